"""Drivers: what they hold, what follows from tables, partly driven systems, published answers, contradictions."""

import re
from pathlib import Path
from typing import Any

import judges
import models
import numpy as np
import pytest
import scipy.interpolate
import sympy
import yaml
from models import build, rotation
from refusals import refused, refuses
from sweeps import TARGETS

import eomgen as eg

# -- What they hold ----------------------------------------------------------------------------------------------------
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
@pytest.mark.parametrize("target", TARGETS)
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
        np.testing.assert_allclose(mod.jacobian(t, state), judges.differences(mod, state, 1e-6, t), atol=2e-8)


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
        (("A", "11*t"), "0.01 rad"),  # contradicts a little later
        (("A", "0.2 + 10*t"), "0.2 rad"),
        (("D", "0.3 + 0.1*t"), "0.1 m"),
    ],
)
def test_contradictory_drivers_are_reported_by_name_and_residual(second: tuple[str, str], said: str) -> None:
    m = slider_crank()
    m.driver("d2", *second)
    refuses(f"EG-CONTRADICTION constraints.d2: 1 drive {said} d2,", m.check)


def test_a_driver_out_of_reach_is_reported() -> None:
    refuses("EG-CONTRADICTION constraints.drive C.r_y drive", lambda: slider_crank("1.5 + t", l=0.2, r=0.3).check())


# -- Published ---------------------------------------------------------------------------------------------------------
LINES = models.reference("linkages_straight_line")


@pytest.mark.parametrize("method", ["embedding", pytest.param("lagrange", marks=pytest.mark.thorough)])
def test_car_axis(method: str) -> None:
    """Rheonomic and stiff; published to 21 digits, which the INDEX rates as good to 2e-13 and 5e-12."""
    given = models.reference("caraxis")
    mod = eg.load(models.EXAMPLES / "car_axis.yaml").compile(method=method, target="numpy")
    assert mod.n_dof == 2
    start = mod.outputs(0.0, mod.x0())
    np.testing.assert_allclose(start, [*given["initial_conditions"]["q"], *given["initial_conditions"]["qdot"]])
    run = mod.simulate(float(given["t_end"]))
    published = {name: float(x) for name, x in given["reference_published"].items()}
    for name in ("xl", "yl", "xr", "yr"):
        assert abs(run[name][-1] - published[name]) < 2e-12
        assert abs(run["v" + name][-1] - published[name + "_dot"]) < 5e-11
    # the constraints as published
    r, omega, L = (float(given["parameters"][key]) for key in ("r", "omega", "L"))
    yb = r * np.sin(omega * run.t)
    xb = np.sqrt(L**2 - yb**2)
    assert np.abs(xb * run["xl"] + yb * run["yl"]).max() < 1e-13
    assert np.abs((run["xl"] - run["xr"]) ** 2 + (run["yl"] - run["yr"]) ** 2 - L**2).max() < 1e-13


def test_kapitza_pendulum() -> None:
    given = models.reference("kapitza_pendulum")
    mod = eg.load(models.EXAMPLES / "kapitza_pendulum.yaml").compile(target="numpy")
    times = sorted(given["trajectory"], key=float)
    run = mod.simulate((0, 1), t_eval=[float(t) for t in times])
    for k, t in enumerate(times):
        angle, rate = map(float, given["trajectory"][t])
        assert abs(run["theta"][k] - angle) < 1e-11
        assert abs(run["theta_dot"][k] - rate) < 1e-10
    # slower than the threshold of the averaged equation it falls over
    end = [mod.simulate(20.0, parameters={"Omega": f * float(given["threshold_Omega"])}) for f in (0.9, 1.25)]
    fell = [np.abs(run["theta"] - np.pi).max() > 2.0 for run in end]
    assert fell == [True, False]


