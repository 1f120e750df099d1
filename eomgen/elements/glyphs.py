"""What elements look like in a picture: solids and lines in sizes of a symbol, which a type of element names.

A symbol is about a fortieth of the picture, so that a joint looks the same in a watch and in a crane.  Types of joints
have a :class:`JointLook` in the axes of their markers (z is the axis); force elements and constraints answer
``glyphs()`` with what of themselves is to be seen.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..expr.core import Expr
from .frames import Marker, WrapCylinder

Points = tuple[tuple[float, ...], ...]


class SymbolPart(NamedTuple):
    """A solid of a joint's symbol, in sizes of a symbol."""

    shape: str  #: box, cylinder or sphere
    size: tuple[float, ...]  #: edges of a box; radius and length of a cylinder; radius of a sphere
    axis: str = "z"  #: where a cylinder lies, in the axes of the marker
    on: str = "S"  #: marker it is fixed to: P or S


class JointLook(NamedTuple):
    """The symbol of a type of joint."""

    pieces: tuple[SymbolPart, ...] = ()
    slides: bool = False  #: whether S slides along z of P: a rail is drawn, or a cylinder with its rod
    bar: bool = False  #: whether a rod without mass joins the two origins


class Drawn(NamedTuple):
    """Lines from marker to marker, or at a joint."""

    stops: tuple[Marker | WrapCylinder, ...] = ()  #: what it runs over, in order; one marker: lines about its z axis
    #: Or the coordinate of a joint that it acts on: lines about an angle, lines between the markers along a length.
    coordinate: str = ""
    #: Lines from the first stop to the last: part of the way (0 .. 1), and two distances across in sizes of a symbol;
    #: without them a straight line over all stops.
    along: tuple[Points, ...] = ()
    about: tuple[Points, ...] = ()  #: lines in the plane across the axis, in sizes of a symbol
    walls: tuple[Expr, ...] = ()  #: values of a coordinate that is a length, at which walls stand across its axis (m)


class Pull(NamedTuple):
    """A given force or torque at a marker: an arrow whose head is there, or a round one about its axis.

    ``value`` (N or N m) in ground axes, or in those of the marker (``own``).
    """

    marker: Marker
    value: tuple[Expr, Expr, Expr]
    own: bool
    turns: bool


class Wheel(NamedTuple):
    """A wheel of a radius (m) about the z axis of a marker."""

    marker: Marker
    radius: Expr


class PitchCircles(NamedTuple):
    """Two wheels on the axes of two joints, of angles a and b with ratio = r_b / r_a (negative: one is internal).

    Their radii follow from the distance of the axes.  Where a stands still, the joint of ``beside`` has its axis, and a
    is part of what carries that joint.  ``belt``: the wheels do not touch, and a belt runs over them; ``radius`` (m) is
    that of the first where it is known.
    """

    a: Expr
    b: Expr
    ratio: Expr
    beside: Expr | None = None
    belt: bool = False
    radius: Expr | None = None


class Contour(NamedTuple):
    """A closed or open line in the axes of a marker: a point (m) as expressions of one symbol, from low to high.

    ``follower``: the marker that is held to it, where there is one; ``face``: with a flat face across its z axis.
    """

    marker: Marker
    point: tuple[Expr, Expr, Expr]
    parameter: Expr
    low: float
    high: float
    follower: Marker | None = None
    face: bool = False


class RackAndPinion(NamedTuple):
    """A pinion of a radius (m, signed) at the joint of one angle, and a rack at the joint of one length."""

    pinion: Expr
    rack: Expr
    radius: Expr


class LiftCurve(NamedTuple):
    """The curve that a follower describes on its cam: its coordinate over that of the cam less a phase."""

    cam: Expr
    follower: Expr
    lift: Expr
    parameter: Expr
    phase: Expr


Glyph = Drawn | Pull | Wheel | PitchCircles | Contour | RackAndPinion | LiftCurve


def _arc(radius: float, start: float, end: float, steps: int, rise: float = 0.0) -> Points:
    """About the origin, angles in degrees; its radius grows by ``rise`` in each step."""
    turns = [(radius + rise * k, math.radians(start + (end - start) * k / steps)) for k in range(steps + 1)]
    return tuple((round(r * math.cos(a), 3), round(r * math.sin(a), 3)) for r, a in turns)


