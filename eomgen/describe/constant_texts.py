"""Stage describe: an expression of numbers as text -> its value; read like those of model files, never executed.

A generated package has no parser and is without this file.
"""

from __future__ import annotations

from ..base.texts import shown
from ..errors import ExpressionError, no_number
from ..graph.core import Expr, Graph
from .expressions import parse


def constant(text: str, what: str) -> float:
    """The value of an expression of numbers; names have none.

    Raises
    ------
    UsageError
    """
    allowed = "write numbers, pi and functions of them"

    def resolve(name: str) -> Expr:
        if name == text.strip():
            raise no_number(f"{what} must be a number, not {shown(text)}; {allowed}")
        raise ExpressionError(f"{name!r} is not a number", remedy=allowed)

    try:
        value = parse(text, Graph(), resolve).value
    except ExpressionError as error:
        raise no_number(f"{what} must be a number: {error}") from None
    if value is None:
        raise no_number(f"{what} must be a number, not {text!r}")
    return float(value)
