"""Contact of shapes in the plane: geometry in NumPy, pairs one by one, momentum, energy, closed forms, stacks."""

from collections.abc import Iterator
from itertools import combinations_with_replacement
from typing import Any

import contact_scenes as scenes
import mujoco
import numpy as np
import pytest
from contact_scenes import ELASTIC, LAW, PLANAR, on
from mujoco_judge import Distances
from refusals import refused, refuses
from sweeps import part_of

import eomgen as eg

G = 9.81


def heap(bulk: bool) -> eg.Model:
    """Three circles on the floor and on each other."""
    m, bodies = scenes.planar("heap", 3)
    r, mu = m.parameter("r", 0.1), m.parameter("mu", 0.3)
    law = {**LAW, "friction": mu}
    if bulk:
        circles = [{"shape": "circle", "on": bodies, "radius": r}]
        m.contacts("floor", circles, {"shape": "half_plane", "on": m.ground}, law)
        m.contacts("among", circles, law=law)
        return m
    for i, body in enumerate(bodies):
        m.sphere_plane(f"f{i}", m.ground.at(0, 0, 0, rpy=(-np.pi / 2, 0, 0)), body, radius=r, **law)
        for j in range(i):
            m.sphere_sphere(f"s{i}{j}", bodies[j], body, radii=(r, r), **law)
    return m


def slopes_of_energy(mod: eg.Module, x: np.ndarray, h: float = 1e-6) -> np.ndarray:
    """Of the potential energy by the coordinates."""
    steps = h * np.eye(len(x))[:, : mod.n_q]
    return np.asarray(mod.energy(x[:, None] + steps)[1] - mod.energy(x[:, None] - steps)[1]) / (2 * h)


START = {"j0_y": 0.0995, "j1_x": 0.15, "j1_y": 0.12, "j2_x": 0.26, "j2_y": 0.22, "j0_x_dot": 1.0, "j1_3_dot": 2.0}


def test_as_the_same_pairs_one_by_one() -> None:
    bulk, single = (heap(together).compile(target="numpy") for together in (True, False))
    x = bulk.x0(**START)
    assert np.count_nonzero(bulk.rhs(0.0, x)[9:]) == 9  # all touch
    for call in ("rhs", "jacobian", "parameter_jacobian", "bias"):
        found, wanted = getattr(bulk, call)(0.0, x), getattr(single, call)(0.0, x)
        assert np.abs(found - wanted).max() <= 1e-12 * np.abs(wanted).max(), call
    assert np.allclose(bulk.energy(x), single.energy(x), rtol=1e-14, atol=0)
    many = np.ascontiguousarray(x[:, None] + 1e-3 * np.random.default_rng(3).standard_normal((len(x), 21)))
    together = bulk.rhs(0.0, many)
    apart = np.array([bulk.rhs(0.0, column) for column in many.T.copy()]).T
    assert np.allclose(together, apart, rtol=1e-12, atol=1e-10 * np.abs(apart).max())
    late = [mod.bind(p={"r": 0.11, "mu": 0.7}).rhs(0.0, x) for mod in (bulk, single)]
    assert np.allclose(*late, rtol=1e-12)


@pytest.mark.parametrize("method", part_of(["lagrange", "hamilton", "newton_euler"], ("lagrange",).__contains__))
def test_every_method(method: str) -> None:
    one, other = (heap(bulk).compile(method=method, target="numpy") for bulk in (True, False))
    assert np.allclose(one.rhs(0.0, one.x0(**START)), other.rhs(0.0, other.x0(**START)), rtol=1e-12)


@pytest.mark.parametrize("kinds", list(combinations_with_replacement(PLANAR, 2)), ids="-".join)
def test_depth_and_force_against_geometry(kinds: tuple[str, str]) -> None:
    """The energy is that of the depths found in NumPy, the force its slope; momentum and its moment are kept."""
    m, (a, b) = scenes.planar("pair", 2, (0, 0, 0))
    m.contacts("touch", on(PLANAR[kinds[0]], a), on(PLANAR[kinds[1]], b), ELASTIC)
    mod = m.compile(target="numpy")
    rng, met = np.random.default_rng(5), 0
    for _ in range(90):
        q = np.concatenate([rng.uniform(-0.05, 0.05, 2), [rng.uniform(-3, 3)], np.zeros(3)])
        way = rng.uniform(-3, 3)
        q[3:5] = q[:2] + rng.uniform(0.1, 0.25) * np.array([np.cos(way), np.sin(way)])
        q[5] = rng.uniform(-3, 3)
        x = np.concatenate([q, np.zeros(6)])
        wanted = sum(part * 2e4 * max(d, 0.0) ** 2.5 / 2.5 for d, part in scenes.witnesses(*kinds, q[:3], q[3:]))
        assert mod.energy(x)[1] == pytest.approx(wanted, rel=1e-9, abs=1e-15)
        force = -mod.bias(0.0, x)
        if wanted < 1e-3:
            continue
        met += 1
        slope = slopes_of_energy(mod, x)
        assert np.allclose(force, -slope, rtol=1e-4, atol=1e-4 * np.abs(slope).max())
        assert np.abs(force[:2] + force[3:5]).max() <= 1e-12 * np.abs(force).max()
        moment = q[0] * force[1] - q[1] * force[0] + q[3] * force[4] - q[4] * force[3] + force[2] + force[5]
        assert abs(moment) <= 1e-12 * np.abs(force).max()
    assert met >= 8