def linkage(
    name: str, start: float, pivots: tuple[float, float], crank: float, coupler: float, rocker: float, point: float
) -> eg.Model:
    """A massless four-bar with the left crank at (0, 0) driven, and a point on the line of its coupler."""
    m = eg.Model(name)
    one, bar, two = (m.body(part, mass=0) for part in ("crank", "coupler", "rocker"))
    m.revolute("A", m.ground, one, coordinate="theta")
    m.revolute("B", one.at(crank, 0, 0), bar, coordinate="bend")
    m.revolute("C", bar.at(coupler, 0, 0), two.at(rocker, 0, 0))
    m.revolute("D", m.ground.at(*pivots, 0), two, coordinate="psi")
    p = bar.marker("P", at=(point, 0, 0))
    m.output("P_x", p.position[0])
    m.output("P_y", p.position[1])
    m.parameter("start", start)
    m.driver("drive", "theta", "start + t")
    return m


@pytest.mark.parametrize("name", ["chebyshev", "hoecken", "watt"])
def test_straight_line_linkages(name: str) -> None:
    rows = LINES[name]["rows"]
    angles = np.array(sorted(float(key) for key in rows))
    if name != "chebyshev":
        angles = np.radians(angles)
    if name == "chebyshev":
        m = linkage(name, angles[0], (4, 0), 5, 2, 5, 1)
        m.guess(theta=angles[0], bend=np.pi - 0.6, psi=2.3)
    elif name == "hoecken":
        m = linkage(name, angles[0], (2, 0), 1, 2.5, 2.5, 5)
        m.guess(theta=angles[0], bend=-0.5, psi=1.6)
    else:
        m = linkage(name, angles[0], (2, 0.5), 1, 0.5, 1, 0.25)
        m.guess(theta=angles[0], bend=np.pi / 2, psi=np.pi)
    mod = m.compile(target="numpy")
    keys = sorted(rows, key=float)
    found = mod.kinematic_analysis(t=angles - angles[0])
    expected = np.array([[float(x) for x in rows[key]] for key in keys])
    np.testing.assert_allclose(np.array([found["P_x"], found["P_y"]]).T, expected, atol=1e-12)
    fine = mod.kinematic_analysis(t=np.linspace(0, angles[-1] - angles[0], 201))
    off = {"chebyshev": fine["P_y"] - 4, "hoecken": fine["P_y"] - 4, "watt": fine["P_x"] - 1}[name]
    assert np.abs(off).max() < 0.02 * np.hypot(np.ptp(fine["P_x"]), np.ptp(fine["P_y"]))  # nearly a straight line


# -- What cannot act ---------------------------------------------------------------------------------------------------


def test_a_driver_of_a_distance_that_no_motion_changes() -> None:
    m, tip = arm()
    m.driver("d", between=[m.ground.at(0, 0, 0), tip], value="2 + 0.1*t")
    refuses("EG-REDUNDANT constraints.d", m.check)


# -- Corners and ends --------------------------------------------------------------------------------------------------


def test_a_motion_that_ends_is_reported_as_such() -> None:
    m, _ = arm()
    m.driver("motor", "A", "sqrt(1 - t)")
    refuses("EG-STALLED 1 motor", m.compile(target="numpy").simulate, (0, 2))


