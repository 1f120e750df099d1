"""Joints of several degrees of freedom, and the weld: cylindrical, planar; :mod:`.turning` has spherical and free."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from ..elements.looks import JointLook, SymbolPart
from ..graph import vectors as vec
from ..graph.core import Expr, Graph, atan2
from ..graph.vectors import Mat3, Vec3
from ..records import dataclass
from .closure_conditions import along, parallel_axes, same_orientation
from .joint import Closure, Coordinate, Joint
from .rotation_coordinates import about, unit


@dataclass(frozen=True)
class Cylindrical(Joint):
    """S slides along the common z axis and turns about it.  Allows 2, removes 4."""

    sentence: ClassVar[str] = "S slides along the common axis {z} and turns about it."
    formula: ClassVar[str] = r"\mathbf{R}_{PS} = \mathbf{R}_{z}(q_2), \quad \mathbf{u} = q_1 \mathbf{e}_{z}"
    type_name: ClassVar[str] = "cylindrical"
    look: ClassVar[JointLook] = JointLook((SymbolPart("cylinder", (1.0, 3.2)),), slides=True)
    coordinates: ClassVar[tuple[Coordinate, ...]] = (Coordinate("_z", "length"), Coordinate("_3", "angle"))

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return about(graph, 2, q[1]), (graph.zero, graph.zero, q[0])

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        return [(vec.zero(graph), unit(graph, 2)), (unit(graph, 2), vec.zero(graph))]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return along(position, "xy") + parallel_axes(rotation)

    def aligned(self, rotation: Mat3) -> list[Expr]:
        return [rotation[2][2]]

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return [position[2], atan2(rotation[1][0], rotation[0][0])]


@dataclass(frozen=True)
class Planar(Joint):
    """S moves in the x-y plane of P and turns about z.  Allows 3, removes 3."""

    sentence: ClassVar[str] = "S slides along the axes {x} and {y} of P and turns about the axis {z}."
    formula: ClassVar[str] = (
        r"\mathbf{R}_{PS} = \mathbf{R}_{z}(q_3), \quad \mathbf{u} = q_1 \mathbf{e}_{x} + q_2 \mathbf{e}_{y}"
    )
    type_name: ClassVar[str] = "planar"
    look: ClassVar[JointLook] = JointLook((SymbolPart("box", (3.0, 3.0, 0.8)),))
    coordinates: ClassVar[tuple[Coordinate, ...]] = (
        Coordinate("_x", "length"),
        Coordinate("_y", "length"),
        Coordinate("_3", "angle"),
    )

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return about(graph, 2, q[2]), (q[0], q[1], graph.zero)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        turn = about(graph, 2, q[2])
        o = vec.zero(graph)
        return [(o, turn[0]), (o, turn[1]), (unit(graph, 2), o)]  # R^T e_k is row k of R

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return along(position, "z") + parallel_axes(rotation)

    def aligned(self, rotation: Mat3) -> list[Expr]:
        return [rotation[2][2]]

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return [position[0], position[1], atan2(rotation[1][0], rotation[0][0])]


@dataclass(frozen=True)
class Translational(Joint):
    """S slides along x, y and z of P without turning.  Allows 3, removes 3."""

    sentence: ClassVar[str] = "S slides along the three axes of P without turning."
    formula: ClassVar[str] = (
        r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = q_1 \mathbf{e}_x + q_2 \mathbf{e}_y + q_3 \mathbf{e}_z"
    )
    type_name: ClassVar[str] = "translational"
    look: ClassVar[JointLook] = JointLook((SymbolPart("box", (1.6, 1.6, 1.6)),))
    has_axis: ClassVar[bool] = False
    coordinates: ClassVar[tuple[Coordinate, ...]] = tuple(Coordinate(f"_{axis}", "length") for axis in "xyz")

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return vec.identity(graph), (q[0], q[1], q[2])

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        return [(vec.zero(graph), unit(graph, k)) for k in range(3)]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return same_orientation(rotation)

    def aligned(self, rotation: Mat3) -> list[Expr]:
        return [rotation[0][0], rotation[2][2]]

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return list(position)


@dataclass(frozen=True)
class Weld(Joint):
    """S is fixed to P.  Allows 0, removes 6."""

    sentence: ClassVar[str] = "S is fixed to P."
    formula: ClassVar[str] = r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = \mathbf{0}"
    type_name: ClassVar[str] = "weld"
    look: ClassVar[JointLook] = JointLook((SymbolPart("box", (0.9, 0.9, 0.9)),))
    has_axis: ClassVar[bool] = False

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return vec.identity(graph), vec.zero(graph)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        return []

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return along(position, "xyz") + same_orientation(rotation)

    def aligned(self, rotation: Mat3) -> list[Expr]:
        return [rotation[0][0], rotation[2][2]]

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return []
