"""Contact of circles, spheres and rods with round shapes, polygons and cuboids -> where they touch."""

from __future__ import annotations

import itertools
from abc import abstractmethod
from collections.abc import Sequence
from functools import partial, reduce
from operator import add

from ..elements.forces.force import View, where
from ..elements.forces.normal_laws import NormalLaw
from ..elements.frames import Marker
from ..expr import vectors as vec
from ..expr.core import Expr, sqrt
from ..expr.differentiate import gradient
from ..expr.vectors import Mat3, Vec3
from .limits import PARALLEL
from .pair_features import EDGE
from .point import Contact, Touch
from .states import BLOCK, CORE

# -- circles and spheres -----------------------------------------------------------------------------------------------


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


def converged(view: View, x: Expr) -> Expr:
    """A number to which iterations came, before the last of Newton's steps.

    At a solution the derivative of that step does not depend on where it began, so that the iterations before it need
    none: a view of pairs puts a symbol in the place of the number until derivatives are made.
    """
    keep = getattr(view, "converged", None)
    return x if keep is None else keep(x)


class CoreRound(Contact):
    """A circle or sphere about the second marker on a core about the first, both with a radius around them.

    The core is a point, a segment along x or a cuboid, by none, one or three half lengths along x, y, z.  A centre
    outside is pushed away from the nearest point of the core, one inside a cuboid out through the nearest face, one on
    a segment along y, one at a point along x.
    """

    halves: tuple[Expr, ...]
    radii: tuple[Expr, Expr]

    def touch(self, view: View) -> Touch:
        reach, R, place = seen_from(self, view)
        if len(self.halves) == 3:
            normal, gap = self._beside_cuboid(place)
            normal = vec.times(R, normal)
        else:
            axes, lateral = vec.transpose(R), reach
            for half, along, x in zip(self.halves, axes, place, strict=False):
                lateral = vec.sub(lateral, vec.scale(_within(x, half), along))
            normal, gap = direction(lateral, axes[len(self.halves)])
        depth = self.radii[0] + self.radii[1] - gap
        second = vec.scale(0.5 * depth - self.radii[1], normal)
        return normal, depth, vec.add(reach, second), second

    def _beside_cuboid(self, place: Vec3) -> tuple[Vec3, Expr]:
        """The normal in the cuboid's axes and the gap."""
        graph = place[0].graph
        x, y, z = (a - _within(a, h) for a, h in zip(place, self.halves, strict=True))
        beyond = [graph.apply("max", a, -a) - h for a, h in zip(place, self.halves, strict=True)]
        face: Vec3 = (graph.one, graph.zero, graph.zero)
        rise = beyond[0]
        for k in (1, 2):
            higher = graph.apply("lt", rise, beyond[k])
            rise = where(higher, beyond[k], rise)
            a, b, c = (where(higher, 1.0 if k == n else 0.0, face[n]) for n in range(3))
            face = (a, b, c)
        a, b, c = (where(graph.apply("lt", p, 0.0), -n, n) for p, n in zip(place, face, strict=True))
        normal, distance = direction((x, y, z), (a, b, c))
        return normal, where(graph.apply("lt", 0.0, distance), distance, rise)


def _within(x: Expr, half: Expr) -> Expr:
    """A place between -half and half that is nearest to x."""
    return x.graph.apply("max", -half, x.graph.apply("min", half, x))


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

    def deepest(self, view: View) -> Expr | None:
        return self.flat.deepest(view)

    def law_here(self, view: View) -> NormalLaw:
        return self.flat.law_here(view)

    def couple(self, view: View) -> Vec3 | None:
        return self.flat.couple(view)


# -- shapes in space ---------------------------------------------------------------------------------------------------


