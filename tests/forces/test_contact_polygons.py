"""Polygons on polygons in the plane: flush edges, corners, energy, rigid stacks, beside MuJoCo."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import contact_scenes as scenes
import mujoco
import numpy as np
import pytest
from sweeps import part_of

import eomgen as eg

G, MASS, HIGH, STIFF = 9.81, 1.5, 0.1, 1e5
SOFT = {"stiffness": STIFF, "exponent": 1, "dissipation": 5.0, "friction": 0.5, "smoothing": 1e-3}
RIGID = {"normal_law": "rigid", "friction": 0.5}


def box(wide: float, corners: int = 4) -> dict[str, Any]:
    """A box, or the same as a polygon with more corners on its upper edge, a little higher in the middle."""
    if corners == 4:
        return {"shape": "box", "size": (wide, HIGH)}
    x, y = wide / 2, HIGH / 2
    return {"shape": "polygon", "points": [(-x, -y), (x, -y), (x, y), (0, y + 1e-3), (-x, y)]}


def tower(shapes: Any, law: Any, turn: float = 0.0, swapped: bool = False, target: str = "cython") -> Any:
    """Bodies on each other on a floor, all turned by an angle, gravity too."""
    c, s = np.cos(turn), np.sin(turn)
    m = eg.Model("tower", gravity=(G * s, -G * c, 0))
    base = m.ground.at(0, 0, 0, rpy=(0, 0, turn))
    bodies = [m.body(f"b{k}", mass=MASS, inertia={"zz": 0.01}) for k in range(len(shapes))]
    for k, body in enumerate(bodies):
        m.planar(f"j{k}", base, body)
        m.initial({f"j{k}_y": (k + 0.5) * HIGH})
    group = [{**shape, "on": body} for shape, body in zip(shapes, bodies, strict=True)]
    m.contacts("floor", group[0], {"shape": "half_plane", "on": base}, law)
    for k in range(len(group) - 1):
        pair = group[k : k + 2]
        m.contacts(f"c{k}", *(pair[::-1] if swapped else pair), law)
    return m.compile(target=target)


WIDTHS = [(0.2, 0.2, 0.2), (0.2, 0.1, 0.1), (0.1, 0.2, 0.05)]


STACKS = [(widths, turn, swapped) for widths in WIDTHS for turn in (0.0, 0.7) for swapped in (False, True)]
SOME = [(WIDTHS[0], 0.0, False), (WIDTHS[1], 0.7, True), (WIDTHS[2], 0.7, False)]


@pytest.mark.parametrize(("widths", "turn", "swapped"), part_of(STACKS, SOME.__contains__))
def test_flush_stacks_rest(widths: tuple[float, ...], turn: float, swapped: bool) -> None:
    """Each of two places of contact carries half of what lies above: d = m g / (2 k)."""
    mod = tower([box(wide) for wide in widths], SOFT, turn, swapped)
    run = mod.simulate((0, 2), method="Radau", rtol=1e-8, atol=1e-11)
    heights = np.array([run[f"j{k}_y"][-1] for k in range(3)])
    sunk = MASS * G * np.array([3, 2, 1]) / (2 * STIFF)
    wanted = (np.arange(3) + 0.5) * HIGH - np.cumsum(sunk)
    np.testing.assert_allclose(heights, wanted, atol=1e-8)
    for k in range(3):
        assert abs(run[f"j{k}_3"][-1]) < 1e-9
        assert np.abs(run[f"j{k}_x"]).max() < 1e-8


HELD = [(widths, target) for widths in WIDTHS for target in ("numpy", "cython")]


@pytest.mark.parametrize(("widths", "target"), part_of(HELD, lambda x: (x[1] == "cython") == (x[0] == WIDTHS[1])))
def test_flush_stacks_are_held_rigidly(widths: tuple[float, ...], target: str) -> None:
    mod = tower([box(wide) for wide in widths], RIGID, 0.3, False, target)
    run = mod.simulate(0.2, method="moreau", step=1e-3)
    for k in range(3):
        assert np.abs(run[f"j{k}_y"] - (k + 0.5) * HIGH).max() < 1e-9
        assert np.abs(run[f"j{k}_x"]).max() < 1e-9
        assert np.abs(run[f"j{k}_3"]).max() < 1e-9


def test_polygons_of_other_numbers_of_corners_stand_on_each_other() -> None:
    """In one group, of which pairs are met once."""
    m = eg.Model("mixed", gravity=(0, -G, 0))
    bodies = [m.body(f"b{k}", mass=MASS, inertia={"zz": 0.01}) for k in range(3)]
    group = [{**box(0.2, 4 + k % 2), "on": body} for k, body in enumerate(bodies)]
    group[1]["on"] = bodies[1].at(0, 0, 0, rpy=(0, 0, np.pi))  # the tip hangs down
    for k, body in enumerate(bodies):
        m.planar(f"j{k}", m.ground, body)
        m.initial({f"j{k}_y": (k + 0.5) * HIGH + 1e-3 * (k > 0), f"j{k}_3": 0.0})
    m.contacts("floor", group, {"shape": "half_plane", "on": m.ground}, SOFT)
    m.contacts("among", group, law=SOFT)
    mod = m.compile(target="numpy")
    x = mod.x0(j0_y=HIGH / 2 - 1e-4, j1_y=1.5 * HIGH + 1e-3 - 2e-4, j2_y=2.5 * HIGH + 1e-3 - 3e-4)
    force = -mod.bias(0.0, x)
    weights = np.array([0.0, -MASS * G, 0.0] * 3)
    pushed = force + 0.0 * weights
    # floor: two corners; tip in the lower box: one place; flat edges above: two
    wanted = [2 - 1, 1 - 2, 2]
    np.testing.assert_allclose(pushed[[1, 4, 7]] + MASS * G, np.multiply(wanted, STIFF * 1e-4), rtol=1e-9)


def test_a_corner_stands_on_a_side_and_beside_a_corner() -> None:
    """k d against the side, at the corner; the same where the side ends just beside."""
    mod = tower([box(0.2), box(0.1)], {"stiffness": STIFF, "exponent": 1}, target="numpy")
    half = np.hypot(0.05, 0.05)
    d = 1e-4
    for x in (0.0, 0.05, 0.0999, -0.0998):
        state = mod.x0(j0_y=0.05, j1_x=x, j1_y=0.1 + half - d, j1_3=np.pi / 4)
        force = -mod.bias(0.0, state) + [0, MASS * G, 0] * 2
        if abs(x) < 0.09:
            np.testing.assert_allclose(force[3:6], [0, STIFF * d, 0], atol=1e-7)
            np.testing.assert_allclose(force[:3], [0, -STIFF * d, -STIFF * d * x], atol=1e-7)
        assert np.all(np.isfinite(force))
        assert force[4] > 0.0


def test_force_is_continuous_where_corners_change_places() -> None:
    """A tilted box slides over the end of another: the force jumps by no more than its tilt turns it."""
    mod = tower([box(0.2), box(0.2)], {"stiffness": STIFF, "exponent": 1.5}, target="numpy")
    tilt = 1e-3
    places = np.linspace(-0.02, 0.02, 401)
    states = np.array([mod.x0(j0_y=0.05, j1_x=x, j1_y=0.15 - 4e-4, j1_3=tilt) for x in places]).T
    forces = -mod.bias(0.0, np.ascontiguousarray(states))
    jumps = np.abs(np.diff(forces, axis=1)).max(axis=1)
    size = np.abs(forces[4]).max()
    assert jumps[4] < 0.02 * size
    assert jumps[3] < 1.5 * tilt * size
    energy = mod.energy(np.ascontiguousarray(states))[1]
    assert np.abs(np.diff(energy, 2)).max() < 1e-3 * energy.max()


def test_energy_is_kept_where_boxes_tumble() -> None:
    """Without loss, in frames turned against each other: thrown boxes and triangles keep their energy."""
    for seed in range(2):
        rng = np.random.default_rng(seed)
        m, bodies = scenes.planar(f"tumble{seed}", 3, (0, 0, 0))
        group = [
            {**scenes.PLANAR[kind], "on": body.at(0, 0, 0, rpy=(0, 0, turn))}
            for kind, body, turn in zip(("box", "polygon", "box"), bodies, rng.uniform(-3, 3, 3), strict=True)
        ]
        m.contacts("among", group, law={"stiffness": 1e6, "exponent": 1.5})
        mod = m.compile()
        start = {}
        for k in range(3):
            way = 2 * np.pi * k / 3
            start |= {f"j{k}_x": 0.35 * np.cos(way), f"j{k}_y": 0.35 * np.sin(way), f"j{k}_3": rng.uniform(-3, 3)}
            start |= {f"j{k}_x_dot": -np.cos(way), f"j{k}_y_dot": -np.sin(way), f"j{k}_3_dot": rng.uniform(-5, 5)}
        run = mod.simulate((0, 1), initial=start, rtol=1e-9, atol=1e-11)
        energy = np.sum(mod.energy(run.x), axis=0)
        assert mod.energy(run.x)[1].max() > 0.1
        assert np.abs(energy / energy[0] - 1).max() < 1e-4, seed


def test_a_stack_rests_as_in_mujoco() -> None:
    """A box on a narrower one beside its middle: heights, and no tilt but what the stiffness gives."""
    wide, mass = (0.2, 0.1), MASS
    aside = 0.01
    xml = f"""<mujoco><option timestep="1e-4" cone="elliptic" iterations="100" tolerance="1e-12"/>
    <default><geom solref="0.002 1" solimp="0.99 0.999 0.0001" friction="0.5 0 0"/></default><worldbody>
    <geom type="plane" size="5 5 1"/>
    <body pos="0 0 0.05"><freejoint/><geom type="box" size="0.1 0.1 0.05" mass="{mass}"/></body>
    <body pos="{aside} 0 0.15"><freejoint/><geom type="box" size="0.05 0.1 0.05" mass="{mass}"/></body>
    </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    for _ in range(5000):
        mujoco.mj_step(model, data)
    mod = tower([box(wide[0]), box(wide[1])], SOFT)
    run = mod.simulate((0, 1), initial={"j1_x": aside}, method="Radau", rtol=1e-8, atol=1e-11)
    found = [data.qpos[0], data.qpos[2], data.qpos[7], data.qpos[9]]
    ours = [run[name][-1] for name in ("j0_x", "j0_y", "j1_x", "j1_y")]
    np.testing.assert_allclose(ours, found, atol=3e-4)
    # forces of rest: of the upper box its weight, and the moment about the lower one's middle
    x = run.x[:, -1]
    force = -mod.bias(0.0, x) + [0, mass * G, 0] * 2
    np.testing.assert_allclose(force[[1, 4]], [mass * G, mass * G], rtol=1e-5)


