"""Constraint elements: equations between coordinates or markers; :data:`CONSTRAINTS` is the table of their types."""

from ..elements.element_type import Types
from . import cams, couplings, drivers, gears, planetary, rolling_types
from .cams import CamLift, FlatContact, FlatSupport, KnifeContact, RollerContact
from .constraint import Condition, Constraint, ConstraintView
from .convex_rolling import RollingConvex
from .couplings import Equation, Linear
from .drivers import AngleDriver, CoordinateDriver, DistanceDriver, Driver, PlaceDriver
from .gears import Belt, Gear, Rack
from .planetary import Planetary
from .rolling import KnifeEdge, RollingDisc, RollingSphere

CONSTRAINTS: Types = {}
for _home in (couplings, gears, planetary, cams, rolling_types, drivers):
    CONSTRAINTS |= _home.TYPES

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
    "KnifeContact",
    "KnifeEdge",
    "Linear",
    "PlaceDriver",
    "Planetary",
    "Rack",
    "RollerContact",
    "RollingConvex",
    "RollingDisc",
    "RollingSphere",
]
