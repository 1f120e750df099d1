"""Contact of shapes in space: distances by brute force, forces as slopes of the energy, runs without loss."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from flying_bodies import ELASTIC, STIFF, check_slopes, depth_of, flying, state
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import eomgen as eg
from eomgen.errors import ModelError

TURNED = Rotation.from_euler("xyz", (0.4, -0.8, 1.1))
ROD = {"shape": "capsule", "length": 0.4, "radius": 0.05}
SHAPES: dict[str, dict[str, Any]] = {
    "ellipsoid": {"shape": "ellipsoid", "semi_axes": (0.2, 0.1, 0.05)},
    "cuboid": {"shape": "cuboid", "size": (0.4, 0.2, 0.1)},
    "capsule": ROD,
}


def test_two_capsules_against_a_minimum() -> None:
    """The depth from the least distance of the segments that SciPy finds; force and moment by virtual work."""
    m, (a, b) = flying(2)
    frame = {"rpy": (0.3, 0.2, -0.5)}
    m.contacts(
        "touch", {**ROD, "on": a.at(0.02, 0, 0.01, **frame)}, {**ROD, "on": b, "length": 0.3, "radius": 0.04}, ELASTIC
    )
    mod = m.compile(target="numpy")
    rng, met = np.random.default_rng(2), {"middle": 0, "end": 0}
    own = Rotation.from_euler("xyz", frame["rpy"])
    for _ in range(150):
        turns = Rotation.random(2, random_state=rng.integers(1 << 30))
        places = [np.zeros(3), rng.uniform(-0.2, 0.2, 3)]
        x = state(mod, places, turns)
        middle = turns[0].apply((0.02, 0, 0.01))
        p, q = (turns[0] * own).apply((0, 0, 1)), turns[1].apply((0, 0, 1))

        def away(s: np.ndarray, p: Any = p, q: Any = q, middle: Any = middle, places: Any = places) -> float:
            return float(np.sum((middle + s[0] * p - places[1] - s[1] * q) ** 2))

        best = minimize(away, (0.0, 0.0), bounds=((-0.2, 0.2), (-0.15, 0.15)), options={"ftol": 1e-15, "gtol": 1e-12})
        depth = 0.09 - np.sqrt(best.fun)
        if depth < 2e-3 or best.fun < 1e-4:
            continue
        inside = abs(best.x[0]) < 0.19 and abs(best.x[1]) < 0.14
        met["middle" if inside else "end"] += 1
        assert depth_of(mod, x) == pytest.approx(depth, rel=1e-4)
        force = -mod.bias(0.0, x)
        assert np.abs(force[:3] + force[6:9]).max() <= 1e-10 * np.abs(force).max()
        if sum(met.values()) < 15:
            check_slopes(mod, x)
    assert min(met.values()) > 5


def test_parallel_capsules() -> None:
    m, (a, b) = flying(2)
    m.contacts("touch", [{**ROD, "on": a}, {**ROD, "on": b}], law=ELASTIC)
    for target in ("numpy", "cython"):
        mod = m.compile(target=target)
        for along in (0.0, 0.1, 0.39):
            x = state(mod, [(0, 0, 0), (0.08, 0, along)], [TURNED, TURNED] if along < 0 else [Rotation.identity()] * 2)
            force = -mod.bias(0.0, x)
            np.testing.assert_allclose(force[6:9], [STIFF * 0.02**1.5, 0, 0], atol=1e-9)
        end = state(mod, [(0, 0, 0), (0.03, 0, 0.44)], [Rotation.identity()] * 2)
        assert depth_of(mod, end) == pytest.approx(0.05, rel=1e-9)


@pytest.mark.parametrize("kind", SHAPES)
def test_depth_on_a_half_space(kind: str) -> None:
    """In turned frames, against the least height of points of the surface."""
    m, (body,) = flying(1)
    base = m.ground.at(0.1, -0.2, 0.3, rpy=tuple(TURNED.as_euler("xyz")))
    own = Rotation.from_euler("xyz", (0.2, 0.5, -0.3))
    marker = body.at(0.03, 0.01, -0.02, rpy=(0.2, 0.5, -0.3))
    m.contacts("floor", {**SHAPES[kind], "on": marker}, {"shape": "half_space", "on": base}, ELASTIC)
    mods = [m.compile(target=target) for target in ("numpy", "cython")]
    rng = np.random.default_rng(6)
    n = TURNED.apply((0, 0, 1))
    for _ in range(12):
        turn = Rotation.random(random_state=rng.integers(1 << 30))
        place = np.array([0.1, -0.2, 0.3]) + rng.uniform(-0.1, 0.1, 3) + 0.05 * n
        centre = place + turn.apply((0.03, 0.01, -0.02))

        def height(local: np.ndarray, turn: Any = turn, centre: Any = centre) -> float:
            return float(n @ (centre + (turn * own).apply(local) - [0.1, -0.2, 0.3]))

        if kind == "ellipsoid":
            axes = np.array(SHAPES[kind]["semi_axes"])

            def of_angles(s: np.ndarray, axes: Any = axes, height: Any = height) -> float:
                round_ = np.array([np.cos(s[0]) * np.sin(s[1]), np.sin(s[0]) * np.sin(s[1]), np.cos(s[1])])
                return float(height(axes * round_))

            starts = [(a, b) for a in (0.3, 2.0, 4.0) for b in (0.7, 1.6, 2.5)]
            gaps = [min(minimize(of_angles, s, options={"gtol": 1e-11}).fun for s in starts)]
        elif kind == "cuboid":
            signs = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T
            gaps = [height(s * SHAPES[kind]["size"]) for s in signs]
        else:
            gaps = [height(np.array([0, 0, z])) - 0.05 for z in (-0.2, 0.2)]
        x = state(mods[0], [place], [turn])
        wanted = sum(STIFF * max(-gap, 0.0) ** 2.5 / 2.5 for gap in gaps)
        for mod in mods:
            assert mod.energy(x)[1] == pytest.approx(wanted, rel=1e-6, abs=1e-12)
        if wanted > 0.1:
            check_slopes(mods[0], x)
            found, judged = (mod.jacobian(0.0, x) for mod in mods)
            assert np.abs(found - judged).max() <= 1e-10 * np.abs(judged).max()


@pytest.mark.parametrize("kind", [*SHAPES, "two capsules"])
def test_lossless_runs_keep_their_energy(kind: str) -> None:
    if kind == "two capsules":
        m, bodies = flying(2)
        m.contacts("touch", [{**ROD, "on": body} for body in bodies], law=ELASTIC)
        start = {"j1_x": 0.25, "j1_y": 0.02, "j1_z": 0.05, "j1_x_dot": -1.5, "j1_wy": 2.0, "j0_wx": 3.0, "j0_wy": -1.0}
    else:
        m, bodies = flying(1, (0, 0, -9.81))
        m.contacts("floor", {**SHAPES[kind], "on": bodies[0]}, {"shape": "half_space", "on": m.ground}, ELASTIC)
        start = {"j0_z": 0.3, "j0_wx": 3.0, "j0_wy": 2.0, "j0_x_dot": 0.5}
    mod = m.compile()
    traj = mod.simulate(0.8, initial=start, rtol=1e-10, atol=1e-12, max_step=2e-3)
    energy = np.sum(mod.energy(traj.x), axis=0)
    assert np.ptp(energy) < 1e-6 * np.abs(energy).max()
    assert np.abs(traj.x[mod.n_q + 2] - traj.x[mod.n_q + 2, 0]).max() > 0.1 or kind == "two capsules"
    touched = mod.energy(traj.x)[1].max() if kind == "two capsules" else 1.0
    assert touched > 1e-3


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"shape": "ellipsoid", "semi_axes": (1, 2)}, "three numbers"),
        ({"shape": "ellipsoid", "semi_axes": (1, 2, -1)}, r"semi_axes\[2\]: is -1; must be greater than 0"),
        ({"shape": "cuboid", "size": (1, 0, 1)}, r"size\[1\]: is 0; must be greater than 0"),
        ({"shape": "cuboid"}, "size: is missing"),
    ],
)
def test_what_is_wrong_with_a_shape_is_told(given: dict[str, Any], told: str) -> None:
    m, (body,) = flying(1)
    m.contacts("floor", {**given, "on": body}, {"shape": "half_space", "on": m.ground}, ELASTIC)
    with pytest.raises(ModelError, match=told):
        m.mechanism()


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("kind", ["ellipsoid", "cuboid"])
def test_a_sphere_on_a_closed_solid(kind: str, swapped: bool) -> None:
    """In turned frames, against the least distance of points of the solid; momentum, slopes, both targets."""
    m, (a, b) = flying(2)
    own = Rotation.from_euler("xyz", (0.2, 0.5, -0.3))
    groups = [
        {**SHAPES[kind], "on": a.at(0.03, 0.01, -0.02, rpy=(0.2, 0.5, -0.3))},
        {"shape": "sphere", "on": b.at(0.01, 0, 0), "radius": 0.08},
    ]
    m.contacts("touch", *(groups[::-1] if swapped else groups), ELASTIC)
    mods = [m.compile(target=target) for target in ("numpy", "cython")]
    rng, met = np.random.default_rng(8), 0
    sizes = np.array(SHAPES[kind].get("semi_axes", 0.5 * np.array(SHAPES["cuboid"]["size"])))
    for _ in range(60):
        turns = [Rotation.random(random_state=rng.integers(1 << 30)) for _ in "ab"]
        way = rng.standard_normal(3)
        local = sizes * way / np.linalg.norm(way / (1 if kind == "ellipsoid" else 0.6))
        centre = local + rng.uniform(0.0, 0.08) * way / np.linalg.norm(way)

        def square(s: np.ndarray, centre: Any = centre) -> float:
            if kind == "cuboid":
                return float(((s - centre) ** 2).sum())
            u = np.array([np.cos(s[0]) * np.sin(s[1]), np.sin(s[0]) * np.sin(s[1]), np.cos(s[1])])
            return float(((sizes * u - centre) ** 2).sum())

        if kind == "cuboid":
            if (np.abs(centre) < sizes).all():
                continue
            found = [minimize(square, np.zeros(3), bounds=[(-x, x) for x in sizes], tol=1e-16).fun]
        else:
            if ((centre / sizes) ** 2).sum() < 1:
                continue
            starts = [(x, y) for x in (0.3, 2.0, 4.0, 5.5) for y in (0.7, 1.6, 2.5)]
            found = [minimize(square, s, options={"gtol": 1e-12}).fun for s in starts]
        depth = 0.08 - np.sqrt(min(found))
        frame = turns[0] * own
        place = turns[0].apply((0.03, 0.01, -0.02)) + frame.apply(centre) - turns[1].apply((0.01, 0, 0))
        x = state(mods[0], [(0, 0, 0), place], turns)
        if depth < 2e-3:
            continue
        met += 1
        for mod in mods:
            assert depth_of(mod, x) == pytest.approx(depth, abs=2e-7)
        force = -mods[0].bias(0.0, x)
        if met <= 5:
            check_slopes(mods[0], x)
            one, other = (mod.jacobian(0.0, x) for mod in mods)
            assert np.abs(one - other).max() <= 1e-9 * np.abs(other).max()
        assert np.abs(force[:3] + force[6:9]).max() <= 1e-12 * np.abs(force).max()
    assert met >= 12


def test_an_ellipsoid_of_equal_axes_is_a_sphere_and_a_flat_cuboid_a_plane() -> None:
    places = [((0.0, 0.0, 0.0), (0.1, 0.05, 0.09)), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.14))]
    values = []
    for shape in ({"shape": "sphere", "radius": 0.1}, {"shape": "ellipsoid", "semi_axes": (0.1, 0.1, 0.1)}):
        m, (a, b) = flying(2)
        m.contacts("touch", {**shape, "on": a}, {"shape": "sphere", "on": b, "radius": 0.06}, ELASTIC)
        mod = m.compile(target="numpy")
        values.append([mod.bias(0.0, state(mod, place, [TURNED, TURNED])) for place in places])
    np.testing.assert_allclose(values[1], values[0], rtol=1e-10, atol=1e-9)
    assert np.abs(values[0]).max() > 1.0
    flat, deep = [], []
    for first in ({"shape": "cuboid", "size": (4, 4, 1)}, {"shape": "half_space"}):
        m, (b,) = flying(1)
        base = m.ground.at(0, 0, -0.5 if first["shape"] == "cuboid" else 0)
        m.contacts("touch", {**first, "on": base}, {"shape": "sphere", "on": b, "radius": 0.06}, ELASTIC)
        mod = m.compile(target="numpy")
        flat.append(mod.bias(0.0, state(mod, [(0.3, 0.2, 0.05)], [TURNED])))
        deep.append(mod.bias(0.0, state(mod, [(0.3, 0.2, -0.05)], [TURNED])))
    np.testing.assert_allclose(flat[0], flat[1], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(deep[0], deep[1], rtol=1e-10, atol=1e-12)


def test_solids_are_drawn_and_verified(tmp_path: Any) -> None:
    m, bodies = flying(3, (0, 0, -9.81))
    group = [{**shape, "on": body} for shape, body in zip(SHAPES.values(), bodies, strict=True)]
    m.contacts("floor", group, {"shape": "half_space", "on": m.ground}, ELASTIC)
    m.initial(j0_z=0.04, j1_x=1.0, j1_z=0.04, j2_x=2.0, j2_z=0.2)
    mod = m.compile(target="numpy")
    file = tmp_path / "solids.yaml"
    file.write_text(m.to_yaml())
    assert np.array_equal(eg.load(file).compile(target="numpy").rhs(0.0, mod.x0()), mod.rhs(0.0, mod.x0()))
    drawn = m.mechanism().forces[0].drawn()
    assert len(drawn) == 3 + 4 + 1 + 1  # ellipses, edges, the line of a capsule, the plane
    report = mod.verify()
    assert report.ok, report
