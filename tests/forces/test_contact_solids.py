"""Contact of shapes in space: known normals, distances by search, slopes of the energy, special cases, MuJoCo, rest."""

from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest
from contact_scenes import ELASTIC, STIFF, check_slopes, depth_of, flying, near, state
from judges import differences
from models import IN_C
from mujoco_judge import EDGE, ROUNDED, Distances
from refusals import refuses
from scipy.spatial.transform import Rotation

import eomgen as eg

TURNED = Rotation.from_euler("xyz", (0.4, -0.8, 1.1))
ROD = {"shape": "capsule", "length": 0.4, "radius": 0.05}
SHAPES: dict[str, dict[str, Any]] = {
    "ellipsoid": {"shape": "ellipsoid", "semi_axes": (0.2, 0.1, 0.05)},
    "cuboid": {"shape": "cuboid", "size": (0.4, 0.2, 0.1)},
    "capsule": ROD,
}
ALL = [
    {"shape": "sphere", "radius": 0.12},
    ROD,
    {"shape": "ellipsoid", "semi_axes": (0.2, 0.1, 0.08)},
    {"shape": "cuboid", "size": (0.3, 0.2, 0.12)},
]
#: Place and turn of each of these on its body.
MARKERS = [
    (np.array([0.25 * k - 0.4, 0.02 * k, 0]), Rotation.from_euler("xyz", (0.2 * k, 0.5, -0.3))) for k in range(len(ALL))
]


def every_pair() -> eg.Model:
    """Two bodies that each bear one shape of every kind, beside each other and turned."""
    m, bodies = flying(2)
    groups = [
        [
            {**shape, "on": body.at(*place, rpy=tuple(turn.as_euler("xyz")))}
            for shape, (place, turn) in zip(ALL, MARKERS, strict=True)
        ]
        for body in bodies
    ]
    m.contacts("touch", *groups, {**ELASTIC, "friction": 0.3, "smoothing": 0.01})
    return m


@cache
def on_numbers() -> eg.Module:
    return every_pair().compile(target="numpy")


@cache
def in_c() -> eg.Module:
    return every_pair().compile(optimize=0)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(5))
def test_random_scenes_keep_momenta_and_gain_no_energy(seed: int) -> None:
    """20 scenes of two bodies, each with shapes of all kinds, that are thrown at each other."""
    mod, rng, met = in_c(), np.random.default_rng(seed), 0
    masses, inertia = np.array([1.0, 2.0]), np.array([0.01, 0.012, 0.015])
    for _ in range(20):
        way = rng.standard_normal(3)
        way *= 1.3 / np.linalg.norm(way)
        turns = [Rotation.random(random_state=rng.integers(1 << 30)) for _ in "ab"]
        x = state(mod, [(0, 0, 0), way], turns)
        x[mod.n_q :] = np.concatenate([rng.normal(size=6), -rng.uniform(0.5, 1.5) * way, rng.normal(size=3)])
        run = mod.simulate(1.5, dict(zip(mod.x_names, x, strict=True)), rtol=1e-9, atol=1e-11)
        energy = np.sum(mod.energy(run.x), axis=0)
        assert np.diff(energy).max() < 1e-6 * energy[0]
        met += energy[-1] < (1.0 - 1e-6) * energy[0]
        both = np.zeros((6, len(run.t)))
        for k in range(2):
            q, v = run.x[7 * k : 7 * k + 7], run.x[14 + 6 * k : 20 + 6 * k]
            turn = Rotation.from_quat(q[[4, 5, 6, 3]].T)
            spin = turn.apply(inertia * v[3:].T) + masses[k] * np.cross(q[:3].T, v[:3].T)
            both += np.vstack([masses[k] * v[:3], spin.T])
        assert np.abs(both - both[:, :1]).max() < 1e-8 * np.abs(both).max()
    assert met > 3


