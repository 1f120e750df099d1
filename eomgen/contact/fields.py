"""Force elements, contact with a height field: z(x, y) above the x-y plane of a marker -> where shapes touch it.

The ground is z <= h(x, y).  A shape touches it where both have one normal; depths change with positions as if that
point did not move, so that forces have a potential.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..base.limits.runs import BEYOND, UP_TO
from ..elements.forces.force import View, where
from ..expr import vectors as vec
from ..expr.core import Expr, Graph, reachable, sqrt, substitute
from ..expr.differentiate import gradient
from ..expr.functions import Surface
from ..expr.vectors import Mat3, Vec3
from .ellipsoids import quadratic_form
from .limits import ASTRAY, FOOT, NOWHERE, STEEP
from .point import Contact, Touch
from .rounds import converged, seen_from

#: Symbols of a place in the expression of a height, and the names by which texts know them.
PLACES = {"x": "x[height]", "y": "y[height]"}
_LINES = 13  #: lines each way of which the picture of a height field is made
_TOO_BENT = 0.05  #: part of the plain step's determinant below which Newton's step is not taken


class HeightField(NamedTuple):
    """A height as an expression of x and y, and its derivatives: h, h_x, h_y, h_xx, h_xy, h_yy."""

    x: Expr
    y: Expr
    values: tuple[Expr, ...]

    def at(self, x: Expr, y: Expr) -> list[Expr]:
        """These at a place."""
        return substitute(self.values, {self.x: x, self.y: y})


def planted(height: Expr, graph: Graph, bring: Callable[[Expr], Expr]) -> HeightField:
    """A height field in the graph of a pair; ``bring`` maps what does not depend on the place from that of a model."""
    source = height.graph
    x, y = (graph.symbol(name) for name in PLACES.values())
    places = {source.symbol(name).id: symbol for name, symbol in zip(PLACES.values(), (x, y), strict=True)}
    new = {i: symbol.id for i, symbol in places.items()}
    kept: dict[int, int] = {}

    def operand(i: int) -> int:
        if i in new:
            return new[i]
        if i not in kept:
            kept[i] = bring(Expr(source, i)).id
        return kept[i]

    for i in reachable(source, [height.id]):
        operation, *ids = source.nodes[i]
        if operation in ("const", "sym") or not any(k in new for k in ids):
            continue
        result = [operand(k) for k in ids]
        if operation in source.calls:
            new[i] = graph.call(*source.calls[operation], result)
        else:
            new[i] = graph.make(operation, *result)
    h = Expr(graph, operand(height.id))
    slopes = gradient(h, [x, y])
    (xx, xy), (_, yy) = (gradient(slope, [x, y]) for slope in slopes)
    return HeightField(x, y, (h, *slopes, xx, xy, yy))


def field_lines(height: Expr) -> list[list[Vec3]]:
    """Lines of a picture over the grid of a table of x and y that a height calls; none where it calls none."""
    graph = height.graph
    places = tuple(graph.symbol(name) for name in PLACES.values())
    for i in reachable(graph, [height.id]):
        operation, *ids = graph.nodes[i]
        function = graph.calls[operation][0] if operation in graph.calls else None
        surface = getattr(function, "evaluator", None)
        if isinstance(surface, Surface) and ids == [place.id for place in places]:
            break
    else:
        return []
    x, y = (np.linspace(axis[0], axis[-1], _LINES) for axis in (surface.x, surface.y))
    grid: list[list[Vec3]] = []
    for a in x.tolist():
        heights = [
            substitute([height], dict(zip(places, map(graph.constant, (a, b)), strict=True)))[0] for b in y.tolist()
        ]
        grid.append([(graph.constant(a), graph.constant(b), z) for b, z in zip(y.tolist(), heights, strict=True)])
    return [*grid, *(list(line) for line in zip(*grid, strict=True))]


class FieldContact(Contact):
    """A shape about the second marker on a height field of the first."""

    field: HeightField

    @abstractmethod
    def _reach(self, m: Vec3, view: View) -> Vec3:
        """From the shape's centre to its farthest point against a direction, in axes of the first marker."""

    @abstractmethod
    def _bend(self, m: Vec3, change: Vec3, view: View) -> Vec3:
        """How that changes with the direction."""

    def _step(self, x: Expr, y: Expr, place: Vec3, view: View) -> tuple[Expr, Expr, Expr]:
        """Newton's step towards e s_x = e s_y = 0, e from the shape's point to that of the ground, s = (x, y, h).

        The last number says whether the distance has a minimum nearby, and no more than one.
        """
        graph = view.graph
        h, hx, hy, xx, xy, yy = self.field.at(x, y)
        m = (-hx, -hy, graph.one)
        e = vec.sub((x, y, h), vec.add(place, self._reach(m, view)))
        fx, fy = e[0] + hx * e[2], e[1] + hy * e[2]
        gxx, gxy, gyy = 1.0 + hx * hx, hx * hy, 1.0 + hy * hy
        bends = [self._bend(m, (-a, -b, graph.zero), view) for a, b in ((xx, xy), (xy, yy))]
        (ax, ay), (bx, by) = ((b[0] + hx * b[2], b[1] + hy * b[2]) for b in bends)
        jxx, jxy, jyx, jyy = gxx + e[2] * xx - ax, gxy + e[2] * xy - bx, gxy + e[2] * xy - ay, gyy + e[2] * yy - by
        det, plain = jxx * jyy - jxy * jyx, gxx * gyy - gxy * gxy
        good = graph.apply("and", graph.apply("lt", _TOO_BENT * plain, det), graph.apply("lt", 0.0, jxx + jyy))
        jxx, jxy, jyx, jyy = (where(good, a, b) for a, b in ((jxx, gxx), (jxy, gxy), (jyx, gxy), (jyy, gyy)))
        det = where(good, det, plain)
        return x - (jyy * fx - jxy * fy) / det, y - (jxx * fy - jyx * fx) / det, good

    def _closest(self, view: View) -> tuple[Vec3, Expr, Vec3, Vec3, Expr, Expr]:
        """Normal, depth and the shape's point, in axes of the first marker; the way between markers; whether found.

        The last number says whether all steps lay where the distance has one minimum: then depths are continuous.
        """
        graph = view.graph
        reach, _, place = seen_from(self, view)
        lowest = vec.add(place, self._reach((graph.zero, graph.zero, graph.one), view))
        x, y = lowest[0], lowest[1]
        unique = graph.one
        for k in range(FOOT):
            if k == FOOT - 1:
                x, y = converged(view, x), converged(view, y)
            x, y, good = self._step(x, y, place, view)
            unique = graph.apply("and", unique, good)
        h, hx, hy, *_ = self.field.at(x, y)
        size = sqrt(1.0 + hx * hx + hy * hy)
        n = (-hx / size, -hy / size, 1.0 / size)
        radius = self._reach((-hx, -hy, graph.one), view)
        e = vec.sub((x, y, h), vec.add(place, radius))
        depth = vec.dot(n, e)
        aside = vec.sub(e, vec.scale(depth, n))
        square = vec.dot(e, e)
        good = graph.apply("le", vec.dot(aside, aside), ASTRAY * square)  # NaN is not
        return n, where(good, depth, -sqrt(where(good, 1.0, square))), radius, reach, good, unique

    def deepest(self, view: View) -> Expr:
        """Nothing where the start or a step lies in a hollow that is sharper than the shape."""
        return where(self._closest(view)[-1], NOWHERE, 0.0)

    def touch(self, view: View) -> Touch:
        R = view.rotation(self.first)
        n, depth, radius, reach, *_ = self._closest(view)
        normal = vec.times(R, n)
        second = vec.add(vec.times(R, radius), vec.scale(0.5 * depth, normal))
        return normal, depth, vec.add(reach, second), second

    def nearness(self, view: View) -> tuple[Vec3, Expr]:
        """As if the nearest ground lay straight ahead.

        Ground may rise beside the nearest point, and nearer ground lie elsewhere: the way to it is at least the part
        ``STEEP`` of the distance, and the whole speed leads there.  Steps may go ``BEYOND`` the distance of what has no
        far side, as a flat; here only ``UP_TO`` it.
        """
        graph = view.graph
        R = view.rotation(self.first)
        n, depth, radius, reach, good, _ = self._closest(view)
        _, _, place = seen_from(self, view)
        beneath = self.field.at(place[0], place[1])[0]
        over = STEEP * (place[2] - beneath) - sqrt(vec.dot(radius, radius))
        gap = where(good, -depth, graph.apply("max", over, -ASTRAY * depth))
        gap = where(graph.apply("and", good, graph.apply("lt", depth, 0.0)), STEEP * gap, gap)
        turning = view.angular_velocity(self.first)
        speed = vec.sub(vec.sub(view.velocity(self.second), view.velocity(self.first)), vec.cross(turning, reach))
        square = vec.dot(speed, speed)
        moves = graph.apply("lt", 0.0, square)
        rate = sqrt(where(moves, square, 1.0))
        x, y, z = (where(moves, -a / rate, b) for a, b in zip(speed, vec.times(R, n), strict=True))
        return (x, y, z), -where(graph.apply("lt", 0.0, gap), UP_TO / BEYOND * gap, gap)


