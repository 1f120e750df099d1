"""Stage verification, swaps: predecessor and successor of joints exchanged, so that coordinates change their signs."""

from __future__ import annotations

from typing import Any

from ...describe.description import DescribedEntry, Description
from ...describe.marker_quantities import ElementQuantity
from ...describe.rewritten_texts import negative, rewritten
from ...describe.visit import Slot, Visitor, copied, visit
from .variant import NotApplicable, Variant, coordinates_of

#: Joints whose inverse is of the same type with all coordinates of the other sign.
TYPES = (
    *("revolute", "continuous", "prismatic", "translational", "screw", "cylindrical", "spherical", "weld"),
    *("distance", "parallel", "perpendicular", "orientation"),
)
#: Elements on a joint's coordinate -> the key that changes its sign, "" if none does.
_ELEMENTS = {
    "torque": "value",
    "actuator": "value",
    "spring": "length",
    "torsional_spring": "angle",
    "joint_spring": "rest",
    "joint_damper": "",
    "damper": "",
    "torsional_damper": "",
    "friction": "",
    "driver": "value",
}


def swap(description: Description, random: Any) -> Variant:
    """Every joint that can be, with predecessor and successor exchanged (one in four stays as it is)."""
    names = coordinates_of(description)
    home = {name: joint for joint, own in names.items() for name in (joint, *own)}
    held = _held(description, home)
    chosen = [
        entry.name
        for entry in description.sections["joints"]
        if _can(entry) and entry.name not in held and random.random() < 0.75
    ]
    if not chosen:
        raise NotApplicable("no joint can be swapped")
    signs = {name for joint in chosen for name in names[joint]}
    signs |= {name + suffix for name in signs for suffix in ("_dot", "_ddot")}
    made = visit(copied(description), _Signed(signs, set(chosen)))
    for entry in made.sections["joints"]:
        if entry.name in chosen:
            entry.values["between"] = list(reversed(entry.values["between"]))
            if entry.values["type"] == "spherical":
                entry.values["sequence"] = entry.values.get("sequence", "xyz")[::-1]
                entry.values["coordinates"] = list(reversed(names[entry.name]))
    return Variant(
        made,
        lambda values: {name: -value if name in signs else value for name, value in values.items()},
        joints=dict.fromkeys(chosen, ""),
    )


def _can(entry: DescribedEntry) -> bool:
    values = entry.values
    return values["type"] in TYPES and values.get("rotation", "euler_angles") == "euler_angles"


def _held(description: Description, home: dict[str, str]) -> set[str]:
    """Joints that elements refer to whose sign cannot be changed by one key."""
    held: set[str] = set()

    class Note(Visitor):
        def coordinate(self, name: str) -> str:
            held.add(home.get(name, name))
            return name

    bare = Description()
    bare.sections["forces"] = [e for e in description.sections["forces"] if e.values["type"] not in _ELEMENTS]
    kept = ("driver", "coupling")
    bare.sections["constraints"] = [e for e in description.sections["constraints"] if e.values["type"] not in kept]
    bare.sections["events"] = [e for e in description.sections["events"] if "reset" in e.values]
    visit(bare, Note())
    return held


class _Signed(Visitor):
    """Coordinates with the other sign wherever they are used."""

    def __init__(self, signs: set[str], joints: set[str]) -> None:
        self.signs, self.joints = signs, joints

    def scalar(self, value: Any, slot: Slot) -> Any:
        def element(quantity: ElementQuantity) -> str:
            raise NotApplicable(f"{quantity} can change its sign")

        changed = rewritten(value, lambda name: f"(-{name})" if name in self.signs else name, str, element)
        if slot.key in ("initial", "guess") and not slot.section:
            return negative(changed) if slot.place[0] in self.signs else changed
        if slot.type == "coupling" and slot.key == "coordinates":
            return negative(changed) if slot.place[0] in self.signs | self.joints else changed
        acts_on = None if slot.entry is None else slot.entry.values.get("joint", slot.entry.values.get("coordinate"))
        turned = acts_on in self.signs or acts_on in self.joints
        if slot.section in ("forces", "constraints") and turned and _ELEMENTS.get(slot.type) == slot.key:
            return negative(changed)
        return changed
