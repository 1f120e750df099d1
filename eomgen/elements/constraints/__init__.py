"""Constraint elements: equations between coordinates or markers; :data:`CONSTRAINTS` is the table of their types."""

from ..element_type import Types
from . import cams, couplings, drivers, gears, holding, locking, planetary, rolling
from .cams import CamLift, FlatContact, FlatSupport, KnifeContact, RollerContact
from .constraint import Condition, Constraint, ConstraintView
from .couplings import Equation, Linear
from .drivers import AngleDriver, CoordinateDriver, DistanceDriver, Driver, PlaceDriver
from .gears import Belt, Gear, Rack
from .holding import Hold
from .locking import Lock
from .planetary import Planetary
from .rolling import KnifeEdge, RollingConvex, RollingDisc, RollingSphere
from .switching import switchable

CONSTRAINTS: Types = {}
for _home in (couplings, gears, planetary, cams, rolling, drivers, holding, locking):
    CONSTRAINTS |= _home.TYPES if _home in (cams, drivers) else switchable(_home.TYPES)

__all__ = [
    "CONSTRAINTS",
    "AngleDriver",
    "Belt",
    "CamLift",
    "Condition",
    "Constraint",
    "ConstraintView",
    "CoordinateDriver",
    "DistanceDriver",
    "Driver",
    "Equation",
    "FlatContact",
    "FlatSupport",
    "Gear",
    "Hold",
    "KnifeContact",
    "KnifeEdge",
    "Linear",
    "Lock",
    "PlaceDriver",
    "Planetary",
    "Rack",
    "RollerContact",
    "RollingConvex",
    "RollingDisc",
    "RollingSphere",
]
