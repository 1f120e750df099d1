"""Stage kinematics: constraints that hold nothing, or are not finite at a position -> errors that name them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..base.limits.constraints import BESIDE, FLAT
from ..constraints import RollingDisc
from ..constraints.rolling import LYING
from ..errors import AssemblyError, ModelError
from ..graph.rounding_bounds import vanishing
from ..graph.substitute import substitute, symbols_of
from .constraint_functions import Array, ConstraintFunctions
from .kinematics import Kinematics
from .undefined_rows import place_of

IDLE = "holds nothing"  #: what is said of rows without slopes
TRIES = 12  #: directions in which a row is evaluated


def require_finite(functions: ConstraintFunctions, q: Array) -> None:
    """Refuse a position at which a constraint or its slope is not a number, or so large that its square is none.

    Raises
    ------
    AssemblyError
        Names the rows.
    """
    if not functions.m:
        return
    C, J = functions.position(q)
    with np.errstate(over="ignore", invalid="ignore"):  # rows whose squares overflow have no length, and no rank
        finite = np.isfinite(np.column_stack([J**2, [*C, *[0.0] * (len(J) - len(C))]])).all(axis=1)
    if finite.all():
        return
    k = functions.kinematics
    bad = [k.constraints.labels[i] for i in np.flatnonzero(~finite)]
    discs = {c.name for c in k.mechanism.constraints if isinstance(c, RollingDisc)}
    place = ", ".join(f"{name} = {x:.6g}" for name, x in zip(k.names, q, strict=True))
    what = f"{', '.join(bad)}: the constraint is not finite at the initial configuration {place}"
    if all(label.partition(".")[0] in discs for label in bad):
        raise AssemblyError(f"{what}: {LYING}; tilt the disc in initial or guess", bad, code="EG-NOT-FINITE")
    raise AssemblyError(f"{what}; give another configuration in initial or guess", bad, code="EG-NOT-FINITE")


def refuse_squares(functions: ConstraintFunctions, q: Array) -> None:
    """Refuse written constraints that are least or greatest where they hold, as |r|^2 = 0 of two points is.

    Raises
    ------
    ModelError
        Names the constraints.
    """
    if not functions.h:
        return
    k, scales = functions.kinematics, functions.system.scales
    slopes = np.abs(functions.scaled_jacobian(q)[: functions.h]).max(axis=1, initial=0.0)
    least = np.array(k.constraints.written[: functions.h], dtype=bool) & (slopes < FLAT)
    if not least.any():
        return
    side = np.zeros(functions.h)
    for step in np.random.default_rng(5).normal(size=(TRIES, len(scales.q))) * BESIDE:
        for away in (step, -step):
            higher = np.sign(functions.position(scales.move(q, away))[0] - functions.position(q)[0])
            side = np.where(side == 0, higher, side)
            least &= (higher == side) & (side != 0)
        if not least.any():
            return
    what = (
        "is 0 only where it is least or greatest, as a sum of squares: its slopes vanish there, so it can hold nothing"
    )
    remedy = "write each component as a constraint: x1 - x2 and y1 - y2 for (x1 - x2)**2 + (y1 - y2)**2"
    labels = (k.constraints.labels[i] for i in np.flatnonzero(least))
    raise ModelError(
        [k.mechanism.problem(place_of(k.mechanism, x), f"{x} {what}", remedy, "EG-REDUNDANT") for x in labels]
    )


def refuse_idle_rows(kinematics: Kinematics, numbers: Mapping[str, float]) -> None:
    """Refuse constraints of which no slope is found at any position, where they are all there is.

    Such are a relation whose factors cancel, and one that nothing proves to be an identity.  Rows of joints whose
    slopes vanish identically with the given parameters are no fault: a body may be held twice.

    Parameters
    ----------
    kinematics : Kinematics
    numbers : mapping of str to float
        Values of the parameters.

    Raises
    ------
    ModelError
        Names the constraints and the parameters whose values cancel.
    """
    c, graph = kinematics.constraints, kinematics.graph
    known = {graph.symbol(name): graph.constant(numbers[name]) for name in kinematics.parameter_names}
    problems = []
    for i, (label, row, written) in enumerate(zip(c.labels, c.jacobian, c.written, strict=True)):
        slopes = [x for x in row if not x.is_zero]
        if kinematics.given_rates and i < len(c.slopes) and not all(vanishing(substitute(c.slopes[i], known))):
            continue  # it holds coordinates that no velocity leaves, as the length of Euler parameters
        if (written and slopes) or not all(vanishing(substitute(slopes, known))):
            used = sorted(symbols_of(slopes) & set(kinematics.parameter_names))
            what = f"{label} {IDLE} at all positions that were tried: its slopes are 0"
            remedy = "remove it"
            if used:
                what = f"{label} {IDLE} with the declared {', '.join(used)}: its factors are 0 or cancel"
                remedy = "declare values with which it acts (they determine the degrees of freedom), or remove it"
            problems.append(
                kinematics.mechanism.problem(place_of(kinematics.mechanism, label), what, remedy, "EG-REDUNDANT")
            )
    if problems:
        raise ModelError(problems)
