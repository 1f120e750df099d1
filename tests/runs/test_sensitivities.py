"""Derivatives by parameters, inputs and starts: of the right-hand side by differences, of runs by closed forms.

Through events too: resets, impacts, ends; and what has no derivative is refused by name.
"""

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import judges
import models
import numpy as np
import pytest
import sympy
from analysed import compiled
from refusals import refused, refuses
from sweeps import part_of

import eomgen as eg

G = 9.81


def slopes(f: Callable[[np.ndarray], np.ndarray], values: np.ndarray) -> np.ndarray:
    """Derivative of f (n,) at values (k,), tenth order; (n, k)."""
    columns = []
    for k, value in enumerate(values):
        size = abs(value) or 1.0

        def along(steps: np.ndarray, k: int = k) -> np.ndarray:
            unit = np.eye(len(values))[k]
            return np.stack([f(values + step * unit) for step in steps[0] - values[k]], axis=-1)

        columns.append(judges.first(along, values[[k]], np.array([size]), h=1e-3, size=1.0) / size)
    return np.array(columns).T if len(values) else np.zeros((len(f(values)), 0))


@pytest.mark.parametrize(
    ("name", "target"),
    part_of(
        itertools.product(
            ("slider_crank", "three_cranks", "rolling_disc", "rssr", "double_pendulum"), ("numpy", "cython")
        ),
        lambda case: case[1] == "numpy" or case[0] in ("slider_crank", "rssr"),
    ),
)
def test_derivatives_of_the_right_hand_side(name: str, target: str) -> None:
    mod = compiled(name, target)
    start = mod.x0()
    states = [start, mod.project(start + 0.02 * np.random.default_rng(4).uniform(-1, 1, mod.n_x))]
    for x in states:
        for found, values, key in (
            (mod.parameter_jacobian(0.3, x), mod.p, "p"),
            (mod.input_jacobian(0.3, x), mod.u, "u"),
        ):
            assert found.shape == (mod.n_x, len(values))

            def rhs(changed: np.ndarray, x: np.ndarray = x, key: str = key) -> np.ndarray:
                return mod.rhs(0.3, x, **{key: changed})

            expected = slopes(rhs, values)
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * np.abs(expected).max(initial=1.0))


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


@pytest.mark.quick
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


def test_a_spring_that_bends_beside_a_far_coordinate() -> None:
    """Two half waves, k above and 20 below, in closed form; the far coordinate lends them no tolerance."""
    m = eg.Model("bent")
    m.parameter("k", 40.0)
    for name, start in (("z", 1.0), ("far", 1e4)):
        m.body(f"body_{name}", mass=1.0)
        m.prismatic(name, m.ground, f"body_{name}", axis="x")
        m.initial(**{name: start, f"{name}_dot": 0.0})
    m.actuator("spring", "z", value="-k*max(z, 0) + 20*max(-z, 0)")
    times = np.linspace(0.0, 0.9, 19)
    k, t = sympy.symbols("k t", positive=True)
    above, below = sympy.sqrt(k), sympy.sqrt(20)
    later = -above / below * sympy.sin(below * (t - sympy.pi / 2 / above))
    slope = sympy.Piecewise((sympy.cos(above * t).diff(k), t < sympy.pi / 2 / above), (later.diff(k), True))
    exact = sympy.lambdify(t, slope.subs(k, 40.0))(times)
    for rtol, allowed in ((1e-9, 1e-8), (1e-6, 1e-5)):
        found = m.compile(target="numpy").sensitivities(["k"], times[-1], t_eval=times, rtol=rtol)
        np.testing.assert_allclose(found["z", "k"], exact, rtol=0, atol=allowed)


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
    "slider_crank": (["r", "m_s", "tau", "theta_dot"], {"theta": 0.3, "theta_dot": 10.0}, 0.3),
    # held by the coordinate of the cut joint: the angles follow from it
    "offset_slider_crank": (["s", "s_dot"], {"s": 0.37, "s_dot": -0.5}, 0.3),
    "rolling_disc": (
        ["r", "lean", "spin_dot"],
        {"x": 0, "y": 0, "yaw": 0, "lean": 0.2, "spin": 0, "yaw_dot": 0.5, "lean_dot": 0.1, "spin_dot": 3.0},
        0.5,
    ),
    "rssr": (["l", "tau", "th_dot"], {"th": 0.3, "th_dot": 5.0}, 0.2),
}  # fmt: skip


