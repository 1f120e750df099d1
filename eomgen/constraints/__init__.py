"""Constraint elements: equations between coordinates or markers; :data:`CONSTRAINTS` is the literal table of them."""

from .base import Condition, Constraint, View
from .cams import CamLift, FlatContact, FlatSupport, KnifeContact, RollerContact
from .couplings import Equation, Linear
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
    )
}

__all__ = [
    "CONSTRAINTS",
    "Belt",
    "CamLift",
    "Condition",
    "Constraint",
    "Equation",
    "FlatContact",
    "FlatSupport",
    "Gear",
    "KnifeContact",
    "KnifeEdge",
    "Linear",
    "Planetary",
    "Rack",
    "RollerContact",
    "RollingDisc",
    "RollingSphere",
    "View",
]
