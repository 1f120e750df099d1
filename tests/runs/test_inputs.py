"""Inputs over time mean the same in every call; parameters given late move the starts, or are refused."""

import pickle
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from models import IN_C
from refusals import refused, refuses
from scipy.interpolate import CubicSpline
from sweeps import TARGETS

import eomgen as eg

TIGHT = {"rtol": 1e-10, "atol": 1e-12}


@cache
def pushed(target: str) -> Any:
    """A mass on a line, pushed: x'' = u, so that x is the input integrated twice."""
    m = eg.Model("cart")
    m.prismatic("J", m.ground, m.body("cart", mass=1.0), axis="x", coordinate="s")
    k, u = m.parameter("k", 2.0), m.input("u")
    push = m.torque("push", "J", u)
    m.output("y", k * u)
    m.output("wall", "50 + k*u")  # a gap that moves with the input and stays open
    m.output("power_in", push.power)
    return m.compile(target=target, **(IN_C if target == "cython" else {}))


@pytest.fixture(scope="module")
def cart() -> Any:
    return pushed("cython")


def test_a_held_table_is_exact_because_the_run_stops_at_its_jumps(cart: Any) -> None:
    times = np.arange(0, 2, 0.01)
    values = np.random.default_rng(3).normal(size=len(times))
    held = cart.simulate((0, 2), inputs={"u": eg.Signal(times, values, "zero-order")}, rtol=1e-6, atol=1e-8)
    speed = np.concatenate([[0.0], np.cumsum(0.01 * values)])
    place = np.cumsum(0.01 * speed[:-1] + 0.01**2 / 2 * values)[-1]
    assert held["s_dot"][-1] == pytest.approx(speed[-1], abs=1e-12)
    assert held["s"][-1] == pytest.approx(place, abs=1e-12)


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


@pytest.mark.parametrize("target", TARGETS)
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
    assert free.metadata["inputs"] == {"u": 0.0}
    for still in (bound := mod.bind(u={"u": 0.0}), mod.bind(u=[0.0]), bound.bind(p={"k": 9.0})):
        run = still.simulate((0, 3), method=method)
        np.testing.assert_allclose(run["s"], 1.0)
        assert run.metadata["inputs"] == {"u": 0.0}
        np.testing.assert_allclose(still.simulate_many(3, count=1, method=method)["s"], 1.0)
        np.testing.assert_allclose(still.sensitivities(["s"], 3)["s", "s"], 1.0)
    many = mod.bind(p={"k": 4.0}).simulate_many(3, count=1, method="LSODA", **TIGHT)
    np.testing.assert_allclose(many["s"], np.cos(6.0), atol=1e-8)
    if target == "cython":
        loaded = [pickle.loads(pickle.dumps(one)).simulate((0, 3))["s"][-1] for one in (bound, mod)]
        np.testing.assert_allclose(loaded, [1.0, np.cos(6.0)], atol=1e-6)
    other = eg.Model("cart")
    other.prismatic("J", other.ground, other.body("cart", mass=1.0), axis="x", coordinate="s")
    other.input("w")
    other.input("u", signal="w + s_ddot")
    refuses("EG-REFERENCE inputs.u.signal s_ddot", other.compile)


def test_a_bound_length_wins_over_its_signal_where_it_drives_the_motion() -> None:
    m = eg.Model("hoist")
    m.prismatic("J", m.ground, m.body("load", mass=1.0), axis="y", coordinate="l")
    m.driver("rope", "l", value=m.input("L", 3.0, signal="3 - 0.5*(1 - cos(t))"))
    mod = m.compile(target="numpy")
    np.testing.assert_allclose(mod.simulate(3)["l"][-1], 2.5 + 0.5 * np.cos(3.0), atol=1e-8)
    np.testing.assert_allclose(mod.bind(u={"L": 2.5}).simulate(3, {"l": 2.5})["l"], 2.5)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("k*r", "EG-NAME-UNKNOWN r"),
        ("u + 1", "EG-NAME-UNKNOWN u"),
        ("k*", "EG-EXPRESSION u"),
        ("().__class__", "EG-EXPRESSION u"),
        (([0, 1], [1, 2, 3]), "EG-SHAPE u"),
        ([1, 2, 3], "EG-TYPE expression"),
        (([0.0, 0.0], [1.0, 2.0]), "EG-RANGE 0.0"),
        (([0, 1], [1, np.nan]), "EG-NUMBER finite"),
        (lambda t, x: x, "EG-SHAPE time"),
        (lambda t: t, "EG-TYPE u"),
        (lambda t, x, gain: gain, "EG-TYPE arguments"),
        (lambda t, x: np.nan, "EG-NOT-FINITE u 0"),
        (lambda t, x: None if t > 0.25 else 0.0, "EG-SHAPE u"),
    ],
)
def test_wrong_inputs(cart: Any, value: Any, words: str) -> None:
    refuses(words, cart.simulate, (0, 1), inputs={"u": value})


