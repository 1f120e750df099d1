"""Generated code against its graph, derivatives against differences."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.kernel_table import NAMED
from ..base.limits.numbers import EPS, TINY
from .checked import CheckedModel
from .digits import FOLDED, UNIT, Number, Numbers, array, bounded, numbers
from .finding import FIRST_STEP, Comparison, Finding, pairs, size_of, terms_size
from .identities import compare_jacobian, jacobian_at, mass_at
from .limits import FIRST_DIFFERENCE, NO_FORCE, OFF_CONSTRAINTS, SECOND_DIFFERENCE
from .random_states import SystemState
from .truth import Truth, Values, solve_constrained

# -- kernels -----------------------------------------------------------------------------------------------------------


COLUMNS = 9  #: states of a batch: more than a vector holds, and no multiple of it


def check_kernels(model: CheckedModel) -> list[Finding]:
    """All straight-line kernels, one finding each; batches; double arithmetic."""
    return [*(_kernel(model, name) for name in model.graph_kernels), *_derived(model), _batches(model), _digits(model)]


def _kernel(model: CheckedModel, name: str) -> Finding:
    """Two evaluations of one expression in different orders differ by two bounds at most."""
    result, labels = Comparison(f"{name}: generated code and graph"), model.labels(name)
    values, bounds = model.bounds(name, model.graph_kernels[name])
    for k, case in enumerate(model.states):
        actual = model.call(name, case).ravel()
        result.add(k, actual - values[:, k], 2.0 * bounds[:, k], terms_size(values[:, k], bounds[:, k]), labels)
    return result.finding()


def _derived(model: CheckedModel) -> list[Finding]:
    """Kernels that are other kernels in disguise: the outputs, and the matrix of the independent coordinates."""
    module, result = model.module, []
    if module.n_y and "motion_outputs" in model.graph_kernels:
        outputs = Comparison("outputs: at the accelerations of the motion")
        for k, case in enumerate(model.states):
            a = model.rhs(case)[module.n_q :]
            expected = module.kernels.motion_outputs(case.q, case.v, a, **case.timed)
            actual = module.outputs(case.t, case.x, **case.values)
            bound = model.bounds("motion_outputs", lambda: model.terms.outputs)[1][:, k]
            slope = module.kernels.output_derivatives(case.q, case.v, a, **case.timed)
            C = jacobian_at(module, case)
            shift, n = model.shift(k, C), module.n_x
            limit = (
                2.0 * bound
                + np.abs(slope[:, :n]) @ shift
                + np.abs(slope[:, n : n + module.layout.n_v]) @ model.moved(k, C)
            )
            outputs.add(k, actual - expected, limit, size_of(expected), model.layout.y)
        result.append(outputs.finding())
    return result


def _batches(model: CheckedModel) -> Finding:
    """A batch gives what single calls give; the vector library's functions may differ by units in the last place."""
    module, result = model.module, Comparison("batches: same as single calls")
    case = model.states[0]
    rng = np.random.default_rng(COLUMNS)
    q = case.q[:, None] + 0.1 * rng.standard_normal((module.n_q, COLUMNS))
    x = np.concatenate([q, case.v[:, None] + rng.standard_normal((module.layout.n_v, COLUMNS))])
    terms = model.terms
    symbols = {name: np.full(COLUMNS, float(v[0])) for name, v in model.symbols.items()}
    symbols |= dict(zip((*terms.q, *terms.v), x, strict=True))
    for name in ("mass_matrix", "bias", "energy", "poses", "constraints", "constraint_jacobian"):
        if name not in model.graph_kernels:
            continue
        outputs = list(model.graph_kernels[name]())
        bounds = bounded(outputs, symbols, COLUMNS)[1]
        kernel = module.kernels.kernel(name, kind="state")
        states = q if NAMED[name].inputs == ("q",) else x
        batch = np.asarray(kernel(states, **case.timed)).reshape(-1, COLUMNS)
        for k in range(COLUMNS):
            single = np.asarray(kernel(np.ascontiguousarray(states[:, k]), **case.timed)).ravel()
            labels = [f"{name} {label}" for label in model.labels(name)]
            result.add(0, batch[:, k] - single, 2.0 * bounds[:, k], terms_size(single, bounds[:, k]), labels)
    result.states_compared = 1
    return result.finding()


