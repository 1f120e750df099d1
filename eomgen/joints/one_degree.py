"""Joints of one degree of freedom: revolute (turn about z), prismatic (slide along z), screw (both in proportion)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

from ..elements.dimensions import LENGTH
from ..elements.element_type import key
from ..elements.kinds import Scalar
from ..elements.looks import JointLook, SymbolPart
from ..graph import vectors as vec
from ..graph.core import Expr, Graph, atan2, cos, sin
from ..graph.vectors import Mat3, Vec3
from ..records import dataclass
from .closure_conditions import along, parallel_axes, same_orientation
from .joint import Closure, Coordinate, Joint
from .rotation_coordinates import about, unit


@dataclass(frozen=True)
class Revolute(Joint):
    """S turns about the common z axis; the origins coincide.  Allows 1, removes 5."""

    sentence: ClassVar[str] = "S turns about the axis {z} that it shares with P; the origins coincide."
    formula: ClassVar[str] = r"\mathbf{R}_{PS} = \mathbf{R}_{z}(q), \quad \mathbf{u} = \mathbf{0}"
    type_name: ClassVar[str] = "revolute"
    look: ClassVar[JointLook] = JointLook((SymbolPart("cylinder", (0.75, 2.5)),))
    coordinates: ClassVar[tuple[Coordinate, ...]] = (Coordinate("", "angle"),)

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return about(graph, 2, q[0]), vec.zero(graph)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        return [(unit(graph, 2), vec.zero(graph))]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return along(position, "xyz") + parallel_axes(rotation)

    def aligned(self, rotation: Mat3) -> list[Expr]:
        return [rotation[2][2]]

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return [atan2(rotation[1][0], rotation[0][0])]


@dataclass(frozen=True)
class Continuous(Revolute):
    """A revolute joint without limits, as URDF calls it.  Allows 1, removes 5."""

    type_name: ClassVar[str] = "continuous"


@dataclass(frozen=True)
class Prismatic(Joint):
    """S slides along the common z axis without turning.  Allows 1, removes 5."""

    sentence: ClassVar[str] = "S slides along the axis {z} that it shares with P, without turning."
    formula: ClassVar[str] = r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = q \mathbf{e}_{z}"
    type_name: ClassVar[str] = "prismatic"
    look: ClassVar[JointLook] = JointLook((SymbolPart("box", (2.2, 2.2, 4.0)),), slides=True)
    coordinates: ClassVar[tuple[Coordinate, ...]] = (Coordinate("", "length"),)

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return vec.identity(graph), (graph.zero, graph.zero, q[0])

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        return [(vec.zero(graph), unit(graph, 2))]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return along(position, "xy") + same_orientation(rotation)

    def aligned(self, rotation: Mat3) -> list[Expr]:
        return [rotation[0][0], rotation[2][2]]

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return [position[2]]


@dataclass(frozen=True)
class Screw(Joint):
    """S turns about the common z axis and slides along it by ``pitch`` (m) per turn.  Allows 1, removes 5.

    The coordinate is the angle; a positive pitch is a right-handed thread (Shabana, sec. 7.7, screw joint).
    """

    sentence: ClassVar[str] = "S turns about the common axis {z} and advances by the pitch $p$ in each turn."
    formula: ClassVar[str] = r"\mathbf{R}_{PS} = \mathbf{R}_{z}(q), \quad \mathbf{u} = \frac{p}{2\pi} q \mathbf{e}_{z}"
    type_name: ClassVar[str] = "screw"
    look: ClassVar[JointLook] = JointLook(
        (SymbolPart("cylinder", (1.2, 0.6)), SymbolPart("cylinder", (0.8, 2.4))), slides=True
    )
    counts_turns: ClassVar[bool] = True
    coordinates: ClassVar[tuple[Coordinate, ...]] = (Coordinate("", "angle"),)
    pitch: Expr = key(
        Scalar(
            "advance of S per turn (m), negative for a left-handed thread",
            required=True,
            not_zero="give a pitch other than 0; a screw without advance is a revolute joint",
            dimension=LENGTH,
        )
    )

    @property
    def lead(self) -> Expr:
        """Advance per radian (m)."""
        return self.pitch / (2 * math.pi)

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return about(graph, 2, q[0]), (graph.zero, graph.zero, self.lead * q[0])

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        return [(unit(graph, 2), vec.scale(self.lead, unit(graph, 2)))]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        """The angle from where the advance z wants x_S to where it is: an equation that knows no full turns."""
        turn = position[2] / self.lead
        c, s = cos(turn), sin(turn)
        off = atan2(c * rotation[1][0] - s * rotation[0][0], c * rotation[0][0] + s * rotation[1][0])
        return [*along(position, "xy"), *parallel_axes(rotation), Closure("thread", self.lead * off, "length")]

    def closure_in_turns(self, graph: Graph, rotation: Mat3, position: Vec3, turn: Expr) -> list[Closure]:
        thread = Closure("thread", position[2] - self.lead * turn, "length")
        return [*along(position, "xy"), *parallel_axes(rotation), thread]

    def aligned(self, rotation: Mat3) -> list[Expr]:
        return [rotation[2][2]]

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return [position[2] / self.lead]
