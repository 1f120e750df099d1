"""Integrators held ready, single steps and steps of one size: the results of whole runs, each call as if the first."""

import os
import re
import signal
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from analysed import compiled
from models import IN_C
from refusals import refused, refuses
from scipy.integrate import solve_ivp
from sweeps import part_of

import eomgen as eg

TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def spring(target: str) -> Any:
    """x'' = (F - k x) / m, which has a closed form."""
    m = eg.Model("spring")
    k, force = m.parameter("k", 9.0), m.input("F", 0.0)
    m.prismatic("J", m.ground, m.body("cart", mass=2), axis="x", coordinate="x")
    m.torque("push", "J", force - k * m.coordinate("x"))
    m.initial = {"x": 0.3}
    return m.compile(target=target, **(IN_C if target == "cython" else {}))


@pytest.fixture(scope="module", params=["cython", "numpy"])
def cart(request: pytest.FixtureRequest) -> Any:
    return spring(request.param)


@pytest.fixture(scope="module")
def in_c() -> Any:
    return spring("cython")


@pytest.fixture(scope="module")
def four_bar() -> Any:
    return compiled("four_bar", "cython")


def closed_form(x: Any, h: float, k: float = 9.0, force: float = 0.0) -> np.ndarray:
    w, rest = np.sqrt(k / 2.0), force / k
    a, b = x[0] - rest, x[1] / w
    return np.array([rest + a * np.cos(w * h) + b * np.sin(w * h), w * (b * np.cos(w * h) - a * np.sin(w * h))])


@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau", "LSODA"])
def test_the_closed_form(cart: Any, method: str) -> None:
    go = cart.integrator(method=method, **TIGHT)
    x = [0.3, -0.2]
    for h in (1.7, 0.01, -2.5, 0.0):
        np.testing.assert_allclose(go(5.0, x, h), closed_form(x, h), atol=2e-8)
        assert go.evaluations > 0 or h == 0.0


def test_parameters_and_inputs_of_a_call(cart: Any) -> None:
    go = cart.integrator(**TIGHT)
    x = np.array([0.3, 0.0])
    np.testing.assert_allclose(go(0.0, x, 1.0, u=[2.0]), closed_form(x, 1.0, force=2.0), atol=1e-8)
    np.testing.assert_allclose(go(0.0, x, 1.0, p=[4.0]), closed_form(x, 1.0, k=4.0), atol=1e-8)
    np.testing.assert_allclose(go(0.0, x, 1.0), closed_form(x, 1.0), atol=1e-8)  # and none stays behind
    held = cart.integrator({"k": 4.0}, {"F": 2.0}, **TIGHT)
    np.testing.assert_allclose(held(0.0, x, 1.0), closed_form(x, 1.0, 4.0, 2.0), atol=1e-8)


@pytest.mark.parametrize("method", ["DOP853", "RK45", "Taylor", "Radau"])
def test_calls_have_the_bits_of_whole_runs_and_forget_each_other(in_c: Any, method: str) -> None:
    go, x = in_c.integrator(method=method, **TIGHT), in_c.x0()
    first = go(0.0, x, 2.0)
    run = in_c.simulate((0.0, 2.0), x, t_eval=[2.0], method=method, **TIGHT)
    np.testing.assert_array_equal(first, run.x[:, -1])
    assert go.evaluations == run.nfev
    go(1.0, first, -30.0)
    np.testing.assert_array_equal(go(0.0, x, 2.0), first)


def test_steps_of_one_size(in_c: Any) -> None:
    go, x = in_c.integrator(method="RK4", step=0.01), in_c.x0()
    by_hand = x
    for k in range(10):
        by_hand = in_c.step(k * 0.01, by_hand, 0.01)
    np.testing.assert_allclose(go(0.0, x, 0.1), by_hand, rtol=1e-14)
    short = in_c.simulate((0.0, 1e-3), x, method="RK4", step=0.01)  # a run shorter than a step
    np.testing.assert_array_equal(short.x[:, -1], go(0.0, x, 1e-3))
    pushed = {"parameters": {"k": 0.0}, "inputs": {"F": "t**3"}}
    run = in_c.simulate(1.0, [0.0, 0.0], **pushed, method="RK4", step=0.25)
    assert run["x_dot"][-1] == pytest.approx(1 / 8, rel=1e-14)  # Simpson's rule, exact for cubics
    refuses("EG-ENDLESS spring step 0.01 1e+12", go, 0.0, x, 1e12)


