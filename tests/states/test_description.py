"""First-order states as they are described: names, units, model files, components, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import sympy

import eomgen as eg
from eomgen.errors import ModelError


def sledge() -> eg.Model:
    m = eg.Model("sledge")
    m.parameter("tau", 0.1)
    body = m.body("body", mass=2.0)
    m.prismatic("s", m.ground, body)
    return m


FAULTS: dict[str, tuple[Callable[[eg.Model], object], str, str]] = {
    "no equation": (lambda m: m.state("a"), "states.a.rate", "is missing"),
    "name of a parameter": (lambda m: m.state("tau", "1"), "states.tau", "already used by the parameter"),
    "name of a coordinate": (lambda m: m.state("s", "1"), "states.s", "already used by the coordinate"),
    "given twice": (lambda m: (m.state("a", 1), m.state("a", 2)), "states.a", "already used by the state"),
    "its rate is a name": (lambda m: (m.input("a_dot"), m.state("a", 1)), "states.a", "'a_dot' is the rate of 'a'"),
    "named like a rate": (lambda m: m.state("w_dot", 1), "states.w_dot", "does not end in _dot"),
    "no number": (lambda m: m.state("a", 1, initial=float("nan")), "states.a.initial", "nan is not a number"),
    "infinite": (lambda m: m.state("a", 1, initial=float("inf")), "states.a.initial", "inf is not a number"),
    "unknown name": (lambda m: m.state("a", "s/tua"), "states.a.rate", "did you mean 'tau'?"),
    "acceleration": (
        lambda m: m.state("a", "s_ddot"),
        "states.a.rate",
        "the acceleration 's_ddot' cannot be used here",
    ),
    "of a marker": (lambda m: m.state("a", "ax(body)"), "states.a.rate", "the acceleration of a marker"),
    "its own rate": (lambda m: m.state("a", "-a_dot"), "states.a.rate", "the rate of a state 'a_dot'"),
    "initial of s": (lambda m: m.state("a", 1, initial="s"), "states.a.initial", "the coordinate 's' cannot be used"),
    "unknown unit": (lambda m: m.state("a", 1, unit="foo"), "states.a.unit", "no unit 'foo'"),
    "in a driver": (lambda m: (m.state("a", 1), m.driver("d", "s", "a")), "constraints.d.value", "the state 'a'"),
    "in a mass": (lambda m: (m.state("a", 1), m.body("c", mass="a")), "bodies.c.mass", "the state 'a' cannot be used"),
    "in a signal": (lambda m: (m.state("a", 1), m.input("u", signal="a")), "inputs.u.signal", "the state 'a'"),
    "reset of a stranger": (
        lambda m: (m.state("act", 1), m.event("e", "s", reset={"atc": 0})),
        "events.e.reset.atc",
        "did you mean 'act'?",
    ),
    "initial of a stranger": (lambda m: (m.state("act", 1), m.initial(atc=0)), "initial.atc", "did you mean 'act'?"),
    "rate in an event": (lambda m: (m.state("a", 1), m.event("e", "a_dot")), "events.e.expression", "rate of a state"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_faults_are_told_by_their_place(case: str) -> None:
    make, path, message = FAULTS[case]
    m = sledge()
    make(m)
    with pytest.raises(ModelError) as error:
        m.mechanism()
    told = {p.path: f"{p.message}; {p.remedy}" for p in error.value.problems}
    assert message in told[path]


def test_dimensions_of_a_rate_are_checked() -> None:
    m = sledge()
    m.parameter("k", 3.0, unit="N/m")
    m.state("p", "(k*s - p)/tau", unit="N")
    m.mechanism()
    m.state("w", "(s - w)/tau", unit="N")
    with pytest.raises(ModelError, match=r"states.w.rate: .*a length \(m\)"):
        m.mechanism()


def test_a_lagrangian_has_no_states_beside_it() -> None:
    q, v = sympy.symbols("q q_dot")
    m = eg.Model.from_lagrangian("bare", v**2 / 2 - q**2 / 2, [q])
    m.state("a", "q - a")
    with pytest.raises(ModelError, match="states: a bare Lagrangian, or equations, have no states"):
        m.mechanism()


def test_laws_in_a_circle_are_refused_through_a_state_too() -> None:
    m = sledge()
    m.actuator("f1", "s", value="force(f2)")
    m.actuator("f2", "s", value="force(f1)")
    m.state("a", "force(f1)")
    with pytest.raises(ModelError, match="algebraic loop between laws"):
        m.derive()


TEXT = """
name: sledge
parameters: {tau: 0.1}
bodies: {body: {mass: 2, markers: {tip: [0.1, 0, 0]}}}
joints: {s: {type: prismatic, between: [ground, body], axis: x}}
forces: {push: {type: actuator, joint: s, value: -5*a - b}}
states:
  a: (vx(body.tip) - a)/tau
  b: {rate: (force(push) - b)/tau, initial: 3, unit: kN, doc: pull, latex: b_p}
