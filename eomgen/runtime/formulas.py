"""Stage runtime: an expression as text -> a function of (t, x), its rate and slopes, and a tape for compiled loops.

The text is read by the same parser as those of model files; nothing is ever executed.  A generated package has no
parser, is without this file and refuses texts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..describe.expressions import parse
from ..errors import ExpressionError, UsageError, cannot
from ..graph.core import Expr, Graph
from ..graph.differentiate import gradient, jvp
from ..graph.evaluate import compile_evaluator
from ..graph.substitute import symbols_of
from ..graph.tape import record_tape
from ..graph.traverse import reachable
from .input_kinds import Expressed
from .layout import Layout
from .near_names import unknown
from .tapes import Tape, bends, jumps


class Formula(Expressed):
    """An expression of time, coordinates, velocities and parameters, given for one run.

    Parameters
    ----------
    layout : Layout
    text : str
        As in a model file, e.g. ``"theta - pi/2"``.
    what : str
        Whose it is, for messages.
    beside : Formula, optional
        One whose graph it shares, so that both can be evaluated at once.
    """

    def __init__(self, layout: Layout, text: str, what: str, beside: Formula | None = None) -> None:
        self.text, self.layout = text, layout
        graph: Graph = Graph() if beside is None else beside.expression.graph
        known = ("t", *layout.x, *layout.p)

        def resolve(name: str) -> Expr:
            if name not in known:
                raise unknown("name", name, known, what)
            return graph.symbol(name)

        try:
            self.expression: Expr = parse(text, graph, resolve)
        except ExpressionError as error:
            raise UsageError(f"{what}: {error}", code=error.code) from None
        self.depends_on_state = not symbols_of([self.expression]).isdisjoint(layout.x)
        self._evaluate = compile_evaluator([self.expression], known)

    @property
    def branches(self) -> bool:
        """Whether it has conditions, at which it may jump or bend."""
        graph = self.expression.graph
        return bends(graph.nodes[i][0] for i in reachable(graph, [self.expression.id]))

    def switches(self, p: Array) -> Callable[[float, Array], list[float]]:
        """What changes its sign where a condition does: a - b of each comparison of a with b, and a of sign(a)."""
        graph, found = self.expression.graph, []
        for i in reachable(graph, [self.expression.id]):
            node = graph.nodes[i]
            if jumps(node[0]):
                found.append(Expr(graph, graph.sub(*node[1:]) if len(node) == 3 else node[1]))
        evaluate, values = compile_evaluator(found, ("t", *self.layout.x, *self.layout.p)), p.tolist()
        return lambda t, x: [float(value) for value in evaluate([t, *np.asarray(x).tolist(), *values])]

    @property
    def tape(self) -> Tape:
        """As the compiled loop plays it."""
        return self.tape_with(())

    def rate(self, name: str, rate: str) -> Formula:
        """The derivative by time along the motion, of an input that is called ``name``.

        Raises
        ------
        UsageError
            It would need accelerations.
        """
        layout, graph = self.layout, self.expression.graph
        moving = dict(zip(layout.velocity_labels, layout.v, strict=True))
        states = sorted(symbols_of([self.expression]) & set(layout.x))
        for state in states:
            if state not in layout.q or state not in moving:
                raise cannot(
                    f"input {name}: the equations need its rate {rate}, but the rate of {self.text!r} contains that "
                    f"of {state}, an acceleration; write {name} in t and parameters, or give {rate} too"
                )
        along = {graph.symbol(q): graph.symbol(moving[q]) for q in states}
        other = object.__new__(type(self))
        other.layout, other.text = layout, f"d/dt ({self.text})"
        other.expression = jvp([self.expression], {graph.symbol("t"): graph.one, **along})[0]
        other.depends_on_state = not symbols_of([other.expression]).isdisjoint(layout.x)
        other._evaluate = compile_evaluator([other.expression], ("t", *layout.x, *layout.p))
        return other

    def function(self, p: Array) -> Callable[[float, Array], float]:
        """f(t, x) at given parameters (n_p,)."""
        evaluate, values = self._evaluate, p.tolist()
        return lambda t, x: float(evaluate([t, *np.asarray(x).tolist(), *values])[0])

    def sample_all(self, forcing: Any, t: Array) -> Array | None:
        """All inputs (n_u, k) at times (k,) in one pass, where they are such expressions of time alone and finite.

        None otherwise: then they are evaluated one by one, so that a fault tells its place.
        """
        u = np.repeat(forcing.base[:, None], len(t), axis=1)
        for i in forcing.varying:
            one = forcing.formulas.get(i)
            if not isinstance(one, Formula) or one.depends_on_state:
                return None
            values = [t, *[0.0] * len(self.layout.x), *forcing.parameters.tolist()]
            with np.errstate(all="ignore"):
                u[i] = one._evaluate(values)[0]
        return u if np.isfinite(u).all() else None

    def slopes(self, p: Array) -> Callable[[float, Array], Array]:
        """Its derivatives (1 + n_x + n_p,) by t, x and p, as f(t, x) at given parameters (n_p,)."""
        graph, known = self.expression.graph, ("t", *self.layout.x, *self.layout.p)
        evaluate = compile_evaluator(gradient(self.expression, [graph.symbol(name) for name in known]), known)
        values = p.tolist()
        return lambda t, x: np.array(evaluate([t, *np.asarray(x).tolist(), *values]), dtype=float)

    def function_with(self, others: Sequence[Formula], p: Array) -> Callable[[float, Array], list[float]]:
        """f(t, x) -> its value and those of others on its graph at given parameters (n_p,), in one pass."""
        layout, values = self.layout, p.tolist()
        expressions = [self.expression, *(other.expression for other in others)]
        evaluate = compile_evaluator(expressions, ("t", *layout.x, *layout.p))
        return lambda t, x: evaluate([t, *np.asarray(x).tolist(), *values])

    def tape_with(self, others: Sequence[Formula]) -> Tape:
        """One tape for it and others."""
        layout = self.layout

        def place(name: str) -> tuple[str, int]:
            for kind, names in (("x", layout.x), ("p", layout.p)):
                if name in names:
                    return kind, names.index(name)
            return "t", 0

        return record_tape([self.expression, *(other.expression for other in others)], place)
