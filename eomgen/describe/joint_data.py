"""Stage describe, data of joints and bodies: limits, dry friction, inertia of drives, and shapes to draw.

Limits, dry friction and shapes travel with the model and enter no equation; the drive's inertia (``armature``) does.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from ..base.value_rules import NOT_NEGATIVE
from ..elements import kinds
from ..elements.kinds import DISPLAY, LIMITS
from ..graph.core import Expr
from .checks import check_keys
from .description import items
from .values import Reader

_COLOR = re.compile(r"#[0-9a-fA-F]{6}")
Limits = tuple[tuple[str, float], ...]  #: (key, value) of what is limited


def limits_nothing(key: str, value: Any) -> bool:
    """Whether a limit is the infinity that no value passes, as URDF and MJCF files write it."""
    return isinstance(value, int | float) and value == (-math.inf if key == "lower" else math.inf)


def read_limits(reader: Reader, path: str, given: Any, coordinates: Sequence[str]) -> tuple[Limits, ...]:
    """Limits of each coordinate of a joint.

    A mapping of ``lower``, ``upper``, ``velocity`` and ``effort``, each a number, or a list of one for each coordinate.
    """
    if not isinstance(given, Mapping):
        reader.wrong(path, given, kinds.Limits)
        return tuple(() for _ in coordinates)
    check_keys(path, given, LIMITS, reader.faults)
    result: list[list[tuple[str, float]]] = [[] for _ in coordinates]
    for key in LIMITS:
        if key not in given or given[key] is None:
            continue
        listed = items(given[key])
        values = [given[key]] if listed is None else listed
        if len(values) != len(coordinates):
            message = f"{len(values)} values for {len(coordinates)} coordinates"
            reader.faults.add(f"{path}.{key}", message, f"give one for each: {', '.join(coordinates)}", "EG-SHAPE")
            continue
        for k, value in enumerate(values):
            place = f"{path}.{key}" if listed is None else f"{path}.{key}[{k}]"
            number = None if value is None or limits_nothing(key, value) else reader.number(place, value)
            if number is not None and number < 0 and key in ("velocity", "effort"):
                reader.faults.add(place, f"is {number:g}", "give the largest size, 0 or positive", "EG-RANGE")
            elif number is not None:
                result[k].append((key, number))
    for name, found in zip(coordinates, result, strict=True):
        limits = dict(found)
        if limits.get("lower", -math.inf) > limits.get("upper", math.inf):
            message = f"lower {limits['lower']:g} is above upper {limits['upper']:g} for {name!r}"
            reader.faults.add(path, message, "exchange them", "EG-RANGE")
    return tuple(tuple(found) for found in result)


def read_dry_friction(reader: Reader, path: str, given: Any) -> float:
    """Coulomb friction of a joint (N m or N), as data."""
    value = reader.number(path, given)
    if value is not None and value < 0:
        reader.faults.add(path, f"is {value:g}", "friction must be 0 or positive", "EG-RANGE")
    return value or 0.0


def read_armature(reader: Reader, path: str, given: Any) -> Expr:
    """Inertia of a drive, as the coordinate of its joint feels it (kg m^2 or kg)."""
    value = reader.expression(path, given)
    reader.requirements.inside(path, value, NOT_NEGATIVE, "an inertia must be 0 or positive")
    return value


def check_display(reader: Reader, path: str, given: Any) -> None:
    """Note faults of the shapes of a body; the files they name are not looked for."""
    listed = items(given)
    if listed is None:
        reader.wrong(path, given, kinds.Display)
        return
    for k, shape in enumerate(listed):
        place = f"{path}[{k}]"
        if not isinstance(shape, Mapping):
            reader.wrong(place, shape, kinds.Display)
            continue
        check_keys(place, shape, DISPLAY, reader.faults)
        for key, value in shape.items():
            if key not in DISPLAY:
                continue
            found = DISPLAY[key].read(reader, f"{place}.{key}", value)
            if key == "scale" and any(x.is_zero for x in found):
                remedy = "give three numbers other than 0; negative ones mirror"
                message = "a scale of 0 leaves nothing of the mesh"
                reader.faults.add(f"{place}.{key}", message, remedy, "EG-RANGE")
            if key == "color" and not (isinstance(value, str) and _COLOR.fullmatch(value)):
                remedy = 'give six hexadecimal digits: "#1f77b4"'
                reader.faults.add(f"{place}.{key}", f"{value!r} is no color", remedy, "EG-TYPE")
