"""Taylor's method: every recurrence beside mpmath, steps judged by their ends, and what other steppers share."""

import re
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
NAMES = list(FORCES)
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


@pytest.mark.parametrize("name", part_of(NAMES, lambda name: name in ALWAYS))
def test_every_recurrence(masses: Any, motion: Any, name: str) -> None:
    """mpmath's integrator at 25 digits; nothing else watches what the last orders are."""
    k, n = NAMES.index(name), masses.n_q
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
    for target, why in (
        ("cython", "max"),
        ("numpy", "target='numpy'"),
    ):
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
