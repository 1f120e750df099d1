"""Stage describe, jumps in time: expressions that the equations differentiate by time -> whether one jumps.

The derivative of a condition is that of the branch taken, so that a jump, which is an impact, would be passed over.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.operations import CONDITION, operations_with
from ..graph.core import Expr
from ..graph.differentiate import gradient
from ..graph.rounding_bounds import is_rounding, with_bounds
from ..graph.substitute import substitute, symbols_of
from ..graph.traverse import reachable

TRIES = 5  #: random places at which a change is looked at


def jumps_in_time(expressions: Sequence[Expr]) -> bool:
    """Whether an expression jumps where a comparison, linear in t and free of coordinates, changes.

    Comparisons that are not linear in t, or that look at coordinates, are not judged.
    """
    if not expressions:
        return False
    graph = expressions[0].graph
    t = graph.symbol("t")
    compared = operations_with(lambda row: row.kind == CONDITION and row.jumps)
    for i in reachable(graph, [x.id for x in expressions]):
        operation, *operands = graph.nodes[i]
        if operation not in compared:
            continue
        apart = Expr(graph, operands[0]) - Expr(graph, operands[1])
        slope = gradient(apart, [t])[0]
        if slope.is_zero or "t" in symbols_of([slope]):
            continue
        when = t - apart / slope  # without t: apart is linear in it
        before, after = (substitute(list(expressions), {Expr(graph, i): x}) for x in (graph.zero, graph.one))
        changes = [a - b for a, b in zip(after, before, strict=True)]
        there = substitute(changes, {t: substitute([when], {t: graph.zero})[0]})
        if any(_differs(x) for x in there):
            return True
    return False


def _differs(change: Expr) -> bool:
    """Whether a change is anything but rounding at one of several random places."""
    random, names = np.random.default_rng(5), sorted(symbols_of([change]))
    for _ in range(TRIES):
        values, bounds = with_bounds([change], dict(zip(names, random.uniform(0.2, 1.4, len(names)), strict=True)))
        if np.isfinite(values).all() and not is_rounding(values, bounds).all():
            return True
    return False
