"""Joints: what a joint type means, answered by one short class; nothing outside this package names a type.

A joint connects marker P (predecessor) and marker S (successor); its axis, where it has one, is the z axis of both.
Rotations are matrices that take S axes to P axes; a twist is (angular, linear) of S relative to P, in S axes, at S.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import product
from typing import ClassVar, NamedTuple

from ..base.value_rules import NOT_NEGATIVE
from ..elements import dimensions
from ..elements.element_type import keys_of
from ..elements.kinds import Choice, Fields, Scalar
from ..elements.looks import JointLook
from ..graph.core import Expr, Graph
from ..graph.vectors import Mat3, Vec3
from ..records import dataclass


class Coordinate(NamedTuple):
    """One coordinate of a joint type: its name is the joint's name plus ``suffix``.

    ``kind`` is 'angle', 'length' or 'parameter' (one of four Euler parameters).
    """

    suffix: str
    kind: str


class Velocity(NamedTuple):
    """One generalized velocity of a joint type.

    ``of`` is the number of the coordinate whose rate it is, and bears its name with ``_dot``; a velocity that is the
    rate of no coordinate is named by the joint's name plus ``suffix``.
    """

    suffix: str
    kind: str
    of: int | None = None


class QuaternionSlot(NamedTuple):
    """Euler parameters e0 .. e3 and the angular velocity that goes with them: numbers of their first entries."""

    coordinate: int
    velocity: int


class Closure(NamedTuple):
    """One loop-closure equation ``expression = 0``; ``kind`` is 'length' (m) or 'angle' (a direction cosine, rad)."""

    label: str
    expression: Expr
    kind: str


class Shape(NamedTuple):
    """A curve or surface: a point (m) as expressions of one or two parameters, which are symbols in them."""

    point: Vec3
    parameters: tuple[Expr, ...]


#: Sequences of axes of Euler angles: no axis follows itself.
SEQUENCES = tuple("".join(s) for s in product("xyz", repeat=3) if s[0] != s[1] and s[1] != s[2])
SEQUENCE = Choice("axes of the intrinsic Euler angles", default="xyz", choices=SEQUENCES)
LENGTH = Scalar(
    "length of the rod (m)",
    required=True,
    not_zero="give a length other than 0; a rod without length is a spherical joint",
    allowed=NOT_NEGATIVE,
    remedy="give a length greater than 0",
    dimension=dimensions.LENGTH,
)


@dataclass(frozen=True)
class Joint(ABC):
    """Questions every joint type answers.

    Class attributes
    ----------------
    type_name : the word in model files and the Model's method
    has_axis : whether ``axis=`` is accepted
    has_axes : whether ``axes=``, directions of x and y, is accepted instead
    options : further keys of this type: the fields that :func:`~eomgen.elements.element_type.key` marks
    coordinates : the coordinates, in order
    role : 'either'; 'tree' for a joint that no equations in the relative pose can close a loop by, so that it is never
        cut; 'loop' for a pure constraint without coordinates of its own, which always closes a loop
    counts_turns : whether :meth:`measure` tells its one angle beyond half a turn
    quaternion_slots : where four of the coordinates are Euler parameters
    look : its symbol in pictures
    sentence, formula : what it allows, for readers; P and S are its markers, {x}, {y}, {z} the axes of the joint as the
        markers have them
    """

    type_name: ClassVar[str]
    sentence: ClassVar[str] = "S moves against P as the joint's coordinates say."
    formula: ClassVar[str] = r"\mathbf{r}_S = \mathbf{r}_P + \mathbf{R}_P \mathbf{u}(q)"
    has_axis: ClassVar[bool] = True
    has_axes: ClassVar[bool] = False
    role: ClassVar[str] = "either"
    counts_turns: ClassVar[bool] = False
    options: ClassVar[Fields] = {}
    coordinates: ClassVar[tuple[Coordinate, ...]] = ()
    quaternion_slots: ClassVar[tuple[QuaternionSlot, ...]] = ()
    look: ClassVar[JointLook] = JointLook()

    def __init_subclass__(cls) -> None:
        cls.options = keys_of(cls)

    @property
    def velocities(self) -> tuple[Velocity, ...]:
        """The generalized velocities, in order: the rates of the coordinates, but for Euler parameters."""
        turning = {slot.coordinate: slot for slot in self.quaternion_slots}
        found: list[Velocity] = []
        for k, coordinate in enumerate(self.coordinates):
            if k in turning:
                found += [Velocity(f"_w{axis}", "angle") for axis in "xyz"]
            elif coordinate.kind != "parameter":
                found.append(Velocity(f"{coordinate.suffix}_dot", coordinate.kind, k))
        return tuple(found)

    @property
    def allows(self) -> int:
        """The relative degrees of freedom the joint leaves, of six."""
        return len(self.velocities)

    @abstractmethod
    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        """Rotation of S in P, and position of S's origin in P axes."""

    @abstractmethod
    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        """One (angular, linear) column per velocity: the relative twist is the sum of column times velocity."""

    @abstractmethod
    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        """Equations that hold the relative pose to what the joint allows, when a loop is closed by it."""

    @abstractmethod
    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        """The coordinates as functions of a relative pose the joint allows."""

    def closure_in_turns(self, graph: Graph, rotation: Mat3, position: Vec3, turn: Expr) -> list[Closure]:
        """The closure where ``turn``, the angle of S about the z axis of P, is known beyond half a turn."""
        return self.closure(graph, rotation, position)

    def aligned(self, rotation: Mat3) -> list[Expr]:
        """Expressions that must be positive: the closure equations alone also admit anti-parallel axes."""
        return []
