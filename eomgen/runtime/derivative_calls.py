"""Stage runtime: the calls of a Module that differentiate the inverse dynamics, and that differentiate twice."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import NonFiniteError, PartitionError, SingularMassMatrixError, ill_shaped
from ..numeric.scales import Array
from .refusals import refuse_reaction_laws, refuse_states, require_velocities
from .room import read_numbers

if TYPE_CHECKING:
    from .bound_model import BoundModel

UNSOUND = (
    "second derivatives of a right-hand side with constraints are taken from a solution without pivots, which is not "
    "accurate at this state, such as near a change point or where hardly any inertia is left; "
    "take mixed differences of rhs, or differences of jacobian in directions along the constraints"
)


class InverseDynamicsDerivatives(NamedTuple):
    """Derivatives of the generalized forces of the inverse dynamics, each at fixed other arguments."""

    dtau_dq: Array  #: (n_v, n_q)
    dtau_dv: Array  #: (n_v, n_v)
    dtau_da: Array  #: (n_v, n_v), the mass matrix


def inverse_dynamics_derivatives(
    module: BoundModel,
    /,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    p: ArrayLike | None = None,
    u: ArrayLike | None = None,
    out: Array | None = None,
    t: ArrayLike = 0.0,
) -> InverseDynamicsDerivatives:
    """Differentiate the generalized forces ``inverse_dynamics(q, v, a)`` by q, by v and by a, each at fixed others.

    Parameters
    ----------
    q, v, a : (n_q,), (n_v,), (n_v,) arrays, or with a last axis k
        Coordinates, velocities and accelerations of the spanning tree.
    p, u : arrays, optional
    out : (n_v, n_q + 2 n_v) array, optional
        Where all three are written side by side; the results are views of it.
    t : float or (k,) array

    Returns
    -------
    InverseDynamicsDerivatives
        ``dtau_dq`` (n_v, n_q), ``dtau_dv`` and ``dtau_da`` (n_v, n_v); the last is the mass matrix.  Columns of Euler
        parameters are partial derivatives by the four numbers: along a rotation with angular velocity w they combine
        as ``dtau_dq @ dq`` with the change dq = N(q) w of q at that velocity.

    Raises
    ------
    UnavailableError
        The model has first-order states.
    """
    refuse_states(module.layout, "inverse_dynamics_derivatives")
    refuse_reaction_laws(module.layout, "inverse_dynamics_derivatives")
    n_q, n_v = module.n_q, module.n_v
    every = _kept(module, "motion", "inverse_dynamics_derivatives")(q, v, a, p, u, out, t)
    return InverseDynamicsDerivatives(every[:, :n_q], every[:, n_q : n_q + n_v], every[:, n_q + n_v :])


def inverse_dynamics_hessian_product(
    module: BoundModel,
    /,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    weights: ArrayLike,
    direction: ArrayLike,
    p: ArrayLike | None = None,
    u: ArrayLike | None = None,
    t: ArrayLike = 0.0,
) -> Array:
    """Multiply the weighted sum of the Hessians of the inverse dynamics by a direction.

    With z = [q; v; a] and J = d(inverse_dynamics)/dz it is the derivative of J(z + e direction)^T weights by e at
    e = 0, which is ``sum_i weights[i] H_i direction`` with the Hessians H_i of the single forces.

    Parameters
    ----------
    q, v, a : (n_q,), (n_v,), (n_v,) arrays, or with a last axis k
    weights : (n_v,) array
        One for each generalized force.
    direction : (n_q + 2 n_v,) array
        [dq; dv; da].
    p, u : arrays, optional
    t : float or (k,) array

    Returns
    -------
    (n_q + 2 n_v,) or (n_q + 2 n_v, k) array

    Raises
    ------
    UnavailableError
        The model has first-order states.
    """
    refuse_states(module.layout, "inverse_dynamics_hessian_product")
    refuse_reaction_laws(module.layout, "inverse_dynamics_hessian_product")
    n_q, n_v = module.n_q, module.n_v
    given = zip("qva", (q, v, a), (n_q, n_v, n_v), strict=True)
    x = _stacked([*given, ("weights", weights, n_v), ("direction", direction, n_q + 2 * n_v)])
    return np.asarray(_kept(module, "state", "inverse_dynamics_hessian_product")(x, p, u, None, t))


def rhs_hessian_product(
    module: BoundModel,
    /,
    t: ArrayLike,
    x: ArrayLike,
    weights: ArrayLike,
    direction: ArrayLike,
    p: ArrayLike | None = None,
    u: ArrayLike | None = None,
) -> Array:
    """Multiply the weighted sum of the Hessians of the right-hand side by a direction.

    With z = [x; u] and J = d(rhs)/dz it is the derivative of J(z + e direction)^T weights by e at e = 0, which is
    ``sum_i weights[i] H_i direction`` with the Hessians H_i of the single rates.  With constraints the projection of x
    is part of the right-hand side and is differentiated too, in directions off the constraints as well; the result is
    that at the projected state.

    Parameters
    ----------
    t : float or (k,) array
    x : (n_x,) or (n_x, k) array
    weights : (n_x,) array
        One for each entry of x'.
    direction : (n_x,) or (n_x + n_u,) array
        Changes of x, or of x and u.
    p, u : arrays, optional

    Returns
    -------
    array
        As long as the direction; with a last axis k for batches.

    Raises
    ------
    UnavailableError
        The rates of the model are given, or its constraints are solved with pivots only.
    EvaluationError
        The solution without pivots is not accurate at this state, such as near a change point.
    """
    layout = module.layout
    require_velocities(layout)
    d, n_x, n = read_numbers("direction", direction), layout.n_x, layout.n_x + layout.n_u
    if layout.n_c:
        x = module.project(x, t, p, u)
    parts = [("x", x, n_x), ("weights", weights, n_x)]
    if whole := d.shape[:1] != (n_x,):
        parts.append(("direction", d, n))
    else:
        parts += [("direction", d, n_x), ("direction", np.zeros(n - n_x), n - n_x)]
    kernel = _kept(module, "timed", "rhs_hessian_product")
    try:
        found = np.asarray(kernel(t, _stacked(parts), p, u))
    except (SingularMassMatrixError, NonFiniteError) as error:
        time, here, now = float(error.time or 0.0), np.asarray(error.state)[:n_x], None if u is None else np.asarray(u)
        alone = now is None or now.ndim == 1
        if not layout.n_c or (alone and not np.isfinite(module.rhs(time, here, p, now)).all()):
            raise
        raise PartitionError(f"rhs_hessian_product at t = {time:.6g}: {UNSOUND}", time, here) from error
    return found if whole else found[:n_x]


def _kept(module: BoundModel, maker: str, name: str) -> Any:
    """A kernel, made at the first call and kept with the module's others."""
    kept = module.kernels.__dict__.setdefault("_kept", {})
    if name not in kept:
        kept[name] = getattr(module.kernels, maker)(name)
    return kept[name]


def _stacked(parts: list[tuple[str, Any, int]]) -> Array:
    """Arguments one below the other; those of one state are repeated for every column of a batch."""
    read = [(name, read_numbers(name, value), n) for name, value, n in parts]
    columns = max((x.shape[1:] for _, x, _ in read), key=len)
    for name, x, n in read:
        if x.shape not in ((n,), (n, *columns)) or x.ndim > 2:
            batch = columns[0] if columns else "k"
            raise ill_shaped(f"{name} must have shape ({n},) or ({n}, {batch}), not {x.shape}")
    return np.concatenate(
        [x if x.shape[1:] == columns else np.repeat(x[:, None], columns[0], axis=1) for _, x, _ in read]
    )
