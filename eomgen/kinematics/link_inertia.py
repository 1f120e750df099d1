"""Stage kinematics: mass, first moment and inertia of a body about its link's origin, and how they move between frames.

Written so that few operations are left: a turn about a coordinate axis touches only what it changes.
"""

from __future__ import annotations

from ..describe.mechanism import Body
from ..frames import Frame
from ..graph import vectors as vec
from ..graph.core import Expr, Graph
from ..graph.rounding_bounds import settled_vector, size_of
from ..graph.vectors import Mat3, Vec3
from ..records import dataclass

Wrench = tuple[Vec3, Vec3]  # moment about the origin, force


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


def symmetric(a: Mat3) -> Mat3:
    """The upper triangle, mirrored."""
    return (a[0], (a[0][1], a[1][1], a[1][2]), (a[0][2], a[1][2], a[2][2]))


def add_matrices(a: Mat3, b: Mat3) -> Mat3:
    """a + b"""
    return (vec.add(a[0], b[0]), vec.add(a[1], b[1]), vec.add(a[2], b[2]))


def subtract_matrices(a: Mat3, b: Mat3) -> Mat3:
    """a - b"""
    return (vec.sub(a[0], b[0]), vec.sub(a[1], b[1]), vec.sub(a[2], b[2]))


def skew(a: Vec3) -> Mat3:
    """[a]: [a] b = a x b"""
    o = a[0].graph.zero
    return ((o, -a[2], a[1]), (a[2], o, -a[0]), (-a[1], a[0], o))


def axis_of(rotation: Mat3) -> int | None:
    """The coordinate axis that a rotation turns about by an angle; None for other rotations and quarter turns."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        alone = all(rotation[k][m].is_zero and rotation[m][k].is_zero for m in (i, j))
        if alone and rotation[k][k].value == 1.0:
            c, s = rotation[i][i], rotation[j][i]
            if c.is_zero or s.is_zero or c != rotation[j][j] or rotation[i][j] != -s:
                return None
            return k
    return None


def rotate_symmetric(rotation: Mat3, a: Mat3) -> Mat3:
    """R a R^T of a symmetric a."""
    k = axis_of(rotation)
    if k is not None:
        return symmetric(_turn(rotation, a, k))
    half = vec.product(rotation, a)
    upper = [[vec.dot(half[i], rotation[j]) if j >= i else half[i][j] for j in range(3)] for i in range(3)]
    return symmetric(tuple(tuple(row) for row in upper))  # type: ignore[arg-type]


def rotate(rotation: Mat3, a: Mat3) -> Mat3:
    """R a R^T"""
    k = axis_of(rotation)
    if k is not None:
        return _turn(rotation, a, k)
    return vec.product(vec.product(rotation, a), vec.transpose(rotation))


def _turn(rotation: Mat3, a: Mat3, k: int) -> Mat3:
    """R a R^T for a turn by an angle about axis k; c^2 + s^2 = 1 saves half of the operations."""
    i, j = (k + 1) % 3, (k + 2) % 3
    c, s = rotation[i][i], rotation[j][i]
    t = s * (a[i][i] - a[j][j]) + c * (a[i][j] + a[j][i])
    result = [list(row) for row in a]
    result[i][i], result[j][j] = a[i][i] - s * t, a[j][j] + s * t
    result[i][j], result[j][i] = c * t - a[j][i], c * t - a[i][j]
    result[i][k], result[j][k] = c * a[i][k] - s * a[j][k], s * a[i][k] + c * a[j][k]
    result[k][i], result[k][j] = c * a[k][i] - s * a[k][j], s * a[k][i] + c * a[k][j]
    return tuple(tuple(row) for row in result)  # type: ignore[return-value]
