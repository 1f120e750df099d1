"""Contact with profiles and closed outlines in the plane -> where they touch, how parts overlap."""

from __future__ import annotations

import itertools
import math
from abc import abstractmethod
from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from ..elements.forces.force import View, where
from ..elements.frames import Frame
from ..expr import vectors as vec
from ..expr.core import Expr, cos, sin, sqrt
from ..expr.vectors import Vec3
from .limits import BELOW, EVEN, FLAT_CORNER, INSIDE, NOWHERE, SHARED
from .pair_features import PIECE
from .point import Contact, Touch

# -- profiles ----------------------------------------------------------------------------------------------------------

# A piece owns the points whose nearest point of the profile it holds, those between the bisectors at its ends, and
# where a neighbour turns towards it all that it faces. So a circle meets one piece, or several where it bridges a
# valley.


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


def beside_hollow_arcs(ring: Sequence[ProfilePart]) -> list[ProfilePart]:
    """The pieces of a smooth ring, with the hollow arcs that lie beyond their ends."""
    result = []
    for k, one in enumerate(ring):
        passes = list(one.sizes[-8:])
        for place, other in ((0, ring[k - 1]), (4, ring[(k + 1) % len(ring)])):
            if other.kind == "arc":
                bend, _, _, cosine, sine = other.sizes[:5]
                inwards = bend.graph.apply("lt", 0.0, bend)
                turned = (cosine * cosine - sine * sine, where(inwards, 2.0 * sine * cosine, 0.0))
                passes[place : place + 4] = hollow(1.0 / where(inwards, bend, 1.0), turned)
        result.append(one._replace(sizes=(*one.sizes[:-8], *passes)))
    return result


def arc_points(one: ProfilePart) -> list[Point]:
    """Points along a circular arc in its own axes, from left to right, for pictures."""
    bend, half = one.sizes[:2]
    result = []
    for part in (-1.0, -0.85, -0.5, 0.0, 0.5, 0.85, 1.0):
        x = part * half
        result.append((x, bend * x * x / (1.0 + sqrt(half.graph.apply("max", 0.0, 1.0 - bend * bend * x * x)))))
    return result


def peaks(points: Sequence[Point]) -> list[tuple[int, Point]]:
    """Inner points, numbered, at which the profile turns down, as far as numbers tell: they meet what is flat."""
    result = []
    for k, (a, b, c) in enumerate(zip(points, points[1:], points[2:], strict=False)):
        turn = cross(minus(b, a), minus(c, b)).value
        if turn is None or turn < 0.0:
            result.append((k, b))
    return result


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


class ProfilePiece(Contact):
    """A circle about the second marker on a piece of a profile in the x-y plane of the first.

    The last of ``sizes`` is how deep a centre may be in the solid.  Out of an outline :class:`InsideRound` pushes a
    deeper one.  Below a profile (``ground``) the law is undefined down to ``BELOW`` times that depth, so that a run
    stops there; what is deeper touches nothing.
    """

    sizes: tuple[Expr, ...]
    radius: Expr
    ground: bool = False

    def deepest(self, view: View) -> Expr | None:
        share = self.share(view) if self.ground else None
        if share is None:
            return None
        return where(view.graph.apply("lt", 0.0, share), self.radius + self.sizes[-1], NOWHERE)

    def _place(self, view: View) -> tuple[Expr, Expr, Vec3]:
        reach = vec.sub(view.position(self.second), view.position(self.first))
        x, y, _ = vec.transpose_times(view.rotation(self.first), reach)
        return x, y, reach

    def _touching(self, view: View, gap: Expr, normal: tuple[Expr, Expr], reach: Vec3) -> Touch:
        out = vec.times(view.rotation(self.first), (*normal, view.graph.zero))
        thick = self.sizes[-1]
        end = BELOW * (self.radius + thick) - self.radius if self.ground else thick
        depth = where(view.graph.apply("lt", gap, -end), -thick, self.radius - gap)
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
            share = where(on, graph.apply("min", 1.0, 2.0 * far / where(on, far + inwards, 1.0)), 0.0)
            next_share = graph.apply("min", 1.0, graph.apply("max", 0.0, 2.0 - 2.0 * beyond * short))
            here, next_one = weight * share, (1.0 - weight) * next_share
            known = graph.apply("lt", 0.0, here + next_one)
            whole = where(known, here / where(known, here + next_one, 1.0), weight)
            taken = where(graph.apply("lt", 0.0, radius), here, whole)  # at a corner both take off the whole together
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


