"""Stage graph: expressions -> the number of operations they take."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

from ..base.operations import ARITHMETIC, operations_with
from ..records import dataclass
from .core import Expr, Graph
from .pair_calls import pair_call
from .traverse import LEAVES, common_graph, reachable


@dataclass(frozen=True)
class Operations:
    """How many operations evaluate some expressions, each shared node counted once.

    Attributes
    ----------
    multiplications, additions, divisions, negations : int
        Subtractions are additions.
    functions : mapping of str to int
        sqrt, sin, pow, ... by name; a sum over pairs of shapes, its derivatives along a direction, ... once each.
    choices : mapping of str to int
        abs, sign, min, max, comparisons, logic and select by name.
    """

    multiplications: int = 0
    additions: int = 0
    divisions: int = 0
    negations: int = 0
    functions: Mapping[str, int] = field(default_factory=dict)
    choices: Mapping[str, int] = field(default_factory=dict)

    @property
    def total(self) -> int:
        """Multiplications, additions and divisions together."""
        return self.multiplications + self.additions + self.divisions

    def __add__(self, other: Operations) -> Operations:
        return Operations(
            self.multiplications + other.multiplications,
            self.additions + other.additions,
            self.divisions + other.divisions,
            self.negations + other.negations,
            _sum(self.functions, other.functions),
            _sum(self.choices, other.choices),
        )

    def as_dict(self) -> dict[str, Any]:
        """The counts as plain numbers and dicts, for a metadata file."""
        return {
            "multiplications": self.multiplications,
            "additions": self.additions,
            "divisions": self.divisions,
            "negations": self.negations,
            "functions": dict(self.functions),
            "choices": dict(self.choices),
        }


def _sum(a: Mapping[str, int], b: Mapping[str, int]) -> dict[str, int]:
    return {name: a.get(name, 0) + b.get(name, 0) for name in sorted({*a, *b})}


def count(outputs: Sequence[Expr]) -> Operations:
    """Count the distinct operations that the outputs are made of."""
    graph = common_graph(outputs)
    if graph is None:
        return Operations()
    nodes = graph.nodes
    found = Counter(nodes[i][0] for i in reachable(graph, (y.id for y in outputs)))
    found = _with_pairs(graph, found)
    bends, arithmetic = operations_with(lambda row: row.bends), operations_with(lambda row: row.kind == ARITHMETIC)
    return Operations(
        multiplications=found["mul"] + found["absorb"],
        additions=found["add"] + found["sub"],
        divisions=found["div"],
        negations=found["neg"],
        functions={k: found[k] for k in sorted(found.keys() - bends - arithmetic - LEAVES)},
        choices={k: found[k] for k in sorted(found.keys() & bends)},
    )


def _with_pairs(graph: Graph, found: Counter[str]) -> Counter[str]:
    """The same, with sums over pairs of shapes under their names; that results are read from lists is no operation."""
    calls = {name: call for name in found.keys() & graph.calls.keys() if (call := pair_call(graph, name)) is not None}
    if not calls:
        return found
    rest = Counter({name: n for name, n in found.items() if name not in calls})
    for name, call in calls.items():
        if call.part not in ("item", "given"):
            rest[f"pairs {call.function.element}({call.part})"] += found[name]
    return rest


def critical_path(outputs: Sequence[Expr]) -> int:
    """Operations on the longest chain from a leaf to an output; every operation counts 1, negation 0."""
    graph = common_graph(outputs)
    if graph is None:
        return 0
    nodes = graph.nodes
    depth: dict[int, int] = {}
    for i in reachable(graph, (y.id for y in outputs)):
        node = nodes[i]
        if node[0] in LEAVES:
            depth[i] = 0
        else:
            depth[i] = max(depth[k] for k in node[1:]) + (node[0] != "neg")
    return max(depth[y.id] for y in outputs)