class RodRod(Contact):
    """Two segments along x of the markers, each with a radius: contact where they are nearest.

    The nearest points are those of Ericson, Real-Time Collision Detection, 2005, section 5.1.9; of parallel segments
    one of the nearest pairs.  Undefined where the segments cross.
    """

    halves: tuple[Expr, Expr]
    radii: tuple[Expr, Expr]

    def touch(self, view: View) -> Touch:
        a, b, s, t, lateral = self._nearest(view)
        distance = sqrt(vec.dot(lateral, lateral))
        normal: Vec3 = (lateral[0] / distance, lateral[1] / distance, lateral[2] / distance)
        depth = self.radii[0] + self.radii[1] - distance
        first = vec.add(vec.scale(s, a), vec.scale(self.radii[0] - 0.5 * depth, normal))
        return normal, depth, first, vec.add(vec.scale(t, b), vec.scale(0.5 * depth - self.radii[1], normal))

    def _nearest(self, view: View) -> tuple[Vec3, Vec3, Expr, Expr, Vec3]:
        """Directions of both, how far along them the nearest points are, and from the first of these to the second."""
        graph = view.graph
        a, b = (vec.transpose(view.rotation(marker))[0] for marker in (self.first, self.second))
        reach = vec.sub(view.position(self.second), view.position(self.first))

        e, c, f = vec.dot(a, b), vec.dot(a, reach), vec.dot(b, reach)
        cross = vec.cross(a, b)
        square = vec.dot(cross, cross)
        skew = graph.apply("lt", PARALLEL, square)
        s = where(skew, (c - e * f) / where(skew, square, 1.0), 0.0)
        t = _within(e * _within(s, self.halves[0]) - f, self.halves[1])
        s = _within(c + e * t, self.halves[0])
        return a, b, s, t, vec.add(reach, vec.sub(vec.scale(t, b), vec.scale(s, a)))


#: A class, a place, the order of axes of which the first lies along it, sizes, the radius of a bound, a number.
CuboidPart = tuple[str, Vec3, tuple[int, int, int], tuple[Expr, ...], Expr, int]


def cuboid_parts(size: Sequence[Expr], edge: Expr) -> list[CuboidPart]:
    """A cuboid's parts: the whole and its corners, and the same with rounded edges.

    Cuboids meet each other as spheropolyhedra, which are solids within a layer of the thickness of the radius of edges:
    corners meet the other's solid, edges its edges, and each such pair has an energy that depends on its distance alone
    (Galindo-Torres and Pedroza, Phys. Rev. E 81, 2010, 061303; Alonso-Marroquin, Europhys. Lett. 83, 2008, 14001).
    """
    halves, zero = [0.5 * one for one in size], edge.graph.zero
    inner = [half - edge for half in halves]
    x, y, z = inner
    plain = (0, 1, 2)
    reach = sqrt(halves[0] * halves[0] + halves[1] * halves[1] + halves[2] * halves[2])
    result: list[CuboidPart] = [(BLOCK, (zero, zero, zero), plain, (*halves, zero), reach, 0)]
    ways = list(itertools.product((-1.0, 1.0), repeat=3))
    for n, (i, j, k) in enumerate(ways):
        result.append(("end", (i * halves[0], j * halves[1], k * halves[2]), plain, (zero,), zero, n))
    result.append((CORE, (zero, zero, zero), plain, (x, y, z, edge), reach, 0))
    for n, (i, j, k) in enumerate(ways):
        result.append(("rounded_corner", (i * x, j * y, k * z), plain, (edge, i * x, j * y, k * z), edge, n))
    for k in range(3):
        for n, (i, j) in enumerate(itertools.product((-1.0, 1.0), repeat=2)):
            place = [zero, i * inner[(k + 1) % 3], j * inner[(k + 2) % 3]]
            order = (k, (k + 1) % 3, (k + 2) % 3)
            at = (place[-k % 3], place[(1 - k) % 3], place[(2 - k) % 3])
            result.append(("rounded_edge", at, order, (inner[k], edge, *place[1:]), inner[k] + edge, 4 * k + n))
    return result


def _rising(x: Expr) -> Expr:
    """From 0 at 0 to 1 at 1, with slopes of 0 there."""
    within = x.graph.apply("max", 0.0, x.graph.apply("min", 1.0, x))
    return within * within * (3.0 - 2.0 * within)


class SharedEnergy(Contact):
    """A contact of bodies with corners, whose energy is a part of that of the law; the force is its slope."""

    @abstractmethod
    def share(self, view: View) -> Expr: ...

    def _change(self, view: View) -> tuple[Vec3, Vec3]:
        """How the share changes as the second body moves along axes of the ground, and as it turns about them."""
        columns = vec.transpose(view.rotation(self.second))
        x, y, z, *slopes = gradient(self.share(view), [*view.position(self.second), *itertools.chain(*columns)])
        by_columns = [(slopes[k], slopes[k + 1], slopes[k + 2]) for k in (0, 3, 6)]
        return (x, y, z), reduce(vec.add, map(vec.cross, columns, by_columns))

    def aside(self, view: View) -> Vec3:
        energy = self.law_here(view).energy(self.touch(view)[1])
        return vec.scale(-energy, self._change(view)[0])

    def couple(self, view: View) -> Vec3:
        _, depth, _, arm = self.touch(view)
        about = vec.scale(-self.law_here(view).energy(depth), self._change(view)[1])
        return vec.sub(about, vec.cross(arm, self.aside(view)))


