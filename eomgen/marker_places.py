"""Names such as ``x(rod.tip)``: coordinates of the place of a marker, in ground axes."""

from __future__ import annotations

import re

_PLACE = re.compile(r"([xyz])\((\w+(?:\.\w+)*)\)")


def place_of_marker(name: object) -> tuple[str, str] | None:
    """Direction and marker of a place such as ``x(rod.tip)``; None for other names."""
    found = _PLACE.fullmatch(name.replace(" ", "")) if isinstance(name, str) else None
    return (found[1], found[2]) if found else None