# -- the constraints section -------------------------------------------------------------------------------------------
TEXT = """\
name: everything
parameters: {r: 0.1, n: 3, k: 0.2}
inputs: {u: 1}
bodies:
  one: {mass: 1, inertia: {zz: 1}}
  two: {mass: 1, inertia: {zz: 1}}
  bar: {mass: 1}
  arm: {mass: 1, inertia: {zz: 1}}
  sat: {mass: 1, inertia: {zz: 1}}
  ball: {mass: 1, inertia: [1, 1, 1]}
joints:
  A: {type: revolute, between: [ground, one], coordinate: alpha}
  B: {type: revolute, between: [ground, two], coordinate: beta}
  C: {type: prismatic, between: [ground, bar], axis: x, coordinate: s}
  D: {type: revolute, between: [ground, arm], coordinate: gamma}
  E: {type: revolute, between: [arm, sat], coordinate: delta}
  F: {type: free, between: [ground, ball]}
constraints:
  c1: {type: coupling, coordinates: {A: 1, beta: -n}, offset: k}
  c2: {type: coupling, equation: s - r*sin(alpha) - 0.01*t}
  c3: {type: gear, joints: [A, B], teeth: [20, 60], internal: true, phase: k}
  c4: {type: planetary, sun: A, ring: B, carrier: D, planet: E, radii: {sun: r, ring: n*r}}
  c5: {type: rack, pinion: A, rack: C, radius: -r, offset: k}
  c6: {type: belt, joints: [A, B], radii: [r, 2*r], crossed: true}
  c7: {type: cam, cam: A, follower: C, lift: k + r*cos(theta), phase: 0.1, periodic: false}
  c8: {type: cam_contact, cam: one, follower: bar, shape: roller, contour: k + r*cos(theta), radius: r/9, coordinate: c}
  c9: {type: cam_contact, cam: one, follower: bar, shape: flat_face, support: k + r*cos(theta)}
  d1: {type: rolling, wheel: ball, plane: ground, radius: r, shape: sphere, no_spin: true}
  d2: {type: rolling, wheel: {body: ball, at: [0, 0, r], rpy: [k, 0, 0]}, radius: r, tube: r/8}
  d3: {type: knife_edge, marker: ball, axis: x, on: one}
  d4: {type: gear, joints: [A, B], cones: [0.5, 0.6]}
  e1: {type: driver, coordinate: A, value: k*sin(n*t) + t**2}
  e2: {type: driver, between: [ball, {body: one, at: [r, 0, 0]}], value: 1 + k*t}
  e3: {type: driver, angle: [ground, sat], value: n*t}
  e4: {type: driver, marker: ball, axis: [0, 0.6, 0.8], on: arm, value: r*t}
"""


def from_python() -> eg.Model:
    m = eg.Model("everything")
    r, n, k = m.parameter("r", 0.1), m.parameter("n", 3), m.parameter("k", 0.2)
    m.input("u", 1)
    one, two = m.body("one", mass=1, inertia={"zz": 1}), m.body("two", mass=1, inertia={"zz": 1})
    bar = m.body("bar", mass=1)
    arm, sat = m.body("arm", mass=1, inertia={"zz": 1}), m.body("sat", mass=1, inertia={"zz": 1})
    ball = m.body("ball", mass=1, inertia=(1, 1, 1))
    A = m.revolute("A", m.ground, one, coordinate="alpha")
    B = m.revolute("B", m.ground, two, coordinate="beta")
    C = m.prismatic("C", m.ground, bar, axis="x", coordinate="s")
    m.revolute("D", m.ground, arm, coordinate="gamma")
    m.revolute("E", arm, sat, coordinate="delta")
    m.free("F", m.ground, ball)
    theta = sympy.Symbol("theta")
    profile = k + r * sympy.cos(theta)
    m.coupling("c1", {A: 1, B.coordinate: -n}, offset=k)
    m.coupling("c2", equation=C.coordinate - r * sympy.sin(A.coordinate) - m.t / 100)
    m.gear("c3", A, B, teeth=(20, 60), internal=True, phase=k)
    m.planetary("c4", sun=A, ring=B, carrier="D", planet="E", radii={"sun": r, "ring": n * r})
    m.rack("c5", A, C, radius=-r, offset=k)
    m.belt("c6", A, B, radii=(r, 2 * r), crossed=True)
    m.cam("c7", A, C, lift=profile, phase=0.1, periodic=False)
    m.cam_contact("c8", one, bar, "roller", contour=profile, radius=r / 9, coordinate="c")
    m.cam_contact("c9", one, bar, "flat_face", support=profile)
    m.rolling("d1", ball, m.ground, r, shape="sphere", no_spin=True)
    m.rolling("d2", ball.at(0, 0, r, rpy=(k, 0, 0)), radius=r, tube=r / 8)
    m.knife_edge("d3", ball, axis="x", on=one)
    m.gear("d4", A, B, cones=(0.5, 0.6))
    m.driver("e1", A, k * sympy.sin(n * m.t) + m.t**2)
    m.driver("e2", between=(ball, one.at(r, 0, 0)), value=1 + k * m.t)
    m.driver("e3", angle=(m.ground, sat), value="n*t")
    m.driver("e4", marker=ball, axis=(0, 0.6, 0.8), on=arm, value=r * m.t)
    return m


def load(tmp_path: Path, text: str) -> eg.Model:
    path = tmp_path / "model.yaml"
    path.write_text(text, encoding="utf-8")
    return eg.load(path)


