"""Force elements, contact of shapes in space: rods, ellipsoids on a plane, spheres on ellipsoids and cuboids."""

from __future__ import annotations

from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Vec3
from ..limits.contacts import FOCAL, NEAREST, PARALLEL
from ..records import dataclass
from .branches import where
from .contact import Contact, Touch
from .contact_rounds import direction
from .force import View


@dataclass(frozen=True)
class RodRod(Contact):
    """Two segments along x of the markers, each with a radius: contact where they are nearest.

    The nearest points are those of Ericson, Real-Time Collision Detection, 2005, section 5.1.9; of parallel segments
    one of the nearest pairs.  Undefined where the segments cross.
    """

    halves: tuple[Expr, Expr]
    radii: tuple[Expr, Expr]

    def touch(self, view: View) -> Touch:
        graph = view.graph
        a, b = (vec.transpose(view.rotation(marker))[0] for marker in (self.first, self.second))
        reach = vec.sub(view.position(self.second), view.position(self.first))

        def within(x: Expr, half: Expr) -> Expr:
            return graph.apply("max", -half, graph.apply("min", half, x))

        e, c, f = vec.dot(a, b), vec.dot(a, reach), vec.dot(b, reach)
        cross = vec.cross(a, b)
        square = vec.dot(cross, cross)
        skew = graph.apply("lt", PARALLEL, square)
        s = where(skew, (c - e * f) / where(skew, square, 1.0), 0.0)
        t = within(e * within(s, self.halves[0]) - f, self.halves[1])
        s = within(c + e * t, self.halves[0])
        across = vec.add(reach, vec.sub(vec.scale(t, b), vec.scale(s, a)))
        distance = sqrt(vec.dot(across, across))
        normal: Vec3 = (across[0] / distance, across[1] / distance, across[2] / distance)
        depth = self.radii[0] + self.radii[1] - distance
        first = vec.add(vec.scale(s, a), vec.scale(self.radii[0] - 0.5 * depth, normal))
        return normal, depth, first, vec.add(vec.scale(t, b), vec.scale(0.5 * depth - self.radii[1], normal))


@dataclass(frozen=True)
class EllipsoidPlane(Contact):
    """An ellipsoid about the second marker, half axes along its x, y, z, on the plane through the first.

    Its lowest point is -(a^2 n_x, b^2 n_y, c^2 n_z) / w, w = sqrt(a^2 n_x^2 + b^2 n_y^2 + c^2 n_z^2), of the plane's
    normal n in the ellipsoid's axes.
    """

    axes: tuple[Expr, Expr, Expr]

    def touch(self, view: View) -> Touch:
        R = view.rotation(self.second)
        normal = vec.transpose(view.rotation(self.first))[2]
        reach = vec.sub(view.position(self.second), view.position(self.first))
        n = vec.transpose_times(R, normal)
        x, y, z = (a * a * k for a, k in zip(self.axes, n, strict=True))
        w = sqrt(vec.dot((x, y, z), n))
        depth = w - vec.dot(normal, reach)
        lowest = vec.times(R, (-x / w, -y / w, -z / w))
        second = vec.add(lowest, vec.scale(0.5 * depth, normal))
        return normal, depth, vec.add(reach, second), second


@dataclass(frozen=True)
class BlockRound(Contact):
    """A sphere about the second marker on a cuboid about the first, half lengths along its x, y, z.

    A centre outside is pushed away from the nearest point of the cuboid, one inside out through the nearest face.
    """

    halves: tuple[Expr, Expr, Expr]
    radius: Expr

    def touch(self, view: View) -> Touch:
        graph, R = view.graph, view.rotation(self.first)
        reach = vec.sub(view.position(self.second), view.position(self.first))
        place = vec.transpose_times(R, reach)
        x, y, z = (
            a - graph.apply("max", -h, graph.apply("min", h, a)) for a, h in zip(place, self.halves, strict=True)
        )
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
        gap = where(graph.apply("lt", 0.0, distance), distance, rise)
        out = vec.times(R, normal)
        depth = self.radius - gap
        second = vec.scale(0.5 * depth - self.radius, out)
        return out, depth, vec.add(reach, second), second


@dataclass(frozen=True)
class EllipsoidRound(Contact):
    """A sphere about the second marker on an ellipsoid about the first, half axes along its x, y, z.

    The nearest point to p is (a^2 p_x / (t + a^2), ...), where S(t), the sum of (a p_x / (t + a^2))^2, is 1 (Eberly,
    Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid, 2013); t times (p_x / (t + a^2), ...) leads
    from it to p.  Newton's method for 1 / sqrt(S) = 1, which is nearly linear (More and Sorensen, SIAM J. Sci. Stat.
    Comput. 4, 1983, 553-572), comes to t from the side on which S > 1, where the largest of the three squares is 1, or
    t = 0 of a centre outside.  Undefined at the centre of the ellipsoid.
    """

    axes: tuple[Expr, Expr, Expr]
    radius: Expr

    def touch(self, view: View) -> Touch:
        graph, R = view.graph, view.rotation(self.first)
        reach = vec.sub(view.position(self.second), view.position(self.first))
        place = vec.transpose_times(R, reach)
        squares = [a * a for a in self.axes]
        scaled = [a * p for a, p in zip(self.axes, place, strict=True)]
        least = graph.apply("min", squares[0], graph.apply("min", squares[1], squares[2]))
        begin = -(1.0 - FOCAL) * least
        for s, q in zip(scaled, squares, strict=True):
            begin = graph.apply("max", begin, graph.apply("max", s, -s) - q)
        rises = [p / a for p, a in zip(place, self.axes, strict=True)]
        outside = graph.apply("lt", 1.0, rises[0] * rises[0] + rises[1] * rises[1] + rises[2] * rises[2])
        begin = where(outside, graph.apply("max", begin, 0.0), begin)
        t = begin
        for _ in range(NEAREST):
            parts = [s / (t + q) for s, q in zip(scaled, squares, strict=True)]
            total = parts[0] * parts[0] + parts[1] * parts[1] + parts[2] * parts[2]
            slope = sum((s * s / (t + q) for s, q in zip(parts, squares, strict=True)), graph.zero)
            t = graph.apply("max", begin, t + total * (sqrt(total) - 1.0) / slope)
        x, y, z = (p / (t + q) for p, q in zip(place, squares, strict=True))
        size = sqrt(x * x + y * y + z * z)
        out = vec.times(R, (x / size, y / size, z / size))
        depth = self.radius - t * size
        second = vec.scale(0.5 * depth - self.radius, out)
        return out, depth, vec.add(reach, second), second
