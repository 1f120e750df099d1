"""Drivers: what they hold, what follows from tables, partly driven systems, and drivers that contradict each other.

The judges are closed forms (law of cosines, projections), SciPy's splines, and a driven pendulum's own equation.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.interpolate
from models import rotation

import eomgen as eg
from eomgen.kinematics import analyse

TIMES = np.linspace(0.0, 0.9, 10)


def arm(length: float = 2.0) -> tuple[eg.Model, object]:
    m = eg.Model("arm")
    body = m.body("arm", mass=0)
    m.revolute("A", m.ground, body, coordinate="phi")
    m.guess(phi=0.9)
    return m, body.at(length, 0, 0)


def run(m: eg.Model, t: np.ndarray = TIMES) -> object:
    return m.compile(target="numpy").kinematic_analysis(t=t)


def test_a_distance_by_the_law_of_cosines() -> None:
    """A ram between (3, 0) and the tip of an arm of length 2: d^2 = 4 + 9 - 12 cos(phi), differentiated twice."""
    m, tip = arm()
    m.driver("ram", between=(m.ground.at(3, 0, 0), tip), value="2 + 0.3*sin(2*t)")
    found = run(m)
    d, d1, d2 = 2 + 0.3 * np.sin(2 * TIMES), 0.6 * np.cos(2 * TIMES), -1.2 * np.sin(2 * TIMES)
    phi = np.arccos((13 - d**2) / 12)
    phi1 = 2 * d * d1 / (12 * np.sin(phi))
    phi2 = (2 * d1**2 + 2 * d * d2 - 12 * np.cos(phi) * phi1**2) / (12 * np.sin(phi))
    for ours, theirs in zip((found["phi"], found["phi_dot"], found["phi_ddot"]), (phi, phi1, phi2), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-12)


def test_the_place_of_a_marker_along_an_axis_of_another() -> None:
    """The tip's place along a slanted axis of a marker off the origin: a . R^T (tip - o) = value."""
    m, tip = arm()
    rpy, axis = (0.0, 0.0, 0.4), np.array([0.6, 0.8, 0.0])
    m.driver("lift", marker=tip, axis=axis.tolist(), on=m.ground.at(0.1, -0.2, 0, rpy=rpy), value="1.2 + 0.2*t**2")
    found = run(m)
    way = np.array(rotation(rpy)) @ axis
    tip_at = 2 * np.array([np.cos(found["phi"]), np.sin(found["phi"]), 0 * TIMES])
    np.testing.assert_allclose(way @ (tip_at - np.array([[0.1], [-0.2], [0]])), 1.2 + 0.2 * TIMES**2, atol=1e-13)
    tip_rate = way @ np.array([-tip_at[1], tip_at[0], 0 * TIMES])
    np.testing.assert_allclose(tip_rate * found["phi_dot"], 0.4 * TIMES, atol=1e-13)
    curve = -(way @ tip_at) * found["phi_dot"] ** 2 + tip_rate * found["phi_ddot"]
    np.testing.assert_allclose(curve, 0.4, atol=1e-12)


def test_the_angle_of_a_body_from_another() -> None:
    """The forearm keeps an angle to the ground, whatever the upper arm does: elbow = value - shoulder."""
    m, tip = arm()
    fore = m.body("fore", mass=0)
    m.revolute("E", tip, fore, coordinate="elbow")
    m.driver("shoulder", "A", "sin(t)")
    m.driver("level", angle=(m.ground, fore), value="7*t")
    found = run(m)
    np.testing.assert_allclose(found["elbow"], 7 * TIMES - np.sin(TIMES), atol=1e-13)
    np.testing.assert_allclose(found["elbow_ddot"], np.sin(TIMES), atol=1e-13)


def test_an_angle_that_is_not_defined_is_refused() -> None:
    m, tip = arm()
    m.revolute("E", tip, m.body("fore", mass=0), axis="y")
    m.driver("level", angle=(m.ground, "fore"), value="t")
    with pytest.raises(
        eg.ModelError, match=r"constraints.level: the z axes .* do not stay in line.*drive a coordinate"
    ):
        m.check()


