"""Joints of two angles between shafts along the z axes: universal (Cardan, Hooke) and constant-velocity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from ..elements.looks import JointLook, SymbolPart
from ..graph import vectors as vec
from ..graph.core import Expr, Graph, atan2, sqrt
from ..graph.vectors import Mat3, Vec3
from ..records import dataclass
from .closure_conditions import along
from .joint import Closure, Coordinate, Joint
from .rotation_coordinates import euler, euler_rates

TWO_ANGLES = (Coordinate("_1", "angle"), Coordinate("_2", "angle"))


@dataclass(frozen=True)
class Universal(Joint):
    """A cross turns about the axis {x} of P and the axis {y} of S, which stay perpendicular.  Allows 2, removes 4.

    R = R_x(q1) R_y(q2); the shafts are the z axes, in line at zero (Shabana, sec. 7.7, universal joint).
    """

    sentence: ClassVar[str] = "A cross turns about the axis {x} of P and the axis {y} of S, which stay perpendicular."
    formula: ClassVar[str] = r"\mathbf{R}_{PS} = \mathbf{R}_{x}(q_1) \mathbf{R}_{y}(q_2), \quad \mathbf{u} = \mathbf{0}"
    type_name: ClassVar[str] = "universal"
    look: ClassVar[JointLook] = JointLook(
        (SymbolPart("cylinder", (0.4, 2.6), "x", "P"), SymbolPart("cylinder", (0.4, 2.6), "y"))
    )
    coordinates: ClassVar[tuple[Coordinate, ...]] = TWO_ANGLES
    has_axes: ClassVar[bool] = True

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return euler(graph, "xy", q), vec.zero(graph)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        return [(g, vec.zero(graph)) for g in euler_rates(graph, "xy", q)]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return [*along(position, "xyz"), Closure("x.y", rotation[0][1], "angle")]

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return [atan2(rotation[2][1], rotation[1][1]), atan2(rotation[0][2], rotation[0][0])]


@dataclass(frozen=True)
class ConstantVelocity(Joint):
    """The shaft bends in any direction, and S turns exactly as fast as P.  Allows 2, removes 4.

    R = R_x(q1/2) R_y(q2) R_x(q1/2).  A palindrome of turns about x and y has no z part in its quaternion
    (e3 = 0): S is turned about an axis in the x-y plane of P, so the relative angular velocity lies in the plane that
    bisects the shafts, and shafts held in their bearings turn equally fast (Hunt, Kinematic Geometry of Mechanisms,
    1978, sec. 13.2: constant-velocity connections).  The shafts are the z axes; a bend of half a turn is singular.
    """

    sentence: ClassVar[str] = (
        "The shaft along the axis {z} bends about any axis across it and passes its turning on evenly."
    )
    formula: ClassVar[str] = r"\omega_S \cdot \mathbf{e}_{z}^S = \omega_P \cdot \mathbf{e}_{z}^P"
    type_name: ClassVar[str] = "constant_velocity"
    look: ClassVar[JointLook] = JointLook((SymbolPart("sphere", (1.0,)), SymbolPart("cylinder", (0.4, 3.0), "x")))
    coordinates: ClassVar[tuple[Coordinate, ...]] = TWO_ANGLES

    def _angles(self, q: Sequence[Expr]) -> tuple[Expr, Expr, Expr]:
        return 0.5 * q[0], q[1], 0.5 * q[0]

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return euler(graph, "xyx", self._angles(q)), vec.zero(graph)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        first, second, third = euler_rates(graph, "xyx", self._angles(q))
        o = vec.zero(graph)
        return [(vec.scale(graph.constant(0.5), vec.add(first, third)), o), (second, o)]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return [*along(position, "xyz"), Closure("x.y", rotation[1][0] - rotation[0][1], "angle")]  # 4 e0 e3

    def aligned(self, rotation: Mat3) -> list[Expr]:
        return [rotation[0][0] + rotation[1][1]]  # 2 (e0^2 - e3^2): it is e3 that vanishes, not e0

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        """From 4 e0 e1, 4 e0 e2 and 4 e0^2 with e = (cos q2/2 cos q1/2, cos q2/2 sin q1/2, sin q2/2, 0)."""
        scalar = 1.0 + rotation[0][0] + rotation[1][1] + rotation[2][2]
        about_x, about_y = rotation[2][1] - rotation[1][2], rotation[0][2] - rotation[2][0]
        across = sqrt(scalar * scalar + about_x * about_x)
        return [2.0 * atan2(about_x, scalar), 2.0 * atan2(about_y, across)]
