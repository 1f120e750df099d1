"""A bare Lagrangian in every way to write one; which rates of inputs become inputs, and their course over time."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from model_files import load
from refusals import refused, refuses
from sympy.physics.mechanics import dynamicsymbols

import eomgen as eg

m, l, g, c, tau, t = sympy.symbols("m l g c tau t", positive=True)
VALUES = {"m": 1.3, "l": 0.7, "g": 9.8, "c": 0.2}
FILE = """\
name: p
parameters: {m: 1.3, l: 0.7, g: 9.8, c: 0.2}
inputs: {tau: 0.9}
lagrangian:
  coordinates: [q]
  expression: m*l**2*q_dot**2/2 + m*g*l*cos(q) + m*q_dot*sin(t)
  forces: {q: tau}
  dissipation: c*q_dot**2
"""


def energy(q: Any, v: Any) -> Any:
    return m * l**2 * v**2 / 2 + m * g * l * sympy.cos(q) + m * v * sympy.sin(t)


@pytest.mark.parametrize("way", ["functions of time", "symbols", "texts", "file"])
def test_ways_to_write_it(way: str, tmp_path: Path) -> None:
    """m l^2 q'' + m cos t = tau - m g l sin q - 2 c q'."""
    known = {"parameters": VALUES, "inputs": {tau: 0.9}}
    moving, (q, v) = dynamicsymbols("q"), sympy.symbols("q q_dot")
    speed = moving.diff(dynamicsymbols._t)
    timed = energy(moving, speed).subs(t, dynamicsymbols._t)
    make = {
        "functions of time": lambda: eg.Model.from_lagrangian("p", timed, [moving], {moving: tau}, c*speed**2, **known),
        "symbols": lambda: eg.Model.from_lagrangian("p", energy(q, v), [q], [tau], c * v**2, **known),
        "texts": lambda: eg.Model.from_lagrangian("p", FILE[FILE.index("m*l**2") : FILE.index("\n  forces")], ["q"],
                                                  {"q": "tau"}, "c*q_dot**2", **known),
        "file": lambda: load(tmp_path, FILE),
    }  # fmt: skip
    mod = make[way]().compile(target="numpy")
    x, time = [0.4, -1.1], 0.3
    wanted = (0.9 - 1.3 * 9.8 * 0.7 * np.sin(0.4) + 2 * 0.2 * 1.1 - 1.3 * np.cos(time)) / (1.3 * 0.7**2)
    np.testing.assert_allclose(mod.rhs(time, x), [-1.1, wanted], rtol=1e-13)
    assert mod.rhs(time, x, u={"tau": 1.9})[1] - wanted == pytest.approx(1 / (1.3 * 0.7**2))


def test_parameters_are_found_and_values_are_needed() -> None:
    q = dynamicsymbols("q")
    model = eg.Model.from_lagrangian(
        "p", energy(q, q.diff()).subs(t, dynamicsymbols._t), [q], inputs={tau: 0.5}, forces=[tau]
    )
    model.output("speed", l * q.diff())
    model.initial(q="pi/4", q_dot=l)
    assert repr(model) == "<Model p: Lagrangian, 3 parameters, 1 input, 1 output>"
    assert set(map(str, model.derive().parameters)) >= {"m", "l", "g"}
    with pytest.raises(eg.ModelError) as caught:
        model.compile(target="numpy")
    assert {p.path for p in caught.value.problems} == {"parameters.m", "parameters.l", "parameters.g"}


def test_faults_of_a_lagrangian() -> None:
    q, z = dynamicsymbols("q z")
    refuses("EG-TYPE lagrangian.coordinates[1] q(t)**2", eg.Model.from_lagrangian, "p", q, [q, q**2])
    bad = eg.Model.from_lagrangian(
        "p", q.diff() ** 2 + z + q.diff().diff(), [q], forces={z: 1}, constraints=[sympy.gamma(q)]
    )
    with pytest.raises(eg.ModelError) as caught:
        bad.check()
    told = {(p.path, p.message.split(" (")[0]) for p in caught.value.problems}
    assert ("lagrangian.expression", "unknown name 'z'") in told
    assert ("lagrangian.expression", "the acceleration 'q_ddot' cannot be used here") in told
    assert ("lagrangian.forces.z", "no coordinate 'z'") in told
    assert any(path == "lagrangian.constraints[0]" and "gamma" in message for path, message in told)


