"""Stage verification, units: a description in other units of length, mass and time (mm, t, ms).

A text f(t, q, ...) becomes s f(t/s_t, q/s_q, ...), so that parameters, inputs and outputs keep their SI numbers.
"""

from __future__ import annotations

from typing import Any

from ...describe.description import Description
from ...describe.names import QUANTITIES
from ...describe.rewritten_texts import rewritten, scaled
from ...describe.scope import ENERGIES
from ...describe.visit import Slot, Visitor, visit
from .dimensions import INERTIA, LENGTH, NONE, SPEED, SPIN, TORQUE, Dimension, dimension_of
from .variant import NotApplicable, UnitScales, Variant, coordinates_of, kinds_of, velocities_of

#: The engineer's units: millimetre, tonne, millisecond.
MM_T_MS = UnitScales(length=1e3, mass=1e-3, time=1e3)
_MARKER = {0: LENGTH, 1: SPEED, 2: Dimension(1, 0, -2), 3: Dimension(2, 1, -1), 4: INERTIA, 5: Dimension(1, 1, -1)}
_MARKER |= {6: Dimension(0, 1), 7: SPIN, 8: SPIN, 9: Dimension(0, 0, -2), 10: Dimension(0, 0, -2)}
#: Local names of laws and profiles -> dimension where the law acts on a length.
_LOCAL = {"length": LENGTH, "angle": NONE}
#: Keys that keep their SI values because nothing but their zeros, or their own value, counts.
_KEPT = ("outputs", "events", "inputs")


def in_units(description: Description, random: Any, scales: UnitScales = MM_T_MS) -> Variant:
    """The description in other units.

    Raises
    ------
    NotApplicable
        A dimension is not known.
    """
    if any(description.values.get(key) is not None for key in ("lagrangian", "equations")):
        raise NotApplicable("the dimensions of a bare Lagrangian and of given equations are not known")
    visitor = _Scaled(description, scales)
    made = visit(description, visitor)
    simulation = made.values.get("simulation")
    if simulation:
        made.values["simulation"] = {
            key: value * scales.time if key in ("end", "step") else value for key, value in simulation.items()
        }
    for entry in made.sections["constraints"]:
        if entry.values["type"] == "coupling" and "coordinates" in entry.values:
            entry.values["coordinates"] = {
                name: scaled(value, 1.0 / visitor.names[name][0]) for name, value in entry.values["coordinates"].items()
            }
    factors = {name: factor for name, (factor, _) in visitor.names.items()}
    return Variant(
        made, lambda values: {name: value * factors.get(name, 1.0) for name, value in values.items()}, scales=scales
    )


class _Scaled(Visitor):
    def __init__(self, description: Description, scales: UnitScales) -> None:
        self.scales = scales
        self.kinds = kinds_of(description)
        self.names: dict[str, tuple[float, str]] = {"t": (scales.time, "")}
        for name, kind in self.kinds.items():
            own = LENGTH if kind == "length" else NONE
            for order, suffix in enumerate(("", "_dot", "_ddot")):
                self.names[name + suffix] = (own._replace(time=-order).of(scales), kind)
        for name, kind in velocities_of(description).items():
            own = SPEED if kind == "length" else SPIN
            self.names[name] = (own.of(scales), kind)
        declared = {e.name for section in ("parameters", "inputs") for e in description.sections[section]}
        self.names |= {name: (TORQUE.of(scales), "") for name in ENERGIES if name not in declared}
        for name in ("momentum_x", "momentum_y", "momentum_z"):
            self.names.setdefault(name, (_MARKER[5].of(scales), ""))
        self.names.setdefault("total_mass", (_MARKER[6].of(scales), ""))
        for name in declared:
            self.names.pop(name, None)
        self.joints = coordinates_of(description)
        self.home = {joint: own[0] for joint, own in self.joints.items() if len(own) == 1}

    def acts_on_length(self, slot: Slot) -> bool:
        """Whether an entry acts along a length rather than an angle."""
        values = {} if slot.entry is None else slot.entry.values
        if slot.section == "joints":
            name = "" if slot.entry is None else slot.entry.name
            return self.kinds.get((self.joints.get(name) or ("",))[0], "") == "length"
        if slot.type == "cam":
            key = "cam" if slot.key == "phase" else "follower"
            return self.kinds.get(self.home.get(values[key], values[key])) == "length"
        if slot.type == "driver":
            if "coordinate" in values:
                name = values["coordinate"]
                return self.kinds.get(self.home.get(name, name)) == "length"
            return "angle" not in values
        joint = values.get("joint")
        if joint is not None:
            return self.kinds.get(self.home.get(joint, joint)) == "length"
        return "between" in values or "marker" in values

    def scalar(self, value: Any, slot: Slot) -> Any:
        if (slot.section, slot.key) in (("", "initial"), ("", "guess"), ("events", "reset")):
            factor = self.names[slot.place[0]][0]
        elif slot.section in _KEPT or slot.type == "coupling":
            factor = 1.0
        else:
            factor = dimension_of(slot, self.acts_on_length(slot)).of(self.scales)
        if slot.key == "stiffness" and slot.type in ("stop", "point_plane", "sphere_plane", "sphere_sphere"):
            return self._contact(value, slot, factor)
        return scaled(self.text(value, slot), factor)

    def _contact(self, value: Any, slot: Slot, factor: float) -> Any:
        """k in k d**n: the scale of d goes in to the power n."""
        if slot.type == "stop" and not self.acts_on_length(slot):
            return scaled(self.text(value, slot), factor)
        exponent = 1.5 if slot.entry is None else slot.entry.values.get("exponent", 1.5)
        if isinstance(exponent, str):
            raise NotApplicable("the exponent of a contact is no number")
        return scaled(self.text(value, slot), factor * self.scales.length ** -float(exponent))

    def text(self, value: Any, slot: Slot) -> Any:
        """A text whose names are measured in the new units."""
        local = self._locals(slot)

        def name(word: str) -> str:
            factor = local[word] if word in local else self.names.get(word, (1.0, ""))[0]
            return word if factor == 1.0 else f"({word}/{factor!r})"

        def locate(quantity: str, marker: str) -> str:
            level = QUANTITIES[quantity][0]
            own = NONE if quantity == "angle" else _MARKER[level]
            return f"({quantity}({marker})/{own.of(self.scales)!r})"

        return rewritten(value, name, locate)

    def _locals(self, slot: Slot) -> dict[str, float]:
        """Names that only a law or a profile knows, and their scales."""
        length = self.acts_on_length(slot)
        if slot.type in ("element", "torsional_element"):
            own = LENGTH if length and slot.type == "element" else NONE
            rate = own._replace(time=-1)
            return {"length": own.of(self.scales), "angle": 1.0, "rate": rate.of(self.scales)}
        if slot.type == "cam" and slot.entry is not None:
            cam = str(slot.entry.values["cam"])
            sliding = self.kinds.get(self.home.get(cam, cam)) == "length"
            return {"theta": (LENGTH if sliding else NONE).of(self.scales)}
        return {"theta": 1.0} if slot.type == "cam_contact" else {}
