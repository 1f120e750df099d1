"""First-order states of elements: descriptions, analyses, loops, every stepper, events; by matrices and by hand."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from judges import differences
from model_files import load
from models import IN_C
from refusals import refuses
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from sweeps import TARGETS

import eomgen as eg

KP, KI, C, M, TAU = 8.0, 5.0, 3.0, 2.0, 0.05


@cache
def servo() -> Any:
    """A mass under a proportional-integral controller that sees its speed through a low-pass filter."""
    m = eg.Model("servo")
    m.prismatic("slide", m.ground, m.body("sledge", mass=M), axis="x", coordinate="s")
    m.input("r", 0.7)
    m.input("F", 1.5)
    m.state("z", "r - s")
    m.state("w", f"(vx(sledge) - w)/{TAU}")
    motor = m.actuator("motor", "s", value=f"{KP}*(r - s) + {KI}*z - {C}*w + F")
    m.output("push", motor.force)
    m.output("place", "s")
    return m.compile(target="numpy")


A = np.array([[0, 1, 0, 0], [-KP / M, 0, KI / M, -C / M], [-1, 0, 0, 0], [0, 1 / TAU, 0, -1 / TAU]])
B = np.array([[0, 0], [KP / M, 1 / M], [1, 0], [0, 0]])


def test_an_integrator_finds_its_equilibrium() -> None:
    rest = servo().equilibrium()
    assert rest["s"] == pytest.approx(0.7, abs=1e-12)
    assert rest.states == pytest.approx({"z": -1.5 / KI, "w": 0.0}, abs=1e-12)
    assert np.abs(servo().rhs(0.0, rest.x)).max() < 1e-12
    np.testing.assert_allclose(np.sort_complex(rest.eigenvalues), np.sort_complex(np.linalg.eigvals(A)), rtol=1e-9)
    assert rest.stability == "asymptotically stable"


@pytest.mark.quick
def test_linear_equations_contain_states() -> None:
    linear = servo().linearize(servo().equilibrium().x)
    assert linear.states == ("s", "s_dot", "z", "w")
    np.testing.assert_allclose(linear.A, A, atol=1e-12)
    np.testing.assert_allclose(linear.B, B, atol=1e-12)
    np.testing.assert_allclose(linear.C, [[-KP, 0, KI, -C], [1, 0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(linear.D, [[KP, 1], [0, 0]], atol=1e-12)
    full = servo().linearize(form="full")
    np.testing.assert_allclose(full.A, A, atol=1e-12)
    np.testing.assert_allclose(full.C, linear.C, atol=1e-12)


def test_large_states_do_not_spoil_an_equilibrium() -> None:
    """Oil at some MPa carries a weight: p = m g / area."""
    m = eg.Model("lift", gravity=(0, 0, -9.81))
    m.prismatic("z", m.ground, m.body("table", mass=800.0), axis="z")
    m.state("p", "2e12*(0 - 0.002*z_dot - 1e-12*(p - 5e6) - 4e-5*(z - 0.3))", initial=1e5)
    m.actuator("oil", "z", value="0.002*p")
    mod = m.compile(target="numpy")
    rest = mod.equilibrium()
    p = 800 * 9.81 / 0.002
    assert rest["p"] == pytest.approx(p, rel=1e-11)
    assert rest["z"] == pytest.approx(0.3 - 1e-12 * (p - 5e6) / 4e-5, rel=1e-9)
    held = mod.equilibrium(hold={"z": 0.25})
    assert held["p"] == pytest.approx(5e6 + 4e-5 * 0.05 / 1e-12, rel=1e-9)
    assert held.supports["z"] == pytest.approx(800 * 9.81 - 0.002 * held["p"], rel=1e-9)


@pytest.mark.parametrize(
    "call",
    [
        lambda mod: mod.kinematic_analysis(s=[0.0, 1.0]),
        lambda mod: mod.motion_range("s"),
        lambda mod: mod.actuator_forces(0.0, mod.x0()),
        lambda mod: mod.canonical,
        lambda mod: mod.regressor([0.1], [0.0], [0.0]),
        lambda mod: mod.base_parameters(),
    ],
)
def test_what_knows_no_states_says_so(call: Any) -> None:
    refuses("EG-UNAVAILABLE first-order", lambda: call(servo()))


def sledge() -> eg.Model:
    m = eg.Model("sledge")
    m.parameter("tau", 0.1)
    body = m.body("body", mass=2.0)
    m.prismatic("s", m.ground, body)
    return m


FAULTS: dict[str, tuple[Callable[[eg.Model], object], str]] = {
    "no equation": (lambda m: m.state("a"), "EG-MISSING states.a.rate:"),
    "name of a parameter": (lambda m: m.state("tau", "1"), "EG-NAME-TAKEN states.tau: parameters.tau"),
    "rate is a name": (lambda m: (m.input("a_dot"), m.state("a", 1)), "EG-NAME-TAKEN states.a: 'a_dot' inputs.a_dot"),
    "unknown name": (lambda m: m.state("a", "s/tua"), "EG-NAME-UNKNOWN states.a.rate: 'tau'?"),
    "acceleration": (lambda m: m.state("a", "s_ddot"), "EG-REFERENCE states.a.rate: 's_ddot'"),
    "its own rate": (lambda m: m.state("a", "-a_dot"), "EG-REFERENCE states.a.rate: 'a_dot'"),
    "in a driver": (lambda m: (m.state("a", 1), m.driver("d", "s", "a")), "EG-REFERENCE constraints.d.value: 'a'"),
    "in a mass": (lambda m: (m.state("a", 1), m.body("c", mass="a")), "EG-REFERENCE bodies.c.mass: 'a'"),
    "initial of a stranger": (lambda m: (m.state("act", 1), m.initial(atc=0)), "EG-NAME-UNKNOWN initial.atc: 'act'?"),
    "rate in event": (lambda m: (m.state("a", 1), m.event("e", "a_dot")), "EG-REFERENCE events.e.expression: 'a_dot'"),
}  # fmt: skip


@pytest.mark.parametrize("case", FAULTS)
def test_faults_are_reported_by_their_place(case: str) -> None:
    make, demand = FAULTS[case]
    m = sledge()
    make(m)
    refuses(demand, m.check)


TEXT = """
name: sledge
parameters: {tau: 0.1}
bodies: {body: {mass: 2, markers: {tip: [0.1, 0, 0]}}}
joints: {s: {type: prismatic, between: [ground, body], axis: x}}
forces: {push: {type: actuator, joint: s, value: -5*a - b}}
states:
  a: (vx(body.tip) - a)/tau
  b: {rate: (force(push) - b)/tau, initial: 3, unit: kN, doc: pull, latex: b_p}