def test_a_clash_of_names() -> None:
    v = sympy.Symbol("q_dot")
    clash = eg.Model.from_lagrangian("p", v**2, ["q"], inputs={"q_dot": 1})
    refuses("EG-NAME-TAKEN lagrangian.coordinates[0] q_dot", clash.check)
    refuses("EG-MISSING lagrangian.coordinates", lambda: eg.Model.from_lagrangian("p", v**2, []).check())


def test_faults_of_a_file_have_their_lines(tmp_path: Path) -> None:
    bad = FILE.replace("{q: tau}", "[tau, tau]\n  constraints: q").replace("+ m*g", "+ mm*g")
    with pytest.raises(eg.ModelError) as caught:
        load(tmp_path, bad).check()
    found = [(p.line, p.path.removeprefix("lagrangian.")) for p in caught.value.problems]
    assert found == [(6, "expression"), (7, "forces"), (8, "constraints")]


@pytest.mark.parametrize("text", ["a_dot**4/4 - a**2/2", "-sqrt(1 - a_dot**2)", "sin(a_dot)*a"])
def test_a_lagrangian_that_is_not_quadratic_in_the_velocities_is_named(text: str) -> None:
    with refused("EG-EXPRESSION lagrangian.expression a_dot T"):
        eg.Model.from_lagrangian("powers", text, ["a"]).derive()


def test_what_is_quadratic_linear_or_constant_in_the_velocities_is_taken() -> None:
    text = "(1 + a**2)*a_dot**2/2 + a_dot*b_dot/3 + b_dot**2 + b*a_dot + sin(t)*b_dot - a**2 - b**4"
    M = eg.Model.from_lagrangian("mixed", text, ["a", "b"]).compile(target="numpy").mass_matrix([2.0, 1.0])
    assert M.tolist() == [[5.0, pytest.approx(1 / 3)], [pytest.approx(1 / 3), 2.0]]


# -- rates of inputs --------------------------------------------------------------------------------------------------
EQUATIONS = """\
name: bowl
inputs: {u: {value: 1, unit: m}}
equations:
  coordinates: [x, y]
  velocities: [w, s]
  rates: {x: RATE, y: s + w}
  mass_matrix: [[1, 0], [0, 2]]
  forcing: [0, -19.62]
  constraints: [ROW]
  kinetic_energy: (w**2 + 2*s**2)/2
outputs: {SHOWN}
"""


def bowl(folder: Path, row: str, rate: str, shown: str, by_input: bool) -> Any:
    text = EQUATIONS.replace("RATE", rate).replace("ROW", row).replace("SHOWN", shown)
    if not by_input:
        text = text.replace("inputs: {u: {value: 1, unit: m}}\n", "").replace("u*", "(1 + 0.3*sin(t))*")
    return load(folder, text).compile(target="numpy")


@pytest.mark.parametrize(
    ("row", "rate", "shown", "names"),
    [
        ("y - u*x**2", "w", "", ("u", "u_dot", "u_ddot")),
        ("s - u*w", "w", "", ("u", "u_dot")),
        ("y - x**2", "u*w + w", "", ("u", "u_dot")),
        ("y - u*x**2", "u*w + w", "acc: x_ddot", ("u", "u_dot", "u_ddot")),
        ("", "u*w + w", "acc: x_ddot", ("u", "u_dot")),
        ("", "u*w + w", "speed: x_dot", ("u",)),
    ],
)
def test_given_equations_move_as_with_the_expression_written_in(
    tmp_path: Path, row: str, rate: str, shown: str, names: tuple[str, ...]
) -> None:
    led, written = (bowl(tmp_path, row, rate, shown, by_input) for by_input in (True, False))
    assert led.u_names == names
    start = {"x": 0.5, "w": 0.1}
    ends = [mod.simulate(1.0, start, inputs=given) for mod, given in ((led, {"u": "1 + 0.3*sin(t)"}), (written, {}))]
    assert np.abs(ends[0].x[:, -1] - ends[1].x[:, -1]).max() < 1e-12
    for name in ends[1].names:
        assert np.abs(ends[0][name][[0, -1]] - ends[1][name][[0, -1]]).max() < 1e-10
    assert ends[0].residuals.position < 1e-14


def inputs_of(model: eg.Model) -> Any:
    return model.compile(target="numpy", kernels=["poses"]).u_names


