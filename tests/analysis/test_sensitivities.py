"""Sensitivities of trajectories against closed forms and central differences of whole runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import eomgen as eg
from eomgen.runtime.signals import Forcing
from eomgen.simulation.sensitivities import _refuse_change_point

Compiled = Callable[..., Any]


def oscillator() -> eg.Model:
    m = eg.Model("oscillator")
    m.parameter("k", 5.0)
    mass = m.parameter("m", 2.0)
    m.input("F", 0.3)
    body = m.body("body", mass=mass)
    m.prismatic("s", m.ground, body, axis="x")
    m.actuator("spring", "s", value="F - k*s")
    m.output("push", "s_ddot + 3*k")
    m.initial(s=0.4, s_dot=-0.2)
    return m


def test_a_linear_oscillator() -> None:
    """Derivatives of the closed solution, by SymPy, in all five of its constants; an output of acceleration too."""
    mod = oscillator().compile(target="numpy")
    times = np.linspace(0.0, 3.0, 7)
    found = mod.sensitivities(["k", "m", "F", "s", "s_dot"], 3.0, t_eval=times)
    k, m, F, x0, v0, t = sympy.symbols("k m F x0 v0 t", positive=True)
    w = sympy.sqrt(k / m)
    x = F / k + (x0 - F / k) * sympy.cos(w * t) + v0 / w * sympy.sin(w * t)
    numbers = {k: 5.0, m: 2.0, F: 0.3, x0: 0.4, v0: -0.2}
    for name, symbol in zip(found.names, (k, m, F, x0, v0), strict=True):
        for row, expression in (("s", x), ("s_dot", x.diff(t)), ("push", x.diff(t, 2) + 3 * k)):
            exact = sympy.lambdify(t, expression.diff(symbol).subs(numbers) + 0 * t)(times)
            np.testing.assert_allclose(found[row, name], exact, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.trajectory["s"], sympy.lambdify(t, x.subs(numbers))(times), atol=1e-8)
    assert (found.held, found.dx.shape, found.dy.shape) == (("s", "s_dot"), (2, 5, 7), (1, 5, 7))


def differences(mod: Any, name: str, held: dict[str, float], times: np.ndarray, **inputs: Any) -> np.ndarray:
    """Central differences, fourth order, of whole runs from assembled states: (n_x, n_t)."""

    def run(shift: float) -> np.ndarray:
        p, u = (dict(zip(names, values, strict=True)) for names, values in ((mod.p_names, mod.p), (mod.u_names, mod.u)))
        start = dict(held)
        for values in (p, u, start):
            if name in values:
                values[name] += shift
        given = {**u, **inputs.get("inputs", {})}
        made = mod.simulate(times[-1], initial=start, parameters=p, inputs=given, t_eval=times, rtol=1e-12, atol=1e-14)
        return np.vstack([made.x, *(made[y] for y in mod.y_names)])

    h = 1e-4
    return (8 * (run(h) - run(-h)) - (run(2 * h) - run(-2 * h))) / (12 * h)


CASES = {
    "slider_crank": (["r", "l", "m_s", "tau", "theta", "theta_dot"], {"theta": 0.3, "theta_dot": 10.0}, 0.3),
    # held by the coordinate of the cut joint: the angles follow from it
    "offset_slider_crank": (["s", "s_dot"], {"s": 0.37, "s_dot": -0.5}, 0.3),
    "rolling_disc": (
        ["r", "g", "m", "lean", "spin_dot"],
        {"x": 0, "y": 0, "yaw": 0, "lean": 0.2, "spin": 0, "yaw_dot": 0.5, "lean_dot": 0.1, "spin_dot": 3.0},
        0.5,
    ),
    "rssr": (["r", "l", "tau", "th", "th_dot"], {"th": 0.3, "th_dot": 5.0}, 0.2),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_trajectories_of_mechanisms(compiled: Compiled, name: str) -> None:
    """The start is assembled anew for each parameter; the loops, Euler parameters and rolling follow."""
    names, held, end = CASES[name]
    mod = compiled(name, "cython")
    if name == "rssr":  # the rod spins about itself: what no value holds is held as it is
        x = mod.x0(held)
        held = {n: float(v) for n, v in zip(mod.x_names, x, strict=True) if n in mod.sensitivities(["r"], 1e-3, x).held}
    if name == "offset_slider_crank":
        names = [*names, *mod.p_names[:2]]
    times = np.linspace(0.0, end, 4)
    found = mod.sensitivities(names, end, held, t_eval=times, rtol=1e-11, atol=1e-13)
    for column, by in enumerate(found.names):
        expected = differences(mod, by, held, times)
        ours = np.concatenate([found.dx[:, column], found.dy[:, column]])
        np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-6 * max(1.0, np.abs(expected).max()), err_msg=by)


def test_the_start_follows_the_parameters(compiled: Compiled) -> None:
    """S(0) is the derivative of the assembly: what is held stays, the rest closes the loop."""
    mod = compiled("slider_crank")
    held = {"theta": 0.5, "theta_dot": 4.0}
    found = mod.sensitivities(["r", "theta", "theta_dot"], 1e-6, held)
    for column, by in enumerate(found.names):
        h = 1e-5
        sides = []
        for sign in (1, -1):
            start, p = dict(held), {}
            if by == "r":
                p = {"r": mod.p[mod.p_names.index("r")] + sign * h}
            else:
                start[by] += sign * h
            sides.append(mod.x0(start, p=p))
        expected = (sides[0] - sides[1]) / (2 * h)
        np.testing.assert_allclose(found.dx[:, column, 0], expected, rtol=0, atol=1e-7)
    assert np.abs(found["s", "r"][0]) > 0.1
    by_slider = mod.sensitivities(["r", "s"], 1e-6, mod.x0(held), hold=["s", "s_dot"])
    assert by_slider["s", "r"][0] == pytest.approx(0.0, abs=1e-12)
    assert by_slider["s", "s"][0] == pytest.approx(1.0, abs=1e-12)
    assert by_slider["theta", "r"][0] == pytest.approx(-found["s", "r"][0] / found["s", "theta"][0], rel=1e-9)


def test_inputs_over_time(compiled: Compiled) -> None:
    """A constant added to a tabulated input; inputs that depend on the state take part in the tangent."""
    mod = oscillator().compile(target="numpy")
    times = np.linspace(0.0, 1.0, 5)
    table = ([0.0, 0.4, 1.0], [0.0, 1.0, 0.5])
    found = mod.sensitivities(["F", "k"], 1.0, inputs={"F": table}, t_eval=times)
    expected = (1 - np.cos(np.sqrt(2.5) * times)) / 5.0
    np.testing.assert_allclose(found["s", "F"], expected, atol=1e-8)
    feedback = mod.sensitivities(["s_dot"], 1.0, inputs={"F": "-3*s"}, t_eval=times)
    np.testing.assert_allclose(feedback["s", "s_dot"], np.sin(2.0 * times) / 2.0, atol=1e-8)
    timed = mod.sensitivities(["F", "k"], 1.0, inputs={"F": lambda t, x: float(np.interp(t, *table))}, t_eval=times)
    np.testing.assert_allclose(timed.dx, found.dx, atol=1e-6)  # its corners are not stepped on
    with pytest.raises(eg.UsageError, match="input F is a Python function of the state.*expression in a text"):
        mod.sensitivities(["s_dot"], 1.0, inputs={"F": lambda t, x: -3.0 * x[0]})


@pytest.mark.parametrize("declared", [False, True], ids=["of the run", "of the model"])
def test_parameters_and_states_in_the_text_of_an_input(declared: bool) -> None:
    """s'' = -k^2 s + a cos(b t) with all of it in the input's text; outputs that hold the input follow."""
    text = "-k**2*s + a*cos(b*t)"
    m = eg.Model("led")
    for name, value in (("k", 2.0), ("a", 0.5), ("b", 3.0)):
        m.parameter(name, value)
    m.prismatic("rail", m.ground, m.body("b1", mass=1.0), axis="x", coordinate="s")
    m.torque("motor", "rail", m.input("u", **({"signal": text} if declared else {})))
    m.output("both", "2*u + s_ddot")
    mod = m.compile(target="numpy")
    times = np.linspace(0.0, 2.0, 6)
    given = {} if declared else {"inputs": {"u": text}}
    found = mod.sensitivities(["k", "a", "b", "s"], 2.0, {"s": 1.0, "s_dot": 0.0}, t_eval=times, **given)
    k, a, b, x0, t = sympy.symbols("k a b x0 t", positive=True)
    part = a / (k**2 - b**2)
    x = (x0 - part) * sympy.cos(k * t) + part * sympy.cos(b * t)
    numbers = {k: 2.0, a: 0.5, b: 3.0, x0: 1.0}
    for name, symbol in zip(found.names, (k, a, b, x0), strict=True):
        for row, expression in (("s", x), ("s_dot", x.diff(t)), ("both", 3 * x.diff(t, 2))):
            exact = sympy.lambdify(t, expression.diff(symbol).subs(numbers) + 0 * t)(times)
            np.testing.assert_allclose(found[row, name], exact, rtol=0, atol=2e-8)


