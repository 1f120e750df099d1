"""Rigid contacts of free bodies: impulses never give energy and keep both momenta; laws too, in any order of groups."""

from collections.abc import Sequence
from functools import cache
from math import gamma
from typing import Any

import numpy as np
import pytest
from contact_scenes import momenta
from models import IN_C
from refusals import refuses
from sweeps import part_of

import eomgen as eg

RIGID: dict[str, Any] = {"normal_law": "rigid"}
SOFT: dict[str, Any] = {"stiffness": 1e4, "dissipation": 0.3, "friction": 0.4, "smoothing": 0.01}
ROUND: dict[str, Any] = {"shape": "circle", "radius": 0.1}


def shape_of(kind: int, body: Any) -> dict[str, Any]:
    kinds = (ROUND, {"shape": "box", "size": (0.2, 0.16)}, {"shape": "segment", "length": 0.2, "radius": 0.05})
    return {**kinds[kind % 3], "on": body}


def free_bodies(masses: Sequence[Any]) -> tuple[eg.Model, list[Any]]:
    m = eg.Model("rigid", gravity=(0, 0, 0))
    for name in masses:
        if isinstance(name, str):
            m.parameter(name, 1.0)
    bodies = [m.body(f"b{k}", mass=x, inertia={"zz": f"0.005*{x}"}) for k, x in enumerate(masses)]
    for k, body in enumerate(bodies):
        m.planar(f"j{k}", m.ground, body)
    return m, bodies


@cache
def three_bodies() -> eg.Module:
    """Of masses, friction and restitution that are parameters; each is a shape with another beside it."""
    m, bodies = free_bodies(("m0", "m1", "m2"))
    m.parameter("mu", 0.0), m.parameter("e", 0.0)
    shapes = [shape_of(k + more, body.at(0.05 * more, 0, 0)) for k, body in enumerate(bodies) for more in (0, 1)]
    m.contacts("c", shapes, law={**RIGID, "friction": "mu", "restitution": "e"})
    return m.compile(**IN_C)


@pytest.mark.parametrize(("seed", "count"), part_of([(3, 10), *((seed, 50) for seed in range(31, 37))], (3, 10).__eq__))
def test_impulses_keep_momenta_and_give_no_energy(seed: int, count: int) -> None:
    """Restitutions of 0 to 1, friction, masses of 1 to 1e6, three bodies that meet at once, none of them ground."""
    mod, random, met = three_bodies(), np.random.default_rng([seed, 31]), 0
    whole = 0
    for k in range(count):
        masses = 10.0 ** np.array([0.0, random.uniform(-3, 3), random.uniform(-3, 3)])
        law = {"e": (0.0, 1.0, random.uniform())[k % 3], "mu": (0.0, random.uniform(0, 1.2))[k % 2]}
        x = np.zeros(18)
        for n, place in enumerate([(0.0, 0.0), (0.45, 0.02), (-0.45, -0.02)]):
            x[3 * n : 3 * n + 2], x[3 * n + 2] = place, random.uniform(-3, 3)
            x[9 + 3 * n : 11 + 3 * n] = np.multiply(place, -4.0) + 0.1 * random.standard_normal(2)
            x[11 + 3 * n] = 3.0 * random.standard_normal()
        own = mod.bind({**law, **{f"m{n}": mass for n, mass in enumerate(masses)}})
        run = own.simulate(0.4, dict(zip(mod.x_names, x, strict=True)), method="moreau", step=1e-3)
        energy = own.energy(run.x)[0]
        assert np.diff(energy).max() <= 1e-9 * energy[0]
        met += np.abs(run.x[9:, -1] - run.x[9:, 0]).max() > 0.1
        found, size = momenta(masses, 0.005 * masses, run.x)
        assert np.abs(found[:2] - found[:2, :1]).max() < 1e-10 * size
        if run.metadata["steps"] > 400:
            continue  # a step was taken in parts, which are not stored
        # places are moved by the scheme's mean velocities, so that the angular momentum is kept as well, but for what
        # is removed of penetrations, by which places are moved besides
        q, v = run.x[:9].reshape(3, 3, -1)[:, :2], run.x[9:].reshape(3, 3, -1)[:, :2]
        removed = np.diff(q) - 0.5 * np.diff(run.t) * (v[..., 1:] + v[..., :-1])
        turned = removed[:, 0] * v[:, 1, 1:] - removed[:, 1] * v[:, 0, 1:]
        assert np.abs(np.diff(found[2]) - masses @ turned).max() < 1e-11 * size
        assert np.abs(masses @ removed[:, 0]).max() < 1e-11 * masses.max()
        whole += 1
    assert met > 0.7 * count
    assert whole > 0.9 * count


