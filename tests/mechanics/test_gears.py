"""Gears, cams and what rolls: closed forms, velocities where teeth mesh, searches for contacts, published motions."""

import math
from functools import partial
from typing import Any

import models
import numpy as np
import pytest
from judges import Bodies, agree, augmented, described, loop_terms, random_states
from models import reference
from refusals import refuses
from scipy.optimize import brentq, minimize_scalar
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


# -- Contours ----------------------------------------------------------------------------------------------------------
CYCLOIDAL = models.reference("cam_gear_cardan")["cycloidal_cam"]  # closed form: s, v, a, jerk over the turn
TAU = 2 * np.pi


def cycloidal(target: str = "numpy") -> Any:
    """Rise over beta by the cycloidal law, dwell, return over the last third (Norton, Design of Machinery, ch. 8)."""
    m = eg.Model("cycloidal")
    m.parameter("h", float(CYCLOIDAL["h"]))
    m.parameter("beta", np.deg2rad(CYCLOIDAL["beta_deg"]))
    wheel, follower = m.body("wheel", mass=1, inertia={"zz": 0.02}), m.body("follower", mass=0.4)
    m.revolute("A", m.ground, wheel, coordinate="phi")
    m.prismatic("D", m.ground, follower, axis="y", coordinate="s")
    rise = "h*(theta/beta - sin(2*pi*theta/beta)/(2*pi))"
    back = rise.replace("theta", "(2*pi - theta)")
    m.cam("law", "A", "D", lift=f"where(theta < beta, {rise}, where(theta < 2*pi - beta, h, {back}))")
    m.independent("phi")
    return m.compile(target=target)


@pytest.mark.parametrize("turns", [0, 1, -2])
def test_the_cycloidal_rise(turns: int) -> None:
    """Displacement, velocity and acceleration of the follower at the points of the turn, also further turns on."""
    mod = cycloidal()
    omega = float(CYCLOIDAL["omega"])
    at = mod.q_names.index("s")
    for degrees, row in CYCLOIDAL["rows"].items():
        q, v, a = mod.kinematics([np.deg2rad(float(degrees)) + turns * TAU], [omega], [0.0])
        s, s_dot, s_ddot, _ = map(float, row)
        assert q[at] == pytest.approx(s, abs=1e-15)
        assert v[at] == pytest.approx(s_dot, abs=1e-13)
        assert a[at] == pytest.approx(s_ddot, abs=2e-12 if turns == 0 else 1e-10)


def test_the_torque_of_a_cam() -> None:
    """(J + m s'^2) phi'' + m s' s'' phi'^2 = tau, with s' and s'' over the angle (the follower's inertia reflected)."""
    mod = cycloidal()
    h, beta = 0.02, np.deg2rad(120)
    phi, omega = 0.6, 25.0
    first = h / beta * (1 - np.cos(TAU * phi / beta))
    second = h / beta**2 * TAU * np.sin(TAU * phi / beta)
    x = mod.x0(phi=phi, phi_dot=omega)
    expected = -0.4 * first * second * omega**2 / (0.02 + 0.4 * first**2)
    assert mod.rhs(0.0, x)[mod.n_q + mod.v_names.index("phi_dot")] == pytest.approx(expected, rel=1e-12)


A, B, C = 0.05, 0.006, 0.0015


def contour(theta: Any) -> Any:
    """A convex cam without symmetry (m)."""
    return A + B * np.cos(theta) + C * np.sin(2 * theta)


CONTOUR = "a + b*cos(theta) + c*sin(2*theta)"
ROLLER = 0.012