def test_wrong_signals_and_names(cart: Any) -> None:
    refuses("EG-NAME-UNKNOWN quintic", eg.Signal, [0, 1], [1, 2], "quintic")
    for inputs, words in (({"v": 1.0}, "EG-NAME-UNKNOWN v"), (3.0, "EG-TYPE mapping")):
        refuses(words, cart.simulate, 1.0, inputs=inputs)
    with pytest.raises(ZeroDivisionError) as caught:
        cart.simulate(1.0, inputs={"u": lambda t, x: 1 / 0})
    assert caught.value.__notes__ == ["raised by the function of input u, called as f(0, x)"]
    with refused("EG-STALLED u"):
        cart.simulate(1.0, inputs={"u": lambda t, x: 0.0 if t < 0.25 else np.inf}, method="LSODA", max_step=0.1)


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
    mod = pushed(target)
    for form, (given, value) in FORMS.items():
        for name, call in CALLS.items():
            if name == "ensemble" and callable(given) and not isinstance(given, eg.Signal):
                continue  # which docs/ensembles.md leaves out
            np.testing.assert_allclose(call(mod, given), 2 * value(ASKED), atol=1e-6, err_msg=f"{form}: {name}")
        found = mod.fit({"t": ASKED, "y": 3.0 * value(ASKED)}, ["k"], inputs={"u": given}, initial={"s": 0, "s_dot": 0})
        assert found.values["k"] == pytest.approx(3.0, rel=1e-6), form


KNOWN, GIVEN = [0.0, 0.4, 1.0, 1.7, 2.0], [1.0, -0.5, 0.3, 0.2, 2.0]
INSIDE = np.linspace(0.013, 1.99, 41)  #: none of the times


