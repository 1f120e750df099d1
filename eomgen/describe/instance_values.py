"""Stage describe, values of an instance: ``{value: 500, unit: mm}`` for a component's parameter -> value and unit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from .description import DescribedEntry
from .names import nearest
from .placed_on import is_constant
from .repetition import Fault
from .units import UnitError, read_unit

KEYS = ("value", "unit")


class InstanceValue(NamedTuple):
    """What an instance gives for a parameter or an input."""

    value: Any
    unit: str | None = None  #: None for that of the component


def read_given(entry: DescribedEntry, given: Any, path: str, fault: Fault) -> InstanceValue | None:
    """A number or expression as it stands, or the value and unit of a mapping; None if that is at fault.

    Parameters
    ----------
    entry : DescribedEntry
        The parameter or input of the component.
    given
        As the instance has it.
    path : str
        Where that is.
    fault : callable
    """
    if not isinstance(given, Mapping):
        return InstanceValue(given)
    for key in given:
        if key not in KEYS:
            fault(f"{path}.{key}", f"no key {key!r}", nearest(str(key), KEYS, "keys"), "EG-NAME-UNKNOWN")
            return None
    if given.get("value") is None:
        fault(path, f"{dict(given)!r} has no value", "write {value: 500, unit: mm}, or a number", "EG-MISSING")
        return None
    unit, own = given.get("unit"), entry.values.get("unit")
    if unit is None:
        return InstanceValue(given["value"])
    try:
        if not isinstance(unit, str):
            raise UnitError(f"{unit!r} is not a unit", "write a unit as text, as in mm")
        read = read_unit(unit)
        if isinstance(own, str) and own and read_unit(own).dimension != read.dimension:
            message = f"{unit!r} does not measure what {entry.name} is in: {own}"
            fault(f"{path}.unit", message, "give a unit like that", "EG-UNIT")
            return None
    except UnitError as error:
        fault(f"{path}.unit", str(error), error.remedy, "EG-UNIT")
        return None
    if not is_constant(given["value"]) and read.size != 1.0:
        remedy = "leave the unit out: parameters are in SI units, so the expression is too"
        fault(
            f"{path}.unit", f"{str(given['value'])!r} is an expression, and {unit} is not an SI unit", remedy, "EG-UNIT"
        )
        return None
    return InstanceValue(given["value"], unit)
