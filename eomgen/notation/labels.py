"""Notation, labels: a printed name and its unit -> what stands at an axis of a plot."""

from __future__ import annotations

from ..texts import visible

TIME = "$t$ (s)"


def label(printed: str, unit: str) -> str:
    """A name as it is printed with its unit, or either alone; no dollar of the unit begins a formula."""
    unit = visible(unit, lines=False).replace("$", r"\$")
    return f"{printed} ({unit})" if printed and unit else printed or unit
