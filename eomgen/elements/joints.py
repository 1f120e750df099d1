"""Joints: what a type means, answered by one short class; :data:`JOINTS` is the table of all types."""

from __future__ import annotations

import inspect
import math
from abc import abstractmethod
from collections.abc import Sequence
from itertools import product
from typing import Any, ClassVar, NamedTuple

from ..base.value_rules import NOT_NEGATIVE
from ..expr import vectors as vec
from ..expr.core import Expr, Graph, atan2, cos, sin, sqrt, substitute, symbols_of
from ..expr.differentiate import jvp
from ..expr.vectors import Mat3, Vec3
from . import kinds
from .constraints.constraint import SWITCHING
from .dimensions import ENERGY, LENGTH, REACH, TIME
from .element_type import Element, ElementType, key, keys_of, table
from .glyphs import JointLook, SymbolPart
from .kinds import MOTION, Choice, Fields, Scalar, Vector, ref
from .rotations import euler_parameters_from_matrix
from .scalars import AXES, axes_of_turns, turned

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
    dimension=LENGTH,
)
BETWEEN = kinds.Pair(
    "predecessor P and successor S, bodies or markers; coordinates are the motion of S relative to P", required=True
)
AXIS = kinds.Axis("axis of the joint, in both markers", default="z")
AXIS_PAIR = kinds.TwoAxes("axes of the cross in the markers: the first stays with P, the second with S")
COORDINATE = kinds.Name("name of the coordinate (the joint's name unless given)", holds="coordinate")
COORDINATES = kinds.Names("names of the coordinates, in order", holds="coordinate")
LATEX = kinds.Latexes("how formulas and plots print its coordinates, in LaTeX: a text, a list or a mapping", default=())
#: Data of a joint that has coordinates; the last only where it has one.
DATA: Fields = {
    "limits": kinds.Limits("limits of the coordinate; a run that passes one warns, but nothing stops there"),
    "dry_friction": kinds.Number(
        "Coulomb friction (N m or N); stored, but it does not act",
        allowed=NOT_NEGATIVE,
        remedy="friction must be 0 or positive",
    ),
    "armature": Scalar(
        "inertia of the drive, referred to the coordinate (kg m^2 or kg)",
        dimension=ENERGY.times(TIME, 2).times(REACH, -2),
        allowed=NOT_NEGATIVE,
        remedy="an inertia must be 0 or positive",
    ),
}


class Joint(Element):
    """Questions every joint type answers.

    Class attributes
    ----------------
    has_axis : whether ``axis=`` is accepted
    has_axes : whether ``axes=``, directions of x and y, is accepted instead
    options : further keys of this type: the fields that :func:`~eomgen.elements.element_type.key` marks
    coordinates : the coordinates, in order
    fixed_axes : axes of P along which the origin of S stays at that of P
    turns : axes about which S turns against P, each in the frame that the turns before made; a key of the type may name
        others
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
    fixed_axes = ""
    turns = "xyz"
    quaternion_slots: ClassVar[tuple[QuaternionSlot, ...]] = ()
    look: ClassVar[JointLook] = JointLook()

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.options = keys_of(cls)

    @classmethod
    def keys(cls) -> Fields:
        """All keys of the type, in the order of the method's arguments."""
        count = len(cls.coordinates)
        keys = {"between": BETWEEN} | {name: field for name, field in cls.options.items() if field.required}
        keys |= ({"axis": AXIS} if cls.has_axis else {}) | ({"axes": AXIS_PAIR} if cls.has_axes else {})
        keys |= {"coordinate": COORDINATE} if count == 1 else {}
        keys |= {name: field for name, field in cls.options.items() if name != "rotation"}
        if count:
            keys |= {"coordinates": COORDINATES, **cls.options, "limits": DATA["limits"]}
            keys |= (DATA if count == 1 else {}) | {"latex": LATEX}
        return keys | SWITCHING if count or cls is Weld else keys

    @property
    def velocities(self) -> tuple[Velocity, ...]:
        """The generalized velocities, in order: the rates of the coordinates, but for Euler parameters."""
        turning = {slot.coordinate: slot for slot in self.quaternion_slots}
        result: list[Velocity] = []
        for k, coordinate in enumerate(self.coordinates):
            if k in turning:
                result += [Velocity(f"_w{axis}", "angle") for axis in "xyz"]
            elif coordinate.kind != "parameter":
                result.append(Velocity(f"{coordinate.suffix}_dot", coordinate.kind, k))
        return tuple(result)

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
        rows = [Closure(f"r_{axis}", position[AXES[axis]], "length") for axis in self.fixed_axes]
        turns = (("z.x", rotation[0][2]), ("z.y", rotation[1][2]), ("x.y", rotation[1][0]))
        return rows + [Closure(*turn, "angle") for turn in turns[: {"": 3, "z": 2}.get(self.turns, 0)]]

    @abstractmethod
    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        """The coordinates as functions of a relative pose the joint allows."""

    def closure_in_turns(self, graph: Graph, rotation: Mat3, position: Vec3, turn: Expr) -> list[Closure]:
        """The closure where ``turn``, the angle of S about the z axis of P, is known beyond half a turn."""
        return self.closure(graph, rotation, position)

    def aligned(self, rotation: Mat3) -> list[Expr]:
        """Expressions that must be positive: the closure equations alone also admit anti-parallel axes."""
        return [rotation[axis][axis] for axis in {"": (0, 2), "z": (2,)}.get(self.turns, ())]


