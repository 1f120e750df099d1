"""Force elements, one-sided laws: functions that vanish on one side and whose other side need not exist there."""

from __future__ import annotations

from collections.abc import Callable

from ..graph.core import Expr


def where(condition: Expr, yes: Expr | float, no: Expr | float) -> Expr:
    """``yes`` where the condition holds, else ``no``."""
    return condition.graph.apply("select", condition, yes, no)


def beyond_zero(x: Expr, law: Callable[[Expr], Expr]) -> Expr:
    """law(x) for x > 0, else 0.

    Where x <= 0 the law sees 1, so that neither it nor its derivative has to exist there (a root of a negative number).
    """
    inside = x.graph.apply("lt", 0.0, x)
    return where(inside, law(where(inside, x, 1.0)), 0.0)
