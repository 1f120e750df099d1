"""Joints: all types, from revolute to free, guides along curves and surfaces, rods and conditions on axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

from ...base.records import dataclass
from ...expr import vectors as vec
from ...expr.core import Expr, Graph, atan2, cos, sin, sqrt, substitute, symbols_of
from ...expr.differentiate import jvp
from ...expr.vectors import Mat3, Vec3
from ..dimensions import LENGTH
from ..element_type import key
from ..kinds import MOTION, Choice, Scalar, Vector, ref
from ..looks import JointLook, SymbolPart
from ..rotations import euler_parameters_from_matrix
from .joint import (
    ROD_LENGTH,
    SEQUENCE,
    Closure,
    Coordinate,
    Joint,
    QuaternionSlot,
    Shape,
    about,
    euler,
    euler_angles,
    euler_rates,
    parameter_rotation,
    unit,
)

# -- axes that stay parallel -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class AxisJoint(Joint):
    """S slides along the axes that are not held, and turns about z where all axes are not kept parallel.

    The coordinates are the lengths in the order x, y, z, then the angle.
    """

    def _free(self, three: Sequence[Vec3] | Vec3) -> list[Any]:
        return [one for axis, one in zip("xyz", three, strict=True) if axis not in self.held]

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        lengths = iter(q)
        x, y, z = (graph.zero if axis in self.held else next(lengths) for axis in "xyz")
        return about(graph, 2, q[-1]) if self.kept == "z" else vec.identity(graph), (x, y, z)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        o = vec.zero(graph)
        columns = [(o, row) for row in self._free(self.pose(graph, q)[0])]  # R^T e_k is row k of R
        return columns + [(unit(graph, 2), o)] * (self.kept == "z")

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return self._free(position) + ([atan2(rotation[1][0], rotation[0][0])] if self.kept == "z" else [])


# -- one degree of freedom ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Revolute(AxisJoint):
    """S turns about the common z axis; the origins coincide.  Allows 1, removes 5."""

    sentence = "S turns about the axis {z} that it shares with P; the origins coincide."
    formula = r"\mathbf{R}_{PS} = \mathbf{R}_{z}(q), \quad \mathbf{u} = \mathbf{0}"
    type_name = "revolute"
    look = JointLook((SymbolPart("cylinder", (0.75, 2.5)),))
    coordinates = (Coordinate("", "angle"),)
    held = "xyz"
    kept = "z"


@dataclass(frozen=True)
class Continuous(Revolute):
    """A revolute joint without limits, as URDF calls it.  Allows 1, removes 5."""

    type_name = "continuous"


@dataclass(frozen=True)
class Prismatic(AxisJoint):
    """S slides along the common z axis without turning.  Allows 1, removes 5."""

    sentence = "S slides along the axis {z} that it shares with P, without turning."
    formula = r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = q \mathbf{e}_{z}"
    type_name = "prismatic"
    look = JointLook((SymbolPart("box", (2.2, 2.2, 4.0)),), slides=True)
    coordinates = (Coordinate("", "length"),)
    held = "xy"
    kept = "xyz"


@dataclass(frozen=True)
class Screw(AxisJoint):
    """S turns about the common z axis and slides along it by ``pitch`` (m) per turn.  Allows 1, removes 5.

    The coordinate is the angle; a positive pitch is a right-handed thread (Shabana, sec. 7.7, screw joint).
    """

    sentence = "S turns about the common axis {z} and advances by the pitch $p$ in each turn."
    formula = r"\mathbf{R}_{PS} = \mathbf{R}_{z}(q), \quad \mathbf{u} = \frac{p}{2\pi} q \mathbf{e}_{z}"
    type_name = "screw"
    look = JointLook((SymbolPart("cylinder", (1.2, 0.6)), SymbolPart("cylinder", (0.8, 2.4))), slides=True)
    counts_turns = True
    coordinates = (Coordinate("", "angle"),)
    held = "xy"
    kept = "z"
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
        return [*super().closure(graph, rotation, position), Closure("thread", self.lead * off, "length")]

    def closure_in_turns(self, graph: Graph, rotation: Mat3, position: Vec3, turn: Expr) -> list[Closure]:
        thread = Closure("thread", position[2] - self.lead * turn, "length")
        return [*super().closure(graph, rotation, position), thread]

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        return [position[2] / self.lead]


# -- several degrees of freedom ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cylindrical(AxisJoint):
    """S slides along the common z axis and turns about it.  Allows 2, removes 4."""

    sentence = "S slides along the common axis {z} and turns about it."
    formula = r"\mathbf{R}_{PS} = \mathbf{R}_{z}(q_2), \quad \mathbf{u} = q_1 \mathbf{e}_{z}"
    type_name = "cylindrical"
    look = JointLook((SymbolPart("cylinder", (1.0, 3.2)),), slides=True)
    coordinates = (Coordinate("_z", "length"), Coordinate("_3", "angle"))
    held = "xy"
    kept = "z"


@dataclass(frozen=True)
class Planar(AxisJoint):
    """S moves in the x-y plane of P and turns about z.  Allows 3, removes 3."""

    sentence = "S slides along the axes {x} and {y} of P and turns about the axis {z}."
    formula = r"\mathbf{R}_{PS} = \mathbf{R}_{z}(q_3), \quad \mathbf{u} = q_1 \mathbf{e}_{x} + q_2 \mathbf{e}_{y}"
    type_name = "planar"
    look = JointLook((SymbolPart("box", (3.0, 3.0, 0.8)),))
    coordinates = (Coordinate("_x", "length"), Coordinate("_y", "length"), Coordinate("_3", "angle"))
    held = "z"
    kept = "z"


@dataclass(frozen=True)
class Translational(AxisJoint):
    """S slides along x, y and z of P without turning.  Allows 3, removes 3."""

    sentence = "S slides along the three axes of P without turning."
    formula = r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = q_1 \mathbf{e}_x + q_2 \mathbf{e}_y + q_3 \mathbf{e}_z"
    type_name = "translational"
    look = JointLook((SymbolPart("box", (1.6, 1.6, 1.6)),))
    has_axis = False
    coordinates = tuple(Coordinate(f"_{axis}", "length") for axis in "xyz")
    kept = "xyz"


@dataclass(frozen=True)
class Weld(AxisJoint):
    """S is fixed to P.  Allows 0, removes 6."""

    sentence = "S is fixed to P."
    formula = r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = \mathbf{0}"
    type_name = "weld"
    look = JointLook((SymbolPart("box", (0.9, 0.9, 0.9)),))
    has_axis = False
    held = "xyz"
    kept = "xyz"


# -- two angles between shafts -----------------------------------------------------------------------------------------


TWO_ANGLES = (Coordinate("_1", "angle"), Coordinate("_2", "angle"))


@dataclass(frozen=True)
class Universal(Joint):
    """A cross turns about the axis {x} of P and the axis {y} of S, which stay perpendicular.  Allows 2, removes 4.

    R = R_x(q1) R_y(q2); the shafts are the z axes, in line at zero (Shabana, sec. 7.7, universal joint).
    """

    sentence = "A cross turns about the axis {x} of P and the axis {y} of S, which stay perpendicular."
    formula = r"\mathbf{R}_{PS} = \mathbf{R}_{x}(q_1) \mathbf{R}_{y}(q_2), \quad \mathbf{u} = \mathbf{0}"
    type_name = "universal"
    look = JointLook((SymbolPart("cylinder", (0.4, 2.6), "x", "P"), SymbolPart("cylinder", (0.4, 2.6), "y")))
    coordinates = TWO_ANGLES
    held = "xyz"
    has_axes = True

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return euler(graph, "xy", q), vec.zero(graph)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        return [(g, vec.zero(graph)) for g in euler_rates(graph, "xy", q)]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        return [*super().closure(graph, rotation, position), Closure("x.y", rotation[0][1], "angle")]

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

    sentence = "The shaft along the axis {z} bends about any axis across it and passes its turning on evenly."
    formula = r"\omega_S \cdot \mathbf{e}_{z}^S = \omega_P \cdot \mathbf{e}_{z}^P"
    type_name = "constant_velocity"
    look = JointLook((SymbolPart("sphere", (1.0,)), SymbolPart("cylinder", (0.4, 3.0), "x")))
    coordinates = TWO_ANGLES
    held = "xyz"

    def _angles(self, q: Sequence[Expr]) -> tuple[Expr, Expr, Expr]:
        return 0.5 * q[0], q[1], 0.5 * q[0]

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return euler(graph, "xyx", self._angles(q)), vec.zero(graph)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        first, second, third = euler_rates(graph, "xyx", self._angles(q))
        o = vec.zero(graph)
        return [(vec.scale(graph.constant(0.5), vec.add(first, third)), o), (second, o)]

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        bend = Closure("x.y", rotation[1][0] - rotation[0][1], "angle")  # 4 e0 e3
        return [*super().closure(graph, rotation, position), bend]

    def aligned(self, rotation: Mat3) -> list[Expr]:
        return [rotation[0][0] + rotation[1][1]]  # 2 (e0^2 - e3^2): it is e3 that vanishes, not e0

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        """From 4 e0 e1, 4 e0 e2 and 4 e0^2 with e = (cos q2/2 cos q1/2, cos q2/2 sin q1/2, sin q2/2, 0)."""
        scalar = 1.0 + rotation[0][0] + rotation[1][1] + rotation[2][2]
        about_x, about_y = rotation[2][1] - rotation[1][2], rotation[0][2] - rotation[2][0]
        across = sqrt(scalar * scalar + about_x * about_x)
        return [2.0 * atan2(about_x, scalar), 2.0 * atan2(about_y, across)]


# -- all axes ----------------------------------------------------------------------------------------------------------


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

    has_axis = False
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

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        n = len(self.place)
        turn = parameter_rotation(graph, q[n:]) if self.in_parameters else euler(graph, self.sequence, q[n:])
        return turn, (q[0], q[1], q[2]) if n else vec.zero(graph)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        """Columns of the angular velocity are constant for Euler parameters."""
        n, o, places = len(self.place), vec.zero(graph), list[tuple[Vec3, Vec3]]()
        if n:
            places = [(o, row) for row in self.pose(graph, q)[0]]
        if self.in_parameters:
            return places + [(unit(graph, k), o) for k in range(3)]
        return places + [(g, o) for g in euler_rates(graph, self.sequence, q[n:])]

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        parameters = self.in_parameters
        turn = euler_parameters_from_matrix(rotation) if parameters else euler_angles(graph, self.sequence, rotation)
        return [*position[: len(self.place)], *turn]


@dataclass(frozen=True)
class Spherical(RotatingJoint):
    """S turns freely about the common origin.  Allows 3, removes 3."""

    sentence = "S turns about its origin, which stays at the origin of P."
    formula = r"\mathbf{R}_{PS} = \mathbf{R}(q_1,q_2,q_3), \quad \mathbf{u} = \mathbf{0}"
    type_name = "spherical"
    look = JointLook((SymbolPart("sphere", (1.0,)),))
    coordinates = ANGLES
    held = "xyz"


@dataclass(frozen=True)
class Free(RotatingJoint):
    """S moves freely: three coordinates of its position in P axes, then its rotation.  Allows 6, removes 0."""

    sentence = "S moves without hindrance: three displacements in the axes of P, then three rotations."
    formula = (
        r"\mathbf{R}_{PS} = \mathbf{R}(q), \quad \mathbf{u} = q_1 \mathbf{e}_x + q_2 \mathbf{e}_y + q_3 \mathbf{e}_z"
    )
    type_name = "free"
    place = PLACE
    coordinates = PLACE + ANGLES


# -- guides: S is led by a curve or a surface of P; they stay in the tree ----------------------------------------------


ALONG_CURVE = (Coordinate("_s", "length"),)
ON_SURFACE = (Coordinate("_u", "length"), Coordinate("_v", "length"))


class GuidePoint(Vector):
    """Three expressions [x, y, z] of the joint's own first coordinates and of parameters."""

    schema = ref("vector")

    def read(self, reader: Any, path: str, value: Any, *own: Any) -> Shape:
        """A point as expressions of parameters of the model and of coordinates of the joint, ``own``."""
        (names,), point = own, reader.vector(path, value, self.level)
        shown = " and ".join(names)
        for name in sorted(symbols_of(point) - {*reader.names.of("parameter"), *names}):
            if name in reader.names.kinds:
                message = f"the {reader.names.kinds[name]} {name!r} cannot be used here"
                reader.fault(path, message, f"allowed are parameters and {shown}", "EG-REFERENCE")
        if not symbols_of(point) & {*names} and not reader.faults.under(path):
            remedy = f"use the joint's own {shown} in the expressions"
            reader.fault(path, f"does not depend on {shown}", remedy, "EG-EXPRESSION")
        return Shape(point, tuple(reader.graph.symbol(name) for name in names))

    def absent(self, reader: Any) -> Shape:
        return Shape((reader.stand_in,) * 3, ())


