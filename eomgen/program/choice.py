"""Stage program: Kinematics of a tree -> the method whose right-hand side takes fewer operations, and both counts."""

from __future__ import annotations

from collections.abc import Mapping

from ..equations import METHODS, TreeEquations
from ..graph.count import count
from ..kinematics import Kinematics
from ..records import dataclass
from .factor import factoring_operations, factorize, is_unrolled, solve
from .program import Limits


@dataclass(frozen=True)
class Choice:
    """What ``auto`` took and why.

    Attributes
    ----------
    method : str
    operations : mapping of str to int
        Multiplications, additions and divisions of the right-hand side by each method compared; of ``embedding`` only
        those of the factorisation where they alone are more than all of ``recursive``.
    """

    method: str
    operations: Mapping[str, int]

    def __str__(self) -> str:
        counts = ", ".join(f"{method} {n}" for method, n in self.operations.items())
        return f"{self.method} chosen; operations of the right-hand side: {counts}"


def choose(kinematics: Kinematics) -> tuple[TreeEquations, Choice]:
    """Derive a tree without loops by ``embedding`` and by ``recursive``; keep the one that takes fewer operations.

    The mass matrix of a large tree is not even formed where factoring it would take more than the recursive method does
    in all.
    """
    recursive = METHODS["recursive"](kinematics)
    assert recursive.accelerations is not None
    operations = {"recursive": count(list(recursive.accelerations)).total}
    factoring = factoring_operations(kinematics.parent)
    large = not is_unrolled(kinematics.parent, Limits().unrolled)
    if large and factoring >= operations["recursive"]:
        return recursive, Choice("recursive", {"embedding": factoring, **operations})
    embedding = METHODS["embedding"](kinematics)
    if large:
        lower = [x for i, row in enumerate(embedding.mass_matrix) for x in row[: i + 1]]
        total = factoring + count([*lower, *embedding.bias]).total
    else:
        turned = embedding.turned
        mass, bias = turned.system if turned else (embedding.mass_matrix, embedding.bias)
        solution = solve(factorize(mass, kinematics.parent), [-h for h in bias])
        total = count(turned.accelerations(solution) if turned else solution).total
    operations = {"embedding": total, **operations}
    chosen = recursive if operations["recursive"] < total else embedding
    return chosen, Choice(chosen.method, operations)
