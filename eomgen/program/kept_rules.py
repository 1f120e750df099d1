"""Stage program: requirements of a mechanism -> data of model.json, by which a module judges parameters given late."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from ..base.value_rules import RANGE
from ..describe.requirements import Requirement
from ..errors import UsageError
from ..graph.substitute import symbols_of
from ..graph.tape import record_tape


def keep_rules(requirements: Sequence[Requirement], names: Sequence[str]) -> dict[str, Any]:
    """What parameters must keep whatever their values are: ranges of single ones, and rules of numbers made of them.

    A range has the place of its parameter; a rule has the places of all that it depends on, and a tape, whose x are the
    points at which it looks.  A number that comes through a function of the model has no tape: it is judged where the
    model is read, and not here.
    """
    ranges: list[list[Any]] = []
    rules: list[list[Any]] = []
    for path, rule, numbers, data, local in requirements:
        kind, *given = numbers[0].node
        if rule == RANGE and kind == "sym" and given[0] in names:
            ranges.append([names.index(given[0]), path, *data])
            continue
        places = {name: ("p", k) for k, name in enumerate(names)} | {name: ("x", k) for k, name in enumerate(local)}
        used = sorted(names.index(name) for name in symbols_of(numbers) - {*local})
        with suppress(UsageError):
            rules.append([path, rule, list(data), used, list(record_tape(numbers, places.__getitem__))])
    return {**({"ranges": ranges} if ranges else {}), **({"rules": rules} if rules else {})}
