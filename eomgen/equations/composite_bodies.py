"""Stage equations: links and their inertias -> the mass matrix of a tree (Featherstone, RBDA (2008), table 6.2)."""

from __future__ import annotations

from collections.abc import Sequence

from ..frames import GROUND
from ..graph.core import Expr
from ..graph.spatial import dot
from ..kinematics.link_inertia import SpatialInertia
from ..kinematics.tree import Link

Rows = tuple[tuple[Expr, ...], ...]


def composite_mass_matrix(links: Sequence[Link], inertias: Sequence[SpatialInertia]) -> Rows:
    """M_ij = s_i . I^c_max(i,j) s_j along each branch, composite inertias summed inwards."""
    n = sum(len(link.columns) for link in links)
    composite = list(inertias)
    graph = links[0].mass.graph
    rows = [[graph.zero] * n for _ in range(n)]
    for k in graph.marked(reversed(range(len(links)))):
        link = links[k]
        if link.parent != GROUND:
            composite[link.parent] = composite[link.parent].plus(link.up_inertia(composite[k]))
        for c, column in enumerate(link.columns):
            i = link.first + c
            wrench = composite[k].times(*column)
            for d in range(c + 1):
                rows[i][link.first + d] = rows[link.first + d][i] = dot(link.columns[d], wrench)
            outer, at = link, link.parent
            while at != GROUND:
                wrench = outer.lift(wrench)
                outer = links[at]
                for d, other in enumerate(outer.columns):
                    rows[i][outer.first + d] = rows[outer.first + d][i] = dot(other, wrench)
                at = outer.parent
    return tuple(tuple(row) for row in rows)
