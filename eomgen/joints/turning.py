"""Joints that turn about all axes: spherical and free, in Euler angles or Euler parameters (Shabana, ch. 7)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from ..elements.element_type import key
from ..elements.kinds import Choice
from ..elements.looks import JointLook, SymbolPart
from ..graph import vectors as vec
from ..graph.core import Expr, Graph
from ..graph.vectors import Mat3, Vec3
from ..records import dataclass
from .closure_conditions import along
from .joint import SEQUENCE, Closure, Coordinate, Joint, QuaternionSlot
from .rotation_coordinates import euler, euler_angles, euler_rates, parameter_rotation, parameters_of, unit

ANGLES = tuple(Coordinate(f"_{k}", "angle") for k in (1, 2, 3))
PARAMETERS = tuple(Coordinate(f"_e{k}", "parameter") for k in range(4))
ROTATION = Choice(
    "how a rotation is described: three Euler angles, or four Euler parameters, which are never singular",
    default="euler_angles",
    choices=("euler_angles", "euler_parameters"),
)
PLACE = tuple(Coordinate(f"_{k}", "length") for k in "xyz")


@dataclass(frozen=True)
class RotatingJoint(Joint):
    """What spherical and free joints share: how they describe a rotation.

    ``rotation`` is ``euler_angles`` (intrinsic, x-y'-z'' unless ``sequence`` says otherwise; singular where the middle
    angle brings the first and last axes in line) or ``euler_parameters`` (e0 the scalar part; never singular), whose
    velocities are the components of the angular velocity of S relative to P in S axes.
    """

    has_axis: ClassVar[bool] = False
    place: ClassVar[tuple[Coordinate, ...]] = ()
    sequence: str = key(SEQUENCE)
    rotation: str = key(ROTATION)

    def __post_init__(self) -> None:
        if self.in_parameters:
            n = len(self.place)
            object.__setattr__(self, "coordinates", (*self.place, *PARAMETERS))
            object.__setattr__(self, "quaternion_slots", (QuaternionSlot(n, n),))

    @property
    def in_parameters(self) -> bool:
        """Whether the rotation is described by Euler parameters."""
        return self.rotation == "euler_parameters"

    def turn(self, graph: Graph, q: Sequence[Expr]) -> Mat3:
        """The rotation of S in P; q without the place."""
        return parameter_rotation(graph, q) if self.in_parameters else euler(graph, self.sequence, q)

    def turns(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        """Columns of the angular velocity; constant for Euler parameters."""
        if self.in_parameters:
            return [(unit(graph, k), vec.zero(graph)) for k in range(3)]
        return [(g, vec.zero(graph)) for g in euler_rates(graph, self.sequence, q)]

    def turned(self, graph: Graph, rotation: Mat3) -> list[Expr]:
        """The coordinates of a rotation."""
        if self.in_parameters:
            return parameters_of(graph, rotation)
        return euler_angles(graph, self.sequence, rotation)


@dataclass(frozen=True)
class Spherical(RotatingJoint):
    """S turns freely about the common origin.  Allows 3, removes 3."""

    sentence: ClassVar[str] = "S turns about its origin, which stays at the origin of P."
    formula: ClassVar[str] = r"\mathbf{R}_{PS} = \mathbf{R}(q_1,q_2,q_3), \quad \mathbf{u} = \mathbf{0}"
    type_name: ClassVar[str] = "spherical"
    look: ClassVar[JointLook] = JointLook((SymbolPart("sphere", (1.0,)),))
    coordinates: ClassVar[tuple[Coordinate, ...]] = ANGLES

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return self.turn(graph, q), vec.zero(graph)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        return self.turns(graph, q)

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return along(position, "xyz")

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return self.turned(graph, rotation)


@dataclass(frozen=True)
class Free(RotatingJoint):
    """S moves freely: three coordinates of its position in P axes, then its rotation.  Allows 6, removes 0."""

    sentence: ClassVar[str] = "S moves without hindrance: three displacements in the axes of P, then three rotations."
    formula: ClassVar[str] = (
        r"\mathbf{R}_{PS} = \mathbf{R}(q), \quad \mathbf{u} = q_1 \mathbf{e}_x + q_2 \mathbf{e}_y + q_3 \mathbf{e}_z"
    )
    type_name: ClassVar[str] = "free"
    place: ClassVar[tuple[Coordinate, ...]] = PLACE
    coordinates: ClassVar[tuple[Coordinate, ...]] = PLACE + ANGLES

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return self.turn(graph, q[3:]), (q[0], q[1], q[2])

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        o = vec.zero(graph)
        return [(o, row) for row in self.turn(graph, q[3:])] + self.turns(graph, q[3:])

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return []

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return [*position, *self.turned(graph, rotation)]
