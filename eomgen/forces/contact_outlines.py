"""Force elements, contact with profiles and outlines in the plane: corners, a smooth curve, a sprocket -> their pieces.

Pieces are those of :mod:`.contact_profiles`, one after the other from left to right, or clockwise about a solid, and
the corners where two of them turn towards each other.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

from ..base.limits.contacts import SHARED
from ..graph.core import Expr, cos, sin, sqrt
from .branches import where
from .contact_insides import notch
from .contact_profiles import (
    Point,
    ProfilePart,
    arc,
    beside_bowls,
    biarcs,
    dot,
    edge,
    length,
    minus,
    tangent,
    times,
    unit,
)

Pair = tuple[float, float]


def straight_pieces(points: Sequence[Point]) -> list[ProfilePart]:
    """Edges from point to point; the first and the last go on beyond their ends."""
    width = SHARED * length(minus(points[-1], points[0]))
    edges = [minus(b, a) for a, b in itertools.pairwise(points)]
    ways = [unit(one) for one in edges]
    sides = [None, *edges, None]
    last = len(edges) - 1
    found = [
        edge(points[k], one, sides[k], sides[k + 2], width, walls=True, endless=(k == 1, k == last - 1))
        for k, one in enumerate(edges)
    ]
    return found + [notch(points[k], ways[k - 1], ways[k], width) for k in range(1, len(edges))]


def smooth_pieces(points: Sequence[Point]) -> list[ProfilePart]:
    """Two circular arcs of one tangent from point to point (biarcs), and straight lines beyond the ends.

    The tangent at a point is that of the circle through it and its neighbours, so that points of a circle give the
    circle; the arcs are those of equal tangent lengths (Bolton, 1975, Computer-Aided Design 7, 83-89).
    """
    width = SHARED * length(minus(points[-1], points[0]))
    ways = _tangents(points)
    first, last = minus(points[1], points[0]), minus(points[-1], points[-2])
    ray = times(ways[0], length(first))
    found = [edge(minus(points[0], ray), ray, None, ways[0], width)]
    for (a, b), (s, t) in zip(itertools.pairwise(points), itertools.pairwise(ways), strict=True):
        found += biarcs(a, b, s, t, width)
    return beside_bowls([*found, edge(points[-1], times(ways[-1], length(last)), ways[-1], None, width)])


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
    found = [edge(points[k], edges[k], edges[k - 1], edges[(k + 1) % n], width, walls=True) for k in range(n)]
    return found + [notch(points[k], ways[k - 1], ways[k], width) for k in range(n)]


def smooth_ring(points: Sequence[Point]) -> list[ProfilePart]:
    """Two circular arcs of one tangent from point to point, clockwise."""
    width, n = _width(points), len(points)
    ways = [tangent(points[k - 1], points[k], points[(k + 1) % n]) for k in range(n)]
    found: list[ProfilePart] = []
    for k in range(n):
        found += biarcs(points[k], points[(k + 1) % n], ways[k], ways[(k + 1) % n], width)
    return beside_bowls(found)


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
    across = minus(end, _turned(low_end, (step[0], -step[1])))  # along the tip before the first flank
    over, down, up = unit(across), (-s, -c), (s, -c)
    width = SHARED * (teeth * pitch)
    tooth = [
        edge(end, times(down, flank), over, down, width, walls=True),
        arc((x, y), low, down, width),
        edge(low, times(up, flank), up, _turned(over, step), width, walls=True),
        edge(low_end, _turned(across, step), up, _turned(down, step), width, walls=True),
    ]
    line = [end, (x, y), (_pitch_radius(teeth, pitch) - seat, graph.zero), low, low_end]
    pieces: list[ProfilePart] = []
    places: list[Point] = []
    for a, b in reversed(turns):
        turn = (graph.constant(a), graph.constant(b))
        pieces += [one._replace(origin=_turned(one.origin, turn), along=_turned(one.along, turn)) for one in tooth]
        places += [_turned(point, turn) for point in line]
    tops = [point for k, point in enumerate(places) if k % len(line) in (0, len(line) - 1)]
    return beside_bowls(pieces), tops, places


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
