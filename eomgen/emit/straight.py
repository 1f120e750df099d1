"""Stage emit: a straight-line block -> pieces of bounded length and the work slots of values that cross between them.

Language-independent; :mod:`.c_text` and :mod:`.numpy_text` print the pieces.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence

from ..graph.core import Expr, Graph
from ..graph.schedule import chunk, order
from ..graph.traverse import LEAVES
from ..operations import CONDITION, operations_with
from ..program import Program
from ..records import dataclass

Slot = int | str  #: a place in an array, or the text of one


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


def cut(
    graph: Graph,
    outputs: Sequence[Expr],
    checks: Sequence[Expr],
    skipped: frozenset[int],
    statements: int,
    lists: Sequence[Expr] = (),
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
    """
    nodes = graph.nodes
    places: dict[int, list[int]] = {}
    for k, y in enumerate(outputs):
        places.setdefault(y.id, []).append(k)
    wanted = [*outputs, *checks, *lists]
    sequence = _pair(graph, [i for i in order(wanted) if i not in skipped])
    chunks = chunk(sequence, wanted, statements if len(sequence) <= statements else max(1, statements // 2))
    last_use = {i: k for k, c in enumerate(chunks) for i in c.imports}
    slots: dict[int, int] = {}
    free: list[int] = []
    work = 0
    check_ids = {y.id for y in checks}
    pieces = []
    for k, c in enumerate(chunks):
        for i in c.exports:
            if not free:
                free.append(work)
                work += 1
            slots[i] = free.pop()
        pieces.append(
            PrintedFunction(
                statements=c.statements,
                loads={i: slots[i] for i in c.imports},
                stores={i: slots[i] for i in c.exports},
                results={i: tuple(places[i]) for i in c.statements if i in places},
                checks=frozenset(check_ids.intersection(c.statements)),
                inlined=conditions(graph, c.statements, {*c.exports, *places}, check_ids),
            )
        )
        free.extend(sorted((slots[i] for i in c.imports if last_use[i] == k), reverse=True))
    made = {i for p in pieces for i in p.statements}
    direct = tuple((k, y.id) for k, y in enumerate(outputs) if y.id not in made)
    bare = tuple(sorted(check_ids - made))
    assert all(nodes[i][0] in LEAVES or i in skipped for _, i in direct)
    return Pieces(tuple(pieces), direct, bare, work)


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