def test_calls_of_loops_have_the_bits_of_whole_runs(four_bar: Any) -> None:
    go, x = four_bar.integrator(**TIGHT), four_bar.x0()
    np.testing.assert_array_equal(go(0.0, x, 1.5), four_bar.simulate((0.0, 1.5), x, t_eval=[1.5], **TIGHT).x[:, -1])


def test_states_off_the_constraints_are_brought_onto_them_first(four_bar: Any) -> None:
    off = four_bar.x0()
    off[: four_bar.n_q] += 0.1
    go = four_bar.integrator(**TIGHT)
    found = four_bar.simulate((0.0, 0.5), off, t_eval=[0.5], **TIGHT).x[:, -1]
    np.testing.assert_array_equal(go(0.0, off, 0.5), found)
    np.testing.assert_allclose(go(0.0, off, 0.0), four_bar.project(off), atol=1e-12)


@pytest.mark.parametrize(
    ("call", "demand"),
    [
        (((0.0, [1.0], 1.0), {}), "EG-SHAPE x (2,) (1,)"),
        (((0.0, [1.0, 2.0], 1.0), {"p": [1.0, 2.0]}), "EG-SHAPE p (1,) (2,)"),
        (((0.0, [1.0, 2.0], float("nan")), {}), "EG-NUMBER h nan"),
        (((0.0, {"x": 1.0}, 1.0), {}), "EG-SHAPE x {'x':"),
        (((0.0, [1j, 2.0], 1.0), {}), "EG-SHAPE x [1j,"),
        (((0.0, [1.0, 2.0], 1.0), {"out": np.zeros(3)}), "EG-SHAPE out (2,)"),
        (((0.0, [1.0, 2.0], 1.0), {"out": np.broadcast_to(0.0, (2,))}), "EG-SHAPE out (2,)"),
        (((0.0, [1.0, 2.0], 1.0), {"out": np.zeros(2, dtype=np.float32)}), "EG-SHAPE out float64"),
        (((0.0, [1.0, 2.0], 1.0), {"p": {"kk": 1.0}}), "EG-NAME-UNKNOWN 'kk' k?"),
        (((1e16, [1.0, 2.0], 1.0), {}), "EG-RANGE h t 1e+16"),
        (((1e308, [1.0, 2.0], 1e308), {}), "EG-NUMBER t 1e+308"),
    ],
)
def test_wrong_calls_are_reported(cart: Any, call: Any, demand: str) -> None:
    positional, named = call
    refuses(f"{demand} integrator spring", cart.integrator(), *positional, **named)


def test_a_state_that_is_reset_needs_a_run() -> None:
    m = eg.Model("ball", gravity=(0, -9.81, 0))
    m.prismatic("J", m.ground, m.body("ball", mass=1), axis="y", coordinate="y")
    m.initial = {"y": 1.0}
    m.event("bounce", "y", direction=-1, reset={"y_dot": -m.coordinate("y_dot")})
    refuses("EG-UNSUPPORTED ball simulate", m.compile(target="numpy").integrator)


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
def test_what_stops_a_call_is_named(method: str) -> None:
    m = eg.Model("wall")
    m.prismatic("J", m.ground, m.body("cart", mass=1), axis="x", coordinate="x")
    m.torque("pull", "J", -1 / (m.coordinate("x") * m.coordinate("x") ** 0.5))
    m.initial = {"x": 1.0}
    mod = m.compile(target="numpy")
    go = mod.integrator(method=method)
    refuses(f"EG-STALLED {method} 2.1781 11", go, 1.0, mod.x0(), 10.0)
    m = eg.Model("root")  # a force that is no number where x < 0
    m.prismatic("J", m.ground, m.body("cart", mass=1), axis="x", coordinate="x")
    m.torque("pull", "J", -(m.coordinate("x") ** 0.5))
    root = m.compile(target="numpy").integrator(method=method)
    with refused(f"EG-STALLED {method} 10 rhs x") as caught:
        root(0.0, [1.0, -1.0], 10.0)
    assert isinstance(caught.value.__cause__, eg.EvaluationError)
    x = np.array([1.0, -1.0])
    with pytest.raises(eg.SimulationError):
        root(0.0, x, 10.0, out=x)
    np.testing.assert_array_equal(x, [1.0, -1.0])  # a call that fails leaves it as it was
    np.testing.assert_allclose(go(1.0, mod.x0(), 0.1), mod.simulate((1.0, 1.1), method=method).x[:, -1], rtol=1e-6)