CURVE = GuidePoint(
    "point of the curve in the predecessor's axes (m), as expressions of the joint's coordinate s",
    required=True,
    level=MOTION,
    own=1,
    dimension=LENGTH,
)
SURFACE = GuidePoint(
    "point of the surface in the predecessor's axes (m), as expressions of the joint's coordinates u and v",
    required=True,
    level=MOTION,
    own=2,
    dimension=LENGTH,
)


@dataclass(frozen=True)
class Guide(Joint):
    """The origin of S is at a point r of P that depends on the first coordinates, the parameters of the shape.

    The parameters cannot be told from a pose without solving equations, so such a joint never closes a loop: another
    joint of the loop is cut.  Singular where the derivatives of r by its parameters vanish or are parallel.
    """

    role = "tree"
    has_axis = False
    look = JointLook((SymbolPart("sphere", (1.0,)),))

    @property
    def shape(self) -> Shape:
        """The point r and its parameters."""
        found: Shape = getattr(self, next(iter(self.options)))
        return found

    def turn(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, list[Vec3]]:
        """Rotation of S in P and the columns of its angular velocity for the coordinates behind the parameters."""
        return vec.identity(graph), []

    def pose(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, Vec3]:
        return self.turn(graph, q)[0], self._at(q, self.shape.point)

    def subspace(self, graph: Graph, q: Sequence[Expr]) -> list[tuple[Vec3, Vec3]]:
        rotation, rates = self.turn(graph, q)
        o = vec.zero(graph)
        point, parameters = self.shape
        columns = []
        for parameter in parameters:
            x, y, z = jvp(list(point), {parameter: graph.one})
            columns.append((o, vec.transpose_times(rotation, self._at(q, (x, y, z)))))
        return [*columns, *((rate, o) for rate in rates)]

    def _at(self, q: Sequence[Expr], point: Vec3) -> Vec3:
        parameters = self.shape.parameters
        x, y, z = substitute(list(point), dict(zip(parameters, q[: len(parameters)], strict=True)))
        return (x, y, z)

    def closure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Closure]:
        raise TypeError(f"a {self.type_name} joint cannot be cut")

    def measure(self, graph: Graph, rotation: Mat3, position: Vec3) -> list[Expr]:
        raise TypeError(f"a {self.type_name} joint cannot be cut")


