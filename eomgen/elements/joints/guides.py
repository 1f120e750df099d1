"""Joints whose successor's origin is guided by a curve or a surface of the predecessor; they stay in the tree."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...base.records import dataclass
from ...expr import vectors as vec
from ...expr.core import Expr, Graph, substitute, symbols_of
from ...expr.differentiate import jvp
from ...expr.vectors import Mat3, Vec3
from ..dimensions import LENGTH
from ..element_type import key
from ..kinds import MOTION, Vector, ref
from ..looks import JointLook, SymbolPart
from .joint import SEQUENCE, Closure, Coordinate, Joint, Shape, euler, euler_rates

ANGLES = tuple(Coordinate(f"_{k}", "angle") for k in (1, 2, 3))
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