def test_every_pair_in_both_targets() -> None:
    """Momentum is kept, forces at rest are slopes of the energy, Jacobians are differences, C gives the numbers."""
    mod, quick = on_numbers(), in_c()
    rng, met = np.random.default_rng(5), 0
    while met < 10:
        turns = [Rotation.random(random_state=rng.integers(1 << 30)) for _ in "ab"]
        x = state(mod, [(0, 0, 0), rng.uniform(-0.4, 0.4, 3)], turns)
        if not 0.1 < quick.energy(x)[1] < 40.0:
            continue
        met += 1
        check_slopes(quick, x)
        x[mod.n_q :] = rng.standard_normal(12)
        force, rates = -mod.bias(0.0, x), mod.rhs(0.0, x)
        assert np.abs(force[:3] + force[6:9]).max() <= 1e-11 * np.abs(force).max()
        np.testing.assert_allclose(quick.rhs(0.0, x), rates, rtol=1e-8, atol=1e-9 * np.abs(rates).max())
        J = quick.jacobian(0.0, x)
        assert np.abs(differences(quick, x) - J).max() <= 1e-4 * np.abs(J).max()
        if met < 3:
            assert np.abs(mod.jacobian(0.0, x) - J).max() <= 1e-8 * np.abs(J).max()


def support(shape: dict[str, Any], n: np.ndarray) -> float:
    """How far a shape reaches along a direction from its centre."""
    if "semi_axes" in shape:
        return float(np.linalg.norm(n * shape["semi_axes"]))
    if "size" in shape:
        return float(np.abs(n) @ shape["size"]) / 2
    return float(shape.get("radius", 0.0) + abs(n[2]) * shape.get("length", 0.0) / 2)


def outside(shape: dict[str, Any], p: np.ndarray) -> float:
    """Above 0 for points out of a shape."""
    if "semi_axes" in shape:
        return float(np.linalg.norm(p / shape["semi_axes"]) - 1.0) * min(shape["semi_axes"])
    if "size" in shape:
        return float((np.abs(p) - np.array(shape["size"]) / 2).max())
    along = np.clip(p[2], -shape.get("length", 0.0) / 2, shape.get("length", 0.0) / 2)
    return float(np.linalg.norm(p - (0, 0, along)) - shape["radius"])


CURVATURE = 0.08**2 / 0.2
#: Depths up to which a pair's answer is the least way out and unique: until axes of capsules cross, and the sum of the
#: least radii of curvature.  Rounded edges that are deeper than their layers have another answer by definition.
DEEP = {
    ("sphere", "sphere"): 0.24, ("sphere", "capsule"): 0.17, ("sphere", "ellipsoid"): 0.12 + CURVATURE,
    ("sphere", "cuboid"): 0.17, ("capsule", "capsule"): 0.1, ("capsule", "ellipsoid"): 0.05 + CURVATURE,
    ("capsule", "cuboid"): 0.05, ("ellipsoid", "ellipsoid"): 2 * CURVATURE, ("ellipsoid", "cuboid"): CURVATURE,
    ("cuboid", "cuboid"): 0.01,
}  # fmt: skip


@pytest.mark.parametrize("pair", DEEP, ids="-".join)
def test_gaps_are_those_of_mujoco(pair: tuple[str, str]) -> None:
    """Apart, grazing and deep: the normal has supports as far apart as the gap, witness points are of the shapes.

    Rounded edges meet by pairs of their own, each with its normal, of which the deepest is the least way out.
    """
    mod, kinds = on_numbers(), [shape["shape"] for shape in ALL]
    numbers = [kinds.index(kind) for kind in pair]
    shapes = [ALL[k] for k in numbers]
    edged = "cuboid" in pair and pair[0] in ("capsule", "cuboid")
    names = [ROUNDED if edged and kind == "cuboid" else kind for kind in pair]
    judge = Distances(names, shapes, EDGE * 0.12 * names.count(ROUNDED))
    gaps = [1e-9, -1e-9, 1e-6, -1e-6, 0.01, *(-part * DEEP[pair] for part in (0.02, 0.2, 0.5, 0.95))]
    met = 0
    for gap, frames, centre in judge.scenes(gaps, 40):
        turns = [frame * MARKERS[k][1].inv() for frame, k in zip(frames, numbers, strict=True)]
        places = [at - turn.apply(MARKERS[k][0]) for at, turn, k in zip((0, centre), turns, numbers, strict=True)]
        found = [one for one in near(mod, state(mod, places, turns)[: mod.n_q]) if one.kinds == pair]
        deepest = max(found, key=lambda one: one.depth)
        assert deepest.depth == pytest.approx(-gap, abs=1e-9)
        met += 1
        if edged:
            continue
        n, half = deepest.normal, 0.5 * deepest.depth * deepest.normal
        reach = support(shapes[0], frames[0].inv().apply(n)) + support(shapes[1], frames[1].inv().apply(-n))
        assert n @ centre - reach == pytest.approx(gap, abs=1e-9)
        witnesses = frames[0].inv().apply(deepest.middle + half), frames[1].inv().apply(deepest.middle - half - centre)
        assert max(outside(shape, p) for shape, p in zip(shapes, witnesses, strict=True)) < 1e-9
    assert met > 20