def test_an_interrupt_stops_a_long_call(in_c: Any) -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        go = in_c.integrator(**TIGHT)
        with pytest.raises(KeyboardInterrupt):
            threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
            go(0.0, in_c.x0(), 1e9)
    finally:
        signal.signal(signal.SIGINT, before)
    np.testing.assert_allclose(go(0.0, [0.3, 0.0], 1.0), closed_form([0.3, 0.0], 1.0), atol=1e-8)


def test_one_thread_at_a_time(in_c: Any) -> None:
    go, refused = in_c.integrator(**TIGHT), []

    def disturb() -> None:
        while not refused:  # not at work yet
            try:
                go(0.0, in_c.x0(), 1e-3)
            except eg.UsageError as error:
                refused.append(str(error))
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            threading.Timer(0.1, disturb).start()
            while True:  # unless the other was at work for a moment
                with suppress(eg.UsageError):
                    go(0.0, in_c.x0(), 1e9)
    finally:
        signal.signal(signal.SIGINT, before)
    assert refused == [
        "integrator of spring: it is already working in another thread; make one integrator for each thread"
    ]


FILE = """
name: swing
bodies: {bob: {mass: 1.0, com: [0, -1, 0]}}
gravity: [0, -9.81, 0]
joints: {q: {type: revolute, between: [ground, bob]}}
initial: {q: 1.0}
simulation: {end: 1, method: RK4, step: 0.01}
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("steps") / "swing.yaml"
    path.write_text(FILE)
    return path


def test_a_run_takes_the_declared_steps(path: Path) -> None:
    swing, h = eg.load(path).compile(target="numpy"), 0.01
    run, x = swing.simulate(), swing.x0()
    for _ in range(100):  # Kutta's classical formula
        a = swing.rhs(0.0, x)
        b = swing.rhs(0.0, x + h / 2 * a)
        c = swing.rhs(0.0, x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + swing.rhs(0.0, x + h * c))
    np.testing.assert_allclose(run.t, np.linspace(0, 1, 101), atol=1e-12)
    np.testing.assert_allclose(run.x[:, -1], x, rtol=1e-12)
    assert len(swing.simulate(step=0.1).t) == 11
    assert len(swing.simulate(method="RK4").t) == 101
    assert len(swing.simulate(method="RK45", rtol=1e-3).t) < 50
    many = swing.simulate_many(initial={"q": [1.0, 0.5]})
    np.testing.assert_allclose(many.x[:, 0], run.x[:, -1], rtol=1e-12)


def test_steps_are_of_order_four() -> None:
    """Order 4, whole steps, and the same steps one by one."""
    mod = compiled("double_pendulum", "cython")
    x0 = mod.x0()
    exact = mod.simulate((0, 1), x0, rtol=1e-13, atol=1e-14).x[:, -1]
    errors = []
    for n in (100, 200, 400):
        run = mod.simulate((0, 1), x0, method="RK4", step=1 / n)
        assert len(run.t) == n + 1
        x, same = x0.copy(), x0
        for k in range(n):
            assert mod.step(k / n, x, 1 / n, out=x) is x
            same = mod.step(k / n, same, 1 / n)
        np.testing.assert_array_equal(x, same)
        np.testing.assert_allclose(run.x[:, -1], x, atol=1e-12)
        errors.append(np.abs(run.x[:, -1] - exact).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.3)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4, abs=0.3)
    between = mod.simulate((0, 1), x0, method="RK4", step=0.0025, t_eval=[0.12345, 0.9]).x
    np.testing.assert_allclose(
        between, mod.simulate((0, 1), x0, t_eval=[0.12345, 0.9], rtol=1e-10, atol=1e-12).x, atol=1e-7
    )
    refuses("EG-MISSING RK4 step", mod.simulate, (0, 1), step=0.1)


# -- taylor's method ---------------------------------------------------------------------------------------------------
#: Forces on a unit mass at x moving at v, each with an operation of its own, as text and for mpmath.
FORCES = {
    "products": ("-x*v*(1 + x) - x**3 - 2*v**2*x", lambda m, x, v, t: -x * v * (1 + x) - x**3 - 2 * v**2 * x),
    "quotients": ("1/(2 + x) + v/(3 + x*v) - x/2", lambda m, x, v, t: 1 / (2 + x) + v / (3 + x * v) - x / 2),
    "sqrt": ("-sqrt(1 + x**2 + v**2)", lambda m, x, v, t: -m.sqrt(1 + x**2 + v**2)),
    "exp, log": ("exp(-x*v) - log(2 + x)", lambda m, x, v, t: m.exp(-x * v) - m.log(2 + x)),
    "sin, cos": ("sin(x + v) - 2*cos(x*v)*x", lambda m, x, v, t: m.sin(x + v) - 2 * m.cos(x * v) * x),
    "sin alone": ("-sin(3*x)", lambda m, x, v, t: -m.sin(3 * x)),
    "tan": ("-tan(x/2) - 0.1*v", lambda m, x, v, t: -m.tan(x / 2) - v / 10),
    "tanh": ("-tanh(2*x*(1 + v**2))", lambda m, x, v, t: -m.tanh(2 * x * (1 + v**2))),
    "sinh, cosh": ("-sinh(x)/cosh(v/2)", lambda m, x, v, t: -m.sinh(x) / m.cosh(v / 2)),
    "asin": ("-asin(0.4*x + 0.1*v)", lambda m, x, v, t: -m.asin(m.mpf(0.4) * x + m.mpf(0.1) * v)),
    "acos": ("acos(0.3*x) - 2*x", lambda m, x, v, t: m.acos(m.mpf(0.3) * x) - 2 * x),
    "atan": ("-atan(3*x*(1 + v))", lambda m, x, v, t: -m.atan(3 * x * (1 + v))),
    "atan2": ("atan2(v, 2 + x) - x", lambda m, x, v, t: m.atan2(v, 2 + x) - x),
    "atan2, one fixed": ("atan2(1, 2 + x) - atan2(x, 3)", lambda m, x, v, t: m.atan2(1, 2 + x) - m.atan2(x, 3)),
    "real powers": ("(2 + x)**1.7 - 4", lambda m, x, v, t: (2 + x) ** m.mpf(1.7) - 4),
    "negative real powers": ("-(2 + x)**(-1.3)", lambda m, x, v, t: -((2 + x) ** m.mpf(-1.3))),
    "powers through 0": ("-x**5 - v**3/7", lambda m, x, v, t: -(x**5) - v**3 / 7),
    "a power below 0": ("(2 + x)**(-3) - x", lambda m, x, v, t: (2 + x) ** (-3) - x),
    "multiples": ("-(1 + 2*(3 + 4*x))*x/9", lambda m, x, v, t: -(1 + 2 * (3 + 4 * x)) * x / 9),
    "multiples in a function": (
        "-x*sin(2*(1 + 3*x)) - sin(x)",
        lambda m, x, v, t: -x * m.sin(2 * (1 + 3 * x)) - m.sin(x),
    ),
    "negative multiples": (
        "-2*(1 - x)*(1 - x) - (1 - 2*x)*x/2",
        lambda m, x, v, t: -2 * (1 - x) ** 2 - (1 - 2 * x) * x / 2,
    ),
    "multiples squared": (
        "-x*((1 + 2*x)*(1 + 2*x)*3 - 2*(1 + 0.5*x*x)*x*x)/9",
        lambda m, x, v, t: -x * (3 * (1 + 2 * x) ** 2 - 2 * (1 + x * x / 2) * x * x) / 9,
    ),
    "multiples by parameters": (
        "(b - 3*a*x)*(a*x)*v/3 + b*x*(2 - a*v)/(1 + a*x*a*x)",
        lambda m, x, v, t: (B - 3 * A * x) * (A * x) * v / 3 + B * x * (2 - A * v) / (1 + A * x * A * x),
    ),
    "time": ("sin(2*t)*x - t*v/5 - x", lambda m, x, v, t: m.sin(2 * t) * x - t * v / 5 - x),
}  # fmt: skip
A, B = 0.75, -1.5  #: parameters a and b
COLUMNS = list(FORCES)
ALWAYS = ("products", "quotients", "sin, cos", "atan2", "real powers", "powers through 0", "multiples squared", "time")
START_OF_ALL = np.repeat([0.4, 0.3], len(FORCES))


@pytest.fixture(scope="module")
def masses() -> Any:
    """A mass of 1 kg on a line for each force, in one model."""
    m = eg.Model("masses")
    m.parameter("a", A), m.parameter("b", B)
    for k, (text, _) in enumerate(FORCES.values()):
        body = m.body(f"body{k}", mass=1.0)
        m.prismatic(f"J{k}", m.ground, body, axis="x", coordinate=f"x{k}")
        own = re.sub(r"\bx\b", f"x{k}", re.sub(r"\bv\b", f"x{k}_dot", text))
        m.torque(f"F{k}", f"J{k}", own)
    return m.compile(**IN_C)


@pytest.fixture(scope="module")
def motion(masses: Any) -> Any:
    """All of them from x = 0.4 m, v = 0.3 m/s."""
    return masses.simulate(
        1.5, START_OF_ALL, method="Taylor", rtol=1e-13, atol=1e-15, t_eval=[0.7, 1.5], dense_output=True
    )


@pytest.mark.parametrize("name", part_of(COLUMNS, lambda name: name in ALWAYS))
def test_every_recurrence(masses: Any, motion: Any, name: str) -> None:
    """mpmath's integrator at 25 digits; nothing else watches what the last orders are."""
    k, n = COLUMNS.index(name), masses.n_q
    with mpmath.workdps(25):
        force = FORCES[name][1]
        exact = mpmath.odefun(
            lambda t, y: [y[1], force(mpmath, y[0], y[1], t)],
            0,
            [mpmath.mpf(0.4), mpmath.mpf(0.3)],
            tol=mpmath.mpf(1e-18),
        )
        for column, t in enumerate((0.7, 1.5)):
            expected = np.array([float(y) for y in exact(t)])
            assert np.abs(motion.x[[k, n + k], column] - expected).max() < 5e-13