def _digits(model: CheckedModel) -> Finding:
    """The graph in double arithmetic against the graph in 50 digits: that the bounds of rounding are bounds."""
    result = Comparison("graph: double arithmetic and 50 digits")
    every = {**model.graph_kernels, "gamma": lambda: model.terms.gamma}
    for name, outputs in every.items():
        values, bounds = model.bounds(name, outputs)
        labels = [f"{name} {label}" for label in model.labels(name)] or [name] * len(values)
        for k, truth in enumerate(model.truths):
            exact = model.system.evaluate(f"kernel {name}", outputs, truth.values)
            apart = numbers(model.system.exact(values[:, k]) - exact)
            result.add(
                k, apart, bounds[:, k] + UNIT * np.abs(numbers(exact)), terms_size(values[:, k], bounds[:, k]), labels
            )
    result.states_compared = len(model.truths)
    return result.finding()


# -- constraints -------------------------------------------------------------------------------------------------------


def check_constraints(model: CheckedModel) -> list[Finding]:
    """C_q, C' and gamma by differences; slopes of potentials."""
    return [_jacobian(model), _velocity(model), _gamma(model), _potentials(model)]


def _jacobian(model: CheckedModel) -> Finding:
    check = "constraint_jacobian: differences of C"
    if not model.terms.n_c:
        return Finding.skipped(check, "there are no constraints")
    result, layout = Comparison(check), model.layout
    bounds = model.bounds("constraint_jacobian", model.graph_kernels["constraint_jacobian"])[1]
    for k, truth in enumerate(model.truths):
        expected = numbers(truth.constraint_jacobian).ravel()
        actual = model.call("constraint_jacobian", truth.case).ravel()
        limit = bounds[:, k] + UNIT * np.abs(expected)
        result.add(
            k, actual - expected, limit + FIRST_DIFFERENCE, size_of(expected), pairs(layout.constraint_labels, layout.v)
        )
    return result.finding()


def _velocity(model: CheckedModel) -> Finding:
    check = "velocity_constraints: rate of C along the motion"
    if not model.terms.n_c:
        return Finding.skipped(check, "there are no constraints")
    result = Comparison(check)
    bounds = model.bounds("velocity_constraints", model.graph_kernels["velocity_constraints"])[1]
    for k, truth in enumerate(model.truths):
        expected = numbers(truth.velocity_rows)
        actual = model.call("velocity_constraints", truth.case)
        size = float((np.abs(model.call("constraint_jacobian", truth.case)) @ np.abs(truth.case.v)).max(initial=0.0))
        limit = bounds[:, k] + UNIT * np.abs(expected)
        result.add(k, actual - expected, limit + FIRST_DIFFERENCE, size, model.layout.constraint_labels)
    return result.finding()


def _gamma(model: CheckedModel) -> Finding:
    """gamma has no kernel of its own: the graph's is judged here, what is generated from it by the accelerations."""
    check = "gamma: second differences of C along the motion"
    if not model.terms.n_c or not model.layout.projects:
        return Finding.skipped(
            check, "there are no constraints" if model.layout.projects else "derived with baumgarte="
        )
    result = Comparison(check)
    values, bounds = model.bounds("gamma", lambda: model.terms.gamma)
    for k, truth in enumerate(model.truths):
        expected = numbers(truth.gamma)
        limit = bounds[:, k] + UNIT * np.abs(expected)
        result.add(
            k,
            values[:, k] - expected,
            limit + SECOND_DIFFERENCE * size_of(expected),
            size_of(expected),
            model.layout.constraint_labels,
        )
    return result.finding()