#: Depths up to which a pair's answer is the least way out: until the axes of segments cross.
DEEP = {
    ("circle", "circle"): 0.2, ("circle", "segment"): 0.13, ("circle", "box"): 0.17, ("segment", "segment"): 0.06,
    ("segment", "box"): 0.03, ("box", "box"): 0.14,
}  # fmt: skip


def test_gaps_are_those_of_mujoco() -> None:
    """Apart, grazing and deep, turned at random and nearly parallel.

    Boxes that are apart are listed where edges lie beside each other only.
    """
    kinds = ("circle", "segment", "box")
    m, bodies = scenes.planar("pairs", 2, (0, 0, 0))
    away = {kind: 4.0 * k for k, kind in enumerate(kinds)}
    groups = [[on(PLANAR[kind], body.at(away[kind], 0, 0)) for kind in kinds] for body in bodies]
    m.contacts("touch", *groups, ELASTIC)
    mod = m.compile(target="numpy")
    for pair, deep in DEEP.items():
        gaps = [1e-9, -1e-9, 1e-6, -1e-6, 0.01, *(-part * deep for part in (0.02, 0.2, 0.5, 0.95))]
        gaps = [gap for gap in gaps if gap < 0.0] if pair == ("box", "box") else gaps
        met = 0
        for gap, turns, centre in Distances(pair, [PLANAR[kind] for kind in pair]).scenes(gaps, 45):
            q = []
            for kind, turn, place in zip(pair, turns, (np.zeros(3), centre), strict=True):
                q += [*(place - turn.apply((away[kind], 0, 0)))[:2], turn.as_rotvec()[2]]
            found = scenes.near(mod, np.array(q))
            depths = [one.depth for one in found if one.kinds == pair]
            assert max(depths) == pytest.approx(-gap, abs=1e-9), pair
            met += 1
        assert met > 20, pair


TILTED = [("circle", "circle", 0.16), ("box", "circle", 0.16), ("segment", "box", 0.09), ("polygon", "segment", 0.07)]


@pytest.mark.parametrize(("first", "second", "away"), TILTED)
def test_bodies_that_tilt_keep_their_energy(first: str, second: str, away: float) -> None:
    """Shapes of the plane on bodies whose planes differ: the force is minus the slope of the potential energy."""
    m = eg.Model("tilted", gravity=(0, 0, 0))
    low, high = (m.body(name, mass=1.0, inertia=(0.02, 0.02, 0.02)) for name in ("low", "high"))
    m.revolute("lean", m.ground, low, axis="x")
    m.universal("hang", m.ground.at(0.01, away, 0.3), high)
    kinds = [{"on": body, **PLANAR[kind]} for kind, body in ((first, low), (second, high))]
    m.contacts("touch", *kinds, {"stiffness": 1e4, "exponent": 1.5})
    module = m.compile(target="numpy")
    pushed = 0
    for q in 0.12 * np.random.default_rng(5).uniform(-1.0, 1.0, (12, module.n_q)):
        x = np.concatenate([q, np.zeros(module.n_v)])
        forces = -module.bias(0.0, x)
        pushed += bool(np.abs(forces).max() > 1.0)
        np.testing.assert_allclose(forces, -slopes_of_energy(module, x), rtol=1e-5, atol=1e-3)
    assert pushed > 4


def test_segments_without_a_radius_are_refused_where_corners_would_pass() -> None:
    m, bodies = scenes.planar("thin", 2)
    thin = {"shape": "segment", "length": 0.3}
    for shape in (thin, {"shape": "box", "size": (0.1, 0.1)}):
        m.contacts("c", on(thin, bodies[0]), on(shape, bodies[1]), LAW)
        refuses("EG-RANGE contacts.c.first 0", m.derive)
        m, bodies = scenes.planar("thin", 2)
    m.contacts("c", {"on": bodies[0], **thin}, {"on": bodies[1], "shape": "circle", "radius": 0.1}, LAW)
    m.derive()


