"""the columns of a Jacobian that belong to states of contacts -> tables and areas of their driver."""

from __future__ import annotations

from itertools import accumulate
from typing import Any

from ..graph.pair_calls import PairFunction
from ..numeric.pair_sums import POSE
from .held_columns import WRENCH
from .pair_sums import plain_numbers, work_of
from .program import Program

HELD_RECORD = 3 + 2 * WRENCH  #: number of a state, two bodies, and what each gets


def is_held(program: Program, function: PairFunction) -> bool:
    """Whether a sum has states whose columns are made from its pairs."""
    return program.held is not None and function.name in {one.function.name for one in program.held.sums}


def held_room(function: PairFunction) -> int:
    """For how many states of near pairs there is room."""
    return function.room * max(kind.states for kind in function.kinds)


def held_areas(program: Program) -> list[tuple[str, int]]:
    """Areas of ``tree_jacobian_held``."""
    if program.held is None:
        return []
    functions = [one.function for one in program.held.sums]
    return [
        ("HELD_OPERANDS", len(program.held.operands)),
        ("HELD_GIVEN", max(function.count for function in functions)),
        ("HELD_LIST", 1 + HELD_RECORD * max(map(held_room, functions))),
        ("HELD_WORK", max(map(work_of, functions))),
    ]


def held_tables(program: Program) -> dict[str, Any] | None:
    """What ``held.c.j2`` writes."""
    held = program.held
    if held is None:
        return None
    sums, at, load = [], 0, 0
    for one in held.sums:
        function = one.function
        sums.append(
            {
                "name": function.name,
                "places": one.places,
                "slots": one.slots,
                "at": at,
                "load": load,
                "begun": POSE * function.bodies,
                "numbers": len(plain_numbers(function)),
                "first_state": function.first_state,
            }
        )
        at += len(one.places)
        load += WRENCH * function.bodies
    states = [k for group in held.groups for k in group]
    return {
        "sums": sums,
        "groups": held.groups,
        "starts": list(accumulate(map(len, held.groups), initial=0)),
        "states": states,
        "firsts": list(accumulate((len(held.rows[k]) for k in states), initial=0)),
        "rows": [row for k in states for row in held.rows[k]],
        "record": HELD_RECORD,
        "loads": len(held.loads),
    }