class TurningGuide(Guide):
    """A guide on which S also turns freely about its origin, in Euler angles."""

    sequence: str

    def turn(self, graph: Graph, q: Sequence[Expr]) -> tuple[Mat3, list[Vec3]]:
        angles = q[len(self.shape.parameters) :]
        return euler(graph, self.sequence, angles), euler_rates(graph, self.sequence, angles)


@dataclass(frozen=True)
class CurveSlider(Guide):
    """The origin of S slides along a curve of P, without turning: a bead on a wire.  Allows 1, removes 5."""

    sentence = (
        "The origin of S slides along a curve of P without turning; the coordinate is the parameter of the curve."
    )
    formula = r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = \mathbf{r}(q)"
    type_name = "curve_slider"
    coordinates = (Coordinate("", "length"),)
    curve: Shape = key(CURVE)


@dataclass(frozen=True)
class SurfaceSlider(Guide):
    """The origin of S slides on a surface of P, without turning: a particle in a bowl.  Allows 2, removes 4."""

    sentence = (
        "The origin of S slides on a surface of P without turning; the coordinates are the parameters of the surface."
    )
    formula = r"\mathbf{R}_{PS} = \mathbf{1}, \quad \mathbf{u} = \mathbf{r}(q_1,q_2)"
    type_name = "surface_slider"
    coordinates = ON_SURFACE
    surface: Shape = key(SURFACE)


