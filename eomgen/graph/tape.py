"""Stage graph: expressions -> a tape: instructions one after the other, as plain data that a loop can play."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..base.operations import OPERATIONS
from ..errors import cannot
from .core import Expr
from .traverse import reachable

Instruction = tuple[str, int, int, int]
#: (operation, operands) one after the other, the numbers among them, and the instructions handed out.
Tape = tuple[list[Instruction], list[float], list[int]]


def record_tape(expressions: Sequence[Expr], place: Callable[[str], tuple[str, int]]) -> Tape:
    """One tape for several expressions.

    Parameters
    ----------
    expressions : sequence of Expr
        Each of a graph of its own, or of the same.
    place : callable
        Name of a symbol -> its kind (``t``, ``x``, ``u``, ``p``) and index.

    Raises
    ------
    UsageError
        An expression calls a function that the model declares: a tape knows operations only.
    """
    code: list[Instruction] = []
    numbers: list[float] = []
    out: list[int] = []
    for expression in expressions:
        graph = expression.graph
        found: dict[int, int] = {}
        for i in reachable(graph, [expression.id]):
            kind, *given = graph.nodes[i]
            if kind == "const":
                code.append(("const", len(numbers), 0, 0))
                numbers.append(float(given[0]))
            elif kind == "sym":
                code.append((*place(given[0]), 0, 0))
            elif kind in OPERATIONS:
                a, b, c = (*(found[k] for k in given), 0, 0)[:3]
                code.append((kind, a, b, c))
            else:
                raise cannot("functions of the model cannot be used in an input over time")
            found[i] = len(code) - 1
        out.append(found[expression.id])
    return code, numbers, out
