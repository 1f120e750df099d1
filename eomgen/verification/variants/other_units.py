"""Stage verification, units: a description in other units of length, mass and time (mm, t, ms).

A text f(t, q, ...) becomes s f(t/s_t, q/s_q, ...), so that parameters, inputs and outputs keep their SI numbers.
"""

from __future__ import annotations

from typing import Any

from ...describe.description import Description
from ...describe.element_states import states_of
from ...describe.fields import MODEL, Field, acts_on_length, fields_of, part_fields
from ...describe.marker_quantities import ElementQuantity, MarkerQuantity
from ...describe.mechanism import LEVEL_DIMENSIONS, MOMENTUM, dimension_of
from ...describe.mechanism import MASS as TOTAL_MASS
from ...describe.names import QUANTITIES
from ...describe.rewritten_texts import rewritten, scaled
from ...describe.scope import ENERGIES
from ...describe.units import read_unit
from ...describe.visit import Slot, Visitor, visit
from ...elements.dimensions import ENERGY, LENGTH, NONE, SPEED, SPIN, Dimension
from ...forces.soil_laws import OWN
from .variant import NotApplicable, UnitScales, Variant, coordinates_of, kinds_of, velocities_of

#: The engineer's units: millimetre, tonne, millisecond.
MM_T_MS = UnitScales(length=1e3, mass=1e-3, time=1e3)
#: Keys that keep their SI values because nothing but their zeros, or their own value, counts.
ALONG = Field("expression", "", along="joint")  #: what is measured along the coordinate of its joint
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
    if any(entry.values.get("soil", OWN) != OWN for entry in description.sections["forces"]):
        raise NotApplicable("the numbers of a published soil are in SI units")
    if any(entry.values.get("law") == "magic_formula" for entry in description.sections["forces"]):
        raise NotApplicable("the coefficients of a published tyre are in SI units")
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
                self.names[name + suffix] = (scales.of(own._replace(time=-order)), kind)
        for name, kind in velocities_of(description).items():
            own = SPEED if kind == "length" else SPIN
            self.names[name] = (scales.of(own), kind)
        declared = {e.name for section in ("parameters", "inputs") for e in description.sections[section]}
        self.names |= {name: (scales.of(ENERGY), "") for name in ENERGIES if name not in declared}
        for name in ("momentum_x", "momentum_y", "momentum_z"):
            self.names.setdefault(name, (scales.of(LEVEL_DIMENSIONS[MOMENTUM]), ""))
        self.names.setdefault("total_mass", (scales.of(LEVEL_DIMENSIONS[TOTAL_MASS]), ""))
        for name in declared:
            self.names.pop(name, None)
        self.joints = coordinates_of(description)
        self.home = {joint: own[0] for joint, own in self.joints.items() if len(own) == 1}
        for entry in description.sections["forces"]:
            way = LENGTH if acts_on_length("forces", entry.values, ALONG, self._is_length) else NONE
            for name, unit in states_of(entry).items():  # bristles of a joint bend as far as it moves
                own = read_unit(unit).dimension
                self.names[name] = (scales.of(way if own in (NONE, LENGTH) else own), "")

    def measured_in(self, slot: Slot) -> Dimension | None:
        """The dimension of a scalar, as the row of its field says."""
        if slot.entry is None:
            return MODEL[slot.key].dimension if slot.section == "" else None
        field = fields_of(slot.section, slot.entry.values).get(slot.key) or part_fields()[slot.key]
        return field.measured_in(slot.entry.values, slot.place, self._acts_on_length(slot, field))

    def _acts_on_length(self, slot: Slot, field: Field) -> bool:
        assert slot.entry is not None
        if slot.section == "joints":
            return self.kinds.get((self.joints.get(slot.entry.name) or ("",))[0], "") == "length"
        return acts_on_length(slot.section, slot.entry.values, field, self._is_length)

    def _is_length(self, name: str) -> bool:
        """Whether a coordinate, or that of a joint, is a length."""
        return self.kinds.get(self.home.get(name, name)) == "length"

    def scalar(self, value: Any, slot: Slot) -> Any:
        if (slot.section, slot.key) in (("", "initial"), ("", "guess"), ("events", "reset")):
            factor = self.names[slot.place[0]][0]
        elif slot.section in _KEPT or slot.type == "coupling":
            factor = 1.0
        else:
            dimension = self.measured_in(slot)
            if dimension is None:
                raise NotApplicable(f"the dimension of {slot.key} in {slot.section or 'the model'} is not known")
            factor = self.scales.of(dimension)
        return scaled(self.text(value, slot), factor)

    def text(self, value: Any, slot: Slot) -> Any:
        """A text whose names are measured in the new units."""
        local = self._locals(slot)

        def name(word: str) -> str:
            factor = local[word] if word in local else self.names.get(word, (1.0, ""))[0]
            return word if factor == 1.0 else f"({word}/{factor!r})"

        def locate(quantity: MarkerQuantity) -> str:
            return f"({quantity}/{self.scales.of(dimension_of(*QUANTITIES[quantity.name]))!r})"

        def element(quantity: ElementQuantity) -> str:
            raise NotApplicable(f"the dimension of {quantity} is not known")

        return rewritten(value, name, locate, element)

    def _locals(self, slot: Slot) -> dict[str, float]:
        """Names that only a law or a profile knows, and their scales."""
        if slot.entry is None:
            return {}
        own = fields_of(slot.section, slot.entry.values).get(slot.key)
        found: dict[str, float] = {}
        for name, field in own.local.items() if own is not None else ():
            dimension = field.measured_in({}, (), self._acts_on_length(slot, field))
            assert dimension is not None
            found[name] = self.scales.of(dimension)
        return found