# -- rotation coordinates ----------------------------------------------------------------------------------------------


def euler(graph: Graph, sequence: str, angles: Sequence[Expr]) -> tuple[Mat3, list[Vec3]]:
    """R = R_a(q1) R_b(q2) R_c(q3), intrinsic: each turn is about an axis of the frame the one before made.

    And the columns g_k with omega = sum g_k q_k' in the turned axes (Shabana, ch. 7: omega-bar = G-bar theta').
    """
    axes = [AXES[letter] for letter in sequence]
    rotation = vec.matrix(graph, turned(axes, angles))
    return rotation, [vec.vector(graph, column) for column in axes_of_turns(axes, angles, -1)]


def euler_angles(graph: Graph, sequence: str, rotation: Mat3) -> list[Expr]:
    """The angles of a rotation matrix; the middle one in [-pi/2, pi/2] (three different axes) or [0, pi].

    Sine and cosine of the middle angle give it, so that value and rate stay right near the singular angles, where one
    of the two alone loses half the digits.
    """
    i, j, k = (AXES[letter] for letter in sequence)
    other, sign = 3 - i - j, 1.0 if (j - i) % 3 == 1 else -1.0
    if i != k:
        upper, lower = rotation[j][k], rotation[k][k]
        first = atan2(-sign * upper, lower)
        second = atan2(sign * rotation[i][k], sqrt(upper * upper + lower * lower))
        return [first, second, atan2(-sign * rotation[i][j], rotation[i][i])]
    upper, lower = rotation[j][i], rotation[other][i]
    first = atan2(upper, -sign * lower)
    second = atan2(sqrt(upper * upper + lower * lower), rotation[i][i])
    return [first, second, atan2(rotation[i][j], sign * rotation[i][other])]


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


# -- sliding and turning -----------------------------------------------------------------------------------------------


ANGLES = tuple(Coordinate(f"_{k}", "angle") for k in (1, 2, 3))
PARAMETERS = tuple(Coordinate(f"_e{k}", "parameter") for k in range(4))


class PoseJoint(Joint):
    """S slides along the axes of P that are not fixed, then turns about the axes of its sequence.

    The coordinates are the lengths in the order x, y, z, then the angles.
    """

    def __init_subclass__(cls) -> None:
        if "coordinates" not in vars(cls) and (not cls.coordinates or {"fixed_axes", "turns"} & vars(cls).keys()):
            lengths = [Coordinate(f"_{axis}", "length") for axis in "xyz" if axis not in cls.fixed_axes]
            every = (*lengths, *(ANGLES[AXES[axis]] for axis in cls.turns))
            cls.coordinates = every if len(every) != 1 else (Coordinate("", every[0].kind),)
        super().__init_subclass__()

    def place(self, graph: Graph, q: Sequence[Expr]) -> Vec3:
        """Position of S's origin in P axes."""
        lengths = iter(q)
        x, y, z = (graph.zero if axis in self.fixed_axes else next(lengths) for axis in "xyz")
        return x, y, z

    def slides(self, graph: Graph, q: Sequence[Expr]) -> list[Vec3]:
        """Its derivatives by the coordinates before the angles."""
        return [row for axis, row in zip("xyz", vec.identity(graph), strict=True) if axis not in self.fixed_axes]

    def turn(self, graph: Graph, angles: Sequence[Expr]) -> tuple[Mat3, list[Vec3]]:
        """Rotation of S in P, and the columns of its angular velocity."""
        return euler(graph, getattr(self, "sequence", self.turns), angles)

    def _turn(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, list[Vec3]]:
        return self.turn(graph, [x for x, one in zip(q, self.coordinates, strict=True) if one.kind != "length"])

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return self._turn(graph, q)[0], self.place(graph, q)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        o, (rotation, rates) = vec.zero(graph), self._turn(graph, q)
        columns = [(o, vec.transpose_times(rotation, slide)) for slide in self.slides(graph, q)]
        return columns + [(rate, o) for rate in rates]

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        lengths = [length for axis, length in zip("xyz", position, strict=True) if axis not in self.fixed_axes]
        return lengths + self.measure_turn(graph, rotation)

    def measure_turn(self, graph: Graph, rotation: Mat3) -> list[Expr]:
        """The angles as functions of a relative rotation that the joint allows."""
        return [atan2(rotation[1][0], rotation[0][0])] if self.turns else []