# -- closed outlines ---------------------------------------------------------------------------------------------------

# The overlap of a circle of radius R about c with the solid S has the energy
#
#     V(c) = integral of E'(R - r) n(r) over r from 0 to R, n(r) the number of separate parts of S within r of c,
#
# and E(R + d) - E(R) more where c is d inside. A part begins at each place of the outline that is nearest to c among
# those beside it, where it adds E(R - r); two grow together at each that is farthest, where -E(R - r) is added. So the
# energy is continuous: where a place that is nearest meets one that is farthest both have the same r, and the number of
# parts within r of c changes with c as continuously as distances do (Cohen-Steiner, Edelsbrunner and Harer, Stability
# of persistence diagrams, 2007, of dimension 0). Forces are its slopes.
#
# Pieces of an outline add the parts (:mod:`.profiles`). Here are the places where they grow together, inner
# corners and far sides of hollow arcs, which act back with the elastic part of the law alone, and the nearest place for
# centres that are deeper inside than pieces tell by themselves.


_SAMPLES = 12  #: points of an arc at which the room inside is measured


def inner_corner(corner: Point, before: Point, after: Point, width: Expr) -> ProfilePart:
    """The inner corner between two edges of given directions; its x axis points out of the solid.

    Sizes: cosine and sine of half of the angle between the edges.
    """
    out = unit((-before[1] - after[1], before[0] + after[0]))
    cosine, sine = dot(out, after), out[0] * after[1] - out[1] * after[0]
    return ProfilePart("inner_corner", corner, out, (cosine, -sine, width), width.graph.zero, False)


def hollow_arcs(pieces: Sequence[ProfilePart]) -> list[ProfilePart]:
    """The hollow arcs among some pieces, as far as numbers tell."""
    arcs = [one for one in pieces if one.kind == "arc"]
    return [one._replace(kind="hollow_arc") for one in arcs if one.sizes[0].value is None or one.sizes[0].value > 0.0]


def inner_corners(pieces: Sequence[ProfilePart]) -> list[ProfilePart]:
    """The inner corners among some corners, as far as numbers tell."""
    result = [one for one in pieces if one.kind == "inner_corner"]
    return [one for one in result if one.sizes[0].value is None or one.sizes[0].value > EVEN]


def never_reached(kind: str, sizes: Sequence[Expr], radius: Expr) -> bool:
    """Whether a circle of a radius that is known never holds a place where parts of its overlap grow together."""
    if kind == "hollow_arc":
        bend = sizes[0].value
        return radius.value is not None and bend is not None and radius.value * bend <= 1.0
    return kind == "inner_corner" and radius.is_zero


def piece_numbers(pieces: Sequence[ProfilePart]) -> list[Expr]:
    """Of each piece those that :mod:`~eomgen.contact.pair_features` reads."""
    result: list[Expr] = []
    for one in pieces:
        half, bend = (one.half, one.half.graph.zero) if one.kind == "edge" else (one.sizes[1], one.sizes[0])
        result += [*one.origin, *one.along, half, bend]
    return result


def clearance_of_arcs(pieces: Sequence[ProfilePart]) -> float:
    """How deep inside an outline of arcs every point has one nearest place, as far as numbers tell; else infinite.

    It is the least radius of circles that touch the outline from inside and hold none of its points, |w|^2 / (2 w n)
    with the way w between two points and the inward normal n at the first, over points of all arcs.
    """
    numbers = [[x.value for x in (*one.origin, *one.along, *one.sizes[:2])] for one in pieces if one.kind == "arc"]
    if len(numbers) < len(pieces) or any(None in row for row in numbers):
        return math.inf
    x, y, c, s, bend, half = np.array(numbers, dtype=float).T[:, :, None]
    part = (np.arange(_SAMPLES) + 0.5) * 2.0 / _SAMPLES - 1.0
    angle = np.arcsin(np.clip(bend * half, -1.0, 1.0))
    turn = np.where(angle == 0.0, FLAT_CORNER, angle)
    along = half * np.sin(turn * part) / np.sin(turn)
    up = along * np.tan(0.5 * turn * part)
    nx, ny = np.sin(turn * part), -np.cos(turn * part)
    place = np.stack([x + c * along - s * up, y + s * along + c * up]).reshape(2, -1)
    normal = np.stack([c * nx - s * ny, s * nx + c * ny]).reshape(2, -1)
    way = place[:, None, :] - place[:, :, None]
    inward = 2.0 * (way * normal[:, :, None]).sum(axis=0)
    ahead = inward > 0.0
    return INSIDE * float(((way * way).sum(axis=0)[ahead] / inward[ahead]).min(initial=math.inf))