@pytest.mark.quick
def test_cubic_tables_and_their_rates_are_those_of_scipy() -> None:
    judge, table = CubicSpline(KNOWN, GIVEN), eg.Signal(KNOWN, GIVEN, "cubic")
    first = table.derivative()
    second = first.derivative()
    for order, one in enumerate((table, first, second)):
        np.testing.assert_allclose(one(INSIDE), judge(INSIDE, order), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose([one(t) for t in INSIDE], one(INSIDE), rtol=1e-14, atol=1e-14)
    assert [float(first(t)) for t in (-0.5, 2.5)] == [0.0, 0.0]
    assert [float(table(t)) for t in (-0.5, 2.5)] == [1.0, 2.0]


def test_linear_tables_have_the_slopes_of_their_pieces() -> None:
    table = eg.Signal(KNOWN, GIVEN)
    slopes = np.diff(GIVEN) / np.diff(KNOWN)
    np.testing.assert_allclose(table(INSIDE), np.interp(INSIDE, KNOWN, GIVEN))
    np.testing.assert_allclose(table.derivative()(INSIDE), slopes[np.searchsorted(KNOWN, INSIDE) - 1])


@pytest.mark.parametrize("t", [0.0, 0.39, 0.4, 0.999, 1.0, 1.99, 2.0, 3.0])
def test_held_tables_keep_the_last_value(t: float) -> None:
    expected = [value for time, value in zip(KNOWN, GIVEN, strict=True) if time <= t][-1]
    assert eg.Signal(KNOWN, GIVEN, "zero-order")(t) == expected


def test_a_short_pulse_is_not_stepped_over(cart: Any) -> None:
    pulse = ([1.0, 1.001, 1.002], [0.0, 1000.0, 0.0])  # an impulse of 1 N s on 1 kg
    run = cart.simulate(3.0, {"s_dot": 0.0}, inputs={"u": pulse})
    assert run["s_dot"][-1] == pytest.approx(1.0, rel=1e-8)
    assert (np.diff(run.t) > 0).all()
    back = cart.simulate((3.0, 0.0), {"s_dot": 1.0}, inputs={"u": pulse}, dense_output=True)
    np.testing.assert_allclose(back.at([2.9, 0.1])["s_dot"], [1.0, 0.0], atol=1e-8)


def test_feedback_enters_the_jacobian(cart: Any) -> None:
    """A stiff controller as an input: Radau needs its slope, else it takes tiny steps."""
    given = {"inputs": {"u": lambda t, x: -1e5 * x[1]}, "rtol": 1e-6, "atol": 1e-9}
    run = cart.simulate(5.0, {"s_dot": 1.0}, method="Radau", **given)
    assert run.nfev < 2000
    assert np.abs(run["s_dot"][-1]) < 1e-3


def test_a_long_linear_table_is_stepped_on_at_every_corner(cart: Any) -> None:
    t, u = np.linspace(0, 3, 3001), np.random.default_rng(0).normal(size=3001)
    assert cart.simulate(3, inputs={"u": (t, u)})["s_dot"][-1] == pytest.approx(np.trapezoid(u, t), abs=1e-12)


# -- inputs that move --------------------------------------------------------------------------------------------------
th, th_dot, l, x, y, x_dot, y_dot = sp.symbols("th th_dot l x y x_dot y_dot")
GRID = np.linspace(0.0, 1.0, 9)

#: An input 1 + t over one second, as it can be given.
WAYS: dict[str, Any] = {
    "text": "1 + t",
    "line": ([0.0, 1.0], [1.0, 2.0]),
    "beyond the run": eg.Signal([-1.0, 3.0], [0.0, 4.0]),
    "many points": (GRID, 1.0 + GRID),
    "spline": eg.Signal(GRID, 1.0 + GRID, "cubic"),
    "without corners": eg.Signal(GRID, 1.0 + GRID, corners=False),
}


class Rated:
    """A function of time that knows its derivatives."""

    def __init__(self, *functions: Any) -> None:
        self.functions = functions

    def __call__(self, t: float, state: Any) -> float:
        return float(self.functions[0](t))

    def derivative(self) -> "Rated | None":
        return Rated(*self.functions[1:]) if self.functions[1:] else None


@cache
def build(name: str, target: str) -> Any:
    """A mass on a string of length l, without gravity: l^2 th' stays; or on a ring of radius l: x y' - y x' stays."""
    if name == "winch":
        m = eg.Model.from_lagrangian("winch", l**2 * th_dot**2 / 2, [th], inputs={l: 1.0})
    else:
        row = x**2 + y**2 - l**2
        m = eg.Model.from_lagrangian("ring", (x_dot**2 + y_dot**2) / 2, [x, y], constraints=[row], inputs={l: 1.0})
    return m.compile(target=target, **(IN_C if target == "cython" else {}))


@pytest.fixture(params=["cython", "numpy"])
def winch(request: Any) -> Any:
    return build("winch", request.param)


@pytest.fixture(params=["cython", "numpy"])
def ring(request: Any) -> Any:
    return build("ring", request.param)


def on_the_ring(run: Any) -> None:
    """The closed form for l = 1 + t from START: th = th_0 + h (1 - 1/l), with h = x y' - y x' = 0.5."""
    t, (x, y, x_dot, y_dot) = run.t, run.x
    angle = np.arctan2(0.8, 0.6) + 0.5 * (1.0 - 1.0 / (1.0 + t))
    assert np.abs(np.hypot(x, y) - (1.0 + t)).max() < 1e-12
    assert np.abs((x * x_dot + y * y_dot) / np.hypot(x, y) - 1.0).max() < 1e-12
    assert np.abs(np.unwrap(np.arctan2(y, x)) - angle).max() < 1e-8


START = {"x": 0.6, "y": 0.8, "x_dot": 0.6 - 0.8 * 0.5, "y_dot": 0.8 + 0.6 * 0.5}  # outwards 1, along the circle 0.5


@pytest.mark.parametrize("way", WAYS)
def test_momentum_of_a_string_that_is_let_out(winch: Any, way: str) -> None:
    run = winch.simulate(1.0, {"th_dot": 1.0}, inputs={"l": WAYS[way]}, **TIGHT)
    assert np.abs(run["l"] ** 2 * run["th_dot"] - 1.0).max() < 1e-9
    assert np.abs(run["l_dot"] - 1.0).max() < 1e-12  # at both ends too
    assert abs(run["th_ddot"][-1] + 2.0 / 8.0) < 1e-8  # th'' = -2 l'/l^3


@pytest.mark.parametrize("method", ["RK45", "Radau", "LSODA", "BDF"])
def test_every_stepper_takes_the_rates_and_stops_at_a_bend(winch: Any, method: str) -> None:
    held = ([0.2, 0.7], [1.0, 1.5])  # let out for half a second
    run = winch.simulate(1.0, {"th_dot": 1.0}, inputs={"l": held}, method=method, rtol=1e-9, atol=1e-11)
    assert abs(run["th_dot"][-1] - 1.0 / 1.5**2) < 1e-7
    assert run["l_dot"][[0, -1]].tolist() == [0.0, 0.0]
    assert {0.2, 0.7} <= set(run.t.tolist())
    back = winch.simulate((1.0, 0.0), run.x[:, -1], inputs={"l": held}, method=method, rtol=1e-9, atol=1e-11)
    assert abs(back["th_dot"][-1] - 1.0) < 1e-7


@pytest.mark.parametrize("way", WAYS)
def test_a_ring_that_widens_as_its_closed_form_says(ring: Any, way: str) -> None:
    run = ring.simulate(1.0, START, inputs={"l": WAYS[way]}, dense_output=True, **TIGHT)
    on_the_ring(run)
    assert 0.0 < run.residuals.raw_position < 1e-8
    assert run.residuals.position < 1e-14
    between = run.at(np.linspace(0.0, 1.0, 33))
    on_the_ring(between)
    assert np.abs(between["l_ddot"]).max() < 1e-9


def test_functions_give_their_rates_or_are_given_beside_them(ring: Any) -> None:
    own = Rated(lambda t: 1.0 + t, lambda t: 1.0, lambda t: 0.0)
    on_the_ring(ring.simulate(1.0, START, inputs={"l": own}, **TIGHT))
    functions = {"l": lambda t, x: 1.0 + t, "l_dot": lambda t, x: 1.0, "l_ddot": 0.0}
    on_the_ring(ring.simulate(1.0, START, inputs=functions, **TIGHT))
    on_the_ring(ring.simulate(1.0, START, inputs={"l": lambda t, x: 1.0 + t, "l_dot": "1"}, **TIGHT))


def test_direct_calls_have_rates_as_inputs(ring: Any) -> None:
    assert ring.u_names == ("l", "l_dot", "l_ddot")
    assert ring.u.tolist() == [1.0, 0.0, 0.0]
    given = {"l": 2.0, "l_dot": 0.5, "l_ddot": 3.0}
    state = ring.x0(x=2.0, y=0.0, y_dot=0.0, u=given)
    assert np.abs(state - [2.0, 0.0, 0.5, 0.0]).max() < 1e-14
    assert np.abs(ring.rhs(0.0, state, u=[*given.values()]) - [0.5, 0.0, 3.0, 0.0]).max() < 1e-12
    assert np.abs(ring.bind(u=given).input_jacobian(0.0, state)[2] - [0.0, 0.0, 1.0]).max() < 1e-9


@pytest.mark.parametrize(
    ("given", "demand"),
    [
        (lambda t, x: 1.0 + t, "EG-UNSUPPORTED l_dot"),
        (Rated(lambda t: 1.0 + t, lambda t: 1.0), "EG-UNSUPPORTED l_ddot"),
        (([0.0, 0.5], [1.0, 1.5]), "EG-JUMP l_ddot slope 0.5 cubic"),
        (eg.Signal([0.0, 0.5], [1.0, 2.0], "zero-order"), "EG-JUMP l_dot value 0.5"),
        ("1 + 0.1*x_dot", "EG-UNSUPPORTED l_dot acceleration"),
        ("1 + 0.1*x", "EG-UNSUPPORTED l_ddot x_dot acceleration"),
        ("1 + max(0, t - 0.25)", "EG-JUMP l_ddot 0.25"),
        ("1 + (t > 0.3)", "EG-JUMP l_dot 0.3"),
    ],
)
def test_a_rate_that_is_not_known_is_refused(ring: Any, given: Any, demand: str) -> None:
    refuses(demand, ring.simulate, 1.0, START, inputs={"l": given})


@pytest.mark.parametrize(
    "given",
    [
        {"l": 1.0, "l_dot": 1.0},
        {"l": "1 + t", "l_dot": 0.0},
        {"l": "1 + t", "l_dot": "2 + 0*t"},
        {"l": ([0.0, 1.0], [1.0, 2.0]), "l_dot": ([0.0, 1.0], [5.0, 5.0])},
        {"l": lambda t, x: 1.0 + t, "l_dot": lambda t, x: 2.0 * t},
        {"l": lambda t, x: 1.0 + (t > 0.3), "l_dot": 0.0},
    ],
)
def test_a_rate_that_contradicts_its_input_is_refused(given: Any) -> None:
    winch = build("winch", "numpy")
    with refused("EG-JUMP l l_dot 0.3" if callable(given["l"]) and given["l_dot"] == 0 else "EG-CONTRADICTION l l_dot"):
        winch.simulate(1.0, {"th_dot": 1.0}, inputs=given)


def test_a_rate_that_is_bound_of_a_held_input_is_refused() -> None:
    bound = build("winch", "numpy").bind(u={"l": 1.0, "l_dot": 1.0})
    refuses("EG-CONTRADICTION l_dot l 1", bound.simulate, 1.0, {"th_dot": 1.0})
    refuses("EG-CONTRADICTION l_dot l 1", bound.sensitivities, ["th"], 1.0, {"th_dot": 1.0})
    refuses("EG-CONTRADICTION l_dot l 1", bound.simulate_many, 1.0, {"th_dot": 1.0}, count=2)
    let_out = bound.simulate(1.0, {"th_dot": 1.0}, inputs={"l": "1 + t"}, **TIGHT)
    assert abs(let_out["th_dot"][-1] - 0.25) < 1e-9
    with refused("EG-CONTRADICTION l_dot l"):
        bound.simulate_many(1.0, {"th_dot": 1.0}, inputs={"l": [1.0, 2.0], "l_dot": [1.0, 2.0]})


def test_a_short_pulse_is_a_jump() -> None:
    pulse = "where(t > 0.5, 1, 0)*where(t < 0.501, 1, 0)"
    with refused("EG-JUMP l_dot 0.5"):
        build("winch", "numpy").simulate(1.0, {"th_dot": 1.0}, inputs={"l": f"1 + 0.1*{pulse}"})


def test_a_text_may_bend_where_one_rate_is_enough(winch: Any) -> None:
    run = winch.simulate(1.0, {"th_dot": 1.0}, inputs={"l": "1 + max(0, t - 0.25)"}, **TIGHT)
    assert abs(run["th_dot"][-1] - 1.0 / 1.75**2) < 1e-8
    run = winch.simulate(1.0, {"th_dot": 1.0}, inputs={"l": "1 + 0.5*sin(th)"}, **TIGHT)
    assert np.abs(run["l"] ** 2 * run["th_dot"] - 1.0).max() < 1e-8  # d/dt (l^2 th') = 0 along the motion


@pytest.mark.parametrize(("target", "method"), [("cython", "DOP853"), ("cython", "Radau"), ("numpy", "DOP853")])
def test_ensembles_take_the_rates(target: str, method: str) -> None:
    winch, ring = build("winch", target), build("ring", target)
    speeds = np.array([1.0, 2.0, 3.0, -1.0, 0.5])
    for way in ("text", "line", "spline"):
        options = {"method": method, "rtol": 1e-9, "atol": 1e-11}
        many = winch.simulate_many(1.0, {"th_dot": speeds}, inputs={"l": WAYS[way]}, **options)
        assert np.abs(many["th_dot"] - speeds / 4.0).max() < 1e-7
        assert abs(winch.simulate(1.0, **many.case(1), **TIGHT)["th_dot"][-1] - 0.5) < 1e-9
        runs = ring.simulate_many(1.0, START, inputs={"l": WAYS[way]}, count=3, t_eval=[0.0, 1.0], **options)
        assert np.abs(np.hypot(runs["x"], runs["y"]) - [[1.0], [2.0]]).max() < 1e-12
    held = winch.simulate_many(1.0, {"th_dot": 1.0}, inputs={"l": [1.0, 2.0]}, method=method)
    assert held["th_dot"].tolist() == [1.0, 1.0]


def test_the_differential_algebraic_form_takes_the_rates(ring: Any) -> None:
    run = ring.dae.solve(1.0, START, inputs={"l": "1 + t"}, rtol=1e-10, atol=1e-12)
    on_the_ring(run)


def test_inputs_that_move_everything_are_integrated() -> None:
    m = eg.Model.from_lagrangian("led", x_dot**2 / 2, [x], constraints=[x - l], inputs={l: 0.0})
    mod = m.compile(target="numpy")
    run = mod.simulate(1.0, inputs={"l": "t**3"}, **TIGHT)
    assert np.abs(run["x"] - run.t**3).max() < 1e-12
    assert np.abs(run["x_ddot"] - 6.0 * run.t).max() < 1e-9
    refuses("EG-UNSUPPORTED method=", mod.simulate, 1.0, inputs={"l": "t**3"}, method="kinematic")


def thrown(h: float = 2.0, w: float = 0.5) -> eg.Model:
    """A ball that starts at h/2 + w with the speed h w, and a state that begins at w squared."""
    m = eg.Model("thrown", gravity=(0.0, -10.0, 0.0))
    ball = m.body("ball", mass=1.0)
    m.prismatic("J", m.ground, ball, axis="y", coordinate="y")
    m.parameter("h", h)
    m.parameter("w", w)
    m.state("a", "-a", initial="w**2")
    m.initial(y="h/2 + w", y_dot="h*w")
    return m


def crank(start: float = 0.4, speed: float = 2.0) -> eg.Model:
    """A slider-crank whose start is declared by parameters: crank angle and slider speed."""
    m = eg.Model("crank", gravity=(0.0, -9.81, 0.0))
    m.parameter("start", start)
    m.parameter("speed", speed)
    m.parameter("r", 0.2)
    arm = m.body("arm", mass=1.0, inertia={"zz": 0.01}, com=("r/2", 0, 0))
    rod = m.body("rod", mass=1.0, inertia={"zz": 0.02}, com=(0.25, 0, 0))
    block = m.body("block", mass=1.0)
    m.revolute("A", m.ground, arm, axis="z", coordinate="theta")
    m.revolute("B", arm.at("r", 0, 0), rod, axis="z", coordinate="phi")
    m.prismatic("C", m.ground, block, axis="x", coordinate="s")
    m.revolute("D", rod.at(0.5, 0, 0), block, axis="z", coordinate="psi")
    m.guess(phi=-0.2, s=0.65)
    m.initial(theta="start", theta_dot="speed")
    m.independent = ["theta"]
    return m


@pytest.fixture(scope="module", params=TARGETS)
def ball(request: pytest.FixtureRequest) -> Any:
    return thrown().compile(target=request.param)


@pytest.fixture(scope="module")
def mechanism() -> Any:
    return crank().compile(target="numpy")


def start(h: float, w: float) -> list[float]:
    return [h / 2 + w, h * w, w * w]


def test_bound_parameters_start_where_their_expressions_say(ball: Any) -> None:
    p = {"h": 3.0, "w": 0.25}
    assert ball.x0() == pytest.approx(start(2.0, 0.5), rel=1e-15)
    assert ball.bind(p).x0() == pytest.approx(start(3.0, 0.25), rel=1e-15)
    assert ball.bind(p).bind({"h": 2.0, "w": 0.5}).x0() == pytest.approx(start(2.0, 0.5), rel=1e-15)
    assert ball.x0(p=[3.0, 0.25]) == pytest.approx(start(3.0, 0.25), rel=1e-15)
    assert ball.x0({"y": 7.0}, p=[3.0, 0.25]) == pytest.approx([7.0, 0.75, 0.0625], rel=1e-15)


@pytest.mark.parametrize("initial", [None, {"y_dot": 1.0}, {"a": [0.1, 0.2, 0.3]}])
def test_each_of_many_runs_begins_at_its_own(ball: Any, initial: Any) -> None:
    h = [1.0, 2.0, 3.0]
    found = ball.simulate_many(0.5, initial, {"h": h})
    for k, one in enumerate(h):
        given = {name: np.broadcast_to(x, 3)[k] for name, x in (initial or {}).items()}
        alone = thrown(one).compile(target="numpy").simulate(0.5, given)
        assert found.x[:, k] == pytest.approx(alone.x[:, -1], abs=1e-8)


def test_slopes_by_parameters_are_those_of_the_closed_form(ball: Any) -> None:
    t, h, w = 0.5, 2.0, 0.5
    found = ball.sensitivities(["h", "w"], t, t_eval=[0.0, t])
    assert found.dx[:, :, 0] == pytest.approx(np.array([[0.5, 1.0], [w, h], [0.0, 2.0 * w]]), abs=1e-14)
    assert found["y", "h"][-1] == pytest.approx(0.5 + w * t, abs=1e-8)
    assert found["a", "w"][-1] == pytest.approx(2.0 * w * np.exp(-t), abs=1e-7)


@pytest.mark.parametrize("angle", [-2.5, 0.9, 3.0])
def test_a_closed_loop_starts_as_if_declared_so(mechanism: Any, angle: float) -> None:
    late = mechanism.bind({"start": angle, "speed": -1.0, "r": 0.15})
    x = late.x0()
    s = 0.15 * np.cos(angle) + np.sqrt(0.25 - (0.15 * np.sin(angle)) ** 2)
    assert x[late.x_names.index("theta")] == pytest.approx(angle, abs=1e-12)
    assert float(late.poses(x[: late.n_q])[list(late.body_names).index("block")][0, 3]) == pytest.approx(s, abs=1e-12)
    assert late.minimal.x0() == pytest.approx([angle, -1.0], abs=1e-12)


def root() -> eg.Model:
    """A free slider that starts at sqrt(a) with the speed 1/a."""
    m = eg.Model("root", gravity=(0, 0, 0))
    m.parameter("a", 0.25)
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="q")
    m.initial(q="sqrt(a)", q_dot="1/a")
    return m