def _potentials(model: CheckedModel) -> Finding:
    """What an element with a potential exerts, less its friction, is the slope of the potential."""
    check = "forces: slopes of their potentials"
    forces = [terms for terms in model.kinematics.forces if terms.potential is not None]
    if not forces:
        return Finding.skipped(check, "no force element has a potential")
    result, layout = Comparison(check), model.layout
    for k, truth in enumerate(model.truths):
        slopes = _potential_slopes(model, truth)
        every, rest = truth.applied(), truth.applied(remainder=True)
        gap = numbers(every - rest + slopes)
        sizes = np.abs(numbers(slopes)) + np.abs(numbers(every)) + np.abs(numbers(rest))
        limit = (64.0 * UNIT if model.kinematics.graph.calls else FOLDED) * (sizes + size_of(sizes)) + NO_FORCE
        if "bias" in model.graph_kernels:  # folded constants weigh more beside half a turn, as rounding does
            limit = np.maximum(limit, FOLDED / UNIT * model.bounds("bias", model.graph_kernels["bias"])[1][:, k])
        result.add(k, gap, limit, size_of(sizes), layout.v)
    return result.finding()


def _potential_slopes(model: CheckedModel, truth: Truth) -> Numbers:
    """dV/dv' of all potentials of force elements, by each velocity."""
    parts = [terms.potential for terms in model.kinematics.forces if terms.potential is not None]

    def total(values: Values) -> Number:
        return sum(truth.system.evaluate("potentials", lambda: parts, values), truth.zero)

    return array([truth.slope(total, partial(truth.displaced, j)) for j in range(model.layout.n_v)])


# -- derivatives -------------------------------------------------------------------------------------------------------

# Along the constraints the derivative is found in many digits, from M, h, C_q and gamma of the graph (which other
# checks judge); across them, and by inputs and parameters, by extrapolated differences of the generated right-hand side
# itself.


DIRECTIONS = 2  #: random ones for each state


def check_derivatives(model: CheckedModel) -> list[Finding]:
    """By the state, by inputs and by parameters."""
    result = [_along(model), _differences(model, "jacobian", "x")]
    for name, by, n in (("input_jacobian", "u", model.module.n_u), ("parameter_jacobian", "p", model.module.n_p)):
        if n and name in model.module.core.names and model.layout.projects and not model.layout.general_rates:
            result.append(_differences(model, name, by))
    return result


def accelerations(model: CheckedModel, truth: Truth, values: Values) -> Numbers:
    """q' and v' at other values of a state's symbols, in many digits, from the graph."""
    terms, n, rows = model.terms, model.layout.n_v, list(model.layout.rows)

    def of(name: str, outputs: Callable[[], object]) -> Numbers:
        chosen = model.graph_kernels.get(name, outputs)
        return model.system.evaluate(f"kernel {name}", chosen, values)  # type: ignore[arg-type]

    M = of("mass_matrix", lambda: [x for row in terms.mass_matrix for x in row]).reshape(n, n)
    C = of("constraint_jacobian", lambda: [x for row in terms.constraint_jacobian for x in row]).reshape(-1, n)
    gamma, h = of("gamma", lambda: terms.gamma), of("bias", lambda: terms.bias)
    return np.concatenate([truth.rates(values), solve_constrained(M, C[rows], h, gamma[rows])[0]])


def _condition(model: CheckedModel, case: SystemState) -> float:
    """Condition of the system of accelerations and multipliers, rows and columns of like size."""
    M, C = mass_at(model.module, case), jacobian_at(model.module, case)
    m = len(C)
    d = 1.0 / np.sqrt(np.maximum(np.diag(M), TINY + EPS * size_of(np.diag(M))))
    M, C = M * d * d[:, None], C * d
    C = C / np.maximum(np.linalg.norm(C, axis=1), TINY)[:, None]
    return float(algebra.cond(np.block([[M, C.T], [C, np.zeros((m, m))]]))) if len(M) else 1.0