@pytest.mark.parametrize(("kind", "ends"), [("cubic", "not-a-knot"), ("natural", "natural"), ("periodic", "periodic")])
def test_a_table_drives_with_the_rates_of_its_spline(kind: str, ends: str) -> None:
    x = np.linspace(0, 2, 9)
    y = np.array([0, 0.4, 0.1, 0.7, 0.9, 0.2, -0.3, 0.1, 0.0])
    m, _ = arm()
    profile = m.table("profile", x, y, kind=kind)
    m.driver("drive", "A", profile(m.t))
    t = np.linspace(0.0, 1.99, 57)
    found, spline = run(m, t), scipy.interpolate.CubicSpline(x, y, bc_type=ends)
    for level, name in enumerate(("phi", "phi_dot", "phi_ddot")):
        np.testing.assert_allclose(found[name], spline(t, level), rtol=1e-11, atol=1e-12)
    # continuous curvature: the acceleration at a point of the table is the same from both sides
    inner = x[1:-1]
    before, after = run(m, inner - 1e-9)["phi_ddot"], run(m, inner + 1e-9)["phi_ddot"]
    assert np.abs(before - after).max() < 1e-6


@pytest.mark.parametrize(
    ("kind", "value", "said"),
    [("monotone", "profile(t)", "of monotone table 'profile'"), ("cubic", "diff(profile(t), 1)", "of the derivative")],
)
def test_tables_whose_acceleration_jumps_are_refused(kind: str, value: str, said: str) -> None:
    m, _ = arm()
    m.table("profile", [0, 1, 2, 3], [0, 1, 1, 0], kind=kind)
    m.driver("drive", "A", value)
    with pytest.raises(eg.ModelError, match=f"constraints.drive.value: the acceleration {said}.*periodic"):
        m.check()


def test_an_euler_parameter_cannot_be_driven() -> None:
    m = eg.Model("ball")
    m.spherical("S", m.ground, m.body("b", mass=1, inertia=(1, 1, 1)), rotation="euler_parameters")
    m.driver("drive", "S_e1", "t")
    with pytest.raises(eg.ModelError, match="S_e1.*is an Euler parameter"):
        m.check()


def driven_pendulum(coordinate: str = "y") -> eg.Model:
    """A pendulum whose pivot moves up and down by a spline."""
    m = eg.Model("shaken", gravity=(0, -9.81, 0))
    x = np.linspace(0, 2, 11)
    lift = m.table("lift", x, 0.2 * np.sin(4 * x))
    pivot, bob = m.body("pivot", mass=0.4), m.body("bob", mass=1.5, com=(0, -0.7, 0))
    m.prismatic("guide", m.ground, pivot, axis="y", coordinate="y")
    m.revolute("hinge", pivot, bob, coordinate="theta")
    m.driver("shaker", coordinate, lift(m.t))
    m.independent("theta")
    return m


@pytest.mark.parametrize("method", ["embedding", "lagrange"])
@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_a_partly_driven_pendulum_obeys_its_own_equation(method: str, target: str) -> None:
    """L theta'' = -(g + y'') sin(theta), y'' from SciPy's spline (Landau and Lifshitz, Mechanics, sec. 30)."""
    mod = driven_pendulum().compile(method=method, target=target)
    x = np.linspace(0, 2, 11)
    spline = scipy.interpolate.CubicSpline(x, 0.2 * np.sin(4 * x))
    assert (mod.n_dof, mod.q_names) == (1, ("y", "theta"))
    rng = np.random.default_rng(3)
    for t, theta, theta_dot in zip(rng.uniform(0, 2, 20), rng.uniform(-3, 3, 20), rng.uniform(-5, 5, 20), strict=True):
        state = mod.x0(theta=theta, theta_dot=theta_dot, t=t)
        np.testing.assert_allclose(state, [spline(t), theta, spline(t, 1), theta_dot], atol=1e-12)
        expected = -(9.81 + spline(t, 2)) * np.sin(theta) / 0.7
        np.testing.assert_allclose(mod.rhs(t, state), [*state[2:], spline(t, 2), expected], rtol=1e-11, atol=1e-11)
        J = mod.jacobian(t, state)
        for k in range(4):
            h = np.zeros(4)
            h[k] = 1e-6
            slope = (mod.rhs(t, state + h) - mod.rhs(t, state - h)) / 2e-6
            np.testing.assert_allclose(J[:, k], slope, atol=2e-8)