@pytest.mark.parametrize("name", part_of(CASES, lambda name: name != "offset_slider_crank"))
def test_trajectories_of_mechanisms(name: str) -> None:
    """The start is assembled anew for each parameter; the loops, Euler parameters and rolling follow."""
    names, held, end = CASES[name]
    mod = compiled(name, "cython")
    if name == "rssr":  # the rod spins about itself: what no value holds is held as it is
        x = mod.x0(held)
        held = {n: float(v) for n, v in zip(mod.x_names, x, strict=True) if n in mod.sensitivities(["r"], 1e-3, x).held}
    if name == "offset_slider_crank":
        names = [*names, mod.p_names[0]]
    times = np.linspace(0.0, end, 4)
    found = mod.sensitivities(names, end, held, t_eval=times, rtol=1e-11, atol=1e-13)
    for column, by in enumerate(found.names):
        expected = differences(mod, by, held, times)
        ours = np.concatenate([found.dx[:, column], found.dy[:, column]])
        np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-6 * max(1.0, np.abs(expected).max()), err_msg=by)


def test_the_start_follows_the_parameters() -> None:
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


def test_inputs_over_time() -> None:
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
    refuses("EG-UNSUPPORTED F", mod.sensitivities, ["s_dot"], 1.0, inputs={"F": lambda t, x: -3.0 * x[0]})


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


def test_what_sensitivities_refuse_and_save(tmp_path: Path) -> None:
    mod = oscillator().compile(target="numpy")
    for names, options, message in (
        (["kk"], {}, "EG-NAME-UNKNOWN k?"),
        (["k", "k"], {}, "EG-CONFLICT once"),
        (["s_dot"], {"hold": ["s"]}, "EG-REFERENCE s_dot"),
        (["k"], {"hold": ["z"]}, "EG-NAME-UNKNOWN z"),
        (["k"], {"method": "DOP854"}, "EG-NAME-UNKNOWN DOP853?"),
    ):
        refuses(message, mod.sensitivities, names, 0.1, **options)
    found = mod.sensitivities("k", 0.1)
    refuses("EG-TYPE output", lambda: found["s"])
    table = np.genfromtxt(found.save(tmp_path / "by.csv"), delimiter=",", names=True, deletechars="")
    np.testing.assert_array_equal(table["d(s)/d(k)"], found["s", "k"])
    with np.load(found.save(tmp_path / "by")) as kept:
        np.testing.assert_array_equal(kept["dx"], found.dx)
    assert "to k" in repr(found)
    loop = compiled("slider_crank")
    refuses("EG-CONTRADICTION r", lambda: loop.sensitivities(["r"], 0.1, loop.x0(), hold=["theta", "s"]))


def ball(**floor: Any) -> eg.Model:
    m = eg.Model("ball", gravity=(0, "-g", 0))
    m.parameter("g", G)
    m.parameter("e", 0.8)
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.initial(h=1.0)
    m.event("floor", "h", **({"direction": -1, "reset": {"h_dot": "-e*h_dot"}} | floor))
    m.output("twice", "2*h + h_ddot")
    return m


def bounces() -> tuple[list[sympy.Symbol], list[sympy.Expr], sympy.Expr, sympy.Expr]:
    """h0, v0, g, e; the times of the first two hits; h and h' between the second and the third."""
    h0, v0, t = sympy.symbols("h0 v0 t", real=True)
    g, e = sympy.symbols("g e", positive=True)
    down = sympy.sqrt(v0**2 + 2 * g * h0)
    first = (v0 + down) / g
    second = first + 2 * e * down / g
    height = e**2 * down * (t - second) - g * (t - second) ** 2 / 2
    return [h0, v0, g, e], [first, second], height, height.diff(t)


IMPACT = {"direction": 0, "reset": None, "restitution": 0.8}


