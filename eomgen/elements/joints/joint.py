"""Joints: what a joint type means, answered by one short class; nothing outside this package names a type."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import product
from typing import ClassVar, NamedTuple

from ...base.records import dataclass
from ...base.value_rules import NOT_NEGATIVE
from ...expr import vectors as vec
from ...expr.core import Expr, Graph, atan2, sqrt
from ...expr.vectors import Mat3, Vec3
from .. import dimensions
from ..element_type import keys_of
from ..kinds import Choice, Fields, Scalar
from ..looks import JointLook
from ..scalars import AXES, elementary

# -- the class ---------------------------------------------------------------------------------------------------------

# A joint connects marker P (predecessor) and marker S (successor); its axis, where it has one, is the z axis of both.
# Rotations are matrices that take S axes to P axes; a twist is (angular, linear) of S relative to P, in S axes, at S.


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
ROD_LENGTH = Scalar(
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
    held : axes of P along which the origin of S stays at that of P
    kept : axes of S that stay parallel to those of P: '', 'z' or 'xyz'
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
    held = ""
    kept = ""
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

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        """Equations that hold the relative pose to what the joint allows, when a loop is closed by it."""
        rows = [Closure(f"r_{axis}", position[AXES[axis]], "length") for axis in self.held]
        turns = (("z.x", rotation[0][2]), ("z.y", rotation[1][2]), ("x.y", rotation[1][0]))
        return rows + [Closure(*turn, "angle") for turn in turns[: {"": 0, "z": 2, "xyz": 3}[self.kept]]]

    @abstractmethod
    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        """The coordinates as functions of a relative pose the joint allows."""

    def closure_in_turns(self, graph: Graph, rotation: Mat3, position: Vec3, turn: Expr) -> list[Closure]:
        """The closure where ``turn``, the angle of S about the z axis of P, is known beyond half a turn."""
        return self.closure(graph, rotation, position)

    def aligned(self, rotation: Mat3) -> list[Expr]:
        """Expressions that must be positive: the closure equations alone also admit anti-parallel axes."""
        return [rotation[axis][axis] for axis in {"": (), "z": (2,), "xyz": (0, 2)}[self.kept]]


# -- rotation coordinates ----------------------------------------------------------------------------------------------


def unit(graph: Graph, axis: int) -> Vec3:
    """The unit vector of axis 0, 1 or 2."""
    o, i = graph.zero, graph.one
    return ((i, o, o), (o, i, o), (o, o, i))[axis]


def about(graph: Graph, axis: int, angle: Expr) -> Mat3:
    """Rotation by ``angle`` about axis 0, 1 or 2; takes turned axes to the original ones."""
    return vec.matrix(graph, elementary(axis, angle))


def euler(graph: Graph, sequence: str, angles: Sequence[Expr]) -> Mat3:
    """R = R_a(q1) R_b(q2) R_c(q3), intrinsic: each turn is about an axis of the frame the one before made."""
    result = about(graph, AXES[sequence[0]], angles[0])
    for letter, angle in zip(sequence[1:], angles[1:], strict=True):
        result = vec.product(result, about(graph, AXES[letter], angle))
    return result


def euler_rates(graph: Graph, sequence: str, angles: Sequence[Expr]) -> list[Vec3]:
    """Columns g_k with omega = sum g_k q_k' in the turned axes (Shabana, ch. 7: omega-bar = G-bar theta')."""
    columns = []
    for k, letter in enumerate(sequence):
        column = unit(graph, AXES[letter])
        for later, angle in zip(sequence[k + 1 :], angles[k + 1 :], strict=True):
            column = vec.transpose_times(about(graph, AXES[later], angle), column)
        columns.append(column)
    return columns


def euler_angles(graph: Graph, sequence: str, rotation: Mat3) -> list[Expr]:
    """The angles of a rotation matrix; the middle one in [-pi/2, pi/2] (three different axes) or [0, pi].

    Sine and cosine of the middle angle give it, so that value and rate stay right near the singular angles, where one
    of the two alone loses half the digits.
    """
    i, j, k = (AXES[letter] for letter in sequence)
    if i != k:
        sign = 1.0 if (i, j, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
        upper, lower = rotation[j][k], rotation[k][k]
        first = atan2(-sign * upper, lower)
        second = atan2(sign * rotation[i][k], sqrt(upper * upper + lower * lower))
        third = atan2(-sign * rotation[i][j], rotation[i][i])
        return [first, second, third]
    other = 3 - i - j
    sign = 1.0 if (i, j, other) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    upper, lower = rotation[j][i], rotation[other][i]
    first = atan2(upper, -sign * lower)
    second = atan2(sqrt(upper * upper + lower * lower), rotation[i][i])
    third = atan2(rotation[i][j], sign * rotation[i][other])
    return [first, second, third]


def parameter_rotation(graph: Graph, e: Sequence[Expr]) -> Mat3:
    """Rotation of Euler parameters e0 (scalar) .. e3 of any length but zero: R = 1 + 2 (e0 e~ + e~ e~) / |e|^2."""
    e0, e1, e2, e3 = e
    s = 2.0 / (e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
    s1, s2, s3 = s * e1, s * e2, s * e3
    w1, w2, w3 = s1 * e0, s2 * e0, s3 * e0
    xx, yy, zz, xy, xz, yz = s1 * e1, s2 * e2, s3 * e3, s1 * e2, s1 * e3, s2 * e3
    i = graph.one
    return ((i - (yy + zz), xy - w3, xz + w2), (xy + w3, i - (xx + zz), yz - w1), (xz - w2, yz + w1, i - (xx + yy)))


def parameter_rates(e: Sequence[Expr], w: Sequence[Expr]) -> list[Expr]:
    """e' = E-bar^T w / 2 with w in the turned axes (Shabana, ch. 7: omega-bar = 2 E-bar theta'); keeps |e|."""
    e0, e1, e2, e3 = e
    h1, h2, h3 = (0.5 * x for x in w)
    return [
        -(e1 * h1 + e2 * h2 + e3 * h3),
        e0 * h1 - e3 * h2 + e2 * h3,
        e3 * h1 + e0 * h2 - e1 * h3,
        e1 * h2 - e2 * h1 + e0 * h3,
    ]