outputs: {total: a + b}
initial: {a: 0.25}
"""


def test_text_and_python_make_the_same_model(tmp_path: Path) -> None:
    file = tmp_path / "sledge.yaml"
    file.write_text(TEXT)
    read = eg.load(file)
    m = eg.Model("sledge")
    tau = m.parameter("tau", 0.1)
    body = m.body("body", mass=2)
    tip = body.marker("tip", at=(0.1, 0, 0))
    m.prismatic("s", m.ground, body, axis="x")
    a, b = m.coordinate("a"), m.coordinate("b")
    push = m.actuator("push", "s", value=-5 * a - b)
    assert m.state("a", (tip.velocity[0] - a) / tau, initial=0.25) == a
    m.state("b", (push.force - b) / tau, initial=3, unit="kN", doc="pull", latex="b_p")
    m.output("total", a + b)
    again = tmp_path / "again.yaml"
    read.save(again)
    modules = [one.compile(target="numpy") for one in (read, m, eg.load(again))]
    x = np.array([0.1, 0.4, 0.3, 2.0])
    for mod in modules:
        assert mod.x_names == ("s", "s_dot", "a", "b")
        assert (mod.q_names, mod.v_names, mod.s_names) == (("s",), ("s_dot",), ("a", "b"))
        assert (mod.n_q, mod.n_v, mod.n_s, mod.n_x, mod.n_dof) == (1, 1, 2, 4, 1)
        np.testing.assert_array_equal(mod.x0(), [0.0, 0.0, 0.25, 3000.0])
        np.testing.assert_allclose(mod.rhs(0.0, x), [0.4, (-1.5 - 2.0) / 2.0, 1.0, (-3.5 - 2.0) / 0.1], rtol=1e-14)
        assert mod.outputs(0.0, x) == pytest.approx([2.3])


def crank(states: bool = True) -> eg.Model:
    """A slider-crank whose motor sees the filtered speed of the slider, and a lagged force of the spring.

    Without ``states`` a body of 1 kg on a slide of its own takes the place of each: its speed is the state.
    """
    m = eg.Model("crank", gravity=(0, -9.81, 0))
    r, l = m.parameter("r", 0.1), m.parameter("l", 0.35)
    m.parameter("T", 0.05)
    wheel = m.body("wheel", mass=1.0, com=(r / 2, 0, 0), inertia={"zz": r**2 / 12})
    rod = m.body("rod", mass=0.8, com=(l / 2, 0, 0), inertia={"zz": 0.8 * l**2 / 12}, markers={"tip": (l, 0, 0)})
    slider = m.body("slider", mass=0.5)
    m.revolute("A", m.ground, wheel, coordinate="theta")
    m.revolute("B", wheel.at(r, 0, 0), rod)
    m.revolute("C", "rod.tip", slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.input("u")
    m.spring("k1", m.ground.at(0.5, 0, 0), slider, stiffness=200, length=0.1)
    rates = {"f": "(vx(rod.tip) - f)/T", "d": "50*(force(k1) - d)"}
    if states:
        for name, rate in rates.items():
            m.state(name, rate, initial=20 if name == "d" else 0)
        m.torque("motor", "A", "-0.4*f + u + 0.001*d")
    else:
        for name, rate in rates.items():
            m.prismatic(f"slide_{name}", m.ground, m.body(f"body_{name}", mass=1.0), axis="z", coordinate=f"q{name}")
            m.actuator(f"drive_{name}", f"q{name}", value=rate.replace("- f", "- qf_dot").replace("- d", "- qd_dot"))
        m.torque("motor", "A", "-0.4*qf_dot + u + 0.001*qd_dot")
        m.initial(qd_dot=20)
    m.output("push", "force(k1)")
    m.initial(theta=0.3, theta_dot=10)
    return m


@cache
def crank_module(target: str, states: bool = True) -> Any:
    return crank(states).compile(target=target, **(IN_C if target == "cython" else {}))


def extended(mod: Any, x: np.ndarray) -> np.ndarray:
    """The state of the model with bodies for states."""
    other = crank_module("numpy", states=False)
    names = {"qf_dot": "f", "qd_dot": "d"}
    known = dict(zip(mod.x_names, x, strict=True))
    return np.array([known.get(names.get(name, name), 0.0) for name in other.x_names])


@pytest.mark.parametrize("target", TARGETS)
def test_a_loop_with_states_moves_as_one_with_bodies_in_their_place(target: str) -> None:
    mod, other = crank_module(target), crank_module("numpy", states=False)
    names = {"qf_dot": "f", "qd_dot": "d"}
    for theta in (0.3, 1.2, 2.5):
        x = mod.x0(theta=theta, theta_dot=4.0, f=0.3, d=-7.0)
        found = dict(zip(mod.x_names, mod.rhs(0.1, x, u=[0.3]), strict=True))
        wanted = dict(zip(other.x_names, other.rhs(0.1, extended(mod, x), u=[0.3]), strict=True))
        for name, value in wanted.items():
            if name not in ("qf", "qd"):
                assert found[names.get(name, name)] == pytest.approx(value, rel=1e-10, abs=1e-10)
        np.testing.assert_allclose(mod.jacobian(0.1, x), differences(mod, x, 1e-6, 0.1), rtol=1e-5, atol=2e-4)


@pytest.mark.parametrize("target", TARGETS)
def test_the_projection_keeps_states_to_the_last_bit(target: str) -> None:
    mod = crank_module(target)
    x = mod.x0(theta=1.0, theta_dot=3.0)
    x = x + np.array([1e-3, -2e-3, 1e-3, 0.02, 0.01, -0.03, 0.0, 0.0])
    x[-2:] = 0.1, 1.7e9
    closed = mod.project(x)
    np.testing.assert_array_equal(closed[-2:], x[-2:])
    assert np.abs(mod.constraints(closed[:3])).max() < 1e-12
    assert np.abs(mod.velocity_constraints(closed)).max() < 1e-11  # however large a state is
    assert mod.rhs(0.0, x)[:3] == pytest.approx(closed[3:6], abs=1e-12)


def test_runs_equilibria_and_minimal_form_of_a_loop() -> None:
    mod, other = crank_module("numpy"), crank_module("numpy", states=False)
    traj = mod.simulate(0.5, rtol=1e-10, atol=1e-12)
    wanted = other.simulate(0.5, rtol=1e-10, atol=1e-12)
    for name, twin in (("theta", "theta"), ("f", "qf_dot"), ("d", "qd_dot"), ("push", "push")):
        assert traj[name][-1] == pytest.approx(wanted[twin][-1], rel=1e-6)
    rest = mod.equilibrium()
    assert np.abs(mod.rhs(0.0, rest.x)).max() < 1e-9
    assert rest["d"] == pytest.approx(float(mod.outputs(0.0, rest.x)[0]), rel=1e-10)
    held = mod.equilibrium(hold={"theta": 0.4}, unknowns=["u"])
    assert held["theta"] == pytest.approx(0.4)
    assert np.abs(held.module.rhs(0.0, held.x)).max() < 1e-9
    linear = mod.linearize(rest.x)
    assert linear.states == ("theta", "theta_dot", "f", "d")
    minimal = mod.minimal
    x = minimal.x0(theta=0.3)
    assert minimal.x_names == ("theta", "theta_dot", "f", "d")
    np.testing.assert_allclose(minimal.rhs(0.0, x), mod.rhs(0.0, minimal.expand(x))[[0, 3, 6, 7]], rtol=1e-12)
    start = minimal.x0(**{name: rest[name] for name in ("theta", "f", "d")}, theta_dot=0.0)
    np.testing.assert_allclose(differences(minimal, start, 1e-6), linear.A, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("method", ["lagrange", "recursive", "augmented", "hamilton"])
def test_methods_agree(method: str) -> None:
    mod, one = crank_module("numpy"), crank().compile(method=method, target="numpy")
    x = mod.x0(theta=1.1, theta_dot=-2.0, f=0.2, d=3.0)
    np.testing.assert_allclose(one.rhs(0.2, x), mod.rhs(0.2, x), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(one.jacobian(0.2, x), mod.jacobian(0.2, x), rtol=1e-7, atol=1e-7)


MASS, K, DRAG, GAIN = 2.0, 4.0, 2.5, 3.0


def lag(events: bool = False, tau: float = 0.5) -> eg.Model:
    """A mass on a spring, a lag of first order behind it, and a force in proportion to the lag's value."""
    m = eg.Model("lag")
    m.parameter("k", K)
    m.parameter("tau", tau, unit="s")
    m.input("F")
    m.prismatic("s", m.ground, m.body("b", mass=MASS), axis="x")
    m.actuator("law", "s", value=f"-k*s - {DRAG}*s_dot + F - {GAIN}*a")
    m.state("a", "(s - a)/tau", initial=0.2)
    m.output("y", "a + s")
    m.output("rates", "a_dot + s_ddot")
    m.initial(s=0.1)
    if events:
        m.event("hit", "s - 0.05", direction=-1, reset={"a": "a + 0.5"})
        m.event("low", "a - 0.15", direction=-1)
    return m