@pytest.mark.parametrize("floor", [{}, IMPACT], ids=["reset", "impact"])
def test_a_bouncing_ball_in_closed_form(floor: dict[str, Any]) -> None:
    mod, end = ball(**floor).compile(target="numpy"), 1.3
    names = ["h", "h_dot", "g"] + (["e"] if not floor else [])
    s = mod.sensitivities(names, end, {"h": 1.0, "h_dot": 0.5})
    symbols, times, height, speed = bounces()
    numbers = dict(zip(symbols, (1.0, 0.5, G, 0.8), strict=True))
    at_end = {**numbers, sympy.Symbol("t", real=True): end}
    assert len(s.events) == 2
    for column, symbol in enumerate(symbols[: len(names)]):
        for row, expression in (("h", height), ("h_dot", speed)):
            assert s[row, names[column]][-1] == pytest.approx(float(expression.diff(symbol).subs(at_end)), abs=2e-8)
        output = 2 * float(height.diff(symbol).subs(at_end)) - (symbol.name == "g")
        assert s["twice", names[column]][-1] == pytest.approx(output, abs=5e-8)
        for event, time, by in zip(s.events, times, s.event_times["floor"], strict=True):
            assert event.t == pytest.approx(float(time.subs(numbers)), abs=1e-9)
            assert event.dt[column] == by[column] == pytest.approx(float(time.diff(symbol).subs(numbers)), abs=1e-8)
    np.testing.assert_allclose([event.d_before[0] for event in s.events], 0.0, atol=1e-8)  # h = 0 at every hit
    first = s.events[0]
    own = np.array([0.0, 0.0, 0.0, -first.before[1]])[: len(names)]
    np.testing.assert_allclose(first.d_after[1], -0.8 * first.d_before[1] + own, atol=1e-9)
    twice = np.flatnonzero(np.diff(s.t) == 0.0)
    assert len(twice) == 2  # both sides of a hit are kept, at fixed times h changes from -v dT to -v+ dT
    np.testing.assert_allclose(s["h", "h"][twice + 1], -0.8 * s["h", "h"][twice], atol=1e-9)
    dips = mod.sensitivities(names, end, {"h": 1.0, "h_dot": 0.5}, events={"dip": "(t - 0.2)**2 - 1e-8"})
    np.testing.assert_allclose(dips.trajectory.t_events["dip"], [0.2 - 1e-4, 0.2 + 1e-4], atol=1e-9)  # within a step


def test_an_event_that_ends_the_run() -> None:
    mod = ball(terminal=True, direction=-1, reset=None).compile(target="numpy")
    s = mod.sensitivities(["h", "h_dot", "g"], 3.0, {"h": 1.0, "h_dot": 0.0})
    fall, v = np.sqrt(2 / G), np.sqrt(2 * G)
    assert (s.trajectory.status, s.t[-1]) == (1, pytest.approx(fall, abs=1e-10))
    np.testing.assert_allclose(s.event_times["floor"], [[1 / v, 1 / G, -fall / (2 * G)]], atol=1e-9)
    np.testing.assert_allclose(s.events[0].d_before, [[0, 0, 0], [-G / v, 0.0, -1 / v]], atol=1e-9)
    second = ball(terminal=2).compile(target="numpy").sensitivities(["h"], 3.0, {"h": 1.0})
    assert second.trajectory.status == 1
    assert second.event_times["floor"][1, 0] == pytest.approx((1 + 2 * 0.8) / v, abs=1e-9)


def test_dry_friction_is_a_rate_that_jumps_where_an_event_is_declared() -> None:
    """x'' = -k x - F sign(x'): half swings about -F/k and F/k (closed form)."""
    m = eg.Model("dry")
    m.parameter("k", 4.0)
    m.parameter("F", 0.7)
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
    m.torque("pull", "J", m.input("u"))
    m.torque("spring", "J", "-k*s")
    m.event("turn", "s_dot")
    mod = m.compile(target="numpy")
    x0, v0 = 1.0, 0.5
    k, F, a, b, t = sympy.symbols("k F x0 v0 t", positive=True)
    w = sympy.sqrt(k)
    first = sympy.sqrt((a + F / k) ** 2 + b**2 / k)
    turn = sympy.atan2(b / w, a + F / k) / w
    position = F / k + (first - 2 * F / k) * sympy.cos(w * (t - turn))
    numbers = {k: 4.0, F: 0.7, a: x0, b: v0, t: 1.2}
    assert float((turn + sympy.pi / w).subs(numbers)) > 1.2
    s = mod.sensitivities(["k", "F", "s", "s_dot"], 1.2, {"s": x0, "s_dot": v0}, inputs={"u": "-F*sign(s_dot)"})
    for name, symbol in zip(s.names, (k, F, a, b), strict=True):
        assert s["s", name][-1] == pytest.approx(float(position.diff(symbol).subs(numbers)), abs=1e-7)
        assert s["s_dot", name][-1] == pytest.approx(float(position.diff(t, symbol).subs(numbers)), abs=1e-7)
        by = s.event_times["turn"][0, s.names.index(name)]
        assert by == pytest.approx(float(turn.diff(symbol).subs(numbers)), abs=1e-8)


# -- mechanisms --------------------------------------------------------------------------------------------------------
def crank(event: str) -> Any:
    def made(folder: Path) -> eg.Model:
        source = (models.EXAMPLES / "slider_crank.yaml").read_text(encoding="utf-8")
        (folder / "crank.yaml").write_text(f"{source}\nevents: {{{event}}}\n", encoding="utf-8")
        return eg.load(folder / "crank.yaml")

    return made