EGG = {"shape": "ellipsoid", "semi_axes": (0.2, 0.1, 0.08)}
BALL = {"shape": "sphere", "radius": 0.08}
BLOCK = {"shape": "cuboid", "size": (0.3, 0.2, 0.5)}
PAIRS = [
    *((EGG, {**EGG, "semi_axes": (0.15, 0.06, 0.12)}), (EGG, BALL), (EGG, ROD), (ROD, BALL), (ROD, ROD), (BALL, BALL)),
    *((BLOCK, EGG), (BLOCK, BALL)),
    *(pytest.param(*pair, marks=pytest.mark.thorough) for pair in ((ROD, EGG), (EGG, BLOCK))),
]
OWN = Rotation.from_euler("xyz", (0.2, 0.5, -0.3))


def touched(shape: dict[str, Any], n: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A point of a shape with the normal n, in its axes; any of an edge or a face where parts of n are 0."""
    if shape["shape"] == "ellipsoid":
        axes = np.array(shape["semi_axes"])
        return axes**2 * n / np.linalg.norm(axes * n)
    if shape["shape"] == "cuboid":
        return np.where(n != 0, np.sign(n), rng.uniform(-1, 1, 3)) * np.array(shape["size"]) / 2
    along = (np.sign(n[2]) or rng.uniform(-1, 1)) * shape.get("length", 0.0) / 2
    return shape["radius"] * n + np.array([0.0, 0.0, along])


def curvature(shape: dict[str, Any]) -> float:
    """The least radius of curvature, which is 0 of a cuboid."""
    axes = shape.get("semi_axes")
    return float(min(axes) ** 2 / max(axes) if axes else shape.get("radius", 0.0))


@pytest.mark.parametrize(("first", "second"), PAIRS, ids=lambda shape: shape["shape"])
def test_known_normals(first: dict[str, Any], second: dict[str, Any]) -> None:
    """Both are put so that they overlap at points of a chosen normal, in turned frames; middles and ends.

    Depths go nearly up to the sum of the least radii of curvature, to which the least way out is unique.
    """
    m, (a, b) = flying(2)
    m.contacts("touch", {**first, "on": a.at(0.03, 0.01, 0, rpy=(0.2, 0.5, -0.3))}, {**second, "on": b}, ELASTIC)
    mod = m.compile(target="numpy")
    rng = np.random.default_rng(1)
    for k in range(15):
        turns = [Rotation.random(random_state=rng.integers(1 << 30)) for _ in "ab"]
        frame, n = turns[0] * OWN, np.zeros(3)
        free = rng.permutation(3)[: k % 3 + 1] if first is BLOCK else np.arange(3)
        n[free] = rng.standard_normal(len(free))
        middle = second is ROD and k % 3 > 0, first is ROD and k % 3 == 2
        if middle[0]:  # across the second axis, and the first one's as well
            axis = frame.inv().apply(turns[1].apply((0, 0, 1)))
            n = np.cross(axis, (0, 0, 1) if middle[1] else n)
        n /= np.linalg.norm(n)
        out, depth = frame.apply(n), rng.choice((1e-4, 3e-3, 0.95 * (curvature(first) + curvature(second))))
        back = turns[1].inv().apply(-out) * (1, 1, 0 if middle[0] else 1)
        places = frame.apply(touched(first, n, rng)), turns[1].apply(touched(second, back, rng))
        place = turns[0].apply((0.03, 0.01, 0)) + places[0] - places[1] - depth * out
        x = state(mod, [(0, 0, 0), place], turns)
        assert depth_of(mod, x) == pytest.approx(depth, abs=1e-11)
        (record,) = (one for one in near(mod, x[: mod.n_q]) if one.depth > 0.0)
        np.testing.assert_allclose(record.normal, out, atol=1e-9)
        surface = turns[0].apply((0.03, 0.01, 0)) + places[0]
        np.testing.assert_allclose(record.middle, surface - 0.5 * depth * out, atol=1e-9)
        force, push = -mod.bias(0.0, x), STIFF * depth**1.5
        np.testing.assert_allclose(force[6:9], push * out, atol=1e-7 * push)
        assert np.abs(force[:3] + force[6:9]).max() <= 1e-12 * push
        if k < 2:
            check_slopes(mod, x)
            slopes = differences(mod, x)
            assert np.abs(slopes - mod.jacobian(0.0, x)).max() <= 1e-5 * np.abs(slopes).max()
        apart = state(mod, [(0, 0, 0), place + 1.001 * depth * out], turns)
        assert mod.energy(apart)[1] == 0.0


def test_a_run_ends_where_the_nearest_place_is_not_unique() -> None:
    """Ellipsoids deeper than their curvature, a ball in a hollow that is sharper; others keep their energy."""
    hollow = {"shape": "height_field", "height": "2*x**2 + 2*y**2"}
    for first, second, start, told in (
        (EGG, EGG, {"j0_x": 0.41, "j0_y": 0.01, "j0_x_dot": -5.0}, "touch .* ellipsoid .* not unique"),
        (BALL, EGG, {"j0_x": 0.3, "j0_x_dot": -5.0}, ""),
        ({**BALL, "radius": 0.3}, hollow, {"j0_z": 0.4, "j0_z_dot": -1.0, "j0_x": 0.05}, "touch .* sharper"),
        (BALL, hollow, {"j0_z": 0.4, "j0_z_dot": -1.0, "j0_x": 0.05}, ""),
    ):
        m, (body,) = flying(1)
        m.contacts("touch", {**first, "on": body}, {**second, "on": m.ground}, {"stiffness": 1e3})
        mod = m.compile(target="numpy")
        if told:
            with pytest.raises(eg.SimulationError, match=told):
                mod.simulate(0.5, initial=start)
        else:
            energy = np.sum(mod.energy(mod.simulate(0.5, initial=start, rtol=1e-10).x), axis=0)
            assert np.ptp(energy) < 1e-6 * energy[0]


PANCAKE = {"shape": "ellipsoid", "semi_axes": (0.2, 0.2, 0.02)}


@pytest.mark.parametrize(("second", "most"), [(BLOCK, 0.03), (PANCAKE, 0.03), (ROD, 0.06)])
def test_flat_ellipsoids_lie_deep(second: dict[str, Any], most: float) -> None:
    """Along their least axis the energy is the law's up to the depth at which centres come near the other solid."""
    m, (a, b) = flying(2)
    m.contacts("touch", {**PANCAKE, "on": a}, {**second, "on": b}, ELASTIC)
    mod = m.compile(target="numpy")
    turn = Rotation.from_euler("y", np.pi / 2) if second is ROD else Rotation.identity()
    up = support(second, turn.inv().apply((0, 0, 1.0)))
    for depth in (1e-3, 5e-3, 0.5 * most, most):
        x = state(mod, [(0, 0, 0), (0, 0, 0.02 + up - depth)], [Rotation.identity(), turn])
        assert mod.energy(x)[1] == pytest.approx(STIFF * depth**2.5 / 2.5, rel=1e-12)
        assert np.isfinite(mod.rhs(0.0, x)).all()


def test_both_ends_of_a_capsule_across_an_edge() -> None:
    """Two ends and the edge between them touch: each end has the law's energy, forces change continuously there."""
    m, (a, b) = flying(2)
    edge, half, rise = 0.02, 0.025, 0.04
    m.contacts("touch", {**BLOCK, "edge_radius": edge, "on": a}, {**ROD, "length": 2 * half, "on": b}, ELASTIC)
    mod = m.compile(target="numpy")
    out, across = np.array([1, 0, 1]) / np.sqrt(2), np.array([1, 0, -1]) / np.sqrt(2)
    place = (np.array(BLOCK["size"]) / 2 - edge) * (1, 0, 1) + rise * out
    turn = Rotation.align_vectors([across], [(0, 0, 1)])[0]
    sides = [Rotation.from_rotvec((0, way, 0)) * turn for way in (-1e-7, 1e-7)]
    before, after = (-mod.bias(0.0, state(mod, [(0, 0, 0), place], [Rotation.identity(), side])) for side in sides)
    assert np.abs(after - before).max() < 1e-4 * np.abs(before).max()
    deep, end = edge + 0.05 - rise, edge + 0.05 - np.hypot(rise, half)
    wanted = (2 * end**2.5 + (1 - (end / deep) ** 2) ** 2 * deep**2.5) * STIFF / 2.5
    x = state(mod, [(0, 0, 0), place], [Rotation.identity(), turn])
    assert mod.energy(x)[1] == pytest.approx(wanted, rel=1e-9)
    check_slopes(mod, x)


def test_the_force_does_not_jump_where_an_end_becomes_as_deep_as_an_edge() -> None:
    """A capsule turns over an edge of a cuboid until it lies flat on a face, and on."""
    m, (a, b) = flying(2)
    edge, half, rise = 0.02, 0.1, 0.04
    m.contacts("touch", {**BLOCK, "edge_radius": edge, "on": a}, {**ROD, "length": 2 * half, "on": b}, ELASTIC)
    mod, forces = m.compile(target="numpy"), []
    for way in (-1e-7, 1e-7):
        turn = Rotation.from_rotvec((0, np.pi / 4 + way, 0)) * Rotation.from_rotvec((0, 3 * np.pi / 4, 0))
        along = turn.apply((0, 0, 1.0))
        place = (np.array(BLOCK["size"]) / 2 - edge) * (1, 0, 1) + rise / np.sqrt(2) * np.array([1, 0, 1])
        forces.append(-mod.bias(0.0, state(mod, [(0, 0, 0), place + 0.3 * half * along], [Rotation.identity(), turn])))
    assert np.abs(forces[1] - forces[0]).max() < 1e-4 * np.abs(forces[0]).max()


@pytest.mark.parametrize("part", [0.02, 0.5, 0.95])
def test_a_corner_along_a_capsule(part: float) -> None:
    """From its middle over its end the energy is continuous, that of one law at both, and never more."""
    m, (a, b) = flying(2)
    edge = 0.02
    m.contacts("touch", {**BLOCK, "edge_radius": edge, "on": a}, {**ROD, "on": b}, ELASTIC)
    mod = m.compile(target="numpy")
    out, along = np.full(3, 3**-0.5), np.array([1, -1, 0]) / np.sqrt(2)
    depth, corner = part * 2 * edge, np.array(BLOCK["size"]) / 2 - edge
    turn = Rotation.align_vectors([along], [(0, 0, 1)])[0]
    ways = np.linspace(0.0, 0.4, 401)  # the end comes to the corner at 0.2
    states = [
        state(mod, [(0, 0, 0), corner + (edge + 0.05 - depth) * out - way * along], [Rotation.identity(), turn])
        for way in ways
    ]
    energy = np.array([mod.energy(x)[1] for x in states]) / (STIFF * depth**2.5 / 2.5)
    np.testing.assert_allclose(energy[[0, 100, 200]], 1.0, rtol=1e-9)
    assert energy.max() <= 1.0 + 1e-9
    assert energy[:201].min() > 0.9
    assert np.abs(np.diff(energy)).max() < 0.2
    assert energy[-1] == 0.0
    for x in states[195:206:5]:
        check_slopes(mod, x)


NEEDLE, BLADE = ({"shape": "ellipsoid", "semi_axes": axes} for axes in ((0.3, 0.03, 0.03), (0.3, 0.09, 0.03)))


@pytest.mark.parametrize(
    ("first", "second"), [(NEEDLE, NEEDLE), (NEEDLE, PANCAKE), (BLADE, ROD), (BLOCK, NEEDLE)], ids=repr
)
def test_slim_ellipsoids_lie_deep(first: dict[str, Any], second: dict[str, Any]) -> None:
    """Half axes of 10 : 1 at points of known normals, to 0.94 of the depth at which the nearest place is not unique."""
    m, (a, b) = flying(2)
    m.contacts("touch", {**first, "on": a}, {**second, "on": b}, ELASTIC)
    mod, rng = m.compile(target="numpy"), np.random.default_rng(1)

    def unique(shape: dict[str, Any], n: np.ndarray) -> float:
        axes = np.array(shape.get("semi_axes", [shape.get("radius", 0.0)] * 3))
        return float(min(axes) ** 2 / np.linalg.norm(axes * n)) if axes.any() else 0.0

    for k in range(60):
        turns = [Rotation.random(random_state=rng.integers(1 << 30)) for _ in "ab"]
        n = rng.standard_normal(3)
        if first is BLOCK:
            n[[[], [0], [1], [0, 1], [0, 2]][k % 5]] = 0
        if second is ROD:
            n = np.cross(turns[0].inv().apply(turns[1].apply((0, 0, 1))), n)
        out = turns[0].apply(n / np.linalg.norm(n))
        back = turns[1].inv().apply(-out) * (1, 1, 0 if second is ROD else 1)
        depth = (0.5, 0.94)[k % 2] * (unique(first, n / np.linalg.norm(n)) + unique(second, back))
        places = turns[0].apply(touched(first, n / np.linalg.norm(n), rng)), turns[1].apply(touched(second, back, rng))
        x = state(mod, [(0, 0, 0), places[0] - places[1] - depth * out], turns)
        assert depth_of(mod, x) == pytest.approx(depth, abs=1e-11)


def test_parallel_capsules() -> None:
    m, (a, b) = flying(2)
    m.contacts("touch", [{**ROD, "on": a}, {**ROD, "on": b}], law=ELASTIC)
    mod = m.compile(target="numpy")
    for along in (0.0, 0.1, 0.39):
        x = state(mod, [(0, 0, 0), (0.08, 0, along)], [Rotation.identity()] * 2)
        np.testing.assert_allclose(-mod.bias(0.0, x)[6:9], [STIFF * 0.02**1.5, 0, 0], atol=1e-9)
    end = state(mod, [(0, 0, 0), (0.03, 0, 0.44)], [Rotation.identity()] * 2)
    assert depth_of(mod, end) == pytest.approx(0.05, rel=1e-9)


@pytest.mark.parametrize("kind", SHAPES)
def test_depth_on_a_half_space(kind: str) -> None:
    """In turned frames, against the least height of the surface."""
    m, (body,) = flying(1)
    base = m.ground.at(0.1, -0.2, 0.3, rpy=tuple(TURNED.as_euler("xyz")))
    own = Rotation.from_euler("xyz", (0.2, 0.5, -0.3))
    marker = body.at(0.03, 0.01, -0.02, rpy=(0.2, 0.5, -0.3))
    m.contacts("floor", {**SHAPES[kind], "on": marker}, {"shape": "half_space", "on": base}, ELASTIC)
    mod = m.compile(target="numpy")
    rng = np.random.default_rng(6)
    n = TURNED.apply((0, 0, 1))
    for _ in range(12):
        turn = Rotation.random(random_state=rng.integers(1 << 30))
        place = np.array([0.1, -0.2, 0.3]) + rng.uniform(-0.1, 0.1, 3) + 0.05 * n
        centre = place + turn.apply((0.03, 0.01, -0.02))

        def height(local: np.ndarray, turn: Any = turn, centre: Any = centre) -> float:
            return float(n @ (centre + (turn * own).apply(local) - [0.1, -0.2, 0.3]))

        if kind == "ellipsoid":
            local = (turn * own).inv().apply(n) * SHAPES[kind]["semi_axes"]
            gaps = [height(np.zeros(3)) - float(np.linalg.norm(local))]
        elif kind == "cuboid":
            signs = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T
            gaps = [height(s * SHAPES[kind]["size"]) for s in signs]
        else:
            gaps = [height(np.array([0, 0, z])) - 0.05 for z in (-0.2, 0.2)]
        x = state(mod, [place], [turn])
        wanted = sum(STIFF * max(-gap, 0.0) ** 2.5 / 2.5 for gap in gaps)
        assert mod.energy(x)[1] == pytest.approx(wanted, rel=1e-6, abs=1e-12)
        if wanted > 0.1:
            check_slopes(mod, x)


OWN = Rotation.from_euler("xyz", (0.2, 0.5, -0.3))


def test_ellipsoids_of_equal_axes_are_spheres() -> None:
    values = []
    for first, second in (("sphere", "sphere"), ("ellipsoid", "ellipsoid")):
        shapes = [
            {"shape": kind, **({"radius": r} if kind == "sphere" else {"semi_axes": (r, r, r)})}
            for kind, r in ((first, 0.1), (second, 0.06))
        ]
        m, (a, b) = flying(2)
        m.contacts(
            "touch", {**shapes[0], "on": a}, {**shapes[1], "on": b}, {**ELASTIC, "friction": 0.3, "smoothing": 0.01}
        )
        mod = m.compile(target="numpy")
        x = state(mod, [(0, 0, 0), (0.1, 0.05, 0.09)], [OWN, OWN.inv()])
        x[mod.n_q :] = np.linspace(-1, 1, 12)
        together = state(mod, [(0, 0, 0), (0, 0, 0)], [OWN, OWN])
        values.append([*mod.rhs(0.0, x), *mod.rhs(0.0, together)])
    assert np.abs(values[0]).max() > 10.0
    np.testing.assert_allclose(values[1], values[0], rtol=1e-8, atol=1e-8)


def test_a_sphere_about_the_centre_of_an_ellipsoid_leaves_along_its_least_axis() -> None:
    """Also from places on its greatest axis, of which no nearest point is unique."""
    m, (a, b) = flying(2)
    m.contacts("touch", {**EGG, "on": a}, {"shape": "sphere", "radius": 0.02, "on": b}, ELASTIC)
    mod = m.compile(target="numpy")
    for place, depth in (((0, 0, 0), 0.1), ((0, 0, 0.01), 0.09), ((0, 0, -0.01), 0.09), ((0.05, 0, 0), None)):
        x = state(mod, [(0, 0, 0), place], [Rotation.identity()] * 2)
        force = -mod.bias(0.0, x)
        assert np.isfinite(mod.jacobian(0.0, x)).all()
        if depth is not None:
            np.testing.assert_allclose(np.abs(force[6:9]), [0, 0, 2e4 * depth**1.5], rtol=1e-4, atol=1e-6)
            assert force[8] * (place[2] or 1.0) > 0
        else:  # nearest points of the section y = 0 of half axes A and c: x A^2 / (A^2 - c^2) along x
            at = 0.05 * 0.2**2 / (0.2**2 - 0.08**2)
            up = 0.08 * np.sqrt(1 - (at / 0.2) ** 2)
            wanted = 0.02 + np.hypot(at - 0.05, up)
            assert depth_of(mod, x) == pytest.approx(wanted, rel=1e-4)


BLOCKS = [{"shape": "cuboid", "size": (0.4, 0.2, 0.1)}, {"shape": "cuboid", "size": (0.15, 0.3, 0.2)}]
FIRM = 1e5
SOFT = {"stiffness": FIRM, "exponent": 1, "dissipation": 20.0, "friction": 0.5, "smoothing": 1e-3}


def pile(sizes: Any, law: Any, **more: Any) -> eg.Model:
    """Cuboids of 1000 kg/m^3 above ground."""
    m = eg.Model("pile", gravity=(0, 0, -9.81))
    bodies = []
    for k, size in enumerate(sizes):
        mass = 1000 * np.prod(size)
        x, y, z = (mass / 12 * side**2 for side in size)
        bodies.append(m.body(f"b{k}", mass=mass, inertia=(y + z, x + z, x + y)))
        m.free(f"j{k}", m.ground, bodies[-1], rotation="euler_parameters")
    shapes = [{"shape": "cuboid", "size": size, "on": b, **more} for size, b in zip(sizes, bodies, strict=True)]
    m.contacts("floor", shapes, {"shape": "half_space", "on": m.ground}, law)
    m.contacts("heap", shapes, law=law)
    return m


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("sizes", "places"),
    [([(0.2, 0.3, 0.1), (0.3, 0.1, 0.2)], 4), ([(0.2, 0.2, 0.2)] * 2, 8), ([(0.3, 0.3, 0.2), (0.2, 0.2, 0.2)], 4)],
)
def test_flush_cuboids_rest_on_corners(sizes: Any, places: int) -> None:
    """The upper one sinks m g / (n k): its four corners and, where they lie on corners, those of the lower one.

    Of two that cross like planks each of four crossed edges carries a part.
    """
    mod = pile(sizes, SOFT).compile(optimize=0)
    height = sizes[0][2] + 0.5 * sizes[1][2]
    start = {"j0_z": 0.5 * sizes[0][2], "j1_z": height}
    traj = mod.simulate(1.0, initial=start, method="Radau", rtol=1e-9, atol=1e-11)
    both, upper = (1000 * 9.81 * sum(np.prod(size) for size in sizes[k:]) for k in (0, 1))
    sunk = 0.5 * sizes[0][2] - both / (4 * FIRM)
    assert traj["j0_z"][-1] == pytest.approx(sunk, abs=2e-6)
    gap = traj["j1_z"][-1] - traj["j0_z"][-1] - 0.5 * (sizes[0][2] + sizes[1][2])
    assert gap == pytest.approx(-upper / (places * FIRM), rel=1e-2)
    still = [traj[name][-1] for name in ("j0_x", "j0_y", "j1_x", "j1_y", "j1_wx", "j1_wy", "j1_wz")]
    assert np.abs(still).max() < 1e-9


