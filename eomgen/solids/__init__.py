"""Solids of uniform density: one short class a type; :data:`SOLIDS` is the literal table of all of them."""

from .bounded import Box, Ellipsoid, Sphere
from .properties import MassProperties, combine, point
from .round import Cone, Cylinder, Rod, Tube
from .solid import Solid

SOLIDS: dict[str, type[Solid]] = {
    solid.type_name: solid for solid in (Box, Cylinder, Tube, Sphere, Rod, Cone, Ellipsoid)
}

__all__ = [
    "SOLIDS",
    "Box",
    "Cone",
    "Cylinder",
    "Ellipsoid",
    "MassProperties",
    "Rod",
    "Solid",
    "Sphere",
    "Tube",
    "combine",
    "point",
]