def _helix(turns: int, begin: float, end: float, radius: float) -> Points:
    count = 12 * turns
    way = [(begin + (end - begin) * k / count, 2 * math.pi * turns * k / count) for k in range(count + 1)]
    coil = tuple((round(s, 3), round(radius * math.sin(a), 3), round(radius * (math.cos(a) - 1.0), 3)) for s, a in way)
    return ((0.0, 0.0, 0.0), *coil, (1.0, 0.0, 0.0))


def _square(begin: float, end: float, half: float) -> Points:
    """A closed rectangle along the way."""
    return ((begin, half, 0.0), (end, half, 0.0), (end, -half, 0.0), (begin, -half, 0.0), (begin, half, 0.0))


#: a helical spring
COIL: tuple[Points, ...] = (_helix(7, 0.15, 0.85, 0.9),)
#: a pot with a piston
DASHPOT: tuple[Points, ...] = (
    ((0.0, 0.0, 0.0), (0.35, 0.0, 0.0)),
    ((0.65, 0.8, 0.0), (0.35, 0.8, 0.0), (0.35, -0.8, 0.0), (0.65, -0.8, 0.0)),
    ((0.55, 0.6, 0.0), (0.55, -0.6, 0.0)),
    ((0.55, 0.0, 0.0), (1.0, 0.0, 0.0)),
)
#: a hydraulic or pneumatic cylinder: barrel, piston and rod
CYLINDER: tuple[Points, ...] = (
    ((0.0, 0.0, 0.0), (0.12, 0.0, 0.0)),
    _square(0.12, 0.6, 0.8),
    ((0.42, 0.8, 0.0), (0.42, -0.8, 0.0)),
    ((0.42, 0.0, 0.0), (1.0, 0.0, 0.0)),
)
#: rubber: a crossed block
RUBBER: tuple[Points, ...] = (
    ((0.0, 0.0, 0.0), (0.3, 0.0, 0.0)),
    _square(0.3, 0.7, 0.9),
    ((0.3, 0.9, 0.0), (0.7, -0.9, 0.0)),
    ((0.3, -0.9, 0.0), (0.7, 0.9, 0.0)),
    ((0.7, 0.0, 0.0), (1.0, 0.0, 0.0)),
)
#: a spiral spring about an axis
SPIRAL: tuple[Points, ...] = (_arc(1.3, 0, 900, 50, rise=0.025),)
#: the turning pot of a damper about an axis
TURNING_DASHPOT: tuple[Points, ...] = (_arc(1.6, 20, 160, 12), _arc(2.2, 0, 180, 16))
#: a round arrow: a motor or torque about an axis
ROUND_ARROW: tuple[Points, ...] = (_arc(2.1, -60, 170, 20), ((-2.5, 0.95), (-2.07, 0.36), (-1.45, 0.75)))
#: stops about an axis
STOP: tuple[Points, ...] = (((1.4, 1.0), (2.6, 1.9)), ((1.4, -1.0), (2.6, -1.9)), _arc(1.72, -35, 35, 8))
#: a cross within a square, about an axis
CROSS: tuple[Points, ...] = (
    ((-0.7, -0.7), (0.7, -0.7), (0.7, 0.7), (-0.7, 0.7), (-0.7, -0.7)),
    ((-0.7, -0.7), (0.7, 0.7)),
    ((-0.7, 0.7), (0.7, -0.7)),
)
#: an arrow along the way
ARROW: tuple[Points, ...] = (((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), ((0.82, 0.7, 0.0), (1.0, 0.0, 0.0), (0.82, -0.7, 0.0)))
#: a law of the model's own between two points: a plain box
LAW_BOX: tuple[Points, ...] = (
    ((0.0, 0.0, 0.0), (0.4, 0.0, 0.0)),
    _square(0.4, 0.6, 0.5),
    ((0.6, 0.0, 0.0), (1.0, 0.0, 0.0)),
)
#: and about an axis
LAW_RING: tuple[Points, ...] = (_arc(1.9, 0, 360, 24),)
#: a part of the plane on which something rolls or stands, across the axis that points out of the solid
PLANE: tuple[Points, ...] = (((12.0, 12.0), (-12.0, 12.0), (-12.0, -12.0), (12.0, -12.0), (12.0, 12.0)),)
