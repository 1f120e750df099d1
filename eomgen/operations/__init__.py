"""Operations of expressions: one row each says all that eomgen knows of it.

Values, derivatives, rounding, simplification, SymPy's form, words of model files, text in C and NumPy, Taylor series
and counts are looked up here, also where a generated package runs without the graph.
"""

from __future__ import annotations

from .row import ARITHMETIC, CHOICE, CONDITION, FUNCTION, Operation, function
from .table import OPERATIONS, operations_with

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


def tape_rows() -> str:
    """``#define EOMGEN_TAPE(X)`` with X(name, value of a, b, c) for every operation, for steppers/tape.c."""
    rows = (f"X({row.name}, {row.plain_c})" for row in OPERATIONS.values())
    return " \\\n    ".join(["#define EOMGEN_TAPE(X)", *rows]) + "\n"
