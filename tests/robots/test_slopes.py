"""Jacobians of fixed robots against Pinocchio's derivatives of its articulated-body algorithm, and what they take.

J. Carpentier, N. Mansard, Analytical derivatives of rigid body dynamics algorithms, RSS 2018: computeABADerivatives.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from robots.pinocchio_judge import Judge
from robots.shipped import urdf_robots

import eomgen as eg
from benchmarks.models import numeric_arm, symbolic_arm
from eomgen import pipeline
from eomgen.program import build_program
from eomgen.program.collect import collect_terms

CASES = [("panda", "embedding"), ("ur5", "embedding"), ("talos", "embedding"), ("talos", "recursive")]


def derivatives(judge: Judge, module: Any, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Pinocchio's dv'/dx, its friction added, in our order."""
    names, velocities, n = module.q_names, module.v_names, module.n_v
    order = [judge.velocities[name] for name in velocities]
    q, v, tau = judge.position(names, x[:n]), np.zeros(judge.pin.nv), np.zeros(judge.pin.nv)
    v[order] = x[n:]
    driven = dict(zip(module.u_names, u, strict=True))
    tau[order] = [driven.get(f"tau_{name.removesuffix('_dot')}", 0.0) for name in velocities]
    damping = np.asarray(judge.pin.damping)
    dq, dv, inverse = (
        part.copy() for part in pin.computeABADerivatives(judge.pin, judge.data, q, v, tau - damping * v)
    )
    inverse = np.triu(inverse) + np.triu(inverse, 1).T
    place = np.ix_(order, order)
    return np.hstack([dq[place], (dv - inverse * damping)[place]])


@pytest.mark.slow
@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize(("name", "method"), CASES)
def test_jacobians_are_those_of_pinocchio(name: str, method: str, target: str) -> None:
    path = urdf_robots()[name][0]
    model = eg.load(path, floating=False, actuate=True, mimic="independent")
    options = {"optimize": 0} if target == "cython" else {}
    module = model.derive(method).compile(target=target, kernels=["rhs", "jacobian"], **options)
    judge, n = Judge(path, False, model), module.n_v
    random = np.random.default_rng(5)
    for _ in range(5):
        x = random.uniform(-1, 1, module.n_x) * np.repeat([1.0, 3.0], n)
        u = random.uniform(-10, 10, module.n_u)
        found, expected = module.jacobian(0.0, x, u=u), derivatives(judge, module, x, u)
        assert np.array_equal(found[:n], np.eye(2 * n)[n:])
        size = np.abs(expected).max(axis=1, keepdims=True)
        assert (np.abs(found[n:] - expected) <= 1e-10 * size).all()


#: Arm -> operations of its Jacobian over those of its right-hand side, and those of the Jacobian today.
TITLES = {"panda": "Panda", "ur5": "UR5"}
ARMS = {"panda": (4.0, 4362), "iiwa": (4.0, 4134), "ur5": (4.5, 2169)}


@pytest.mark.parametrize("name", ARMS)
def test_a_jacobian_takes_at_most_four_right_hand_sides(name: str) -> None:
    """Panda and UR5 with numbers for parameters; the iiwa with symbols, whose own operations are counted apart."""
    equations = (symbolic_arm(name) if name == "iiwa" else numeric_arm(name)).derive("embedding")
    terms = collect_terms(equations.kinematics, equations.mobility, equations.tree)
    counts = build_program(terms, {"name": name}, kernels=["rhs", "jacobian"]).counts
    most, known = ARMS[name]
    assert counts["jacobian"].total <= most * counts["rhs"].total
    assert counts["jacobian"].total == known
    if name != "iiwa":
        page = (Path(__file__).parents[2] / "docs" / "operations.md").read_text(encoding="utf-8")
        assert f"| Jacobian of the {TITLES[name]} | {known:,} |" in page


def test_a_jacobian_of_a_humanoid_takes_few_operations() -> None:
    """Of 32 joints: its own terms, the mass matrix and the bias, beside a factor and 64 solutions in loops."""
    model = eg.load(urdf_robots()["talos"][0], floating=False, actuate=True)
    counts = pipeline.build(model.derive("recursive"), "c", ["rhs", "jacobian"]).counts
    assert counts["residual_jacobian"].total <= 16_000
    assert counts["mass_matrix"].total + counts["bias"].total <= 5_700
