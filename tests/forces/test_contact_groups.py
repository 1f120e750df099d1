"""Contact between groups of shapes: geometry in NumPy, one-to-one contacts, momentum, energy, closed forms."""

from __future__ import annotations

import pickle
from itertools import combinations_with_replacement
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import ELASTIC, LAW, PLANAR, on
from sweeps import part_of

import eomgen as eg
from eomgen.pipeline import build
from eomgen.program.fingerprint import fingerprint

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


START = {"j0_y": 0.0995, "j1_x": 0.15, "j1_y": 0.12, "j2_x": 0.26, "j2_y": 0.22, "j0_x_dot": 1.0, "j1_3_dot": 2.0}


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_as_the_same_pairs_one_by_one(target: str) -> None:
    bulk, single = (heap(b).compile(target=target) for b in (True, False))
    x = bulk.x0(**START)
    assert np.count_nonzero(bulk.rhs(0.0, x)[9:]) == 9  # all touch
    for call in ("rhs", "jacobian", "parameter_jacobian", "bias"):
        found, wanted = getattr(bulk, call)(0.0, x), getattr(single, call)(0.0, x)
        assert np.abs(found - wanted).max() <= 1e-13 * np.abs(wanted).max(), call
    assert np.allclose(bulk.energy(x), single.energy(x), rtol=1e-14, atol=0)
    many = np.ascontiguousarray(x[:, None] + 1e-3 * np.random.default_rng(3).standard_normal((len(x), 21)))
    together = bulk.rhs(0.0, many)
    apart = np.array([bulk.rhs(0.0, column) for column in many.T.copy()]).T
    assert np.allclose(together, apart, rtol=1e-12, atol=1e-10 * np.abs(apart).max())
    late = [mod.bind(p={"r": 0.11, "mu": 0.7}).rhs(0.0, x) for mod in (bulk, single)]
    assert np.allclose(*late, rtol=1e-12)


@pytest.mark.parametrize("method", ["lagrange", "hamilton", "newton_euler", "gibbs_appell", "augmented"])
def test_every_method(method: str) -> None:
    a, b = heap(True).compile(target="numpy"), heap(False).compile(method=method, target="numpy")
    c = heap(True).compile(method=method, target="numpy")
    x = a.x0(**START)
    if method != "hamilton":  # whose states are momenta
        assert np.allclose(c.rhs(0.0, x), a.rhs(0.0, x), rtol=1e-12)
    assert np.allclose(c.rhs(0.0, c.x0(**START)), b.rhs(0.0, b.x0(**START)), rtol=1e-12)


@pytest.mark.parametrize("kinds", list(combinations_with_replacement(PLANAR, 2)), ids="-".join)
def test_depth_and_force_against_geometry(kinds: tuple[str, str]) -> None:
    """The energy is that of the depths found in NumPy, the force its slope; momentum and its moment are kept."""
    m, (a, b) = scenes.planar("pair", 2, (0, 0, 0))
    m.contacts("touch", on(PLANAR[kinds[0]], a), on(PLANAR[kinds[1]], b), ELASTIC)
    mod = m.compile(target="numpy")
    rng, met = np.random.default_rng(5), 0
    for _ in range(200):
        q = np.concatenate([rng.uniform(-0.05, 0.05, 2), [rng.uniform(-3, 3)], np.zeros(3)])
        way = rng.uniform(-3, 3)
        q[3:5] = q[:2] + rng.uniform(0.1, 0.25) * np.array([np.cos(way), np.sin(way)])
        q[5] = rng.uniform(-3, 3)
        x = np.concatenate([q, np.zeros(6)])
        wanted = sum(part * 2e4 * max(d, 0.0) ** 2.5 / 2.5 for d, part in scenes.spots(*kinds, q[:3], q[3:]))
        assert mod.energy(x)[1] == pytest.approx(wanted, rel=1e-9, abs=1e-15)
        force = -mod.bias(0.0, x)
        if wanted < 1e-3:
            continue
        met += 1
        sides = [x.copy() for _ in range(12)]
        for k in range(6):
            sides[2 * k][k] += 1e-6
            sides[2 * k + 1][k] -= 1e-6
        V = mod.energy(np.array(sides).T)[1]
        slope = (V[::2] - V[1::2]) / 2e-6
        assert np.allclose(force, -slope, rtol=1e-4, atol=1e-4 * np.abs(slope).max())
        assert np.abs(force[:2] + force[3:5]).max() <= 1e-12 * np.abs(force).max()
        moment = q[0] * force[1] - q[1] * force[0] + q[3] * force[4] - q[4] * force[3] + force[2] + force[5]
        assert abs(moment) <= 1e-12 * np.abs(force).max()
    assert met >= 20


