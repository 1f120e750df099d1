"""Force elements, contact: circles and spheres on circles, segments and polygons -> where they touch."""

from __future__ import annotations

from ..frames import Marker
from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Mat3, Vec3
from ..numeric.polygon_edges import EDGE
from ..records import dataclass
from .branches import where
from .contact import Contact, SphereSphere, Touch
from .force import View
from .normal_laws import NormalLaw


def direction(reach: Vec3, otherwise: Vec3) -> tuple[Vec3, Expr]:
    """The unit vector along another and its length; ``otherwise`` where that is 0, so that coincident centres part."""
    square = vec.dot(reach, reach)
    apart = square.graph.apply("lt", 0.0, square)
    length = sqrt(where(apart, square, 1.0))
    x, y, z = (where(apart, a / length, b) for a, b in zip(reach, otherwise, strict=True))
    return (x, y, z), where(apart, length, 0.0)


def seen_from(contact: Contact, view: View) -> tuple[Vec3, Mat3, Vec3]:
    """From the first marker to the second in ground axes, the rotation of the first, and the same in its axes."""
    R = view.rotation(contact.first)
    reach = vec.sub(view.position(contact.second), view.position(contact.first))
    return reach, R, vec.transpose_times(R, reach)


def along_axis(view: View, marker: Marker, k: int) -> Vec3:
    """One of the axes of a marker."""
    return vec.transpose(view.rotation(marker))[k]


def settled(view: View, x: Expr) -> Expr:
    """A number to which iterations came, before the last of Newton's steps.

    At a solution the derivative of that step does not depend on where it began, so that the iterations before it need
    none: a view of pairs puts a symbol in the place of the number until derivatives are made.
    """
    keep = getattr(view, "settled", None)
    return x if keep is None else keep(x)


@dataclass(frozen=True)
class RoundRound(SphereSphere):
    """Two circles or spheres; where their centres coincide the second is pushed along x of the first marker."""

    def touch(self, view: View) -> Touch:
        reach = vec.sub(view.position(self.second), view.position(self.first))
        normal, distance = direction(reach, vec.transpose(view.rotation(self.first))[0])
        depth = self.radii[0] + self.radii[1] - distance
        first = vec.scale(self.radii[0] - 0.5 * depth, normal)
        return normal, depth, first, vec.scale(0.5 * depth - self.radii[1], normal)


@dataclass(frozen=True)
class SegmentRound(Contact):
    """A circle or sphere about the second marker on a segment along x of the first, which has a radius of its own.

    A centre on the segment is pushed along y of the first marker.
    """

    half: Expr
    radii: tuple[Expr, Expr]

    def touch(self, view: View) -> Touch:
        graph, along = view.graph, vec.transpose(view.rotation(self.first))[0]
        reach = vec.sub(view.position(self.second), view.position(self.first))
        place = graph.apply("max", -self.half, graph.apply("min", self.half, vec.dot(along, reach)))
        across = vec.sub(reach, vec.scale(place, along))
        normal, distance = direction(across, vec.transpose(view.rotation(self.first))[1])
        depth = self.radii[0] + self.radii[1] - distance
        first = vec.add(vec.scale(place, along), vec.scale(self.radii[0] - 0.5 * depth, normal))
        return normal, depth, first, vec.scale(0.5 * depth - self.radii[1], normal)


@dataclass(frozen=True)
class PolygonRound(Contact):
    """A circle about the second marker on a convex polygon in the x-y plane of the first.

    Of a centre outside the nearest point of the outline counts, of one inside the edge that is nearest; the edge in
    whose direction the centre is farthest holds both (Ericson, Real-Time Collision Detection, 2005, section 5.1).
    """

    edges: tuple[Expr, ...]
    radius: Expr

    def touch(self, view: View) -> Touch:
        graph, R = view.graph, view.rotation(self.first)
        reach = vec.sub(view.position(self.second), view.position(self.first))
        x, y, _ = vec.transpose_times(R, reach)
        best: tuple[Expr, ...] | None = None
        for k in range(0, len(self.edges), EDGE):
            px, py, nx, ny, length = self.edges[k : k + EDGE]
            rise = nx * (x - px) + ny * (y - py)
            mine = (rise, px, py, nx, ny, length)
            if best is None:
                best = mine
            else:
                higher = graph.apply("lt", best[0], rise)
                best = tuple(where(higher, new, old) for new, old in zip(mine, best, strict=True))
        assert best is not None
        rise, px, py, nx, ny, length = best
        run = ny * (px - x) + nx * (y - py)  # along the edge (-ny, nx)
        run = graph.apply("max", 0.0, graph.apply("min", length, run))
        ax, ay = x - px + run * ny, y - py - run * nx
        outside = graph.apply("lt", 0.0, rise)
        distance = sqrt(where(outside, ax * ax + ay * ay, 1.0))
        gap = where(outside, distance, rise)
        nx, ny = where(outside, ax / distance, nx), where(outside, ay / distance, ny)
        normal = vec.times(R, (nx, ny, graph.zero))
        depth = self.radius - gap
        second = vec.scale(0.5 * depth - self.radius, normal)
        return normal, depth, vec.add(reach, second), second


@dataclass(frozen=True)
class AtHeight(Contact):
    """Shapes of the plane that touch in the plane of the first: the point of contact lies at the height of the second.

    So both bodies feel the force at one place, and its power is that of the depth, whichever way the bodies tilt.
    """

    flat: Contact
    height: Vec3

    def touch(self, view: View) -> Touch:
        normal, depth, first, second = self.flat.touch(view)
        return normal, depth, vec.add(first, self.height), second

    def nearness(self, view: View) -> tuple[Vec3, Expr]:
        return self.flat.nearness(view)

    def share(self, view: View) -> Expr | None:
        return self.flat.share(view)

    def grip(self, view: View) -> Expr | None:
        return self.flat.grip(view)

    def law_here(self, view: View) -> NormalLaw:
        return self.flat.law_here(view)

    def couple(self, view: View) -> Vec3 | None:
        return self.flat.couple(view)
