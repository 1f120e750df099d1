"""Stage describe, solids of revolution about their z axis, which ``axis`` can lay elsewhere."""

from __future__ import annotations

import math
from typing import ClassVar

from ..elements.dimensions import LENGTH
from ..elements.kinds import Fields, Scalar
from ..graph.core import Expr
from ..graph.vectors import Vec3
from ..records import dataclass
from .solid import Solid

_LENGTH = Scalar("length along the axis (m)", required=True, dimension=LENGTH)
_RADIUS = Scalar("radius (m)", required=True, dimension=LENGTH)


@dataclass(frozen=True)
class Cylinder(Solid):
    """A full circular cylinder, placed by its centre; of length 0 a disc (which needs a mass)."""

    type_name: ClassVar[str] = "cylinder"
    dimensions: ClassVar[Fields] = {"radius": _RADIUS, "length": _LENGTH}
    has_axis: ClassVar[bool] = True

    def content(self) -> Expr:
        r = self.length("radius")
        return math.pi * r * r * self.length("length")

    def gyration(self) -> Vec3:
        r, l = self.length("radius"), self.length("length")
        across = r * r / 4.0 + l * l / 12.0
        return (across, across, 0.5 * r * r)


@dataclass(frozen=True)
class Tube(Solid):
    """A hollow circular cylinder, placed by its centre."""

    type_name: ClassVar[str] = "tube"
    dimensions: ClassVar[Fields] = {
        "outer_radius": Scalar("outer radius (m)", required=True, dimension=LENGTH),
        "inner_radius": Scalar("inner radius (m)", required=True, dimension=LENGTH),
        "length": _LENGTH,
    }
    has_axis: ClassVar[bool] = True

    def content(self) -> Expr:
        a, b = self.length("outer_radius"), self.length("inner_radius")
        return math.pi * (a - b) * (a + b) * self.length("length")

    def gyration(self) -> Vec3:
        a, b, l = self.length("outer_radius"), self.length("inner_radius"), self.length("length")
        square = a * a + b * b
        across = square / 4.0 + l * l / 12.0
        return (across, across, 0.5 * square)


@dataclass(frozen=True)
class Rod(Solid):
    """A thin straight rod, placed by its middle; ``line_density`` is its mass for each metre."""

    type_name: ClassVar[str] = "rod"
    dimensions: ClassVar[Fields] = {"length": _LENGTH}
    has_axis: ClassVar[bool] = True
    content_key: ClassVar[str] = "line_density"

    def content(self) -> Expr:
        return self.length("length")

    def gyration(self) -> Vec3:
        l = self.length("length")
        across = l * l / 12.0
        return (across, across, self.graph.zero)


@dataclass(frozen=True)
class Cone(Solid):
    """A full circular cone, placed by the centre of its base, its apex along the axis."""

    type_name: ClassVar[str] = "cone"
    dimensions: ClassVar[Fields] = {
        "radius": Scalar("radius of the base (m)", required=True, dimension=LENGTH),
        "length": Scalar("height along the axis (m)", required=True, dimension=LENGTH),
    }
    has_axis: ClassVar[bool] = True

    def content(self) -> Expr:
        r = self.length("radius")
        return (math.pi / 3.0) * r * r * self.length("length")

    def gyration(self) -> Vec3:
        r, h = self.length("radius"), self.length("length")
        across = 0.15 * r * r + 0.0375 * h * h
        return (across, across, 0.3 * r * r)

    def centre(self) -> Vec3:
        zero = self.graph.zero
        return (zero, zero, 0.25 * self.length("length"))
