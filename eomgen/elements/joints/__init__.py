"""Joints: one short class a type; :data:`JOINTS` is the table of all of them."""

from . import joint_types
from .joint import Closure, Coordinate, Joint, QuaternionSlot, Shape, Velocity
from .joint_types import Continuous, Prismatic, Revolute

#: By their words, in the order of their files.
JOINTS: dict[str, type[Joint]] = {
    one.type_name: one
    for one in vars(joint_types).values()
    if isinstance(one, type) and issubclass(one, Joint) and "type_name" in vars(one)
}

__all__ = [
    "JOINTS",
    "Closure",
    "Continuous",
    "Coordinate",
    "Joint",
    "Prismatic",
    "QuaternionSlot",
    "Revolute",
    "Shape",
    "Velocity",
]
