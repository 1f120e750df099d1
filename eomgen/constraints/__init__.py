"""Constraint elements: equations between coordinates or markers; :data:`CONSTRAINTS` is the literal table of them."""

from .base import Condition, Constraint, View
from .cams import CamLift, FlatContact, FlatSupport, KnifeContact, RollerContact
from .couplings import Equation, Linear
from .drivers import AngleDriver, CoordinateDriver, DistanceDriver, Driver, PlaceDriver
from .gears import Belt, Gear, Planetary, Rack
from .rolling import KnifeEdge, RollingDisc, RollingSphere

CONSTRAINTS: dict[str, type[Constraint]] = {
    constraint.type_name: constraint
    for constraint in (
        Linear,
        Equation,
        Gear,
        Planetary,
        Rack,
        Belt,
        CamLift,
        KnifeContact,
        RollerContact,
        FlatContact,
        FlatSupport,
        RollingDisc,
        RollingSphere,
        KnifeEdge,
        CoordinateDriver,
        DistanceDriver,
        PlaceDriver,
        AngleDriver,
    )
}

__all__ = [
    "CONSTRAINTS",
    "AngleDriver",
    "Belt",
    "CamLift",
    "Condition",
    "Constraint",
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
    "RollingDisc",
    "RollingSphere",
    "View",
]
