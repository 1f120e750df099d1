"""Kinematics -> the method whose right-hand side takes fewer operations, and both counts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

from ..expr.evaluate import Evaluator
from ..expr.schedule import count
from ..mechanics import Kinematics
from ..mechanics.methods import METHODS, TreeEquations
from ..mechanics.mobility import Mobility
from ..mechanics.wrenches import cut_drives
from .linear_algebra import factoring_operations, factorize_tree, has_long_paths, is_unrolled
from .loop_systems import BodyLoops, EmbeddedLoops, estimate
from .program import Limits
from .terms import SystemTerms


class Choice:
    """What ``auto`` took and why.

    Attributes
    ----------
    method : str
    operations : mapping of str to int
        Multiplications, additions and divisions of the right-hand side by each method compared; of ``embedding`` only
        those of the factorisation where they alone are more than all of ``recursive``.  Counted when they are read
        where only one method is left, as nothing depends on them then.
    """

    def __init__(self, method: str, counted: dict[str, int] | Callable[[], dict[str, int]]) -> None:
        self.method, self._counted = method, counted

    @cached_property
    def operations(self) -> dict[str, int]:
        return self._counted() if callable(self._counted) else self._counted

    def __reduce__(self) -> tuple[type[Choice], tuple[str, dict[str, int]]]:
        return Choice, (self.method, self.operations)

    def __str__(self) -> str:
        counts = ", ".join(f"{method} {n}" for method, n in self.operations.items())
        return f"{self.method} chosen; right-hand side: {counts} operations"


def choose(kinematics: Kinematics, mobility: Mobility) -> tuple[TreeEquations, Choice | None]:
    """Derive by ``embedding`` and by ``recursive``; keep the one whose right-hand side takes fewer operations."""
    if cut_drives(kinematics):  # its inertia couples branches: what recursion cannot have
        return METHODS["embedding"](kinematics), None
    if kinematics.constraints.labels:
        return _choose_with_constraints(kinematics, mobility)
    return _choose_of_tree(kinematics)


def _choose_with_constraints(kinematics: Kinematics, mobility: Mobility) -> tuple[TreeEquations, Choice | None]:
    """By the operations once the state is on the constraints, which takes the same in both.

    An embedded system that is too large to be written out is not derived.  Joints that move (almost) no mass by
    themselves, as those of light rods may, are for embedding.
    """
    operations: dict[str, int] = {}
    factors = estimate(kinematics.constraints.jacobian, mobility.n_dof)
    embedding = None
    if not mobility.n_dof or factors <= Limits().unrolled_loops:
        embedding = METHODS["embedding"](kinematics)
        embedded = EmbeddedLoops(SystemTerms(kinematics, mobility, embedding))
        if not mobility.n_dof or not embedded.determined:
            return embedding, None
        operations["embedding"] = embedded.operations
    recursive = METHODS["recursive"](kinematics)
    if not has_long_paths(kinematics.parent):
        embedding = embedding or METHODS["embedding"](kinematics)
        recursive = _with_shorter(recursive, embedding)
    bodies = BodyLoops(SystemTerms(kinematics, mobility, recursive))
    if bodies.motion is None or not _is_sound(kinematics, mobility, bodies):
        return embedding or METHODS["embedding"](kinematics), None
    if "embedding" not in operations:
        return recursive, Choice("recursive", lambda: {"recursive": bodies.operations})
    operations["recursive"] = bodies.operations
    assert embedding is not None
    chosen = embedding if operations["embedding"] <= operations["recursive"] else recursive
    return chosen, Choice(chosen.method, operations)


def _with_shorter(recursive: TreeEquations, embedding: TreeEquations) -> TreeEquations:
    """The recursive form with the mass matrix, forces and inverse dynamics of the other where these are shorter."""
    result = replace(recursive, mass=embedding.mass)
    if count(list(embedding.bias)).total < count(list(recursive.bias)).total:
        result.bias = embedding.bias
    if count(list(embedding.inverse_dynamics)).total < count(list(recursive.inverse_dynamics)).total:
        result.inverse_dynamics = embedding.inverse_dynamics
    return result


def _is_sound(kinematics: Kinematics, mobility: Mobility, bodies: BodyLoops) -> bool:
    """Whether articulated bodies can be used at the reference and at most other configurations of the mechanism."""
    m = kinematics.mechanism
    numbers = {p.name: 1.0 if p.value is None else float(p.value) for p in m.parameters} | {
        u.name: u.value for u in m.inputs
    }
    known = (*kinematics.names, *kinematics.velocity_names, *numbers, "t")
    evaluate = Evaluator([bodies.is_sound], known)
    rest = [0.0] * len(kinematics.velocity_names)
    result = [bool(evaluate([*sample, *rest, *numbers.values(), 0.0])[0] == 1.0) for sample in mobility.samples]
    return result[0] and 2 * sum(result) > len(result)


def _choose_of_tree(kinematics: Kinematics) -> tuple[TreeEquations, Choice]:
    """Without constraints.

    The mass matrix of a large tree is not even formed where factoring it would take more than the recursive method does
    in all.
    """
    recursive = METHODS["recursive"](kinematics)
    assert recursive.accelerations is not None
    operations = {"recursive": count(list(recursive.accelerations)).total}
    factoring = factoring_operations(kinematics.parent)
    large = not is_unrolled(kinematics.parent, Limits().unrolled)
    if factoring >= operations["recursive"] and has_long_paths(kinematics.parent):
        return recursive, Choice("recursive", {"embedding": factoring, **operations})
    embedding = METHODS["embedding"](kinematics)
    if large:
        lower = [x for i, row in enumerate(embedding.mass_matrix) for x in row[: i + 1]]
        total = factoring + count([*lower, *embedding.bias]).total
    else:
        turned = embedding.turned
        mass, bias = turned.system if turned else (embedding.mass_matrix, embedding.bias)
        solution = factorize_tree(mass, kinematics.parent).solve([-h for h in bias])
        total = count(turned.accelerations(solution) if turned else solution).total
    operations = {"embedding": total, **operations}
    chosen = _with_shorter(recursive, embedding) if operations["recursive"] < total else embedding
    return chosen, Choice(chosen.method, operations)
