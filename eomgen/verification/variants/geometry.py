"""Stage verification, geometry: which parameters stand in places, sizes and constraints of a description."""

from __future__ import annotations

from typing import Any

from ...describe.description import Description
from ...describe.rewritten_texts import names_of
from ...describe.visit import Slot, Visitor, visit

_CONTENT = ("mass", "inertia", "principal", "first_moment", "density", "line_density", "com")


def parameters_of_geometry(description: Description) -> set[str]:
    """Names in joints, constraints, initial values and places of markers."""
    found: set[str] = set()

    class Note(Visitor):
        def scalar(self, value: Any, slot: Slot) -> Any:
            inside = slot.section in ("joints", "constraints") or slot.key in ("at", "rpy", "initial", "guess")
            if inside and slot.key not in _CONTENT and slot.key != "armature":
                found.update(names_of(value))
            return value

    visit(description, Note())
    lagrangian = description.values.get("lagrangian") or {}
    for text in lagrangian.get("constraints", ()):
        found |= names_of(text)
    return found
