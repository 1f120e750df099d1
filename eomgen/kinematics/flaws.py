"""Stage kinematics: what no motion can mend: springs of no length, discs that always lie flat, undefined rows."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ..constraints import RollingDisc
from ..constraints.rolling import LYING
from ..describe.mechanism import Mechanism
from ..errors import AssemblyError, ModelError, Problem
from ..forces import Line, Route
from ..forces.routes import Cylinder
from ..frames import Marker
from ..graph.core import Expr
from ..graph.evaluate import evaluate
from ..graph.rounding import vanishing
from ..graph.substitute import substitute, symbols_of
from .motion import Motion

if TYPE_CHECKING:
    from .kinematics import Kinematics
    from .loops import Constraints
    from .mobility import Array, ConstraintFunctions


IDLE = "holds nothing"  #: what is said of rows without slopes


def find_flaws(mechanism: Mechanism, motion: Motion) -> list[Problem]:
    """Force elements whose ends never part or lie in a cylinder, and discs that lie flat, at every position."""
    problems = []
    for force in mechanism.forces:
        path = getattr(force, "path", None)
        place = f"forces.{force.name}"
        if isinstance(path, Line) and _meet(motion, path.start, path.end):
            what = "both ends are always at the same point"
            problems.append(mechanism.problem(place, what, "a line needs two points that can part; move one of them"))
        if isinstance(path, Route):
            problems += _flaws_of_route(mechanism, motion, place, path)
    for constraint in mechanism.constraints:
        if isinstance(constraint, RollingDisc) and constraint.lies_flat(motion):
            what = f"{constraint.wheel.label} always lies flat: its axle (z) is along the plane's normal"
            remedy = "turn the marker of the wheel or of the plane (rpy), or take a joint that lets the disc stand"
            problems.append(mechanism.problem(f"constraints.{constraint.name}", what, remedy))
    return problems


def _meet(motion: Motion, start: Marker, end: Marker) -> bool:
    return all(x.is_zero for x in motion.relative(start, end).position)


def _flaws_of_route(mechanism: Mechanism, motion: Motion, place: str, route: Route) -> list[Problem]:
    problems = []
    stops = [route.start, *route.via, route.end]
    for k, (one, other) in enumerate(pairwise(stops)):
        if isinstance(one, Marker) and isinstance(other, Marker) and _meet(motion, one, other):
            what = f"{one.label} and {other.label}, which follow each other, are always at the same point"
            problems.append(mechanism.problem(place, what, "leave one of them out"))
        for cylinder, end in ((one, other), (other, one)):
            if isinstance(cylinder, Cylinder) and isinstance(end, Marker):
                x, y, _ = motion.relative(cylinder.marker, end).position
                number = _number(mechanism, x * x + y * y - cylinder.radius * cylinder.radius)
                if number is not None and number < 0.0:
                    index = k if cylinder is other else k - 1
                    what = f"{end.label} lies inside the cylinder around {cylinder.marker.label}"
                    remedy = "a path starts and ends outside; give a smaller radius or move the point"
                    problems.append(mechanism.problem(f"{place}.via[{index}]", what, remedy))
    return problems


def _number(mechanism: Mechanism, value: Expr) -> float | None:
    """The value, if it depends on nothing but parameters whose values are declared."""
    declared = {p.name: p.value for p in mechanism.parameters if p.value is not None}
    return float(evaluate([value], declared)[0]) if symbols_of([value]) <= declared.keys() else None


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
    bad = [k.constraints.labels[functions.rows[i]] for i in np.flatnonzero(~finite)]
    discs = {c.name for c in k.mechanism.constraints if isinstance(c, RollingDisc)}
    place = ", ".join(f"{name} = {x:.6g}" for name, x in zip(k.names, q, strict=True))
    what = f"{', '.join(bad)}: not finite at the initial configuration {place}"
    if all(label.partition(".")[0] in discs for label in bad):
        raise AssemblyError(f"{what}: {LYING}; tilt it in initial or guess", bad)
    raise AssemblyError(f"{what}; give another one in initial or guess", bad)


def refuse_rows_of_time(mechanism: Mechanism, constraints: Constraints) -> None:
    """Refuse constraints in which only time, inputs and parameters stand: no coordinate can hold them.

    Raises
    ------
    ModelError
        Names the constraints.
    """
    problems, clock = [], {"t", *(u.name for u in mechanism.inputs)}
    free = [*constraints.values, *constraints.velocity[len(constraints.values) :]]
    for label, row, left in zip(constraints.labels, constraints.jacobian, free, strict=True):
        moving = sorted(symbols_of([left]) & clock)
        if moving and all(x.is_zero for x in row):
            what = f"{label} depends on {', '.join(moving)} and on no coordinate, so nothing can hold it"
            remedy = "let a coordinate follow it, or take it away"
            problems.append(mechanism.problem(_place(mechanism, label), what, remedy))
    if problems:
        raise ModelError(problems)


def refuse_idle_rows(kinematics: Kinematics, numbers: Mapping[str, float]) -> None:
    """Refuse constraints of which no slope is found at any position, where they are all there is.

    Such are a relation whose factors cancel, one that nothing proves to be an identity, and one that is a square.  Rows
    of joints whose slopes vanish identically with the given parameters are no fault: a body may be held twice.

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
    for label, row, written in zip(c.labels, c.jacobian, c.written, strict=True):
        slopes = [x for x in row if not x.is_zero]
        if (written and slopes) or not all(vanishing(substitute(slopes, known))):
            used = sorted(symbols_of(slopes) & set(kinematics.parameter_names))
            what = f"{label} {IDLE} at all positions that were tried: its slopes are 0"
            remedy = "take it away"
            if used:
                what = f"{label} {IDLE} with the declared {', '.join(used)}: its factors are 0 or cancel"
                remedy = "declare values with which it acts, as freedoms are judged at these, or take it away"
            problems.append(kinematics.mechanism.problem(_place(kinematics.mechanism, label), what, remedy))
    if problems:
        raise ModelError(problems)


def _place(mechanism: Mechanism, label: str) -> str:
    """The path of the element that a constraint row belongs to."""
    if mechanism.lagrangian or mechanism.given:
        return "lagrangian.constraints" if mechanism.lagrangian else "equations.constraints"
    name = label.partition(".")[0]
    return f"joints.{name}" if any(spec.name == name for spec in mechanism.joints) else f"constraints.{name}"
