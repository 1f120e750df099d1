"""Stage describe, paths: the ``via`` list of a force element -> markers and cylinders in order."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..forces import Cylinder
from ..frames import Marker
from .checks import check_keys
from .description import items
from .fields import CYLINDER
from .reading import Reader


def read_via(reader: Reader, path: str, value: Any) -> tuple[Marker | Cylinder, ...] | None:
    """What a path runs over; None if anything is wrong with it, which is noted."""
    listed = items(value)
    if listed is None:
        reader.wrong(path, value, "via")
        return None
    found: list[Marker | Cylinder] = []
    for k, item in enumerate(listed):
        stop = _stop(reader, f"{path}[{k}]", item)
        if stop is None:
            continue
        if isinstance(stop, Cylinder) and found and isinstance(found[-1], Cylinder):
            message = "follows another cylinder"
            reader.faults.add(f"{path}[{k}]", message, "put a marker that the path slides through between them")
        found.append(stop)
    return None if reader.faults.under(path) else tuple(found)


def _stop(reader: Reader, path: str, value: Any) -> Marker | Cylinder | None:
    if not (isinstance(value, Mapping) and "body" not in value):
        return reader.marker(path, value)
    check_keys(path, value, CYLINDER, reader.faults)
    if "around" not in value or "radius" not in value:
        return None
    marker = reader.marker(f"{path}.around", value["around"])
    radius = reader.expression(f"{path}.radius", value["radius"])
    if radius.value is not None and radius.value <= 0:
        reader.faults.add(f"{path}.radius", f"is {radius.value:g}", "must be greater than 0")
    field = CYLINDER["sense"]
    sense = reader.choice(f"{path}.sense", value.get("sense", field.default), field)
    return None if marker is None else Cylinder(marker, radius, 1 if sense == "positive" else -1)