# -- one degree of freedom ---------------------------------------------------------------------------------------------


class Revolute(PoseJoint):
    """S turns about the common z axis; the origins coincide.  Allows 1, removes 5."""

    sentence = "S turns about the axis {z} that it shares with P; the origins coincide."
    formula = r"\mathbf{R}_{PS} = \mathbf{R}_{z}(q), \quad \mathbf{u} = \mathbf{0}"
    look = JointLook((SymbolPart("cylinder", (0.75, 2.5)),))
    fixed_axes = "xyz"
    turns = "z"


class Continuous(Revolute):
    """A revolute joint without limits, as URDF calls it.  Allows 1, removes 5."""


class Prismatic(PoseJoint):
    """S slides along the common z axis without turning.  Allows 1, removes 5."""

    sentence = "S slides along the axis {z} that it shares with P, without turning."
    formula = r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = q \mathbf{e}_{z}"
    look = JointLook((SymbolPart("box", (2.2, 2.2, 4.0)),), slides=True)
    fixed_axes = "xy"
    turns = ""


class Screw(PoseJoint):
    """S turns about the common z axis and slides along it by ``pitch`` (m) per turn.  Allows 1, removes 5.

    The coordinate is the angle; a positive pitch is a right-handed thread (Shabana, sec. 7.7, screw joint).
    """

    sentence = "S turns about the common axis {z} and advances by the pitch $p$ in each turn."
    formula = r"\mathbf{R}_{PS} = \mathbf{R}_{z}(q), \quad \mathbf{u} = \frac{p}{2\pi} q \mathbf{e}_{z}"
    look = JointLook((SymbolPart("cylinder", (1.2, 0.6)), SymbolPart("cylinder", (0.8, 2.4))), slides=True)
    counts_turns = True
    coordinates = (Coordinate("", "angle"),)
    fixed_axes = "xy"
    turns = "z"
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

    def place(self, graph: Graph, q: Sequence[Expr]) -> Vec3:
        return graph.zero, graph.zero, self.lead * q[0]

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        z = vec.identity(graph)[2]
        return [(z, vec.scale(self.lead, z))]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        """The angle from where the advance z wants x_S to where it is: an equation that knows no full turns."""
        turn = position[2] / self.lead
        c, s = cos(turn), sin(turn)
        off = atan2(c * rotation[1][0] - s * rotation[0][0], c * rotation[0][0] + s * rotation[1][0])
        return [*super().closure(graph, rotation, position), Closure("thread", self.lead * off, "length")]

    def closure_in_turns(self, graph: Graph, rotation: Mat3, position: Vec3, turn: Expr) -> list[Closure]:
        thread = Closure("thread", position[2] - self.lead * turn, "length")
        return [*super().closure(graph, rotation, position), thread]

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return [position[2] / self.lead]


# -- several degrees of freedom ----------------------------------------------------------------------------------------


class Cylindrical(PoseJoint):
    """S slides along the common z axis and turns about it.  Allows 2, removes 4."""

    sentence = "S slides along the common axis {z} and turns about it."
    formula = r"\mathbf{R}_{PS} = \mathbf{R}_{z}(q_2), \quad \mathbf{u} = q_1 \mathbf{e}_{z}"
    look = JointLook((SymbolPart("cylinder", (1.0, 3.2)),), slides=True)
    fixed_axes = "xy"
    turns = "z"