#: Pairs of corners, of which the second is acute, obtuse, as wide as the first, nearly flat, or has several edges.
PAIRS: dict[str, tuple[Any, Any]] = {
    "wedge": ([(0, 0), (0.12, 0.4), (-0.12, 0.4)], scenes.rectangle(0.3, 0.1)),
    "needles": ([(0.2, 0.0), (-0.1, 0.05), (-0.1, -0.03)], [(0.2, -0.1), (0.1, 0.15), (-0.2, -0.1)]),
    "equal": (scenes.rectangle(0.2, 0.1), scenes.rectangle(0.2, 0.1)),
    "narrow": (scenes.rectangle(0.05, 0.1), scenes.rectangle(0.4, 0.02)),
    "obtuse": ([(-0.1, -0.05), (0, -0.06), (0.1, -0.05), (0.1, 0.05), (-0.1, 0.05)], scenes.rectangle(0.2, 0.1)),
    "rounds": (scenes.regular(9, 0.1), scenes.regular(7, 0.12)),
}


def touching(name: str, law: Any, swapped: bool = False, target: str = "numpy") -> Any:
    """Two bodies of a pair of shapes, without gravity."""
    m, bodies = scenes.planar(name, 2, (0, 0, 0))
    group = [{"shape": "polygon", "points": list(p), "on": b} for p, b in zip(PAIRS[name], bodies, strict=True)]
    m.contacts("c", *(group[::-1] if swapped else group), law)
    return m.compile(target=target)


