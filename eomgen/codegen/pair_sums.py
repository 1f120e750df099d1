"""Sums over pairs of shapes: which a program has, and their lists in the work array."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

from ..contact.pair_sums import MEETING, MOTION, PLACE, POSE, REST, RESULT, WRENCH
from ..contact.pairs import PairCall, PairFunction, pair_call
from ..errors import cannot
from ..expr.core import Expr, Graph, reachable
from .program import BY_BODIES, Program


class UsedSum(NamedTuple):
    """A sum, and whether its value, its derivatives, the time in which shapes meet and near pairs are used."""

    function: PairFunction
    sums: bool
    slopes: bool
    meets: bool
    lists: bool


def used_sums(program: Program) -> list[UsedSum]:
    """The sums, by name."""
    calls = [call for name in sorted(program.called) if (call := pair_call(program.graph, name)) is not None]
    functions = {call.function.name: call.function for call in calls}
    parts = {(call.function.name, call.part) for call in calls}
    return [
        UsedSum(functions[name], *((name, part) in parts for part in ("sum", "slope", "meeting", "witnesses")))
        for name in sorted(functions)
    ]


class SumAgain(NamedTuple):
    """A sum of which the Jacobian takes derivatives along one direction after another at one place."""

    function: PairFunction
    rated: frozenset[int]  #: numbers that have rates
    read: frozenset[int]  #: results that are read


def sums_again(program: Program) -> list[SumAgain]:
    """The sums of which the Jacobian takes derivatives along one direction after another at one place."""
    graph = program.graph
    roots = [y.id for block in program.blocks if block.name in BY_BODIES[1:] for y in block.outputs]
    places, rated, read = (defaultdict[str, set[int]](set) for _ in range(3))
    functions: dict[str, PairFunction] = {}
    for operation, first, *_ in (graph.nodes[i] for i in reachable(graph, roots) if graph.nodes[i][0] in graph.calls):
        call = pair_call(graph, operation)
        if call is None:
            continue
        name = call.function.name
        if call.part == "slope":
            functions[name] = call.function
            places[name].add(first)
            rated[name].update(call.numbers)
        elif call.part == "item":
            read[name].update(call.numbers)
    single = [name for name in sorted(functions) if len(places[name]) == 1]
    return [SumAgain(functions[name], frozenset(rated[name]), frozenset(read[name])) for name in single]


def refuse_sums(program: Program, target: str) -> None:
    """Refuse contacts between groups where a target has no form for them. Raises UsageError."""
    names = sorted({function.element for function, *_ in used_sums(program)})
    if names:
        raise cannot(
            f"{target} has no contacts between groups of shapes (here {', '.join(names)}); use target c, cython or "
            "numpy, or describe each pair by point_plane, sphere_plane or sphere_sphere"
        )


SLOTS = 24  #: numbers of columns for each pair that is listed, of which few are near at a time
COPIED = 16  #: entries of a list that are results one after the other, from which they are copied in a loop


class CopiedRun(NamedTuple):
    """Results that are entries of a list, one after the other."""

    first: int  #: place in the result
    made: int  #: the list
    start: int  #: number of the entry
    length: int


def copied_runs(graph: Graph, outputs: Sequence[Expr]) -> list[CopiedRun]:
    """Long runs of entries of lists among results."""
    runs: list[CopiedRun] = []
    for k, y in enumerate(outputs):
        node = graph.nodes[y.id]
        call = pair_call(graph, node[0])
        if call is None or call.part != "item":
            continue
        made, number = node[1], call.numbers[0]
        if runs and runs[-1][:2] == (k - runs[-1].length, made) and runs[-1].start + runs[-1].length == number:
            runs[-1] = runs[-1]._replace(length=runs[-1].length + 1)
        else:
            runs.append(CopiedRun(k, made, number, 1))
    return [run for run in runs if run.length >= COPIED]


def placed_length(table: Sequence[Sequence[int]]) -> int:
    """Numbers of a shape as placed: motion, sizes, bounding radius, arm from the body's origin, thickness, body."""
    return POSE + len(table[0]) - PLACE - REST + 6


def plain_numbers(function: PairFunction) -> list[float]:
    """What is given behind the bodies before the states of pairs; 0 where an operand is an expression."""
    return [0.0 if x is None else x for x in function.data[: len(function.data) - function.states]]


def work_of(function: PairFunction) -> int:
    """Numbers that a sum works with: its shapes and their rates, and in lanes copies of what is given and found."""
    shapes = sum(len(rows) * placed_length(rows) for rows in function.tables)
    return 2 * shapes + 2 * function.count + max(function.results, function.witnesses)


def slots_of(function: PairFunction) -> int:
    """Numbers for which columns of a derivative at one place have room: so many for each pair that has room."""
    return SLOTS * function.capacity + function.results


def kept_of(function: PairFunction) -> int:
    """Numbers that derivatives at one place keep: shapes, their rates, near pairs with what they exert, and columns."""
    shapes = sum(len(rows) * placed_length(rows) for rows in function.tables)
    columns = 2 * function.count + function.bodies + function.results + 2 + slots_of(function)
    return 2 * shapes + record_of(function) * function.capacity + columns


def record_of(function: PairFunction) -> int:
    """Numbers of one near pair that is kept: its kind, its two shapes and what it exerts."""
    return 3 + RESULT + max(kind.states for kind in function.kinds)