class InnerCornerRound(ProfilePiece):
    """At an inner corner that is farther from the centre than the edges beside it."""

    def share(self, view: View) -> Expr:
        x, y, _ = self._place(view)
        cosine, sine, width, _ = self.sizes
        first, second = part(sine * (x * cosine + y * sine), width), part(sine * (x * cosine - y * sine), width)
        both = view.graph.apply("max", 0.0, first + second - 1.0)  # what the edges have more than one, flat ones too
        return where(view.graph.apply("lt", 0.0, cosine), -both, 0.0)

    def touch(self, view: View) -> Touch:
        x, y, reach = self._place(view)
        square = x * x + y * y
        apart = view.graph.apply("lt", 0.0, square)
        distance = sqrt(where(apart, square, 1.0))
        normal = where(apart, x / distance, 1.0), where(apart, y / distance, 0.0)
        return self._touching(view, where(apart, distance, 0.0), normal, reach)


class HollowArcRound(ProfilePiece):
    """At the far side of a hollow arc of curvature k, seen from beyond its centre.

    It is (1 + q) / k away, q = |(k x, 1 - k y)|.
    """

    def share(self, view: View) -> Expr:
        x, y, _ = self._place(view)
        bend, half, rise, cosine, sine, width = self.sizes[:6]
        left = (x + half) * cosine - (y - rise) * sine
        right = (half - x) * cosine - (y - rise) * sine
        return where(view.graph.apply("lt", 0.0, bend), -part(-left, width) * part(-right, width), 0.0)

    def touch(self, view: View) -> Touch:
        graph = view.graph
        x, y, reach = self._place(view)
        hollow = graph.apply("lt", 0.0, self.sizes[0])
        k = where(hollow, self.sizes[0], 1.0)
        square = k * k * x * x + (k * y - 1.0) * (k * y - 1.0)
        apart = graph.apply("lt", 0.0, square)
        q = sqrt(where(apart, square, 1.0))
        normal = where(apart, k * x / q, 0.0), where(apart, (k * y - 1.0) / q, 1.0)
        return self._touching(view, (1.0 + where(apart, q, 0.0)) / k, normal, reach)


class InsideRound(ProfilePiece):
    """A circle whose centre is deep inside an outline: pushed out to the nearest place of its nearest piece."""

    def share(self, view: View) -> Expr:
        return self.sizes[PIECE + 1]

    def touch(self, view: View) -> Touch:
        graph = view.graph
        x, y, reach = self._place(view)
        px, py, c, s, half, k, corner, deep = self.sizes
        u, v = c * (x - px) + s * (y - py), c * (y - py) - s * (x - px)
        sine = k * half
        rise = half * sine / (1.0 + sqrt(graph.apply("max", 0.0, 1.0 - sine * sine)))
        along, up = u + half, v - rise  # from its first corner
        away = sqrt(where(graph.apply("lt", 0.5, corner), along * along + up * up, 1.0))
        square = k * k * u * u + (1.0 - k * v) * (1.0 - k * v)
        q = sqrt(where(graph.apply("lt", 0.0, square), square, 1.0))
        gap = (2.0 * v - k * (u * u + v * v)) / (1.0 + q)
        at_corner = graph.apply("lt", 0.5, corner)
        nx, ny = where(at_corner, -along / away, -k * u / q), where(at_corner, -up / away, (1.0 - k * v) / q)
        out = vec.times(view.rotation(self.first), (c * nx - s * ny, s * nx + c * ny, graph.zero))
        depth = where(graph.apply("lt", 0.5, deep), self.radius + where(at_corner, away, -gap), -self.radius)
        second = vec.scale(0.5 * depth - self.radius, out)
        return out, depth, vec.add(reach, second), second


# -- corners, curves, sprockets ----------------------------------------------------------------------------------------

# Pieces are those of :mod:`.profiles`, one after the other from left to right, or clockwise about a solid, and
# the corners where two of them turn towards each other.


