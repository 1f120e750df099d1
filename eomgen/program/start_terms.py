"""Stage program, start: initial values and guesses -> their numbers, and how they follow from later parameters."""

from __future__ import annotations

from math import isfinite
from typing import Any

from ..base.operations import OPERATIONS
from ..errors import TO_BE_FINITE, ModelError
from ..graph.core import Expr
from ..graph.differentiate import gradient
from ..graph.substitute import symbols_of
from ..graph.tape import record_tape
from ..graph.traverse import reachable
from ..kinematics import Kinematics
from ..kinematics.mobility import initial_values


def describe_start(kinematics: Kinematics) -> dict[str, Any]:
    """Initial values and guesses as model.json holds them.

    Their numbers are those at the declared parameters.  ``start_terms`` are the tapes of those that follow from
    parameters, by section with their names; ``start_slopes`` the derivatives of initial values that do not vanish, with
    the name and the place of the parameter of each.  ``start_fixed`` are those that call tables or functions of the
    model, which no tape can play, with the places of their parameters.
    """
    m = kinematics.mechanism
    given = {"initial": m.initial, "initial_outputs": m.initial_outputs, "guess": m.guess}
    values = {p.name: p.value for p in m.parameters}
    found: dict[str, Any] = {
        key: initial_values(kinematics, values, key)
        for key, terms in given.items()
        if terms or key != "initial_outputs"
    }
    if bad := [(key, name) for key, of in found.items() for name, x in of.items() if not isfinite(x)]:
        what = "is no number at the declared parameters"
        raise ModelError(
            [m.problem(f"{key.partition('_')[0]}.{name}", what, TO_BE_FINITE, "EG-NOT-FINITE") for key, name in bad]
        )
    places = {name: ("p", k) for k, name in enumerate(kinematics.parameter_names)}
    late = {key: {n: x for n, x in terms.items() if symbols_of([x])} for key, terms in given.items()}
    fixed = {n: x for terms in late.values() for n, x in terms.items() if not _is_of_operations(x)}
    late = {key: {n: x for n, x in terms.items() if n not in fixed} for key, terms in late.items()}
    if fixed:
        found["start_fixed"] = {n: sorted(places[name][1] for name in symbols_of([x])) for n, x in fixed.items()}
    if not any(late.values()):
        return found
    known = [kinematics.graph.symbol(name) for name in places]
    slopes = [
        (name, k, slope)
        for name, x in late["initial"].items()
        for k, slope in enumerate(gradient(x, known))
        if not slope.is_zero
    ]
    terms = {
        key: [list(of), list(record_tape(list(of.values()), places.__getitem__))] for key, of in late.items() if of
    }
    tape = record_tape([slope for *_, slope in slopes], places.__getitem__)
    return found | {"start_terms": terms, "start_slopes": [[[name, k] for name, k, _ in slopes], list(tape)]}


def _is_of_operations(x: Expr) -> bool:
    """Whether a tape can play it."""
    return {x.graph.nodes[i][0] for i in reachable(x.graph, [x.id])} <= {"sym", "const", *OPERATIONS}
