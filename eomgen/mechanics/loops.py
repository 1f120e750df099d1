"""Cut joints, constraint elements and written equations -> constraint equations C(q, t) = 0."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..base.limits.numbers import ROUNDED
from ..elements.constraints.constraint import ALLOWED, VELOCITY, Condition, Equation
from ..elements.constraints.rolling import RollingDisc
from ..elements.forces.paths import Line, Route
from ..elements.frames import Frame, Marker, WrapCylinder
from ..elements.joints import Closure
from ..errors import ModelError, Problem
from ..expr import vectors as vec
from ..expr.core import Expr, Graph, substitute, symbols_of
from ..expr.differentiate import gradient, jacobian, jvp
from ..expr.evaluate import evaluate
from ..expr.identity import random_point, vanishes
from ..expr.notation import rate_of
from ..expr.records import Record
from ..expr.vectors import Vec3
from ..model.mechanism import JointSpec, Mechanism
from ..model.quantities import REACTIONS
from .motion import MarkerMotion
from .topology import MotionSymbols
from .tree import Poses, Turns

# -- cut joints --------------------------------------------------------------------------------------------------------


class Constraints(Record):
    """C(q, t) = 0 and its derivatives (Shabana, ch. 3): C' = C_q v + C_t, C'' = C_q a + gamma (Q_d = -gamma).

    C_q stands for the derivative of C' by v, dC/dq N where q' = N v.  Nonholonomic rows A(q, t) v + b(q, t) = 0
    come after the holonomic ones and have no value C: for them C_q is A and C_t is b.  Rows that vanish identically
    are left out and listed in ``vanishing``; redundant ones stay.
    """

    labels: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()  #: 'length' or 'angle' per row
    written: tuple[bool, ...] = ()  #: whether a user wrote the row's factors, so that it may have any size
    values: tuple[Expr, ...] = ()  #: of the holonomic rows
    jacobian: tuple[tuple[Expr, ...], ...] = ()  #: dense rows, mostly the zero node
    time_derivative: tuple[Expr, ...] = ()  #: C_t
    velocity: tuple[Expr, ...] = ()  #: C_q v + C_t
    gamma: tuple[Expr, ...] = ()
    slopes: tuple[tuple[Expr, ...], ...] = ()  #: dC/dq of the holonomic rows, where given equations have q' = N v + b
    aligned: tuple[Expr, ...] = ()  #: must be positive, else an axis of the joint in ``aligned_joints`` is flipped
    aligned_joints: tuple[str, ...] = ()
    vanishing: tuple[str, ...] = ()
    declared: int = 0  #: rows before the vanishing ones were left out
    stabilised: tuple[float, float] | None = None  #: alpha and beta, where gamma holds 2 alpha C' + beta^2 C

    @property
    def nonholonomic(self) -> int:
        """Number of rows at velocity level."""
        return len(self.labels) - len(self.values)


class Row(Record):
    """One equation ``expression = 0`` before its derivatives are formed.

    ``level`` is 'position' for C(q, t), 'velocity' for a nonholonomic A(q, t) v + b(q, t), linear in v.
    ``written``: its factors are a user's, and may have any size.
    """

    label: str
    expression: Expr
    kind: str
    level: str = "position"
    written: bool = False


class ClosedLoop(NamedTuple):
    """A cut joint: its equations, coordinates, alignment conditions, and the coordinates that wrap at half a turn."""

    rows: list[Row]
    measured: list[Expr]
    aligned: list[Expr]
    wrapping: list[str]


def close_loop(spec: JointSpec, poses: Poses, q: Sequence[Expr]) -> ClosedLoop:
    """What cutting a joint gives.

    The angle of a joint that turns about one axis is a sum of the tree's angles if the loop lies in a plane; elsewhere
    it is measured between -pi and pi.
    """
    outer, inner = poses.pair(spec.predecessor, spec.successor)
    pose = poses.relative(spec.predecessor, spec.successor)
    gap = vec.sub(inner.position, outer.position)
    turns = turns_about_z(spec, poses, q)
    rows, measured = closing_equations(spec, pose, None if turns is None else turns[0])
    if {r.label for r in rows} >= {"r_x", "r_y", "r_z"}:  # all three vanish: any axes do, common ones are simplest
        if turns is not None:
            gap = _in_plane(gap, (outer.rotation[0][2], outer.rotation[1][2], outer.rotation[2][2]))
        free = dict(zip(("r_x", "r_y", "r_z"), gap, strict=True))
        rows = [r._replace(expression=free.get(r.label, r.expression)) for r in rows]
    labelled = [Row(f"{spec.name}.{r.label}", r.expression, r.kind) for r in rows]
    wraps = turns is None and not spec.joint.counts_turns
    wrapping = [spec.coordinates[k] for k in _angles(spec)] if wraps else []
    return ClosedLoop(labelled, measured, spec.joint.aligned(pose.rotation), wrapping)


def _angles(spec: JointSpec) -> list[int]:
    """Which coordinates of a joint are angles."""
    return [k for k, coordinate in enumerate(spec.joint.coordinates) if coordinate.kind == "angle"]


def turns_about_z(spec: JointSpec, poses: Poses, q: Sequence[Expr]) -> Turns | None:
    """The one angle of a cut joint as a sum of the tree's angles, where the loop lies in a plane."""
    if len(_angles(spec)) != 1:
        return None
    return poses.turns(poses.relative(spec.predecessor, spec.successor).rotation, q)


