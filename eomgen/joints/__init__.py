"""Joints: one short class a type; :data:`JOINTS` is the literal table of all of them."""

from .base import Ball, Closure, Coordinate, Joint, Velocity
from .many_degrees import Cylindrical, Planar, Weld
from .one_degree import Prismatic, Revolute
from .turning import Free, Spherical

JOINTS: dict[str, type[Joint]] = {
    joint.type_name: joint for joint in (Revolute, Prismatic, Cylindrical, Spherical, Planar, Free, Weld)
}

__all__ = [
    "JOINTS",
    "Ball",
    "Closure",
    "Coordinate",
    "Cylindrical",
    "Free",
    "Joint",
    "Planar",
    "Prismatic",
    "Revolute",
    "Spherical",
    "Velocity",
    "Weld",
]
