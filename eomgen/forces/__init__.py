"""Force elements: geometry (a path or a marker) times a law; :data:`FORCES` is the literal table of the classes."""

from .base import CoordinateLoad, Force, Load, MarkerLoad, View
from .elements import Actuator, BodyTorque, Damper, PointForce, Spring
from .paths import JointCoordinate, Line, Path, Turn

FORCES: dict[str, type[Force]] = {
    force.type_name: force for force in (Spring, Damper, Actuator, PointForce, BodyTorque)
}

__all__ = [
    "FORCES",
    "Actuator",
    "BodyTorque",
    "CoordinateLoad",
    "Damper",
    "Force",
    "JointCoordinate",
    "Line",
    "Load",
    "MarkerLoad",
    "Path",
    "PointForce",
    "Spring",
    "Turn",
    "View",
]