EQUAL = 0.1  #: part of the depth over which an end becomes as deep as what is between both


def beside_ends(
    view: View, rod: tuple[Marker, Expr], solid: tuple[Marker, Vec3, Vec3], depth: Expr, radius: Expr
) -> Expr:
    """The part of the law of a rod's middle at depth d that counts beside its ends, which touch the solid themselves.

    It is the product of 1 - (e / d)^2, not below 0, of both ends, with their depths e in the cuboid, given by the place
    of a marker from its centre and half lengths: with that of an end the energy is the law's at the end and far from
    it, and nowhere more than that of the deeper, of laws that are linear or stiffen.  Each end that touches counts.
    Over the last part EQUAL of the depth it falls to 0 with a slope of 0, so that the force does not jump at e = d.
    """
    graph, (marker, half), (other, centre, halves) = view.graph, rod, solid
    larger = partial(graph.apply, "max")
    reach, R = vec.sub(view.position(marker), view.position(other)), view.rotation(other)
    middle = vec.add(centre, vec.transpose_times(R, reach))
    along = vec.transpose_times(R, along_axis(view, marker, 0))

    def gap(end: Expr) -> Expr:
        place = vec.add(middle, vec.scale(end, along))
        out = [larger(x, -x) - h for x, h in zip(place, halves, strict=True)]
        square = reduce(add, (larger(0.0, x) * larger(0.0, x) for x in out))
        apart = graph.apply("lt", 0.0, square)
        return where(apart, sqrt(where(apart, square, 1.0)), reduce(larger, out))

    def beside(end: Expr) -> Expr:
        part = graph.apply("min", 1.0, larger(0.0, radius - gap(end)) / where(deep, depth, 1.0))
        near = larger(0.0, (part - (1.0 - EQUAL)) / EQUAL)
        return 1.0 - part * part - 2.0 * EQUAL * (near * near * (1.0 - near))

    deep = graph.apply("lt", 0.0, depth)
    return where(deep, beside(half) * beside(-half), 1.0)


class EdgeEdge(SharedEnergy, RodRod):
    """An edge of a cuboid on another: where they cross, not where one ends, as corners touch there.

    The energy is that of the law times the square of the sine of their angle, and times parts that go to 0 towards both
    ends of both within their radii.
    """

    def share(self, view: View) -> Expr:
        return self._share(view, 2)

    def _share(self, view: View, ending: int) -> Expr:
        a, b, s, t, _ = self._nearest(view)
        cross = vec.cross(a, b)
        part = vec.dot(cross, cross)
        for x, half, radius in list(zip((s, t), self.halves, self.radii, strict=True))[:ending]:
            part = part * _rising((half - view.graph.apply("max", x, -x)) / radius)
        return part


class EdgeRod(EdgeEdge):
    """An edge of a cuboid on a rod, whose ends touch the cuboid by themselves."""

    centre: tuple[Expr, Expr]  #: from the cuboid's to the edge's, along y and z of the edge

    def share(self, view: View) -> Expr:
        y, z = self.centre
        halves = (self.halves[0], view.graph.apply("max", y, -y), view.graph.apply("max", z, -z))
        solid, radius = (self.first, (view.graph.zero, y, z), halves), self.radii[0] + self.radii[1]
        beside = beside_ends(view, (self.second, self.halves[1]), solid, self.touch(view)[1], radius)
        return self._share(view, 1) * beside


class RodCorner(SharedEnergy, CoreRound):
    """A corner of a cuboid on a rod, whose ends touch the cuboid by themselves."""

    corner: Vec3  #: from the cuboid's centre

    def share(self, view: View) -> Expr:
        x, y, z = (view.graph.apply("max", k, -k) for k in self.corner)
        solid, radius = (self.second, self.corner, (x, y, z)), self.radii[0] + self.radii[1]
        return beside_ends(view, (self.first, self.halves[0]), solid, self.touch(view)[1], radius)
