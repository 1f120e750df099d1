"""Cams: laws of lift against closed forms, contact with contours against numeric searches for the contact point."""

from typing import Any

import models
import numpy as np
import pytest
from judges import Bodies, agree, augmented, described, loop_terms, random_states
from scipy.optimize import brentq, minimize_scalar

import eomgen as eg

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


@pytest.mark.parametrize(
    ("kind", "motion"), [("roller", "oscillating"), ("flat_face", "translating"), ("knife_edge", "oscillating")]
)
def test_against_multipliers_and_between_methods(kind: str, motion: str) -> None:
    model = cam_model(kind, motion)
    targets = {"embedding": "numpy", "lagrange": "numpy"}
    modules = [model.compile(method, target=target) for method, target in targets.items()]
    mod = modules[0]
    rigid = described(model)
    n = mod.n_q
    for x in random_states(mod, 5, 2):
        q, v = x[:n], x[n:]
        M, h = Bodies(mod, q, v).newton_euler(rigid)
        # the contact point has no inertia, so M is singular: any inertia across the constraint's force changes nothing
        C_q, gamma = loop_terms(mod, q, v)
        expected = augmented(M, h, C_q, gamma)
        for other in modules:
            agree(other.rhs(0.0, x)[n:], expected, 1e-8)
        agree(modules[1].rhs(0.0, x)[n:], modules[0].rhs(0.0, x)[n:], 1e-11)


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
