"""Stage kinematics: what no motion can mend: springs of no length, discs that always lie flat, undefined rows."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

from ..constraints import RollingDisc
from ..describe.mechanism import Mechanism
from ..errors import ModelError, Problem
from ..forces import Line, Route
from ..frames import Marker, WrapCylinder
from ..graph.core import Expr
from ..graph.evaluate import evaluate
from ..graph.substitute import symbols_of
from .motion import MarkerMotion

if TYPE_CHECKING:
    from .loops import Constraints


def find_undefined(mechanism: Mechanism, motion: MarkerMotion) -> list[Problem]:
    """Force elements whose ends never part or lie in a cylinder, and discs that lie flat, at every position."""
    problems = []
    for force in mechanism.forces:
        path = getattr(force, "path", None)
        place = f"forces.{force.name}"
        if isinstance(path, Line) and _meet(motion, path.start, path.end):
            what = "both ends are always at the same point"
            problems.append(
                mechanism.problem(place, what, "a line needs two different points; move one of them", "EG-UNDEFINED")
            )
        if isinstance(path, Route):
            problems += _undefined_on_route(mechanism, motion, place, path)
    for constraint in mechanism.constraints:
        if isinstance(constraint, RollingDisc) and constraint.lies_flat(motion):
            what = f"{constraint.wheel.label} always lies flat: its axle (z) is along the plane's normal"
            remedy = (
                "turn the marker of the wheel or of the plane (rpy), or use a joint that lets the disc stand upright"
            )
            problems.append(mechanism.problem(f"constraints.{constraint.name}", what, remedy, "EG-UNDEFINED"))
    return problems


def _meet(motion: MarkerMotion, start: Marker, end: Marker) -> bool:
    return all(x.is_zero for x in motion.relative(start, end).position)


def _undefined_on_route(mechanism: Mechanism, motion: MarkerMotion, place: str, route: Route) -> list[Problem]:
    problems = []
    stops = [route.start, *route.via, route.end]
    for k, (one, other) in enumerate(pairwise(stops)):
        if isinstance(one, Marker) and isinstance(other, Marker) and _meet(motion, one, other):
            what = f"the neighbouring points {one.label} and {other.label} of the path always coincide"
            problems.append(mechanism.problem(place, what, "leave one of them out", "EG-UNDEFINED"))
        for cylinder, end in ((one, other), (other, one)):
            if isinstance(cylinder, WrapCylinder) and isinstance(end, Marker):
                x, y, _ = motion.relative(cylinder.marker, end).position
                number = _number(mechanism, x * x + y * y - cylinder.radius * cylinder.radius)
                if number is not None and number < 0.0:
                    index = k if cylinder is other else k - 1
                    what = f"{end.label} lies inside the cylinder around {cylinder.marker.label}"
                    remedy = "a path must start and end outside; give a smaller radius, or move the point"
                    problems.append(mechanism.problem(f"{place}.via[{index}]", what, remedy, "EG-UNDEFINED"))
    return problems


def _number(mechanism: Mechanism, value: Expr) -> float | None:
    """The value, if it depends on nothing but parameters whose values are declared."""
    declared = {p.name: p.value for p in mechanism.parameters if p.value is not None}
    return float(evaluate([value], declared)[0]) if symbols_of([value]) <= declared.keys() else None


def refuse_rows_of_time(mechanism: Mechanism, constraints: Constraints, for_a_time: bool = False) -> None:
    """Refuse constraints in which no coordinate stands: none can hold them.

    A wrong number in place of a coordinate is told by assembly, with its size; where nothing is assembled it is told
    here: in equations of velocities, and in all that hold ``for_a_time``, also where parameters stand in them.

    Raises
    ------
    ModelError
        Names the constraints.
    """
    problems, clock = [], {"t", *(u.name for u in mechanism.inputs)}
    m = len(constraints.values)
    free = [*constraints.values, *constraints.velocity[m:]]
    for k, (label, row, left) in enumerate(zip(constraints.labels, constraints.jacobian, free, strict=True)):
        if not all(x.is_zero for x in row):
            continue
        used = symbols_of([left])
        moving = sorted(used if for_a_time else used & clock)
        if moving:
            what = f"{label} depends on {', '.join(moving)} but on no coordinate, so no motion can satisfy it"
        elif left.value and (for_a_time or k >= m):
            rate = " moves it" if k >= m else " changes it"
            what = f"{label} is always {left.value:.6g}, as no coordinate{rate}, so no motion can satisfy it"
        else:
            continue
        remedy = "write a coordinate into it, or remove it"
        problems.append(mechanism.problem(place_of(mechanism, label), what, remedy, "EG-CONTRADICTION"))
    if problems:
        raise ModelError(problems)


def place_of(mechanism: Mechanism, label: str) -> str:
    """The path of the element that a constraint row belongs to."""
    if mechanism.lagrangian or mechanism.given:
        return "lagrangian.constraints" if mechanism.lagrangian else "equations.constraints"
    name = label.partition(".")[0]
    return f"joints.{name}" if any(spec.name == name for spec in mechanism.joints) else f"constraints.{name}"