def test_order_of_groups_does_not_matter() -> None:
    values = []
    for swapped in (False, True):
        m, (a, b) = scenes.planar("pair", 2)
        groups = [on(PLANAR["box"], a), [on(PLANAR["polygon"], b), on(PLANAR["circle"], b.at(0.05, 0, 0))]]
        m.contacts("touch", *(groups[::-1] if swapped else groups), LAW)
        mod = m.compile(target="numpy")
        x = mod.x0(j1_x=0.15, j1_y=0.03, j1_3=2.0, j0_x_dot=1.0, j1_3_dot=4.0)
        assert np.abs(mod.rhs(0.0, x)[6:]).max() > 20.0
        values.append(mod.rhs(0.0, x))
    assert np.allclose(*values, rtol=1e-12)


def test_shapes_in_space_as_one_by_one() -> None:
    """Spheres and the ends of capsules on a slope, in turned frames."""
    mods = []
    for bulk in (True, False):
        m = eg.Model("spheres", gravity=(0, 0, -G))
        bodies = [m.body(f"b{k}", mass=1.0, inertia=(0.01, 0.02, 0.025)) for k in range(2)]
        for k, body in enumerate(bodies):
            m.free(f"j{k}", m.ground, body)
        slope, hub = m.ground.at(0, 0, 0, rpy=(0.2, 0.1, 0)), bodies[0].at(0.01, 0.02, 0.03, rpy=(0.4, 1.0, 0.3))
        ends = [bodies[1].at(0, 0, z) for z in (-0.15, 0.15)]
        if bulk:
            group = [
                {"shape": "sphere", "on": hub, "radius": 0.1},
                {"shape": "capsule", "on": bodies[1], "length": 0.3, "radius": 0.05},
            ]
            m.contacts("floor", {"shape": "half_space", "on": slope}, group, LAW)
            m.contacts("among", group[0], group[1], LAW)
        else:
            m.sphere_plane("f0", slope, hub, radius=0.1, **LAW)
            for k, end in enumerate(ends):
                m.sphere_plane(f"f{k + 1}", slope, end, radius=0.05, **LAW)
        mods.append(m.compile(target="numpy"))
    x = mods[0].x0(j0_x=2.0, j0_z=-0.2, j1_z=0.02, j1_y_dot=1.0, j0_x_dot=0.3)
    x[:] = x + 0.01 * np.random.default_rng(4).standard_normal(len(x))
    x = mods[0].project(x)
    assert np.abs(mods[0].rhs(0.0, x)).max() > 50.0
    assert np.allclose(mods[0].rhs(0.0, x), mods[1].rhs(0.0, x), rtol=1e-11, atol=1e-9)


def test_a_sphere_on_a_capsule() -> None:
    """Beside the cylinder the depth is across the axis, beyond an end it is that of two spheres."""
    m = eg.Model("rod", gravity=(0, 0, 0))
    rod, ball = m.body("rod", mass=1.0, inertia=(0.1, 0.1, 0.1)), m.body("ball", mass=1.0, inertia=(0.1, 0.1, 0.1))
    m.free("jr", m.ground, rod)
    m.free("jb", m.ground, ball)
    first = {"shape": "capsule", "on": rod, "length": 0.4, "radius": 0.05}
    m.contacts("touch", first, {"shape": "sphere", "on": ball, "radius": 0.1}, ELASTIC)
    mod = m.compile(target="numpy")
    for place, normal, gap in (
        ((0.08, 0.1, 0.1), (0.08, 0.1, 0.0), np.hypot(0.08, 0.1)),
        ((0.06, 0.02, -0.3), (0.06, 0.02, -0.1), np.sqrt(0.06**2 + 0.02**2 + 0.1**2)),
    ):
        x = mod.x0(**dict(zip(("jb_x", "jb_y", "jb_z"), place, strict=True)))
        force = 2e4 * (0.15 - gap) ** 1.5 * np.array(normal) / gap
        names = list(mod.v_names)
        found = -mod.bias(0.0, x)
        at = [names.index(f"jb_{c}_dot") for c in "xyz"]
        assert np.allclose(found[at], force, rtol=1e-12)
        back = [names.index(f"jr_{c}_dot") for c in "xyz"]
        assert np.allclose(found[back], -force, rtol=1e-12)


