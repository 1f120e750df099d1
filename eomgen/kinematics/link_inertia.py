"""Stage kinematics: mass, first moment and inertia of a body about its link's origin, and how they move between frames.

Written so that few operations are left: a turn about a coordinate axis touches only what it changes.
"""

from __future__ import annotations

from ..describe.mechanism import Body
from ..frames import Frame
from ..graph import vectors as vec
from ..graph.core import Expr, Graph
from ..graph.rounding_bounds import settled_vector, size_of
from ..graph.spatial import Wrench
from ..graph.tensors import add_matrices, rotate_symmetric, symmetric
from ..graph.vectors import Mat3, Vec3
from ..records import dataclass


@dataclass(frozen=True)
class SpatialInertia:
    """Mass, first moment m c and inertia about the link's origin, in link axes (Featherstone, RBDA, eq. 2.62)."""

    mass: Expr
    moment: Vec3
    inertia: Mat3

    def times(self, angular: Vec3, linear: Vec3) -> Wrench:
        """(moment about the origin, force) of a twist or spatial acceleration: Featherstone, RBDA, eq. 2.63."""
        turn = vec.add(vec.times(self.inertia, angular), vec.cross(self.moment, linear))
        push = vec.sub(vec.scale(self.mass, linear), vec.cross(self.moment, angular))
        return turn, push

    @property
    def is_zero(self) -> bool:
        """Whether all ten entries vanish identically."""
        return all(x.is_zero for x in (self.mass, *self.moment, *(x for row in self.inertia for x in row)))

    def plus(self, other: SpatialInertia) -> SpatialInertia:
        """Both in one link."""
        return SpatialInertia(
            self.mass + other.mass,
            vec.add(self.moment, other.moment),
            symmetric(add_matrices(self.inertia, other.inertia)),
        )

    def turned(self, rotation: Mat3) -> SpatialInertia:
        """In the axes that ``rotation`` takes its axes to."""
        return SpatialInertia(self.mass, vec.times(rotation, self.moment), rotate_symmetric(rotation, self.inertia))

    def shifted(self, p: Vec3) -> SpatialInertia:
        """About the point that sees its origin at p (Featherstone, RBDA, eq. 2.66)."""
        h, inertia = self.moment, self.inertia
        moved = vec.add(h, vec.scale(self.mass, p))
        both = vec.add(h, moved)
        x, y, z = (p[k] * both[k] for k in range(3))  # 2 (p . h) 1 + m p^2 1, and less p h^T + h p^T + m p p^T
        diagonal = (inertia[0][0] + (y + z), inertia[1][1] + (x + z), inertia[2][2] + (x + y))
        xy, xz, yz = (inertia[i][j] - (p[i] * moved[j] + h[i] * p[j]) for i, j in ((0, 1), (0, 2), (1, 2)))
        rows = ((diagonal[0], xy, xz), (xy, diagonal[1], yz), (xz, yz, diagonal[2]))
        return SpatialInertia(self.mass, moved, rows)


def no_inertia(graph: Graph) -> SpatialInertia:
    """That of nothing."""
    o = vec.zero(graph)
    return SpatialInertia(graph.zero, o, (o, o, o))


def body_inertia(body: Body, frame: Frame) -> SpatialInertia:
    """The spatial inertia of a body in its link frame.

    First moment and inertia about the body's origin are taken as they are where the body has them, so that their
    symbols stay the parameters of the equations.
    """
    back = vec.transpose(frame.rotation)
    if body.moment is not None and body.inertia_origin is not None:
        about_body = SpatialInertia(body.mass, body.moment, symmetric(body.inertia_origin))
        return about_body.shifted(vec.neg(frame.position)).turned(back)
    inertia = settled_matrix(rotate_symmetric(back, symmetric(body.inertia)), body.inertia)
    return SpatialInertia(body.mass, vec.zero(body.mass.graph), inertia).shifted(place_point(frame, body.com))


def place_point(frame: Frame, point: Vec3) -> Vec3:
    """A point of a body, in the frame: numbers that cancel are exactly 0."""
    moved = vec.transpose_times(frame.rotation, vec.sub(point, frame.position))
    return settled_vector(moved, size_of(point, frame.position))


def settled_matrix(turned: Mat3, before: Mat3) -> Mat3:
    """A matrix that was turned, its constant entries exactly 0 where they are rounding of those before."""
    size = max(size_of(row) for row in before)
    return (settled_vector(turned[0], size), settled_vector(turned[1], size), settled_vector(turned[2], size))
