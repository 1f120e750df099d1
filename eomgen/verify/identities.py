"""A module alone -> what must hold between its own results, whatever the model is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..base import algebra
from ..base.algebra import Array, correlated
from ..base.limits.numbers import EPS
from ..errors import EomgenError
from ..runtime.inputs import moving_inputs
from ..runtime.minimal import Minimal
from .finding import FIRST_STEP, SHORTER, Comparison, Finding, extrapolate, failed, pairs, size_of
from .limits import CLOSED
from .random_states import SystemState

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

# -- identities --------------------------------------------------------------------------------------------------------

# Nothing but the module and NumPy is needed, so that exported packages carry these checks.


#: Rounding of a kernel relative to its largest entry, where the size of the terms behind it is not known: sums of some
#: hundred products.  Checks that know the graph have bounds of their own.
KERNEL = 256.0 * EPS

Check = Callable[[str, "BoundModel", Sequence[SystemState]], Finding]


def identities(module: BoundModel, states: Sequence[SystemState]) -> list[Finding]:
    """All of them; one that cannot be carried out fails."""
    result = []
    for name, check in CHECKS.items():
        if module.info.no_inertia and check not in KINEMATIC:
            result.append(Finding.skipped(name, "the model is for kinematics only"))
            continue
        try:
            result.append(check(name, module, states))
        except EomgenError as error:
            result.append(failed(name, error))
    return result


def mass_at(module: BoundModel, c: SystemState) -> Array:
    """M of the tree."""
    return module.kernels.mass_matrix(c.q, **c.timed)


def jacobian_at(module: BoundModel, c: SystemState) -> Array:
    """The independent rows of C_q."""
    return module.kernels.constraint_jacobian(c.q, **c.timed)[module.layout.rows]


def _definite(check: str, module: BoundModel, states: Sequence[SystemState]) -> Finding:
    """The matrix of the degrees of freedom, each scaled to a unit diagonal."""
    if not module.layout.n_dof or module.layout.general_rates:
        return Finding.skipped(
            check, "there is no degree of freedom" if not module.layout.n_dof else "equations are given"
        )
    if module.info.indefinite:
        return Finding.skipped(check, "the model accepts masses and inertias that no body can have")
    result = Comparison(check, "asymmetry; or the smallest eigenvalue at unit diagonal, sign reversed")
    for c in states:
        M = module.kernels.embedded_mass_matrix(c.q, **c.timed)
        result.add(c.number, M - M.T, KERNEL * size_of(M) * np.ones_like(M), size_of(M))
        smallest = float(algebra.eigvalsh(correlated(M))[0]) if np.isfinite(M).all() else -np.inf
        result.add(c.number, [max(0.0, -smallest)], [0.0])
    return result.finding()


def _kinetic(check: str, module: BoundModel, states: Sequence[SystemState]) -> Finding:
    if not module.n_bodies:
        return Finding.skipped(check, "there are no bodies")
    result = Comparison(check)
    for c in states:
        v, M = c.v[: module.n_v], module.mass_matrix(c.q, **c.timed)
        T, expected = float(module.energy(c.x, **c.timed)[0]), float(v @ M @ v) / 2.0
        size = float(np.abs(v) @ np.abs(M) @ np.abs(v)) / 2.0
        result.add(c.number, [T - expected], [KERNEL * size], size)
    return result.finding()


def _inverse(check: str, module: BoundModel, states: Sequence[SystemState]) -> Finding:
    result = Comparison(check)
    for c in states:
        M, h = mass_at(module, c), module.kernels.bias(c.t, c.x, **c.values)
        expected = module.kernels.inverse_dynamics(c.q, c.v, c.a, **c.timed)
        size = size_of(np.abs(M) @ np.abs(c.a) + np.abs(h))
        result.add(c.number, M @ c.a + h - expected, KERNEL * size, size, module.layout.v)
    return result.finding()


def _rates(module: BoundModel, q: Array, v: Array) -> Array:
    space = module.layout.space
    return v if space is None else space.rates(q, v)


def _slopes(check: str, module: BoundModel, states: Sequence[SystemState]) -> Finding:
    """C_q N of each velocity; C of Euler parameters off their unit length is a function like any other."""
    if not module.n_rows or module.layout.general_rates:
        return Finding.skipped(check, "there are no constraints" if not module.n_rows else "equations are given")
    result, n_h = Comparison(check), module.layout.n_h
    for c in states:
        C = module.kernels.constraint_jacobian(c.q, **c.timed)[:n_h]
        for j, scale in enumerate(module.layout.scales.q):
            way = _rates(module, c.q, np.eye(module.layout.n_v)[j]) * scale
            slope, error = extrapolate(_along_q(module, c, way), KERNEL * size_of(C) * size_of(c.q))
            size = size_of(C) * scale
            result.add(c.number, slope - C[:, j] * scale, error + KERNEL * size, size, module.constraint_labels[:n_h])
    result.states_compared = len(states)
    return result.finding()


def _along_q(module: BoundModel, c: SystemState, way: Array) -> Callable[[float], Array]:
    return lambda s: module.constraints(c.q + s * way, **c.timed, rows="all")


def _projection(check: str, module: BoundModel, states: Sequence[SystemState]) -> Finding:
    """Projected twice is projected once; loops are closed there, and at ``x0``."""
    result, scales = Comparison(check), module.layout.scales
    for c in states:
        x = module.project(c.x, t=c.t, **c.values)
        again = module.project(x, t=c.t, **c.values)
        result.add(c.number, again - x, CLOSED * size_of(x), size_of(x), module.x_names)
        for state, t, p, u in ((x, c.t, c.p, c.u), (module.x0(), 0.0, module.p, module.u)):
            gap = scales.residual(module.constraints(state[: module.n_q], t=t, p=p, u=u, rows="all"))
            result.add(c.number, gap, CLOSED, 1.0, module.constraint_labels[: module.layout.n_h])
    result.states_compared = len(states)
    return result.finding()


def _balance(check: str, module: BoundModel, states: Sequence[SystemState]) -> Finding:
    """B^T (M a + h) = 0, B the motions that the constraints leave (their null space by singular values)."""
    result = Comparison(check)
    for c in states:
        a = module.rhs(c.t, c.x, **c.values)[module.n_q :]
        M, h, C = mass_at(module, c), module.kernels.bias(c.t, c.x, **c.values), jacobian_at(module, c)
        scale = module.layout.scales.q
        free = _null(C * scale) * scale[:, None]
        size = np.abs(free).T @ (np.abs(M) @ np.abs(a) + np.abs(h))
        condition = _condition(M, C, scale)
        # terms of M and h as large as the largest force may cancel in a direction without any force
        limit = KERNEL * (condition * size + size_of(size))
        result.add(c.number, free.T @ (M @ a + h), limit, size_of(size))
    return result.finding()


def _null(J: Array) -> Array:
    """Orthonormal columns that J (m, n) of full rank m maps to zero."""
    n = J.shape[1]
    return algebra.svd(J)[2][len(J) :].T if len(J) else np.eye(n)


def _condition(M: Array, C: Array, scale: Array) -> float:
    """Condition of C scaled, times that of the embedded matrix at unit diagonal."""
    free = _null(C * scale) * scale[:, None]
    condition = algebra.cond(correlated(free.T @ M @ free)) if free.shape[1] else 1.0
    rows = np.linalg.norm(C * scale, axis=1)
    return float(condition * (algebra.cond((C * scale) / rows[:, None]) if len(C) else 1.0))


def _holding(check: str, module: BoundModel, states: Sequence[SystemState]) -> Finding:
    """d/dt (C_q v + C_t) = 0 along x' = rhs, inputs moving at their rates where those are inputs too."""
    if not module.n_rows or not module.layout.projects:
        return Finding.skipped(check, "there are no constraints" if not module.n_rows else "derived with baumgarte=")
    result = Comparison(check)
    for c in states:
        rate = module.rhs(c.t, c.x, **c.values)
        time_scale = 1.0 / max(size_of(rate), 1.0)
        C = jacobian_at(module, c)
        size = size_of(np.abs(C) @ np.abs(rate[module.n_q :])) * time_scale
        condition = _condition(mass_at(module, c), C, module.layout.scales.q)
        noise = KERNEL * size_of(np.abs(C) @ np.abs(c.v))
        slope, error = extrapolate(_along_x(module, c, rate, time_scale), noise)
        result.add(c.number, slope, error + KERNEL * condition * size, max(size, noise))
    return result.finding()