def test_a_start_that_is_given_needs_no_declared_one() -> None:
    module = root().compile(target="numpy")
    late = module.bind({"a": -1.0})
    assert late.rhs(0.0, [1.0, 2.0]) == pytest.approx([2.0, 0.0])
    assert late.x0({"q": 1.0}) == pytest.approx([1.0, -1.0])
    assert module.simulate(0.5, {"q": 1.0}, parameters={"a": -1.0}).x[:, -1] == pytest.approx([0.5, -1.0])
    assert module.simulate(0.5, [1.0, 2.0], parameters={"a": -1.0}).x[:, -1] == pytest.approx([2.0, 2.0])
    assert late.simulate_many(0.5, parameters={"a": [1.0, 4.0]}).x == pytest.approx(
        np.array([[1.5, 2.125], [1.0, 0.25]])
    )
    assert module.sensitivities(["q"], 0.5, {"q": 1.0}, parameters={"a": -1.0})["q", "q"][-1] == pytest.approx(1.0)
    for given in ({}, {"q_dot": 3.0}):
        refuses("EG-NOT-FINITE initial.q -1", late.x0, given)
    refuses("EG-NOT-FINITE initial.q_dot 0", module.simulate, 0.5, {"q": 1.0}, parameters={"a": 0.0})


@pytest.mark.parametrize("target", TARGETS)
def test_one_bad_set_of_parameters_fails_its_own_run(target: str) -> None:
    runs = root().compile(target=target).simulate_many(0.1, parameters={"a": [-1.0, 4.0]})
    assert np.isnan(runs.x[:, 0]).all()
    assert runs.x[0, 1] == pytest.approx(2.0 + 0.025, abs=1e-12)
    assert (runs.status != 0).tolist() == [True, False]


