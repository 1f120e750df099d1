"""Stage verification, check constraints: derivatives of constraints and potentials against differences of them."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..base.limits.analyses import FIRST_DIFFERENCE, NO_FORCE, SECOND_DIFFERENCE
from .bench import Bench, numbers
from .comparison import Comparison, pairs, size_of
from .digits import Number
from .finding import Finding
from .rounding_sizes import FOLDED, UNIT
from .truth import Truth, Values


def check(bench: Bench) -> list[Finding]:
    """C_q, C' and gamma by differences; slopes of potentials."""
    return [_jacobian(bench), _velocity(bench), _gamma(bench), _potentials(bench)]


def _jacobian(bench: Bench) -> Finding:
    check = "constraint_jacobian: differences of C"
    if not bench.terms.n_c:
        return Finding.skipped(check, "there are no constraints")
    found, layout = Comparison(check), bench.layout
    bounds = bench.bounds("constraint_jacobian", bench.graph_kernels["constraint_jacobian"])[1]
    for k, truth in enumerate(bench.truths):
        expected = numbers([x for row in truth.constraint_jacobian for x in row])
        actual = bench.call("constraint_jacobian", truth.case).ravel()
        limit = bounds[:, k] + UNIT * np.abs(expected)
        found.add(
            k, actual - expected, limit + FIRST_DIFFERENCE, size_of(expected), pairs(layout.constraint_labels, layout.v)
        )
    return found.finding()


def _velocity(bench: Bench) -> Finding:
    check = "velocity_constraints: rate of C along the motion"
    if not bench.terms.n_c:
        return Finding.skipped(check, "there are no constraints")
    found = Comparison(check)
    bounds = bench.bounds("velocity_constraints", bench.graph_kernels["velocity_constraints"])[1]
    for k, truth in enumerate(bench.truths):
        expected = numbers(truth.velocity_rows)
        actual = bench.call("velocity_constraints", truth.case)
        size = float((np.abs(bench.call("constraint_jacobian", truth.case)) @ np.abs(truth.case.v)).max(initial=0.0))
        limit = bounds[:, k] + UNIT * np.abs(expected)
        found.add(k, actual - expected, limit + FIRST_DIFFERENCE, size, bench.layout.constraint_labels)
    return found.finding()


def _gamma(bench: Bench) -> Finding:
    """gamma has no kernel of its own: the graph's is judged here, what is generated from it by the accelerations."""
    check = "gamma: second differences of C along the motion"
    if not bench.terms.n_c or not bench.layout.projects:
        return Finding.skipped(
            check, "there are no constraints" if bench.layout.projects else "derived with baumgarte="
        )
    found = Comparison(check)
    values, bounds = bench.bounds("gamma", lambda: bench.terms.gamma)
    for k, truth in enumerate(bench.truths):
        expected = numbers(truth.gamma)
        limit = bounds[:, k] + UNIT * np.abs(expected)
        found.add(
            k,
            values[:, k] - expected,
            limit + SECOND_DIFFERENCE * size_of(expected),
            size_of(expected),
            bench.layout.constraint_labels,
        )
    return found.finding()


def _potentials(bench: Bench) -> Finding:
    """What an element with a potential exerts, less its friction, is the slope of the potential."""
    check = "forces: slopes of their potentials"
    forces = [terms for terms in bench.kinematics.forces if terms.potential is not None]
    if not forces:
        return Finding.skipped(check, "no force element has a potential")
    found, layout = Comparison(check), bench.layout
    for k, truth in enumerate(bench.truths):
        slopes = _potential_slopes(bench, truth)
        every, rest = truth.applied(), truth.applied(remainder=True)
        gap = numbers([f - r + s for f, r, s in zip(every, rest, slopes, strict=True)])
        own = np.abs(numbers(slopes)) + np.abs(numbers(every)) + np.abs(numbers(rest))
        limit = (64.0 * UNIT if bench.kinematics.graph.calls else FOLDED) * (own + size_of(own)) + NO_FORCE
        if "bias" in bench.graph_kernels:  # folded constants weigh more beside half a turn, as rounding does
            limit = np.maximum(limit, FOLDED / UNIT * bench.bounds("bias", bench.graph_kernels["bias"])[1][:, k])
        found.add(k, gap, limit, size_of(own), layout.v)
    return found.finding()


def _potential_slopes(bench: Bench, truth: Truth) -> list[Number]:
    """dV/dv' of all potentials of force elements, by each velocity."""
    parts = [terms.potential for terms in bench.kinematics.forces if terms.potential is not None]

    def total(values: Values) -> list[Number]:
        return [sum(truth.system.evaluate("potentials", lambda: parts, values), truth.zero)]

    return [truth.slope(total, partial(truth.displaced, j))[0] for j in range(bench.layout.n_v)]
