"""Derivatives of M a + h by recursion over composite bodies against those of its formula, joint by joint."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.equations.tree_slopes import ForceSlopes, can_differentiate
from eomgen.graph import evaluate
from eomgen.graph.differentiate import jacobian

EXAMPLES = Path(__file__).parents[2] / "examples"
JOINTS: dict[str, tuple[str, dict[str, Any]]] = {
    "revolute": ("revolute", {"axis": (0.6, 0, 0.8)}),
    "prismatic": ("prismatic", {"axis": "y"}),
    "cylindrical": ("cylindrical", {}),
    "planar": ("planar", {}),
    "universal": ("universal", {}),
    "spherical, angles": ("spherical", {"sequence": "zyx"}),
    "spherical, parameters": ("spherical", {"rotation": "euler_parameters"}),
    "free, angles": ("free", {}),
    "free, parameters": ("free", {"rotation": "euler_parameters"}),
}


def body(m: eg.Model, name: str, k: int) -> Any:
    inertia = {"xx": 0.3, "yy": 0.2 + 0.01 * k, "zz": 0.25, "xy": 0.02, "xz": -0.03, "yz": 0.01}
    return m.body(name, mass=1.0 + 0.3 * k, com=(0.3, -0.1 * k, 0.2), inertia=inertia)


def largest_difference(model: Any) -> float:
    """Of derivatives, bias and mass matrix, relative to the largest entry."""
    equations = model.derive("embedding")
    kinematics, tree = equations.kinematics, equations.tree
    assert can_differentiate(kinematics)
    slopes, symbols = ForceSlopes(kinematics), [*kinematics.q, *kinematics.v]
    n_q, n, zero = len(kinematics.q), len(kinematics.v), kinematics.graph.zero
    random = np.random.default_rng(n)
    values = {p.name: p.value for p in kinematics.mechanism.parameters} | dict.fromkeys(kinematics.input_names, 0.3)
    values |= {s.node[1]: float(random.uniform(-1, 1)) for s in (*symbols, *kinematics.a)} | {"t": 0.2}
    formula = jacobian(list(tree.inverse_dynamics), symbols)
    found = slopes.by_position(kinematics.a)
    found |= {(i, n_q + k): value for (i, k), value in slopes.by_velocity.items()}
    pairs = [[entries.get((i, k), zero) for i in range(n) for k in range(n_q + n)] for entries in (found, formula)]
    pairs += [slopes.bias, tree.bias]
    pairs += [[x for row in rows for x in row] for rows in (slopes.mass_matrix, tree.mass_matrix)]
    numbers = [np.array(evaluate(part, values), dtype=float) for part in pairs]
    both = zip(numbers[::2], numbers[1::2], strict=True)
    return float(np.max([np.abs(a - b).max() / np.abs(b).max() for a, b in both]))


@pytest.mark.parametrize("name", JOINTS)
def test_every_joint_between_two_hinges(name: str) -> None:
    """With forces: a spring and a damper between bodies, friction, an input, the inertia of a drive."""
    kind, options = JOINTS[name]
    m = eg.Model("between", gravity=(0.5, -9.81, 1.0))
    first, second, third = (body(m, letter, k) for k, letter in enumerate("abc"))
    m.revolute("A", m.ground, first, axis="y", coordinate="alpha", armature=0.3)
    getattr(m, kind)("B", first.at(0.2, 0.3, 0.1), second, **options)
    m.revolute("C", second.at(0.1, 0, -0.2), third, axis="x", coordinate="gamma")
    m.spring("k", m.ground.at(1, 1, 0), third.at(0.1, 0.2, 0), stiffness=30, length=0.1)
    m.damper("c", first.at(0, 0, 0.4), third.at(0.1, 0.2, 0), damping=3)
    m.torque("motor", "C", m.input("tau") * 2)
    m.torque("friction", "A", "-0.2*alpha_dot*abs(alpha_dot) + sin(alpha)*t")
    assert largest_difference(m) < 1e-12


@pytest.mark.parametrize("name", ["bicycle", "stewart_platform", "flyball_governor", "excavator"])
def test_examples(name: str) -> None:
    assert largest_difference(eg.load(EXAMPLES / f"{name}.yaml")) < 1e-12


def test_branches_that_share_nothing_do_not_couple() -> None:
    m = eg.Model("branched", gravity=(0, 0, -9.81))
    trunk = body(m, "trunk", 0)
    m.free("base", m.ground, trunk, rotation="euler_parameters")
    for k in (1, 2):
        arm = body(m, f"arm{k}", k)
        m.revolute(f"shoulder{k}", trunk.at(0, 0.2 * k, 0), arm, axis="x")
        m.revolute(f"elbow{k}", arm.at(0, 0, 0.3), body(m, f"hand{k}", k), axis="y")
    assert largest_difference(m) < 1e-12
    kinematics = m.derive("embedding").kinematics
    one, other = (
        [kinematics.velocity_names.index(f"{joint}{k}_dot") for joint in ("shoulder", "elbow")] for k in (1, 2)
    )
    slopes = ForceSlopes(kinematics)
    assert not any((i, j) in slopes.by_velocity for i in one for j in other)


def test_guides_and_angles_passed_backwards_are_left_to_the_formula() -> None:
    """Their directions change along their own coordinates."""
    m = eg.Model("bead", gravity=(0, 0, -9.81))
    m.curve_slider("wire", m.ground, body(m, "bead", 0), curve=["s", "s**2", 0], coordinate="s")
    assert not can_differentiate(m.derive("embedding").kinematics)
    assert not can_differentiate(eg.load(EXAMPLES / "delta_robot.yaml").derive("embedding").kinematics)
