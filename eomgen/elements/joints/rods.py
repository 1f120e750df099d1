"""Pure constraints between two bodies that other joints hold: massless rods and the elementary conditions on axes.

They have no coordinates and always close a loop (Shabana, ch. 7: basic constraints; the primitive joints of ADAMS).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from ...base.records import dataclass
from ...expr import vectors as vec
from ...expr.core import Expr, Graph
from ...expr.vectors import Mat3, Vec3
from ..element_type import key
from ..looks import JointLook, SymbolPart
from .joint import LENGTH, Closure, Joint


@dataclass(frozen=True)
class RodJoint(Joint):
    """Equations between the poses of two bodies; ``removes`` of the six degrees of freedom go."""

    role = "loop"
    removes: ClassVar[int]

    @property
    def allows(self) -> int:
        return 6 - self.removes

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        raise TypeError(f"a {self.type_name} joint cannot be in the tree")

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        raise TypeError(f"a {self.type_name} joint cannot be in the tree")

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return []


def apart(length: Expr, position: Vec3) -> Closure:
    """The origins are ``length`` apart: (r . r - l^2) / 2 l = 0, whose gradient is a unit vector there."""
    return Closure("length", (vec.dot(position, position) - length * length) / (2.0 * length), "length")


@dataclass(frozen=True)
class Distance(RodJoint):
    """A massless rod with a ball joint at each end: the origins stay ``length`` apart.  Allows 5, removes 1."""

    sentence = "The origins of P and S stay at the distance $l$, as by a massless rod with a ball at each end."
    formula = r"\mathbf{u}^T \mathbf{u} - l^2 = 0"
    type_name = "distance"
    look = JointLook((SymbolPart("sphere", (0.7,), on="P"), SymbolPart("sphere", (0.7,))), bar=True)
    has_axis = False
    removes = 1
    length: Expr = key(LENGTH)

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return [apart(self.length, position)]


@dataclass(frozen=True)
class RevoluteSpherical(RodJoint):
    """A massless rod of ``length`` turns about z of P, across it, with a ball joint at S.  Allows 4, removes 2."""

    sentence = "A massless rod of length $l$ turns about the axis {z} of P and holds S by a ball."
    formula = r"u_{z} = 0, \quad u_{x}^2 + u_{y}^2 - l^2 = 0"
    type_name = "revolute_spherical"
    look = JointLook((SymbolPart("cylinder", (0.75, 2.2), on="P"), SymbolPart("sphere", (0.8,))), bar=True)
    removes = 2
    held = "z"
    length: Expr = key(LENGTH)

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return [apart(self.length, position), *super().closure(graph, rotation, position)]


@dataclass(frozen=True)
class Inline(RodJoint):
    """The origin of S stays on the axis {z} of P.  Allows 4, removes 2."""

    sentence = "The origin of S stays on the axis {z} of P."
    formula = r"u_{x} = 0, \quad u_{y} = 0"
    type_name = "inline"
    look = JointLook((SymbolPart("sphere", (0.8,)),), slides=True)
    removes = 2
    held = "xy"


@dataclass(frozen=True)
class Inplane(RodJoint):
    """The origin of S stays in the plane of P across the axis {z}.  Allows 5, removes 1."""

    sentence = "The origin of S stays in the plane of P across the axis {z}."
    formula = r"u_{z} = 0"
    type_name = "inplane"
    look = JointLook((SymbolPart("sphere", (0.8,)),))
    removes = 1
    held = "z"


@dataclass(frozen=True)
class Parallel(RodJoint):
    """The z axes stay parallel.  Allows 4, removes 2."""

    sentence = "The axes {z} of P and S stay parallel."
    formula = r"\mathbf{e}_{x}^P \cdot \mathbf{e}_{z}^S = 0, \quad \mathbf{e}_{y}^P \cdot \mathbf{e}_{z}^S = 0"
    type_name = "parallel"
    removes = 2
    kept = "z"


@dataclass(frozen=True)
class Perpendicular(RodJoint):
    """The z axes stay perpendicular: turn one marker by ``rpy``, as ``axis`` turns both.  Allows 5, removes 1."""

    sentence = "The axes {z} of P and S stay perpendicular."
    formula = r"\mathbf{e}_{z}^P \cdot \mathbf{e}_{z}^S = 0"
    type_name = "perpendicular"
    removes = 1

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return [Closure("z.z", rotation[2][2], "angle")]


@dataclass(frozen=True)
class Orientation(RodJoint):
    """S does not turn against P: all axes stay parallel, and the origins move freely.  Allows 3, removes 3."""

    sentence = "The axes of S stay parallel to those of P; the origins are free."
    formula = r"\mathbf{R}_{PS} = \mathbf{1}"
    type_name = "orientation"
    has_axis = False
    removes = 3
    kept = "xyz"