outputs: {total: a + b}
initial: {a: 0.25}
"""


def test_text_and_python_make_the_same_model(tmp_path: Path) -> None:
    file = tmp_path / "sledge.yaml"
    file.write_text(TEXT)
    read = eg.load(file)
    m = eg.Model("sledge")
    tau = m.parameter("tau", 0.1)
    body = m.body("body", mass=2)
    tip = body.marker("tip", at=(0.1, 0, 0))
    m.prismatic("s", m.ground, body, axis="x")
    a, b = m.coordinate("a"), m.coordinate("b")
    push = m.actuator("push", "s", value=-5 * a - b)
    assert m.state("a", (tip.velocity[0] - a) / tau, initial=0.25) == a
    m.state("b", (push.force - b) / tau, initial=3, unit="kN", doc="pull", latex="b_p")
    m.output("total", a + b)
    again = tmp_path / "again.yaml"
    read.save(again)
    modules = [one.compile(target="numpy") for one in (read, m, eg.load(again))]
    x = np.array([0.1, 0.4, 0.3, 2.0])
    for mod in modules:
        assert mod.x_names == ("s", "s_dot", "a", "b")
        assert (mod.q_names, mod.v_names, mod.s_names) == (("s",), ("s_dot",), ("a", "b"))
        assert (mod.n_q, mod.n_v, mod.n_s, mod.n_x, mod.n_dof) == (1, 1, 2, 4, 1)
        np.testing.assert_array_equal(mod.x0(), [0.0, 0.0, 0.25, 3000.0])
        np.testing.assert_allclose(mod.rhs(0.0, x), [0.4, (-1.5 - 2.0) / 2.0, 1.0, (-3.5 - 2.0) / 0.1], rtol=1e-14)
        assert mod.outputs(0.0, x) == pytest.approx([2.3])
    assert modules[0].layout.unit("b") == "N"


def test_initial_values_may_be_expressions_of_parameters_and_are_set_by_name() -> None:
    m = sledge()
    m.state("a", "s - a", initial="2*tau")
    mod = m.compile(target="numpy")
    assert mod.x0()[-1] == 0.2
    assert mod.x0(a=0.7, s=0.3).tolist() == [0.3, 0.0, 0.7]
    with pytest.raises(eg.EomgenError, match="did you mean a"):
        mod.x0(aa=1.0)
    with pytest.raises(eg.EomgenError, match="a must be finite"):
        mod.x0(a=float("nan"))


def test_components_bring_their_states() -> None:
    leg = eg.Model("leg")
    leg.parameter("tau", 0.2)
    leg.prismatic("x", leg.ground, leg.body("foot", mass=1.0))
    leg.state("act", "(1 - act)/tau + rate(other)", initial=0.1)
    leg.actuator("muscle", "x", value="3*act - force(other)")
    leg.actuator("other", "x", value="4*x")
    m = eg.Model("walker")
    m.add(leg, prefix="l_")
    m.add(leg, prefix="r_", tau=0.5)
    mod = m.compile(target="numpy")
    assert mod.x_names == ("l_x", "r_x", "l_x_dot", "r_x_dot", "l_act", "r_act")
    np.testing.assert_allclose(mod.rhs(0.0, mod.x0())[2:], [0.3, 0.3, 0.9 / 0.2, 0.9 / 0.5])
