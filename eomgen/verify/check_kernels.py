"""Generated code against its graph, derivatives against differences."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.numbers import EPS, TINY
from ..errors import EomgenError
from .bench import Bench, numbers
from .cases import Case
from .digits import FOLDED, UNIT, Number, Numbers, bounded, solve
from .finding import FIRST_STEP, SHORTER, Comparison, Finding, extrapolate, pairs, size_of, terms_size
from .limits import FIRST_DIFFERENCE, NO_FORCE, OFF_CONSTRAINTS, SECOND_DIFFERENCE
from .truth import Truth, Values

# -- kernels -----------------------------------------------------------------------------------------------------------


COLUMNS = 9  #: states of a batch: more than a vector holds, and no multiple of it


def check_kernels(bench: Bench) -> list[Finding]:
    """All straight-line kernels, one finding each; batches; double arithmetic."""
    return [*(_kernel(bench, name) for name in bench.graph_kernels), *_derived(bench), _batches(bench), _digits(bench)]


def _kernel(bench: Bench, name: str) -> Finding:
    """Two evaluations of one expression in different orders differ by two bounds at most."""
    found, labels = Comparison(f"{name}: generated code and graph"), bench.labels(name)
    values, bounds = bench.bounds(name, bench.graph_kernels[name])
    for k, case in enumerate(bench.cases):
        actual = bench.call(name, case).ravel()
        found.add(k, actual - values[:, k], 2.0 * bounds[:, k], terms_size(values[:, k], bounds[:, k]), labels)
    return found.finding()


def _derived(bench: Bench) -> list[Finding]:
    """Kernels that are other kernels in disguise: the outputs, and the matrix of the independent coordinates."""
    module, found = bench.module, []
    if module.n_y and "motion_outputs" in bench.graph_kernels:
        outputs = Comparison("outputs: at the accelerations of the motion")
        for k, case in enumerate(bench.cases):
            a = bench.rhs(case)[module.n_q :]
            expected = module.kernels.motion_outputs(case.q, case.v, a, p=case.p, u=case.u, t=case.t)
            actual = module.outputs(case.t, case.x, p=case.p, u=case.u)
            bound = bench.bounds("motion_outputs", lambda: bench.terms.outputs)[1][:, k]
            slope = module.kernels.output_derivatives(case.q, case.v, a, p=case.p, u=case.u, t=case.t)
            C = module.kernels.constraint_jacobian(case.q, p=case.p, u=case.u, t=case.t)[bench.layout.rows]
            shift, n = bench.shift(k, C), module.n_x
            limit = (
                2.0 * bound
                + np.abs(slope[:, :n]) @ shift
                + np.abs(slope[:, n : n + module.layout.n_v]) @ bench.moved(k, C)
            )
            outputs.add(k, actual - expected, limit, size_of(expected), bench.layout.y)
        found.append(outputs.finding())
    return found


def _batches(bench: Bench) -> Finding:
    """A batch gives what single calls give; the vector library's functions may differ by units in the last place."""
    module, found = bench.module, Comparison("batches: same as single calls")
    case = bench.cases[0]
    rng = np.random.default_rng(COLUMNS)
    q = case.q[:, None] + 0.1 * rng.standard_normal((module.n_q, COLUMNS))
    x = np.concatenate([q, case.v[:, None] + rng.standard_normal((module.layout.n_v, COLUMNS))])
    terms = bench.terms
    symbols = {name: np.full(COLUMNS, float(v[0])) for name, v in bench.symbols.items()}
    symbols |= dict(zip((*terms.q, *terms.v), x, strict=True))
    for name in ("mass_matrix", "bias", "energy", "poses", "constraints", "constraint_jacobian"):
        if name not in bench.graph_kernels:
            continue
        outputs = list(bench.graph_kernels[name]())
        bounds = bounded(outputs, symbols, COLUMNS)[1]
        kernel = module.kernels.kernel(name, kind="state")
        states = x if KERNEL_STATES[name] == "x" else q
        batch = np.asarray(kernel(states, p=case.p, u=case.u, t=case.t)).reshape(-1, COLUMNS)
        for k in range(COLUMNS):
            single = np.asarray(kernel(np.ascontiguousarray(states[:, k]), p=case.p, u=case.u, t=case.t)).ravel()
            labels = [f"{name} {label}" for label in bench.labels(name)]
            found.add(0, batch[:, k] - single, 2.0 * bounds[:, k], terms_size(single, bounds[:, k]), labels)
    found.cases = 1
    return found.finding()


