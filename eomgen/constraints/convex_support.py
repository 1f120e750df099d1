"""Constraint elements, supports: a formula of a support -> whether it is that of a convex body, at sampled normals.

Continued by H(k n) = k H(n), a support is that of a convex body where H is convex.  On unit normals its radii of
curvature are the eigenvalues of f_nn + (f - f_n . n) I across n, with the derivatives of any formula f that agrees with
H there (Schneider, Convex Bodies, 2014, section 2.5).  Where both vanish the body has a corner, about which it would
turn; where one does it has an edge, on which it rolls as a thin disc does.
"""

from __future__ import annotations

from ..base.value_rules import SUPPORT
from ..elements.entry import Entry
from ..graph.core import Expr
from ..graph.differentiate import jvp
from ..graph.vectors import Vec3


def require_convex(e: Entry, support: Expr, local: Vec3) -> None:
    """Note a fault of a support that is not convex, as far as the values of parameters tell."""
    slopes = [_along(support, local, k) for k in range(3)]
    bends = [_along(slope, local, k) for slope in slopes for k in range(3)]
    e.judge("support", SUPPORT, [support, *slopes, *bends], local=[str(x.node[1]) for x in local])


def _along(x: Expr, local: Vec3, k: int) -> Expr:
    graph = x.graph
    return jvp([x], {symbol: graph.one if i == k else graph.zero for i, symbol in enumerate(local)})[0]
