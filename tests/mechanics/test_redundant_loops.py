"""Planar loops made of spatial joints: redundant rows are named and harmless; assembly says what it cannot do."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from refusals import refuses
from scipy.integrate import solve_ivp
from sweeps import TARGETS

import eomgen as eg

FOUR_BAR = (models.EXAMPLES / "four_bar.yaml").read_text(encoding="utf-8")
TILTED = ["tilted_four_bar", "skewed_four_bar"]


def test_redundant_rows_are_reported_by_name(equations: Callable[..., Any], module: Callable[..., Any]) -> None:
    report = equations("three_cranks").report
    assert f"redundant: {', '.join(report.redundant)}" in str(report)
    mod = module("three_cranks")
    assert [mod.metadata["constraint_labels"][k] for k in mod.metadata["redundant_rows"]] == report.redundant
    q = mod.assemble(theta1=1.0)
    assert mod.constraints(q).shape == (3,)
    assert mod.constraint_jacobian(q).shape == (3, 4)
    assert mod.constraints(q, rows="all").shape == (4,)
    assert np.linalg.matrix_rank(mod.constraint_jacobian(q, rows="all"), tol=1e-9) == 3


@pytest.mark.parametrize("method", ["embedding", pytest.param("lagrange", marks=pytest.mark.thorough)])
def test_a_third_crank_of_a_parallelogram_changes_nothing(
    equations: Callable[..., Any], module: Callable[..., Any], method: str
) -> None:
    """Closed form: bars stay parallel, (3 m r^2/3 + M r^2) th'' = -(3 m/2 + M) r g cos th."""
    report = equations("three_cranks", method).report
    assert (report.constraints, report.rank, report.degrees_of_freedom) == (4, 3, 1)
    assert report.gruebler_kutzbach_planar == 0
    assert len(report.redundant) == 1
    mod = module("three_cranks", method, "cython")
    g, r, m, M = 9.81, 0.2, 0.7, 1.3
    slope = (1.5 * m + M) * g / ((m + M) * r)
    cranks = [mod.q_names.index(f"theta{k}") for k in (1, 2, 3)]
    for theta, rate in ((-0.5, 0.0), (-1.2, 3.0), (-2.4, -4.0)):
        x = mod.x0(theta1=theta, theta1_dot=rate)
        assert np.abs(x[cranks] - theta).max() <= 1e-12
        a = mod.rhs(0.0, x)[mod.n_q :]
        assert np.abs(a[cranks] + slope * np.cos(theta)).max() <= 1e-11 * slope
    run = mod.simulate((0, 5), rtol=1e-12, atol=1e-14)
    closed = solve_ivp(
        lambda t, y: [y[1], -slope * np.cos(y[0])],
        (0, 5),
        [-0.5, 0.0],
        method="DOP853",
        t_eval=run.t,
        rtol=1e-13,
        atol=1e-14,
    )
    for k in (1, 2, 3):
        assert np.abs(run[f"theta{k}"] - closed.y[0]).max() <= 1e-9
        assert np.abs(run[f"theta{k}_dot"] - closed.y[1]).max() <= 1e-9 * np.abs(closed.y[1]).max()
    assert np.abs(mod.constraints(run.x[: mod.n_q], rows="all")).max() < 1e-11


def test_a_loop_that_cannot_close_is_an_error_at_its_joint(tmp_path: Path) -> None:
    file = tmp_path / "wide.yaml"
    file.write_text(FOUR_BAR.replace("a4: {value: 0.10", "a4: {value: 0.50"), encoding="utf-8")
    line = next(k for k, text in enumerate(FOUR_BAR.splitlines(), start=1) if text.startswith("  C: "))
    refuses(f"EG-LOOP-OPEN {file}:{line}: joints.C:", lambda: eg.load(file).derive())


def test_inconsistent_initial_values_are_an_error(tmp_path: Path, module: Callable[..., Any]) -> None:
    file = tmp_path / "given.yaml"
    file.write_text(FOUR_BAR.replace("initial: {theta: pi/3,", "initial: {theta: pi/3, psi: 2.0,"), encoding="utf-8")
    line = next(k for k, text in enumerate(FOUR_BAR.splitlines(), start=1) if text.startswith("initial: "))
    refuses(f"EG-LOOP-OPEN {file}:{line}: initial: psi", lambda: eg.load(file).derive())
    mod = module("four_bar")
    refuses("EG-LOOP-OPEN theta psi 2.5", mod.x0, theta=1.0, psi=2.5)
    refuses("EG-CONTRADICTION theta_dot psi_dot", mod.x0, theta=1.0, theta_dot=10.0, psi_dot=0.0)
    refuses("EG-LOOP-OPEN theta psi 2.5", mod.simulate, (0, 1), {"theta": 1.0, "psi": 2.5})


def test_consistent_values_of_a_message_are_taken_when_they_are_given_back(module: Callable[..., Any]) -> None:
    mod = module("four_bar")
    with pytest.raises(eg.AssemblyError) as caught:
        mod.x0(theta=1.0, psi=2.5)
    advice = dict(pair.split(" = ") for pair in str(caught.value).rpartition("such as ")[2].split(", "))
    state = dict(zip(mod.x_names, mod.x0({name: float(value) for name, value in advice.items()}), strict=True))
    assert {name: f"{state[name]:.12g}" for name in ("theta", "psi")} == advice


def test_given_values_are_held_exactly_and_consistent_ones_may_be_redundant(module: Callable[..., Any]) -> None:
    mod = module("four_bar")
    x = mod.x0(psi=1.2, theta_dot=4.0)
    state = dict(zip(mod.x_names, x, strict=True))
    assert state["psi"] == 1.2
    assert state["theta_dot"] == 4.0
    everything = {name: state[name] for name in mod.q_names}
    assert np.abs(mod.x0(**everything, theta_dot=4.0) - x).max() <= 1e-12


def test_assembly_from_a_rough_guess(module: Callable[..., Any]) -> None:
    for name in TILTED:
        mod = module(name)
        q = mod.assemble(theta=1.0, bend=-0.2, psi=1.6)
        assert np.abs(mod.constraints(q, rows="all")).max() <= 1e-13
        assert q[mod.q_names.index("theta")] == 1.0
    mod = module("four_bar")
    other = mod.assemble(theta=1.0, bend=-2.0, psi=-2.0)  # the crossed branch, told by the guess
    assert np.abs(mod.constraints(other)).max() <= 1e-13
    assert other[mod.q_names.index("psi")] < 0
    assert mod.branch(other) == -mod.branch(mod.assemble(theta=1.0))


def spinner(**guess: float) -> eg.Model:
    """A body on a ball joint that a revolute joint about ground's z axis closes."""
    m = eg.Model("spinner")
    body = m.body("body", mass=1.0, com=(0.1, 0, 0), inertia=(0.1, 0.2, 0.3))
    m.spherical("ball", m.ground, body, coordinates=["a", "b", "c"])
    m.revolute("pin", m.ground, body)
    m.initial(c=0.2)
    m.guess(**guess)
    return m