@cache
def lag_module(target: str = "numpy", events: bool = False) -> Any:
    return lag(events).compile(target=target, **(IN_C if target == "cython" else {}))


def matrix(k: float = K, tau: float = 0.5) -> np.ndarray:
    return np.array([[0, 1, 0], [-k / MASS, -DRAG / MASS, -GAIN / MASS], [1 / tau, 0, -1 / tau]])


@pytest.mark.parametrize(
    ("target", "method"),
    [
        *(("cython", method) for method in ("DOP853", "Radau", "LSODA", "Taylor", "RK4")),
        *(("numpy", method) for method in ("RK45", "BDF")),
    ],
)
def test_every_stepper_finds_the_matrix_exponential(target: str, method: str) -> None:
    mod = lag_module(target)
    options: dict[str, Any] = {"step": 1e-3} if method == "RK4" else {"rtol": 1e-9, "atol": 1e-11}
    traj = mod.simulate(2.0, method=method, **options)
    x = expm(2.0 * matrix()) @ [0.1, 0.0, 0.2]
    np.testing.assert_allclose(traj.x[:, -1], x, atol=2e-7)
    rates = matrix() @ x
    assert [traj[name][-1] for name in ("a", "a_dot", "y")] == pytest.approx([x[2], rates[2], x[2] + x[0]], abs=1e-6)
    assert traj["rates"][-1] == pytest.approx(rates[2] + rates[1], abs=1e-6)


