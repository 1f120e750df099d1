"""Stage describe, solids: box, sphere and ellipsoid, placed by their centres."""

from __future__ import annotations

import math
from typing import ClassVar

from ..elements.dimensions import LENGTH
from ..elements.kinds import Fields, Scalar, Vector
from ..graph.core import Expr
from ..graph.vectors import Vec3
from ..records import dataclass
from .solid import Solid


@dataclass(frozen=True)
class Box(Solid):
    """A rectangular block; edges along its axes."""

    type_name: ClassVar[str] = "box"
    dimensions: ClassVar[Fields] = {"size": Vector("edges along x, y, z (m)", required=True, dimension=LENGTH)}

    def content(self) -> Expr:
        a, b, c = self.lengths["size"]
        return a * b * c

    def gyration(self) -> Vec3:
        a, b, c = (x * x / 12.0 for x in self.lengths["size"])
        return (b + c, a + c, a + b)


@dataclass(frozen=True)
class Ellipsoid(Solid):
    """An ellipsoid; half axes along its axes."""

    type_name: ClassVar[str] = "ellipsoid"
    dimensions: ClassVar[Fields] = {"semi_axes": Vector("half axes along x, y, z (m)", required=True, dimension=LENGTH)}

    def content(self) -> Expr:
        a, b, c = self.lengths["semi_axes"]
        return (4.0 / 3.0 * math.pi) * a * b * c

    def gyration(self) -> Vec3:
        a, b, c = (0.2 * x * x for x in self.lengths["semi_axes"])
        return (b + c, a + c, a + b)


@dataclass(frozen=True)
class Sphere(Solid):
    """A ball."""

    type_name: ClassVar[str] = "sphere"
    dimensions: ClassVar[Fields] = {"radius": Scalar("radius (m)", required=True, dimension=LENGTH)}

    def content(self) -> Expr:
        r = self.length("radius")
        return (4.0 / 3.0 * math.pi) * r * r * r

    def gyration(self) -> Vec3:
        r = self.length("radius")
        return (0.4 * r * r,) * 3
