"""Which rates of inputs become inputs of their own, and with what name, unit and expression over time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

import eomgen as eg
from eomgen.describe.input_names import chains, rate_of, split_rate

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
    file = folder / "bowl.yaml"
    file.write_text(text, encoding="utf-8")
    return eg.load(file).compile(target="numpy")


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


def test_only_what_is_differentiated_gets_rates() -> None:
    th, th_dot, u, k = sp.symbols("th th_dot u k")
    make = eg.Model.from_lagrangian
    held = make("a", th_dot**2 / 2 - u * th**2, [th], forces=[u], dissipation=u * th_dot**2, inputs={u: 1.0})
    assert [x.name for x in held.mechanism().inputs] == ["u"]
    moving = make("b", u**2 * th_dot**2 / 2, [th], inputs={u: 1.0, k: 2.0}, forces=[k])
    assert [x.name for x in moving.mechanism().inputs] == ["u", "k", "u_dot"]
    m = eg.Model("c", gravity=(0, -10, 0))
    b = m.body("b", mass=1)
    m.prismatic("s", m.ground, b, axis="y")
    m.input("u", unit="mm")
    m.event("near", "s - u")
    assert [x.name for x in m.mechanism().inputs] == ["u"]
    m.event("floor", "s - u", restitution=0.5)
    assert [x.name for x in m.mechanism().inputs] == ["u", "u_dot"]


def test_a_name_that_is_taken_is_told() -> None:
    m = eg.Model("lift")
    b = m.body("b", mass=1)
    m.prismatic("s", m.ground, b, axis="y")
    m.input("u")
    m.parameter("u_ddot", 1.0)
    m.driver("lead", coordinate="s", value="u")
    with pytest.raises(eg.ModelError, match=r"u_ddot.*rate of input 'u', whose rate the driver 'lead' needs"):
        m.mechanism()


def test_an_expression_over_time_brings_its_rates() -> None:
    """l^2 th' stays; of a signal of the model as of one of the run, which comes first."""
    th, th_dot, l = sp.symbols("th th_dot l")
    model = eg.Model.from_lagrangian("reel", l**2 * th_dot**2 / 2, [th], inputs={l: 1.0}, parameters={"k": 1.0})
    model.description.sections["inputs"][0].values["signal"] = "1 + k*t**2"
    mod = model.compile(target="numpy")
    start, tight = {"th_dot": 1.0}, {"rtol": 1e-10, "atol": 1e-12}
    run = mod.simulate(1.0, start, parameters={"k": 3.0}, **tight)
    assert np.abs(run["l"] ** 2 * run["th_dot"] - 1.0).max() < 1e-9
    assert np.abs(run["l_dot"] - 6.0 * run.t).max() < 1e-12
    assert abs(mod.simulate(1.0, start, inputs={"l": "1 + t"}, **tight)["th_dot"][-1] - 0.25) < 1e-9
    assert mod.simulate(1.0, start, inputs={"l": 2.0})["th_dot"][-1] == 1.0
    many = mod.simulate_many(1.0, {"th_dot": [1.0, 2.0]}, **tight)
    assert np.abs(many["th_dot"] - [0.25, 0.5]).max() < 1e-9
    model.description.sections["inputs"][0].values["signal"] = "1 + th_dot"
    with pytest.raises(
        eg.ModelError, match="l_dot is needed, but the signal depends on 'th_dot', whose rate is not a velocity"
    ):
        model.mechanism()


def test_names_of_rates() -> None:
    assert [rate_of("u"), rate_of("u_dot"), rate_of("u", 3), rate_of("dot")] == [
        "u_dot",
        "u_ddot",
        "u_dddot",
        "dot_dot",
    ]
    assert [split_rate("u_ddot"), split_rate("u")] == [("u", 2), ("u", 0)]
    assert chains(["a", "b", "a_ddot", "b_dot", "c_dot"]) == {"a": ["a_ddot"], "b": ["b_dot"]}


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
        with pytest.raises(eg.ModelError, match=r"constraints.led: the constraint 'led' .* makes it jump"):
            m.check()
    else:
        assert m.check().degrees_of_freedom == 0
