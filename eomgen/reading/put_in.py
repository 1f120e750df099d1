"""Stage reading, values: what a user puts in for names -> substitutions on the graph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..describe.expressions import parse
from ..describe.sympy_face import is_sympy, lower_sympy, name_of
from ..errors import ExpressionError, UsageError
from ..graph.core import Expr, Graph
from ..graph.shown import quoted
from ..graph.substitute import substitute
from ..runtime.near_names import unknown


def read_value(graph: Graph, name: str, value: Any) -> Expr:
    """The expression of a number, a text or a SymPy expression; functions of time stand for what they are called.

    Raises
    ------
    UsageError
        It is none of these.
    """
    try:
        if isinstance(value, str):
            return parse(value, graph, graph.symbol)
        if is_sympy(value):
            return lower_sympy(graph, value, graph.symbol)
        return graph.constant(float(value))
    except ExpressionError as error:
        raise UsageError(f"{name}: {error}") from None
    except (TypeError, ValueError, OverflowError):
        raise UsageError(f"{name} must be a number, a text or a SymPy expression, not {quoted(value)}") from None


def read_values(given: Mapping[Any, Any], allowed: Sequence[str], what: str) -> dict[str, Any]:
    """Values by name, names and values looked at.

    Raises
    ------
    UsageError
        An unknown name, or a value that is no expression.
    """
    if not isinstance(given, Mapping):
        raise UsageError(f"values are given by name, as a mapping does, not {quoted(given)}")
    values = {name_of(key): value for key, value in given.items()}
    for name, value in values.items():
        if name not in allowed:
            raise unknown(what, name, allowed)
        read_value(Graph(), name, value)
    return values


def put_in(expressions: Sequence[Expr], values: Mapping[str, Any]) -> list[Expr]:
    """The expressions with values put in for names, all at once; the graph simplifies what follows."""
    if not expressions or not values:
        return list(expressions)
    graph = expressions[0].graph
    mapping = {graph.symbol(name): read_value(graph, name, value) for name, value in values.items()}
    return substitute(expressions, mapping)