def test_depth_of_a_bouncing_ball() -> None:
    """Linear and without loss: k d^2 / 2 = m g (h + d) at the deepest point, and the height comes back."""
    m, (ball,) = scenes.planar("ball", 1)
    law = {"stiffness": 5e4, "exponent": 1}
    m.contacts("floor", on(PLANAR["circle"], ball), {"shape": "half_plane", "on": m.ground}, law)
    m.output("height", ball.position[1])
    mod = m.compile()
    h, k, W = 0.5, 5e4, G
    traj = mod.simulate((0, 1.5), initial={"j0_y": 0.1 + h}, rtol=1e-11, atol=1e-13, t_eval=np.linspace(0, 1.5, 300001))
    deep = (W + np.sqrt(W * W + 2 * k * W * h)) / k
    assert 0.1 - traj["height"].min() == pytest.approx(deep, rel=1e-5)
    later = traj["height"][traj.t > 0.5]
    assert later.max() == pytest.approx(0.1 + h, abs=1e-6)


@pytest.mark.parametrize("side", [-1, 1])
def test_angle_at_which_a_box_slides(side: int) -> None:
    """A box slides with g (sin a - mu cos a) above atan mu, and not below it, to 1e-3 rad."""
    mu = 0.4
    angle = np.arctan(mu) + side * 1e-3
    m = eg.Model("slope", gravity=(G * np.sin(angle), -G * np.cos(angle), 0))
    box = m.body("box", mass=2.0, inertia={"zz": 0.02})
    m.planar("j", m.ground, box)
    law = {"stiffness": 1e6, "exponent": 1, "dissipation": 2.0, "friction": mu, "smoothing": 1e-5}
    m.contacts("floor", {"shape": "box", "on": box, "size": (0.4, 0.1)}, {"shape": "half_plane", "on": m.ground}, law)
    mod = m.compile()
    traj = mod.simulate((0, 2), initial={"j_y": 0.05}, method="Radau", rtol=1e-8, atol=1e-11, t_eval=[0.0, 1.0, 2.0])
    gained = traj["j_x_dot"][2] - traj["j_x_dot"][1]
    expected = G * (np.sin(angle) - mu * np.cos(angle))
    if side > 0:
        assert gained == pytest.approx(expected, rel=1e-3)
    else:
        assert abs(gained) < 1e-3 * abs(expected)
        assert 0.0 < traj["j_x_dot"][2] < 1e-3


def test_when_a_sliding_sphere_begins_to_roll() -> None:
    """After 2 v0 / (7 mu g), with 5/7 of the speed."""
    mu, v0, r, mass = 0.2, 2.0, 0.1, 1.5
    m = eg.Model("billiard", gravity=(0, 0, -G))
    ball = m.body("ball", mass=mass, inertia=(0.4 * mass * r**2,) * 3)
    m.free("j", m.ground, ball)
    law = {"stiffness": 1e7, "exponent": 1.5, "dissipation": 1.0, "friction": mu, "smoothing": 1e-4}
    m.contacts("table", {"shape": "sphere", "on": ball, "radius": r}, {"shape": "half_space", "on": m.ground}, law)
    mod = m.compile()
    rest = r - (mass * G / 1e7) ** (2 / 3)
    wanted = 2 * v0 / (7 * mu * G)
    times = np.linspace(0, 1.0, 2001)
    traj = mod.simulate((0, 1.0), initial={"j_z": rest, "j_x_dot": v0}, method="Radau", t_eval=times)
    speed = traj["j_x_dot"]
    assert speed[-1] == pytest.approx(5 / 7 * v0, rel=1e-3)
    sliding = times < 0.8 * wanted  # the speed falls by mu g; where its line meets the end speed
    slope, start = np.polyfit(times[sliding], speed[sliding], 1)
    assert (speed[-1] - start) / slope == pytest.approx(wanted, rel=1e-3)


