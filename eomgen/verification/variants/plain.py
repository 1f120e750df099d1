"""Stage verification, the plain form: Builder or Description -> numbers, texts and mappings only, defaults written out.

A round trip through the text of a model file makes it plain, whether the model came from Python, YAML or a robot's
file.  Data that enter no equation (shapes, limits, LaTeX) are left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...describe.builder import Builder
from ...describe.description import GROUND_NAME, DescribedEntry, Description
from ...describe.placed_on import with_rpy
from ...describe.plain_form import plain_description
from ...describe.rewritten_texts import number_of, rewritten
from ...describe.units import read_unit
from ...describe.visit import Slot, Visitor, visit
from ...forces.muscle import SHORTENING
from .variant import coordinates_of, kinds_of

#: Type of constraint -> the key whose marker is ground unless given.
_ON_GROUND = {"rolling": "plane", "knife_edge": "on", "driver": "on"}
_DATA = {
    "joints": ("limits", "dry_friction", "latex"),
    "bodies": ("display",),
    **dict.fromkeys(("parameters", "inputs", "outputs"), ("latex",)),
}


def plain(model: Builder | Description) -> Description:
    """The plain form of a model.

    Raises
    ------
    UsageError
        It has values that no model file can hold, such as functions of Python.
    """
    given = model.description if isinstance(model, Builder) else model
    result = plain_description(given)
    for section, keys in _DATA.items():
        for entry in result.sections[section]:
            for key in keys:
                entry.values.pop(key, None)
    for section in ("lagrangian", "equations"):
        if result.values.get(section) is not None:
            result.values[section].pop("latex", None)
    result = visit(result, _WithoutOutputs(result))
    for section in ("parameters", "inputs"):
        for entry in result.sections[section]:
            _convert_to_si(entry)
    if not any(entry.name == GROUND_NAME for entry in result.sections["bodies"]) and result.sections["bodies"]:
        result.add("bodies", GROUND_NAME, {})
    for entry in result.sections["bodies"]:
        _write_placements(entry)
    for entry in result.sections["forces"]:
        if entry.values["type"] == "muscle":  # its default counts seconds
            entry.values.setdefault("velocity_max", f"{SHORTENING}*({entry.values['fiber_length']})")
    for entry in result.sections["constraints"]:
        side = _ON_GROUND.get(entry.values["type"])
        if side is not None and side not in entry.values and not (side == "on" and "marker" not in entry.values):
            entry.values[side] = GROUND_NAME
    return visit(result, _Placed(values_of(result)))


def _convert_to_si(entry: DescribedEntry) -> None:
    """A value in mm as one in m, so that values of a run and declared ones mean the same."""
    unit, value = read_unit(entry.values.get("unit") or ""), entry.values.get("value")
    if unit.size != 1.0 and value is not None:
        entry.values |= {"value": number_of(value, {}) * unit.size, "unit": unit.si}


def values_of(description: Description) -> dict[str, float]:
    """Declared values of parameters, texts such as ``pi/10`` evaluated."""
    return {
        entry.name: number_of(entry.values["value"], {})
        for entry in description.sections["parameters"]
        if entry.values.get("value") is not None
    }


def _write_placements(entry: DescribedEntry) -> None:
    """Markers as mappings of at and rpy; solids and points with their place."""
    markers = entry.values.get("markers", {})
    entry.values["markers"] = {
        name: dict(placed) if isinstance(placed, Mapping) else {"at": list(placed)} for name, placed in markers.items()
    }
    for solid in entry.values.get("solids", ()):
        solid.setdefault("at", [0, 0, 0])


class _WithoutOutputs(Visitor):
    """Writes out what outputs are, where laws, events and other outputs use them by name."""

    def __init__(self, description: Description) -> None:
        own = {name for names in coordinates_of(description).values() for name in names} | {*kinds_of(description)}
        self.given = {
            entry.name: entry.values["expression"]
            for entry in description.sections["outputs"]
            if entry.values["expression"] != entry.name and entry.name not in own
        }

    def scalar(self, value: Any, slot: Slot) -> Any:
        local = slot.field.local if slot.field else ()

        def name(word: str) -> str:
            return f"({self.scalar(self.given[word], slot)})" if word in self.given and word not in local else word

        return rewritten(value, name, str)


class _Placed(Visitor):
    """Writes ``at`` and ``rpy`` out wherever a placement is given; parameters in a matrix have declared values."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self.parameters = parameters

    def placement(self, body: str, placed: Mapping[str, Any], slot: Any) -> dict[str, Any]:
        placed, at = with_rpy(placed, self.parameters), list(placed.get("at", (0, 0, 0)))
        return {"at": at} if slot.key == "points" else {"at": at, "rpy": list(placed.get("rpy", (0, 0, 0)))}
