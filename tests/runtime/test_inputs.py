"""Inputs over time: texts, held values, lines and splines, in compiled loops and through SciPy alike."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import eomgen as eg

TIGHT = {"rtol": 1e-10, "atol": 1e-12}


@pytest.fixture(scope="module")
def cart() -> Any:
    """A mass on a line, pushed: x'' = u, so that x is the input integrated twice."""
    m = eg.Model("cart")
    body = m.body("cart", mass=1.0)
    m.prismatic("J", m.ground, body, axis="x", coordinate="s")
    u = m.input("u")
    m.parameter("k", 2.0)
    m.torque("push", "J", u)
    return m.compile()


TIMES, VALUES = np.array([0.0, 0.3, 0.5, 1.1, 2.0]), np.array([0.0, 1.0, -0.5, 2.0, 0.2])


def twice(function: Any, times: np.ndarray, n: int = 200_001) -> np.ndarray:
    """The second integral by the trapezoidal rule on a fine grid between the knots, where the input is smooth."""
    grid = np.unique(np.concatenate([np.linspace(0, 2, n), TIMES]))
    middle = function((grid[1:] + grid[:-1]) / 2)
    h = np.diff(grid)
    speed = np.concatenate([[0.0], np.cumsum(h * middle)])
    place = np.concatenate([[0.0], np.cumsum(h * (speed[:-1] + h * middle / 2))])
    return np.interp(times, grid, place)


@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau"])
@pytest.mark.parametrize("interpolation", ["zero-order", "linear", "cubic"])
def test_tables_between_their_times(cart: Any, method: str, interpolation: str) -> None:
    signal = eg.Signal(TIMES, VALUES, interpolation)
    expected = {
        "zero-order": lambda t: VALUES[np.searchsorted(TIMES, t, side="right") - 1],
        "linear": lambda t: np.interp(t, TIMES, VALUES),
        "cubic": CubicSpline(TIMES, VALUES),
    }[interpolation]
    asked = np.linspace(0, 2, 41)
    run = cart.simulate((0, 2), inputs={"u": signal}, method=method, t_eval=asked, **TIGHT)
    np.testing.assert_allclose(run["s"], twice(expected, asked), atol=1e-8)
    inside = np.linspace(0.01, 1.99, 37)
    np.testing.assert_allclose(signal(inside), expected(inside), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(run["u"], signal(asked))
    back = cart.simulate((2, 0), run.x[:, -1], inputs={"u": signal}, method=method, **TIGHT)
    np.testing.assert_allclose(back.x[:, -1], 0.0, atol=1e-7)


def test_a_held_table_is_exact_because_the_run_stops_at_its_jumps(cart: Any) -> None:
    times = np.arange(0, 2, 0.01)
    values = np.random.default_rng(3).normal(size=len(times))
    held = cart.simulate((0, 2), inputs={"u": eg.Signal(times, values, "zero-order")}, rtol=1e-6, atol=1e-8)
    speed = np.concatenate([[0.0], np.cumsum(0.01 * values)])
    place = np.cumsum(0.01 * speed[:-1] + 0.01**2 / 2 * values)[-1]
    assert held["s_dot"][-1] == pytest.approx(speed[-1], abs=1e-12)
    assert held["s"][-1] == pytest.approx(place, abs=1e-12)
    signal = eg.Signal(times, values, "zero-order", corners=False)
    loose = cart.simulate((0, 2), inputs={"u": signal}, rtol=1e-6, atol=1e-8)
    stepped = solve_ivp(lambda t, x: [x[1], signal(t)], (0, 2), [0, 0], method="DOP853", rtol=1e-6, atol=1e-8)
    assert len(loose.t) == len(stepped.t) > 5 * len(held.t)  # over the jumps, as SciPy does
    np.testing.assert_allclose(loose.x, stepped.y, rtol=1e-9, atol=1e-12)
    assert abs(loose["s"][-1] - place) > 1e-6


def test_more_jumps_than_corners_are_kept_for_others(cart: Any) -> None:
    times = np.linspace(0, 2, 3001)[:-1]
    values = np.where(np.arange(3000) % 2, 1.0, -1.0)
    run = cart.simulate((0, 2), inputs={"u": eg.Signal(times, values, "zero-order")})
    assert run["s_dot"][-1] == pytest.approx(0.0, abs=1e-12)
    assert len(run.t) >= 3000


@pytest.mark.parametrize("method", ["DOP853", "RK23", "LSODA", "Radau"])
def test_texts_of_time_state_and_parameters(cart: Any, method: str) -> None:
    options = {"rtol": 1e-7, "atol": 1e-9} if method == "RK23" else TIGHT
    run = cart.simulate((0, 3), {"s": 1.0}, {"k": 4.0}, inputs={"u": "-k*s"}, method=method, **options)
    np.testing.assert_allclose(run["s"], np.cos(2 * run.t), atol=1e-5 if method == "RK23" else 1e-7)
    np.testing.assert_allclose(run["u"], -4.0 * run["s"], atol=1e-12)
    run = cart.simulate(
        (0, 3), inputs={"u": "where(t < 1, sin(3*t), max(0, 2 - t)) + 0*abs(s)"}, method=method, **options
    )
    function = cart.simulate(
        (0, 3),
        inputs={"u": lambda t, x: np.sin(3 * t) if t < 1 else max(0.0, 2 - t)},
        method="RK45",
        max_step=1e-3,
        **TIGHT,
    )
    assert run["s"][-1] == pytest.approx(function["s"][-1], abs=1e-5)


def test_every_operation_means_the_same_on_a_tape(cart: Any) -> None:
    text = (
        "sqrt(1 + t) + exp(-t) + log(2 + t) + sin(t)*cos(t) + tan(t/2) + asin(t/3) + acos(t/3) + atan(t) + sinh(t) "
        "+ cosh(t) + tanh(t) + asinh(t) + acosh(1 + t) + atanh(t/3) "
        "+ atan2(t, 2) + hypot(t, 2) + abs(t - 1) + sign(t - 1) + min(t, 1, 2*t) + max(t, 1) + (t < 1) "
        "+ (t <= 1) + (t == 1) + (t != 1) + (not t) + (t > 1 and t < 1.5 or t > 1.7) + (3 if t > 0.5 else 2) "
        "+ t**3 - -t + t**2.5 / 7"
    )
    forced = cart.simulate((0, 2), inputs={"u": text}, method="RK4", step=0.05)
    called = cart.simulate((0, 2), inputs={"u": text}, method="Radau", t_eval=forced.t, rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(forced["u"], called["u"], rtol=1e-13)
    rates = cart.simulate((0, 2), inputs={"u": text}, method="RK4", step=0.01)
    middle = (rates.t[1:] + rates.t[:-1]) / 2
    smooth = np.all([np.abs(middle - t) > 0.02 for t in (0.0, 0.5, 1.0, 1.5, 1.7)], axis=0)
    u = np.interp(middle, rates.t, rates["u"])  # Simpson's rule is what RK4 does with a pure input
    simpson = 0.01 * u
    np.testing.assert_allclose(np.diff(rates["s_dot"])[smooth], simpson[smooth], rtol=1e-3)


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_signals_that_the_model_declares(target: str, tmp_path: Path) -> None:
    m = eg.Model("cart")
    body = m.body("cart", mass=1.0)
    m.prismatic("J", m.ground, body, axis="x", coordinate="s")
    m.parameter("k", 4.0)
    m.torque("push", "J", m.input("u", signal="where(t > 100, sqrt(t), -k*s)"))
    m.initial(s=1.0)
    file = tmp_path / "cart.yaml"
    file.write_text(m.to_yaml(), encoding="utf-8")
    mod = eg.load(file).compile(target=target)
    method = "DOP853" if target == "cython" else "RK45"
    run = mod.simulate((0, 3), method=method, **TIGHT)
    np.testing.assert_allclose(run["s"], np.cos(2 * run.t), atol=1e-8)
    np.testing.assert_allclose(run["u"], -4.0 * run["s"])
    stiffer = mod.simulate((0, 3), None, {"k": 9.0}, method="Radau", rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(stiffer["s"], np.cos(3 * stiffer.t), atol=1e-5)
    free = mod.simulate((0, 3), inputs={"u": 0.0}, method=method)
    np.testing.assert_allclose(free["s"], 1.0)
    other = eg.Model("cart")
    other.prismatic("J", other.ground, other.body("cart", mass=1.0), axis="x", coordinate="s")
    other.input("w")
    other.input("u", signal="w + s_ddot")
    with pytest.raises(eg.ModelError, match="the acceleration 's_ddot' cannot(.|\n)*the input 'w' cannot be used here"):
        other.compile()


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("k*r", "no name in input u 'r'"),
        ("u + 1", "no name in input u 'u'"),
        ("k*", "input u: .*not a valid expression"),
        ("().__class__", "input u"),
        (([0, 1], [1, 2, 3]), "input u: times and values"),
        ([1, 2, 3], "a Signal, an expression as text"),
    ],
)
def test_wrong_inputs(cart: Any, value: Any, words: str) -> None:
    with pytest.raises(eg.UsageError, match=words):
        cart.simulate((0, 1), inputs={"u": value})


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([0, 1], [1, 2], "quintic"), "no interpolation 'quintic'; there are linear, zero-order, cubic"),
        (([0, 0], [1, 2]), "times must increase"),
        (([0, 1], [1, np.nan]), "must be finite"),
    ],
)
def test_wrong_signals(arguments: Any, words: str) -> None:
    with pytest.raises(eg.UsageError, match=words):
        eg.Signal(*arguments)


def test_steps_of_one_size(cart: Any) -> None:
    """Order 4, whole steps, and the same steps one by one."""
    mod = eg.load(Path(__file__).parents[2] / "examples" / "double_pendulum.yaml").compile()
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
    np.testing.assert_allclose(between, mod.simulate((0, 1), x0, t_eval=[0.12345, 0.9], **TIGHT).x, atol=1e-7)
    for options, words in (({"method": "RK4"}, "RK4 needs step="), ({"step": 0.1}, "no other method takes it")):
        with pytest.raises(eg.UsageError, match=words):
            mod.simulate((0, 1), **options)
    pushed = cart.step(0.0, [0.0, 1.0], 0.5, u=[2.0])
    np.testing.assert_allclose(pushed, [0.5 + 0.25, 2.0], rtol=1e-14)
    with pytest.raises(ValueError, match="out must be"):
        cart.step(0.0, [0.0, 1.0], 0.5, out=np.zeros(3))


class Rising:
    """An input 1 + 3 t that says its rate, as docs/inputs.md allows: a number, or a function."""

    def __init__(self, rate: Any) -> None:
        self.rate = rate

    def __call__(self, t: float, x: Any) -> float:
        return 1.0 + 3.0 * t

    def derivative(self) -> Any:
        return self.rate


KNOTS, POINTS = np.array([0.0, 0.5, 1.0, 1.5, 2.0]), np.array([1.0, -2.0, 3.0, 5.0, 7.0])
SPLINE = CubicSpline(KNOTS, POINTS)
ASKED = np.array([0.1, 0.7, 1.2, 1.9])
FORMS: dict[str, tuple[Any, Any]] = {
    "number": (2.0, lambda t: 2.0 + 0.0 * t),
    "pair": ((KNOTS, POINTS), lambda t: np.interp(t, KNOTS, POINTS)),
    "held": (eg.Signal(KNOTS, POINTS, "zero-order"), lambda t: POINTS[np.searchsorted(KNOTS, t, side="right") - 1]),
    "cubic": (eg.Signal(KNOTS, POINTS, "cubic"), SPLINE),
    "text": ("1 + sin(3*t)", lambda t: 1 + np.sin(3 * t)),
    "function": (lambda t, x: 1 + np.sin(3 * t), lambda t: 1 + np.sin(3 * t)),
    "object": (Rising(3.0), lambda t: 1 + 3 * t),
    "spline": (SPLINE, SPLINE),
}
CALLS: dict[str, Any] = {
    "simulate": lambda m, u: m.simulate(2, inputs={"u": u}, t_eval=ASKED)["y"],
    "Radau": lambda m, u: m.simulate(2, inputs={"u": u}, t_eval=ASKED, method="Radau")["y"],
    "at": lambda m, u: m.simulate(2, inputs={"u": u}, dense_output=True).at(ASKED)["y"],
    "sensitivities": lambda m, u: 2 * m.sensitivities(["k"], 2, inputs={"u": u}, t_eval=ASKED)["y", "k"],
    "with an event": lambda m, u: (
        2 * m.sensitivities(["k"], 2, inputs={"u": u}, t_eval=ASKED, events=["t - 0.3"])["y", "k"]
    ),
    "impacts": lambda m, u: m.simulate_impacts(2, {"wall": 0.5}, inputs={"u": u}).at(ASKED)["y"],
    "dae": lambda m, u: m.dae.solve(2, inputs={"u": u}, t_eval=ASKED)["y"],
    "ensemble": lambda m, u: m.simulate_many(2, {"s": np.zeros(1)}, inputs={"u": u}, t_eval=ASKED)["y"].ravel(),
    "power": lambda m, u: 2 * (r := m.simulate(2, inputs={"u": u}, t_eval=ASKED))["power_in"] / r["s_dot"],
}


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_every_form_of_an_input_means_the_same_in_every_call(target: str) -> None:
    """y = k u: after a run each call must take the input of each time, not of the run's last part."""
    m = eg.Model("cart")
    m.prismatic("J", m.ground, m.body("cart", mass=1.0), axis="x", coordinate="s")
    k, u = m.parameter("k", 2.0), m.input("u")
    push = m.torque("push", "J", u)
    m.output("y", k * u)
    m.output("wall", "50 + k*u")  # a gap that moves with the input and stays open
    m.output("power_in", push.power)
    mod = m.compile(target=target)
    for form, (given, value) in FORMS.items():
        for name, call in CALLS.items():
            if name == "ensemble" and callable(given) and not isinstance(given, eg.Signal):
                continue  # which docs/ensembles.md leaves out
            np.testing.assert_allclose(call(mod, given), 2 * value(ASKED), atol=1e-6, err_msg=f"{form}: {name}")
        found = mod.fit({"t": ASKED, "y": 3.0 * value(ASKED)}, ["k"], inputs={"u": given}, initial={"s": 0, "s_dot": 0})
        assert found.values["k"] == pytest.approx(3.0, rel=1e-6), form


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("rate", [1, 1.0, lambda t: 1.0, lambda t, x: 1.0])
def test_impacts_on_a_floor_whose_object_says_its_rate(target: str, rate: Any) -> None:
    """A ball meets a floor that rises by 1 m/s: 9.81/2 t^2 + t = 2; elastic, v+ = 2 - v-."""
    m = eg.Model("floor", gravity=(0, -9.81, 0))
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.input("u")
    m.output("gap", "h - u")
    up = Rising(rate)
    up.__class__ = type("Up", (Rising,), {"__call__": lambda self, t, x: 1.0 + t})
    run = m.compile(target=target).simulate_impacts((0, 0.7), {"gap": 1.0}, {"h": 3.0}, inputs={"u": up})
    hit = (np.sqrt(1 + 4 * 9.81) - 1) / 9.81
    assert run.impacts[0][0] == pytest.approx(hit, abs=1e-8)
    assert run["h_dot"][-1] == pytest.approx(2 + 9.81 * hit - 9.81 * (0.7 - hit), abs=1e-7)
