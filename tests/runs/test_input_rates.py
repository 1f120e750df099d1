"""Inputs that move: closed forms of motions in which the rates of inputs count, whatever way the input is given."""

from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from models import IN_C
from refusals import refused, refuses

import eomgen as eg

TIGHT = {"rtol": 1e-10, "atol": 1e-12}
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