def closing_equations(spec: JointSpec, pose: Frame, turn: Expr | None) -> tuple[list[Closure], list[Expr]]:
    """Equations and coordinates of a cut joint as functions of the pose of S in P, and of its turn in a plane loop."""
    graph, rotation, position = pose.position[0].graph, pose.rotation, pose.position
    if turn is None:
        return spec.joint.closure(graph, rotation, position), spec.joint.measure(graph, rotation, position)
    rows = spec.joint.closure_in_turns(graph, rotation, position, turn)
    measured = spec.joint.measure(graph, rotation, position)
    measured[_angles(spec)[0]] = turn
    return rows, measured


def _in_plane(gap: Vec3, axis: Vec3) -> Vec3:
    """A gap in axes of which the third is across the plane of its loop, so that nothing is left along it.

    Axes in which a component vanishes already are kept, and so is a gap that is in no plane.
    """
    graph = gap[0].graph
    if any(vanishes(gap)):
        return gap
    axle = np.array(evaluate(axis, random_point(axis, np.random.default_rng(5))), dtype=float)
    first = np.cross(axle, np.eye(3)[int(np.argmin(np.abs(axle)))])
    first /= np.linalg.norm(first)
    rows = [[graph.constant(x) for x in row.tolist()] for row in (first, np.cross(axle, first), axle)]
    turned = [vec.dot((x, y, z), gap) for x, y, z in rows]
    return (turned[0], turned[1], turned[2]) if vanishes(turned[2:])[0] else gap


def differentiate_constraints(
    graph: Graph, rows: Sequence[Row], aligned: Sequence[tuple[str, Expr]], state: MotionSymbols, length: Expr
) -> Constraints:
    """Form C_q, C_t, C' and gamma of the rows that do not vanish identically; ``length`` is that of the mechanism."""
    sizes = {"length": length.value or 0.0, "angle": 1.0}
    identical = {
        r: zero or _is_closed(r, sizes[r.kind])
        for r, zero in zip(rows, vanishes([r.expression for r in rows]), strict=True)
    }
    kept = [r for r in rows if not identical[r]]
    kept.sort(key=lambda r: r.level != "position")
    values = [r.expression for r in kept if r.level == "position"]
    nonholonomic = [r.expression for r in kept if r.level != "position"]
    open_conditions = [(joint, e) for joint, e in aligned if e.value is None or e.value <= 0]
    along = state.q_dot_direction | state.time_direction
    velocity = jvp(values, along)
    if state.general_rates:  # q' may keep a constraint by itself, as that of Euler parameters keeps their norm
        kept_by_rates = zip(velocity, kept, vanishes(velocity), strict=False)
        velocity = [graph.zero if row.written and zero else x for x, row, zero in kept_by_rates]
    entries = state.slopes(values, velocity)
    m = len(values)
    entries |= {(m + i, j): e for (i, j), e in jacobian(nonholonomic, list(state.v)).items()}
    slopes = jacobian(values, list(state.q)) if state.general_rates else {}
    at_rest = dict.fromkeys(state.v, graph.zero)
    zero = graph.zero
    still = [(x, rate) for x, rate in zip(state.q, substitute(state.rates, at_rest), strict=True) if not rate.is_zero]
    return Constraints(
        labels=tuple(r.label for r in kept),
        kinds=tuple(r.kind for r in kept),
        written=tuple(r.written for r in kept),
        values=tuple(values),
        jacobian=tuple(tuple(entries.get((i, j), zero) for j in range(len(state.v))) for i in range(len(kept))),
        time_derivative=(*jvp(values, {**state.time_direction, **dict(still)}), *substitute(nonholonomic, at_rest)),
        velocity=(*velocity, *nonholonomic),
        gamma=tuple(jvp([*velocity, *nonholonomic], along | at_rest)),
        slopes=tuple(tuple(slopes.get((i, j), zero) for j in range(len(state.q))) for i in range(m)) if slopes else (),
        aligned=tuple(e for _, e in open_conditions),
        aligned_joints=tuple(joint for joint, _ in open_conditions),
        vanishing=tuple(r.label for r in rows if identical[r]),
        declared=len(rows),
    )


