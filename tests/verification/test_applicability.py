"""verify of models with inputs that move, without masses, at singular places, and short of time."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg
from eomgen.cli import main
from eomgen.simulation.events import told_by_the_caller
from eomgen.verification import Finding, Verification
from eomgen.verification.comparison import Comparison
from eomgen.verification.variants import variant_findings


def lift(name: str, equation: str) -> eg.Model:
    """Two sliders on a line, tied by an equation with an input; a spring on the first."""
    model = eg.Model("lift")
    model.input(name, 0.3)
    model.prismatic("X", model.ground, model.body("b", mass=1.0), axis="x", coordinate="x")
    model.prismatic("S", model.ground, model.body("c", mass=1.0), axis="x", coordinate="s")
    model.actuator("F", "X", "-4*x")
    model.coupling("flow", equation=equation)
    model.initial(x=0.3, x_dot=1.0)
    return model


@pytest.mark.parametrize(
    ("name", "equation", "inputs"),
    [
        ("lift", "s - x*lift - x", ("lift", "lift_dot", "lift_ddot")),
        ("lift_dot", "s_dot - x*lift_dot - x_dot", ("lift_dot", "lift_ddot")),
    ],
)
def test_constraints_that_move_with_inputs(name: str, equation: str, inputs: tuple[str, ...]) -> None:
    module = lift(name, equation).compile(target="numpy")
    assert module.u_names == inputs
    found = module.verify(states=3, seconds=60.0)
    assert found.ok, str(found)
    compared = {f.check for f in found.findings if not f.left_out}
    assert {"rhs: constraints stay satisfied", "gamma: second differences of C along the motion"} <= compared
    assert {"power: rate of energy, forces and drivers", "variants: inputs"} <= compared


def test_a_rate_of_an_input_that_is_left_out_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same model with inputs that stand still: the constraints do not go on holding, by the checks as by an ODE."""
    module = lift("lift", "s - x*lift - x").compile(target="numpy")
    monkeypatch.setattr("eomgen.verification.identities.moving_inputs", lambda layout, u: np.zeros_like(u))
    assert {f.check for f in module.verify(states=2, seconds=0.0).breaches} == {"rhs: constraints stay satisfied"}

    def by_hand(t: float, z: np.ndarray) -> list[float]:  # x'' + a s'' = -4 x, s = a x, a = 1 + l
        a, a_dot, a_ddot = 1.3 + 0.1 * np.sin(3 * t), 0.3 * np.cos(3 * t), -0.9 * np.sin(3 * t)
        return [z[1], (-4 * z[0] - a * (2 * a_dot * z[1] + a_ddot * z[0])) / (1 + a * a)]

    run = module.simulate(2.0, inputs={"lift": "0.3 + 0.1*sin(3*t)"}, rtol=1e-11, atol=1e-13)
    exact = solve_ivp(by_hand, (0, 2), [0.3, 1.0], rtol=1e-12, atol=1e-13, method="DOP853").y[:, -1]
    np.testing.assert_allclose([run["x"][-1], run["x_dot"][-1]], exact, atol=1e-9)


def test_a_force_of_infinite_slope_at_the_start() -> None:
    model = eg.Model("orifice")
    model.prismatic("X", model.ground, model.body("a", mass=1.0), axis="x", coordinate="x")
    model.actuator("F", "X", "1 - abs(x)**0.5")
    model.initial(x=0.0)
    found = model.compile(target="numpy").verify(states=2)
    assert found.ok, str(found)
    assert any(f.check.startswith("variants: ") and not f.left_out for f in found.findings)


def test_a_model_without_masses_has_its_kinematics_compared() -> None:
    model = eg.Model("drawing")
    model.revolute("A", model.ground, model.body("a", mass=0.0), coordinate="th")
    model.prismatic("B", model.ground, model.body("b", mass=0.0), axis="x", coordinate="x")
    model.coupling("c", equation="sin(th) - 0.5*x")
    equations = model.derive()
    found = equations.compile(target="numpy").verify(states=3)
    compared = {f.check for f in found.findings if not f.left_out}
    assert found.ok, str(found)
    assert {"constraint_jacobian: differences of C", "constraint_jacobian: extrapolated differences"} <= compared
    kinematics, c = equations.kinematics, equations.kinematics.constraints
    wrong = tuple(tuple(1.001 * x for x in row) for row in c.jacobian)
    broken = replace(equations, kinematics=replace(kinematics, constraints=replace(c, jacobian=wrong)))
    breaches = {f.check for f in broken.compile(target="numpy").verify(states=3).breaches}
    assert {"constraint_jacobian: differences of C", "constraint_jacobian: extrapolated differences"} <= breaches