def test_a_shape_in_both_groups_and_groups_without_shapes_are_refused() -> None:
    """So that no pair is counted twice."""
    for first, second, told in (
        (2, 2, "EG-CONFLICT contacts.c.second"),
        (0, 2, "EG-MISSING contacts.c"),
        (2, 0, "EG-MISSING contacts.c"),
    ):
        m, bodies = free_bodies([1.0, 2.0])
        both = [{**ROUND, "on": body} for body in bodies]
        m.contacts("c", both[:first], both[:second], SOFT)
        refuses(told, m.compile, target="numpy")


# -- laws of the normal force ------------------------------------------------------------------------------------------
STEEL = {"normal_law": "hertz", "moduli": (2.1e11, 7e10), "poisson": (0.3, 0.33)}
HERTZ_E = 1 / ((1 - 0.3**2) / 2.1e11 + (1 - 0.33**2) / 7e10)
MASS, RADIUS = 0.5, 0.05


def ball(law: dict[str, Any], bulk: bool, radius: Any = RADIUS) -> eg.Model:
    """A sphere above a plane that moves along z."""
    m = eg.Model("ball", gravity=(0, 0, 0))
    body = m.body("ball", mass=MASS, inertia=(1e-3,) * 3)
    m.prismatic("z", m.ground, body, axis="z")
    if bulk:
        sphere = {"shape": "sphere", "on": body, "radius": radius}
        m.contacts("touch", sphere, {"shape": "half_space", "on": m.ground}, law)
    else:
        m.sphere_plane("touch", m.ground, body, radius=radius, **law)
    return m


def impact(model: eg.Model, speed: float) -> tuple[float, float]:
    """How long the ball that meets the plane at a speed stays in contact, and its speed afterwards over that before."""
    m = model
    m.event("leaves", f"z(ball) - {RADIUS}", direction=1, terminal=True)
    start = {"z": RADIUS - 1e-12, "z_dot": -speed}
    traj = m.compile(target="numpy").simulate(1.0, initial=start, rtol=1e-11, atol=1e-14, max_step=2e-5)
    return float(traj.t[-1]), float(traj["z_dot"][-1]) / speed


@pytest.mark.parametrize("bulk", [False, True])
def test_time_of_an_impact_after_hertz(bulk: bool) -> None:
    """Johnson (1985), equations 11.22 to 11.24: T = 2.94 d_max / v = 2.87 (m^2 / (R E^2 v))^(1/5)."""
    v = 0.3
    duration, e = impact(ball(STEEL, bulk), v)
    assert duration == pytest.approx(2.87 * (MASS**2 / (RADIUS * HERTZ_E**2 * v)) ** 0.2, rel=2e-3)
    k = 4 / 3 * HERTZ_E * RADIUS**0.5
    deepest = (5 * MASS * v**2 / (4 * k)) ** 0.4
    exact = 2 * np.sqrt(np.pi) * gamma(1.4) / gamma(0.9) * deepest / v
    assert exact == pytest.approx(2.94 * deepest / v, rel=2e-3)
    assert duration == pytest.approx(exact, rel=1e-6)
    assert e == pytest.approx(1.0, rel=1e-8)


@pytest.mark.parametrize("loss", [0.003, 0.01])
def test_restitution_after_hunt_and_crossley(loss: float) -> None:
    """For small losses e = 1 - (2/3) lambda v (Hunt and Crossley, 1975), in the first order."""
    v = 0.4
    _, e = impact(ball({"normal_law": "hertz", "stiffness": 1e6, "dissipation": loss / v}, False), v)
    assert 1 - e == pytest.approx(2 / 3 * loss, rel=loss)


@pytest.mark.parametrize("damping", [20.0, 200.0])
@pytest.mark.parametrize("bulk", [False, True])
def test_restitution_of_the_linear_law(damping: float, bulk: bool) -> None:
    """Schwager and Poschel (2007), Granular Matter 9, 465-469, equation 9: contact ends where the force does."""
    stiffness = 1e5
    beta = damping / (2 * MASS)
    omega = np.sqrt(stiffness / MASS - beta**2)
    expected = np.exp(-beta / omega * (np.pi - np.arctan2(2 * beta * omega, omega**2 - beta**2)))
    law = {"normal_law": "linear", "stiffness": stiffness, "damping": damping}
    _, e = impact(ball(law, bulk), 0.3)
    assert e == pytest.approx(expected, rel=1e-5)


LAWS: dict[str, dict[str, Any]] = {
    "hertz of bodies": {**STEEL, "dissipation": 0.4},
    "hertz": {"normal_law": "hertz", "stiffness": 3e6, "restitution": 0.7, "velocity": 0.2},
    "linear": {"normal_law": "linear", "stiffness": 3e5, "damping": 250.0},
    "hunt_crossley": {"stiffness": 1e6, "exponent": 1.2, "dissipation": 0.4},
}