KERNEL_STATES = {
    "mass_matrix": "q",
    "bias": "x",
    "energy": "x",
    "poses": "q",
    "constraints": "q",
    "constraint_jacobian": "q",
}


def _digits(bench: Bench) -> Finding:
    """The graph in double arithmetic against the graph in 50 digits: that the bounds of rounding are bounds."""
    found = Comparison("graph: double arithmetic and 50 digits")
    every = {**bench.graph_kernels, "gamma": lambda: bench.terms.gamma}
    for name, outputs in every.items():
        values, bounds = bench.bounds(name, outputs)
        labels = [f"{name} {label}" for label in bench.labels(name)] or [name] * len(values)
        for k, truth in enumerate(bench.truths):
            exact = bench.system.evaluate(f"kernel {name}", outputs, truth.values)
            apart = numbers([truth.mp.mpf(float(x)) - y for x, y in zip(values[:, k], exact, strict=True)])
            found.add(
                k, apart, bounds[:, k] + UNIT * np.abs(numbers(exact)), terms_size(values[:, k], bounds[:, k]), labels
            )
    found.cases = len(bench.truths)
    return found.finding()


# -- constraints -------------------------------------------------------------------------------------------------------


def check_constraints(bench: Bench) -> list[Finding]:
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


# -- derivatives -------------------------------------------------------------------------------------------------------

# Along the constraints the derivative is found in many digits, from M, h, C_q and gamma of the graph (which other
# checks judge); across them, and by inputs and parameters, by extrapolated differences of the generated right-hand side
# itself.


DIRECTIONS = 2  #: random ones for each state


def check_derivatives(bench: Bench) -> list[Finding]:
    """By the state, by inputs and by parameters."""
    found = [_along(bench), _all_directions(bench)]
    for name, n in (("input_jacobian", bench.module.n_u), ("parameter_jacobian", bench.module.n_p)):
        if n and name in bench.module.core.names and bench.layout.projects and not bench.layout.general_rates:
            found.append(_by(bench, name))
    return found


def accelerations(bench: Bench, truth: Truth, values: Values) -> Numbers:
    """q' and v' at other values of a state's symbols, in many digits, from the graph."""
    terms, n, rows = bench.terms, bench.layout.n_v, list(bench.layout.rows)
    kernels = bench.graph_kernels

    def of(name: str, outputs: Callable[[], object] | None = None) -> Numbers:
        chosen = kernels.get(name, outputs)
        return bench.system.evaluate(f"kernel {name}", chosen, values)  # type: ignore[arg-type]

    M = of("mass_matrix", lambda: [x for row in bench.terms.mass_matrix for x in row])
    C = of("constraint_jacobian", lambda: [x for row in terms.constraint_jacobian for x in row])
    gamma, h = of("gamma", lambda: terms.gamma), of("bias", lambda: terms.bias)
    C_rows = [C[n * i : n * i + n] for i in rows]
    matrix = [[*M[n * i : n * i + n], *(row[i] for row in C_rows)] for i in range(n)]
    matrix += [[*row, *[truth.zero] * len(rows)] for row in C_rows]
    z = solve(matrix, [[-x] for x in h] + [[-gamma[i]] for i in rows])
    return [*truth.rates(values), *(x[0] for x in z[:n])]


def _condition(bench: Bench, case: Case) -> float:
    """Condition of the system of accelerations and multipliers, rows and columns of like size."""
    module = bench.module
    C = module.kernels.constraint_jacobian(case.q, p=case.p, u=case.u, t=case.t)[bench.layout.rows]
    M, m = module.kernels.mass_matrix(case.q, p=case.p, u=case.u, t=case.t), len(C)
    d = 1.0 / np.sqrt(np.maximum(np.diag(M), TINY + EPS * size_of(np.diag(M))))
    M, C = M * d * d[:, None], C * d
    C = C / np.maximum(np.linalg.norm(C, axis=1), TINY)[:, None]
    return float(algebra.cond(np.block([[M, C.T], [C, np.zeros((m, m))]]))) if module.layout.n_v else 1.0


