"""Constraints that close and open: Switched -> their equations, and loads of multipliers for them.

While closed, w = C'' + 2 b C' + b^2 C = 0 of an equation of positions, C' + b C of one of velocities, whose error dies
away at the rate b (J. Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972), 1-16).  The multiplier l acts as -C_q^T l.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from ..elements.forces.force import CoordinateLoad, Force, Load, MarkerLoad, View, where
from ..expr import vectors as vec
from ..expr.core import Expr, reachable
from ..expr.differentiate import jacobian
from ..expr.identity import vanishes
from ..model.mechanism import Switched
from .kinematics import ForceTerms, Kinematics
from .loops import couple, differentiate_constraints, refuse_rows_of_time, refuse_unusable
from .wrenches import JointWrenches, Row6

#: Operations whose results are numbers whatever numbers they are given.
FINITE = {"sym", "const", "add", "sub", "mul", "neg", "sin", "cos", "abs", "min", "max", "lt", "le", "eq", "select"}


class SwitchedRow(NamedTuple):
    """One equation of a constraint that closes and opens."""

    label: str
    state: str  #: 1 while it holds
    on: Expr  #: whether it does
    jacobian: tuple[Expr, ...]  #: of C' by v
    rate: Expr  #: C'
    rest: Expr  #: w without the accelerations
    multiplier: Expr
    errors: tuple[Expr, Expr]  #: C, 0 for an equation of velocities, and C'; both 0 while it is open
    kind: str  #: 'length' or 'angle'


class ClosingForce(Force):
    """What a constraint exerts while it is closed."""

    def loads(self, view: View) -> list[Load]:
        return []


def switched_rows(kinematics: Kinematics) -> tuple[list[SwitchedRow], list[ForceTerms]]:
    """The equations of all constraints that close and open, and the loads of their multipliers."""
    rows, loads = list[SwitchedRow](), list[ForceTerms]()
    for switch in kinematics.mechanism.switched:
        of_switch, terms = _of_one(kinematics, switch)
        rows += of_switch
        loads.append(terms)
    return rows, loads


def _of_one(kinematics: Kinematics, switch: Switched) -> tuple[list[SwitchedRow], ForceTerms]:
    graph, motion = kinematics.graph, kinematics.motion
    assert switch.constraint is not None
    mechanism = replace(kinematics.mechanism, constraints=(switch.constraint,))
    coupled = couple(mechanism, motion).rows
    refuse_unusable(mechanism, motion, coupled)
    result = differentiate_constraints(graph, coupled, [], motion.state, kinematics.length_scale)
    refuse_rows_of_time(mechanism, result, for_a_time=True)
    apart = replace(kinematics, mechanism=mechanism, constraints=result, coupled=result.labels)
    on_bodies = JointWrenches(apart).element_rows()
    rate = kinematics.resolve([switch.stabilisation])[0]
    rows, along = [], dict[str, Expr]()
    markers: list[MarkerLoad] = []
    for i, label in enumerate(result.labels):
        multiplier = graph.symbol(f"held[{label}]")
        J, speed = result.jacobian[i], result.velocity[i]
        if i < len(result.values):
            rest = result.gamma[i] + 2.0 * rate * speed + rate * rate * result.values[i]
        else:
            rest = result.gamma[i] + rate * speed
        *entries, C_rate, w = (_while_closed(switch, x) for x in (*J, speed, rest))
        value = result.values[i] if i < len(result.values) else graph.zero
        errors = (where(switch.holds, value, 0.0), where(switch.holds, speed, 0.0))
        closed = label, switch.state, switch.holds, tuple(entries), C_rate, w
        rows.append(SwitchedRow(*closed, multiplier, errors, result.kinds[i]))
        for body, D in on_bodies[label].items():
            markers.append(_load(kinematics, body, tuple(_while_closed(switch, d) for d in D), multiplier))
        for name, part in zip(kinematics.velocity_labels, _left(kinematics, J, on_bodies[label]), strict=True):
            if not part.is_zero:
                along[name] = along.get(name, graph.zero) - _while_closed(switch, part) * multiplier
    loads = [CoordinateLoad(name, value) for name, value in along.items()]
    force = ClosingForce(switch.constraint.name)
    return rows, ForceTerms(force, tuple(markers), tuple(loads), None, tuple(markers), tuple(loads))


def _while_closed(switch: Switched, x: Expr) -> Expr:
    """x, or 0 while the constraint is open and x may be no number: a disc that lies flat, far from its plane."""
    if {x.graph.nodes[i][0] for i in reachable(x.graph, [x.id])} <= FINITE:
        return x
    return where(switch.holds, x, 0.0)


def _load(kinematics: Kinematics, body: int, D: Row6, multiplier: Expr) -> MarkerLoad:
    """The wrench -l D on a body, about its origin."""
    x = [-(d * multiplier) for d in D]
    return MarkerLoad(kinematics.motion.body(body), vec.three(x, 0), vec.three(x, 3))


def _left(kinematics: Kinematics, J: Sequence[Expr], on_bodies: dict[int, Row6]) -> list[Expr]:
    """What of a row acts along coordinates of the tree, beyond the wrenches on bodies."""
    if not on_bodies:
        return list(J)
    graph, total = kinematics.graph, list(J)
    for body, D in on_bodies.items():
        marker = kinematics.motion.body(body)
        v, w = kinematics.motion.velocity(marker), kinematics.motion.angular_velocity(marker)
        slopes = jacobian([*v, *w], list(kinematics.v))
        for j in range(len(total)):
            column = [slopes.get((k, j), graph.zero) for k in range(6)]
            work = vec.dot(vec.three(D, 0), vec.three(column, 0)) + vec.dot(vec.three(D, 3), vec.three(column, 3))
            total[j] = total[j] - work
    return [graph.zero if zero else x for x, zero in zip(total, vanishes(total), strict=True)]