def cam_model(kind: str, motion: str, contour_text: str = CONTOUR, **keys: Any) -> eg.Model:
    """A cam about the ground's z axis with a translating (offset by e) or an oscillating follower."""
    m = eg.Model(f"{kind}_{motion}", gravity=(1.0, -9.81, 0))
    for name, value in (("a", A), ("b", B), ("c", C), ("e", 0.01)):
        m.parameter(name, value)
    cam = m.body("wheel", mass=1.3, com=(0.004, 0.001, 0), inertia={"zz": 0.02})
    turned = {"flat_face": (-np.pi / 2, 0, 0)}.get(kind, (0, 0, 0))
    if motion == "translating":
        follower = m.body("follower", mass=0.4, com=(0, 0.02, 0))
        m.revolute("A", m.ground, cam, coordinate="phi")
        m.prismatic("D", m.ground.at("e", 0, 0), follower, axis="y", coordinate="s")
        tip = follower.marker("tip", rpy=turned)
        m.guess(s=0.06)
    else:
        follower = m.body("follower", mass=0.4, com=(0.05, 0, 0), inertia={"zz": 0.003})
        m.revolute("A", m.ground, cam, coordinate="phi")
        m.revolute("D", m.ground.at(-0.1, 0.03, 0), follower, coordinate="s")
        tip = follower.marker("tip", at=(0.0 if kind == "flat_face" else 0.1, 0, 0), rpy=turned)
        m.guess(s=0.3)
    if "support" not in keys:
        keys["contour"] = contour_text
    if kind == "roller":
        keys.setdefault("radius", ROLLER)
    m.cam_contact("touch", cam, tip, kind, **keys)
    m.independent("phi")
    return m


def gap_to_contour(p: np.ndarray, phi: float) -> float:
    """Distance of a point from the turned contour, by search over the contour; negative inside."""
    c, s = np.cos(phi), np.sin(phi)
    x, y = c * p[0] + s * p[1], -s * p[0] + c * p[1]

    def away(theta: float) -> float:
        return float(np.hypot(x - contour(theta) * np.cos(theta), y - contour(theta) * np.sin(theta)))

    grid = np.linspace(0, TAU, 721)
    best = grid[int(np.argmin([away(theta) for theta in grid]))]
    found = minimize_scalar(away, bounds=(best - 0.02, best + 0.02), method="bounded", options={"xatol": 1e-12})
    inside = np.hypot(x, y) < contour(np.arctan2(y, x))
    return float(-found.fun if inside else found.fun)


def reach_of_contour(n: np.ndarray, phi: float) -> float:
    """How far the turned cam reaches along a direction, by search over the contour."""

    def away(theta: float) -> float:
        return float(-contour(theta) * (np.cos(theta + phi) * n[0] + np.sin(theta + phi) * n[1]))

    grid = np.linspace(0, TAU, 721)
    best = grid[int(np.argmin([away(theta) for theta in grid]))]
    return -float(minimize_scalar(away, bounds=(best - 0.02, best + 0.02), options={"xatol": 1e-12}).fun)