@pytest.mark.parametrize(
    ("first", "told"),
    [
        (3, "EG-TYPE contacts.c.first"),
        ([{"shape": "circle", "radius": 0.1}] * 2, "EG-CONFLICT contacts.c.first b0"),
        ({"shape": "polygon", "points": [("m", 0), (0, 0.1), (-0.1, 0)]}, "EG-DIMENSION first[0].points[0][0]"),
    ],
)
def test_groups_that_cannot_be_are_reported(first: Any, told: str) -> None:
    m, bodies = scenes.planar("wrong", 2)
    m.parameter("m", 0.1, unit="kg")
    given = [on(one, bodies[0]) for one in first] if isinstance(first, list) else first
    given = on(given, bodies[0]) if isinstance(given, dict) else given
    with refused(told):
        m.contacts("c", given, {"shape": "half_plane", "on": m.ground}, LAW)
        m.check()


def test_coincident_centres_part() -> None:
    """Circles along x of the first, a centre on a segment along its y: forces are finite and opposite."""
    for kind, axis, depth in (("circle", 0, 0.2), ("segment", 1, 0.13)):
        m, (a, b) = scenes.planar("same", 2, (0, 0, 0))
        m.contacts("touch", on(PLANAR[kind], a), on(PLANAR["circle"], b), ELASTIC)
        mod = m.compile(target="numpy")
        force = -mod.bias(0.0, mod.x0())
        wanted = np.zeros(2)
        wanted[axis] = 2e4 * depth**1.5
        assert np.allclose(force[3:5], wanted, rtol=1e-12)
        assert np.allclose(force[:2], -wanted, rtol=1e-12)
        assert np.isfinite(mod.jacobian(0.0, mod.x0())).all()


G, MASS, HIGH, STIFF = 9.81, 1.5, 0.1, 1e5
SOFT = {"stiffness": STIFF, "exponent": 1, "dissipation": 5.0, "friction": 0.5, "smoothing": 1e-3}
RIGID = {"normal_law": "rigid", "friction": 0.5}


def box(wide: float) -> dict[str, Any]:
    return {"shape": "box", "size": (wide, HIGH)}


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
    return m.compile(target=target, **({} if target == "numpy" else {"optimize": 0}))


WIDTHS = [(0.2, 0.2, 0.2), (0.2, 0.1, 0.1), (0.1, 0.2, 0.05)]
STACKS = [(widths, turn, swapped) for widths in WIDTHS for turn in (0.0, 0.7) for swapped in (False, True)]


@pytest.mark.parametrize(("widths", "turn", "swapped"), part_of(STACKS, [(WIDTHS[1], 0.7, True)].__contains__))
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


@pytest.mark.thorough
@pytest.mark.parametrize("widths", WIDTHS)
def test_flush_stacks_are_held_rigidly(widths: tuple[float, ...]) -> None:
    mod = tower([box(wide) for wide in widths], RIGID, 0.3)
    run = mod.simulate(0.2, method="moreau", step=1e-3)
    for k in range(3):
        assert np.abs(run[f"j{k}_y"] - (k + 0.5) * HIGH).max() < 1e-9
        assert np.abs(run[f"j{k}_x"]).max() < 1e-9
        assert np.abs(run[f"j{k}_3"]).max() < 1e-9


@pytest.mark.thorough
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


@pytest.mark.parametrize("name", part_of(PAIRS, {"needles", "narrow"}.__contains__))
def test_energy_is_continuous(name: str) -> None:
    """Along random ways of the size of the depth: what changes most between two places is bisected."""
    mod, swapped = (touching(name, {"stiffness": 1e7, "exponent": 1.5}, order) for order in (False, True))
    rng = np.random.default_rng(11)
    starts, ends, most = [], [], []
    for q, depth in poses(name, rng, 60):
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


@pytest.mark.parametrize("name", part_of(PAIRS, "needles".__eq__))
def test_forces_are_slopes_of_the_energy_of_the_geometry(name: str) -> None:
    """At any depth; momentum and its moment are kept, and of both targets the numbers are the same."""
    k, n = 1e7, 1.5
    mod, compiled = (touching(name, {"stiffness": k, "exponent": n}, False, target) for target in ("numpy", "cython"))
    first, second = (np.array(points) for points in PAIRS[name])
    second_witnesses = kinks = 0
    for q, depth in poses(name, np.random.default_rng(12), 60):
        x = np.concatenate([q, np.zeros(6)])
        found = scenes.facing(first, scenes.placed(q[3:], second))
        second_witnesses += found[1][0] > 0.0 and found[1][1] > 0.0
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
        slopes = -slopes_of_energy(mod, x, h)
        around = -mod.bias(0.0, states(sides))
        if np.any(np.abs(around.T - force) > 1e-3 * scale):  # the force or its moment jumps here
            kinks += 1
            continue
        assert np.all(np.abs(force - slopes) < 1e-4 * scale), (q, depth)
    assert second_witnesses >= 4
    assert kinks < 10