def poses(name: str, rng: np.random.Generator, count: int) -> Iterator[tuple[np.ndarray, float]]:
    """The second body in the first by some depth, near flush or not; of each second pose a corner in a corner."""
    first, second = (np.array(points) for points in PAIRS[name])
    ways = [np.arctan2(*(q - p)) for one in (first, second) for p, q in zip(one, np.roll(one, -1, 0), strict=True)]
    while count:
        turn = rng.choice([rng.uniform(-3, 3), rng.choice(ways) - rng.choice(ways) + np.pi * rng.integers(2)])
        turn += rng.choice([0.0, 1e-3, 0.1]) * rng.standard_normal()
        way, depth = rng.uniform(-np.pi, np.pi), 10 ** rng.uniform(-4, -1.7)
        if count % 2:
            corner = scenes.placed([0, 0, turn], second[rng.integers(len(second))])
            place = first[rng.integers(len(first))] - corner + 2 * depth * np.array([np.cos(way), np.sin(way)])
        else:
            low, high = 0.0, 1.0
            for _ in range(30):
                middle = (low + high) / 2
                outline = scenes.placed([middle * np.cos(way), middle * np.sin(way), turn], second)
                low, high = (middle, high) if scenes.facing(first, outline)[0][0] > depth else (low, middle)
            place = low * np.array([np.cos(way), np.sin(way)])
        if 0.0 < scenes.facing(first, scenes.placed([*place, turn], second))[0][0] < 0.03:
            count -= 1
            yield np.array([0, 0, 0, *place, turn]), depth


def states(q: np.ndarray) -> np.ndarray:
    """States at rest, one a column."""
    return np.ascontiguousarray(np.concatenate([q.T, np.zeros((6, len(q)))]))


