"""Constraint elements: the coordinates of a joint that stay where they are, for constraints that close and open."""

from __future__ import annotations

from typing import ClassVar

from ...base.records import dataclass
from ...expr.core import Expr
from ..element_type import ElementType, Entry, table
from ..kinds import JointReference
from .constraint import VELOCITY, Condition, Constraint, ConstraintView


@dataclass(frozen=True)
class Lock(Constraint):
    """A joint whose coordinates, or one of them, do not change: it is held wherever it is."""

    sentence: ClassVar[str] = "The coordinates of the joint do not change while it is locked."
    formula: ClassVar[str] = r"\dot{q}_k = 0"
    type_name: ClassVar[str] = "lock"
    velocities: tuple[tuple[str, Expr, str], ...]  #: label, the velocity, 'length' or 'angle'

    def conditions(self, view: ConstraintView) -> list[Condition]:
        return [Condition(label, velocity, kind, VELOCITY) for label, velocity, kind in self.velocities]


def _lock(e: Entry) -> Constraint | None:
    velocities = e.velocities("joint")
    if not {"closes", "opens", "closed"} & e.values.keys():
        remedy = "give closes, opens or closed; for good use a joint of type weld"
        e.fault("", "is neither closed nor opened", remedy, "EG-MISSING")
    return None if velocities is None else Lock(e.name, velocities)


TYPES = table(
    ElementType(
        "lock",
        "a joint whose coordinates stay where they are while it is closed: a clutch, a brake, the latch of a door.",
        {"joint": JointReference("joint that is locked, or one of its coordinates", required=True)},
        _lock,
    )
)
