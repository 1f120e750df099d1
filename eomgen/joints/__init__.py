"""Joints: one short class a type; :data:`JOINTS` is the literal table of all of them."""

from .base import Closure, Coordinate, Joint
from .many_degrees import Cylindrical, Free, Planar, Spherical, Weld
from .one_degree import Prismatic, Revolute

JOINTS: dict[str, type[Joint]] = {
    joint.type_name: joint for joint in (Revolute, Prismatic, Cylindrical, Spherical, Planar, Free, Weld)
}

__all__ = [
    "JOINTS",
    "Closure",
    "Coordinate",
    "Cylindrical",
    "Free",
    "Joint",
    "Planar",
    "Prismatic",
    "Revolute",
    "Spherical",
    "Weld",
]
