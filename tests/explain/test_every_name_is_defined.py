"""Every name on a right side of the equations of motion is the model's own, or has a line that says what it is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from sweeps import part_of

import eomgen as eg
from eomgen.explain.document import Folded, FormulaLine


def lines(pieces: Any) -> Iterator[FormulaLine]:
    """Formulas among pieces of a section, folded ones too."""
    for piece in pieces:
        if isinstance(piece, FormulaLine):
            yield piece
        elif isinstance(piece, Folded):
            yield from lines(piece.pieces)


EXAMPLES_OF = ["double_wishbone", "excavator", "four_bar", "double_pendulum", "watt_six_bar"]
METHODS_OF = ["embedding", "lagrange", "augmented"]
EVERY = [(name, method) for name in EXAMPLES_OF for method in METHODS_OF]
#: Of small mechanisms every method, of each large one another.
SOME = {*EVERY[6:12], ("double_wishbone", "embedding"), ("excavator", "lagrange"), ("watt_six_bar", "augmented")}


@pytest.mark.parametrize(("name", "method"), part_of(EVERY, SOME.__contains__))
def test_no_name_of_the_equations_of_motion_is_left_open(name: str, method: str) -> None:
    equations = eg.load_example(name).derive(method=method)
    told = equations.explain(level="short")
    (section,) = (one for one in told.sections if one.title == "Equations of motion")
    found = list(lines(section.pieces))
    assert found
    k = equations.kinematics
    own = {*k.names, *k.velocity_names, *k.parameter_names, *k.input_names, "t"}
    own |= {f"{name}_ddot" for name in k.names}
    defined = {line.sides[0] for line in found}
    for line in found:
        for side in line.sides[1:]:
            for symbol in getattr(side, "free_symbols", ()):
                assert str(symbol) in own or told._printer.latex(symbol) in defined, f"{symbol} in {line.sides[0]}"