ALLOWED = {"k": 2e4, "r": 0.15, "mu": 0.5, "m_b": 2.0}
BAD = {"k": -1.0, "r": 0.0, "mu": -0.2, "m_b": -3.0}
#: What is said of each of them, and nothing else.
SAID = {
    "k": ["forces.floor.stiffness: is -1 with k = -1; must be greater than 0"],
    "r": ["forces.floor.first[0].radius: is 0 with r = 0; must be greater than 0"],
    "mu": ["forces.floor.friction: is -0.2 with mu = -0.2; must be 0 or greater"],
    "m_b": [
        "bodies.ball.mass: is -3 with m_b = -3; give a mass of 0 or more",
        "bodies.ball.inertia: the moment about the centre of mass is -0.015 with r = 0.1, m_b = -3; give",
    ],
}
MODEL = """
name: dropped
gravity: [0, -9.81, 0]
parameters: {k: 1.0e+4, r: 0.1, mu: 0.3, m_b: 1.0, e: 0.5}
bodies: {ball: {mass: m_b, inertia: {zz: m_b*r**2/2}}}
joints: {J: {type: planar, between: [ground, ball], coordinates: [x, y, phi]}}
forces:
  floor:
    {type: contacts, first: [{shape: circle, on: ball, radius: r}], second: [{shape: half_plane, on: ground}],
     stiffness: k, restitution: 1 - e**2, velocity: 1, friction: mu, smoothing: 0.01}
initial: {y: 0.3}
simulation: {end: 0.02}
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("late") / "dropped.yaml"
    found.write_text(MODEL)
    return found


@pytest.fixture(scope="module")
def dropped(file: Path) -> Any:
    return eg.load(file).derive().compile(target="numpy")


def said(error: eg.ModelError) -> list[str]:
    return [str(problem) for problem in error.problems]


@pytest.mark.parametrize("name", BAD)
def test_every_call_refuses_a_value_that_an_element_does_not_allow(dropped: Any, name: str) -> None:
    p = {name: BAD[name]}
    array = dropped.p
    array[dropped.p_names.index(name)] = BAD[name]
    x = dropped.x0()
    calls: list[Any] = [
        lambda: dropped.bind(p=p),
        lambda: dropped.bind(p=array),
        lambda: dropped.simulate(0.01, parameters=p),
        lambda: dropped.simulate_many(0.01, parameters=p, count=2),
        lambda: dropped.x0(p=p),
        lambda: dropped.rhs(0.0, x, p=p),
        lambda: dropped.sensitivities(["e"], 0.01, parameters=p),
        lambda: dropped.linearize(x=x, p=p),
    ]
    for call in calls:
        with pytest.raises(eg.ParameterError) as caught:
            call()
        assert len(said(caught.value)) == len(SAID[name])
        assert all(text.startswith(start) for text, start in zip(said(caught.value), SAID[name], strict=True))
        assert isinstance(caught.value, eg.UsageError)


def test_allowed_values_pass(dropped: Any) -> None:
    bound = dropped.bind(p=ALLOWED)
    run = dropped.simulate(0.01, parameters=ALLOWED)
    assert np.array_equal(run.x, bound.simulate(0.01).x)
    many = dropped.simulate_many(0.01, parameters={name: [value] * 3 for name, value in ALLOWED.items()})
    assert len(many) == 3
