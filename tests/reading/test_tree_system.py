"""The parts of large equations of loops: with the constraints they give the accelerations of the compiled module."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shown_numbers import evaluate, random_state, state_values

import eomgen as eg
from eomgen.reading.printed_equations import PrintedEquations
from eomgen.reading.printed_parts import PrintedGroup, PrintedParts
from eomgen.reading.tree_system import TreeSystem

EXAMPLES = Path(__file__).parents[2] / "examples"
LONG = ["bicycle", "delta_robot", "double_wishbone", "excavator", "andrews_squeezer", "watt_six_bar"]


def numbers(named: Any, system: TreeSystem, values: dict[str, float]) -> list[np.ndarray]:
    """M_t, f_t, C and gamma at a state."""
    flat = [x for matrix in system[:4] for x in matrix]
    found = iter(evaluate(named, flat, values))
    return [np.array([next(found) for _ in matrix]).reshape(matrix.shape) for matrix in system[:4]]


@pytest.mark.parametrize("name", LONG)
def test_parts_give_the_accelerations_of_the_module(name: str) -> None:
    equations = eg.load(EXAMPLES / f"{name}.yaml").derive()
    module: Any = equations.compile("numpy")
    state = random_state(module, 5)
    named, system = equations.written("tree_system")
    mass, force, jacobian, gamma = numbers(named, system, state_values(module, state, 0.0))
    n_v, n_c = len(mass), len(jacobian)
    whole = np.block([[mass, -jacobian.T], [jacobian, np.zeros((n_c, n_c))]])
    solved = np.linalg.lstsq(whole, np.concatenate([force[:, 0], -gamma[:, 0]]), rcond=1e-12)[0][:n_v]
    expected = module.rhs(0.0, state)[module.n_q :]
    if system.zeros:  # where 0 stands for the heading, the others are those of a turned ground
        free = module.metadata["independent"]
        solved, expected = solved[free], expected[free]
    np.testing.assert_allclose(solved, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("name", LONG)
def test_groups_can_be_read_in_their_order(name: str) -> None:
    equations = eg.load(EXAMPLES / f"{name}.yaml").derive()
    printed = PrintedEquations(equations)
    assert printed.of_loops
    groups = [item for item in PrintedParts(printed).items() if isinstance(item, PrintedGroup)]
    told = [str(line.left.name) for group in groups for line in group.lines if hasattr(line.left, "name")]
    assert sorted(told) == sorted(str(symbol) for symbol, _ in printed.named)
    place = {name: k for k, name in enumerate(told)}
    for symbol, x in printed.named:
        assert all(place[str(s)] < place[str(symbol)] for s in x.free_symbols if str(s) in place)