@pytest.mark.parametrize("law", LAWS)
def test_no_law_ever_pulls(law: str) -> None:
    """In 10,000 random states; at rest the force is minus the slope of the energy."""
    single, bulk = (ball(LAWS[law], b).compile(target="numpy") for b in (False, True))
    rng = np.random.default_rng(1)
    x = np.ascontiguousarray([RADIUS + 1e-3 * rng.standard_normal(10_000), 5.0 * rng.standard_normal(10_000)])
    force = MASS * single.rhs(0.0, x)[1]
    assert force.min() == 0.0
    assert 1000 < np.count_nonzero(force) < 5001
    assert np.array_equal(force[x[0] >= RADIUS], np.zeros(np.count_nonzero(x[0] >= RADIUS)))
    together = MASS * bulk.rhs(0.0, x)[1]
    np.testing.assert_allclose(together, force, rtol=1e-11, atol=1e-11 * force.max())
    z, h = RADIUS - 4e-4, 1e-7
    slope = (single.energy(np.array([z + h, 0.0]))[1] - single.energy(np.array([z - h, 0.0]))[1]) / (2 * h)
    assert MASS * single.rhs(0.0, np.array([z, 0.0]))[1] == pytest.approx(-slope, rel=1e-6)


@pytest.mark.quick
def test_two_spheres_after_hertz() -> None:
    """1 / R = 1 / R1 + 1 / R2, single and in groups."""
    for bulk in (False, True):
        m = eg.Model("pair", gravity=(0, 0, 0))
        body = m.body("b", mass=1, inertia=(1e-3,) * 3)
        m.prismatic("x", m.ground, body, axis="x")
        if bulk:
            a, b = ({"shape": "sphere", "on": on, "radius": r} for on, r in ((m.ground, 0.04), (body, 0.06)))
            m.contacts("touch", a, b, STEEL)
        else:
            m.sphere_sphere("touch", m.ground, body, radii=(0.04, 0.06), **STEEL)
        force = m.compile(target="numpy").rhs(0.0, np.array([0.1 - 1e-5, 0.0]))[1]
        assert force == pytest.approx(4 / 3 * HERTZ_E * np.sqrt(0.024) * 1e-5**1.5, rel=1e-9)


def test_a_stop_with_the_linear_law() -> None:
    m = eg.Model("stop")
    body = m.body("b", mass=2)
    m.prismatic("x", m.ground, body, axis="x")
    m.stop("end", "x", stiffness=1000, upper=0.1, normal_law="linear", damping=30)
    mod = m.compile(target="numpy")
    assert mod.rhs(0.0, np.array([0.12, 0.1]))[1] == pytest.approx(-(1000 * 0.02 + 30 * 0.1) / 2)
    assert mod.rhs(0.0, np.array([0.12, -3.0]))[1] == 0.0
    assert "max" in m.derive().explain().markdown


WRONG = [
    ({"stiffness": 1, "normal_law": "cubic"}, "EG-CHOICE normal_law: cubic"),
    ({"normal_law": "linear"}, "EG-MISSING stiffness:"),
    ({"normal_law": "linear", "stiffness": 1, "dissipation": 2}, "EG-CONFLICT dissipation: hunt_crossley linear"),
    ({"stiffness": 1, "damping": 2}, "EG-CONFLICT damping: linear hunt_crossley"),
    ({"normal_law": "hertz", "stiffness": 1, "exponent": 1.2}, "EG-CONFLICT exponent: hunt_crossley hertz"),
    ({"normal_law": "hertz"}, "EG-MISSING stiffness:"),
    ({**STEEL, "stiffness": 1}, "EG-CONFLICT stiffness:"),
    ({"normal_law": "hertz", "moduli": (1e9, 1e9)}, "EG-MISSING poisson:"),
    ({**STEEL, "poisson": (0.3, 0.7)}, "EG-RANGE poisson[1]: 0.7"),
]


@pytest.mark.parametrize(("law", "told"), WRONG)
def test_what_is_wrong_with_a_law_is_reported(law: dict[str, Any], told: str) -> None:
    for bulk in (False, True):
        refuses(told, ball(law, bulk).derive)


def test_shapes_without_a_radius_take_no_moduli() -> None:
    m = eg.Model("rod", gravity=(0, 0, -9.81))
    body = m.body("rod", mass=1, inertia=(1e-3,) * 3)
    m.free("j", m.ground, body)
    rod = {"shape": "capsule", "on": body, "length": 0.2, "radius": 0.02}
    m.contacts("touch", rod, {"shape": "half_space", "on": m.ground}, STEEL)
    refuses("EG-CONFLICT contacts.touch.first", m.derive)


def test_units_of_the_linear_law() -> None:
    """A stiffness in N/m is right for the linear law and wrong for an exponent of 3/2."""
    for law, right in (("linear", True), ("hertz", False)):
        m = ball({"normal_law": law, "stiffness": "k"}, False)
        m.parameter("k", 1e5, unit="N/m")
        if right:
            m.derive()
        else:
            refuses("EG-DIMENSION forces.touch.stiffness", m.derive)