Pair = tuple[float, float]


def straight_pieces(points: Sequence[Point]) -> list[ProfilePart]:
    """Edges from point to point; the first and the last go on beyond their ends."""
    width = SHARED * length(minus(points[-1], points[0]))
    edges = [minus(b, a) for a, b in itertools.pairwise(points)]
    ways = [unit(one) for one in edges]
    sides = [None, *edges, None]
    last = len(edges) - 1
    result = [
        edge(points[k], one, sides[k], sides[k + 2], width, walls=True, endless=(k == 1, k == last - 1))
        for k, one in enumerate(edges)
    ]
    return result + [inner_corner(points[k], ways[k - 1], ways[k], width) for k in range(1, len(edges))]


def smooth_pieces(points: Sequence[Point]) -> list[ProfilePart]:
    """Two circular arcs of one tangent from point to point (biarcs), and straight lines beyond the ends.

    The tangent at a point is that of the circle through it and its neighbours, so that points of a circle give the
    circle; the arcs are those of equal tangent lengths (Bolton, 1975, Computer-Aided Design 7, 83-89).
    """
    width = SHARED * length(minus(points[-1], points[0]))
    ways = _tangents(points)
    first, last = minus(points[1], points[0]), minus(points[-1], points[-2])
    ray = times(ways[0], length(first))
    result = [edge(minus(points[0], ray), ray, None, ways[0], width)]
    for (a, b), (s, t) in zip(itertools.pairwise(points), itertools.pairwise(ways), strict=True):
        result += biarcs(a, b, s, t, width)
    return beside_hollow_arcs([*result, edge(points[-1], times(ways[-1], length(last)), ways[-1], None, width)])


def _tangents(points: Sequence[Point]) -> list[Point]:
    """Directions of the circles through each point and its neighbours."""
    inner = [tangent(a, b, c) for a, b, c in zip(points, points[1:], points[2:], strict=False)]
    first, last = minus(points[1], points[0]), minus(points[-1], points[-2])
    return [_mirrored(inner[0], first), *inner, _mirrored(inner[-1], last)]


def _mirrored(way: Point, chord: Point) -> Point:
    """The tangent at the other end of a chord of a circle."""
    c = unit(chord)
    along = 2.0 * dot(way, c)
    return along * c[0] - way[0], along * c[1] - way[1]


def straight_ring(points: Sequence[Point]) -> list[ProfilePart]:
    """Edges from point to point, clockwise."""
    width = _width(points)
    edges = [minus(b, a) for a, b in zip(points, [*points[1:], points[0]], strict=True)]
    ways = [unit(one) for one in edges]
    n = len(points)
    result = [edge(points[k], edges[k], edges[k - 1], edges[(k + 1) % n], width, walls=True) for k in range(n)]
    return result + [inner_corner(points[k], ways[k - 1], ways[k], width) for k in range(n)]


def smooth_ring(points: Sequence[Point]) -> list[ProfilePart]:
    """Two circular arcs of one tangent from point to point, clockwise."""
    width, n = _width(points), len(points)
    ways = [tangent(points[k - 1], points[k], points[(k + 1) % n]) for k in range(n)]
    result: list[ProfilePart] = []
    for k in range(n):
        result += biarcs(points[k], points[(k + 1) % n], ways[k], ways[(k + 1) % n], width)
    return beside_hollow_arcs(result)


class Tooth(NamedTuple):
    """A seat of a sprocket on the x axis: where its arc ends on the side of y, its flank, and the corner of its tip."""

    seat_end: Point
    flank: Point
    length: Expr
    tip: Point


def _tooth(teeth: int, pitch: Expr, seat: Expr, tip: Expr, angle: Expr) -> Tooth:
    c, s = cos(0.5 * angle), sin(0.5 * angle)
    x, y = _pitch_radius(teeth, pitch) - seat * c, seat * s
    along = x * s + y * c
    flank = sqrt(along * along + tip * tip - (x * x + y * y)) - along
    return Tooth((x, y), (s, c), flank, (x + flank * s, y + flank * c))


def half_tooth(teeth: int, pitch: Expr, seat: Expr, tip: Expr, angle: Expr) -> Expr:
    """Half of the width of the teeth of a sprocket at their narrowest: at the tip, or between the seats.

    Arcs that reach the line between neighbouring pins are nearest there, and the flanks part from it outwards.
    """
    corner, half = _tooth(teeth, pitch, seat, tip, angle).tip, math.pi / teeth
    at_tip = corner[0] * math.sin(half) - corner[1] * math.cos(half)
    return where(pitch.graph.apply("lt", math.pi - 2.0 * half, angle), 0.5 * pitch - seat, at_tip)