def test_values_between_the_steps_are_as_good(masses: Any, motion: Any) -> None:
    times = np.linspace(0, 1.5, 37)
    exact = masses.simulate(1.5, START_OF_ALL, method="Taylor", rtol=1e-13, atol=1e-15, t_eval=times).x
    assert np.abs(motion.at(times).x - exact).max() < 1e-12
    other = masses.simulate(1.5, START_OF_ALL, rtol=1e-13, atol=1e-15).x  # all recurrences beside DOP853
    assert np.abs(motion.x[:, -1] - other[:, -1]).max() < 1e-11


@pytest.fixture(scope="module")
def swing() -> Any:
    return compiled("double_pendulum", "cython")


START = np.array([1.0, 0.3, 0.0, 0.0])


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-9, 1e-12])
def test_the_error_follows_the_tolerance_in_few_steps(swing: Any, rtol: float) -> None:
    exact = swing.simulate(3, START, rtol=1e-13, atol=1e-15).x[:, -1]
    run = swing.simulate(3, START, method="Taylor", rtol=rtol, atol=rtol / 100)
    assert np.abs(run.x[:, -1] - exact).max() < 20 * rtol + 1e-12
    assert run.nfev <= 1.05 * len(run.t) + 2  # a series at each end of a step, which serves the next one; few in vain
    assert len(run.t) < 140


