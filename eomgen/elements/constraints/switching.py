"""Constraint elements that close and open: keys by which any constraint holds for a time, and what only does so."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...expr import vectors as vec
from ...expr.core import Expr
from ..dimensions import SPIN
from ..element_type import ElementType, Entry, Types, Where, element, key, table
from ..frames import Marker, velocity_at
from ..kinds import LAW, Choice, Fields, Flag, JointReference, Pair, Scalar, SomeNames
from ..looks import CROSS, Drawn, Seen
from .constraint import VELOCITY, Condition, Constraint, ConstraintView, on_two_bodies

#: Of any constraint that may close and open in a run.
SWITCHING: Fields = {
    "closes": Scalar("where it falls to 0 the constraint closes: a plastic impact, after which it holds", level=LAW),
    "opens": Scalar("where it falls to 0 while the constraint holds, it lets go", level=LAW),
    "closed": Flag("whether it holds at the start of a run; false if closes is given, else true"),
    "releases": SomeNames("one or several other constraints that let go as it closes, before the impact"),
    "stabilisation": Scalar(
        "rate (1/s), greater than 0, at which an error of the equation dies away while it holds",
        default=10,
        dimension=SPIN,
    ),
}

#: How a condition of a joint without coordinates is written that holds for a time.
IN_PLACE_OF_JOINTS = (
    "joints without coordinates, except welds, cannot open; use a constraint of type hold: axes: xyz, turning: xyz "
    "acts as a weld, axes: xyz without turning as a ball joint, axes: xy, turning: z in the plane"
)


def switchable(types: Types) -> Types:
    """The types with these keys too."""
    return {name: _with_keys(result) for name, result in types.items()}


def _with_keys(element: ElementType) -> ElementType:
    return element._replace(keys=element.keys | SWITCHING)


def is_switched(values: Mapping[str, Any]) -> bool:
    """Whether an entry says that a constraint or joint closes or opens."""
    return not values.keys().isdisjoint(("closes", "opens", "closed"))


def state_of(name: str) -> str:
    """The first-order state that is 1 while the constraint or joint of a name holds."""
    return f"{name}_closed"


def event_of(name: str, key: str) -> str:
    """The event at which it ``closes`` or ``opens``."""
    return f"{name}_{key}"


# -- what holds for a time only ----------------------------------------------------------------------------------------
AXES = ("xyz", "xy", "x", "y", "z", "xz", "yz")


class Hold(Constraint):
    """A marker that does not move on the body of another marker, along some of that marker's axes.

    It is held wherever it is: its velocity on the other body is 0, and with ``turning`` its angular velocity too.
    """

    sentence = "The marker does not move on the other body while it is held."
    formula = r"\mathbf{v}_b - \mathbf{v}_a = \mathbf{0}"
    on: Marker
    marker: Marker
    axes: str = key(
        Choice("axes of the first marker along which the second does not move", default="xyz", choices=AXES)
    )
    turning: str = key(
        Choice("axes of the first marker about which the second does not turn", default="none", choices=("none", *AXES))
    )

    def drawn(self) -> list[Seen]:
        return [Drawn((self.marker,), about=CROSS)]

    def conditions(self, view: ConstraintView) -> list[Condition]:
        under = velocity_at(view, self.on, vec.sub(view.position(self.marker), view.position(self.on)))
        axes = view.rotation(self.on)
        slip = vec.transpose_times(axes, vec.sub(view.velocity(self.marker), under))
        turn = vec.sub(view.angular_velocity(self.marker), view.angular_velocity(self.on))
        spin = vec.transpose_times(axes, turn)
        rows = [Condition(f"v{axis}", slip["xyz".index(axis)], "length", VELOCITY) for axis in self.axes]
        return rows + [Condition(f"w{axis}", spin["xyz".index(axis)], "angle", VELOCITY) for axis in self.turning]


class Lock(Constraint):
    """A joint whose coordinates, or one of them, do not change: it is held wherever it is."""

    sentence = "The coordinates of the joint do not change while it is locked."
    formula = r"\dot{q}_k = 0"
    velocities: tuple[tuple[str, Expr, str], ...]  #: label, the velocity, 'length' or 'angle'

    def conditions(self, view: ConstraintView) -> list[Condition]:
        return [Condition(label, velocity, kind, VELOCITY) for label, velocity, kind in self.velocities]


def _require_switch(e: Entry, otherwise: str) -> None:
    if not is_switched(e.values):
        remedy = f"give closes, opens or closed; for good {otherwise}"
        e.fault("", "is neither closed nor opened", remedy, "EG-MISSING")


def _pair(e: Entry) -> tuple[Marker, Marker] | None:
    _require_switch(e, "a joint holds bodies")
    pair = e.pair()
    return pair if pair is not None and on_two_bodies(e, "between", *pair) else None


def _check_turning(e: Entry, values: dict[str, Any]) -> None:
    values["turning"] = values["turning"].removeprefix("none")


def _lock(e: Entry) -> Constraint | None:
    velocities = e.velocities("joint")
    _require_switch(e, "use a joint of type weld")
    return None if velocities is None else Lock(e.name, velocities)


TYPES = table(
    element(
        Hold,
        "hold",
        "a marker fixed on another body at its place of closing: a foot on the ground, a grasp, a clutch.",
        Where({"between": Pair("marker of the holding body, and the marker that it holds", required=True)}, _pair),
        check=_check_turning,
    ),
    ElementType(
        "lock",
        "a joint whose coordinates stay where they are while it is closed: a clutch, a brake, the latch of a door.",
        {"joint": JointReference("joint that is locked, or one of its coordinates", required=True)},
        _lock,
    ),
)
