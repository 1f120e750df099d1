"""Gears, planetary sets, racks and belts against closed forms, and against the velocities of the points that mesh."""

from typing import Any

import models
import numpy as np
import pytest
from judges import Bodies, agree, augmented, described, loop_terms, random_states
from sweeps import TARGETS

import eomgen as eg

PLANETARY = models.reference("cam_gear_cardan")["planetary"]  # closed form (Willis)


def pair(**keys: Any) -> eg.Model:
    """Two eccentric wheels on parallel axes, coupled by one constraint of type ``keys['type']``."""
    m = eg.Model("pair", gravity=(0, -9.81, 0))
    r1, r2 = m.parameter("r1", 0.1), m.parameter("r2", 0.25)
    one = m.body("one", mass=2.0, com=(0.03, 0, 0), inertia={"zz": 0.3})
    two = m.body("two", mass=3.0, com=(0, 0.05, 0), inertia={"zz": 0.7})
    m.revolute("A", m.ground, one, coordinate="alpha")
    m.revolute("B", m.ground.at(0.35, 0, 0), two, coordinate="beta")
    m.torque("motor", "A", m.input("tau", 2.0))
    getattr(m, keys.pop("type"))("mesh", "A", "B", **({"radii": (r1, r2)} | keys))
    m.independent("alpha")
    return m


@pytest.mark.quick
@pytest.mark.parametrize(
    ("keys", "ratio"),
    [
        ({"type": "gear"}, -0.4),
        ({"type": "gear", "internal": True}, 0.4),
        ({"type": "gear", "radii": None, "teeth": (20, 50)}, -0.4),
        ({"type": "belt"}, 0.4),
        ({"type": "belt", "crossed": True}, -0.4),
        ({"type": "belt", "radii": None, "teeth": (12, 36)}, 1 / 3),
    ],
)
def test_pairs_turn_in_the_ratio_of_their_radii(keys: dict[str, Any], ratio: float) -> None:
    mod = pair(**keys).compile(target="numpy")
    assert mod.n_dof == 1
    q, v, a = mod.kinematics([0.7], [3.0], [-2.0])
    first, second = (mod.q_names.index(n) for n in ("alpha", "beta"))
    for x, given in ((q, 0.7), (v, 3.0), (a, -2.0)):
        assert x[first] == given
        assert x[second] == pytest.approx(ratio * given, rel=1e-14)


def test_the_phase_sets_how_gears_are_assembled() -> None:
    mod = pair(type="gear", phase=0.5).compile(target="numpy")
    x = mod.x0(beta=0.0)
    assert x[mod.x_names.index("alpha")] == pytest.approx(0.5, rel=1e-14)


@pytest.mark.parametrize("method", ["embedding", "lagrange"])
@pytest.mark.parametrize("target", TARGETS)
def test_reflected_inertia_and_weight(method: str, target: str) -> None:
    """One equation by hand: (J1 + n^2 J2) alpha'' = tau + moments of the weights, beta = -n alpha."""
    mod = pair(type="gear").compile(method, target=target)
    n, g = 0.4, 9.81
    for alpha in (0.0, 0.4, 2.0):
        x = mod.x0(alpha=alpha, alpha_dot=1.5)
        beta = -n * alpha
        J = 0.3 + 2 * 0.03**2 + n**2 * (0.7 + 3 * 0.05**2)
        moment = 2.0 - 2 * g * 0.03 * np.cos(alpha) - n * 3 * g * 0.05 * np.sin(beta)
        at = mod.n_q + mod.v_names.index("alpha_dot")
        assert mod.rhs(0.0, x)[at] == pytest.approx(moment / J, rel=1e-12)
        assert mod.embedded_mass_matrix(x[: mod.n_q])[0, 0] == pytest.approx(J, rel=1e-12)


def bevel(keys: dict[str, Any], turn: tuple[float, float, float]) -> eg.Model:
    m = eg.Model("bevel")
    one, two = m.body("one", mass=1, inertia=(1, 1, 2)), m.body("two", mass=1, inertia=(1, 1, 2))
    m.revolute("A", m.ground, one, coordinate="alpha")
    m.revolute("B", m.ground.at(0, 0, 0, rpy=turn), two, coordinate="beta")
    m.gear("mesh", "A", "B", **keys)
    m.independent("alpha")
    return m


def test_bevel_gears_roll_on_their_pitch_cones() -> None:
    """The points of both cones on the line where they touch have the same velocity."""
    cones = (0.5, 0.9)
    mod = bevel({"cones": cones}, (0.0, sum(cones), 0.0)).compile(target="numpy")
    line = np.array([np.sin(0.5), 0, np.cos(0.5)])  # between the two z axes, at the cone angle from each
    q, v, _ = mod.kinematics([0.0], [2.0], [0.0])
    bodies = Bodies(mod, q, v)
    assert bodies.R[1][:, 2] @ line == pytest.approx(np.cos(0.9))
    np.testing.assert_allclose(np.cross(bodies.w[0], line), np.cross(bodies.w[1], line), atol=1e-11)
    assert np.linalg.norm(np.cross(bodies.w[0], line)) > 0.5


