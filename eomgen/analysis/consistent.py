"""Any state -> the nearest one on the constraints, near in a metric of one's own, with values held.

Least change of positions, d^T W d with C = 0, by steps along the constraints and back onto them; then of velocities, in
one linear step (Blajer, Elimination of constraint violation and accuracy aspects in numerical simulation of multibody
systems, Multibody System Dynamics 7 (2002), 265-284, has W = M).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array
from ..base.assembly import ClosureSystem, close, closed
from ..base.limits.constraints import ACCEPTED
from ..base.limits.constraints import STATE as RANK
from ..base.scales import largest, least
from ..base.texts import quote
from ..errors import ProjectionError, UsageError, cannot, ill_typed, off_range
from ..runtime.argument_checks import check_names, read_names, read_number, read_state
from ..runtime.kernels import constraint_system
from ..runtime.layout import Layout
from .limits import NEAREST

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

STEPS = 100  #: along the constraints, at most; they gain a constant factor each, the larger the nearer the state
CLOSING = 25  #: Newton steps onto the constraints, at most
PASSES = 30  #: of the linear correction of velocities, at most
LONGEST = 0.5  #: scaled step along the constraints
DAMPING = 1.0  #: of the first step onto the constraints: far away it goes down the steepest way and stays near


@np.errstate(all="ignore")
def consistent(
    module: BoundModel,
    /,
    x: ArrayLike,
    t: float = 0.0,
    *,
    weights: Mapping[str, float] | str | None = None,
    hold: Sequence[str] = (),
    p: Any = None,
    u: Any = None,
) -> Array:
    """Find the state on the constraints that is nearest to a given one: first its position, then its velocities.

    Parameters
    ----------
    x : (n_x,) array
        Any state.
    t : float
    weights : mapping of str to float, or 'mass', optional
        Weights of the squared changes, in radians or lengths of the model; 1 for names not
        given.  The weight of a coordinate is also that of its rate, unless the rate is named.  ``'mass'``
        takes the mass matrix of the tree as the metric.
    hold : sequence of str
        Coordinates and rates that keep their values exactly.
    p, u : optional
        As for ``bind``.

    Returns
    -------
    (n_x,) array

    Raises
    ------
    ProjectionError
        No state near the given one satisfies the constraints, or none with these values held.
    UsageError
        A name is unknown, or a weight is not positive.

    Notes
    -----
    ``project(x)`` is the same with weights 1 to first order in the change; ``x0`` starts from named values.
    """
    module = module.bind(p, u)
    layout, t = module.layout, read_number("t", t)
    state = read_state("x", x, layout.x)
    if layout.general_rates:
        raise cannot(
            "consistent() works for models with q' = v only, and the rates of this model's coordinates are given; "
            "use project(x)"
        )
    fixed = read_names("hold", hold)
    if isinstance(weights, Mapping):
        weights = {name: read_number(f"weights: that of {name}", weight) for name, weight in weights.items()}
    elif weights is not None and not (isinstance(weights, str) and weights == "mass"):
        raise ill_typed(f"weights must be a mapping of names to weights, or 'mass', not {quote(weights)}")
    _check_names(layout, weights, fixed)
    if not layout.n_c:
        return np.asarray(module.project(state, t=t))
    q = _positions(module, state[: layout.n_q], t, weights, fixed)
    return np.concatenate([q, _velocities(module, q, state[layout.n_q :], t, weights, fixed)])


def _check_names(layout: Layout, weights: Mapping[str, float] | str | None, fixed: Sequence[str]) -> None:
    raw = () if weights is None or isinstance(weights, str) else read_names("weights", weights)
    allowed = tuple(dict.fromkeys((*layout.velocity_labels, *layout.v)))
    for place, names in (("weights", raw), ("hold", fixed)):
        check_names("coordinate or velocity", names, allowed, place=place)
    if isinstance(weights, Mapping):
        for name, weight in weights.items():
            if not weight > 0.0:
                raise off_range(f"weights: that of {name} must be positive, not {weight}; hold= keeps a value exactly")


def _metric(
    module: BoundModel, q: Array, t: float, weights: Mapping[str, float] | str | None, names: Sequence[str]
) -> Array:
    """The lower triangle L of W = L L^T; by default 1 over the square of each coordinate's scale."""
    layout = module.layout
    if weights == "mass":
        try:
            return np.asarray(np.linalg.cholesky(module.kernels.mass_matrix(q, t=t)))
        except np.linalg.LinAlgError:
            raise UsageError(
                "weights='mass' needs a positive definite mass matrix of the tree, and this one is not: a body has no "
                "mass, or a negative inertia; give weights={name: weight}",
                code="EG-NO-INERTIA",
            ) from None
    factors = np.ones(layout.n_v)
    if isinstance(weights, Mapping):
        for i, (freedom, name) in enumerate(zip(layout.velocity_labels, names, strict=True)):
            factors[i] = weights.get(name, weights.get(freedom, 1.0))
    return np.diag(np.sqrt(factors) / layout.scales.q)