class Planar(PoseJoint):
    """S moves in the x-y plane of P and turns about z.  Allows 3, removes 3."""

    sentence = "S slides along the axes {x} and {y} of P and turns about the axis {z}."
    formula = r"\mathbf{R}_{PS} = \mathbf{R}_{z}(q_3), \quad \mathbf{u} = q_1 \mathbf{e}_{x} + q_2 \mathbf{e}_{y}"
    look = JointLook((SymbolPart("box", (3.0, 3.0, 0.8)),))
    fixed_axes = "z"
    turns = "z"


class Translational(PoseJoint):
    """S slides along x, y and z of P without turning.  Allows 3, removes 3."""

    sentence = "S slides along the three axes of P without turning."
    formula = r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = q_1 \mathbf{e}_x + q_2 \mathbf{e}_y + q_3 \mathbf{e}_z"
    look = JointLook((SymbolPart("box", (1.6, 1.6, 1.6)),))
    has_axis = False
    turns = ""


class Weld(PoseJoint):
    """S is fixed to P.  Allows 0, removes 6."""

    sentence = "S is fixed to P."
    formula = r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = \mathbf{0}"
    look = JointLook((SymbolPart("box", (0.9, 0.9, 0.9)),))
    has_axis = False
    fixed_axes = "xyz"
    turns = ""


# -- two angles between shafts -----------------------------------------------------------------------------------------


class Universal(PoseJoint):
    """A cross turns about the axis {x} of P and the axis {y} of S, which stay perpendicular.  Allows 2, removes 4.

    R = R_x(q1) R_y(q2); the shafts are the z axes, in line at zero (Shabana, sec. 7.7, universal joint).
    """

    sentence = "A cross turns about the axis {x} of P and the axis {y} of S, which stay perpendicular."
    formula = r"\mathbf{R}_{PS} = \mathbf{R}_{x}(q_1) \mathbf{R}_{y}(q_2), \quad \mathbf{u} = \mathbf{0}"
    look = JointLook((SymbolPart("cylinder", (0.4, 2.6), "x", "P"), SymbolPart("cylinder", (0.4, 2.6), "y")))
    fixed_axes = "xyz"
    turns = "xy"
    has_axes = True

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return [*super().closure(graph, rotation, position), Closure("x.y", rotation[0][1], "angle")]

    def measure_turn(self, graph: Graph, rotation: Mat3) -> list[Expr]:
        return [atan2(rotation[2][1], rotation[1][1]), atan2(rotation[0][2], rotation[0][0])]


class ConstantVelocity(PoseJoint):
    """The shaft bends in any direction, and S turns exactly as fast as P.  Allows 2, removes 4.

    R = R_x(q1/2) R_y(q2) R_x(q1/2).  A palindrome of turns about x and y has no z part in its quaternion
    (e3 = 0): S is turned about an axis in the x-y plane of P, so the relative angular velocity lies in the plane that
    bisects the shafts, and shafts held in their bearings turn equally fast (Hunt, Kinematic Geometry of Mechanisms,
    1978, sec. 13.2: constant-velocity connections).  The shafts are the z axes; a bend of half a turn is singular.
    """

    sentence = "The shaft along the axis {z} bends about any axis across it and passes its turning on evenly."
    formula = r"\omega_S \cdot \mathbf{e}_{z}^S = \omega_P \cdot \mathbf{e}_{z}^P"
    look = JointLook((SymbolPart("sphere", (1.0,)), SymbolPart("cylinder", (0.4, 3.0), "x")))
    fixed_axes = "xyz"
    turns = "xy"

    def turn(self, graph: Graph, angles: Sequence[Expr]) -> tuple[Mat3, list[Vec3]]:
        half = 0.5 * angles[0]
        rotation, (first, second, third) = euler(graph, "xyx", (half, angles[1], half))
        return rotation, [vec.scale(graph.constant(0.5), vec.add(first, third)), second]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        bend = Closure("x.y", rotation[1][0] - rotation[0][1], "angle")  # 4 e0 e3
        return [*super().closure(graph, rotation, position), bend]

    def aligned(self, rotation: Mat3) -> list[Expr]:
        return [rotation[0][0] + rotation[1][1]]  # 2 (e0^2 - e3^2): it is e3 that vanishes, not e0

    def measure_turn(self, graph: Graph, rotation: Mat3) -> list[Expr]:
        """From 4 e0 e1, 4 e0 e2 and 4 e0^2 with e = (cos q2/2 cos q1/2, cos q2/2 sin q1/2, sin q2/2, 0)."""
        scalar = 1.0 + rotation[0][0] + rotation[1][1] + rotation[2][2]
        about_x, about_y = rotation[2][1] - rotation[1][2], rotation[0][2] - rotation[2][0]
        sine = sqrt(scalar * scalar + about_x * about_x)
        return [2.0 * atan2(about_x, scalar), 2.0 * atan2(about_y, sine)]