def test_only_what_is_differentiated_gets_rates() -> None:
    th, th_dot, u, k = sympy.symbols("th th_dot u k")
    make = eg.Model.from_lagrangian
    held = make("a", th_dot**2 / 2 - u * th**2, [th], forces=[u], dissipation=u * th_dot**2, inputs={u: 1.0})
    assert inputs_of(held) == ("u",)
    moving = make("b", u**2 * th_dot**2 / 2, [th], inputs={u: 1.0, k: 2.0}, forces=[k])
    assert inputs_of(moving) == ("u", "k", "u_dot")
    m = eg.Model("c", gravity=(0, -10, 0))
    b = m.body("b", mass=1)
    m.prismatic("s", m.ground, b, axis="y")
    m.input("u", unit="mm")
    m.event("near", "s - u")
    assert inputs_of(m) == ("u",)
    m.event("floor", "s - u", restitution=0.5)
    assert inputs_of(m) == ("u", "u_dot")


def test_a_name_that_is_taken_is_reported() -> None:
    m = eg.Model("lift")
    b = m.body("b", mass=1)
    m.prismatic("s", m.ground, b, axis="y")
    m.input("u")
    m.parameter("u_ddot", 1.0)
    m.driver("lead", coordinate="s", value="u")
    refuses("EG-NAME-TAKEN parameters.u_ddot u lead", m.check)


REEL = """
name: reel
parameters: {k: 1}
inputs: {l: {value: 1, signal: 1 + k*t**2}}
lagrangian: {coordinates: [th], expression: l**2*th_dot**2/2}
"""


def test_an_expression_over_time_brings_its_rates(tmp_path: Path) -> None:
    """l^2 th' stays; of a signal of the model as of one of the run, which comes first."""
    mod = load(tmp_path, REEL).compile(target="numpy")
    start, tight = {"th_dot": 1.0}, {"rtol": 1e-10, "atol": 1e-12}
    run = mod.simulate(1.0, start, parameters={"k": 3.0}, **tight)
    assert np.abs(run["l"] ** 2 * run["th_dot"] - 1.0).max() < 1e-9
    assert np.abs(run["l_dot"] - 6.0 * run.t).max() < 1e-12
    assert abs(mod.simulate(1.0, start, inputs={"l": "1 + t"}, **tight)["th_dot"][-1] - 0.25) < 1e-9
    assert mod.simulate(1.0, start, inputs={"l": 2.0})["th_dot"][-1] == 1.0
    with refused("EG-UNSUPPORTED inputs.l.signal th_dot l_dot"):
        load(tmp_path, REEL.replace("1 + k*t**2", "1 + th_dot")).check()


@pytest.mark.parametrize(
    ("factor", "jumps"),
    [("where(t > t0, 1.5, 1)", True), ("where(t > t0, 1 + (t - t0), 1)", False), ("1 + max(t - 0.5, 0)", False)],
)
def test_what_jumps_in_time_by_a_condition_is_refused(factor: str, jumps: bool) -> None:
    """Differentiated by time the branch taken is constant, so that the impulse of the jump would be passed over."""
    m = eg.Model("lift", gravity=(0, -9.81, 0))
    m.parameter("t0", 0.3)
    m.prismatic("s", m.ground, m.body("b", mass=1), axis="x")
    m.coupling("led", equation=f"s - 0.1*({factor})")
    if jumps:
        refuses("EG-JUMP constraints.led", m.check)
    else:
        assert m.check().degrees_of_freedom == 0


def test_a_law_without_a_value_at_some_parameters_is_no_jump() -> None:
    """sqrt(l^2 - 10 r^2) is a number at the declared values, not at all that a random point may have."""
    x, y = dynamicsymbols("x y")
    t, r, l, T = dynamicsymbols._t, *sympy.symbols("r l T")
    c = sympy.sqrt(l**2 - 10 * r**2)
    law = sympy.Piecewise((c * t**3 / T**3, t < T), (c * (3 * t - 2 * T) / T, True))
    L = (x.diff(t) ** 2 + y.diff(t) ** 2) / 2
    given = {r: 0.1, l: 0.35, T: 1.0}
    model = eg.Model.from_lagrangian("led", L, [x, y], constraints=[x - y - law], parameters=given)
    assert model.check().degrees_of_freedom == 1