def _is_closed(row: Row, size: float) -> bool:
    """Whether a row is a number that is nothing but rounding of the places in it."""
    value = row.expression.value
    return value is not None and not row.written and abs(value) <= ROUNDED * size


def equation_rows(mechanism: Mechanism) -> list[Row]:
    """The constraint equations that accompany a bare Lagrangian or given equations."""
    bare = mechanism.given
    if bare is None:
        return []
    rates = {n + "_dot" for n in bare.coordinates} | set(bare.velocities)
    return [
        Row(f"constraint_{k + 1}", e, "angle", "position" if symbols_of([e]).isdisjoint(rates) else "velocity", True)
        for k, e in enumerate(bare.constraints)
    ]


# -- constraint elements -----------------------------------------------------------------------------------------------


class Coupled(NamedTuple):
    """What all constraint elements say, in terms of the tree.

    Equations; expressions that must be positive, each with the element's name; and (coordinate, value) pairs from
    which assembly starts where nothing is said about the coordinate.
    """

    rows: list[Row]
    aligned: list[tuple[str, Expr]]
    hints: list[tuple[str, Expr]]


def couple(mechanism: Mechanism, motion: MarkerMotion) -> Coupled:
    """Ask every constraint element for its equations; coordinates of cut joints become functions of the tree's."""
    rows: list[Row] = []
    aligned: list[tuple[str, Expr]] = []
    hints: list[tuple[str, Expr]] = []
    for constraint in mechanism.constraints:
        conditions = constraint.conditions(motion)
        positive = constraint.aligned(motion)
        near = constraint.hints(motion)
        flat = [*(c.expression for c in conditions), *positive, *(value for _, value in near)]
        mapping = motion.derived_symbols(mechanism, symbols_of(flat))
        values = iter(substitute(flat, mapping) if mapping else flat)
        for c in conditions:
            value = next(values)
            level = _level(c, value, motion) if isinstance(constraint, Equation) else c.level
            rows.append(Row(f"{constraint.name}.{c.label}", value, c.kind, level, constraint.written))
        aligned += [(constraint.name, next(values)) for _ in positive]
        hints += [(str(symbol.node[1]), next(values)) for symbol, _ in near]
    return Coupled(rows, aligned, hints)


def _level(condition: Condition, value: Expr, motion: MarkerMotion) -> str:
    """The level of an equation: forces of elements tell only in terms of the tree whether they move with velocities."""
    used = symbols_of([value])
    return VELOCITY if any(v.node[1] in used for v in motion.state.v) else condition.level


# -- written equations -------------------------------------------------------------------------------------------------

# What an equation names itself is judged where it is read; laws of force elements bring in more, and states are known
# there, but not how they change.


_SWITCHED_STATES = "a constraint that closes or opens can contain states that only events and samples change"


class _Written(NamedTuple):
    """An equation, the symbols in it as it is written and in terms of the tree, and the elements it speaks of."""

    equation: Equation
    row: Row
    named: set[str]
    used: set[str]
    elements: list[str]


