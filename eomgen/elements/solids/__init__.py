"""Solids of uniform density: one short class a type; :data:`SOLIDS` is the literal table of all of them."""

from .solid import MassProperties, combine, point
from .solid import Box, Cone, Cylinder, Ellipsoid, Rod, Solid, Sphere, Tube

SOLIDS: dict[str, type[Solid]] = {
    solid.type_name: solid for solid in (Box, Cylinder, Tube, Sphere, Rod, Cone, Ellipsoid)
}

__all__ = [
    "SOLIDS",
    "Cylinder",
    "MassProperties",
    "Rod",
    "Solid",
    "combine",
    "point",
]
