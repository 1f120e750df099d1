"""The first screen of large equations: blocks, letters for parts that are entries, and what each group holds."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import sympy as sp

import eomgen as eg
from eomgen.printing.formula_tree import Letter, MatrixOf, Name
from eomgen.reading.matrix_blocks import find_blocks
from eomgen.reading.printed_equations import PrintedEquations
from eomgen.reading.printed_parts import ZERO, PrintedGroup, PrintedParts, PrintedRow

EXAMPLES = Path(__file__).parents[2] / "examples"


def parts(name: str) -> PrintedParts:
    return PrintedParts(PrintedEquations(eg.load(EXAMPLES / f"{name}.yaml").derive()))


def matrices(of: PrintedParts) -> dict[str, MatrixOf]:
    lines = [line for item in of.items() if isinstance(item, PrintedRow) for line in item.lines]
    return {
        line.left.latex: line.right
        for line in lines
        if isinstance(line.right, MatrixOf) and isinstance(line.left, Letter)
    }


def test_a_platform_on_six_legs_is_shown_in_blocks() -> None:
    """M_t has a block of the platform and one of each leg; each ball joint couples the platform and one leg."""
    shown = matrices(parts("stewart_platform"))
    M, C = shown["M_t"].rows, shown["C"].rows
    assert len(M) == 7
    assert all((x == ZERO) == (i != j) for i, row in enumerate(M) for j, x in enumerate(row))
    assert [len(row) for row in C] == [7] * 6
    assert all((x == ZERO) == (j not in (0, i + 1)) for i, row in enumerate(C) for j, x in enumerate(row))


def test_blocks_need_vanishing_ones() -> None:
    full = [[True] * 4] * 4
    assert find_blocks(full, full, ["a.x", "a.y", "b.x", "b.y"], [0, 0, 1, 1]) is None
    coupled = [[True, False, False, True], [False] * 4, [False] * 4, [True, False, False, True]]
    assert find_blocks(coupled, full, ["a.x", "a.y", "b.x", "b.y"], [0, 0, 1, 1]) is None  # inertia joins the branches
    apart = [[i // 2 == j // 2 for j in range(4)] for i in range(4)]
    blocks = find_blocks(apart, apart, ["a.x", "a.y", "b.x", "b.y"], [0, 0, 1, 1])
    assert blocks == (((0, 1), (2, 3)), ((0, 1), (2, 3)))


@pytest.mark.parametrize("name", ["bicycle", "double_wishbone", "delta_robot", "andrews_squeezer"])
def test_every_letter_of_a_matrix_is_told_once(name: str) -> None:
    """Letters and parts in matrices have a line each, and none has two."""
    of = parts(name)
    groups = [item for item in of.items() if isinstance(item, PrintedGroup)]
    left = [line.left for group in groups for line in group.lines]
    told = [x.latex if isinstance(x, Letter) else of.names.latex(x.name) for x in left if isinstance(x, Letter | Name)]
    assert len(told) == len(set(told))
    for key in ("M_t", "C"):
        for row in matrices(of)[key].rows:
            for x in row:
                if isinstance(x, Letter) and re.search(r"_\{.*\d", x.latex):
                    assert x.latex in told, x


def test_groups_say_how_much_they_hold() -> None:
    of = parts("bicycle")
    named = {str(symbol): x for symbol, x in of.printed.named}
    for group in (item for item in of.items() if isinstance(item, PrintedGroup)):
        words = "".join(x for x in group.title.pieces if isinstance(x, str))
        formulas, operations = map(int, re.search(r"\((\d+) formulas, (\d+) operations\)", words).groups())  # type: ignore[union-attr]
        assert formulas == len(group.lines)
        lines: list[Any] = [named[line.left.name] for line in group.lines if isinstance(line.left, Name)]
        assert operations >= sum(int(sp.count_ops(x)) for x in lines) > 0
    shown = str(eg.load(EXAMPLES / "bicycle.yaml").derive())
    assert shown.index("In groups:") < shown.index("velocity terms of the constraints") < shown.index("c_tilt = ")


def test_choices_within_choices_are_named() -> None:
    """Six feet that are held or free: each depends on those before, so that choices written out double with each."""
    equations = eg.load(EXAMPLES / "rimless_wheel.yaml").derive()
    compiled = equations.operations["inverse_dynamics"]
    shown = [x for _, x in equations.intermediates] + list(equations.force)
    assert sum(x.count_ops() for x in shown) < 2 * (compiled.multiplications + compiled.additions)
    assert max(x.count_ops() for x in shown) < 100