class PairLists:
    """The lists of one block of these statements, behind the rest of its work, which ends at ``start``."""

    def __init__(self, graph: Graph, statements: Iterable[int], start: int) -> None:
        self._graph = graph
        self._places: dict[int, int] = {}
        self._rates: dict[str, int] = {}
        end = start
        work = 0
        for i in statements if graph.calls else ():
            call = self.call(i)
            if call is None or call.part == "item":
                continue
            function = call.function
            self._places[i] = end
            lengths = {
                "given": function.count,
                "meeting": MEETING + MOTION * function.bodies,
                "witnesses": function.witnesses,
            }
            end += lengths.get(call.part, function.results)
            if call.part == "slope" and function.name not in self._rates:
                self._rates[function.name] = end
                end += function.count
            work = max(work, work_of(function))
        self._work = end
        self.end = end + work  #: where the work of the block ends with them
        #: sums of which derivatives are taken along one direction after another at one place, and the operands of C
        #: that say where the count of near pairs and the pairs are kept (``eomgen_pairs.h``)
        self.again: Mapping[str, str] = {}

    def call(self, i: int) -> PairCall | None:
        """What a node does, if it is one of a sum."""
        return pair_call(self._graph, self._graph.nodes[i][0])

    def is_list(self, i: int) -> bool:
        """Whether a node is a list, which has no variable."""
        return i in self._places

    @property
    def every(self) -> Sequence[int]:
        """All lists."""
        return list(self._places)

    def copies(self, runs: Sequence[CopiedRun]) -> list[str]:
        """Statements that copy entries into the result."""
        return [
            f"for (int i = 0; i < {run.length}; i++) {{ out[{run.first} + i] = "
            f"w[{self._places[run.made] + run.start} + i]; }}"
            for run in runs
        ]

    def place(self, i: int) -> int:
        """Where in the work an entry of a list stands."""
        call = self.call(i)
        assert call is not None
        return self._places[self._graph.nodes[i][1]] + call.numbers[0]

    def fills(self, i: int) -> list[tuple[int, int]]:
        """Which operands go where in the work before a list is made."""
        call, operands = self.call(i), self._graph.nodes[i][1:]
        assert call is not None
        function, place = call.function, self._places[i]
        if call.part == "given":
            start = POSE * function.bodies
            return [(place + k, x) for k, x in enumerate(operands) if k < start or function.data[k - start] is None]
        if call.part == "meeting":
            return [(place + MEETING + k, x) for k, x in enumerate(operands[1:])]
        if call.part == "slope":
            rates = self._rates[function.name]
            return [(rates + k, x) for k, x in zip(call.numbers, operands[1:], strict=True)]
        return []

    def lines(self, i: int, filled: Sequence[str]) -> list[str]:
        """The statements that make a list; ``filled`` are those that copy its operands (:meth:`fills`)."""
        call, operands = self.call(i), self._graph.nodes[i][1:]
        assert call is not None
        function, place, work = call.function, self._places[i], self._work
        if call.part == "given":
            start, count = place + POSE * function.bodies, len(plain_numbers(function))
            heads = [
                f"for (int i = 0; i < {count}; i++) {{ w[{start} + i] = same(pairs_{function.name}_numbers[i]); }}"
            ]
            if any(x is not None for x in function.data[count:]):  # counts of pieces that touch, among states
                heads.append(f"for (int i = 0; i < {function.states}; i++) {{ w[{start + count} + i] = same(0.0); }}")
            return [*heads, *filled]
        source = self._places[operands[0]]
        if call.part == "witnesses":
            return [f"pairs_{function.name}_witnesses(w + {source}, w + {place}, w + {work});"]
        if call.part == "sum":
            return [f"pairs_{function.name}_sum(w + {source}, w + {place}, w + {work});"]
        if call.part == "meeting":
            after = f"w + {place + MEETING}, w + {place}, w + {work}"
            return [*filled, f"pairs_{function.name}_meeting(w + {source}, {after});"]
        rates = self._rates[function.name]
        along, capacity = f"w + {source}, w + {rates}, w + {place}", self.again.get(function.name)
        slope = f"slope({along}, w + {work})" if capacity is None else f"again({along}, {capacity})"
        return [
            f"memset(w + {rates}, 0, {function.count} * sizeof *w);",
            *filled,
            f"pairs_{function.name}_{slope};",
        ]


# -- columns of a Jacobian by states of contacts ------------------------------------------------------------------
STATE_RECORD = 3 + 2 * WRENCH  #: number of a state, two bodies, and what each gets


def has_columns(program: Program, function: PairFunction) -> bool:
    """Whether a sum has states whose columns are made from its pairs."""
    return program.contacts is not None and function.name in {one.function.name for one in program.contacts.sums}


def room_of_states(function: PairFunction) -> int:
    """For how many states of near pairs there is room."""
    return function.capacity * max(kind.states for kind in function.kinds)


def contact_areas(program: Program) -> list[tuple[str, int]]:
    """Areas of ``tree_jacobian_held``."""
    if program.contacts is None:
        return []
    functions = [one.function for one in program.contacts.sums]
    return [
        ("CONTACT_OPERANDS", len(program.contacts.operands)),
        ("CONTACT_GIVEN", max(function.count for function in functions)),
        ("CONTACT_LIST", 1 + STATE_RECORD * max(map(room_of_states, functions))),
        ("CONTACT_WORK", max(map(work_of, functions))),
    ]


def contact_tables(program: Program) -> dict[str, Any] | None:
    """What ``equations.c.j2`` writes of them."""
    contacts = program.contacts
    if contacts is None:
        return None
    sums, at, load = [], 0, 0
    for one in contacts.sums:
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
    states = [k for group in contacts.groups for k in group]
    return {
        "sums": sums,
        "groups": contacts.groups,
        "starts": list(accumulate(map(len, contacts.groups), initial=0)),
        "states": states,
        "firsts": list(accumulate((len(contacts.rows[k]) for k in states), initial=0)),
        "rows": [row for k in states for row in contacts.rows[k]],
        "loads": len(contacts.loads),
    }