def _tangent(bench: Bench, truth: Truth, rng: np.random.Generator) -> tuple[Array, Array]:
    """A random displacement w (n_v,) and change of velocity (n_v,) along the constraints."""
    case, module, n = truth.case, bench.module, bench.layout.n_v
    C = module.kernels.constraint_jacobian(case.q, p=case.p, u=case.u, t=case.t)[bench.layout.rows]
    back = algebra.pinv(C) if len(C) else np.zeros((n, 0))
    free = np.eye(n) - back @ C if len(C) else np.eye(n)
    sizes = module.layout.scales.q
    w, change = free @ (sizes * rng.standard_normal(n)), free @ (sizes * rng.standard_normal(n))
    if len(C):
        turned = truth.slope(
            lambda values: bench.system.evaluate("velocity", lambda: bench.terms.velocity_constraints, values),
            lambda s: _shifted(truth, s, w, np.zeros(n)),
        )
        change = change - back @ numbers(turned)[bench.layout.rows]
    return w, change


def _shifted(truth: Truth, s: object, w: Array, change: Array) -> Values:
    """The state moved by s along w and change."""
    terms, number = truth.system.terms, truth.mp.mpf
    values = dict(truth.values)
    for j, x in enumerate(w):
        for name, column in zip(terms.q, truth.columns[j], strict=True):
            if column:
                values[name] = values[name] + s * number(float(x)) * column
    for name, x in zip(terms.v, change, strict=True):
        values[name] = values[name] + s * number(float(x))
    return values


def _along(bench: Bench) -> Finding:
    """J d in random directions d along the constraints, by differences in many digits."""
    check = "jacobian: along the constraints, 50 digits"
    if not bench.layout.projects or "jacobian" not in bench.module.core.names:
        return Finding.skipped(check, "derived with baumgarte=" if not bench.layout.projects else "there is no kernel")
    if bench.terms.by_columns or bench.layout.general_rates:
        why = "the mass matrix is not written out" if bench.terms.by_columns else "rates of coordinates are given"
        return Finding.skipped(check, why)
    if not bench.module.layout.n_dof:
        return Finding.skipped(check, "the constraints allow no motion")
    found, rng = Comparison(check), np.random.default_rng(1)
    for k, truth in enumerate(bench.truths):
        case = truth.case
        J = bench.module.jacobian(case.t, case.x, p=case.p, u=case.u)
        condition = _condition(bench, case) * bench.dependence(
            bench.module.kernels.constraint_jacobian(case.q, p=case.p, u=case.u, t=case.t)[bench.layout.rows]
        )
        # where terms of the forces cancel, their slopes do too
        exact, multipliers = (numbers(x) for x in truth.solve(list(bench.layout.rows)))
        slack = np.concatenate([np.zeros(bench.layout.n_q), bench.acceleration_limit(k, exact, multipliers)])
        for _ in range(DIRECTIONS):
            try:
                w, change = _tangent(bench, truth, rng)
                expected = numbers(truth.slope(_state_rates(bench, truth), _line(truth, w, change)))
            except ZeroDivisionError:
                return Finding.skipped(check, "the system of accelerations and multipliers is singular")
            d = np.concatenate([_moved(truth, w), change])
            size = max(size_of(np.abs(J) @ np.abs(d)), size_of(bench.rhs(case)))
            limit = 4.0 * bench.layout.n_x * UNIT * condition * size + slack * max(1.0, size_of(d))
            found.add(k, J @ d - expected, limit, size, bench.labels("rhs"))
    found.cases = len(bench.truths)
    return found.finding()


def _state_rates(bench: Bench, truth: Truth) -> Callable[[Values], Numbers]:
    return lambda values: accelerations(bench, truth, values)


def _line(truth: Truth, w: Array, change: Array) -> Callable[[object], Values]:
    return lambda s: _shifted(truth, s, w, change)


def _moved(truth: Truth, w: Array) -> Array:
    """N w, the change of the coordinates."""
    return np.array([numbers(column) for column in truth.columns]).T @ w if len(w) else np.zeros(0)