def test_mistakes_and_files(compiled: Compiled, tmp_path: Path) -> None:
    mod = oscillator().compile(target="numpy")
    for names, options, message in (
        (["kk"], {}, "did you mean k"),
        (["k", "k"], {}, "each name only once"),
        ([], {}, "name at least one"),
        (["s_dot"], {"hold": ["s"]}, "s_dot is not held"),
        (["k"], {"hold": ["z"]}, "no coordinate or rate 'z'"),
        (["k"], {"initial": [1.0]}, "must name values or have shape"),
        (["k"], {"method": "DOP854"}, "did you mean DOP853"),
    ):
        with pytest.raises(eg.UsageError, match=message):
            mod.sensitivities(names, 0.1, **options)
    found = mod.sensitivities("k", 0.1)
    with pytest.raises(eg.UsageError, match="state or output"):
        found["s"]
    with pytest.raises(eg.UsageError, match="differentiated by"):
        found["s", "m"]
    table = np.genfromtxt(found.save(tmp_path / "by.csv"), delimiter=",", names=True, deletechars="")
    np.testing.assert_array_equal(table["d(s)/d(k)"], found["s", "k"])
    with np.load(found.save(tmp_path / "by")) as kept:
        np.testing.assert_array_equal(kept["dx"], found.dx)
    assert "to k" in repr(found)
    loop = compiled("slider_crank")
    with pytest.raises(eg.UsageError, match="the start cannot follow a change of r"):
        loop.sensitivities(["r"], 0.1, loop.x0(), hold=["theta", "s"])


def test_a_change_point_is_named() -> None:
    # 0.3 + 0.6 = 0.5 + 0.4: flat at th = 0, where the slopes of both closure rows are parallel
    m = eg.Model("flat")
    crank, rod, rock = (m.body(name, mass=1, inertia={"zz": 0.01}) for name in ("crank", "rod", "rock"))
    m.revolute("A", m.ground, crank, coordinate="th")
    m.revolute("B", crank.at(0.3, 0, 0), rod)
    m.revolute("C", rod.at(0.5, 0, 0), rock.at(0.4, 0, 0))
    m.revolute("D", m.ground.at(-0.6, 0, 0), rock, coordinate="ps")
    m.initial(th=0.1)
    m.guess(ps=0.1, B=3.0)
    mod = m.compile(target="numpy")
    flat = np.array([{"B": np.pi}.get(name, 0.0) for name in mod.x_names])
    _refuse_change_point(mod, Forcing(mod.layout, None), 0.0, mod.x0())
    with pytest.raises(eg.NoDerivativeError, match="passes a change point at t = 0.5 s, th = 0.*end the run before"):
        _refuse_change_point(mod, Forcing(mod.layout, None), 0.5, flat)