def sprocket_ring(
    teeth: int, pitch: Expr, seat: Expr, tip: Expr, angle: Expr
) -> tuple[list[ProfilePart], list[Point], list[Point]]:
    """A wheel for a chain of pins: its pieces, its outer corners and points of its outline, all clockwise.

    A seat is an arc about the place of a pin on the pitch circle, whose radius is pitch / (2 sin(pi / teeth)); straight
    flanks go on from its ends to the tip circle (ISO 606, with the flank in place of its large arc).  The first seat
    lies on the x axis.

    Parameters
    ----------
    teeth : int
    pitch : Expr
        The straight distance between neighbouring pins (m).
    seat : Expr
        The radius of the seats (m).
    tip : Expr
        The radius of the tip circle (m).
    angle : Expr
        The seating angle, over which the arc of a seat goes (rad).
    """
    graph = pitch.graph
    (x, y), (s, c), flank, end = _tooth(teeth, pitch, seat, tip, angle)
    turns = [(math.cos(2.0 * math.pi * k / teeth), math.sin(2.0 * math.pi * k / teeth)) for k in range(teeth)]
    step = (graph.constant(turns[1][0]), graph.constant(-turns[1][1]))
    low, low_end = (x, -y), (end[0], -end[1])
    tip_edge = minus(end, _turned(low_end, (step[0], -step[1])))  # along the tip before the first flank
    over, down, up = unit(tip_edge), (-s, -c), (s, -c)
    width = SHARED * (teeth * pitch)
    tooth = [
        edge(end, times(down, flank), over, down, width, walls=True),
        arc((x, y), low, down, width),
        edge(low, times(up, flank), up, _turned(over, step), width, walls=True),
        edge(low_end, _turned(tip_edge, step), up, _turned(down, step), width, walls=True),
    ]
    line = [end, (x, y), (_pitch_radius(teeth, pitch) - seat, graph.zero), low, low_end]
    pieces: list[ProfilePart] = []
    places: list[Point] = []
    for a, b in reversed(turns):
        turn = (graph.constant(a), graph.constant(b))
        pieces += [one._replace(origin=_turned(one.origin, turn), along=_turned(one.along, turn)) for one in tooth]
        places += [_turned(point, turn) for point in line]
    tops = [point for k, point in enumerate(places) if k % len(line) in (0, len(line) - 1)]
    return beside_hollow_arcs(pieces), tops, places


def _pitch_radius(teeth: int, pitch: Expr) -> Expr:
    return pitch / (2.0 * math.sin(math.pi / teeth))


def half_gap(points: Sequence[Pair]) -> float:
    """Half of the least distance between edges of a closed outline that are no neighbours."""
    n, least = len(points), math.inf
    edges = [(points[k], points[(k + 1) % n]) for k in range(n)]
    for i, j in itertools.combinations(range(n), 2):
        if j - i in (1, n - 1):
            continue
        for one, (start, end) in ((edges[i], edges[j]), (edges[j], edges[i])):
            least = min(least, *(_away(point, start, end) for point in one))
    if n == 3:  # all are neighbours: the smallest height
        least = min(_away(points[k - 1], *edges[k]) for k in range(3))
    return 0.5 * least


def _away(point: Pair, start: Pair, end: Pair) -> float:
    """The distance of a point from a straight line between two others."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    run = ((point[0] - start[0]) * dx + (point[1] - start[1]) * dy) / (dx * dx + dy * dy)
    run = min(1.0, max(0.0, run))
    return math.hypot(point[0] - start[0] - run * dx, point[1] - start[1] - run * dy)


def _width(points: Sequence[Point]) -> Expr:
    """Over which neighbouring pieces share a circle."""
    around = [length(minus(b, a)) for a, b in zip(points, [*points[1:], points[0]], strict=True)]
    return SHARED * reduce(lambda a, b: a + b, around)


def _turned(point: Point, turn: Point) -> Point:
    """Turned by an angle whose cosine and sine are given."""
    c, s = turn
    return c * point[0] - s * point[1], s * point[0] + c * point[1]
