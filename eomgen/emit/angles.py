"""Stage emit: a piece of statements -> the angles whose sin and cos can be computed together at its start."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ..graph.core import Graph
from ..records import dataclass
from .alike_branches import Pairs
from .straight import PrintedFunction

CIRCULAR = ("sin", "cos")


@dataclass(frozen=True)
class Angles:
    """What is computed together.

    Attributes
    ----------
    first : tuple of int
        Statements that the angles are made of, in order; they come before all others.
    arguments : tuple of int
        Ids of the angles.
    """

    first: tuple[int, ...]
    arguments: tuple[int, ...]


def gather_angles(graph: Graph, piece: PrintedFunction, pairs: Pairs | None = None) -> Angles:
    """The angles of a piece that do not themselves depend on a sin or cos computed in it; first those of pairs."""
    nodes = graph.nodes
    inside = set(piece.statements)
    late: set[int] = set()
    arguments: dict[int, None] = {}
    for i in piece.statements:
        node = nodes[i]
        circular = node[0] in CIRCULAR
        if circular and node[1] not in late:
            arguments[node[1]] = None
        if circular or not late.isdisjoint(node[1:]):
            late.add(i)
    if pairs is not None:
        arguments = _side_by_side(arguments, pairs)
    first = _behind(graph, arguments, inside)
    return Angles(tuple(i for i in piece.statements if i in first), tuple(arguments))


def _side_by_side(arguments: dict[int, None], pairs: Pairs) -> dict[int, None]:
    found: dict[int, None] = {}
    for operands in pairs.operands.values():
        if len(operands) == 1 and arguments.keys() >= {operands[0][0], operands[0][1]}:
            found |= {operands[0][0]: None, operands[0][1]: None}
    return found | arguments


def _behind(graph: Graph, roots: Collection[int], inside: set[int]) -> set[int]:
    """The statements that roots are made of, themselves included."""
    found: set[int] = set()
    open_ends = [i for i in roots if i in inside]
    while open_ends:
        i = open_ends.pop()
        if i not in found:
            found.add(i)
            open_ends.extend(k for k in graph.nodes[i][1:] if k in inside)
    return found


def print_angles(operands: Sequence[str]) -> list[str]:
    """C statements that fill ``sines`` and ``cosines``, four angles at a time."""
    n = len(operands)
    lines = [f"real sines[{n}], cosines[{n}];"]
    start, sign = 0, "bits far ="
    for size, name in ((4, "four"), (2, "two"), (1, "one")):
        while n - start >= size:
            group = ", ".join(operands[start : start + size])
            lines.append(f"{sign} sincos_{name}({group}, sines + {start}, cosines + {start});")
            start, sign = start + size, "far |="
    lines.append("if (any_far(far)) {")
    lines += [f"    sincos_far({a}, sines + {k}, cosines + {k});" for k, a in enumerate(operands)]
    return [*lines, "}"]