def test_jacobians_know_states() -> None:
    for mod in (lag_module("cython"), lag_module("numpy")):
        x = np.array([0.3, -0.2, 0.7])
        np.testing.assert_allclose(mod.jacobian(0.0, x), matrix(), rtol=1e-14, atol=1e-15)
        np.testing.assert_allclose(mod.input_jacobian(0.0, x), [[0.0], [1 / MASS], [0.0]], atol=1e-15)
        by_tau = -(x[0] - x[2]) / 0.25
        np.testing.assert_allclose(mod.parameter_jacobian(0.0, x), [[0, 0], [-x[0] / MASS, 0], [0, by_tau]], atol=1e-14)


def with_events(parameters: dict[str, float] | None = None, start: tuple[float, ...] = (0.1, 0.0, 0.2)) -> np.ndarray:
    """The end at t = 3 by SciPy's own events; s passes 0.05 downwards once."""
    A = matrix(**(parameters or {}))
    hit: Any = lambda t, x: x[0] - 0.05  # noqa: E731
    hit.terminal, hit.direction = True, -1
    tight = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    first = solve_ivp(lambda t, x: A @ x, (0, 3), start, events=hit, **tight)
    x = first.y[:, -1] + [0, 0, 0.5]
    assert first.status == 1
    return np.asarray(solve_ivp(lambda t, x: A @ x, (first.t[-1], 3), x, **tight).y[:, -1])