def _along_x(module: BoundModel, c: SystemState, rate: Array, time_scale: float) -> Callable[[float], Array]:
    u_rate = moving_inputs(module.layout, c.u)

    def f(s: float) -> Array:
        x, t, u = c.x + s * time_scale * rate, c.t + s * time_scale, c.u + s * time_scale * u_rate
        return module.velocity_constraints(x, p=c.p, u=u, t=t)

    return f


def _minimal(check: str, module: BoundModel, states: Sequence[SystemState]) -> Finding:
    layout = module.layout
    try:
        layout.require_minimal_form()
    except EomgenError:
        return Finding.skipped(check, "positions do not follow from independent coordinates")
    if not module.layout.n_dof or not layout.projects:
        return Finding.skipped(
            check, "there is no degree of freedom" if not module.layout.n_dof else "derived with baumgarte="
        )
    result = Comparison(check)
    for c in states:
        bound = module.bind(c.p, c.u)
        minimal = Minimal(bound)
        minimal.reset(c.q)
        full = minimal.reduce(bound.rhs(c.t, c.x))
        reduced = minimal.rhs(c.t, minimal.reduce(c.x))
        condition = _condition(mass_at(module, c), jacobian_at(module, c), layout.scales.q)
        size = size_of(bound.rhs(c.t, c.x))
        result.add(c.number, reduced - full, CLOSED * condition * size, size, minimal.x_names)
    return result.finding()


