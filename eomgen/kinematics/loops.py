"""Stage kinematics: cut joints -> constraint equations C(q, t) = 0 and the coordinates of the cut joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..base.limits.numbers import ROUNDED
from ..describe.mechanism import JointSpec, Mechanism
from ..graph import vectors as vec
from ..graph.core import Expr, Graph
from ..graph.differentiate import jacobian, jvp
from ..graph.evaluate import evaluate
from ..graph.rounding_bounds import vanishing
from ..graph.substitute import substitute, symbols_of
from ..graph.vectors import Vec3
from ..records import dataclass
from .state import MotionSymbols
from .tree import Poses


@dataclass(frozen=True)
class Constraints:
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


@dataclass(frozen=True)
class Row:
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
    graph = poses.graph
    outer, inner = poses.pair(spec.predecessor, spec.successor)
    rotation = vec.product(vec.transpose(outer.rotation), inner.rotation)
    gap = vec.sub(inner.position, outer.position)
    position = vec.transpose_times(outer.rotation, gap)
    angles = [k for k, coordinate in enumerate(spec.joint.coordinates) if coordinate.kind == "angle"]
    turns = poses.turns(rotation, q) if len(angles) == 1 else None
    if turns is not None:
        rows = spec.joint.closure_in_turns(graph, rotation, position, turns[0])
    else:
        rows = spec.joint.closure(graph, rotation, position)
    if {r.label for r in rows} >= {"r_x", "r_y", "r_z"}:  # all three vanish: any axes do, common ones are simplest
        if turns is not None:
            gap = _in_plane(gap, (outer.rotation[0][2], outer.rotation[1][2], outer.rotation[2][2]))
        free = dict(zip(("r_x", "r_y", "r_z"), gap, strict=True))
        rows = [r._replace(expression=free.get(r.label, r.expression)) for r in rows]
    measured = spec.joint.measure(graph, rotation, position)
    if turns is not None:
        measured[angles[0]] = turns[0]
    labelled = [Row(f"{spec.name}.{r.label}", r.expression, r.kind) for r in rows]
    wrapping = [] if turns is not None or spec.joint.counts_turns else [spec.coordinates[k] for k in angles]
    return ClosedLoop(labelled, measured, spec.joint.aligned(rotation), wrapping)


def _in_plane(gap: Vec3, axis: Vec3) -> Vec3:
    """A gap in axes of which the third is across the plane of its loop, so that nothing is left along it.

    Axes in which a component vanishes already are kept, and so is a gap that is in no plane.
    """
    graph = gap[0].graph
    if any(vanishing(gap)):
        return gap
    names = sorted(symbols_of(axis))
    values = dict(zip(names, np.random.default_rng(5).uniform(0.2, 1.4, len(names)).tolist(), strict=True))
    across = np.array(evaluate(list(axis), values), dtype=float)
    first = np.cross(across, np.eye(3)[int(np.argmin(np.abs(across)))])
    first /= np.linalg.norm(first)
    rows = [[graph.constant(x) for x in row.tolist()] for row in (first, np.cross(across, first), across)]
    turned = [vec.dot((x, y, z), gap) for x, y, z in rows]
    return (turned[0], turned[1], turned[2]) if vanishing(turned[2:])[0] else gap


def differentiate_constraints(
    graph: Graph, rows: Sequence[Row], aligned: Sequence[tuple[str, Expr]], state: MotionSymbols, length: Expr
) -> Constraints:
    """Form C_q, C_t, C' and gamma of the rows that do not vanish identically; ``length`` is that of the mechanism."""
    sizes = {"length": length.value or 0.0, "angle": 1.0}
    identical = {
        r: zero or _is_closed(r, sizes[r.kind])
        for r, zero in zip(rows, vanishing([r.expression for r in rows]), strict=True)
    }
    kept = [r for r in rows if not identical[r]]
    kept.sort(key=lambda r: r.level != "position")
    values = [r.expression for r in kept if r.level == "position"]
    nonholonomic = [r.expression for r in kept if r.level != "position"]
    open_conditions = [(joint, e) for joint, e in aligned if e.value is None or e.value <= 0]
    along = {**dict(zip(state.q, state.rates, strict=True)), **state.clock}
    velocity = jvp(values, along)
    if not state.in_order:  # q' may keep a constraint by itself, as that of Euler parameters keeps their norm
        kept_by_rates = zip(velocity, kept, vanishing(velocity), strict=False)
        velocity = [graph.zero if row.written and zero else x for x, row, zero in kept_by_rates]
    entries = state.slopes(values, velocity)
    m = len(values)
    entries |= {(m + i, j): e for (i, j), e in jacobian(nonholonomic, list(state.v)).items()}
    slopes = {} if state.in_order else jacobian(values, list(state.q))
    at_rest = dict.fromkeys(state.v, graph.zero)
    zero = graph.zero
    still = [(x, rate) for x, rate in zip(state.q, substitute(state.rates, at_rest), strict=True) if not rate.is_zero]
    return Constraints(
        labels=tuple(r.label for r in kept),
        kinds=tuple(r.kind for r in kept),
        written=tuple(r.written for r in kept),
        values=tuple(values),
        jacobian=tuple(tuple(entries.get((i, j), zero) for j in range(len(state.v))) for i in range(len(kept))),
        time_derivative=(*jvp(values, {**state.clock, **dict(still)}), *substitute(nonholonomic, at_rest)),
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


def own_rows(mechanism: Mechanism) -> list[Row]:
    """The constraint equations that accompany a bare Lagrangian or given equations."""
    bare = mechanism.lagrangian or mechanism.given
    if bare is None:
        return []
    rates = {n + "_dot" for n in bare.coordinates} | set(getattr(bare, "velocities", ()))
    return [
        Row(f"constraint_{k + 1}", e, "angle", "position" if symbols_of([e]).isdisjoint(rates) else "velocity", True)
        for k, e in enumerate(bare.constraints)
    ]
