"""Force elements, contact with closed outlines: where parts of the overlap grow together, and what is deep inside.

The overlap of a circle of radius R about c with the solid S has the energy

    V(c) = integral of E'(R - r) n(r) over r from 0 to R, n(r) the number of separate parts of S within r of c,

and E(R + d) - E(R) more where c is d inside.  A part begins at each place of the outline that is nearest to c among
those beside it, where it adds E(R - r); two grow together at each that is farthest, where -E(R - r) is added.  So the
energy is continuous: where a place that is nearest meets one that is farthest both have the same r, and the number of
parts within r of c changes with c as continuously as distances do (Cohen-Steiner, Edelsbrunner and Harer, Stability of
persistence diagrams, 2007, of dimension 0).  Forces are its slopes.

Pieces of an outline add the parts (:mod:`.contact_profiles`).  Here are the places where they grow together, inner
corners and far sides of hollow arcs, which act back with the elastic part of the law alone, and the nearest place for
centres that are deeper inside than pieces tell by themselves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..base.limits.contacts import EVEN, FLAT_CORNER, ROOM
from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..numeric.outline_pieces import PIECE
from ..records import dataclass
from .branches import where
from .contact import Touch
from .contact_profiles import Point, ProfilePart, ProfilePiece, dot, part, unit
from .force import View

_SAMPLES = 12  #: points of an arc at which the room inside is measured


def notch(corner: Point, before: Point, after: Point, width: Expr) -> ProfilePart:
    """The inner corner between two edges of given directions; its x axis points out of the solid.

    Sizes: cosine and sine of half of the angle between the edges.
    """
    out = unit((-before[1] - after[1], before[0] + after[0]))
    cosine, sine = dot(out, after), out[0] * after[1] - out[1] * after[0]
    return ProfilePart("notch", corner, out, (cosine, -sine, width), width.graph.zero, False)


def bowls(pieces: Sequence[ProfilePart]) -> list[ProfilePart]:
    """The hollow arcs among some pieces, as far as numbers tell."""
    arcs = [one for one in pieces if one.kind == "arc"]
    return [one._replace(kind="bowl") for one in arcs if one.sizes[0].value is None or one.sizes[0].value > 0.0]


def notches(pieces: Sequence[ProfilePart]) -> list[ProfilePart]:
    """The inner corners among some corners, as far as numbers tell."""
    found = [one for one in pieces if one.kind == "notch"]
    return [one for one in found if one.sizes[0].value is None or one.sizes[0].value > EVEN]


def never_reached(kind: str, sizes: Sequence[Expr], radius: Expr) -> bool:
    """Whether a circle of a radius that is known never holds a place where parts of its overlap grow together."""
    if kind == "bowl":
        bend = sizes[0].value
        return radius.value is not None and bend is not None and radius.value * bend <= 1.0
    return kind == "notch" and radius.is_zero


def piece_numbers(pieces: Sequence[ProfilePart]) -> list[Expr]:
    """Of each piece those that :mod:`~eomgen.numeric.outline_pieces` reads."""
    found: list[Expr] = []
    for one in pieces:
        half, bend = (one.half, one.half.graph.zero) if one.kind == "edge" else (one.sizes[1], one.sizes[0])
        found += [*one.origin, *one.along, half, bend]
    return found


def told_by_arcs(pieces: Sequence[ProfilePart]) -> float:
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
    return ROOM * float(((way * way).sum(axis=0)[ahead] / inward[ahead]).min(initial=math.inf))


class NotchRound(ProfilePiece):
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


class BowlRound(ProfilePiece):
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


@dataclass(frozen=True)
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