def test_newtons_cradle() -> None:
    """Equal spheres in a row with gaps: the last takes all of the speed."""
    m, bodies = scenes.planar("cradle", 5, (0, 0, 0))
    for body in range(5):
        m._description.sections["bodies"][body].values["mass"] = 1.0
    m.contacts("among", {"shape": "circle", "on": bodies, "radius": 0.05}, law={"stiffness": 1e6})
    mod = m.compile()
    start: dict[str, Any] = {f"j{k}_x": 0.105 * k for k in range(5)} | {"j0_x_dot": 1.0}
    traj = mod.simulate((0, 0.2), initial=start, rtol=1e-11, atol=1e-13)
    speeds = np.array([traj[f"j{k}_x_dot"][-1] for k in range(5)])
    assert np.allclose(speeds, [0, 0, 0, 0, 1], atol=1e-7)


@pytest.mark.parametrize("seed", part_of(range(6), lambda seed: seed < 3))
def test_energy_never_grows_in_random_scenes(seed: int) -> None:
    mod, start = random_scene(seed)
    traj = mod.simulate((0, 0.6), initial=start, rtol=1e-9, atol=1e-11)
    energy = np.sum(mod.energy(traj.x), axis=0)
    assert np.diff(energy).max() <= 1e-6 * np.abs(energy).max()