def gearbox(fixed: str, planet_on: str = "carrier", planets: bool = True) -> eg.Model:
    """The planetary set of the reference (30, 30, 90 teeth, module 2 mm), one member fixed ('' for none)."""
    m = eg.Model("gearbox", gravity=(0, -9.81, 0))
    sizes = {"sun": 0.03, "planet": 0.03, "ring": 0.09}
    joints: dict[str, Any] = {}
    for name in ("sun", "ring", "carrier"):
        if name != fixed:
            body = m.body(name, mass=1.0, com=(0.01, 0.002, 0), inertia={"zz": 0.004})
            joints[name] = m.revolute(f"of_{name}", m.ground, body, coordinate=name)
    if planets:
        wheel = m.body("wheel", mass=0.4, com=(0, 0.005, 0), inertia={"zz": 0.0003})
        holder = m.bodies["carrier"] if fixed != "carrier" else m.ground
        if planet_on == "frame":  # an arm of the same motion, turned back, so that the planet turns against the frame
            joints["planet"] = m.planar("of_planet", m.ground, wheel, coordinates=["px", "py", "planet"])
            joints["planet"] = "planet"
            m.coupling("x", equation="px - 0.06*cos(carrier)")
            m.coupling("y", equation="py - 0.06*sin(carrier)")
        else:
            joints["planet"] = m.revolute("of_planet", holder.at(0.06, 0, 0), wheel, coordinate="planet")
    m.planetary("set", **joints, radii=sizes)
    m.torque("motor", joints["sun" if fixed != "sun" else "ring"], 0.3)
    return m


@pytest.mark.parametrize(
    ("fixed", "driver", "driven", "expected"),
    [
        ("ring", "sun", "carrier", PLANETARY["carrier_over_sun_ring_fixed"]),
        ("carrier", "sun", "ring", PLANETARY["ring_over_sun_carrier_fixed"]),
        ("sun", "ring", "carrier", PLANETARY["carrier_over_ring_sun_fixed"]),
    ],
)
@pytest.mark.parametrize("planets", [True, False])
def test_planetary_ratios(fixed: str, driver: str, driven: str, expected: str, planets: bool) -> None:
    mod = gearbox(fixed, planets=planets).compile(target="numpy", independent=[driver])
    assert mod.n_dof == 1
    _, v, _ = mod.kinematics([0.2], [1.0], [0.0])
    assert v[mod.q_names.index(driven)] == pytest.approx(float(expected), rel=1e-14)


def test_a_gear_twice_is_redundant_and_named() -> None:
    m = pair(type="gear")
    m.gear("again", "A", "B", teeth=(2, 5))
    report = m.check()
    assert report.degrees_of_freedom == 1
    assert report.gruebler_kutzbach_planar == 0
    assert len(report.redundant) == 1
    assert report.redundant[0] in ("mesh.ratio", "again.ratio")
    m = pair(type="gear")
    m.gear("other", "A", "B", teeth=(3, 5))
    m.independent = []
    assert m.check().degrees_of_freedom == 0  # two different ratios block each other


def rack_and_pinion() -> eg.Model:
    m = eg.Model("hoist", gravity=(0, -9.81, 0))
    r = m.parameter("r", 0.2)
    pinion, rack = m.body("pinion", mass=1.0, inertia={"zz": 0.05}), m.body("rack", mass=3.0)
    m.revolute("A", m.ground, pinion, coordinate="theta")
    m.prismatic("B", m.ground.at(r, 0, 0), rack, axis="y", coordinate="s")
    m.rack("mesh", "A", "B", radius=r, offset=0.1)
    m.independent("theta")
    return m


def test_a_rack_falls_on_its_pinion() -> None:
    """m g r = -(J + m r^2) theta''; energy is kept and s = r theta + offset all along."""
    mod = rack_and_pinion().compile(target="numpy")
    x = mod.x0(theta=0.5, theta_dot=2.0)
    q, v = x[:2], x[2:]
    at = {name: mod.q_names.index(name) for name in ("theta", "s")}
    assert q[at["s"]] == pytest.approx(0.2 * 0.5 + 0.1, rel=1e-14)
    assert v[at["s"]] == pytest.approx(0.2 * 2.0, rel=1e-14)
    theta_ddot = -3.0 * 9.81 * 0.2 / (0.05 + 3.0 * 0.2**2)
    assert mod.rhs(0.0, x)[2 + at["theta"]] == pytest.approx(theta_ddot, rel=1e-13)
    run = mod.simulate((0, 2), initial={"theta": 0.5, "theta_dot": 2.0}, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(run["theta"], 0.5 + 2 * run.t + theta_ddot * run.t**2 / 2, atol=1e-9)
    np.testing.assert_allclose(run["s"], 0.2 * run["theta"] + 0.1, atol=1e-12)
    energy = run["energy"]
    assert np.abs(energy - energy[0]).max() < 1e-9 * np.ptp(run["s"]) * 3 * 9.81


@pytest.mark.parametrize("make", [lambda: gearbox("ring"), lambda: gearbox(""), lambda: gearbox("ring", "frame")])
def test_against_multipliers_and_between_methods(make: Any) -> None:
    model = make()
    modules = [model.compile(method, target="numpy") for method in ("embedding", "lagrange")]
    mod = modules[0]
    rigid = described(model)
    n = mod.n_q
    for x in random_states(mod, 3, 2):
        q, v = x[:n], x[n:]
        M, h = Bodies(mod, q, v).newton_euler(rigid)
        h = h - np.array([0.3 if name in ("sun",) else 0.0 for name in mod.q_names])
        C_q, gamma = loop_terms(mod, q, v)
        expected = augmented(M, h, C_q, gamma)
        for other in modules:
            agree(other.rhs(0.0, x)[n:], expected, 1e-8)
        agree(modules[1].rhs(0.0, x)[n:], modules[0].rhs(0.0, x)[n:], 1e-12)