def _tangent(model: CheckedModel, truth: Truth, rng: np.random.Generator) -> tuple[Array, Array]:
    """A random displacement w (n_v,) and change of velocity (n_v,) along the constraints."""
    n, C = model.layout.n_v, jacobian_at(model.module, truth.case)
    back = algebra.pinv(C) if len(C) else np.zeros((n, 0))
    free = np.eye(n) - back @ C if len(C) else np.eye(n)
    sizes = model.layout.scales.q
    w, change = free @ (sizes * rng.standard_normal(n)), free @ (sizes * rng.standard_normal(n))
    if len(C):
        turned = truth.slope(
            lambda values: model.system.evaluate("velocity", lambda: model.terms.velocity_constraints, values),
            _line(truth, w, np.zeros(n)),
        )
        change = change - back @ numbers(turned)[model.layout.rows]
    return w, change


def _line(truth: Truth, w: Array, change: Array) -> Callable[[Number], Values]:
    terms, exact = truth.system.terms, truth.system.exact
    dq, dv = exact(w) @ truth.columns, exact(change)
    return lambda s: truth.values | truth.moved(terms.q, s * dq) | truth.moved(terms.v, s * dv)


def _along(model: CheckedModel) -> Finding:
    """J d in random directions d along the constraints, by differences in many digits."""
    check = "jacobian: along the constraints, 50 digits"
    if not model.layout.projects or "jacobian" not in model.module.core.names:
        return Finding.skipped(check, "derived with baumgarte=" if not model.layout.projects else "there is no kernel")
    if model.terms.by_columns or model.layout.general_rates:
        why = "the mass matrix is not written out" if model.terms.by_columns else "rates of coordinates are given"
        return Finding.skipped(check, why)
    if not model.module.layout.n_dof:
        return Finding.skipped(check, "the constraints allow no motion")
    result, rng = Comparison(check), np.random.default_rng(1)
    for k, truth in enumerate(model.truths):
        case = truth.case
        J = model.module.jacobian(case.t, case.x, **case.values)
        condition = _condition(model, case) * model.dependence(jacobian_at(model.module, case))
        # where terms of the forces cancel, their slopes do too
        exact, multipliers = (numbers(x) for x in truth.solve(list(model.layout.rows)))
        slack = np.concatenate([np.zeros(model.layout.n_q), model.acceleration_limit(k, exact, multipliers)])
        for _ in range(DIRECTIONS):
            try:
                w, change = _tangent(model, truth, rng)
                expected = numbers(truth.slope(partial(accelerations, model, truth), _line(truth, w, change)))
            except ZeroDivisionError:
                return Finding.skipped(check, "the system of accelerations and multipliers is singular")
            d = np.concatenate([w @ numbers(truth.columns), change])
            size = max(size_of(np.abs(J) @ np.abs(d)), size_of(model.rhs(case)))
            limit = 4.0 * model.layout.n_x * UNIT * condition * size + slack * max(1.0, size_of(d))
            result.add(k, J @ d - expected, limit, size, model.labels("rhs"))
    result.states_compared = len(model.truths)
    return result.finding()


def _noise(model: CheckedModel, k: int) -> Array:
    """By how much rounding may move x' (n_x,)."""
    truth, layout = model.truths[k], model.layout
    a, multipliers = (numbers(x) for x in truth.solve(list(layout.rows)))
    moved = model.shift(k, jacobian_at(model.module, truth.case))
    rates = np.abs(model.slopes(truth.case))[: layout.n_q] @ moved
    return np.concatenate([rates, model.acceleration_limit(k, a, multipliers)])


def _differences(model: CheckedModel, name: str, by: str) -> Finding:
    """Every column of a Jacobian, across the constraints too, by extrapolated differences."""
    check, module, case = f"{name}: differences of rhs", model.module, model.states[0]
    if name not in module.core.names:
        return Finding.skipped(check, "there is no kernel")
    try:
        noise = _noise(model, 0)
    except ZeroDivisionError:
        return Finding.skipped(check, "the system of accelerations and multipliers is singular")
    noise = np.maximum(noise, 2.0 * EPS * size_of(model.rhs(case)))  # where drivers alone give accelerations
    least = size_of(model.layout.scales.q) if by == "x" else 0.0
    known = noise, 4.0 * model.layout.n_x * UNIT * _condition(model, case), least
    first = OFF_CONSTRAINTS if len(model.layout.rows) else FIRST_STEP
    return compare_jacobian(module, check, name, by, [case], first, known)