def test_a_fit_by_series_finds_a_length(swing: Any) -> None:
    """SciPy has no such method: derivatives go along the steps of another, or are integrated by it."""
    times = np.linspace(0.0, 1.5, 31)
    run = swing.simulate(1.5, START, parameters={"l2": 0.9}, t_eval=times)
    fit = swing.fit({"t": times, "theta2": run["theta2"]}, {"l2": 1.0}, initial=START, method="Taylor")
    assert abs(fit.values["l2"] - 0.9) < 1e-6


def test_solve_ivp_takes_it(swing: Any) -> None:
    found = solve_ivp(
        swing.rhs, (0, 3), START, method=swing.Taylor, rtol=1e-11, atol=1e-13, dense_output=True,
        events=lambda t, x: x[0],
    )  # fmt: skip
    ours = swing.simulate(3, START, method="Taylor", rtol=1e-11, atol=1e-13, t_eval=[1.234, 3.0], events=["theta1"])
    assert np.abs(found.y[:, -1] - ours.x[:, -1]).max() < 1e-12
    assert np.abs(found.sol(1.234) - ours.x[:, 0]).max() < 1e-12
    assert np.abs(found.t_events[0] - ours.t_events["theta1"]).max() < 1e-10
    with refused("EG-UNSUPPORTED Taylor rhs"):
        solve_ivp(lambda t, x: -x, (0, 1), [1.0], method=swing.Taylor)


