"""Stage program, reactions that equations do not determine: what laws, outputs and events ask for -> which to refuse.

An equation of a joint that vanishes whatever the coordinates are has a multiplier that no equation of motion holds.  It
is 0 in the smallest reactions (those of :mod:`~eomgen.analysis.reactions`) where they do no work together with it, as
those across the plane of a planar mechanism.  Elsewhere what depends on it is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..base.limits.systems import UNTOUCHED
from ..base.operations import CONDITION, OPERATIONS
from ..errors import ModelError, Problem
from ..graph.core import Expr
from ..graph.differentiate import jacobian
from ..graph.evaluate import compile_evaluator
from ..graph.substitute import substitute, symbols_of
from ..graph.traverse import operands, reachable
from ..kinematics import Kinematics
from ..kinematics.reaction_parts import force_and_moment
from ..kinematics.wrenches import Row6
from .reaction_users import Users

PROBES = 3  #: states at which components are looked at
_REMEDY = (
    "let the forces act in the plane of the loop, or give a joint of the loop more freedom (cylindrical, spherical); "
    "reactions(t, x) gives the smallest of all solutions"
)


def refuse_undetermined(
    kinematics: Kinematics,
    every: Mapping[str, Row6],
    idle: Sequence[Expr],
    values: Mapping[Expr, Expr],
    users: Users,
) -> None:
    """Refuse what depends on multipliers that no equation determines, unless they are 0 in the smallest reactions.

    Parameters
    ----------
    every : mapping
        Wrench of each joint, along the axes of S.
    idle : sequence
        The multipliers of equations that vanish, on which these wrenches depend.
    values : mapping
        What the symbols of reactions and multipliers stand for, in terms of ``idle`` too.

    Raises
    ------
    ModelError
    """
    if is_zero(list(jacobian(list(values.values()), list(idle)).values())):
        return
    open_ = _open(kinematics, every, idle)
    if not open_:
        return
    graph, mechanism, motion = kinematics.graph, kinematics.mechanism, kinematics.motion
    problems = list[Problem]()
    for name, quantity in mechanism.reaction_quantities.items():
        symbols = motion.derived_symbols(mechanism, {name})
        if _depends(substitute([graph.symbol(name)], symbols), values, open_):
            part = f"reaction({quantity.of}).{quantity.part}" if quantity.part else f"multiplier({quantity.of})"
            message = f"{part} is undetermined: rigid bodies do not determine how the joints of a loop share this load"
            problems.append(mechanism.problem(quantity.path, message, _REMEDY, "EG-UNDETERMINED"))
    for force in mechanism.forces:
        if force.by_reaction and _depends(users.laws.get(force.name, ()), values, open_):
            message = f"the load of joint {getattr(force, 'joint', '')!r} is undetermined: rigid bodies do not "
            message += "determine how the joints of a loop share it"
            problems.append(mechanism.problem(f"forces.{force.name}", message, _REMEDY, "EG-UNDETERMINED"))
    if problems:
        raise ModelError(problems)


def _depends(found: Sequence[Expr], values: Mapping[Expr, Expr], on: Sequence[Expr]) -> bool:
    """Whether what is asked for depends on such multipliers."""
    slopes = jacobian(substitute(list(found), dict(values)), list(on))
    return not is_zero(list(slopes.values()))


def _open(kinematics: Kinematics, every: Mapping[str, Row6], idle: Sequence[Expr]) -> list[Expr]:
    """The multipliers that are not 0 in the smallest reactions, nor independent of such ones."""
    parts = list[list[Expr]]()
    for spec in kinematics.mechanism.joints:
        if spec.name in every:
            parts += [list(part) for part in force_and_moment(kinematics.motion, spec, every[spec.name])]
    flat = [x for part in parts for x in part]
    slopes = jacobian(flat, list(idle))
    base = substitute(flat, dict.fromkeys(idle, kinematics.graph.zero))
    places = list(slopes)
    numbers = _probed([*base, *slopes.values()])
    related = np.zeros((len(idle), len(idle)), dtype=bool)
    moved = np.zeros(len(idle), dtype=bool)
    for values in numbers:
        S = np.zeros((len(flat), len(idle)))
        for (i, j), d in zip(places, values[len(flat) :], strict=True):
            S[i, j] = d
        for k in range(0, len(flat), 3):  # forces and moments apart: their scales differ
            some, wrench = S[k : k + 3], values[k : k + 3]
            related |= np.abs(some.T @ some) > UNTOUCHED
            moved |= np.abs(some.T @ wrench) > UNTOUCHED
    for _ in idle:  # what is related to something open is open too
        moved = moved | related @ moved
    return [multiplier for multiplier, is_open in zip(idle, moved, strict=True) if is_open]


def _probed(expressions: Sequence[Expr]) -> np.ndarray:
    expressions = _with_every_choice(expressions)
    names = sorted(symbols_of(expressions))
    values = np.random.default_rng(2).uniform(0.5, 1.5, (PROBES, len(names)))
    with np.errstate(all="ignore"):
        evaluate = compile_evaluator(expressions, names)
        return np.array([evaluate(row.tolist()) for row in values])


def _with_every_choice(expressions: Sequence[Expr]) -> list[Expr]:
    """Expressions in which a choice is a combination of its values, so that what acts far from a state is seen too."""
    graph = expressions[0].graph
    new: dict[int, Expr] = {}
    for i in reachable(graph, (x.id for x in expressions)):
        operation = graph.nodes[i][0]
        parts = [new[k] for k in operands(graph.nodes[i])]
        row = OPERATIONS.get(operation)
        if not parts or row is None or not row.bends:
            new[i] = Expr(graph, graph.make(operation, *(x.id for x in parts)) if parts else i)
            continue
        key = graph.nodes[i][1] if row.chooses else i  # choices by one condition are made together
        if row.kind == CONDITION or operation == "sign":
            new[i] = graph.symbol(f"choice {i}")
            continue
        values = parts[1:] if row.chooses else parts
        new[i] = graph.zero
        for k, x in enumerate(values):
            new[i] = new[i] + graph.symbol(f"choice {key}.{k}") * x
    return [new[x.id] for x in expressions]


def is_zero(expressions: Sequence[Expr]) -> bool:
    """Whether expressions vanish whatever their symbols are."""
    left = [x for x in expressions if not x.is_zero]
    return not left or bool((np.abs(_probed(left)) < UNTOUCHED).all())