def disc(folder: Path) -> eg.Model:
    m = eg.load_example("rolling_disc")
    m.event("kick", "spin - 0.5", direction=1, reset={"lean_dot": "lean_dot + 0.2*r", "spin_dot": "1.3*spin_dot"})
    return m


ROLLS = {"x": 0, "y": 0, "yaw": 0, "lean": 0.2, "spin": 0, "yaw_dot": 0.5, "lean_dot": 0.1, "spin_dot": 3.0}
#: model, names, what is held, end, how many events
STRUCK: dict[str, tuple[Any, list[str], dict[str, float], float, int]] = {
    "an impact in a loop": (
        crank("stop: {expression: 0.4 - s, restitution: 0.5}"),
        ["r", "theta_dot"], {"theta": 1.3, "theta_dot": -10.0}, 0.2, 1,
    ),
    "a reset that the loop takes back in part": (
        crank("kick: {expression: theta + 1 + r/0.9, direction: -1, reset: {theta_dot: 1.1*theta_dot + 1.01*r*l}}"),
        ["l", "theta_dot"], {"theta": -0.5, "theta_dot": 10.0}, 0.3, 1,
    ),
    "a reset that rolling takes back in part": (disc, ["r", "lean", "spin_dot"], ROLLS, 0.4, 1),
}  # fmt: skip


@pytest.mark.parametrize("case", part_of(STRUCK, lambda case: case != "a reset that the loop takes back in part"))
def test_mechanisms_against_differences(case: str, tmp_path: Path) -> None:
    make, names, held, end, count = STRUCK[case]
    equations, h = make(tmp_path).derive(), 2e-5
    mod = equations.compile(target="numpy")
    times = np.array([0.5 * end, end])
    s = mod.sensitivities(names, end, held, t_eval=times, rtol=1e-10, atol=1e-12)
    assert len(s.events) == count
    assert s.trajectory.residuals.velocity < 1e-9
    for column, name in enumerate(names):

        def run(shift: float, name: str = name) -> tuple[np.ndarray, np.ndarray]:
            start, p = dict(held), {}
            if name in start:
                start[name] += shift
            else:
                p = {name: mod.p[mod.p_names.index(name)] + shift}
            made = mod.simulate(end, start, p, t_eval=times, rtol=1e-12, atol=1e-14)
            return np.vstack([made.x, *(made[y] for y in mod.y_names)]), np.concatenate(made.t_events)

        right, left = run(h), run(-h)
        x, at = ((a - b) / (2 * h) for a, b in zip(right, left, strict=True))
        ours = np.concatenate([s.dx[:, column], s.dy[:, column]])
        np.testing.assert_allclose(ours, x, rtol=0, atol=2e-6 * max(1.0, np.abs(x).max()), err_msg=name)
        np.testing.assert_allclose([event.dt[column] for event in s.events], at, rtol=1e-5, atol=1e-7, err_msg=name)


# -- what has no derivative --------------------------------------------------------------------------------------------
def test_what_has_no_derivative_is_refused(tmp_path: Path) -> None:
    dropped = {"h": 1.0, "h_dot": 0.0}
    mod = ball().compile(target="numpy")
    with refused("EG-ZENO floor 4.06371"):  # sqrt(2/g) (1 + 2 e/(1 - e)) = 4.06371 s
        mod.sensitivities(["h"], 10.0, dropped)
    refuses("EG-NO-DERIVATIVE floor", mod.sensitivities, ["h"], 4.0637, dropped)
    refuses("EG-NO-DERIVATIVE floor start", mod.sensitivities, ["h"], 0.5, {"h": 0.0, "h_dot": -1.0})
    m = eg.Model("two", gravity=(0, -G, 0))
    for i in "ab":
        m.prismatic(f"J{i}", m.ground, m.body(i, mass=1.0), axis="y", coordinate=i)
        m.event(f"floor_{i}", i, restitution=0.5)
    two = m.compile(target="numpy")
    refuses("EG-NO-DERIVATIVE floor_a floor_b", two.sensitivities, ["a"], 0.6, {"a": 1.0, "b": 1.0})
    apart = two.sensitivities(["a"], 0.6, {"a": 1.0, "b": 1.001})
    assert [event.name for event in apart.events] == ["floor_a", "floor_b"]

    with refused("EG-NO-DERIVATIVE shift"):
        crank("shift: {expression: theta + 1, direction: -1, reset: {theta: theta + 0.1}}")(tmp_path).compile(
            target="numpy"
        ).sensitivities(["r"], 0.3, {"theta": -0.5, "theta_dot": 10.0})
    with refused("EG-UNSUPPORTED f"):

        def f(t: float, x: np.ndarray) -> float:
            return t - 0.1

        mod.sensitivities(["h"], 0.3, events=f)
