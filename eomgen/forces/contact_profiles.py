"""Force elements, contact with a profile in the plane: points of ground -> pieces, and how a circle touches a piece.

A piece owns the points whose nearest point of the profile it holds, those between the bisectors at its ends, and where
a neighbour turns towards it all that it faces.  So a circle meets one piece, or several where it bridges a valley.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

from ..frames import Frame
from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Vec3
from ..records import dataclass
from .branches import where
from .contact import Contact, Touch
from .force import View

Point = tuple[Expr, Expr]
WALLS = 7  #: place among the sizes of an edge of whether it is felt beside its neighbours


class ProfilePart(NamedTuple):
    """A piece of a profile: origin and direction of its x axis, y out of the solid; sizes; half of its length.

    ``open`` tells whether it goes on without end.
    """

    kind: str
    origin: Point
    along: Point
    sizes: tuple[Expr, ...]
    half: Expr
    open: bool

    def frame(self, base: Frame) -> Frame:
        """Its axes in the body of a frame."""
        zero, one = self.half.graph.zero, self.half.graph.one
        (c, s), (x, y) = self.along, self.origin
        turn = ((c, -s, zero), (s, c, zero), (zero, zero, one))
        return Frame(vec.product(base.rotation, turn), vec.add(base.position, vec.times(base.rotation, (x, y, zero))))


def edge(
    start: Point,
    reach: Point,
    before: Point | None,
    after: Point | None,
    width: Expr,
    walls: bool = False,
    endless: tuple[bool, bool] = (False, False),
) -> ProfilePart:
    """A straight piece between neighbours, straight ones given by their ways from end to end, if they have both.

    Sizes: half of its length; at the left and the right end x and y of the bisector and 1, or 0 without an end; 1 if it
    is felt beside its neighbours where these turn towards it (``walls``), else 0; the width over which neighbours share
    a circle; of both ends what is hollow there (:func:`hollow`), of an edge with walls.
    """
    graph, way, half = width.graph, unit(reach), 0.5 * length(reach)
    ends: list[Expr] = []
    passes: list[Expr] = []
    for run, inward, on in ((before, 1.0, endless[0]), (after, -1.0, endless[1])):
        if run is None:
            passes += hollow(graph.zero, None)
            ends += [graph.zero, graph.one, graph.zero]
            continue
        other = unit(run)
        turned = (dot(way, other), -inward * cross(way, other)) if walls else None
        passes += hollow(graph.zero, turned, graph.zero if on else 1.0 / length(run))
        bisector = unit((-way[1] - other[1], way[0] + other[0]))  # the sum of both normals
        ends += [inward * dot(bisector, way), way[0] * bisector[1] - way[1] * bisector[0], graph.one]
    middle = (start[0] + 0.5 * reach[0], start[1] + 0.5 * reach[1])
    sizes = (half, *ends, graph.constant(float(walls)), width, *passes)
    return ProfilePart("edge", middle, way, sizes, half, before is None or after is None)


def hollow(radius: Expr, turned: Point | None, short: Expr | None = None) -> tuple[Expr, Expr, Expr, Expr]:
    """What is hollow between an end of a piece and the next: cosine and sine of their angle, radius, 1 / length.

    It is the corner itself, of radius 0, before a piece of a length, or a hollow arc; where the outline turns the
    other way all four are 0.
    """
    zero = radius.graph.zero
    if turned is None:
        return zero, zero, zero, zero
    inwards = radius.graph.apply("lt", 0.0, turned[1])
    cosine, sine, size, per_length = (
        where(inwards, x, 0.0) for x in (*turned, radius, zero if short is None else short)
    )
    return cosine, sine, size, per_length


def biarcs(a: Point, b: Point, s: Point, t: Point, width: Expr) -> tuple[ProfilePart, ProfilePart]:
    """Two arcs of one tangent from a point to another, at which the directions are s and t."""
    v, both = minus(b, a), (s[0] + t[0], s[1] + t[1])
    along, square = dot(v, both), dot(v, v)
    d = square / (along + sqrt(along * along + 2.0 * (1.0 - dot(s, t)) * square))
    joint = (0.5 * (a[0] + b[0] + d * (s[0] - t[0])), 0.5 * (a[1] + b[1] + d * (s[1] - t[1])))
    return arc(a, joint, s, width), arc(joint, b, None, width, t)


def solid_depth(pieces: Sequence[ProfilePart], depth: Expr) -> Expr:
    """How far a solid reaches below its pieces: as deep as given, but not beyond the centre of its sharpest hill.

    There its sides meet: a deeper solid would be felt through the other side of a hill.
    """
    graph = depth.graph
    bends = [-one.sizes[0] for one in pieces if one.kind == "arc"]  # 1 / radius, of hills
    return reduce(lambda least, bend: least / graph.apply("max", 1.0, least * bend), bends, depth)


def tangent(a: Point, b: Point, c: Point) -> Point:
    """The direction at b of the circle through three points."""
    before, after = minus(b, a), minus(c, b)
    p, q = dot(before, before), dot(after, after)
    return unit((before[0] * q + after[0] * p, before[1] * q + after[1] * p))


def arc(start: Point, end: Point, at_start: Point | None, width: Expr, at_end: Point | None = None) -> ProfilePart:
    """A circular arc, given the direction at its start or its end.

    Sizes: curvature; half of the chord; height of the ends over the middle; cos and sin of the half angle; the width
    over which neighbours share a circle; of both ends what is hollow beyond them (:func:`hollow`), nothing so far.
    """
    chord = minus(end, start)
    c, half = unit(chord), 0.5 * length(chord)
    if at_start is not None:
        cosine, sine = dot(at_start, c), at_start[0] * c[1] - at_start[1] * c[0]
    else:
        assert at_end is not None
        cosine, sine = dot(at_end, c), c[0] * at_end[1] - c[1] * at_end[0]
    rise = half * sine / (1.0 + cosine)
    middle = (start[0] + half * c[0] + rise * c[1], start[1] + half * c[1] - rise * c[0])
    sizes = (sine / half, half, rise, cosine, sine, width, *[width.graph.zero] * 8)
    return ProfilePart("arc", middle, c, sizes, sqrt(half * half + rise * rise), False)


def beside_bowls(ring: Sequence[ProfilePart]) -> list[ProfilePart]:
    """The pieces of a smooth ring, with the hollow arcs that lie beyond their ends."""
    found = []
    for k, one in enumerate(ring):
        passes = list(one.sizes[-8:])
        for place, other in ((0, ring[k - 1]), (4, ring[(k + 1) % len(ring)])):
            if other.kind == "arc":
                bend, _, _, cosine, sine = other.sizes[:5]
                inwards = bend.graph.apply("lt", 0.0, bend)
                turned = (cosine * cosine - sine * sine, where(inwards, 2.0 * sine * cosine, 0.0))
                passes[place : place + 4] = hollow(1.0 / where(inwards, bend, 1.0), turned)
        found.append(one._replace(sizes=(*one.sizes[:-8], *passes)))
    return found


def arc_points(one: ProfilePart) -> list[Point]:
    """Points along a circular arc in its own axes, from left to right, for pictures."""
    bend, half = one.sizes[:2]
    found = []
    for part in (-1.0, -0.85, -0.5, 0.0, 0.5, 0.85, 1.0):
        x = part * half
        found.append((x, bend * x * x / (1.0 + sqrt(half.graph.apply("max", 0.0, 1.0 - bend * bend * x * x)))))
    return found


def peaks(points: Sequence[Point]) -> list[tuple[int, Point]]:
    """Inner points, numbered, at which the profile turns down, as far as numbers tell: they meet what is flat."""
    found = []
    for k, (a, b, c) in enumerate(zip(points, points[1:], points[2:], strict=False)):
        turn = cross(minus(b, a), minus(c, b)).value
        if turn is None or turn < 0.0:
            found.append((k, b))
    return found


def minus(a: Point, b: Point) -> Point:
    """The difference of two places."""
    return a[0] - b[0], a[1] - b[1]


def times(a: Point, factor: Expr) -> Point:
    """A vector times a number."""
    return a[0] * factor, a[1] * factor


def dot(a: Point, b: Point) -> Expr:
    """The scalar product."""
    return a[0] * b[0] + a[1] * b[1]


def cross(a: Point, b: Point) -> Expr:
    """The component of the vector product along z."""
    return a[0] * b[1] - a[1] * b[0]


def length(a: Point) -> Expr:
    """The length of a vector."""
    return sqrt(dot(a, a))


def unit(a: Point) -> Point:
    """The vector of length 1 of the same direction."""
    size = length(a)
    return a[0] / size, a[1] / size


def part(side: Expr, width: Expr) -> Expr:
    """1 on the inner side of a bisector, 0 on the outer; the piece on its other side has the rest of 1."""
    graph = side.graph
    return graph.apply("max", 0.0, graph.apply("min", 1.0, 0.5 + 0.5 * side / width))


@dataclass(frozen=True)
class ProfilePiece(Contact):
    """A circle about the second marker on a piece of a profile in the x-y plane of the first.

    The last of ``sizes`` is how far below the profile its solid reaches; a deeper centre feels nothing.
    """

    sizes: tuple[Expr, ...]
    radius: Expr

    def _place(self, view: View) -> tuple[Expr, Expr, Vec3]:
        reach = vec.sub(view.position(self.second), view.position(self.first))
        x, y, _ = vec.transpose_times(view.rotation(self.first), reach)
        return x, y, reach

    def _touching(self, view: View, gap: Expr, normal: tuple[Expr, Expr], reach: Vec3) -> Touch:
        out = vec.times(view.rotation(self.first), (*normal, view.graph.zero))
        thick = self.sizes[-1]
        depth = where(view.graph.apply("lt", gap, -thick), -thick, self.radius - gap)
        second = vec.scale(0.5 * depth - self.radius, out)
        return out, depth, vec.add(reach, second), second


class SurfaceRound(ProfilePiece):
    """On a piece beside others: two places of contact grow together where the circle holds what is hollow between them.

    A place begins there with all the depth d of the hollow.  So damping and friction count by d_place - w d_hollow, of
    which w is 1 where this place begins, 0 where the one beyond the hollow does, and between them the rest of that
    one's w; beside a hollow that the circle does not hold they count in full.
    """

    @abstractmethod
    def _ends(self, x: Expr, y: Expr) -> tuple[Point, Point]:
        """How far a place is from the left and the right end: inwards along the piece, and out of the solid."""

    def grip(self, view: View) -> Expr | None:
        graph = view.graph
        if self.normal_law.elastic(graph.one).is_zero:
            return None
        *passes, thick = self.sizes[-9:]
        if all(number.is_zero for number in passes):
            return None
        x, y, _ = self._place(view)
        ends, less = self._ends(x, y), graph.zero
        for (along, up), (far, _), (c, s, radius, short) in (
            (ends[0], ends[1], passes[:4]),
            (ends[1], ends[0], passes[4:]),
        ):
            high, inwards = up - radius, graph.apply("max", 0.0, along)
            beyond = graph.apply("max", 0.0, high * s - along * c)  # how far over the piece beyond the hollow
            both = inwards + beyond
            square = along * along + high * high
            apart = graph.apply("lt", 0.0, square)
            away = radius + where(apart, sqrt(where(apart, square, 1.0)), 0.0)
            weight = beyond / where(graph.apply("lt", 0.0, both), both, 1.0)
            on = graph.apply("lt", 0.0, far)  # towards its other end the piece hands the circle over to the next
            room = where(on, graph.apply("min", 1.0, 2.0 * far / where(on, far + inwards, 1.0)), 0.0)
            next_room = graph.apply("min", 1.0, graph.apply("max", 0.0, 2.0 - 2.0 * beyond * short))
            own, next_one = weight * room, (1.0 - weight) * next_room
            known = graph.apply("lt", 0.0, own + next_one)
            whole = where(known, own / where(known, own + next_one, 1.0), weight)
            taken = where(graph.apply("lt", 0.0, radius), own, whole)  # at a corner both take off the whole together
            less = less + taken * graph.apply("max", 0.0, self.radius - away)
        depth = self.touch(view)[1]
        meets = graph.apply("lt", 0.0, depth)
        inside = graph.apply("min", 1.0, graph.apply("max", 0.0, 1.0 + (self.radius - depth) / thick))
        return graph.apply("max", 0.0, 1.0 - inside * less / where(meets, depth, 1.0))


class EdgeRound(SurfaceRound):
    """On a straight piece, whose ends are corners of the profile or go on."""

    def share(self, view: View) -> Expr:
        x, y, _ = self._place(view)
        half, left_x, left_y, left, right_x, right_y, right, walls, width = self.sizes[:9]
        above = walls * view.graph.apply("max", 0.0, y)
        first, second = (
            part(along * by - y * bx + above * view.graph.apply("max", 0.0, bx), width)
            for along, bx, by in ((x + half, left_x, left_y), (half - x, right_x, right_y))
        )
        return (1.0 - left * (1.0 - first)) * (1.0 - right * (1.0 - second))

    def _ends(self, x: Expr, y: Expr) -> tuple[Point, Point]:
        half, left, right = self.sizes[0], self.sizes[3], self.sizes[6]
        far = half + x.graph.apply("abs", x)  # from an end that there is not
        closed = [x.graph.apply("lt", 0.0, end) for end in (left, right)]
        return (where(closed[0], x + half, far), y), (where(closed[1], half - x, far), y)

    def touch(self, view: View) -> Touch:
        graph = view.graph
        x, y, reach = self._place(view)
        half, _, _, left, _, _, right = self.sizes[:7]
        over = right * graph.apply("max", 0.0, x - half) - left * graph.apply("max", 0.0, -half - x)
        beside = graph.apply("lt", 0.0, over * over)
        distance = sqrt(where(beside, over * over + y * y, 1.0))
        signed = where(graph.apply("lt", y, 0.0), -distance, distance)
        gap = where(beside, signed, y)
        return self._touching(view, gap, (where(beside, over / signed, 0.0), where(beside, y / signed, 1.0)), reach)


class ArcRound(SurfaceRound):
    """On a circular arc of curvature k: gap (2 y - k (x^2 + y^2)) / (1 + q), q = |(k x, 1 - k y)|.

    The formula holds for k = 0 too.
    """

    def share(self, view: View) -> Expr:
        x, y, _ = self._place(view)
        width, ((left, _), (right, _)) = self.sizes[5], self._ends(x, y)
        return part(left, width) * part(right, width)

    def _ends(self, x: Expr, y: Expr) -> tuple[Point, Point]:
        _, half, rise, cosine, sine = self.sizes[:5]
        high, left, right = y - rise, x + half, half - x
        return (
            (left * cosine - high * sine, left * sine + high * cosine),
            (right * cosine - high * sine, right * sine + high * cosine),
        )

    def touch(self, view: View) -> Touch:
        graph = view.graph
        x, y, reach = self._place(view)
        k = self.sizes[0]
        up = 1.0 - k * y
        square = k * k * x * x + up * up
        apart = graph.apply("lt", 0.0, square)  # from the centre of the arc
        q = sqrt(where(apart, square, 1.0))
        gap = (2.0 * y - k * (x * x + y * y)) / (1.0 + q)
        return self._touching(view, gap, (-k * x / q, up / q), reach)
