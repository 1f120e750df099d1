"""Sensitivities through events, against closed forms and central differences of whole runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import eomgen as eg

G = 9.81


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


@pytest.mark.parametrize(
    ("floor", "target"), [({}, "numpy"), (IMPACT, "numpy"), (IMPACT, "cython")], ids=["reset", "impact", "impact in C"]
)
def test_a_bouncing_ball_in_closed_form(floor: dict[str, Any], target: str) -> None:
    mod, end = ball(**floor).compile(target=target), 1.3
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


def test_a_text_as_event_and_events_that_are_not_watched() -> None:
    m = ball()
    m.event("up", "t - 0.1", terminal=True)
    mod = m.compile(target="numpy")
    half = {"half": {"expression": "h - h_dot*g/100 - 0.5", "direction": -1}}
    s = mod.sensitivities(["g"], 0.45, events=half)
    assert s.t[-1] == 0.45
    t = sympy.symbols("t")
    g = sympy.Symbol("g", positive=True)
    time = sympy.solve(1 - g * t**2 / 2 + g**2 * t / 100 - sympy.Rational(1, 2), t)
    time = next(x for x in time if x.subs(g, G) > 0)
    assert s.events[0].t == pytest.approx(float(time.subs(g, G)), abs=1e-10)
    assert s.event_times["half"][0, 0] == pytest.approx(float(time.diff(g).subs(g, G)), abs=1e-9)
    assert len(s.event_times["up"]) == len(s.trajectory.t_events["up"]) == 0


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
        source = (Path(__file__).parents[2] / "examples" / "slider_crank.yaml").read_text(encoding="utf-8")
        (folder / "crank.yaml").write_text(f"{source}\nevents: {{{event}}}\n", encoding="utf-8")
        return eg.load(folder / "crank.yaml")

    return made


def disc(folder: Path) -> eg.Model:
    m = eg.load(Path(__file__).parents[2] / "examples" / "rolling_disc.yaml")
    m.event("kick", "spin - 0.5", direction=1, reset={"lean_dot": "lean_dot + 0.2*r", "spin_dot": "1.3*spin_dot"})
    return m


def two_bars(folder: Path) -> eg.Model:
    """A double pendulum whose end hits a wall that moves."""
    m = eg.Model("wall", gravity=(0, "-g", 0))
    m.parameter("g", G)
    mass, far, l = m.parameter("mass", 0.7), m.parameter("far", 0.3), m.parameter("l", 0.8)
    upper = m.body("upper", mass=1.0, com=(0, -0.5, 0), inertia={"zz": 0.08})
    lower = m.body("lower", mass=mass, com=(0, -l / 2, 0), inertia={"zz": 0.05})
    m.revolute("A", m.ground, upper, coordinate="a")
    m.revolute("B", upper.at(0, -1, 0), lower, coordinate="b")
    m.event("wall", lower.at(0, -l, 0).position[0] + far + 0.05 * m.t, restitution=0.6)
    return m


def stone(folder: Path) -> eg.Model:
    """A body in Euler parameters that lands on a corner."""
    m = eg.Model("stone", gravity=(0, 0, "-g"))
    m.parameter("g", G)
    J, r = m.parameter("J", 0.3), m.parameter("r", 0.4)
    body = m.body("b", mass=1.0, inertia=(J, 0.5, 0.6))
    m.free("f", m.ground, body, rotation="euler_parameters")
    m.event("floor", body.at(r, 0, 0.1).position[2] + 1.0, restitution=0.7)
    return m


THROWN = dict.fromkeys(["f_x", "f_y", "f_z", "f_e1", "f_e2", "f_e3", "f_y_dot", "f_z_dot"], 0.0) | {
    "f_e0": 1.0, "f_wx": 0.3, "f_wy": 2.0, "f_wz": 0.4, "f_x_dot": 0.1
}  # fmt: skip
ROLLS = {"x": 0, "y": 0, "yaw": 0, "lean": 0.2, "spin": 0, "yaw_dot": 0.5, "lean_dot": 0.1, "spin_dot": 3.0}
#: model, names, what is held, end, how many events
CASES: dict[str, tuple[Any, list[str], dict[str, float], float, int]] = {
    "an impact in a loop": (
        crank("stop: {expression: 0.4 - s, restitution: 0.5}"),
        ["r", "l", "m_s", "theta", "theta_dot"], {"theta": 1.3, "theta_dot": -10.0}, 0.2, 1,
    ),
    "a reset that the loop takes back in part": (
        crank("kick: {expression: theta + 1 + r/0.9, direction: -1, reset: {theta_dot: 1.1*theta_dot + 1.01*r*l}}"),
        ["r", "l", "theta_dot"], {"theta": -0.5, "theta_dot": 10.0}, 0.3, 1,
    ),
    "a reset that rolling takes back in part": (disc, ["r", "g", "lean", "spin_dot"], ROLLS, 0.4, 1),
    "a wall that moves": (
        two_bars, ["g", "mass", "far", "l", "a", "b_dot"], {"a": 0.9, "b": 0.2, "a_dot": 0.0, "b_dot": 0.0}, 0.9, 1
    ),
    "Euler parameters": (stone, ["g", "J", "r", "f_z", "f_wy"], THROWN, 0.8, 1),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_mechanisms_against_differences(case: str, tmp_path: Path) -> None:
    make, names, held, end, count = CASES[case]
    equations, h = make(tmp_path).derive(), 2e-5
    mod = equations.compile(target="numpy")
    quick = equations.compile(optimize=0) if mod.n_c else mod  # many runs of loops: by the functions in C
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
            made = quick.simulate(end, start, p, t_eval=times, rtol=1e-12, atol=1e-14)
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
    with pytest.raises(eg.ZenoError, match="floor.*near t = 4.0637"):  # sqrt(2/g) (1 + 2 e/(1 - e)) = 4.06371 s
        mod.sensitivities(["h"], 10.0, dropped)
    with pytest.raises(eg.NoDerivativeError, match="floor at t = 4.063.* nor where impacts die away"):
        mod.sensitivities(["h"], 4.0637, dropped)
    with pytest.raises(eg.NoDerivativeError, match="floor happens at the end of the run"):
        mod.sensitivities(["h"], float(np.sqrt(2 / G)), dropped)
    with pytest.raises(eg.NoDerivativeError, match="floor happens at the start of the run"):
        mod.sensitivities(["h"], 0.5, {"h": 0.0, "h_dot": -1.0})
    thrown = ball(direction=0, reset=None)
    thrown.event("ceiling", "1.0 - h", restitution=1.0)
    thrown = thrown.compile(target="numpy")
    # 0.45 s after it was thrown to 1e-9 above the ceiling, which it would reach 0.4515236 s after it was thrown
    speed, late = float(np.sqrt(2 * G)), 0.45
    hits = {"h": 1e-9 + speed * late - G * late**2 / 2, "h_dot": speed - G * late}
    with pytest.raises(eg.NoDerivativeError, match="ceiling at t = 0.0015.* only grazes"):
        thrown.sensitivities(["h_dot"], 0.003, hits, max_step=1e-5)
    assert issubclass(eg.NoDerivativeError, eg.SimulationError)

    m = eg.Model("two", gravity=(0, -G, 0))
    for i in "ab":
        m.prismatic(f"J{i}", m.ground, m.body(i, mass=1.0), axis="y", coordinate=i)
        m.event(f"floor_{i}", i, restitution=0.5)
    two = m.compile(target="numpy")
    with pytest.raises(eg.NoDerivativeError, match="floor_a and floor_b happen at once"):
        two.sensitivities(["a"], 0.6, {"a": 1.0, "b": 1.0})
    apart = two.sensitivities(["a"], 0.6, {"a": 1.0, "b": 1.001})
    assert [event.name for event in apart.events] == ["floor_a", "floor_b"]

    with pytest.raises(
        eg.NoDerivativeError, match="event shift resets coordinates to values that do not close the loops"
    ):
        crank("shift: {expression: theta + 1, direction: -1, reset: {theta: theta + 0.1}}")(tmp_path).compile(
            target="numpy"
        ).sensitivities(["r"], 0.3, {"theta": -0.5, "theta_dot": 10.0})
    with pytest.raises(eg.UsageError, match="event f is a Python function"):

        def f(t: float, x: np.ndarray) -> float:
            return t - 0.1

        mod.sensitivities(["h"], 0.3, events=f)


def test_a_jump_of_an_input_at_the_event_is_refused() -> None:
    m = eg.Model("kicked")
    m.prismatic("s", m.ground, m.body("a", mass=1.0), axis="x")
    m.torque("f", "s", m.input("u"))
    m.event("kick", "s - 1", direction=1, reset={"s_dot": "s_dot + 2"})
    mod = m.compile(target="numpy")
    jump = {"u": eg.Signal([0.0, 1.0], [0.0, 1.0], "zero-order")}
    with pytest.raises(eg.NoDerivativeError, match="kick happens at t = 1 s, exactly where an input jumps"):
        mod.sensitivities(["s"], 2.0, {"s": 0.0, "s_dot": 1.0}, inputs=jump)
    later = mod.sensitivities(["s", "s_dot"], 2.0, {"s": 0.1, "s_dot": 1.0}, inputs=jump)
    np.testing.assert_allclose(later["s", "s"][-1], 1 - (1.0 - 3.0) * (-1.0) * -1.0, atol=1e-9)


# -- inputs that move gaps, lengths and constraints --------------------------------------------------------------------
def racket() -> tuple[eg.Model, dict[str, float]]:
    m = eg.Model("racket", gravity=(0, -10, 0))
    m.parameter("r", 0.5)
    m.input("u")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="y", coordinate="s")
    m.event("hit", "s - u", restitution=0.8)
    return m, {"s": 1.0, "s_dot": 0.0}


def string() -> tuple[eg.Model, dict[str, float]]:
    th, thd, u, r = sympy.symbols("th th_dot u r")
    L = u**2 * thd**2 / 2 + u * sympy.cos(th)
    m = eg.Model.from_lagrangian("let_out", L, [th], inputs={u: 1.0}, parameters={r: 0.5})
    return m, {"th": 0.3, "th_dot": 1.0}


def ring() -> tuple[eg.Model, dict[str, float]]:
    x, y, xd, yd, u, r = sympy.symbols("x y x_dot y_dot u r")
    T = (xd**2 + yd**2) / 2 - r * y
    m = eg.Model.from_lagrangian(
        "ring", T, [x, y], constraints=[x**2 + y**2 - u**2], inputs={u: 1.0}, parameters={r: 0.5}
    )
    return m, {"x": 0.6, "x_dot": 0.8}


@pytest.mark.parametrize("make", [racket, string, ring])
def test_inputs_that_move_gaps_lengths_and_constraints(make: Any) -> None:
    model, held = make()
    mod, h, end = model.compile(target="numpy"), 1e-4, 0.9
    moved = {"u": "r*t + 0.1*sin(4*r*t)" if make is racket else "1 + 0.3*r*t + 0.1*sin(3*t)"}
    s = mod.sensitivities(["r"], end, held, inputs=moved, rtol=1e-10, atol=1e-12)
    assert len(s.events) == (make is racket)
    right, left = (
        mod.simulate(end, held, {"r": 0.5 + d}, moved, rtol=1e-12, atol=1e-14).x[:, -1] for d in (h, -h)
    )  # fmt: skip
    np.testing.assert_allclose(s.dx[:, 0, -1], (right - left) / (2 * h), atol=1e-6)
    assert np.abs(s.dx[:, 0, -1]).max() > 0.1


def test_events_at_the_start() -> None:
    m = eg.Model("ball", gravity=(0, -9.81, 0))
    m.prismatic("J", m.ground, m.body("b", mass=1), axis="y", coordinate="h")
    m.event("floor", "h")
    found = m.compile(target="numpy").sensitivities(["h_dot"], 0.5, {"h": 0.0})  # at rest, and only watched
    assert found["h", "h_dot"][-1] == pytest.approx(0.5, rel=1e-8)  # h = v t - g t^2 / 2
    m.event("end", "h", direction=-1, terminal=True)
    with pytest.raises(eg.NoDerivativeError, match="end happens at the start of the run"):
        m.compile(target="numpy").sensitivities(["h_dot"], 0.5, {"h": 0.0, "h_dot": -2.0})


def test_a_length_that_opens_a_change_point_has_no_derivative() -> None:
    """A driven parallelogram through its flat position: the torque has a derivative, the crank's length has none."""
    m = eg.Model("flat", gravity=(0, -9.81, 0))
    length = m.parameter("a", 0.3)
    m.parameter("k", 1.0)
    rods = {n: m.body(n, mass=1, com=(0.1, 0, 0), inertia=(0.01, 0.01, 0.01)) for n in "abc"}
    m.revolute("A", m.ground, rods["a"], coordinate="th")
    m.revolute("B", rods["a"].at(length, 0, 0), rods["b"], coordinate="be")
    m.revolute("D", m.ground.at(0.6, 0, 0), rods["c"], coordinate="ps")
    m.revolute("C", rods["b"].at(0.6, 0, 0), rods["c"].at(0.3, 0, 0))
    m.actuator("drive", "A", "k")
    m.initial(th=0.2)
    m.guess(be=-0.2, ps=0.2)
    m.independent("th")
    mod = m.compile()
    start = {"th": 0.2, "th_dot": -3.0}
    ends = [mod.simulate(0.2, start, parameters={"k": k}, rtol=1e-11, atol=1e-12)["th"][-1] for k in (1.001, 0.999)]
    found = mod.sensitivities(["k"], 0.2, start)
    assert len(found.trajectory.change_points) == 1
    assert len(mod.sensitivities(["k"], 0.2, start, t_eval=[0.0, 0.2]).trajectory.change_points) == 1
    assert found["th", "k"][-1] == pytest.approx((ends[0] - ends[1]) / 0.002, rel=1e-5)
    with pytest.raises(eg.NoDerivativeError, match="a change of a separates the branches"):
        mod.sensitivities(["a"], 0.2, start)


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_an_event_that_is_no_number_throughout_is_told_once(target: str) -> None:
    module = eg.load(Path(__file__).parents[2] / "examples" / "pendulum.yaml").compile(target=target)
    with pytest.warns(UserWarning, match="event outside: the value was not a number") as told:
        module.sensitivities(["g"], 0.1, events={"outside": "log(-1 - theta**2)"})
    assert len(told) == 1
    assert told[0].filename == __file__
    with pytest.warns(UserWarning, match="event outside: the value was not a number") as told:
        module.simulate(0.1, events={"outside": "log(-1 - theta**2)"})
    assert len(told) == 1
