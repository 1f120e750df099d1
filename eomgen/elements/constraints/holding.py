"""Constraint elements: a marker held where it is on another body, for constraints that close and open."""

from __future__ import annotations

from typing import ClassVar

from ...base.records import dataclass
from ...expr import vectors as vec
from ..element_type import ElementType, Entry, table
from ..frames import Marker
from ..kinds import Choice, Pair
from ..looks import CROSS, Drawn, Seen
from .constraint import VELOCITY, Condition, Constraint, ConstraintView, on_two_bodies

AXES = ("xyz", "xy", "x", "y", "z", "xz", "yz")


@dataclass(frozen=True)
class Hold(Constraint):
    """A marker that does not move on the body of another marker, along some of that marker's axes.

    It is held wherever it is: its velocity on the other body is 0, and with ``turning`` its angular velocity too.
    """

    sentence: ClassVar[str] = "The marker does not move on the other body while it is held."
    formula: ClassVar[str] = r"\mathbf{v}_b - \mathbf{v}_a = \mathbf{0}"
    type_name: ClassVar[str] = "hold"
    on: Marker
    marker: Marker
    axes: str
    turning: str

    def drawn(self) -> list[Seen]:
        return [Drawn((self.marker,), about=CROSS)]

    def conditions(self, view: ConstraintView) -> list[Condition]:
        apart = vec.sub(view.position(self.marker), view.position(self.on))
        under = vec.add(view.velocity(self.on), vec.cross(view.angular_velocity(self.on), apart))
        axes = view.rotation(self.on)
        slip = vec.transpose_times(axes, vec.sub(view.velocity(self.marker), under))
        turn = vec.sub(view.angular_velocity(self.marker), view.angular_velocity(self.on))
        spin = vec.transpose_times(axes, turn)
        rows = [Condition(f"v{axis}", slip["xyz".index(axis)], "length", VELOCITY) for axis in self.axes]
        return rows + [Condition(f"w{axis}", spin["xyz".index(axis)], "angle", VELOCITY) for axis in self.turning]


def _hold(e: Entry) -> Constraint | None:
    pair, axes, turning = e.pair(), e["axes"], e["turning"]
    if not {"closes", "opens", "closed"} & e.values.keys():
        remedy = "give closes, opens or closed; for good a joint holds bodies"
        e.fault("", "is neither closed nor opened", remedy, "EG-MISSING")
    if pair is None or not on_two_bodies(e, "between", *pair):
        return None
    return Hold(e.name, *pair, axes, "" if turning == "none" else turning)


TYPES = table(
    ElementType(
        "hold",
        "a marker held where it is on another body while it is closed: a foot on the ground, a grasp, a clutch.",
        {
            "between": Pair("marker whose body holds, and the marker that is held", required=True),
            "axes": Choice(
                "axes of the first marker along which the second does not move", default="xyz", choices=AXES
            ),
            "turning": Choice(
                "axes of the first marker about which the second does not turn",
                default="none",
                choices=("none", *AXES),
            ),
        },
        _hold,
    )
)