def _noise(bench: Bench, k: int) -> Array:
    """By how much rounding may move x' (n_x,)."""
    truth, layout = bench.truths[k], bench.layout
    a, multipliers = (numbers(x) for x in truth.solve(list(layout.rows)))
    C = bench.module.kernels.constraint_jacobian(truth.case.q, p=truth.case.p, u=truth.case.u, t=truth.case.t)[
        layout.rows
    ]
    rates = np.abs(bench.slopes(truth.case))[: layout.n_q] @ bench.shift(k, C)
    return np.concatenate([rates, bench.acceleration_limit(k, a, multipliers)])


def _all_directions(bench: Bench) -> Finding:
    """Every column, across the constraints too, by extrapolated differences."""
    check, module, layout = "jacobian: differences of rhs", bench.module, bench.layout
    if "jacobian" not in module.core.names:
        return Finding.skipped(check, "there is no kernel")
    case = bench.cases[0]
    J = module.jacobian(case.t, case.x, p=case.p, u=case.u)
    scales = np.concatenate([_coordinate_sizes(bench), layout.scales.q])

    def column(j: int) -> Callable[[float], Array]:
        def f(s: float) -> Array:
            x = np.array(case.x)
            x[j] += s * scales[j]
            return module.rhs(case.t, x, p=case.p, u=case.u)

        return f

    return _compare(
        bench, check, J * scales, [column(j) for j in range(layout.n_x)], layout.x, size_of(layout.scales.q)
    )


def _coordinate_sizes(bench: Bench) -> Array:
    return np.array([bench.layout.length if kind == "length" else 1.0 for kind in bench.layout.coordinate_kinds])


def _by(bench: Bench, name: str) -> Finding:
    module, case = bench.module, bench.cases[0]
    inputs = name == "input_jacobian"
    names, values = (module.u_names, case.u) if inputs else (module.p_names, case.p)
    J = getattr(module, name)(case.t, case.x, p=case.p, u=case.u)
    scales = np.where(values != 0.0, np.abs(values), 1.0) * (1.0 if inputs else 0.2)

    def column(j: int) -> Callable[[float], Array]:
        def f(s: float) -> Array:
            given = np.array(values)
            given[j] += s * scales[j]
            p, u = (case.p, given) if inputs else (given, case.u)
            return module.rhs(case.t, case.x, p=p, u=u)

        return f

    return _compare(bench, f"{name}: differences of rhs", J * scales, [column(j) for j in range(len(names))], names)


def _compare(
    bench: Bench,
    check: str,
    J: Array,
    columns: list[Callable[[float], Array]],
    names: tuple[str, ...],
    least: float = 0.0,
) -> Finding:
    """``least``: size of columns of any such Jacobian, which counts where constraints leave no motion."""
    found, condition = Comparison(check), _condition(bench, bench.cases[0])
    try:
        noise = _noise(bench, 0)
    except ZeroDivisionError:
        return Finding.skipped(check, "the system of accelerations and multipliers is singular")
    noise = np.maximum(noise, 2.0 * EPS * size_of(bench.rhs(bench.cases[0])))  # where drivers alone give accelerations
    slopes, errors, left_out = [], [], []
    step = OFF_CONSTRAINTS if len(bench.layout.rows) else FIRST_STEP
    rounding = 4.0 * bench.layout.n_x * UNIT * condition
    for j, f in enumerate(columns):
        slope, error = J[:, j], np.zeros(len(J))
        try:
            for first in (step, SHORTER * step):
                slope, error = extrapolate(f, noise, first)
                if (np.abs(slope - J[:, j]) <= error + rounding * size_of(slope)).all():
                    break
        except EomgenError:
            left_out.append(names[j])
        slopes.append(slope)
        errors.append(error)
    if left_out:
        found.note = f"without {', '.join(left_out)}: no consistent state was found nearby"
    expected, error = np.array(slopes).T, np.array(errors).T
    size = max(size_of(expected), size_of(bench.rhs(bench.cases[0])), least)
    limit = error + rounding * size
    found.add(0, J - expected, limit, size, pairs(bench.labels("rhs"), names))
    return found.finding()
