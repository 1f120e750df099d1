"""Force elements: geometry (a path or a marker) times a law; :data:`FORCES` is the table of their types."""

from ..element_type import ElementType, Types
from . import actuators, attraction, bushing, creep, friction, laws, muscle, springs, stops, tyres
from .actuators import Actuator, BodyTorque, PointForce
from .attraction import PointGravity
from .bushing import Bushing
from .creep import Creep
from .force import CoordinateLoad, Force, Load, MarkerLoad, View
from .friction import JointFriction, ReactionFriction
from .friction_laws import BrownMcPhee, Friction, LuGre
from .laws import GeneralElement
from .muscle import Muscle
from .normal_laws import DampedLinear, HuntCrossley, NormalLaw
from .paths import JointCoordinate, Line, Path, Route, Turn
from .springs import Damper, Spring
from .stops import JointStop
from .tyres import Tyre

FORCES: Types = {}
for _home in (actuators, springs, laws, bushing, attraction, friction, stops, muscle, creep, tyres):
    FORCES |= _home.TYPES

__all__ = [
    "FORCES",
    "Actuator",
    "BodyTorque",
    "BrownMcPhee",
    "Bushing",
    "CoordinateLoad",
    "Creep",
    "DampedLinear",
    "Damper",
    "ElementType",
    "Force",
    "Friction",
    "GeneralElement",
    "HuntCrossley",
    "JointCoordinate",
    "JointFriction",
    "JointStop",
    "Line",
    "Load",
    "LuGre",
    "MarkerLoad",
    "Muscle",
    "NormalLaw",
    "Path",
    "PointForce",
    "PointGravity",
    "ReactionFriction",
    "Route",
    "Spring",
    "Turn",
    "Tyre",
    "View",
]
