"""Stage describe, repetition: ``for`` of an added component -> the values of its variables, round by round."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from decimal import Decimal
from typing import Any

from ..elements.kinds import ROUNDS, items
from .names import fault_of_name
from .rewritten_texts import in_brackets, rewritten

Fault = Callable[[str, str, str, str], None]
Round = dict[str, Any]

_REMEDY = "give a list of numbers or expressions, a count n for 1 to n, or {from, to, step}"


def rounds_of(given: Any, path: str, fault: Fault) -> list[Round] | None:
    """The values of all variables in each round; None where something is wrong, which is told."""
    if not isinstance(given, Mapping) or not given:
        fault(path, f"{given!r} is not a mapping of variables to their values", _REMEDY, "EG-TYPE")
        return None
    columns: dict[str, list[Any]] = {}
    for name, values in given.items():
        place = f"{path}.{name}"
        wrong = fault_of_name(name, symbol=True)
        if wrong:
            fault(place, *wrong, "EG-NAME-FORM")
            return None
        listed = _listed(values)
        if listed is None:
            fault(place, f"{values!r} is not a list of values", _REMEDY, "EG-TYPE")
            return None
        if not 1 <= len(listed) <= ROUNDS:
            many, none = ("has more than {} values", "EG-TOO-LARGE"), ("has no values", "EG-SHAPE")
            wrong_count, code = many if listed else none
            fault(place, wrong_count.format(ROUNDS), f"1 to {ROUNDS}", code)
            return None
        columns[name] = listed
    counts = {name: len(values) for name, values in columns.items()}
    if len(set(counts.values())) > 1:
        shown = ", ".join(f"{name} has {count}" for name, count in counts.items())
        remedy = "all lists must have the same length: the variables take their values side by side"
        fault(path, f"lists of different lengths: {shown}", remedy, "EG-SHAPE")
        return None
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _listed(values: Any) -> list[Any] | None:
    if isinstance(values, int) and not isinstance(values, bool):
        return list(range(1, min(values, ROUNDS + 1) + 1))
    if isinstance(values, Mapping):
        first, last, step = (values.get(key, default) for key, default in (("from", 1), ("to", None), ("step", 1)))
        if not {*values} <= {"from", "to", "step"} or not all(map(_is_number, (first, last, step))) or step == 0:
            return None
        begin, end, by = (Decimal(repr(x)) for x in (first, last, step))  # as written, so that the end counts
        count = math.floor((end - begin) / by) + 1
        whole = all(isinstance(x, int) for x in (first, step))
        return [(int if whole else float)(begin + k * by) for k in range(max(0, min(count, ROUNDS + 1)))]
    listed = items(values)
    if listed is None or not all(isinstance(x, str) or _is_number(x) for x in listed):
        return None
    return listed


def put_in(value: Any, variables: Round) -> Any:
    """A value, or all that it holds, with the variables of a round put in."""
    if isinstance(value, str):
        if value.strip() in variables:
            return variables[value.strip()]
        return rewritten(value, lambda name: _text(name, variables), str)
    if isinstance(value, Mapping):
        return {key: part if key == "body" else put_in(part, variables) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [put_in(part, variables) for part in value]
    return value


def _text(name: str, variables: Round) -> str:
    if name not in variables:
        return name
    value = variables[name]
    return in_brackets(value if isinstance(value, str) else repr(value))
