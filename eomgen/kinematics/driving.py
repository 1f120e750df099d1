"""Stage kinematics: drivers at the reference and over time -> closed positions, or what contradicts what.

Drivers take their degrees of freedom in the order of the model; one that finds none left over-drives the mechanism.
It may stay where it asks for nothing that the others do not give, at all times tried.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.limits.constraints import CONTRADICTION
from ..constraints import Driver
from ..errors import TO_BE_FINITE, AssemblyError, ModelError
from ..graph.substitute import symbols_of
from ..numeric.constraint_system import Assembly, ConstraintSystem
from ..numeric.continuation import Continuation
from ..numeric.held_path import HeldPath
from ..numeric.ranks import rank

if TYPE_CHECKING:
    from .constraint_functions import ConstraintFunctions

Array = NDArray[np.float64]
FIRST, STEPS = 1e-3, 16  #: part of the span in the first step of a motion over it; its steps at most


def driver_rows(functions: ConstraintFunctions) -> dict[int, str]:
    """Row -> name of its driver."""
    labels = functions.kinematics.constraints.labels
    names = {c.name for c in functions.kinematics.mechanism.constraints if isinstance(c, Driver)}
    found = {i: label.partition(".")[0] for i, label in enumerate(labels)}
    return {i: name for i, name in found.items() if name in names}


def close_driven(functions: ConstraintFunctions, given: Mapping[str, float], guess: Mapping[str, float]) -> Assembly:
    """Assemble at t = 0; where that fails for the drivers, say so.

    Raises
    ------
    AssemblyError
        The loops do not close, or not with the values that the drivers ask for.
    ModelError
        There are more drivers than degrees of freedom, and they contradict each other.
    """
    drivers = driver_rows(functions)
    try:
        found = functions.close_nearest(given, guess)
    except AssemblyError as error:
        if not drivers:
            raise
        raise _explain(functions, drivers, given, guess, error) from None
    if drivers:
        _refuse_contradictions(functions, drivers, found.q)
    return found


def follow_drivers(functions: ConstraintFunctions, q: Array) -> list[Array]:
    """Closed positions at later times, as further samples; none without drivers, or where they cannot be followed."""
    drivers = driver_rows(functions)
    jacobian = [e for row in functions.kinematics.constraints.jacobian for e in row]
    if not drivers or "t" in symbols_of(jacobian):
        return []
    return [position for _, position in _follow(functions.system, q, functions)][1::4]


def _follow(system: ConstraintSystem, q: Array, functions: ConstraintFunctions) -> list[tuple[float, Array]]:
    """Closed positions at times after 0, a small motion apart."""
    end = functions.kinematics.mechanism.simulation.end
    continuation = Continuation(HeldPath(system, q, {}, end), q, fewest=STEPS)
    continuation.step = FIRST
    continuation.to(1.0, steps=STEPS)
    return [(point.s * end, point.q) for point in continuation.points[1:]]


def _guess(functions: ConstraintFunctions, q: Array) -> dict[str, float]:
    """Coordinates of a position, but for those that have a better guess of their own."""
    hinted = {name for name, _ in functions.kinematics.hints}
    return {n: float(x) for n, x in zip(functions.kinematics.names, q, strict=True) if n not in hinted}


def _others(functions: ConstraintFunctions, drivers: Sequence[int]) -> list[int]:
    return [i for i in range(functions.m) if i not in drivers]


def _needed(
    functions: ConstraintFunctions, drivers: Mapping[int, str], q: Array, t: float = 0.0
) -> tuple[list[int], list[int]]:
    """Rows that count at a position, drivers in order as long as they add something; and the drivers left over."""
    J = functions.scaled_jacobian(q, t)
    kept = _others(functions, list(drivers))
    spare = []
    for row in drivers:
        if rank(J[[*kept, row]]).rank > rank(J[kept]).rank:
            kept.append(row)
        else:
            spare.append(row)
    return sorted(kept), spare


def _explain(
    functions: ConstraintFunctions,
    drivers: Mapping[int, str],
    given: Mapping[str, float],
    guess: Mapping[str, float],
    error: AssemblyError,
) -> AssemblyError | ModelError:
    """Why the mechanism cannot be assembled with its drivers."""
    free = functions.with_rows(_others(functions, list(drivers)))
    try:
        q = functions.close(given, guess, system=free).q
    except AssemblyError as loops:
        return loops  # not for the drivers' sake
    with np.errstate(all="ignore"):
        values = functions.position(q)[0]
    lost = [i for i in drivers if not np.isfinite(values[i])]
    if lost:
        names, labels = [drivers[i] for i in lost], functions.kinematics.constraints.labels
        return AssemblyError(
            f"{', '.join(names)} has no finite value at t = 0: {TO_BE_FINITE}",
            [labels[i] for i in lost],
            code="EG-NOT-FINITE",
        )
    kept, spare = _needed(functions, drivers, q)
    if spare:
        try:
            q = functions.close(given, guess, system=functions.with_rows(kept)).q
        except AssemblyError:
            pass
        else:
            return _contradiction(functions, drivers, spare, q, 0.0)
    if given:
        try:
            functions.close({}, {**guess, **given})
        except AssemblyError:
            pass
        else:
            held = f"{error}; at t = 0 the drivers prescribe {', '.join(drivers.values())} too"
            return AssemblyError(held, error.rows, code="EG-CONTRADICTION")
    C = functions.position(q)[0]
    gaps = [f"{drivers[i]} by {abs(C[i]):.3g} {_unit(functions, i)}" for i in drivers]
    rows = [functions.kinematics.constraints.labels[i] for i in drivers]
    text = str(error).partition("; check")[0]
    words = (
        f"the loops cannot reach the position that the drivers prescribe at t = 0: {text}; at the position nearest to "
        f"the guess where the loops close, the drivers are off ({', '.join(gaps)}); give the drivers values within "
        "reach, or a guess nearer to them"
    )
    return AssemblyError(words, [*rows, *error.rows], code="EG-CONTRADICTION")


def _refuse_contradictions(functions: ConstraintFunctions, drivers: Mapping[int, str], q: Array) -> None:
    """Follow the drivers that count; those left over must agree with them."""
    kept, spare = _needed(functions, drivers, q)
    if not spare:
        return
    for t, here in _follow(functions.with_rows(kept), q, functions):
        if len(_needed(functions, drivers, here, t)[0]) > len(kept):
            break  # the first position was singular; elsewhere all of them count
        C = functions.scales.residual(functions.position(here, t)[0])
        if np.abs(C[spare]).max() > CONTRADICTION:
            raise _contradiction(functions, drivers, spare, here, t)


def _contradiction(
    functions: ConstraintFunctions, drivers: Mapping[int, str], spare: Sequence[int], q: Array, t: float
) -> ModelError:
    mechanism = functions.kinematics.mechanism
    C = functions.position(q, t)[0]
    deaf = [row for row in spare if not _felt(functions, drivers, row, q)]
    others = [name for row, name in drivers.items() if row not in spare]
    freedoms = len(others)
    problems = []
    for row in spare:
        gap = f"{abs(C[row]):.3g} {_unit(functions, row)} at t = {t:.4g} s"
        verb = "moves" if freedoms == 1 else "move"
        who = f"{' and '.join(others)} {verb} it already" if others else "the mechanism cannot move"
        if row in deaf:
            problems.append(
                mechanism.problem(
                    f"constraints.{drivers[row]}",
                    "the driver has no effect: no motion of the mechanism changes the quantity that it prescribes, "
                    f"and this is off by {gap}",
                    "drive a coordinate, or two markers that move relative to each other",
                    "EG-REDUNDANT",
                )
            )
            continue
        message = (
            f"the mechanism is over-driven: it has {freedoms} degree{'s' if freedoms != 1 else ''} of freedom and "
            f"{len(drivers)} driver{'s' if len(drivers) != 1 else ''}; {who}, and {drivers[row]} is off by {gap}"
        )
        remedy = f"remove one of {', '.join(drivers.values())}, or give them values that agree"
        problems.append(mechanism.problem(f"constraints.{drivers[row]}", message, remedy, "EG-CONTRADICTION"))
    return ModelError(problems)


def _felt(functions: ConstraintFunctions, drivers: Mapping[int, str], row: int, q: Array) -> bool:
    """Whether a motion that the loops allow changes what a driver prescribes: here, or beside a dead centre."""
    loops = _others(functions, list(drivers))
    free = functions.with_rows(loops)
    random = np.random.default_rng(1)
    for moved in (0.0, 0.1, 0.3, 0.3):
        step = moved * random.uniform(-1.0, 1.0, functions.scales.q.size)
        try:
            start = _guess(functions, functions.scales.move(q, step))
            here = functions.close({}, start, restarts=0, system=free).q if moved else q
        except AssemblyError:
            continue
        J = functions.scaled_jacobian(here)
        if rank(J[[*loops, row]]).rank > rank(J[loops]).rank:
            return True
    return False


def _unit(functions: ConstraintFunctions, row: int) -> str:
    return "m" if functions.kinematics.constraints.kinds[row] == "length" else "rad"
