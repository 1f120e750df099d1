"""Names such as ``x(rod.tip)`` and ``vx(rod.tip)``: place and velocity of a marker, in ground axes."""

from __future__ import annotations

import re

_PLACE = re.compile(r"(v?[xyz])\((\w+(?:\.\w+)*)\)")


def place_of_marker(name: object) -> tuple[str, str] | None:
    """``x`` or ``vx`` and the marker of a name such as ``x(rod.tip)``; None for other names."""
    found = _PLACE.fullmatch(name.replace(" ", "")) if isinstance(name, str) else None
    return (found[1], found[2]) if found else None