def test_crossed_edges_carry_a_cuboid() -> None:
    """Two cubes turned by 45 degrees about x and about y: edge on edge, at the distance of rounded edges."""
    m, (a, b) = flying(2)
    cube = {"shape": "cuboid", "size": (0.2, 0.2, 0.2), "edge_radius": 0.01}
    m.contacts("touch", {**cube, "on": a}, {**cube, "on": b}, ELASTIC)
    mod = m.compile(target="numpy")
    inner = 0.09 * np.sqrt(2)  # to the centre line of a rounded edge
    turns = [Rotation.from_euler("x", np.pi / 4), Rotation.from_euler("y", np.pi / 4)]
    for depth in (1e-3, 4e-3):
        x = state(mod, [(0, 0, 0), (0.01, -0.02, 2 * inner + 0.02 - depth)], turns)
        assert depth_of(mod, x) == pytest.approx(depth, rel=1e-9)
        force = -mod.bias(0.0, x)
        assert force[8] == pytest.approx(2e4 * depth**1.5, rel=1e-9)


@pytest.mark.parametrize("shift", [0.08, 0.12])
def test_rigid_stacks_stand_or_fall_as_in_mujoco(shift: float) -> None:
    """The upper of two cubes of 0.2 m beyond the edge by less or more than half."""
    world = "".join(
        f'<body pos="{k * shift} 0 {0.1 + 0.2 * k}"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="8"/></body>'
        for k in range(2)
    )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="1e-3"/><worldbody><geom type="plane" size="5 5 1"/>{world}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    for _ in range(600):
        mujoco.mj_step(model, data)
    mod = pile([(0.2, 0.2, 0.2)] * 2, {"normal_law": "rigid", "friction": 1.0}).compile(**IN_C)
    start = {"j0_z": 0.1, "j1_z": 0.3, "j1_x": shift}
    traj = mod.simulate(0.6, initial=start, method="moreau", step=2e-3)
    falls = data.qpos[9] < 0.29
    assert falls == (shift > 0.1)
    assert (traj["j1_z"][-1] < 0.29) == falls
    if not falls:
        np.testing.assert_allclose([traj["j0_z"][-1], traj["j1_z"][-1]], [0.1, 0.3], atol=1e-9)
        np.testing.assert_allclose(data.qpos[[2, 9]], [0.1, 0.3], atol=2e-3)


def test_bristles_between_edges_are_refused() -> None:
    m, (a, b) = flying(2)
    law = {"stiffness": 1e4, "friction": 0.5, "friction_law": "lugre", "bristle_stiffness": 1e3, "bristle_damping": 1.0}
    m.contacts("touch", {**BLOCKS[0], "on": a}, {**BLOCKS[1], "on": b}, law)
    refuses("EG-CONFLICT contacts.touch.law.friction_law", m.derive)
