"""Stage describe, solids: box, sphere and ellipsoid, placed by their centres."""

from __future__ import annotations

import math
from typing import ClassVar

from ..graph.core import Expr
from ..graph.vectors import Vec3
from ..records import dataclass
from .solid import Solid, SolidSize


@dataclass(frozen=True)
class Box(Solid):
    """A rectangular block; edges along its axes."""

    type_name: ClassVar[str] = "box"
    dimensions: ClassVar[dict[str, SolidSize]] = {"size": SolidSize("vector", "edges along x, y, z (m)")}

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
    dimensions: ClassVar[dict[str, SolidSize]] = {"semi_axes": SolidSize("vector", "half axes along x, y, z (m)")}

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
    dimensions: ClassVar[dict[str, SolidSize]] = {"radius": SolidSize("expression", "radius (m)")}

    def content(self) -> Expr:
        r = self.length("radius")
        return (4.0 / 3.0 * math.pi) * r * r * r

    def gyration(self) -> Vec3:
        r = self.length("radius")
        return (0.4 * r * r,) * 3
