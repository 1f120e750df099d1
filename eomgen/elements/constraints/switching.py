"""Constraint elements that hold for a time only: a marker on a body, the coordinates of a joint."""

from __future__ import annotations

from ...expr import vectors as vec
from ...expr.core import Expr
from ..element_type import ElementType, Entry, Where, element, key
from ..frames import Marker, velocity_at
from ..glyphs import CROSS, Drawn, Glyph
from ..kinds import Choice, JointReference, Pair
from .constraint import VELOCITY, Condition, Constraint, ConstraintView, is_switched, on_two_bodies, switchable

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

    def glyphs(self) -> list[Glyph]:
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


def _lock(e: Entry) -> Constraint | None:
    velocities = e.velocities("joint")
    _require_switch(e, "use a joint of type weld")
    return None if velocities is None else Lock(e.name, velocities)


TYPES = switchable(
    element(
        Hold,
        "hold",
        "a marker fixed on another body at its place of closing: a foot on the ground, a grasp, a clutch.",
        Where({"between": Pair("marker of the holding body, and the marker that it holds", required=True)}, _pair),
        check=lambda e, values: values.update(turning=values["turning"].removeprefix("none")),
    ),
    ElementType(
        "lock",
        "a joint whose coordinates stay where they are while it is closed: a clutch, a brake, the latch of a door.",
        {"joint": JointReference("joint that is locked, or one of its coordinates", required=True)},
        _lock,
    ),
)
