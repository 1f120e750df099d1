"""Expressions -> their number of operations, an order of evaluation, a tape that a loop can play."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import asdict, field
from itertools import pairwise
from typing import Any

from ..base.operations import ARITHMETIC, OPERATIONS, operations_with
from ..errors import cannot
from .core import LEAVES, Expr, Graph, common_graph, reachable
from .records import Record

# -- numbers of operations ---------------------------------------------------------------------------------------------


class Operations(Record):
    """How many operations evaluate some expressions, each shared node counted once."""

    multiplications: int = 0
    additions: int = 0  #: and subtractions
    divisions: int = 0
    negations: int = 0
    #: sqrt, sin, pow, ... by name; a sum over pairs of shapes, its derivatives along a direction, ... once each
    functions: Mapping[str, int] = field(default_factory=dict)
    #: abs, sign, min, max, comparisons, logic and select by name
    choices: Mapping[str, int] = field(default_factory=dict)

    @property
    def total(self) -> int:
        """Multiplications, additions and divisions together."""
        return self.multiplications + self.additions + self.divisions

    def __add__(self, other: Operations) -> Operations:
        merged: dict[str, Any] = other.as_dict()
        for name, value in self.as_dict().items():
            both = value + merged[name] if isinstance(value, int) else Counter(value) + Counter(merged[name])
            merged[name] = both if isinstance(both, int) else dict(sorted(both.items()))
        return Operations(**merged)

    def as_dict(self) -> dict[str, Any]:
        """The counts as plain numbers and dicts, for a metadata file."""
        return asdict(self)


def count(outputs: Sequence[Expr], skipped: Container[int] = ()) -> Operations:
    """Count the distinct operations that the outputs are made of, but for those ``skipped``."""
    graph = common_graph(outputs)
    if graph is None:
        return Operations()
    nodes = graph.nodes
    result = Counter(nodes[i][0] for i in reachable(graph, (y.id for y in outputs)) if i not in skipped)
    for name in result.keys() & graph.calls.keys():
        n, counted = result.pop(name), graph.calls[name][0].counted(name)
        if counted:
            result[counted] += n
    bends, arithmetic = operations_with(lambda row: row.bends), operations_with(lambda row: row.kind == ARITHMETIC)
    return Operations(
        multiplications=result["mul"] + result["absorb"],
        additions=result["add"] + result["sub"],
        divisions=result["div"],
        negations=result["neg"],
        functions={k: result[k] for k in sorted(result.keys() - bends - arithmetic - LEAVES)},
        choices={k: result[k] for k in sorted(result.keys() & bends)},
    )


# -- order of evaluation -----------------------------------------------------------------------------------------------


class Chunk(Record):
    """A run of statements, ids of nodes, that can stand in a function of its own."""

    statements: tuple[int, ...]  #: in order of evaluation
    imports: tuple[int, ...]  #: made by earlier chunks and used here, ascending
    exports: tuple[int, ...]  #: made here and used by later chunks, ascending
    results: tuple[int, ...]  #: made here that are outputs, ascending; one may also be an export


def order(outputs: Sequence[Expr]) -> list[int]:
    """Order in which to evaluate the outputs so that few values are live at a time.

    Depth first, operands before their node, and of a node's operands first the one that needs more registers
    (R. Sethi, J. D. Ullman, The generation of optimal code for arithmetic expressions, J. ACM 17 (1970), applied to
    the graph as if it were a tree).  Where a graph is so shared that the order in which it was made needs fewer live
    values, that order is taken.  Constants and symbols are not in it.
    """
    graph = common_graph(outputs)
    if graph is None:
        return []
    roots = [y.id for y in outputs]
    need = _registers(graph, roots)
    depth_first = _depth_first(graph, roots, need)
    as_made = sorted(depth_first)
    return min(depth_first, as_made, key=lambda statements: max(crossings(graph, statements)))


def _depth_first(graph: Graph, roots: Sequence[int], need: Mapping[int, int]) -> list[int]:
    nodes = graph.nodes
    result: list[int] = []
    done = {i for i in need if nodes[i][0] in LEAVES}
    for root in roots:
        stack = [root]
        while stack:
            i = stack[-1]
            if i in done:
                stack.pop()
                continue
            open_operands = [k for k in nodes[i][1:] if k not in done]
            if open_operands:
                if len(open_operands) > 1:  # the heaviest on top of the stack; ties by id, so that the order is fixed
                    open_operands.sort(key=lambda k: (need[k], -k))
                stack.extend(open_operands)
            else:
                stack.pop()
                done.add(i)
                result.append(i)
    return result


def _registers(graph: Graph, roots: Sequence[int]) -> dict[int, int]:
    """Sethi-Ullman numbers: registers each node would need if it were a tree; leaves need none."""
    nodes = graph.nodes
    need: dict[int, int] = {}
    for i in reachable(graph, roots):
        node = nodes[i]
        if node[0] in LEAVES:
            need[i] = 0
        elif len(node) == 2:
            need[i] = need[node[1]] or 1
        elif len(node) == 3:
            a, b = need[node[1]], need[node[2]]
            need[i] = (a if a > b else b if b > a else a + 1) or 1
        else:
            ranked = sorted((need[k] for k in node[1:]), reverse=True)
            need[i] = max(1, *(n + waiting for waiting, n in enumerate(ranked)))
    return need


def _last_uses(graph: Graph, statements: Sequence[int]) -> dict[int, int]:
    """Statement id -> index of the last statement that uses it (its own index if none does)."""
    nodes = graph.nodes
    last = {i: k for k, i in enumerate(statements)}
    for k, i in enumerate(statements):
        for j in nodes[i][1:]:
            if j in last:
                last[j] = k
    return last


def crossings(graph: Graph, statements: Sequence[int]) -> list[int]:
    """How many values are made by ``statements[:k]`` and used in ``statements[k:]``, for k of 0 to n.

    The largest is the number of live values that the order needs.
    """
    steps = [0] * (len(statements) + 2)
    last = _last_uses(graph, statements)
    for k, i in enumerate(statements):
        steps[k + 1] += 1
        steps[last[i] + 1] -= 1
    live = 0
    result = []
    for k in range(len(statements) + 1):
        live += steps[k]
        result.append(live)
    return result


def chunk(
    statements: Sequence[int], outputs: Sequence[Expr], size: int = 2000, followed: Container[int] = ()
) -> list[Chunk]:
    """Cut an order into chunks at its narrow waists.

    Each chunk has between half of ``size`` and ``size`` statements (the last one perhaps fewer) and ends where the
    fewest values cross; of equal places the latest.  Statements in ``followed`` stay in one chunk with the next.
    """
    graph = common_graph(outputs)
    if graph is None or not statements:
        return []
    live = crossings(graph, statements)
    cuts = [0]
    while len(statements) - cuts[-1] > size:
        window = range(cuts[-1] + size, cuts[-1] + max(1, size // 2) - 1, -1)
        cut = min(window, key=live.__getitem__)
        cuts.append(cut + (statements[cut - 1] in followed))
    cuts.append(len(statements))

    nodes = graph.nodes
    last = _last_uses(graph, statements)
    wanted = {y.id for y in outputs}
    chunks = []
    for start, end in pairwise(cuts):
        mine = statements[start:end]
        here = set(mine)
        used = {j for i in mine for j in nodes[i][1:] if j in last}
        chunks.append(
            Chunk(
                statements=tuple(mine),
                imports=tuple(sorted(used - here)),
                exports=tuple(sorted(i for i in mine if last[i] >= end)),
                results=tuple(sorted(here & wanted)),
            )
        )
    return chunks


# -- tapes -------------------------------------------------------------------------------------------------------------


Instruction = tuple[str, int, int, int]
#: (operation, operands) one after the other, the numbers among them, and the instructions handed out.
Tape = tuple[list[Instruction], list[float], list[int]]


def record_tape(expressions: Sequence[Expr], place: Callable[[str], tuple[str, int]]) -> Tape:
    """One tape for several expressions; ``place`` gives a symbol its kind (``t``, ``x``, ``u``, ``p``) and index.

    Raises
    ------
    UsageError
        An expression calls a function that the model declares: a tape knows operations only.
    """
    code: list[Instruction] = []
    numbers: list[float] = []
    out: list[int] = []
    for expression in expressions:
        graph = expression.graph
        result: dict[int, int] = {}
        for i in reachable(graph, [expression.id]):
            kind, *operands = graph.nodes[i]
            if kind == "const":
                code.append(("const", len(numbers), 0, 0))
                numbers.append(float(operands[0]))
            elif kind == "sym":
                code.append((*place(operands[0]), 0, 0))
            elif kind in OPERATIONS:
                a, b, c = (*(result[k] for k in operands), 0, 0)[:3]
                code.append((kind, a, b, c))
            else:
                raise cannot("functions of the model cannot be used in an input over time")
            result[i] = len(code) - 1
        out.append(result[expression.id])
    return code, numbers, out
