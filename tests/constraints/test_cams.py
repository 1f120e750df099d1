"""Cams: laws of lift against closed forms, contact with contours against numeric searches for the contact point."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from judges import Bodies, agree, augmented, loop_terms, random_states, rigid_bodies
from scipy.optimize import brentq, minimize_scalar

import eomgen as eg

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


def test_dwell_and_return() -> None:
    mod = cycloidal()
    at = mod.q_names.index("s")
    q, v, a = mod.kinematics([np.deg2rad(180)], [30.0], [0.0])
    assert (q[at], v[at], a[at]) == (0.02, 0, 0)
    q, v, _ = mod.kinematics([np.deg2rad(300)], [30.0], [0.0])
    assert q[at] == pytest.approx(0.01, rel=1e-13)
    assert v[at] == pytest.approx(-float(CYCLOIDAL["vmax"]), rel=1e-13)


def test_the_torque_of_a_cam() -> None:
    """(J + m s'^2) phi'' + m s' s'' phi'^2 = tau, with s' and s'' over the angle (the follower's inertia reflected)."""
    mod = cycloidal("cython")
    h, beta = 0.02, np.deg2rad(120)
    phi, omega = 0.6, 25.0
    first = h / beta * (1 - np.cos(TAU * phi / beta))
    second = h / beta**2 * TAU * np.sin(TAU * phi / beta)
    x = mod.x0(phi=phi, phi_dot=omega)
    expected = -0.4 * first * second * omega**2 / (0.02 + 0.4 * first**2)
    assert mod.rhs(0.0, x)[mod.n_q + mod.v_names.index("phi_dot")] == pytest.approx(expected, rel=1e-12)


# -- contours --------------------------------------------------------------------------------------------------------
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


def test_an_eccentric_circle_is_a_slider_crank() -> None:
    """A circle of radius a about a point e from the axis: the roller's centre keeps a + R from the circle's centre."""
    e, a, R = 0.008, 0.04, 0.01
    text = "0.008*cos(theta) + sqrt(0.04**2 - (0.008*sin(theta))**2)"
    mod = cam_model("roller", "translating", text, radius=R).compile(target="numpy").bind(p={"e": 0.0})
    at = mod.q_names.index("s")
    for phi in (0.3, 1.7, 3.0, 5.0):
        q, v, _ = mod.kinematics([phi], [1.0], [0.0])
        root = np.sqrt((a + R) ** 2 - (e * np.cos(phi)) ** 2)
        assert q[at] == pytest.approx(e * np.sin(phi) + root, rel=1e-12)
        assert v[at] == pytest.approx(e * np.cos(phi) + e**2 * np.cos(phi) * np.sin(phi) / root, rel=1e-11)


@pytest.mark.parametrize("motion", ["translating", "oscillating"])
def test_contour_and_support_function_of_a_circle_agree(motion: str) -> None:
    """The circle's support function is a + e cos(psi); a flat face moves as a + e sin(phi) on it."""
    by_contour = cam_model("flat_face", motion, "0.008*cos(theta) + sqrt(0.04**2 - (0.008*sin(theta))**2)")
    by_support = cam_model("flat_face", motion, support="0.04 + 0.008*cos(theta)")
    one, two = (m.compile(target="numpy") for m in (by_contour, by_support))
    for phi in (0.4, 2.0, 4.4):
        states = []
        for mod in (one, two):
            q, v, a = mod.kinematics([phi], [2.0], [1.0])
            at = mod.q_names.index("s")
            states.append((q[at], v[at], a[at]))
            x = mod.x0(phi=phi, phi_dot=2.0)
            states[-1] += (mod.rhs(0.0, x)[mod.n_q + mod.v_names.index("phi_dot")],)
        np.testing.assert_allclose(states[0], states[1], rtol=1e-10, atol=1e-13)
        if motion == "translating":
            s, c = np.sin(phi), np.cos(phi)
            expected = (0.04 + 0.008 * s, 0.016 * c, 0.008 * (c - 4 * s))
            np.testing.assert_allclose(states[1][:3], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("kind", "motion"), [("roller", "oscillating"), ("flat_face", "translating"), ("knife_edge", "oscillating")]
)
def test_against_multipliers_and_between_methods(kind: str, motion: str) -> None:
    model = cam_model(kind, motion)
    targets = {"embedding": "cython" if kind == "roller" else "numpy", "lagrange": "numpy"}
    modules = [model.compile(method, target=target) for method, target in targets.items()]
    mod = modules[0]
    rigid = rigid_bodies(model.mechanism())
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


def test_a_cam_runs_for_many_turns_and_keeps_its_energy() -> None:
    mod = cam_model("roller", "translating").compile()
    run = mod.simulate((0, 3), initial={"phi": 0.2, "phi_dot": 20.0}, rtol=1e-10, atol=1e-12)
    assert run["phi"][-1] > 8 * TAU
    energy = run["energy"]
    assert np.abs(energy - energy[0]).max() < 1e-7 * np.abs(energy).max()
    assert np.abs(run["touch_contact"] - run["touch_contact"][0]).max() > 8 * TAU - 1


def test_counts_of_cams() -> None:
    """Two bodies, two joints, one contact: the contact point's own coordinate changes nothing."""
    for kind, rows in (("knife_edge", 1), ("roller", 2), ("flat_face", 2)):
        report = cam_model(kind, "translating").check()
        assert report.degrees_of_freedom == report.gruebler_kutzbach_planar == 1
        assert report.constraints == report.rank == rows


def test_the_contact_point_is_not_what_one_integrates() -> None:
    """Where no coordinate is named or chosen, a joint's own is independent, not the angle of the contact point."""
    m = eg.Model("unnamed")
    cam, follower = m.body("wheel", mass=1, inertia={"zz": 0.02}), m.body("follower", mass=0.4)
    m.cam_contact("touch", cam, follower, "roller", contour="0.05 + 0.004*cos(3*theta)", radius=ROLLER)
    m.prismatic("D", m.ground, follower, axis="y")
    m.revolute("A", m.ground, cam)
    m.guess(D=0.06)
    assert m.check().independent == ["A"]


def test_a_face_does_not_touch_the_far_side() -> None:
    """The equations also hold on the side the normal points into; assembly refuses that side."""
    m = cam_model("flat_face", "translating")
    m.guess(s=0.05, touch_contact=-1.5)
    mod = m.compile(target="numpy")
    assert mod.x0(phi=0.1)[mod.x_names.index("s")] > 0.04


def tabled(shape: str, **keys: Any) -> eg.Model:
    """The cam of this file, its contour given by a table of points."""
    m = cam_model(shape, "translating", "profile(theta)", **keys)
    points = np.linspace(0, TAU, 241)
    m.table("profile", points, contour(points), kind="periodic")
    return m


@pytest.mark.parametrize("shape", ["knife_edge", "roller", "flat_face"])
def test_a_contour_by_points_through_a_periodic_spline(shape: str) -> None:
    """A table of 241 points moves the follower as the expression does, to the order of the spline's error."""
    exact, table = (m.compile(target="numpy") for m in (cam_model(shape, "translating"), tabled(shape)))
    for phi in (0.3, 2.5, 4.0, 9.0, -3.0):
        x, y = (mod.kinematics([phi], [3.0], [1.0]) for mod in (exact, table))
        assert exact.q_names == table.q_names
        at = exact.q_names.index("s")
        for level, error in zip(range(3), (1e-9, 1e-6, 1e-4), strict=True):
            assert y[level][at] == pytest.approx(x[level][at], abs=error)


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
    mod = m.compile()
    at = mod.q_names.index("s")
    for degrees, row in CYCLOIDAL["rows"].items():
        q, v, a = mod.kinematics([np.deg2rad(float(degrees)) + TAU], [30.0], [0.0])
        s, s_dot, s_ddot, _ = map(float, row)
        assert q[at] == pytest.approx(s, abs=1e-10)
        assert v[at] == pytest.approx(s_dot, abs=1e-6)
        # the jerk jumps at both ends of the rise, where a cubic's curvature lags by a fraction of a step
        assert a[at] == pytest.approx(s_ddot, abs=0.01 if 0 < float(degrees) < 120 else 0.3)
    run = mod.simulate((0, 1), initial={"phi": 0.1, "phi_dot": 20.0})
    assert np.ptp(run["s"]) == pytest.approx(h, rel=1e-3)


# -- profiles that must close ----------------------------------------------------------------------------------------
OPEN = [
    ("lift", "0.01*theta", "value is 0 at theta = 0 and 0.0628319 at 2 pi"),
    ("lift", "k*theta*(2*pi - theta)", "slope is 0.0628319 at theta = 0 and -0.0628319 at 2 pi at the declared values"),
    ("lift", "law(theta)", "value is 0.01"),
    ("contour", "0.05 + 0.01*theta", "value is 0.05 at theta = 0 and 0.112832 at 2 pi"),
    ("support", "0.05 + k*theta*(2*pi - theta)", "slope"),
]


def lifted(key: str, law: str, **keys: Any) -> eg.Model:
    m = eg.Model("open", gravity=(0, -9.81, 0))
    m.parameter("k", 0.01)
    m.table("law", [0, 2, 4, 6.5], [0.01, 0.02, 0.03, 0.01])  # not of a period of a turn
    wheel, follower = m.body("wheel", mass=1, inertia={"zz": 0.01}), m.body("follower", mass=0.5)
    m.revolute("A", m.ground, wheel, coordinate="phi")
    m.prismatic("D", m.ground, follower, axis="y", coordinate="s")
    if key == "lift":
        m.cam("track", "A", "D", lift=law, **keys)
    else:
        face = follower.marker("face", at=(0, 0, 0), rpy=(-np.pi / 2, 0, 0))
        m.cam_contact("track", wheel, face, "flat_face", **{key: law}, **keys)
    m.independent("phi")
    return m


@pytest.mark.parametrize(("key", "law", "message"), OPEN)
def test_a_periodic_profile_that_does_not_close_is_refused(key: str, law: str, message: str) -> None:
    with pytest.raises(eg.ModelError) as caught:
        lifted(key, law).check()
    (problem,) = caught.value.problems
    assert problem.path == f"constraints.track.{key}"
    assert problem.message.startswith("does not close after a turn: its ")
    assert message in problem.message
    assert "periodic: false" in problem.remedy


def test_within_one_turn_a_profile_need_not_close() -> None:
    """The energy of a lift of constant slope stays, beyond 2 pi too: it is a rack then."""
    mod = lifted("lift", "0.01*theta", periodic=False).compile()
    run = mod.simulate((0, 0.2), initial={"phi": 6.0, "phi_dot": 5.0}, rtol=1e-10, atol=1e-12)
    assert run["phi"][-1] > TAU
    assert run["s"] == pytest.approx(0.01 * run["phi"], abs=1e-12)
    energy = [sum(mod.energy(x)) for x in run.x.T]
    assert np.ptp(energy) < 1e-9


@pytest.mark.parametrize(
    "law",
    [
        "0.03",
        "0.03 + 1e-9*sin(theta)",
        "where(theta < pi, k*(1 - cos(2*theta)), 0)",  # a rise and return, then a dwell
        "k*(sin(theta)**2 + cos(theta)**2)",
    ],
)
def test_profiles_that_close_are_taken(law: str) -> None:
    assert lifted("lift", law).check().degrees_of_freedom == 1
