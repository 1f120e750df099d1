"""Stage runtime: an expression as text -> a tape that compiled loops play, and a function of (t, x) for all others.

The text is read by the same parser as those of model files; nothing is ever executed.  A generated package, which has no
parser, refuses texts.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ExpressionError, MissingDependencyError, UsageError
from ..numeric.scales import Array
from .layout import Layout
from .names import unknown

if TYPE_CHECKING:
    from ..graph.core import Expr

#: (operation, operands) one after the other, the numbers among them, and the instructions handed out.
Tape = tuple[list[tuple[str, int, int, int]], list[float], list[int]]


class Formula:
    """An expression of time, coordinates, velocities and parameters, given for one run.

    Parameters
    ----------
    layout : Layout
    text : str
        As in a model file, e.g. ``"theta - pi/2"``.
    what : str
        Whose it is, for messages.
    """

    def __init__(self, layout: Layout, text: str, what: str) -> None:
        try:
            from ..describe.expressions import parse
            from ..graph.core import Graph
            from ..graph.evaluate import compile_evaluator
            from ..graph.substitute import symbols_of
        except ImportError:
            raise MissingDependencyError(
                f"{what}: an expression as text needs eomgen to be read: pip install eomgen, or give a function f(t, x)"
            ) from None
        self.text, self.layout = text, layout
        graph = Graph()
        known = ("t", *layout.x, *layout.p)

        def resolve(name: str) -> Expr:
            if name not in known:
                raise unknown(f"name in {what}", name, known)
            return graph.symbol(name)

        try:
            self.expression = parse(text, graph, resolve)
        except ExpressionError as error:
            raise UsageError(f"{what}: {error}") from None
        self.depends_on_state = not symbols_of([self.expression]).isdisjoint(layout.x)
        self._evaluate = compile_evaluator([self.expression], known)

    def function(self, p: Array) -> Callable[[float, Array], float]:
        """f(t, x) at given parameters (n_p,)."""
        evaluate, values = self._evaluate, p.tolist()
        return lambda t, x: float(evaluate([t, *np.asarray(x).tolist(), *values])[0])


def record_tape(formulas: list[Formula]) -> Tape:
    """One tape for several expressions."""
    from ..graph.traverse import reachable

    code: list[tuple[str, int, int, int]] = []
    numbers: list[float] = []
    out: list[int] = []
    for formula in formulas:
        graph, layout = formula.expression.graph, formula.layout
        place: dict[int, int] = {}
        for i in reachable(graph, [formula.expression.id]):
            kind, *given = graph.nodes[i]
            if kind == "const":
                code.append(("const", len(numbers), 0, 0))
                numbers.append(float(given[0]))
            elif kind == "sym":
                code.append(_leaf(layout, given[0]))
            else:
                a, b, c = (*(place[k] for k in given), 0, 0)[:3]
                code.append((kind, a, b, c))
            place[i] = len(code) - 1
        out.append(place[formula.expression.id])
    return code, numbers, out


def _leaf(layout: Layout, name: str) -> tuple[str, int, int, int]:
    for kind, names in (("x", layout.x), ("p", layout.p)):
        if name in names:
            return kind, names.index(name), 0, 0
    return "t", 0, 0, 0


def is_formula(value: Any) -> bool:
    """Whether what a user gives is an expression as text."""
    return isinstance(value, str)