class FieldRound(FieldContact):
    """A sphere, or a point of radius 0: the nearest point of the ground."""

    radius: Expr

    def _reach(self, m: Vec3, view: View) -> Vec3:
        return vec.scale(-self.radius / sqrt(vec.dot(m, m)), m)

    def _bend(self, m: Vec3, change: Vec3, view: View) -> Vec3:
        w = sqrt(vec.dot(m, m))
        along = vec.dot(m, change) / (w * w * w)
        return vec.scale(-self.radius, vec.sub(vec.scale(1.0 / w, change), vec.scale(along, m)))


class FieldEllipsoid(FieldContact):
    """An ellipsoid, half axes along its x, y, z; its farthest point against m is -B m / sqrt(m B m) from its centre.

    B = R diag(a^2, b^2, c^2) R^T, R from its axes to those of the ground.
    """

    axes: tuple[Expr, Expr, Expr]

    def _form(self, view: View) -> Mat3:
        R = vec.product(vec.transpose(view.rotation(self.first)), view.rotation(self.second))
        return quadratic_form(R, self.axes)

    def _reach(self, m: Vec3, view: View) -> Vec3:
        Bm = vec.times(self._form(view), m)
        return vec.scale(-1.0 / sqrt(vec.dot(m, Bm)), Bm)

    def _bend(self, m: Vec3, change: Vec3, view: View) -> Vec3:
        B = self._form(view)
        Bm = vec.times(B, m)
        w = sqrt(vec.dot(m, Bm))
        along = vec.dot(change, Bm) / (w * w * w)
        return vec.sub(vec.scale(along, Bm), vec.scale(1.0 / w, vec.times(B, change)))
