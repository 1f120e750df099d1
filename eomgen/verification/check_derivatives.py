"""Stage verification, check derivatives: the Jacobians of the complete right-hand side against differences of it.

Along the constraints the derivative is found in many digits, from M, h, C_q and gamma of the graph (which other checks
judge); across them, and by inputs and parameters, by extrapolated differences of the generated right-hand side itself.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import OFF_CONSTRAINTS
from ..base.limits.numbers import EPS, TINY
from ..errors import EomgenError
from .bench import Bench, numbers
from .cases import Case
from .comparison import Comparison, pairs, size_of
from .differences import FIRST_STEP, SHORTER, extrapolate
from .digits import Numbers, solve
from .finding import Finding
from .rounding_sizes import UNIT
from .truth import Truth, Values

DIRECTIONS = 2  #: random ones for each state


def check(bench: Bench) -> list[Finding]:
    """By the state, by inputs and by parameters."""
    found = [_along(bench), _all_directions(bench)]
    for name, n in (("input_jacobian", bench.module.n_u), ("parameter_jacobian", bench.module.n_p)):
        if n and name in bench.module.core.names and bench.layout.projects and not bench.layout.given_rates:
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
    C = module.kernels.constraint_jacobian(case.q, p=case.p, u=case.u, t=case.t)
    M, m = module.kernels.mass_matrix(case.q, p=case.p, u=case.u, t=case.t), len(C)
    d = 1.0 / np.sqrt(np.maximum(np.diag(M), TINY + EPS * size_of(np.diag(M))))
    M, C = M * d * d[:, None], C * d
    C = C / np.maximum(np.linalg.norm(C, axis=1), TINY)[:, None]
    return float(algebra.cond(np.block([[M, C.T], [C, np.zeros((m, m))]]))) if module.layout.n_v else 1.0


def _tangent(bench: Bench, truth: Truth, rng: np.random.Generator) -> tuple[Array, Array]:
    """A random displacement w (n_v,) and change of velocity (n_v,) along the constraints."""
    case, module, n = truth.case, bench.module, bench.layout.n_v
    C = module.kernels.constraint_jacobian(case.q, p=case.p, u=case.u, t=case.t)
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
    if bench.terms.by_columns or bench.layout.given_rates:
        why = "the mass matrix is not written out" if bench.terms.by_columns else "rates of coordinates are given"
        return Finding.skipped(check, why)
    if not bench.module.layout.n_dof:
        return Finding.skipped(check, "the constraints allow no motion")
    found, rng = Comparison(check), np.random.default_rng(1)
    for k, truth in enumerate(bench.truths):
        case = truth.case
        J = bench.module.jacobian(case.t, case.x, p=case.p, u=case.u)
        condition = _condition(bench, case) * bench.dependence(
            bench.module.kernels.constraint_jacobian(case.q, p=case.p, u=case.u, t=case.t)
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
    C = bench.module.kernels.constraint_jacobian(truth.case.q, p=truth.case.p, u=truth.case.u, t=truth.case.t)
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
