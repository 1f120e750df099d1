"""Stage describe: an expression of numbers as text -> its value; read like those of model files, never executed.

A generated package has no parser and is without this file.
"""

from __future__ import annotations

from ..errors import ExpressionError, no_number
from ..graph.core import Expr, Graph
from .expressions import parse


def constant(text: str, what: str) -> float:
    """The value of an expression of numbers; names have none.

    Raises
    ------
    UsageError
    """

    def resolve(name: str) -> Expr:
        raise ExpressionError(f"{name!r} is not a number", remedy="write numbers, pi and functions of them")

    try:
        value = parse(text, Graph(), resolve).value
    except ExpressionError as error:
        raise no_number(f"{what} must be a number, not {text!r}: {error}") from None
    if value is None:
        raise no_number(f"{what} must be a number, not {text!r}")
    return float(value)