# -- all axes ----------------------------------------------------------------------------------------------------------


ROTATION = Choice(
    "how a rotation is described: three Euler angles, or four Euler parameters, which are never singular",
    default="euler_angles",
    choices=("euler_angles", "euler_parameters"),
)


class RotatingJoint(PoseJoint):
    """What spherical and free joints share: how they describe a rotation.

    ``rotation`` is ``euler_angles`` (intrinsic, x-y'-z'' unless ``sequence`` says otherwise; singular where the middle
    angle brings the first and last axes in line) or ``euler_parameters`` (e0 the scalar part; never singular), whose
    velocities are the components of the angular velocity of S relative to P in S axes.
    """

    has_axis = False
    sequence: str = key(SEQUENCE)
    rotation: str = key(ROTATION)

    def __post_init__(self) -> None:
        if self.rotation == "euler_parameters":
            lengths = self.coordinates[:-3]
            object.__setattr__(self, "coordinates", (*lengths, *PARAMETERS))
            object.__setattr__(self, "quaternion_slots", (QuaternionSlot(len(lengths), len(lengths)),))

    def turn(self, graph: Graph, angles: Sequence[Expr]) -> tuple[Mat3, list[Vec3]]:
        """Of Euler parameters the columns are constant."""
        if self.quaternion_slots:
            return parameter_rotation(graph, angles), [*vec.identity(graph)]
        return super().turn(graph, angles)

    def measure_turn(self, graph: Graph, rotation: Mat3) -> list[Expr]:
        if self.quaternion_slots:
            return [*euler_parameters_from_matrix(rotation)]
        return euler_angles(graph, self.sequence, rotation)


class Spherical(RotatingJoint):
    """S turns freely about the common origin.  Allows 3, removes 3."""

    sentence = "S turns about its origin, which stays at the origin of P."
    formula = r"\mathbf{R}_{PS} = \mathbf{R}(q_1,q_2,q_3), \quad \mathbf{u} = \mathbf{0}"
    look = JointLook((SymbolPart("sphere", (1.0,)),))
    fixed_axes = "xyz"


class Free(RotatingJoint):
    """S moves freely: three coordinates of its position in P axes, then its rotation.  Allows 6, removes 0."""

    sentence = "S moves without hindrance: three displacements in the axes of P, then three rotations."
    formula = (
        r"\mathbf{R}_{PS} = \mathbf{R}(q), \quad \mathbf{u} = q_1 \mathbf{e}_x + q_2 \mathbf{e}_y + q_3 \mathbf{e}_z"
    )


# -- guides: S is led by a curve or a surface of P; they stay in the tree ----------------------------------------------


class GuidePoint(Vector):
    """Three expressions [x, y, z] of the joint's own first coordinates and of parameters."""

    schema = ref("vector")

    def read(self, reader: Any, path: str, value: Any, *own: Any) -> Shape:
        """A point as expressions of parameters of the model and of coordinates of the joint, ``own``."""
        (names,), point = own, reader.vector(path, value, self.level)
        listed = " and ".join(names)
        for name in sorted(symbols_of(point) - {*reader.names.of("parameter"), *names}):
            if name in reader.names.kinds:
                message = f"the {reader.names.kinds[name]} {name!r} cannot be used here"
                reader.fault(path, message, f"allowed are parameters and {listed}", "EG-REFERENCE")
        if not symbols_of(point) & {*names} and not reader.faults.under(path):
            remedy = f"use the joint's own {listed} in the expressions"
            reader.fault(path, f"does not depend on {listed}", remedy, "EG-EXPRESSION")
        return Shape(point, tuple(reader.graph.symbol(name) for name in names))

    def absent(self, reader: Any) -> Shape:
        return Shape((reader.stand_in,) * 3, ())