def random_scene(seed: int) -> tuple[Any, dict[str, float]]:
    """Random shapes thrown at each other on a floor."""
    rng = np.random.default_rng(seed)
    m, bodies = scenes.planar(f"random{seed}", 4)
    kinds = rng.choice(list(PLANAR), 4)
    group = [on(PLANAR[kind], body) for kind, body in zip(kinds, bodies, strict=True)]
    law = {**LAW, "stiffness": 1e4 * 10 ** rng.uniform(0, 1), "friction": rng.uniform(0, 1)}
    m.contacts("among", group, law=law)
    m.contacts(
        "floor", group, {"shape": "half_plane", "on": m.ground.at(0, 0, 0, rpy=(0, 0, rng.uniform(-0.2, 0.2)))}, law
    )
    start: dict[str, float] = {}
    for k in range(4):
        start |= {f"j{k}_x": 0.4 * (k % 2), f"j{k}_y": 0.3 + 0.4 * (k // 2), f"j{k}_3": rng.uniform(-3, 3)}
        start |= {f"j{k}_x_dot": (1 - 2 * (k % 2)) * rng.uniform(0, 2), f"j{k}_3_dot": rng.uniform(-5, 5)}
    return m.compile(target="cython"), start


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
        rest = np.zeros(module.n_v)

        def height(at: np.ndarray, rest: np.ndarray = rest) -> float:
            return float(module.energy(np.concatenate([at, rest]))[1])

        slopes = [(height(q + d) - height(q - d)) / 2e-6 for d in 1e-6 * np.eye(module.n_q)]
        forces = -module.bias(0.0, np.concatenate([q, rest]))
        pushed += bool(np.abs(forces).max() > 1.0)
        np.testing.assert_allclose(forces, np.negative(slopes), rtol=1e-5, atol=1e-3)
    assert pushed > 4


def test_names_of_contacts_stand_apart_from_functions_and_losses() -> None:
    """A function of the contact's name, and a contact named as another's losses could be."""
    m, (first, second) = scenes.planar("named", 2)
    m.table("push", np.linspace(-1.0, 1.0, 5), np.linspace(-2.0, 2.0, 5))
    disc = {"shape": "circle", "radius": 0.1}
    for name, body in (("push", first), ("push_lost", second)):
        m.contacts(name, {**disc, "on": body}, {"shape": "half_plane", "on": m.ground}, LAW)
    m.force("pull", first, (0, "push(j0_x)", 0))
    module = m.compile(target="numpy")
    x = module.x0({"j0_x": 0.3, "j0_y": 0.09, "j1_x": 2.0, "j1_y": 0.07, "j0_x_dot": 0.2})
    alone = m.compile().rhs(0.0, x)
    np.testing.assert_allclose(module.rhs(0.0, x), alone, rtol=1e-12, atol=1e-12)
    still = module.x0({"j0_x": 0.3, "j0_y": 0.09, "j1_x": 2.0, "j1_y": 0.07})
    forces = [0.6 - 1.0 * G + push(0.01), -1.2 * G + push(0.03)]
    np.testing.assert_allclose(-module.bias(0.0, still)[[1, 4]], forces, rtol=1e-9)
    report = module.verify()
    assert report.ok, report


def push(depth: float) -> float:
    """The force of LAW at rest."""
    return float(LAW["stiffness"]) * depth ** float(LAW.get("exponent", 1.5))


def test_derived_contacts_are_pickled_and_recognised() -> None:
    equations = heap(True).derive()
    kept = [fingerprint(build(e, "cython")) for e in (equations, heap(True).derive())]
    module = equations.compile(target="numpy")
    module.rhs(0.0, module.x0(START))  # what evaluating keeps is no part of it
    again = pickle.loads(pickle.dumps(equations))
    assert kept[0] is not None
    assert kept == [fingerprint(build(again, "cython"))] * 2


def test_segments_without_a_radius_are_refused_where_corners_would_pass() -> None:
    m, bodies = scenes.planar("thin", 2)
    thin = {"shape": "segment", "length": 0.3}
    for shape in (thin, {"shape": "box", "size": (0.1, 0.1)}):
        m.contacts("c", on(thin, bodies[0]), on(shape, bodies[1]), LAW)
        with pytest.raises(eg.ModelError, match="pass through a segment of radius 0, which has no inside; give the"):
            m.derive()
        m, bodies = scenes.planar("thin", 2)
    m.contacts("c", {"on": bodies[0], **thin}, {"on": bodies[1], "shape": "circle", "radius": 0.1}, LAW)
    m.derive()


@pytest.mark.parametrize(
    ("first", "told"),
    [
        (3, "is not a list of shapes"),
        ("disc", "is not a list of shapes"),
        ([{"shape": "circle", "radius": 0.1}] * 2, "has the circle on b0 twice; give each shape once"),
        ({"shape": "polygon", "points": [("m", 0), (0, 0.1), (-0.1, 0)]}, r"points\[0\]\[0\]"),
    ],
)
def test_groups_that_cannot_be_are_told(first: Any, told: str) -> None:
    m, bodies = scenes.planar("wrong", 2)
    m.parameter("m", 0.1, unit="kg")
    given = [on(one, bodies[0]) for one in first] if isinstance(first, list) else first
    given = on(given, bodies[0]) if isinstance(given, dict) else given
    with pytest.raises(eg.EomgenError, match=told):
        m.contacts("c", given, {"shape": "half_plane", "on": m.ground}, LAW)
        m.check()


def test_coincident_centres_part() -> None:
    """Circles along x of the first, a centre on a segment along its y: forces are finite and opposite."""
    for kind, axis, depth in (("circle", 0, 0.2), ("segment", 1, 0.13)):
        m, (a, b) = scenes.planar("same", 2, (0, 0, 0))
        m.contacts("touch", on(PLANAR[kind], a), on(PLANAR["circle"], b), ELASTIC)
        for target in ("numpy", "cython"):
            mod = m.compile(target=target)
            force = -mod.bias(0.0, mod.x0())
            wanted = np.zeros(2)
            wanted[axis] = 2e4 * depth**1.5
            assert np.allclose(force[3:5], wanted, rtol=1e-12)
            assert np.allclose(force[:2], -wanted, rtol=1e-12)
            assert np.isfinite(mod.jacobian(0.0, mod.x0())).all()