@dataclass(frozen=True)
class PointOnCurve(TurningGuide):
    """The origin of S slides along a curve of P; S turns freely, in Euler angles.  Allows 4, removes 2.

    A point on a curve (Shabana, sec. 3.2, point follower): of the curve's point r(s) only s is free.
    """

    sentence = "The origin of S slides along a curve of P, and S turns freely."
    formula = r"\mathbf{u} = \mathbf{r}(q_1)"
    type_name = "point_on_curve"
    coordinates = (*ALONG_CURVE, *ANGLES)
    curve: Shape = key(CURVE)
    sequence: str = key(SEQUENCE)


@dataclass(frozen=True)
class PointOnSurface(TurningGuide):
    """The origin of S slides on a surface of P; S turns freely, in Euler angles.  Allows 5, removes 1."""

    sentence = "The origin of S slides on a surface of P, and S turns freely."
    formula = r"\mathbf{u} = \mathbf{r}(q_1,q_2)"
    type_name = "point_on_surface"
    coordinates = (*ON_SURFACE, *ANGLES)
    surface: Shape = key(SURFACE)
    sequence: str = key(SEQUENCE)


# -- rods and conditions on axes, without coordinates ------------------------------------------------------------------


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
    length: Expr = key(ROD_LENGTH)

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
    length: Expr = key(ROD_LENGTH)

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