def refuse_unusable(mechanism: Mechanism, motion: MarkerMotion, rows: Sequence[Row]) -> None:
    """Refuse equations that hold what has no rate here, or that are not linear in velocities."""
    by_name = {row.label.partition(".")[0]: row for row in rows}
    requested = {n for n, q in mechanism.quantities.items() if q.element and q.measure not in REACTIONS}
    problems: list[Problem] = []
    for equation in mechanism.constraints:
        if isinstance(equation, Equation):
            row, named = by_name[equation.name], symbols_of([equation.expression])
            one = _Written(equation, row, named, symbols_of([row.expression]), sorted(named & requested))
            if result := _of_states(mechanism, one) or (one.elements and _of_laws(mechanism, motion, one)):
                problems.append(mechanism.problem(f"constraints.{equation.name}.equation", *result))
    if problems:
        raise ModelError(problems)


def _of_states(mechanism: Mechanism, one: _Written) -> tuple[str, str, str] | None:
    """Message, remedy and code for a state whose rate would have to stand in the rate of the equation.

    One that is constant between events has none; it may stand in what closes for a time, where an error that jumps with
    it dies away.
    """
    for_a_time = any(one.equation is switch.constraint for switch in mechanism.switched)
    for state in mechanism.states:
        if state.name in one.used and not (for_a_time and state.rate.is_zero):
            law = "" if state.name in one.named or not one.elements else f" in the law of {', '.join(one.elements)}"
            why = "not states" if state.rate.is_zero else "not states that change continuously"
            remedy = f"{ALLOWED}, {why}; {_SWITCHED_STATES}"
            return f"the state {state.name!r}{law} cannot be used here", remedy, "EG-REFERENCE"
    return None


def _of_laws(mechanism: Mechanism, motion: MarkerMotion, one: _Written) -> tuple[str, str, str] | None:
    """The same for what laws of force elements bring in."""
    state, whose = motion.state, f"in the law of {', '.join(one.elements)}"
    inputs = {u.name for u in mechanism.inputs}
    moving = sorted(name for name in one.used & inputs - one.named if rate_of(name) not in inputs)
    if moving:
        remedy = "write the law out in the equation, so that its rates become inputs too"
        return f"the rate of the input {moving[0]!r} {whose} is needed here and not known", remedy, "EG-REFERENCE"
    known = inputs | {p.name for p in mechanism.parameters} | {s.name for s in mechanism.states}
    known |= {str(x.node[1]) for x in (*state.q, *state.v, state.t)}
    unknown = sorted(one.used - known)
    if unknown:
        remedy = f"{ALLOWED}, not accelerations and reactions"
        return f"{unknown[0]!r} {whose} cannot be used here", remedy, "EG-REFERENCE"
    velocities = [v for v in state.v if v.node[1] in one.used]
    if not symbols_of(gradient(one.row.expression, velocities)).isdisjoint({str(v.node[1]) for v in velocities}):
        message = f"the equation is not linear in the velocities {whose}"
        return message, "a nonholonomic constraint must be linear in the velocities", "EG-EXPRESSION"
    return None


# -- undefined rows ----------------------------------------------------------------------------------------------------


def find_undefined(mechanism: Mechanism, motion: MarkerMotion) -> list[Problem]:
    """Force elements whose ends never part or lie in a cylinder, and discs that lie flat, at every position."""
    problems = []
    for force in mechanism.forces:
        path = getattr(force, "path", None)
        place = f"forces.{force.name}"
        if isinstance(path, Line) and _meet(motion, path.start, path.end):
            remedy = "a line needs two different points; move one of them"
            problems.append(mechanism.problem(place, "both ends are always at the same point", remedy, "EG-UNDEFINED"))
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

    A wrong number in place of a coordinate is reported by assembly, with its size; where nothing is assembled, it is
    reported here: in equations of velocities, and in all that hold ``for_a_time``, also where parameters stand in them.
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
    if mechanism.bare:
        return f"{mechanism.bare_section}.constraints"
    name = label.partition(".")[0]
    return f"joints.{name}" if any(spec.name == name for spec in mechanism.joints) else f"constraints.{name}"
