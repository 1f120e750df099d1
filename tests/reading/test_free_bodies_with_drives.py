"""Free bodies of mechanisms whose drives have inertia: reactions balance the accelerations of the compiled module."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from shown_numbers import random_state, state_values
from sweeps import part_of

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


def crank(cut: str) -> eg.Model:
    """A slider-crank with a drive of inertia J at a joint of the tree (A) or at the one that closes the loop (C)."""
    m = eg.Model("crank", gravity=(0, "-g", 0))
    for name, value in {"g": 9.81, "r": 0.1, "l": 0.35, "J": 0.02}.items():
        m.parameter(name, value)
    a, b = m.body("a", mass=1, com=("r/2", 0, 0), inertia={"zz": 0.01}), m.body("b", mass=0.8, com=("l/2", 0, 0))
    s = m.body("s", mass=0.5)
    drive: Any = {"armature": "J"}
    m.revolute("A", m.ground, a, coordinate="theta", **(drive if cut == "A" else {}))
    m.revolute("B", a.at("r", 0, 0), b, coordinate="beta")
    m.revolute("C", b.at("l", 0, 0), s, **(drive if cut == "C" else {}))
    m.prismatic("D", m.ground, s, axis="x", coordinate="x")
    m.torque("motor", "A", 0.7)
    m.initial = {"theta": 0.6}
    m.guess = {"beta": -0.8, "x": 0.4}
    return m


def residual(equations: Any, shown: Any = None) -> float:
    """What is left of all equations of free bodies and joints with the best reactions, beside their largest term."""
    module, shown = equations.compile("numpy"), equations if shown is None else shown
    x = random_state(module, 4)
    values = {sp.Symbol(name): value for name, value in state_values(module, x, 0.0).items()}
    rows = []
    for name in module.body_names:
        balance = shown.free_bodies[name]
        rows += [*balance.force, *balance.moment]
    for joint in shown.joint_forces:
        rows += shown.joint_forces[joint]
    left = [row.lhs - row.rhs for row in rows if isinstance(row, sp.Equality)]
    numbers = [expression.subs(values) for expression in left]
    unknown = sorted({s for expression in numbers for s in expression.free_symbols}, key=str)
    matrix, right = sp.linear_eq_to_matrix(numbers, unknown)
    A, b = np.array(matrix, dtype=float), np.array(right, dtype=float)[:, 0]
    best = np.linalg.lstsq(A, b, rcond=None)[0]
    return float(np.abs(A @ best - b).max() / np.abs(b).max())


@pytest.mark.parametrize("method", ["newton_euler", "amalgamated"])
@pytest.mark.parametrize("cut", ["A", "C"])
def test_reactions_balance_a_drive_with_inertia(cut: str, method: str) -> None:
    model = crank(cut)
    assert residual(model.derive(method)) < 1e-10


def test_without_the_inertia_of_the_drive_they_do_not() -> None:
    """The accelerations of the module are those with J, so that free bodies of J = 0 are out of balance."""
    equations = crank("A").derive("newton_euler")
    assert residual(equations, equations.subs({"J": 0})) > 1e-4


@pytest.mark.parametrize("method", part_of(("newton_euler", "amalgamated"), lambda method: method == "newton_euler"))
def test_the_arm_with_geared_motors_is_explained(method: str) -> None:
    assert eg.load(EXAMPLES / "puma560.yaml").derive(method).explain().difference < 1e-10
