"""Stage emit: a straight-line block -> pieces of bounded length and the work slots of values that cross between them.

Language-independent; :mod:`.c_text` and :mod:`.numpy_text` print the pieces.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence

from ..base.operations import CONDITION, operations_with
from ..graph.core import Expr, Graph
from ..graph.schedule import chunk, order
from ..graph.traverse import LEAVES
from ..program import Program
from ..records import dataclass
from .alike_branches import Pairs

Slot = int | str  #: a place in an array, or the text of one
FindPairs = Callable[[Sequence[int], Collection[int]], Pairs | None]


@dataclass(frozen=True)
class PrintedFunction:
    """A run of statements, printed as one function.

    Attributes
    ----------
    statements : tuple of int
        Node ids in order.
    loads, stores : mapping of int to Slot
        Node id -> slot of the work array.
    results : mapping of int to tuple of Slot
        Node id -> places in the result.
    checks : frozenset of int
        Ids that must not be <= 0.
    inlined : frozenset of int
        Conditions that stand only in selections and checks, so need no variable of their own.
    """

    statements: tuple[int, ...]
    loads: Mapping[int, Slot]
    stores: Mapping[int, Slot]
    results: Mapping[int, tuple[Slot, ...]]
    checks: frozenset[int]
    inlined: frozenset[int]


@dataclass(frozen=True)
class Pieces:
    """All of a block: its pieces, results that need no statement, and the work slots used."""

    pieces: tuple[PrintedFunction, ...]
    direct: tuple[tuple[int, int], ...]  #: (place in the result, id of a leaf or a hoisted value)
    checks: tuple[int, ...]  #: checks that are leaves or hoisted values
    work: int
    pairs: Pairs | None = None  #: statements that are computed together


def cut(
    graph: Graph,
    outputs: Sequence[Expr],
    checks: Sequence[Expr],
    skipped: frozenset[int],
    statements: int,
    lists: Sequence[Expr] = (),
    find: FindPairs | None = None,
    guards: Sequence[Expr] = (),
) -> Pieces:
    """Order the statements behind outputs and checks and cut them into pieces.

    Parameters
    ----------
    skipped : frozenset of int
        Operations that are not evaluated here (hoisted values and what they are made of).
    statements : int
        Most statements in one piece; what is longer is cut into pieces of at most half of that, which compile faster.
    lists : sequence of Expr
        What is made too, for its own sake.
    find : callable, optional
        Statements, results and checks -> pairs that stay together and cross in places side by side.
    guards : sequence of Expr
        Checks that come before all that they do not need.
    """
    nodes = graph.nodes
    places: dict[int, list[int]] = {}
    for k, y in enumerate(outputs):
        places.setdefault(y.id, []).append(k)
    wanted = [*outputs, *checks, *guards, *lists]
    every = dict.fromkeys((*order(guards), *order(wanted)))
    sequence = _pair(graph, [i for i in every if i not in skipped])
    check_ids = {y.id for y in (*checks, *guards)}
    pairs = None if find is None else find(sequence, {*places, *check_ids})
    second: Mapping[int, int] = {}
    if pairs is not None:
        sequence, second = pairs.in_order(graph, sequence), pairs.second
    longest = statements if len(sequence) <= statements else max(1, statements // 2)
    chunks = chunk(sequence, wanted, longest, second)
    first = {b: a for a, b in second.items()}
    last_use = {first.get(i, i): k for k, c in enumerate(chunks) for i in c.imports}
    slots: dict[int, int] = {}
    free: dict[int, list[int]] = {1: [], 2: []}  #: by number of places side by side
    work = 0
    pieces = []
    for k, c in enumerate(chunks):
        exports = dict.fromkeys(j for i in c.exports for j in _together(first.get(i, i), second))
        for i in exports:
            size = 1 + (i in second)
            if i in first:
                continue
            if not free[size]:
                free[size].append(work)
                work += size
            slots[i] = free[size].pop()
            if i in second:
                slots[second[i]] = slots[i] + 1
        pieces.append(
            PrintedFunction(
                statements=c.statements,
                loads={i: slots[i] for i in c.imports},
                stores={i: slots[i] for i in exports},
                results={i: tuple(places[i]) for i in c.statements if i in places},
                checks=frozenset(check_ids.intersection(c.statements)),
                inlined=conditions(graph, c.statements, {*c.exports, *places}, check_ids),
            )
        )
        ended = {first.get(i, i) for i in c.imports if last_use[first.get(i, i)] == k}
        for i in sorted(ended, key=slots.__getitem__, reverse=True):
            free[1 + (i in second)].append(slots[i])
    made = {i for p in pieces for i in p.statements}
    direct = tuple((k, y.id) for k, y in enumerate(outputs) if y.id not in made)
    bare = tuple(sorted(check_ids - made))
    assert all(nodes[i][0] in LEAVES or i in skipped for _, i in direct)
    return Pieces(tuple(pieces), direct, bare, work, pairs)


def _together(i: int, second: Mapping[int, int]) -> tuple[int, ...]:
    """A statement, with the other of its pair."""
    return (i, second[i]) if i in second else (i,)


def _pair(graph: Graph, sequence: list[int]) -> list[int]:
    """Put sin and cos of one argument side by side, so that a compiler makes one call of both."""
    nodes = graph.nodes
    partner: dict[int, int] = {}
    seen: dict[int, int] = {}
    for i in sequence:
        if nodes[i][0] in ("sin", "cos"):
            argument = nodes[i][1]
            if argument in seen:
                partner[seen[argument]] = i
            else:
                seen[argument] = i
    later = set(partner.values())
    result = []
    for i in sequence:
        if i in later:
            continue
        result.append(i)
        if i in partner:
            result.append(partner[i])
    return result


def conditions(graph: Graph, statements: Iterable[int], kept: Container[int], checks: Container[int]) -> frozenset[int]:
    """Conditions of this piece that are used as conditions only."""
    nodes, relations = graph.nodes, operations_with(lambda row: row.kind == CONDITION)
    found = set()
    for i in statements:
        node = nodes[i]
        if node[0] in relations and i not in kept and (i not in checks or node[0] == "lt"):
            found.add(i)
        found.difference_update(node[2:] if node[0] == "select" else node[1:])
    return frozenset(found)


def references(program: Program, inputs: Sequence[str]) -> dict[int, str]:
    """Node id -> text, for every leaf symbol and hoisted value a block can read."""
    graph = program.graph
    texts = {graph.symbol(program.time).id: "t"}
    texts.update({graph.symbol(name).id: f"c[{k}]" for k, name in enumerate(program.parameters)})
    texts.update({y.id: f"c[{len(program.parameters) + k}]" for k, y in enumerate(program.hoisted)})
    texts.update({graph.symbol(name).id: f"u[{k}]" for k, name in enumerate(program.inputs)})
    texts.update({graph.symbol(name).id: f"x[{k}]" for k, name in enumerate(inputs)})
    return texts
