"""Force elements, contact of shapes in space: rods of a radius on each other, ellipsoids on a plane."""

from __future__ import annotations

from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Vec3
from ..limits.contacts import PARALLEL
from ..records import dataclass
from .branches import where
from .contact import Contact, Touch
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