def plain(value: Any) -> Any:
    """The same data whatever the order of keys and of terms."""
    if isinstance(value, dict):
        return {key: plain(part) for key, part in value.items()}
    if isinstance(value, list):
        return [plain(part) for part in value]
    if not isinstance(value, str):
        return value
    names = {name: sympy.Symbol(name) for name in re.findall(r"[a-z]\w*", value) if name not in ("sin", "cos")}
    return str(sympy.nsimplify(sympy.sympify(value, locals=names), rational=True))


def test_python_and_file_say_the_same_and_both_round_trip(tmp_path: Path) -> None:
    models = [load(tmp_path, TEXT), from_python()]
    models += [load(tmp_path, m.to_yaml()) for m in models]
    first, *others = (plain(yaml.safe_load(m.to_yaml())) for m in models)
    assert len(first["constraints"]) == 17
    for other in others:
        assert other == first


BROKEN = [
    ("joints: [A, B], teeth", "joints: [A, G], teeth", 21, "EG-NAME-UNKNOWN c3.joints[1]: G"),
    ("joints: [A, B], teeth", "joints: [A, F], teeth", 21, "EG-REFERENCE c3.joints[1]: 6 F_x"),
    ("joints: [A, B], teeth", "joints: [A, C], teeth", 21, "EG-REFERENCE c3.joints[1]: 's'"),
    ("joints: [A, B], teeth", "joints: [A, E], teeth", 21, "EG-REFERENCE c3.joints: planetary"),
    ("teeth: [20, 60]", "teeth: [20, -60]", 21, "EG-RANGE c3.teeth[1]: -60"),
    ("internal: true", "internal: 1", 21, "EG-TYPE c3.internal: 1"),
    ("type: rack", "type: rak", 23, "EG-CHOICE c5.type: rak 'rack'?"),
    ("radius: -r, offset", "radius: -r, ofset: 1, offset", 23, "EG-NAME-UNKNOWN c5.ofset: 'offset'?"),
    ("coordinates: {A: 1, beta: -n}", "coordinates: {A: 1, bet: 2}", 19, "EG-NAME-UNKNOWN c1.coordinates.bet: 'beta'?"),
    ("- 0.01*t", "- ax(one)", 20, "EG-REFERENCE c2.equation: ax(one)"),
    ("- 0.01*t", "- wx(one)*wz(two)", 20, "EG-EXPRESSION c2.equation: wx(one), wz(two)"),
    ("- 0.01*t", "- kinetic_energy", 20, "EG-REFERENCE c2.equation: energies"),
    ("radii: {sun: r, ring: n*r}", "radii: {sun: 1, ring: 3, planet: 2}", 22, "EG-RANGE c4.radii: ring 3"),
    ("lift: k + r*cos(theta)", "lift: k + r*cos(alpha)", 25, "EG-REFERENCE c7.lift: alpha"),
    (", coordinate: c}", ", coordinate: beta}", 26, "EG-NAME-TAKEN c8.coordinate: 'beta'"),
    ("shape: flat_face, supp", "shape: knife_edge, supp", 27, "EG-CONFLICT c9.support:"),
    ("shape: sphere, no_spin", "shape: disc, no_spin", 28, "EG-CONFLICT d1.no_spin:"),
    ("k*sin(n*t) + t**2", "k*s", 32, "EG-REFERENCE e1.value: s"),
    ("coordinate: A, value", "coordinate: A, marker: one, value", 32, "EG-CONFLICT e1: both coordinate marker"),
    ("angle: [ground, sat]", "angle: [sat, sat]", 34, "EG-REFERENCE e3.angle:"),
    ("  d4: {", "  c3: {", 31, "EG-FILE-DAMAGED c3:"),
]


@pytest.mark.parametrize(("old", "new", "line", "demand"), BROKEN)
def test_faults(old: str, new: str, line: int, demand: str, tmp_path: Path) -> None:
    assert TEXT.count(old) == 1
    with refused(f"{demand} model.yaml:{line}:") as caught:
        load(tmp_path, TEXT.replace(old, new)).check()
    assert len({p.path for p in caught.value.problems}) == 1