def _positions(
    module: BoundModel, start: Array, t: float, weights: Mapping[str, float] | str | None, fixed: Sequence[str]
) -> Array:
    """The q nearest to the start with C(q, t) = 0."""
    layout = module.layout
    start = start if layout.space is None else layout.space.normalized(start)
    free = np.array([name not in fixed for name in layout.velocity_labels])
    n_h = layout.n_h
    if not n_h:
        return start
    L = _metric(module, start, t, weights, layout.velocity_labels)[np.ix_(free, free)]
    scales, metric = layout.scales, np.zeros((layout.n_v, len(L)))
    metric[free] = algebra.inv(L.T) / scales.q[free, None]
    system = ClosureSystem(constraint_system(module.kernels).at(t).position, scales, free.astype(float))

    def nearest(q: Array) -> Array | None:
        """The nearest closed position to first order, None if there is none near by."""
        q, residual = close(system, q, CLOSING, DAMPING, metric)
        return q if closed(residual) else None

    def change(q: Array) -> Array:
        return np.asarray(L.T @ (scales.q * scales.distance(q, start))[free])

    q = nearest(start)
    if q is None and not fixed:  # the metric leads astray far from the constraints: begin at the projection
        q = nearest(np.asarray(module.project(np.concatenate([start, np.zeros(layout.n_v)]), t=t))[: layout.n_q])
    if q is None:
        kept = f" with {', '.join(fixed)} held" if fixed else ""
        C = system.evaluate(start)[0]
        worst = layout.constraint_labels[int(np.abs(C).argmax())]
        raise ProjectionError(
            f"no consistent position was found{kept}: in the state given, the residual of the constraint {worst} is "
            f"{largest(C):.2g} (scaled)"
        )
    share = 1.0
    for _ in range(STEPS if free.any() else 0):
        _, sizes, Vt = algebra.svd(system.evaluate(q)[1] @ metric, full_matrices=False)
        normal = Vt[sizes > RANK * sizes[0]]
        y = change(q)
        slope = y - normal.T @ (normal @ y)
        step = -share * (metric @ slope)
        if largest(step) <= share * NEAREST:
            break
        trial = nearest(scales.move(q, step * min(1.0, LONGEST / largest(step))))
        if trial is not None and float(change(trial) @ change(trial)) < float(y @ y):
            q, share = trial, min(1.0, 2.0 * share)
        elif share < NEAREST:
            break
        else:
            share *= 0.5
    return q


def _velocities(
    module: BoundModel, q: Array, v: Array, t: float, weights: Mapping[str, float] | str | None, fixed: Sequence[str]
) -> Array:
    """The v nearest to the given ones that the constraints allow."""
    layout, scales = module.layout, module.layout.scales
    free = np.array([name not in fixed for name in layout.v])
    L = _metric(module, q, t, weights, layout.v)[np.ix_(free, free)]
    J = module.kernels.constraint_jacobian(q, t=t)[:, free] / scales.c[:, None]
    J = algebra.solve(L, J.T).T
    sizes = np.linalg.norm(J, axis=1)
    sizes = np.where(sizes > RANK * sizes.max(initial=0.0), sizes, np.inf)
    J = J / sizes[:, None]  # rows alike, so that the Tikhonov term weighs all in the same way
    v, before = np.array(v), np.inf
    for _ in range(PASSES):
        rate = module.velocity_constraints(np.concatenate([q, v]), t=t, rows="all") / scales.c
        if largest(rate) == 0.0 or not largest(rate) < before or not J.any():
            break
        before = largest(rate)
        v[free] += algebra.solve(L.T, least(J, -rate / sizes))
    rate = module.velocity_constraints(np.concatenate([q, v]), t=t, rows="all") / scales.c
    if largest(rate) > ACCEPTED * max(1.0, scales.speed(v)):
        worst = layout.constraint_labels[int(np.abs(rate).argmax())]
        kept = f" with {', '.join(fixed)} held" if fixed else ""
        raise ProjectionError(
            f"no consistent velocities were found{kept}: the rate of the constraint {worst} stays {largest(rate):.2g}"
        )
    return v