def test_driven_joints_stay_in_the_tree() -> None:
    """A driver on the joint that would be cut: its coordinate is one of the tree's all the same."""
    m = eg.Model("loop")
    a, b, c = (m.body(name, mass=1, inertia={"zz": 1}) for name in "abc")
    m.revolute("A", m.ground, a)
    m.revolute("B", a.at(0.1, 0, 0), b)
    m.revolute("C", b.at(0.3, 0, 0), c)
    m.prismatic("D", m.ground, c, axis="x")
    assert [m.mechanism().joints[k].name for k in analyse(m.mechanism()).topology.cut] == ["C"]
    m.driver("drive", "C", "0.4 + t")
    assert "C" in analyse(m.mechanism()).names


def slider_crank(value: str = "10*t", l: float = 0.3, r: float = 0.1, e: float = 0.0) -> eg.Model:
    m = eg.Model("crank")
    crank, rod, slider = (m.body(name, mass=0) for name in ("crank", "rod", "slider"))
    m.revolute("A", m.ground, crank)
    m.revolute("B", crank.at(r, 0, 0), rod)
    m.revolute("C", rod.at(l, 0, 0), slider)
    m.prismatic("D", m.ground.at(0, e, 0), slider, axis="x")
    m.driver("drive", "A", value)
    m.guess(D=0.4, B=0)
    return m


@pytest.mark.parametrize(
    ("second", "said"),
    [
        (("A", "11*t"), r"d2 is off by 0.01 rad at t = 0.01 s"),  # contradicts a little later
        (("A", "0.2 + 10*t"), r"d2 is off by 0.2 rad at t = 0 s"),
        (("D", "0.3 + 0.1*t"), r"d2 is off by 0.1 m at t = 0 s"),
    ],
)
def test_contradictory_drivers_are_told_by_name_and_residual(second: tuple[str, str], said: str) -> None:
    m = slider_crank()
    m.driver("d2", *second)
    with pytest.raises(
        eg.ModelError, match=f"constraints.d2: .*over-driven: it has 1 degree.*drive moves it.*{said}"
    ) as e:
        m.check()
    assert "remove one of drive, d2" in str(e.value)


def test_drivers_that_agree_may_stay() -> None:
    m = slider_crank()
    m.driver("d2", "D", "0.1*cos(10*t) + sqrt(0.09 - 0.01*sin(10*t)**2)")
    report = m.check()
    assert (report.degrees_of_freedom, report.redundant) == (0, ["d2.motion"])


def test_a_driver_out_of_reach_is_told() -> None:
    with pytest.raises(
        eg.AssemblyError, match=r"constraints.drive: .*C.r_y 0.09.*off \(drive by .* rad\); give the drivers"
    ):
        slider_crank("1.5 + t", l=0.2, r=0.3).check()


def test_a_loop_that_cannot_close_is_not_blamed_on_the_driver() -> None:
    with pytest.raises(eg.AssemblyError, match=r"joints.C: the loops do not close.*C.r_y 0.25.*check the dimensions"):
        slider_crank(l=0.05, r=0.2, e=0.5).check()


def test_initial_values_that_contradict_a_driver() -> None:
    m = slider_crank()
    m.initial(A=0.3)
    with pytest.raises(eg.AssemblyError, match="A = 0.3 are inconsistent.*at t = 0 the drivers prescribe drive"):
        m.check()