def test_held_inputs_are_steps_and_others_refused() -> None:
    mod = compiled("oscillator", "cython").bind({"k": 1.0, "a": 0.3})
    held = eg.Signal([0, 0.5, 1.2], [1.0, -1.0, 0.5], "zero-order")
    tight = {"rtol": 1e-12, "atol": 1e-14, "inputs": {"F": held}}
    assert np.abs(mod.simulate(2, method="Taylor", **tight).x[:, -1] - mod.simulate(2, **tight).x[:, -1]).max() < 1e-10
    for given in ("sin(t)", ([0, 1], [0, 1]), lambda t, x: 1.0):
        refuses("EG-UNSUPPORTED Taylor inputs corners", mod.simulate, 1, inputs={"F": given}, method="Taylor")


def test_models_without_series_say_so() -> None:
    loops = compiled("four_bar", "cython")
    refuses("EG-UNSUPPORTED four_bar Taylor loops", loops.simulate, 1, method="Taylor")
    refuses("EG-UNAVAILABLE four_bar Taylor loops", getattr, loops, "Taylor")
    m = eg.Model("stop")
    body = m.body("mass", mass=1.0)
    m.prismatic("J", m.ground, body, axis="x", coordinate="s")
    m.torque("push", "J", "-max(s, 0)")
    for target, why in (("cython", "max"), ("numpy", "target='numpy'")):
        refuses(f"EG-UNSUPPORTED stop Taylor {why}", m.compile(target=target).simulate, 1, method="Taylor")


#: Forces whose last two terms may vanish or tell nothing of what comes: as text, start (x, v), and for SciPy.
BLIND = {
    "cube": ("-x**3", (0.0, 1.0), lambda t, x, v: -(x**3)),
    "cube, nearly at 0": ("-x**3", (1e-8, 1.0), lambda t, x, v: -(x**3)),
    "fifth power": ("-x**5", (0.0, 1.0), lambda t, x, v: -(x**5)),
    "late": ("-x**3 + 0.001*t**15", (0.0, 0.0), lambda t, x, v: -(x**3) + 0.001 * t**15),
    "wall": ("-9.81 + exp(-400*x)", (1.0, 0.0), lambda t, x, v: -9.81 + np.exp(-400 * x)),
    "step": ("-x + tanh(200*(t - 1.2))", (0.0, 1.0), lambda t, x, v: -x + np.tanh(200 * (t - 1.2))),
    "friction": ("-20*x - tanh(1000*v)", (1.0, 0.0), lambda t, x, v: -20 * x - np.tanh(1000 * v)),
    "branch": ("-atan2(x, v)", (0.0, 1.0), lambda t, x, v: -np.arctan2(x, v)),
    "arms": ("atan2(x, 2)", (0.0, 0.0), lambda t, x, v: np.arctan2(x, 2)),
}  # fmt: skip


@pytest.mark.parametrize("name", part_of(BLIND, "branch".__eq__))
def test_steps_are_judged_by_their_ends(name: str) -> None:
    """Against SciPy's Radau on the equations written by hand, for one run and in lanes, at many tolerances."""
    force, (x0, v0), own = BLIND[name]
    m = eg.Model("blind")
    body = m.body("body", mass=1.0)
    m.prismatic("J", m.ground, body, axis="x", coordinate="x")
    m.torque("F", "J", re.sub(r"\bv\b", "x_dot", force))
    mod = m.compile(**IN_C)
    judge = solve_ivp(
        lambda t, y: [y[1], own(t, y[0], y[1])], (0, 2), [x0, v0], method="Radau", rtol=1e-10, atol=1e-12, max_step=0.01
    )
    for rtol in (1e-3, 1e-6, 1e-9, 1e-11):
        options = {"method": "Taylor", "rtol": rtol, "atol": rtol / 10}
        run = mod.simulate(2, [x0, v0], **options)
        assert np.abs(run.x[:, -1] - judge.y[:, -1]).max() < 200 * rtol + 2e-7
        many = mod.simulate_many(2, np.tile([[x0], [v0]], 3), **options)
        assert np.abs(many.x - judge.y[:, -1:]).max() < 200 * rtol + 2e-7
