"""Force elements, contact of two convex polygons in the plane: edges that face each other -> up to two contact points.

The edges are chosen as for manifolds of contact (Gregorius, Contact manifolds, Game Developers Conference 2015): the
edge along whose normal the polygons overlap least (the separating axis theorem), and of the other polygon the edge that
faces it most.  Contact points lie at both ends of the part in which the edges lie beside each other; each is a corner
of one polygon against the line of the other's edge.  Places are compared along the mean of both directions, so that
both depths are equal where one corner takes the place of another, and it does not matter which polygon is the first.

The energy is E(D) + y E(min(d, O - D)): D is the least overlap along a normal (the separating axis theorem), which is
the depth of the deeper point, d the depth of the other, and O the least overlap along the normals of all other edges.
The part y is 1 where the edges are nearly parallel and goes to 0 where a neighbour faces the other edge as much.  So
the second point counts nothing where other edges take over, be it because the overlap along them is as little (O = D)
or because they face each other as much (y = 0), and the energy is continuous.  Forces are its slopes: where O - D is
the lesser, the second point lies at the edge of O and the deeper point pushes so much less; y gives a couple.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..elements.forces.force import View, where
from ..elements.forces.normal_laws import NormalLaw, PartOfLaw
from ..expr import vectors as vec
from ..expr.core import Expr, sqrt
from ..expr.vectors import Vec3
from .limits import FLAT_CORNER, NOWHERE
from .pair_features import FACING, FIRST
from .point import Contact, Touch
from .profiles import Point, dot, minus, times, unit

_PARALLEL = 0.25  #: part of the squared half angle to a neighbour up to which edges count as parallel


class _Edge(NamedTuple):
    """An edge of a polygon, counterclockwise.

    Its corners, the outward normal (shorter where bodies tilt), by how much it rises out of the plane along its
    direction, the cosine of the angle to the neighbour whose direction is nearest.
    """

    start: Point
    end: Point
    normal: Point
    rise: Expr
    bend: Expr


class _Witness(NamedTuple):
    """A corner against the line of an edge: the corner, the normal from the first polygon to the second, the depth."""

    place: Point
    normal: Point
    of_first: Expr  #: whether the corner is of the first polygon
    depth: Expr


def _plus(a: Point, b: Point) -> Point:
    return a[0] + b[0], a[1] + b[1]


def _either(condition: Expr, yes: Point, no: Point) -> Point:
    return where(condition, yes[0], no[0]), where(condition, yes[1], no[1])


def _witness_of(condition: Expr, a: _Witness, b: _Witness) -> _Witness:
    place, normal = _either(condition, a.place, b.place), _either(condition, a.normal, b.normal)
    return _Witness(place, normal, where(condition, a.of_first, b.of_first), where(condition, a.depth, b.depth))


class _Matter(NamedTuple):
    """What of a polygon matters: the edge that faces the other one, corners and edges of the least and next overlap."""

    edge: _Edge
    corner: Point
    next_corner: Point
    next_start: Point
    next_normal: Point


def _matter(sizes: Sequence[Expr]) -> _Matter:
    """The numbers of :mod:`~eomgen.contact.pair_features` in the polygon's own axes."""
    graph = sizes[0].graph
    start, end, normal, before, after, *others = zip(sizes[0 : FACING + 8 : 2], sizes[1 : FACING + 8 : 2], strict=True)
    bend = graph.apply("max", dot(normal, after), dot(before, normal))
    return _Matter(_Edge(start, end, normal, graph.zero, bend), *others)


class _Facing(NamedTuple):
    """Two edges that face each other; how far the polygons overlap, where, and the edge of the next overlap."""

    first: _Edge
    second: _Edge
    least: _Witness
    next: _Witness


class _Parts(NamedTuple):
    """One of two contact points as it counts."""

    witness: _Witness
    share: Expr  #: the part of its law
    change: Expr  #: slope of that part by the cosine of the angle of both edges
    relief: Expr  #: the depth that this point carries less
    relieved: Expr  #: the part of the law of that depth