class Guide(PoseJoint):
    """The origin of S is at a point r of P that depends on the first coordinates, the parameters of the shape.

    The parameters cannot be told from a pose without solving equations, so such a joint never closes a loop: another
    joint of the loop is cut.  Singular where the derivatives of r by its parameters vanish or are parallel.
    """

    role = "tree"
    has_axis = False
    turns = ""
    look = JointLook((SymbolPart("sphere", (1.0,)),))

    @property
    def shape(self) -> Shape:
        """The point r and its parameters."""
        result: Shape = getattr(self, next(iter(self.options)))
        return result

    def place(self, graph: Graph, q: Sequence[Expr]) -> Vec3:
        return self._at(q, self.shape.point)

    def slides(self, graph: Graph, q: Sequence[Expr]) -> list[Vec3]:
        point, parameters = self.shape
        return [self._at(q, jvp(list(point), {parameter: graph.one})) for parameter in parameters]

    def _at(self, q: Sequence[Expr], point: Sequence[Expr]) -> Vec3:
        parameters = self.shape.parameters
        x, y, z = substitute(list(point), dict(zip(parameters, q[: len(parameters)], strict=True)))
        return (x, y, z)

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> Any:
        raise TypeError(f"a {self.type_name} joint cannot be cut")

    measure = closure


class CurveSlider(Guide):
    """The origin of S slides along a curve of P, without turning: a bead on a wire.  Allows 1, removes 5."""

    sentence = (
        "The origin of S slides along a curve of P without turning; the coordinate is the parameter of the curve."
    )
    formula = r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = \mathbf{r}(q)"
    coordinates: ClassVar[tuple[Coordinate, ...]] = (Coordinate("", "length"),)
    curve: Shape = key(
        GuidePoint(
            "point of the curve in the predecessor's axes (m), as expressions of the joint's coordinate s",
            required=True,
            level=MOTION,
            own=1,
            dimension=LENGTH,
        )
    )


class SurfaceSlider(Guide):
    """The origin of S slides on a surface of P, without turning: a particle in a bowl.  Allows 2, removes 4."""

    sentence = (
        "The origin of S slides on a surface of P without turning; the coordinates are the parameters of the surface."
    )
    formula = r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = \mathbf{r}(q_1,q_2)"
    coordinates: ClassVar[tuple[Coordinate, ...]] = (Coordinate("_u", "length"), Coordinate("_v", "length"))
    surface: Shape = key(
        GuidePoint(
            "point of the surface in the predecessor's axes (m), as expressions of the joint's coordinates u and v",
            required=True,
            level=MOTION,
            own=2,
            dimension=LENGTH,
        )
    )


class TurningGuide(Guide):
    """A guide on which S also turns freely about its origin, in Euler angles."""

    turns = "xyz"
    sequence: str = key(SEQUENCE)


class PointOnCurve(TurningGuide, CurveSlider):
    """The origin of S slides along a curve of P; S turns freely, in Euler angles.  Allows 4, removes 2.

    A point on a curve (Shabana, sec. 3.2, point follower): of the curve's point r(s) only s is free.
    """

    sentence = "The origin of S slides along a curve of P, and S turns freely."
    formula = r"\mathbf{u} = \mathbf{r}(q_1)"
    coordinates = (Coordinate("_s", "length"), *ANGLES)


class PointOnSurface(TurningGuide, SurfaceSlider):
    """The origin of S slides on a surface of P; S turns freely, in Euler angles.  Allows 5, removes 1."""

    sentence = "The origin of S slides on a surface of P, and S turns freely."
    formula = r"\mathbf{u} = \mathbf{r}(q_1,q_2)"
    coordinates = (*SurfaceSlider.coordinates, *ANGLES)


# -- rods and conditions on axes, without coordinates ------------------------------------------------------------------


class RodJoint(Joint):
    """Equations between the poses of two bodies; ``removes`` of the six degrees of freedom go."""

    role = "loop"
    removes: ClassVar[int]

    @property
    def allows(self) -> int:
        return 6 - self.removes

    def pose(self, graph: Graph, q: Sequence[Expr]) -> Any:
        raise TypeError(f"a {self.type_name} joint cannot be in the tree")

    subspace = pose

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return []