def upright(mod: Any, q: np.ndarray) -> float:
    return float(mod.poses(q)[0][2, 2])


@pytest.mark.parametrize("guess", [{"a": 3.0}, {"a": 3.1, "b": 0.2}, {"b": 2.9}, {"a": 2.2, "b": 0.5}])
def test_flipped_solutions_are_rejected_when_a_model_is_assembled(guess: dict[str, float]) -> None:
    mod = spinner(**guess).compile(target="numpy")
    assert mod.n_dof == 1
    assert upright(mod, mod.x0()[: mod.n_q]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("target", TARGETS)
def test_flipped_solutions_are_rejected_by_the_module(target: str) -> None:
    mod = spinner().compile(target=target)
    for guess in ({"a": 3.0}, {"a": 3.1, "b": 0.2}, {"b": 2.9}):
        assert upright(mod, mod.assemble(guess)) == pytest.approx(1.0, abs=1e-12)
    # half a turn about x, held exactly, leaves half a turn about y, which stands upright; without it only the flipped
    assert upright(mod, mod.x0(a=np.pi)[: mod.n_q]) == pytest.approx(1.0, abs=1e-12)
    refuses("EG-LOOP-OPEN flipped", mod.x0, a=np.pi, b=0.0)
    assert all(upright(mod, q) > 0 for q in mod.branches())
