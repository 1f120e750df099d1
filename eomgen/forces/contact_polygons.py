"""Force elements, contact of two convex polygons in the plane: the two edges that face each other -> up to two spots.

The edges are chosen as for manifolds of contact (Gregorius, Contact manifolds, Game Developers Conference 2015): the
edge along whose normal the polygons overlap least (the separating axis theorem), and of the other polygon the edge that
faces it most.  Spots lie at both ends of the part in which the edges lie beside each other; each is a corner of one
polygon against the line of the other's edge.  Places are compared along the mean of both directions, so that both
depths are equal where one corner takes the place of another: the energy is continuous there, and it does not matter
which polygon is the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Vec3
from ..limits.contacts import NOWHERE
from ..records import dataclass
from .branches import where
from .contact import Contact, Touch
from .contact_profiles import Point, dot, minus, times, unit
from .contact_rounds import EDGE
from .force import View


class _Edge(NamedTuple):
    """An edge of a polygon, counterclockwise: its corners and the outward normal (shorter where bodies tilt)."""

    start: Point
    end: Point
    normal: Point


def _plus(a: Point, b: Point) -> Point:
    return a[0] + b[0], a[1] + b[1]


def _chosen(condition: Expr, yes: _Edge, no: _Edge) -> _Edge:
    flat = [(where(condition, a[0], b[0]), where(condition, a[1], b[1])) for a, b in zip(yes, no, strict=True)]
    return _Edge(*flat)


def _edges(sizes: Sequence[Expr]) -> list[_Edge]:
    """Edges of a polygon in its own axes."""
    starts = list(zip(sizes[::EDGE], sizes[1::EDGE], strict=True))
    normals = zip(sizes[2::EDGE], sizes[3::EDGE], strict=True)
    return [_Edge(*one) for one in zip(starts, [*starts[1:], starts[0]], normals, strict=True)]


def _first_least(found: Sequence[tuple[Expr, _Edge]]) -> tuple[Expr, _Edge]:
    """The edge of the least of some numbers."""

    def lesser(best: tuple[Expr, _Edge], new: tuple[Expr, _Edge]) -> tuple[Expr, _Edge]:
        less = new[0].graph.apply("lt", new[0], best[0])
        return where(less, new[0], best[0]), _chosen(less, new[1], best[1])

    return reduce(lesser, found)


def _overlap(edge: _Edge, corners: Sequence[Point]) -> Expr:
    """How deep the deepest of some corners is below an edge."""
    depths = [dot(edge.normal, minus(edge.start, corner)) for corner in corners]
    return reduce(lambda a, b: a.graph.apply("max", a, b), depths)


class _Facing(NamedTuple):
    """Two edges that face each other, how far the polygons overlap and along which normal of the first or second."""

    first: _Edge
    second: _Edge
    overlap: Expr
    out: Point


@dataclass(frozen=True)
class PolygonPolygon(Contact):
    """A convex polygon about the second marker on one about the first, in whose x-y plane both lie: one of two spots.

    ``edges`` and ``others`` are the edges of both as in :class:`~.contact_rounds.PolygonRound`; ``spot`` is 0 or 1.
    """

    edges: tuple[Expr, ...]
    others: tuple[Expr, ...]
    spot: int

    def touch(self, view: View) -> Touch:
        graph, R = view.graph, view.rotation(self.first)
        a, b, _, _ = self._facing(view)
        normal_a, normal_b = a.normal, unit(b.normal)
        way = (normal_b[1] - normal_a[1], normal_a[0] - normal_b[0])  # the first edge goes along it, the second back
        low = graph.apply("lt", dot(way, b.end), dot(way, a.start))
        high = graph.apply("lt", dot(way, a.end), dot(way, b.start))
        ends = ((low, a.start, b.end), (high, a.end, b.start))
        kept = [tuple(where(own, p, q) for p, q in zip(one, other, strict=True)) for own, one, other in ends]
        beside = graph.apply("lt", dot(way, (kept[0][0], kept[0][1])), dot(way, (kept[1][0], kept[1][1])))
        own, place = ends[self.spot][0], (kept[self.spot][0], kept[self.spot][1])
        normal = (where(own, -normal_b[0], normal_a[0]), where(own, -normal_b[1], normal_a[1]))
        depth = where(own, dot(normal_b, minus(b.start, place)), dot(normal_a, minus(a.start, place)))
        half = times(normal, where(own, -0.5 * depth, 0.5 * depth))
        middle = vec.times(R, (*_plus(place, half), graph.zero))
        reach = vec.sub(view.position(self.second), view.position(self.first))
        out = vec.times(R, (*normal, graph.zero))
        return out, where(beside, depth, -NOWHERE), middle, vec.sub(middle, reach)

    def nearness(self, view: View) -> tuple[Vec3, Expr]:
        facing = self._facing(view)
        return vec.times(view.rotation(self.first), (*facing.out, view.graph.zero)), facing.overlap

    def _facing(self, view: View) -> _Facing:
        """The edges in axes of the first marker."""
        graph, R = view.graph, view.rotation(self.first)
        x, y, _ = vec.transpose_times(R, vec.sub(view.position(self.second), view.position(self.first)))
        (xx, xy, _), (yx, yy, _), _ = vec.product(vec.transpose(R), view.rotation(self.second))

        def placed(p: Point) -> Point:
            return x + xx * p[0] + xy * p[1], y + yx * p[0] + yy * p[1]

        own = _edges(self.edges)
        others = []
        for start, end, (nx, ny) in _edges(self.others):
            across = (yy * nx - yx * ny, xx * ny - xy * nx)  # of the edge as placed
            others.append(_Edge(placed(start), placed(end), across))
        starts = [edge.start for edge in others]
        deep_a, a = _first_least([(_overlap(edge, starts), edge) for edge in own])
        corners = [edge.start for edge in own]
        deep_b, b = _first_least([(_overlap(edge, corners), edge) for edge in others])
        _, facing_a = _first_least([(dot(edge.normal, b.normal), edge) for edge in own])
        _, facing_b = _first_least([(dot(edge.normal, a.normal), edge) for edge in others])
        of_second = graph.apply("lt", deep_b, deep_a)
        out = unit(b.normal)
        normal = (where(of_second, -out[0], a.normal[0]), where(of_second, -out[1], a.normal[1]))
        first, second = _chosen(of_second, facing_a, a), _chosen(of_second, b, facing_b)
        return _Facing(first, second, where(of_second, deep_b, deep_a), normal)


def most_reach(sizes: Sequence[Expr]) -> Expr:
    """How far the corners of a polygon are from its marker."""
    squares = [x * x + y * y for x, y in zip(sizes[::EDGE], sizes[1::EDGE], strict=True)]
    return sqrt(reduce(lambda a, b: a.graph.apply("max", a, b), squares))
