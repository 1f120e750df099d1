"""Stage reading, values: what a user puts in for names -> substitutions on the graph."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..describe.expressions import parse
from ..describe.rewritten_texts import rewritten
from ..describe.sympy_face import free_names, is_sympy, lower_sympy, name_of, symbol
from ..errors import ExpressionError, UsageError, at_odds, ill_typed
from ..graph.core import Expr, Graph
from ..graph.evaluate import evaluate
from ..graph.shown import quoted
from ..graph.substitute import substitute, symbols_of
from ..graph.traverse import reachable
from ..runtime.near_names import unknown

QUARTER = "quarter()"  #: symbol of a quarter of a turn while values are put in


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
        raise UsageError(f"{name}: {error}", code="EG-EXPRESSION") from None
    except (TypeError, ValueError, OverflowError):
        raise ill_typed(f"{name} must be a number, a text or a SymPy expression, not {quoted(value)}") from None


def read_values(given: Any, allowed: Sequence[str], what: str, plain: Callable[[str], str]) -> dict[str, Any]:
    """Values by name, names and values looked at.

    Parameters
    ----------
    given : mapping
    allowed : sequence of str
    what : str
        What the names are, in messages.
    plain : callable
        ``left.hinge`` of an instance of a component -> ``left_hinge``, in names and in values.

    Raises
    ------
    UsageError
        An unknown name, one that is given twice, or a value that is no expression.
    """
    if not isinstance(given, Mapping):
        raise ill_typed(f"values are given by name, as a mapping does, not {quoted(given)}")
    values: dict[str, Any] = {}
    for key, value in given.items():
        name = name_of(key)
        name = plain(name) if isinstance(name, str) and name not in allowed else name
        if name not in allowed:
            raise unknown(what, name, allowed)
        if name in values:
            raise at_odds(f"{what} {name!r} is given twice; give it one value")
        values[name] = _without_dots(value, plain)
        read_value(Graph(), name, values[name])
    return values


def _without_dots(value: Any, plain: Callable[[str], str]) -> Any:
    """A value whose names of instances have no dots."""
    if isinstance(value, str):
        return rewritten(value, plain, str)
    if not is_sympy(value):
        return value
    return value.xreplace({symbol(name): symbol(plain(name)) for name in free_names([value]) if "." in name})


def put_in(expressions: Sequence[Expr], values: Mapping[str, Any]) -> list[Expr]:
    """The expressions with values put in for names, all at once; the graph simplifies what follows.

    Sines and cosines of quarter turns come out as 0, 1 and -1, which those of doubles would miss by rounding.
    """
    if not expressions or not values:
        return list(expressions)
    graph = expressions[0].graph
    quarter = graph.symbol(QUARTER)
    read = [read_value(graph, name, value) for name, value in values.items()]
    read = substitute(read, {x: k * quarter for x, k in _quarters(read)})
    found = substitute(expressions, dict(zip(map(graph.symbol, values), read, strict=True)))
    return substitute(_turned(found), {quarter: graph.constant(math.pi / 2)})


def _quarters(expressions: Sequence[Expr]) -> list[tuple[Expr, float]]:
    """Constants that are a few quarters of a turn, and how many."""
    graph = expressions[0].graph
    constants = [i for i in reachable(graph, (x.id for x in expressions)) if graph.nodes[i][0] == "const"]
    counts = [(i, round(graph.nodes[i][1] / (math.pi / 2))) for i in constants]
    return [(Expr(graph, i), float(k)) for i, k in counts if 0 < abs(k) <= 8 and graph.nodes[i][1] == k * math.pi / 2]


def _turned(expressions: Sequence[Expr]) -> list[Expr]:
    """Sines and cosines of whole numbers of quarter turns, exactly."""
    graph = expressions[0].graph
    exact: dict[Expr, Expr] = {}
    for i in reachable(graph, (x.id for x in expressions)):
        operation, *operands = graph.nodes[i]
        if operation not in ("sin", "cos") or symbols_of([argument := Expr(graph, operands[0])]) != {QUARTER}:
            continue
        turns = float(evaluate([argument], {QUARTER: 1.0})[0])  # numbers beside it would not come out whole
        straight = float(evaluate([argument], {QUARTER: 0.0})[0])
        if straight == 0.0 and turns.is_integer():
            k = int(turns) % 4
            value = (0.0, 1.0, 0.0, -1.0)[k] if operation == "sin" else (1.0, 0.0, -1.0, 0.0)[k]
            exact[Expr(graph, i)] = graph.constant(value)
    return substitute(expressions, exact)