def apart(length: Expr, position: Vec3) -> Closure:
    """The origins are ``length`` apart: (r . r - l^2) / 2 l = 0, whose gradient is a unit vector there."""
    return Closure("length", (vec.dot(position, position) - length * length) / (2.0 * length), "length")


class Distance(RodJoint):
    """A massless rod with a ball joint at each end: the origins stay ``length`` apart.  Allows 5, removes 1."""

    sentence = "The origins of P and S stay at the distance $l$, as by a massless rod with a ball at each end."
    formula = r"\mathbf{u}^T \mathbf{u} - l^2 = 0"
    removes = 1
    look = JointLook((SymbolPart("sphere", (0.7,), on="P"), SymbolPart("sphere", (0.7,))), bar=True)
    has_axis = False
    length: Expr = key(ROD_LENGTH)

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return [apart(self.length, position)]


class RevoluteSpherical(RodJoint):
    """A massless rod of ``length`` turns about z of P, across it, with a ball joint at S.  Allows 4, removes 2."""

    sentence = "A massless rod of length $l$ turns about the axis {z} of P and holds S by a ball."
    formula = r"u_{z} = 0, \quad u_{x}^2 + u_{y}^2 - l^2 = 0"
    removes = 2
    look = JointLook((SymbolPart("cylinder", (0.75, 2.2), on="P"), SymbolPart("sphere", (0.8,))), bar=True)
    fixed_axes = "z"
    length: Expr = key(ROD_LENGTH)

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return [apart(self.length, position), *super().closure(graph, rotation, position)]


class Inline(RodJoint):
    """The origin of S stays on the axis {z} of P.  Allows 4, removes 2."""

    sentence = "The origin of S stays on the axis {z} of P."
    formula = r"u_{x} = 0, \quad u_{y} = 0"
    removes = 2
    look = JointLook((SymbolPart("sphere", (0.8,)),), slides=True)
    fixed_axes = "xy"


class Inplane(RodJoint):
    """The origin of S stays in the plane of P across the axis {z}.  Allows 5, removes 1."""

    sentence = "The origin of S stays in the plane of P across the axis {z}."
    formula = r"u_{z} = 0"
    removes = 1
    look = JointLook((SymbolPart("sphere", (0.8,)),))
    fixed_axes = "z"


class Parallel(RodJoint):
    """The z axes stay parallel.  Allows 4, removes 2."""

    sentence = "The axes {z} of P and S stay parallel."
    formula = r"\mathbf{e}_{x}^P \cdot \mathbf{e}_{z}^S = 0, \quad \mathbf{e}_{y}^P \cdot \mathbf{e}_{z}^S = 0"
    removes = 2
    turns = "z"


class Perpendicular(RodJoint):
    """The z axes stay perpendicular: turn one marker by ``rpy``, as ``axis`` turns both.  Allows 5, removes 1."""

    sentence = "The axes {z} of P and S stay perpendicular."
    formula = r"\mathbf{e}_{z}^P \cdot \mathbf{e}_{z}^S = 0"
    removes = 1

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return [Closure("z.z", rotation[2][2], "angle")]


class Orientation(RodJoint):
    """S does not turn against P: all axes stay parallel, and the origins move freely.  Allows 3, removes 3."""

    sentence = "The axes of S stay parallel to those of P; the origins are free."
    formula = r"\mathbf{R}_{PS} = \mathbf{1}"
    removes = 3
    has_axis = False
    turns = ""


def joint(kind: type[Joint]) -> ElementType:
    """The type of joints of a class, whose documentation says what they allow."""
    text = " ".join((inspect.getdoc(kind) or "").partition("\n\n")[0].split())
    doc = f"a joint of type {kind.type_name}: {text}".replace(", removes", " of 6 degrees of freedom, removes")
    doc = doc.replace(". Allows", ".  Allows")
    return ElementType(kind.type_name, doc, kind.keys(), ends=("predecessor", "successor"), kind=kind)


_KINDS: tuple[type[Joint], ...] = (
    *(Revolute, Continuous, Prismatic, Screw, Cylindrical, Planar, Translational, Weld, Universal),
    *(ConstantVelocity, Spherical, Free, CurveSlider, SurfaceSlider, PointOnCurve, PointOnSurface, Distance),
    *(RevoluteSpherical, Inline, Inplane, Parallel, Perpendicular, Orientation),
)
JOINTS = table(*map(joint, _KINDS))