def test_a_lagrangian_may_be_coupled() -> None:
    """Two masses on springs, held equal by a coupling: x'' = -(k1 + k2)/(m1 + m2) x."""
    x, y, x_dot, y_dot = sympy.symbols("x y x_dot y_dot")
    L = (2 * x_dot**2 + 3 * y_dot**2) / 2 - (5 * x**2 + 7 * y**2) / 2
    m = eg.Model.from_lagrangian("two", L, [x, y])
    m.coupling("equal", {x: 1, y: -1})
    mod = m.compile(target="numpy")
    state = mod.x0(x=0.3)
    np.testing.assert_allclose(mod.rhs(0.0, state)[2:], [-12 / 5 * 0.3] * 2, rtol=1e-13)


def test_angles_that_close_loops_in_space_are_refused() -> None:
    """Such an angle is known up to full turns only: a coupling would jump with it."""
    m = build("spatial_loop")
    wheel = m.body("wheel", mass=1, inertia=(1, 1, 1))
    m.revolute("W", m.ground, wheel, coordinate="turn")
    m.coupling("follow", {"C_3": 1, "turn": -1})
    refuses("EG-UNDEFINED constraints.follow C_3", m.derive)


def laws() -> eg.Model:
    """Two sliders, a spring, a damper, and laws of an input and of states."""
    m = eg.Model("laws")
    a, b = m.body("a", mass=2, inertia={"zz": 1}), m.body("b", mass=1)
    m.prismatic("x", m.ground, a, axis="x")
    m.prismatic("y", m.ground, b, axis="x")
    m.input("u", 1)
    m.state("s", rate="-s", initial=1)
    m.sampled("held", "0.5 + t", period=0.2)
    m.joint_spring("K", "x", stiffness=3)
    m.joint_damper("D", "x", damping=2)
    m.output("slow", "2*s*x")
    m.initial(x=1)
    return m


REFUSED = [
    ("x - s", "EG-REFERENCE 's'"),
    ("x_dot - s", "EG-REFERENCE 's'"),
    ("slow - 1", "EG-REFERENCE 's'"),
    ("x - held", "EG-REFERENCE 'held'"),
    ("x - s_dot", "EG-REFERENCE 's_dot'"),
    ("power(D) - 1", "EG-EXPRESSION power(D)"),
    ("wx(a) - 1", "EG-CONTRADICTION c.equation -1"),
    ("vy(a) - u", "EG-CONTRADICTION c.equation u"),
    ("x == 2*y", "EG-EXPRESSION comparison"),
]


@pytest.mark.parametrize(("equation", "demand"), REFUSED)
@pytest.mark.parametrize("closes", [None, "1 - t"])
def test_an_equation_that_cannot_be_held_is_refused(equation: str, demand: str, closes: str | None) -> None:
    m = laws()
    m.coupling("c", equation=equation, **({} if closes is None else {"closes": closes}))
    if equation == "x - held" and closes:
        assert m.derive()
        return
    with refused(f"{demand} constraints.c") as caught:
        m.derive()
    assert len(caught.value.problems) == 1


def test_the_law_of_an_element_in_an_equation() -> None:
    """y' = -2 x', by the damper's force: 6 x'' + 2 x' + 3 x = 0; a held rate and length are those of the slider."""
    m = laws()
    m.coupling("c", equation="y_dot - force(D)")
    run = m.compile(target="numpy").simulate(1.0, initial={"x": 1.0})
    decay, w = 1 / 6, np.sqrt(17) / 6
    x = np.exp(-decay * run.t) * (np.cos(w * run.t) + decay / w * np.sin(w * run.t))
    assert run["x"] == pytest.approx(x, abs=1e-7)
    assert run["y"] == pytest.approx(2 - 2 * x, abs=1e-7)
    for equation, end in (("rate(D) - 1", 2.0), ("length(K) - 1", 1.0), ("force(D) + 2", 2.0)):
        m = laws()
        m.coupling("c", equation=equation)
        speed = {} if "length" in equation else {"x_dot": 1.0}
        assert m.compile(target="numpy").simulate(1.0, initial=speed)["x"][-1] == pytest.approx(end, abs=1e-9)
