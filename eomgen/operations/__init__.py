"""Operations of expressions: one row each says all that eomgen knows of it.

Values, derivatives, rounding, simplification, SymPy's form, words of model files, text in C and NumPy, Taylor series
and counts are looked up here, also where a generated package runs without the graph.
"""

from __future__ import annotations

from collections.abc import Callable

from .row import ARITHMETIC, CHOICE, CONDITION, FUNCTION, Operation, function
from .table import ROWS

__all__ = [
    "ARITHMETIC",
    "CHOICE",
    "CONDITION",
    "FUNCTION",
    "OPERATIONS",
    "Operation",
    "function",
    "operations_with",
    "tape_rows",
]

OPERATIONS: dict[str, Operation] = {row.name: row for row in ROWS}


def operations_with(test: Callable[[Operation], bool]) -> frozenset[str]:
    """Names of the operations that pass a test."""
    return frozenset(name for name, row in OPERATIONS.items() if test(row))


def tape_rows() -> str:
    """``#define EOMGEN_TAPE(X)`` with X(name, value of a, b, c) for every operation, for steppers/tape.c."""
    rows = (f"X({row.name}, {row.plain_c})" for row in OPERATIONS.values())
    return " \\\n    ".join(["#define EOMGEN_TAPE(X)", *rows]) + "\n"
