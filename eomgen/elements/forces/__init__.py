"""Force elements: geometry (a path or a marker) times a law; :data:`FORCES` is the table of their types."""

from ..element_type import Types
from . import friction, muscle, normal_laws, springs, wheels
from .force import CoordinateLoad, Force, Load, MarkerLoad, View
from .friction import ReactionFriction
from .paths import JointCoordinate, Line, Route, Turn

FORCES: Types = {}
for _home in (springs, friction, normal_laws, muscle, wheels):
    FORCES |= _home.TYPES

__all__ = [
    "FORCES",
    "CoordinateLoad",
    "Force",
    "JointCoordinate",
    "Line",
    "Load",
    "MarkerLoad",
    "ReactionFriction",
    "Route",
    "Turn",
    "View",
]
