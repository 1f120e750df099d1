"""A bare Lagrangian: functions of time or plain symbols, parameters found by themselves, the same graph either way."""

from __future__ import annotations

import pytest
import sympy
from sympy.physics.mechanics import dynamicsymbols

from eomgen import Model
from eomgen.describe import Mechanism
from eomgen.errors import ModelError
from eomgen.graph import evaluate

m, l, g, c, tau, t = sympy.symbols("m l g c tau t", positive=True)
VALUES = {"m": 1.3, "l": 0.7, "g": 9.8, "c": 0.2, "tau": 0.9, "q": 0.4, "q_dot": -1.1, "t": 0.3}


def energy(q, v):
    return m * l**2 * v**2 / 2 + m * g * l * sympy.cos(q) + m * v * sympy.sin(t)


def compare(a: Mechanism, b: Mechanism) -> None:
    for one, two in zip(_parts(a), _parts(b), strict=True):
        assert one == pytest.approx(two, rel=1e-14)


def _parts(mechanism: Mechanism) -> list[float]:
    lagrangian = mechanism.lagrangian
    assert lagrangian is not None
    return evaluate(
        [lagrangian.expression, lagrangian.dissipation, *lagrangian.forces, *lagrangian.constraints], VALUES
    )


def models() -> list[Model]:
    moving = dynamicsymbols("q")
    speed = moving.diff(dynamicsymbols._t)
    q, v = sympy.symbols("q q_dot")
    shared = {"parameters": {m: 1.3, "l": 0.7}}
    return [
        Model.from_lagrangian(
            "p", energy(moving, speed), [moving], {moving: tau}, c * speed**2, [moving - 1], **shared
        ),
        Model.from_lagrangian("p", energy(q, v), [q], [tau], c * v**2, sympy.Matrix([q - 1]), **shared),
        Model.from_lagrangian(
            "p",
            "m*l**2*q_dot**2/2 + m*g*l*cos(q) + m*q_dot*sin(t)",
            ["q"],
            {"q": "tau"},
            "c*q_dot**2",
            ["q - 1"],
            **shared,
        ),
    ]


@pytest.mark.parametrize("which", [0, 1, 2])
def test_three_ways_to_write_it(which: int) -> None:
    model = models()[which]
    mechanism = model.mechanism()
    assert mechanism.lagrangian is not None
    assert mechanism.lagrangian.coordinates == ("q",)
    assert {p.name: p.value for p in mechanism.parameters} == {"m": 1.3, "l": 0.7, "c": None, "g": None, "tau": None}
    assert not mechanism.bodies
    assert not mechanism.joints
    compare(mechanism, models()[0].mechanism())
    q, v = VALUES["q"], VALUES["q_dot"]
    numbers = {s: VALUES[s.name] for s in (m, l, g, t)}
    expected = [float(energy(q, v).subs(numbers)), VALUES["c"] * v**2, VALUES["tau"], q - 1]
    assert _parts(mechanism) == pytest.approx(expected)


def test_outputs_initial_and_inputs() -> None:
    q = dynamicsymbols("q")
    model = Model.from_lagrangian("p", energy(q, q.diff()), [q], forces=[tau], inputs={tau: 0.5})
    model.output("speed", l * q.diff())
    model.output("q", q)
    model.initial(q="pi/4", q_dot=l)
    mechanism = model.mechanism()
    assert [(u.name, u.value) for u in mechanism.inputs] == [("tau", 0.5)]
    assert mechanism.outputs[0].expression == mechanism.graph.symbol("l") * mechanism.graph.symbol("q_dot")
    assert mechanism.initial["q_dot"] == mechanism.graph.symbol("l")
    assert repr(model) == "<Model p: Lagrangian, 3 parameters, 1 input, 2 outputs>"


def test_faults() -> None:
    q, z = dynamicsymbols("q z")
    with pytest.raises(ModelError, match=r"lagrangian.coordinates\[1\]: q\(t\)\*\*2 is not a coordinate"):
        Model.from_lagrangian("p", q, [q, q**2])
    bad = Model.from_lagrangian(
        "p", q.diff() ** 2 + z + q.diff().diff(), [q], forces={z: 1}, constraints=[sympy.gamma(q)]
    )
    with pytest.raises(ModelError) as caught:
        bad.mechanism()
    told = {(p.path, p.message.split(" (")[0]) for p in caught.value.problems}
    assert ("lagrangian.expression", "unknown name 'z'") in told
    assert ("lagrangian.expression", "the acceleration 'q_ddot' cannot be used here") in told
    assert ("lagrangian.forces.z", "no coordinate 'z'") in told
    assert any(path == "lagrangian.constraints[0]" and "gamma" in message for path, message in told)


def test_a_clash_of_names() -> None:
    v = sympy.Symbol("q_dot")
    clash = Model.from_lagrangian("p", v**2, ["q"], inputs={"q_dot": 1})
    with pytest.raises(ModelError, match="'q_dot' is already used"):
        clash.mechanism()
    with pytest.raises(ModelError, match="there are no coordinates; name at least one"):
        Model.from_lagrangian("p", v**2, []).mechanism()


@pytest.mark.parametrize(
    "text", ["a_dot**4/4 - a**2/2", "-sqrt(1 - a_dot**2)", "exp(a_dot)", "a_dot**3", "sin(a_dot)*a"]
)
def test_a_lagrangian_that_is_not_quadratic_in_the_velocities_is_named(text: str) -> None:
    with pytest.raises(ModelError, match=r"lagrangian.expression: is not quadratic in the velocities.*a_dot; write T"):
        Model.from_lagrangian("powers", text, ["a"]).derive()


def test_what_is_quadratic_linear_or_constant_in_the_velocities_is_taken() -> None:
    text = "(1 + a**2)*a_dot**2/2 + a_dot*b_dot/3 + b_dot**2 + b*a_dot + sin(t)*b_dot - a**2 - b**4"
    M = Model.from_lagrangian("mixed", text, ["a", "b"]).compile(target="numpy").mass_matrix([2.0, 1.0])
    assert M.tolist() == [[5.0, pytest.approx(1 / 3)], [pytest.approx(1 / 3), 2.0]]
