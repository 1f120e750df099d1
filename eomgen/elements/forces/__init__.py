"""Force elements: geometry (a path or a marker) times a law; :data:`FORCES` is the table of their types."""

from ..element_type import Types
from . import friction, muscle, normal_laws, springs, wheels
from .force import CoordinateLoad, Force, Load, MarkerLoad, View
from .friction import Friction, LuGre, ReactionFriction
from .muscle import Muscle
from .paths import JointCoordinate, Line, Path, Route, Turn
from .springs import Actuator, Bushing, Damper, Spring
from .wheels import Tyre

FORCES: Types = {}
for _home in (springs, friction, normal_laws, muscle, wheels):
    FORCES |= _home.TYPES

__all__ = [
    "FORCES",
    "Actuator",
    "Bushing",
    "CoordinateLoad",
    "Damper",
    "Force",
    "Friction",
    "JointCoordinate",
    "Line",
    "Load",
    "LuGre",
    "MarkerLoad",
    "Muscle",
    "Path",
    "ReactionFriction",
    "Route",
    "Spring",
    "Turn",
    "Tyre",
    "View",
]