def tip_of(mod: Any, q: np.ndarray, motion: str, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Place of the follower's marker, and the normal of its face."""
    pose = mod.poses(q)[mod.body_names.index("follower")]
    at = np.array([0.1, 0, 0]) if motion == "oscillating" and kind != "flat_face" else np.zeros(3)
    return pose[:3, 3] + pose[:3, :3] @ at, pose[:3, :3] @ np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize("motion", ["translating", "oscillating"])
@pytest.mark.parametrize("kind", ["knife_edge", "roller", "flat_face"])
def test_the_follower_touches_the_cam(kind: str, motion: str) -> None:
    """Place by search for the contact; velocity and acceleration by differences of places found so."""
    mod = cam_model(kind, motion).compile(target="numpy")
    assert mod.n_dof == 1
    at = mod.q_names.index("s")
    low, high = (0.02, 0.12) if motion == "translating" else (-0.1, 0.9)

    def gap(s: float, phi: float) -> float:
        if motion == "translating":
            p, n = np.array([0.01, s]), np.array([0.0, 1.0])
        else:
            n = np.array([-np.sin(s), np.cos(s)])
            p = np.array([-0.1, 0.03]) + (0.0 if kind == "flat_face" else 0.1) * np.array([np.cos(s), np.sin(s)])
        if kind == "flat_face":
            return float(n @ p - reach_of_contour(n, phi))
        if kind == "knife_edge":
            return float(np.hypot(*p) - contour(np.arctan2(p[1], p[0]) - phi))
        return gap_to_contour(p, phi) - ROLLER

    def solve(phi: float) -> float:
        return float(brentq(gap, low, high, args=(phi,), xtol=1e-15, rtol=1e-15))

    for phi in np.linspace(0.2, TAU, 7):
        q, v, a = mod.kinematics([phi], [3.0], [2.0])
        assert q[at] == pytest.approx(solve(phi), abs=2e-9)
        d = 0.02
        values = {k: solve(phi + k * d) for k in (-2, -1, 0, 1, 2)}
        first = (8 * (values[1] - values[-1]) - (values[2] - values[-2])) / (12 * d)
        second = (16 * (values[1] + values[-1]) - (values[2] + values[-2]) - 30 * values[0]) / (12 * d**2)
        assert v[at] == pytest.approx(3.0 * first, abs=2e-5 * 3)
        assert a[at] == pytest.approx(9.0 * second + 2.0 * first, abs=5e-3)
        p, n = tip_of(mod, q, motion, kind)
        if kind == "roller":
            assert gap_to_contour(p, phi) == pytest.approx(ROLLER, abs=1e-9)
        elif kind == "flat_face":
            assert n @ p == pytest.approx(reach_of_contour(n, phi), abs=1e-12)


def test_a_lift_by_points_through_a_periodic_spline() -> None:
    """The reference's cycloidal law through points of a whole turn: s, v, a at the points of the rise."""
    m = eg.Model("points")
    wheel, follower = m.body("wheel", mass=1, inertia={"zz": 0.02}), m.body("follower", mass=0.4)
    m.revolute("A", m.ground, wheel, coordinate="phi")
    m.prismatic("D", m.ground, follower, axis="y", coordinate="s")
    h, beta = float(CYCLOIDAL["h"]), np.deg2rad(CYCLOIDAL["beta_deg"])
    theta = np.linspace(0, TAU, 721)

    def rise(x: Any) -> Any:
        return h * (x / beta - np.sin(TAU * x / beta) / TAU)

    lift = np.where(theta < beta, rise(theta), np.where(theta < TAU - beta, h, rise(TAU - theta)))
    lift[-1] = lift[0]
    m.table("law", theta, lift, kind="periodic")
    m.cam("cam", "A", "D", lift="law(theta)")
    m.independent("phi")
    mod = m.compile(target="numpy")
    at = mod.q_names.index("s")
    for degrees, row in CYCLOIDAL["rows"].items():
        q, v, a = mod.kinematics([np.deg2rad(float(degrees)) + TAU], [30.0], [0.0])
        s, s_dot, s_ddot, _ = map(float, row)
        assert q[at] == pytest.approx(s, abs=1e-10)
        assert v[at] == pytest.approx(s_dot, abs=1e-6)
        # the jerk jumps at both ends of the rise, where a cubic's curvature lags by a fraction of a step
        assert a[at] == pytest.approx(s_ddot, abs=0.01 if 0 < float(degrees) < 120 else 0.3)


# -- Lifts -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("follower", ["prismatic", "revolute"])
@pytest.mark.parametrize("cam", ["prismatic", "revolute"])
def test_cams_slide_or_turn_and_so_do_their_followers(cam: str, follower: str) -> None:
    """One degree of freedom with s = f(a): s' = f' a' and (m_a + m_s f'^2) a'' + m_s f' f'' a'^2 = 0 (Lagrange)."""
    m = eg.Model("cams")
    bodies = [m.body(n, mass=mass, inertia=(3, 3, mass)) for n, mass in (("a", 2.0), ("s", 3.0))]
    getattr(m, cam)("A", m.ground, bodies[0])
    getattr(m, follower)("S", m.ground.at(1, 0, 0), bodies[1])
    m.cam("law", "A", "S", lift="0.3*sin(theta) + 0.1*cos(2*theta)")
    module = m.compile(target="numpy")
    x = module.x0(A=0.7, A_dot=1.3)
    f, df = 0.3 * np.sin(0.7) + 0.1 * np.cos(1.4), 0.3 * np.cos(0.7) - 0.2 * np.sin(1.4)
    ddf = -0.3 * np.sin(0.7) - 0.4 * np.cos(1.4)
    a_ddot = -3.0 * df * ddf * 1.3**2 / (2.0 + 3.0 * df**2)
    found = dict(zip(module.x_names, module.rhs(0.0, x), strict=True))
    state = dict(zip(module.x_names, x, strict=True))
    assert state["S"] == pytest.approx(f, abs=1e-13)
    assert state["S_dot"] == pytest.approx(df * 1.3, abs=1e-13)
    assert found["A_dot"] == pytest.approx(a_ddot, rel=1e-12)
    assert found["S_dot"] == pytest.approx(df * a_ddot + ddf * 1.3**2, rel=1e-12)


def test_the_phase_turns_the_cam_back() -> None:
    """s = f(a - phase): where the cam stands at its phase the follower is where f(0) says."""
    m = eg.Model("cams")
    wheel, follower = m.body("wheel", mass=1.0, inertia=(1, 1, 1)), m.body("follower", mass=1.0)
    m.revolute("A", m.ground, wheel)
    m.prismatic("S", m.ground, follower)
    m.cam("law", "A", "S", lift="0.3*sin(theta) + 0.1*cos(2*theta)", phase=0.4)
    module = m.compile(target="numpy")
    for angle in (0.4, 1.5):
        state = dict(zip(module.x_names, module.x0(A=angle), strict=True))
        assert state["S"] == pytest.approx(0.3 * np.sin(angle - 0.4) + 0.1 * np.cos(2 * angle - 0.8), abs=1e-13)


# -- Discs, balls and blades -------------------------------------------------------------------------------------------
DISC = models.reference("rolling_disc")
TURN = (-np.pi / 2, 0, 0)  # brings z to y


def disc(target: str = "numpy", method: str = "embedding", rotation: str | None = None) -> Any:
    """The thin uniform disc of the reference: Rz(psi) Rx(theta) Ry(phi), axle y, centre at height r cos(theta)."""
    p = DISC["parameters_SI"]
    mass, r, g = p["m"], p["r"], p["g"]
    m = eg.Model("disc", gravity=(0, 0, -g))
    wheel = m.body("wheel", mass=mass, inertia=(mass * r**2 / 4, mass * r**2 / 2, mass * r**2 / 4))
    if rotation is None:
        m.free("f", m.ground, wheel, sequence="zxy", coordinates=["X", "Y", "Z", "psi", "theta", "phi"])
        m.independent("psi", "theta", "phi")
    else:
        m.joint("free", "f", m.ground, wheel, rotation=rotation)
    m.rolling("roll", wheel.at(0, 0, 0, rpy=TURN), m.ground, radius=r)
    return m.compile(method, target=target)


def disc_state(mod: Any, theta: float, rates: tuple[float, float, float]) -> np.ndarray:
    psi_dot, theta_dot, phi_dot = rates
    return mod.x0(psi=0.0, theta=theta, phi=0.0, psi_dot=psi_dot, theta_dot=theta_dot, phi_dot=phi_dot, X=0.0, Y=0.0)


@pytest.mark.parametrize(("target", "method"), [("numpy", "embedding"), ("numpy", "lagrange")])
def test_the_published_disc(target: str, method: str) -> None:
    """Velocities of the centre and all accelerations at the state of the reference."""
    mod = disc(target, method)
    assert mod.n_dof == 3
    given = DISC["initial_state"]
    x = disc_state(mod, given[3], tuple(given[7:]))
    assert x[mod.x_names.index("Z")] == pytest.approx(0.5 * np.cos(given[3]), rel=1e-13)
    for name, value in zip(("X_dot", "Y_dot"), given[5:7], strict=True):
        assert x[mod.x_names.index(name)] == pytest.approx(value, rel=1e-9)
    rate = mod.rhs(0.0, x)
    for name, value in zip(("X", "Y", "psi", "theta", "phi"), DISC["initial_acc"], strict=True):
        assert rate[mod.n_q + mod.v_names.index(f"{name}_dot")] == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize("sample", DISC["steady_samples"].items(), ids=lambda s: s[0])
def test_steady_circles(sample: tuple[str, dict[str, float]]) -> None:
    """At the spin of the reference the lean stays, and the centre goes round a circle."""
    words, found = sample
    theta, psi_dot = (float(w.split("=")[1]) for w in words.split(","))
    mod = disc()
    x = disc_state(mod, theta, (psi_dot, 0.0, found["phid"]))
    rate = mod.rhs(0.0, x)
    assert np.abs(rate[mod.n_q + 3 :]).max() < 1e-12 * found["phid"] ** 2
    run = mod.simulate((0, 2), initial=dict(zip(mod.x_names, x.tolist(), strict=True)), rtol=1e-10, atol=1e-12)
    speed = np.hypot(x[mod.x_names.index("X_dot")], x[mod.x_names.index("Y_dot")])
    radius = speed / abs(psi_dot)
    side = np.array([-x[mod.x_names.index("Y_dot")], x[mod.x_names.index("X_dot")]]) / psi_dot
    assert np.linalg.norm(side) == pytest.approx(radius)
    away = np.hypot(run["X"] - side[0], run["Y"] - side[1])
    np.testing.assert_allclose(run["theta"], theta, atol=1e-7)
    np.testing.assert_allclose(away, radius, rtol=1e-6)


def test_energy_and_slip_of_a_disc_that_wobbles() -> None:
    mod = disc()
    given = DISC["initial_state"]
    x = disc_state(mod, given[3], tuple(given[7:]))
    run = mod.simulate((0, 4), initial=dict(zip(mod.x_names, x.tolist(), strict=True)), rtol=1e-11, atol=1e-13)
    assert np.ptp(run["theta"]) > 0.1
    energy = run["energy"]
    assert np.abs(energy - energy[0]).max() < 1e-8 * energy[0]
    for state in run.x.T[:: len(run.t) // 5]:
        bodies = Bodies(mod, state[:6], state[6:])
        axle = bodies.R[0][:, 1]
        down = axle[2] * axle - [0, 0, 1]
        rim = bodies.v[0] + np.cross(bodies.w[0], 0.5 * down / np.linalg.norm(down))
        assert np.abs(rim).max() < 1e-9
        assert np.linalg.norm(bodies.v[0]) > 0.1
    np.testing.assert_allclose(run["Z"], 0.5 * np.cos(run["theta"]), atol=1e-13)


def test_upright_rolling_is_stable_above_the_critical_spin() -> None:
    """Eigenvalues of the exact Jacobian of straight rolling (critical spin sqrt(g / 3r))."""
    mod = disc()
    critical = DISC["critical_upright_spin_rad_s"]
    growth = []
    for factor in (0.99, 1.01):
        x = disc_state(mod, 0.0, (0.0, 0.0, factor * critical))
        growth.append(float(np.linalg.eigvals(mod.jacobian(0.0, x)).real.max()))
    assert growth[0] > 0.3
    assert abs(growth[1]) < 1e-6


def ball(**keys: Any) -> eg.Model:
    """A solid ball on a plane that is tilted by alpha about y, so that it rolls down along x of the plane."""
    m = eg.Model("ball", gravity=(0, 0, "-g"))
    m.parameter("g", 9.81)
    r, mass, alpha = m.parameter("r", 0.2), m.parameter("mass", 1.5), m.parameter("alpha", 0.4)
    sphere = m.body("sphere", mass=mass, inertia=[2 * mass * r**2 / 5] * 3)
    m.joint("free", "f", m.ground, sphere, rotation="euler_parameters")
    m.rolling("roll", sphere, m.ground.at(0.1, 0, -0.3, rpy=(0, alpha, 0)), radius=r, shape="sphere", **keys)
    return m


@pytest.mark.parametrize("method", ["embedding", "lagrange"])
def test_a_ball_rolls_down_an_incline(method: str) -> None:
    """a = 5/7 g sin(alpha) along the slope, whatever it spins about the normal; 1/2 a t^2 after t."""
    mod = ball().compile(method, target="numpy")
    assert mod.n_dof == 3
    a = 5 / 7 * 9.81 * np.sin(0.4)
    down = np.array([np.cos(0.4), 0, -np.sin(0.4)])
    x = mod.x0()
    rate = mod.rhs(0.0, x)
    at = mod.n_q + mod.v_names.index("f_x_dot")
    np.testing.assert_allclose(rate[at : at + 3], a * down, atol=1e-12)
    run = mod.simulate((0, 1.5), rtol=1e-10, atol=1e-12)
    path = np.stack([run[f"f_{k}"] - run[f"f_{k}"][0] for k in "xyz"])
    np.testing.assert_allclose(path, np.outer(down, a * run.t**2 / 2), atol=1e-8)
    assert path[0, -1] > 2


def test_a_ball_on_a_turntable_goes_round_two_sevenths_as_fast() -> None:
    """A solid ball that rolls on a turntable moves on a circle at 2/7 of its rate (Weltner, Am. J. Phys. 47, 1979)."""
    m = eg.Model("turntable", gravity=(0, 0, -9.81))
    table, sphere = (
        m.body("table", mass=1, inertia=(1, 1, 1)),
        m.body("sphere", mass=0.3, inertia=[0.4 * 0.3 * 0.01] * 3),
    )
    m.revolute("shaft", m.ground, table, coordinate="turn")
    m.joint("free", "f", m.ground, sphere, rotation="euler_parameters")
    m.rolling("roll", sphere, table, radius=0.1, shape="sphere")
    m.coupling("drive", equation="turn - 4*t")
    mod = m.compile(target="numpy")
    assert mod.n_dof == 3
    x = mod.x0(f_x=0.5, f_y=0.1, f_x_dot=0.3, f_y_dot=-0.2)
    rate, at = mod.rhs(0.0, x), mod.n_q + mod.v_names.index("f_x_dot")
    v = x[at : at + 2]
    np.testing.assert_allclose(rate[at : at + 2], 8 / 7 * np.array([-v[1], v[0]]), atol=1e-12)
    run = mod.simulate((0, 2 * np.pi / (8 / 7)), initial=dict(zip(mod.x_names, x.tolist(), strict=True)), rtol=1e-10)
    assert run["f_x"][-1] == pytest.approx(0.5, abs=1e-7)
    assert run["f_y"][-1] == pytest.approx(0.1, abs=1e-7)
    assert np.ptp(run["f_x"]) == pytest.approx(2 * np.hypot(0.3, 0.2) / (8 / 7), rel=1e-3)


def sleigh() -> eg.Model:
    m = eg.Model("sleigh")
    a, mass, J = m.parameter("a", 0.3), m.parameter("mass", 2.0), m.parameter("J", 0.1)
    runner = m.body("runner", mass=mass, com=(a, 0, 0), inertia={"zz": J})
    m.planar("move", m.ground, runner, coordinates=["x", "y", "psi"])
    m.knife_edge("blade", runner)
    return m


def test_chaplygins_sleigh() -> None:
    """v' = a w^2, w' = -m a v w / (J + m a^2), v along the blade (Neimark and Fufaev, ch. II)."""
    mod = sleigh().compile(target="numpy")
    assert mod.n_dof == 2
    a, mass, J = 0.3, 2.0, 0.1
    psi, v, w = 0.7, 1.2, -0.9
    x = mod.x0(psi=psi, x_dot=v * np.cos(psi), psi_dot=w)
    names = mod.v_names
    speeds = {n: x[mod.n_q + names.index(n)] for n in names}
    assert speeds["y_dot"] == pytest.approx(v * np.sin(psi), rel=1e-13)
    rate = dict(zip(names, mod.rhs(0.0, x)[mod.n_q :].tolist(), strict=True))
    along = rate["x_dot"] * np.cos(psi) + rate["y_dot"] * np.sin(psi)
    assert along == pytest.approx(a * w**2, rel=1e-12)
    assert rate["psi_dot"] == pytest.approx(-mass * a * v * w / (J + mass * a**2), rel=1e-12)
    run = mod.simulate((0, 6), initial=dict(zip(mod.x_names, x.tolist(), strict=True)), rtol=1e-10, atol=1e-12)
    slip = -run["x_dot"] * np.sin(run["psi"]) + run["y_dot"] * np.cos(run["psi"])
    assert np.abs(slip).max() < 1e-12
    assert abs(run["psi_dot"][-1]) < 1e-3  # it ends straight, the mass in front
    speed = run["x_dot"][-1] * np.cos(run["psi"][-1]) + run["y_dot"][-1] * np.sin(run["psi"][-1])
    assert speed == pytest.approx(np.sqrt(v**2 + (J + mass * a**2) / mass * w**2), rel=1e-5)


def test_a_rounded_wheel_keeps_its_energy() -> None:
    mod = models.rounded_wheel().compile(target="numpy")
    assert mod.n_dof == 3
    run = mod.simulate((0, 3), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(run["z"], 0.25 * np.sin(run["lean"]) + 0.05, atol=1e-12)
    for state in run.x.T[:: len(run.t) // 5]:  # the lowest point of its tube rests
        bodies = Bodies(mod, state[:6], state[6:])
        axle = bodies.R[0][:, 2]
        down = axle[2] * axle - [0, 0, 1]
        lowest = 0.25 * down / np.linalg.norm(down) - [0, 0, 0.05]
        assert np.abs(bodies.v[0] + np.cross(bodies.w[0], lowest)).max() < 1e-9
    energy = run["energy"]
    assert np.abs(energy - energy[0]).max() < 1e-8 * energy[0]
    assert np.hypot(run["x"], run["y"]).max() > 1


# -- Convex bodies -----------------------------------------------------------------------------------------------------
MASS, INERTIA = 1.3, (0.004, 0.005, 0.007)


def rattleback(flip: bool = True) -> eg.Model:
    """As in the reference: z points down, the plane's normal up."""
    p = reference("rattleback_kane_levinson")["parameters_SI"]
    m = eg.Model("stone", gravity=(0, 0, 9.81))
    stone = m.body(
        "stone", mass=p["M"], com=(0, 0, p["h"]), inertia={"xx": p["A"], "yy": p["B"], "zz": p["C"], "xy": p["D"]}
    )
    m.free("fly", m.ground, stone, sequence="zxy", coordinates=("X", "Y", "Z", "psi", "alpha", "beta"))
    plane = m.ground.at(0, 0, 0, rpy=(math.pi, 0, 0))
    m.rolling("roll", stone, plane, shape="ellipsoid", semi_axes=(p["a"], p["b"], p["c"]))
    for axis in "xyz":
        m.output(f"w{axis}", f"w{axis}_body(stone)")
        m.output(f"a{axis}", f"w{axis}_body_dot(stone)")
    m.independent("psi", "alpha", "beta")
    return m


@pytest.mark.parametrize("method", ["embedding", "augmented", "recursive", "lagrange"])
def test_accelerations_of_kane_and_levinson(method: str) -> None:
    case = reference("rattleback_kane_levinson")["acceleration_test"]
    m = rattleback()
    x, y, z = case["omega"]
    m.initial(alpha=case["alpha"], beta=case["beta"], X=0, Y=0, psi=0.7, wx=x, wy=y, wz=z)
    mod = m.compile(method=method, target="numpy")
    found = mod.outputs(0.0, mod.x0())
    np.testing.assert_allclose(found[::2], case["omega"], atol=1e-12)
    np.testing.assert_allclose(found[1::2], case["omega_dot"], rtol=1e-10)


@pytest.mark.parametrize(
    ("keys", "demand"),
    [
        ({"shape": "ellipsoid"}, "EG-MISSING constraints.roll.semi_axes"),
        ({"shape": "ellipsoid", "semi_axes": (1, 0, 1)}, "EG-RANGE constraints.roll.semi_axes[1] 0"),
        ({"shape": "sphere", "radius": 1, "support": "nx"}, "EG-CONFLICT constraints.roll.support"),
        ({"shape": "convex", "support": "-0.1"}, "EG-RANGE constraints.roll.support curvature"),
        ({"shape": "convex", "support": "0.1*nx"}, "EG-RANGE constraints.roll.support corner"),
        ({"shape": "convex", "support": "log(-1 - nx**2)"}, "EG-RANGE constraints.roll.support number"),
    ],
)
def test_what_is_wrong_is_reported(keys: dict[str, Any], demand: str) -> None:
    m = eg.Model("wrong")
    body = m.body("body", mass=1, inertia=INERTIA)
    m.free("fly", m.ground, body)
    m.rolling("roll", body, **keys)
    refuses(demand, m.check)


# -- Shapes ------------------------------------------------------------------------------------------------------------
G = 9.81
X = {"f_e0": 0.9, "f_e1": 0.2, "f_e2": -0.3, "f_e3": np.sqrt(1 - 0.94), "f_x": 0.3, "f_y": -0.1}
SPIN = {"f_wx": 0.7, "f_wy": -1.1, "f_wz": 2.0}


def stone(com: tuple[float, float, float] = (0.0, 0.0, 0.01), at: float = 0.0, **shape: object) -> eg.Model:
    m = eg.Model("stone", gravity=(0.4, 0, -G))
    body = m.body("stone", mass=1.3, com=com, inertia=(2e-3, 3e-3, 4e-3))
    m.free("f", m.ground, body, rotation="euler_parameters")
    m.rolling("roll", body.at(0, 0, at), **shape)
    m.guess(f_z=0.2)
    return m


def surface(a: float, b: float, c: float) -> np.ndarray:
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 1500), np.linspace(0, np.pi, 800))
    return np.stack([a * np.cos(u) * np.sin(v), b * np.sin(u) * np.sin(v), c * np.cos(v)]).reshape(3, -1)


@pytest.mark.parametrize("support", ["ellipsoid", "sqrt((0.2*nx)**2 + (0.12*ny)**2 + (0.07*nz)**2)"])
def test_the_lowest_point_lies_on_the_plane_and_rests(support: str) -> None:
    """Of all points of the surface the lowest has height 0 and no velocity."""
    more = {"semi_axes": (0.2, 0.12, 0.07)} if support == "ellipsoid" else {"support": support}
    mod = stone(shape="ellipsoid" if support == "ellipsoid" else "convex", **more).compile(target="numpy")
    x = mod.x0(**X, **SPIN)
    pose = mod.poses(x[: mod.n_q])[0]
    points = pose[:3, :3] @ surface(0.2, 0.12, 0.07) + pose[:3, 3:]
    lowest = points[:, points[2].argmin()]
    assert lowest[2] == pytest.approx(0.0, abs=2e-6)
    v = dict(zip(mod.x_names, x, strict=True))
    turn = pose[:3, :3] @ [v["f_wx"], v["f_wy"], v["f_wz"]]
    speed = np.array([v["f_x_dot"], v["f_y_dot"], v["f_z_dot"]]) + np.cross(turn, lowest - pose[:3, 3])
    assert np.abs(speed).max() < 5e-3  # the nearest point of the grid
    run = mod.simulate(1.0, {**X, **SPIN}, rtol=1e-10, atol=1e-12)
    T, V = mod.energy(run.x)
    assert np.abs(T + V - T[0] - V[0]).max() < 1e-7 * T.max()


# -- all of them -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("make", "of"), [
    (cam_model, ("roller", "oscillating")), (cam_model, ("flat_face", "translating")),
    (cam_model, ("knife_edge", "oscillating")), (gearbox, ("ring",)), (gearbox, ("",)), (gearbox, ("ring", "frame")),
    (models.rounded_wheel, ()), (sleigh, ()), (partial(ball, no_spin=True), ()),
])  # fmt: skip
def test_against_multipliers_and_between_methods(make: Any, of: tuple[str, ...]) -> None:
    model = make(*of)
    one, two = (model.compile(method, target="numpy") for method in ("embedding", "lagrange"))
    if "f_e0" in one.q_names:  # its velocities are no rates of coordinates: the judge differentiates along those only
        x = one.project(np.concatenate([one.x0()[: one.n_q], [0.4, 0.1, -0.2, 1.0, 2.0, -1.0]]))
        agree(two.rhs(0.0, x), one.rhs(0.0, x), 1e-12)
        return
    n, rigid = one.n_q, described(model)
    for x in random_states(one, 5, 3):
        q, v = x[:n], x[n:]
        M, h = Bodies(one, q, v).newton_euler(rigid)
        h = h - np.array([0.3 * (q_name == "sun") for q_name in one.q_names])  # the gearbox's motor
        # a cam's contact point has no inertia, so M is singular: any across the constraint's force changes nothing
        expected = augmented(M, h, *loop_terms(one, q, v))
        for mod in (one, two):
            agree(mod.rhs(0.0, x)[n:], expected, 1e-8)
        agree(two.rhs(0.0, x)[n:], one.rhs(0.0, x)[n:], 1e-12 if make is gearbox else 1e-11)
