"""Constraint elements: equations between coordinates or markers; :data:`CONSTRAINTS` is the table of their types."""

from ..element_type import Types
from . import cams, constraint, drivers, gears, rolling, switching
from .constraint import Condition, Constraint, ConstraintView, Equation
from .drivers import CoordinateDriver, Driver
from .rolling import RollingDisc
from .switching import switchable

CONSTRAINTS: Types = {}
for _home in (constraint, gears, cams, rolling, drivers, switching):
    CONSTRAINTS |= _home.TYPES if _home in (cams, drivers) else switchable(_home.TYPES)

__all__ = [
    "CONSTRAINTS",
    "Condition",
    "Constraint",
    "ConstraintView",
    "CoordinateDriver",
    "Driver",
    "Equation",
    "RollingDisc",
]