class PolygonPolygon(Contact):
    """A convex polygon about the second marker on one about the first, in its x-y plane: one of two contact points.

    ``edges`` and ``others`` are what of both matters (:mod:`~eomgen.contact.pair_features`);
    ``witness`` is 0 or 1.
    """

    edges: tuple[Expr, ...]
    others: tuple[Expr, ...]
    witness: int

    def touch(self, view: View) -> Touch:
        graph, R = view.graph, view.rotation(self.first)
        place, normal, radius, depth = self._parts(view)[0]
        half = times(normal, where(radius, -0.5 * depth, 0.5 * depth))
        middle = vec.times(R, (*_plus(place, half), graph.zero))
        reach = vec.sub(view.position(self.second), view.position(self.first))
        out = vec.times(R, (*normal, graph.zero))
        return out, depth, middle, vec.sub(middle, reach)

    def nearness(self, view: View) -> tuple[Vec3, Expr]:
        least = self._facing(view).least
        return vec.times(view.rotation(self.first), (*least.normal, view.graph.zero)), least.depth

    def law_here(self, view: View) -> NormalLaw:
        if self.normal_law.elastic(view.graph.one).is_zero:
            return self.normal_law
        parts = self._parts(view)
        less = parts.relieved * self.normal_law.elastic(parts.relief)
        return PartOfLaw(self.normal_law, parts.share, less)

    def couple(self, view: View) -> Vec3 | None:
        graph, parts = view.graph, self._parts(view)
        energy = self.normal_law.energy(parts.witness.depth)
        if energy.is_zero:
            return None
        a, b = self._facing(view)[:2]
        along = (-b.normal[1], b.normal[0], b.rise)
        turn = vec.cross(along, (-a.normal[1], a.normal[0], graph.zero))
        return vec.times(view.rotation(self.first), vec.scale(-parts.change * energy, turn))

    def _parts(self, view: View) -> _Parts:
        graph = view.graph
        a, b, least, other = self._facing(view)
        normal_a, normal_b = a.normal, unit(b.normal)
        way = (normal_b[1] - normal_a[1], normal_a[0] - normal_b[0])  # the first edge goes along it, the second back
        low = graph.apply("lt", dot(way, b.end), dot(way, a.start))
        high = graph.apply("lt", dot(way, a.end), dot(way, b.start))
        witnesses = []
        for edge, one, two in ((low, a.start, b.end), (high, a.end, b.start)):
            place = _either(edge, one, two)
            normal = _either(edge, times(normal_b, -graph.one), normal_a)
            depth = where(edge, dot(normal_b, minus(b.start, place)), dot(normal_a, minus(a.start, place)))
            witnesses.append(_Witness(place, normal, edge, depth))
        beside = graph.apply("lt", dot(way, witnesses[0].place), dot(way, witnesses[1].place))
        deeper = graph.apply("lt", witnesses[0].depth, witnesses[1].depth)  # whether the second is
        main = deeper if self.witness else 1.0 - deeper
        share, slope = self._share(a, b)
        meets, faces = graph.apply("lt", 0.0, least.depth), graph.apply("lt", 0.0, share)
        # the deeper point: that of the least overlap, which it is as long as the edges face each other
        deep = _witness_of(faces, witnesses[self.witness], least)
        # the other: up to the next overlap
        slack, mine = other.depth - least.depth, witnesses[self.witness]
        short = [graph.apply("lt", slack, witness.depth) for witness in witnesses]
        limited = _witness_of(short[self.witness], other._replace(depth=slack), mine)
        limited = limited._replace(depth=where(faces, limited.depth, -NOWHERE))
        engaged = _witness_of(main, deep, limited)
        apart = mine._replace(depth=where(beside, mine.depth, -NOWHERE))
        relieved = where(meets, where(short[1 - self.witness], where(main, share, 0.0), 0.0), 0.0)
        return _Parts(
            _witness_of(meets, engaged, apart),
            where(meets, where(main, 1.0, share), 1.0),
            where(meets, where(main, 0.0, slope), 0.0),
            slack,
            relieved,
        )

    def _share(self, a: _Edge, b: _Edge) -> tuple[Expr, Expr]:
        """The part of the second point, 1 near parallel edges, and its slope by the cosine of the edges' angle."""
        graph = a.bend.graph
        apart = _plus(a.normal, b.normal)  # its square is 4 sin^2(angle / 2)
        cosine = sqrt(0.5 + 0.5 * graph.apply("max", a.bend, b.bend))  # of half the angle to a neighbour
        limit = graph.apply("max", FLAT_CORNER, 2.0 - 2.0 * cosine)
        left = (1.0 - dot(apart, apart) / limit) / (1.0 - _PARALLEL)
        part = graph.apply("max", 0.0, graph.apply("min", 1.0, left))
        slope = -12.0 * part * (1.0 - part) / ((1.0 - _PARALLEL) * limit)
        return part * part * (3.0 - 2.0 * part), slope

    def _facing(self, view: View) -> _Facing:
        """The edges in axes of the first marker."""
        graph, R = view.graph, view.rotation(self.first)
        x, y, _ = vec.transpose_times(R, vec.sub(view.position(self.second), view.position(self.first)))
        (xx, xy, _), (yx, yy, _), (zx, zy, _) = vec.product(vec.transpose(R), view.rotation(self.second))

        def placed(p: Point) -> Point:
            return x + xx * p[0] + xy * p[1], y + yx * p[0] + yy * p[1]

        def turned(n: Point) -> Point:  # of an edge as placed
            return yy * n[0] - yx * n[1], xx * n[1] - xy * n[0]

        matter, other = _matter(self.edges), _matter(self.others)
        nx, ny = other.edge.normal
        a = matter.edge
        b = _Edge(
            placed(other.edge.start), placed(other.edge.end), turned((nx, ny)), zy * nx - zx * ny, other.edge.bend
        )
        flags = self.edges[FACING + 8 : FIRST]

        def witness(
            flag: Expr, one: tuple[Point, Point], two: tuple[Point, Point], corners: tuple[Point, Point]
        ) -> _Witness:
            """Of the edge of the first polygon or the second, by start and normal, the deepest corner of the other."""
            of_second = graph.apply("lt", 0.5, flag)
            place = _either(of_second, *corners)
            normal = _either(of_second, times(unit(two[1]), -graph.one), one[1])
            depths = dot(two[1], minus(two[0], corners[0])), dot(one[1], minus(one[0], corners[1]))
            return _Witness(place, normal, of_second, where(of_second, *depths))

        least = witness(flags[0], (a.start, a.normal), (b.start, b.normal), (matter.corner, placed(other.corner)))
        next_b = placed(other.next_start), turned(other.next_normal)
        corners = matter.next_corner, placed(other.next_corner)
        return _Facing(a, b, least, witness(flags[1], (matter.next_start, matter.next_normal), next_b, corners))
