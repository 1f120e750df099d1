"""Models that are correct though a figure of theirs is zero, nothing moves, or a check does not apply: no breach."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest

import eomgen as eg
from eomgen.cli import main
from eomgen.errors import UsageError
from eomgen.verification import Verification
from eomgen.verification.variants import variant_findings


def ball() -> eg.Model:
    model = eg.Model("ball", gravity=(0, -9.81, 0))
    model.prismatic("J", model.ground, model.body("b", mass=1), axis="y", coordinate="h")
    model.initial(h=1.0)
    model.event("floor", "h", restitution=0.9)
    return model


def rotor() -> eg.Model:
    """Without gravity the bias is 0, and only terms that cancel are behind it."""
    model = eg.Model("rotor")
    model.revolute("A", model.ground, model.body("a", mass=1, com=(0.2, 0.1, 0), inertia={"zz": 0.1}))
    return model


def stone() -> eg.Model:
    model = eg.Model("stone", gravity=(0, 0, -9.81))
    model.free("fly", model.ground, model.body("s", mass=1, inertia=(1, 2, 3)), rotation="euler_parameters")
    model.initial(fly_z=1, fly_e0="cos(pi/8)", fly_e1="sin(pi/8)", fly_wx=2, fly_wz=5)
    return model


def triangle() -> eg.Model:
    model = eg.Model("triangle", gravity=(0, -9.81, 0))
    a, b = (model.body(name, mass=1, inertia={"zz": 0.1}) for name in "ab")
    model.revolute("A", model.ground, a)
    model.revolute("B", a.at(0.2, 0, 0), b)
    model.revolute("C", b.at(0.2, 0, 0), model.ground.at(0.3, 0, 0))
    return model


def welded() -> eg.Model:
    model = eg.Model("welded")
    model.weld("w", model.ground, model.body("a", mass=1, inertia=(1, 1, 1)))
    return model


def verified(model: eg.Model) -> Verification:
    return model.compile(target="numpy").verify(states=4)


@pytest.mark.parametrize("make", [ball, rotor, stone, triangle, welded], ids=lambda make: make.__name__)
def test_correct_models_have_no_breach(make: Callable[[], eg.Model]) -> None:
    found = verified(make())
    assert found.ok, str(found)


def test_a_muscle_in_other_units_is_no_breach() -> None:
    """Its fastest shortening is 10 lengths in a second unless given, also where time is measured in ms."""
    model = eg.Model("arm", gravity=(0, -9.81, 0))
    arm = model.body("arm", mass=1, com=(0.15, 0, 0), inertia={"zz": 0.02})
    model.revolute("elbow", model.ground, arm)
    origin, insertion = model.ground.at(0, 0.3, 0), arm.at(0.05, 0, 0)
    model.muscle("biceps", origin, insertion, activation=0.3, force_max=500, fiber_length=0.1, slack_length=0.2)
    (found,) = variant_findings(model, only="units mm, t, ms")
    assert not found.left_out, found
    assert found.ok, found


def test_events_that_reset_leave_runs_out_with_the_reason() -> None:
    runs = [f for f in verified(ball()).findings if f.check.startswith(("runs", "steppers"))]
    assert runs
    assert all(f.left_out and "reset" in f.note for f in runs)


def test_a_bias_that_should_be_zero_and_is_not_is_found() -> None:
    equations = rotor().derive()
    equations.tree.bias = (equations.kinematics.graph.zero + 1e-12,)
    changed = dataclasses.replace(equations)  # compiling starts from what the record was made of
    found = {f.check for f in changed.compile(target="numpy").verify(states=2).breaches}
    assert {"bias: free bodies", "accelerations: free bodies"} <= found


def test_angular_momentum_turns_with_ground() -> None:
    model = rotor()
    model.output("L", "angular_momentum_z(ground)")
    for change in ("ground turned", "all at once"):
        (found,) = variant_findings(model, only=change)
        assert not found.left_out, found
        assert found.ok, found


@pytest.mark.parametrize(
    "text",
    ["momentum_x", "2*momentum_y - momentum_z*A", "inertia_xy(ground)", "inertia_yz(com)*momentum_x + inertia_xx(a)"],
)
def test_sums_over_all_bodies_turn_with_ground(text: str) -> None:
    model = rotor()
    model.output("p", text)
    for change in ("ground turned", "all at once"):
        (found,) = variant_findings(model, only=change)
        assert not found.left_out, found
        assert found.ok, found


def test_a_parameter_with_the_name_of_a_momentum_does_not_turn() -> None:
    model = rotor()
    model.parameter("momentum_x", 3.0)
    model.output("p", "momentum_x + A")
    (found,) = variant_findings(model, only="ground turned")
    assert not found.left_out, found
    assert found.ok, found


def test_values_in_other_units_are_no_breach() -> None:
    """A length in mm is declared as 200 and given at run time as 0.2."""
    model = eg.Model("rod", gravity=(0, -9.81, 0))
    l, F = model.parameter("l", 200, unit="mm"), model.input("F", 2, unit="kN")
    mass = model.parameter("m", 500, unit="g")
    rod = model.body("rod", mass=mass, com=(0, -l, 0), inertia={"zz": 0.01})
    model.revolute("A", model.ground, rod)
    model.force("pull", rod, (F, 0, 0))
    found = variant_findings(model)
    assert not [str(f) for f in found if not f.ok]
    (given,) = [f for f in found if f.check.endswith("parameters at run time")]
    assert not given.left_out


@pytest.mark.parametrize("states", [0, -1, 1.5, True])
def test_a_number_of_states_that_is_none_is_refused(states: object) -> None:
    with pytest.raises(UsageError, match="states"):
        rotor().compile(target="numpy").verify(states=states)  # type: ignore[arg-type]


def test_a_model_for_kinematics_only_lists_what_does_not_apply(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "massless.yaml"
    file.write_text("name: massless\nbodies: {a: {mass: 0}}\njoints: {A: {type: revolute, between: [ground, a]}}\n")
    with pytest.raises(SystemExit) as left:
        main(["verify", str(file), "--target", "numpy"])
    assert left.value.code == 0
    written = capsys.readouterr().out
    assert "kinematics only" in written
    assert "BREACH" not in written