@pytest.mark.parametrize("target", TARGETS)
def test_events_see_states_and_reset_them(target: str) -> None:
    traj = lag_module(target, events=True).simulate(3.0, rtol=1e-10, atol=1e-12)
    assert [len(times) for times in traj.t_events] == [1, 2]
    np.testing.assert_allclose(traj.x[:, -1], with_events(), atol=1e-8)


def test_sensitivities_go_through_resets_of_states() -> None:
    found = lag_module(events=True).sensitivities(["tau", "k", "a"], 3.0, rtol=1e-10, atol=1e-12)
    h = 1e-5
    ends = {
        "tau": [with_events({"tau": 0.5 + sign * h}) for sign in (1, -1)],
        "k": [with_events({"k": K + sign * h}) for sign in (1, -1)],
        "a": [with_events(start=(0.1, 0.0, 0.2 + sign * h)) for sign in (1, -1)],
    }
    for by, (ahead, behind) in ends.items():
        slope = (ahead - behind) / (2 * h)
        np.testing.assert_allclose([found[name, by][-1] for name in ("s", "s_dot", "a")], slope, atol=2e-5)


def test_many_runs_are_single_runs() -> None:
    mod = lag_module(events=True)
    taus, starts = np.array([0.4, 0.5, 0.6, 0.7, 0.9]), np.array([0.1, 0.2, 0.3, 0.05, 0.0])
    many = mod.simulate_many(3.0, parameters={"tau": taus}, initial={"a": starts})
    for k, (tau, a) in enumerate(zip(taus, starts, strict=True)):
        single = mod.simulate(3.0, parameters={"tau": tau}, initial={"a": a}).x[:, -1]
        np.testing.assert_allclose(many.x[:, k], single, rtol=0.0, atol=1e-8)


def test_a_driven_mechanism_integrates_its_states() -> None:
    """s = 0.1 sin 3 t is prescribed; a' = s' - 4 a has a closed form."""
    m = eg.Model("driven")
    m.prismatic("s", m.ground, m.body("b", mass=1.0))
    m.driver("d", "s", "0.1*sin(3*t)")
    m.state("a", "s_dot - 4*a")
    traj = m.compile(target="numpy").simulate(1.0, rtol=1e-10, atol=1e-12)
    exact = 0.3 * (4 * np.cos(3 * traj.t) + 3 * np.sin(3 * traj.t) - 4 * np.exp(-4 * traj.t)) / 25
    np.testing.assert_allclose(traj["a"], exact, atol=1e-9)
    np.testing.assert_allclose(traj["s"], 0.1 * np.sin(3 * traj.t), atol=1e-12)


def test_an_impact_leaves_states_alone() -> None:
    m = eg.Model("bounce", gravity=(0, 0, -9.81))
    m.prismatic("z", m.ground, m.body("b", mass=1.0), axis="z")
    m.state("h", "vz(b) - 2*h")
    m.event("floor", "z", restitution=0.8)
    m.initial(z=1.0)
    traj = m.compile(target="numpy").simulate(1.0, rtol=1e-10, atol=1e-12)
    fall = float(np.sqrt(2 / 9.81))
    flight: Any = lambda t, x: [x[1], -9.81, x[1] - 2 * x[2]]  # noqa: E731
    before = solve_ivp(flight, (0, fall), [1, 0, 0], rtol=1e-11, atol=1e-13).y[:, -1]
    after = solve_ivp(flight, (fall, 1), [0, -0.8 * before[1], before[2]], rtol=1e-11, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(traj.x[:, -1], after, atol=1e-8)


def test_states_without_freedoms(tmp_path: Path) -> None:
    """First-order and sampled states beside bodies that cannot move: s' = -s from 2; s -> s/2 + 1 every 0.1 s."""
    text = "name: w\nbodies: {b: {mass: 1}}\njoints: {j: {type: weld, between: [ground, b]}}\n"
    text += 'states: {s: {rate: "-s", initial: 2}, z: {sampled: "0.5*z+1", period: 0.1, initial: 4}}\n'
    for target in ("numpy", "cython"):
        run = load(tmp_path, text).compile(target=target).simulate((0, 0.25))
        assert run["s"][-1] == pytest.approx(2 * np.exp(-0.25), abs=1e-7)
        assert run["z"][-1] == 2 + 2 / 2**3  # samples at 0, 0.1 and 0.2 s