#: Name -> check.
CHECKS: dict[str, Check] = {
    "embedded_mass_matrix: symmetric, positive definite": _definite,
    "energy: T = v M v / 2": _kinetic,
    "inverse_dynamics: M a + h": _inverse,
    "constraint_jacobian: extrapolated differences": _slopes,
    "project: idempotent, closes loops, keeps x0": _projection,
    "rhs: forces in balance along free motions": _balance,
    "rhs: constraints stay satisfied": _holding,
    "minimal: the same accelerations": _minimal,
}
#: Those that need no inertia.
KINEMATIC = (_slopes, _projection)


# -- Jacobians by differences ------------------------------------------------------------------------------------------

# For modules without equations, such as those of exported packages: nothing but NumPy is needed.


STATES = 2  #: states that are tried
NAMES = {"jacobian": "x", "input_jacobian": "u", "parameter_jacobian": "p"}  #: kernel -> what it differentiates by


def jacobians(module: BoundModel, states: Sequence[SystemState]) -> list[Finding]:
    """One finding for each Jacobian of the complete right-hand side that the module has."""
    result = []
    for name, by in NAMES.items():
        size = {"x": module.n_x, "u": module.n_u, "p": module.n_p}[by]
        exact = by == "x" or (module.layout.projects and not module.layout.general_rates)
        if size and exact and name in module.core.names:
            check = f"{name}: extrapolated differences of rhs"
            try:
                result.append(compare_jacobian(module, check, name, by, states[:STATES]))
            except EomgenError as error:
                result.append(failed(check, error))
    return result


def compare_jacobian(
    module: BoundModel,
    check: str,
    name: str,
    by: str,
    states: Sequence[SystemState],
    first: float = FIRST_STEP,
    known: tuple[Array, float, float] | None = None,
) -> Finding:
    """A Jacobian beside differences of the right-hand side.

    Parameters
    ----------
    name : str
        Of the kernel.
    by : {'x', 'u', 'p'}
    first : float
        The first step of differences.
    known : (array, float, float), optional
        By how much rounding may move x' (n_x,) and, relative to its size, the Jacobian; and the size of columns of any
        such Jacobian, which counts where constraints leave no motion.  By default from the condition of the equations.
    """
    result, layout = Comparison(check), module.layout
    names = {"x": layout.x, "u": module.u_names, "p": module.p_names}[by]
    left_out: set[str] = set()
    for c in states:
        J, rate = getattr(module, name)(c.t, c.x, **c.values), module.rhs(c.t, c.x, **c.values)
        scales = _scales(module, c, by)
        if known is None:
            rounding = KERNEL * _condition(mass_at(module, c), jacobian_at(module, c), layout.scales.q)
            noise, least = np.full(layout.n_x, rounding * max(size_of(rate), size_of(layout.scales.q))), 0.0
        else:
            noise, rounding, least = known
        for j, label in enumerate(names):
            size = max(size_of(J * scales), size_of(rate), least)
            compared: tuple[Array, Array] | None = None
            for step in (first, SHORTER * first):
                try:
                    slope, error = extrapolate(_along(module, c, by, j, float(scales[j])), noise, step)
                except EomgenError:
                    continue
                compared = slope - J[:, j] * scales[j], error + rounding * size
                if (np.abs(compared[0]) <= compared[1]).all():
                    break
            if compared is None:
                left_out.add(label)
                continue
            result.add(c.number, *compared, size, pairs([f"{n}'" for n in layout.x], [label]))
    result.states_compared = len(states)
    if left_out:
        result.note = f"without {', '.join(sorted(left_out))}: no consistent state was found nearby"
    return result.finding()


def _scales(module: BoundModel, c: SystemState, by: str) -> Array:
    """Sizes of the variables, over which differences are taken."""
    layout = module.layout
    if by == "x":
        kinds = layout.coordinate_kinds
        lengths = np.array([layout.length if kind == "length" else 1.0 for kind in kinds])
        return np.concatenate([lengths, layout.scales.q])
    values = c.u if by == "u" else c.p
    return np.where(values != 0.0, np.abs(values), 1.0) * (1.0 if by == "u" else 0.2)


def _along(module: BoundModel, c: SystemState, by: str, j: int, scale: float) -> Callable[[float], Array]:
    def f(s: float) -> Array:
        raw = {"x": np.array(c.x), "u": np.array(c.u), "p": np.array(c.p)}
        raw[by][j] += s * scale
        return module.rhs(c.t, raw["x"], p=raw["p"], u=raw["u"])

    return f
