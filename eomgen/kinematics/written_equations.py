"""Stage kinematics: equations that users wrote, in the tree's own symbols -> what cannot stand in them, by name.

What an equation names itself is judged where it is read; laws of force elements bring in more, and states are known
there, but not how they change.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..base.notation import rate_of
from ..constraints import Equation
from ..constraints.couplings import ALLOWED
from ..describe.mechanism import Mechanism
from ..errors import ModelError, Problem
from ..graph.differentiate import gradient
from ..graph.substitute import symbols_of
from .loops import Row
from .motion import MarkerMotion

_HELD = "a constraint that closes or opens can contain states that only events and samples change"


class _Written(NamedTuple):
    """An equation, the symbols in it as it is written and in terms of the tree, and the elements it speaks of."""

    equation: Equation
    row: Row
    named: set[str]
    used: set[str]
    elements: list[str]


def refuse_unusable(mechanism: Mechanism, motion: MarkerMotion, rows: Sequence[Row]) -> None:
    """Refuse equations that hold what has no rate here, or that are not linear in velocities.

    Raises
    ------
    ModelError
    """
    by_name = {row.label.partition(".")[0]: row for row in rows}
    asked = mechanism.element_quantities.keys() | mechanism.wrench_quantities.keys()
    problems: list[Problem] = []
    for equation in mechanism.constraints:
        if isinstance(equation, Equation):
            row, named = by_name[equation.name], symbols_of([equation.expression])
            own = _Written(equation, row, named, symbols_of([row.expression]), sorted(named & asked))
            if found := _of_states(mechanism, own) or (own.elements and _of_laws(mechanism, motion, own)):
                problems.append(mechanism.problem(f"constraints.{equation.name}.equation", *found))
    if problems:
        raise ModelError(problems)


def _of_states(mechanism: Mechanism, own: _Written) -> tuple[str, str, str] | None:
    """Message, remedy and code for a state whose rate would have to stand in the rate of the equation.

    One that is held between events has none; it may stand in what closes for a time, where an error that jumps with it
    dies away.
    """
    for_a_time = any(own.equation is switch.constraint for switch in mechanism.switched)
    for state in mechanism.states:
        if state.name in own.used and not (for_a_time and state.rate.is_zero):
            law = "" if state.name in own.named or not own.elements else f" in the law of {', '.join(own.elements)}"
            why = "not states" if state.rate.is_zero else "not states that change continuously"
            remedy = f"{ALLOWED}, {why}; {_HELD}"
            return f"the state {state.name!r}{law} cannot be used here", remedy, "EG-REFERENCE"
    return None


def _of_laws(mechanism: Mechanism, motion: MarkerMotion, own: _Written) -> tuple[str, str, str] | None:
    """The same for what laws of force elements bring in."""
    state, whose = motion.state, f"in the law of {', '.join(own.elements)}"
    inputs = {u.name for u in mechanism.inputs}
    moving = sorted(name for name in own.used & inputs - own.named if rate_of(name) not in inputs)
    if moving:
        remedy = "write the law out in the equation, so that its rates become inputs too"
        return f"the rate of the input {moving[0]!r} {whose} is needed here and not known", remedy, "EG-REFERENCE"
    known = inputs | {p.name for p in mechanism.parameters} | {s.name for s in mechanism.states}
    known |= {str(x.node[1]) for x in (*state.q, *state.v, state.t)}
    late = sorted(own.used - known)
    if late:
        remedy = f"{ALLOWED}, not accelerations and reactions"
        return f"{late[0]!r} {whose} cannot be used here", remedy, "EG-REFERENCE"
    velocities = [v for v in state.v if v.node[1] in own.used]
    if not symbols_of(gradient(own.row.expression, velocities)).isdisjoint({str(v.node[1]) for v in velocities}):
        message = f"the equation is not linear in the velocities {whose}"
        return message, "a nonholonomic constraint must be linear in the velocities", "EG-EXPRESSION"
    return None
