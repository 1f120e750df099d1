"""Force elements: geometry (a path or a marker) times a law; :data:`FORCES` is the literal table of the classes."""

from .attraction import PointGravity
from .base import CoordinateLoad, Force, Load, MarkerLoad, View
from .bushing import Bushing
from .contact import Contact, PointPlane, SpherePlane, SphereSphere
from .elements import Actuator, BodyTorque, Damper, PointForce, Spring
from .friction import Friction, JointFriction
from .laws import Element, TorsionalElement
from .muscle import Muscle
from .normal_laws import HuntCrossley
from .paths import JointCoordinate, Line, Path, Turn
from .routes import Cylinder, Route
from .stops import JointStop

FORCES: dict[str, type[Force]] = {
    force.type_name: force
    for force in (
        Spring,
        Damper,
        Actuator,
        Element,
        TorsionalElement,
        PointForce,
        BodyTorque,
        Bushing,
        PointGravity,
        JointFriction,
        JointStop,
        PointPlane,
        SpherePlane,
        SphereSphere,
        Muscle,
    )
}

__all__ = [
    "FORCES",
    "Actuator",
    "BodyTorque",
    "Bushing",
    "Contact",
    "CoordinateLoad",
    "Cylinder",
    "Damper",
    "Element",
    "Force",
    "Friction",
    "HuntCrossley",
    "JointCoordinate",
    "JointFriction",
    "JointStop",
    "Line",
    "Load",
    "MarkerLoad",
    "Muscle",
    "Path",
    "PointForce",
    "PointGravity",
    "PointPlane",
    "Route",
    "SpherePlane",
    "SphereSphere",
    "Spring",
    "TorsionalElement",
    "Turn",
    "View",
]