def test_a_module_of_equations_says_that_its_model_is_not_known() -> None:
    found = lift("lift", "s - x*lift - x").derive().compile(target="numpy").verify(states=1)
    (variants,) = (f for f in found.findings if f.check.startswith("variants"))
    assert variants.left_out
    assert "Model.compile" in variants.note


def test_a_model_that_changes_later_is_compared_as_it_was_compiled() -> None:
    model = lift("lift", "s - x*lift - x")
    module = model.compile(target="numpy")
    model.actuator("G", "S", "100.0")
    found = module.verify(states=1)
    assert found.ok, str(found)
    assert module.bind(u={"lift": 0.2}).description is module.description


def test_checks_that_are_not_reached_are_counted(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "lift.yaml"
    lift("lift", "s - x*lift - x").save(file)
    monkey = pytest.MonkeyPatch()
    with monkey.context() as patch:
        patch.setattr("eomgen.verification.verify.LEAST", 0.0)
        assert run("verify", file, "--target", "numpy", "--states", 1, "--seconds", 0, "--json") == 0
        result = json.loads(capfd.readouterr().out)
        assert result["not_reached"] == sum(f["check"].startswith("variants") for f in result["findings"]) > 20
        assert run("verify", file, "--target", "numpy", "--states", 1, "--seconds", 0) == 0
        assert f"{result['not_reached']} of them for lack of time" in capfd.readouterr().out


def run(*words: object) -> int:
    with pytest.raises(SystemExit) as leaving:
        main([str(word) for word in words])
    return int(leaving.value.code or 0)


def test_nothing_compared_is_not_ok() -> None:
    assert not Verification("nothing", (Finding.skipped("a", "why"),)).ok
    assert Verification("one", (Finding.skipped("a", "why"), Finding("b", 0.0, 1.0))).ok


def test_a_check_without_a_finite_limit_is_left_out() -> None:
    without = Comparison("singular")
    without.add(0, [1.0, 0.0], np.inf)
    assert without.finding().left_out
    assert "no finite limit" in without.finding().note
    without.add(1, [1e-3], 1e-6)
    assert not without.finding().ok
    nothing = Comparison("no number")
    nothing.add(0, [np.nan], np.inf)
    assert not nothing.finding().ok


@pytest.mark.parametrize("law", [{"normal_law": "rigid"}, {"stiffness": 1e4}])
@pytest.mark.parametrize("simulation", [None, {"method": "moreau", "step": 1e-3}])
def test_contacts_that_runs_take_as_rigid(law: dict[str, Any], simulation: dict[str, Any] | None) -> None:
    """No integrator runs rigid contacts; those with a law of force are run by one, whatever the model says."""
    m = eg.Model("dropped", gravity=(0, -9.81, 0))
    body = m.body("b", mass=1.0, inertia={"zz": 0.1})
    m.planar("j", m.ground, body)
    m.input("F", 0.5)
    m.force("push", body, ("F", 0, 0))
    m.contacts("c", {"shape": "circle", "on": body, "radius": 0.1}, {"shape": "half_plane", "on": m.ground}, law)
    m.initial(j_y=0.3)
    if simulation:
        m.simulation = simulation
    with told_by_the_caller():  # some states are inside the ground
        found = {f.check: f for name in ("inputs", "short runs") for f in variant_findings(m, only=name)}
    assert all(f.ok for f in found.values()), found
    runs = found["variants: short runs"]
    assert runs.left_out == ("normal_law" in law)
    assert not runs.left_out or "rigid contacts exert impulses" in runs.note
    assert not found["variants: inputs"].left_out