@pytest.mark.parametrize("name", PAIRS)
def test_energy_is_continuous(name: str) -> None:
    """Along random ways of the size of the depth: what changes most between two places is bisected."""
    mod, swapped = (touching(name, {"stiffness": 1e7, "exponent": 1.5}, order) for order in (False, True))
    rng = np.random.default_rng(11)
    starts, ends, most = [], [], []
    for q, depth in poses(name, rng, 120):
        step = np.concatenate([np.zeros(3), rng.standard_normal(2), rng.choice([0, 10]) * rng.standard_normal(1)])
        line = q + np.linspace(-2, 2, 129)[:, None] * depth * step * rng.choice([0.1, 1.0])
        energy = mod.energy(states(line))[1]
        np.testing.assert_allclose(swapped.energy(states(line))[1], energy, rtol=1e-7, atol=1e-9 * energy.max())
        for k in np.argsort(np.abs(np.diff(energy)))[-2:]:
            starts.append(line[k])
            ends.append(line[k + 1])
            most.append(energy.max())
    low, high = np.array(starts), np.array(ends)
    for _ in range(36):
        middle = (low + high) / 2
        a, b, c = (mod.energy(states(q))[1] for q in (low, middle, high))
        upper = (np.abs(b - a) < np.abs(c - b))[:, None]
        low, high = np.where(upper, middle, low), np.where(upper, high, middle)
    jumps = np.abs(mod.energy(states(high))[1] - mod.energy(states(low))[1])
    assert np.all(jumps < 1e-7 * np.array(most))


@pytest.mark.parametrize("name", PAIRS)
def test_forces_are_slopes_of_the_energy_of_the_geometry(name: str) -> None:
    """At any depth; momentum and its moment are kept, and of both targets the numbers are the same."""
    k, n = 1e7, 1.5
    mod, compiled = (touching(name, {"stiffness": k, "exponent": n}, False, target) for target in ("numpy", "cython"))
    first, second = (np.array(points) for points in PAIRS[name])
    second_spots = kinks = 0
    for q, depth in poses(name, np.random.default_rng(12), 120):
        x = np.concatenate([q, np.zeros(6)])
        found = scenes.facing(first, scenes.placed(q[3:], second))
        second_spots += found[1][0] > 0.0 and found[1][1] > 0.0
        wanted = sum(part * k * max(d, 0.0) ** (n + 1) / (n + 1) for d, part in found)
        assert mod.energy(x)[1] == pytest.approx(wanted, rel=1e-8)
        assert compiled.energy(x)[1] == pytest.approx(wanted, rel=1e-8)
        force = -mod.bias(0.0, x)
        scale = np.array([1, 1, 0.1] * 2) * np.abs(force).max()
        assert np.all(np.abs(compiled.bias(0.0, x) + force) < 1e-9 * scale)
        assert np.abs(force[:2] + force[3:5]).max() < 1e-12 * scale[0]
        assert abs(force[2] + force[5] + q[3] * force[4] - q[4] * force[3]) < 1e-12 * scale[0]
        h = 1e-5 * depth
        sides = np.array([q + way * h * np.eye(6)[i] for i in range(6) for way in (1, -1)])
        slopes = np.diff(mod.energy(states(sides))[1].reshape(6, 2), axis=1)[:, 0] / (2 * h)
        around = -mod.bias(0.0, states(sides))
        if np.any(np.abs(around.T - force) > 1e-3 * scale):  # the force or its moment jumps here
            kinks += 1
            continue
        assert np.all(np.abs(force - slopes) < 1e-4 * scale), (q, depth)
    assert second_spots >= 10
    assert kinks < 20


@pytest.mark.parametrize("name", part_of(PAIRS, lambda name: name in {"needles", "narrow", "obtuse"}))
def test_energy_is_kept_in_deep_hits(name: str) -> None:
    """Tied by a spring, thrown at each other ten times: the corners go deep into each other."""
    m, bodies = scenes.planar(name, 2)
    group = [{"shape": "polygon", "points": list(p), "on": b} for p, b in zip(PAIRS[name], bodies, strict=True)]
    m.contacts("c", *group, {"stiffness": 1e7, "exponent": 1.5})
    m.spring("tie", *bodies, stiffness=300.0)
    mod = m.compile()
    rng = np.random.default_rng(7)
    for _ in range(5):
        way = rng.uniform(-np.pi, np.pi)
        start = {"j1_x": 0.7 * np.cos(way), "j1_y": 0.7 * np.sin(way), "j0_3_dot": rng.uniform(-9, 9)}
        start |= {"j1_3": rng.uniform(-3, 3), "j1_3_dot": rng.uniform(-9, 9)}
        run = mod.simulate((0, 1), initial=start, method="DOP853", rtol=1e-9, atol=1e-11)
        energy = np.sum(mod.energy(np.ascontiguousarray(run.x)), axis=0)
        assert np.abs(np.diff(energy)).max() < 1e-4 * np.ptp(mod.energy(np.ascontiguousarray(run.x))[0])
