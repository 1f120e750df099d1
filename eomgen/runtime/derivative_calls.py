"""The call of a Module that differentiates the inverse dynamics."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from numpy.typing import ArrayLike

from ..base.algebra import Array
from .refusals import refuse_reaction_laws, refuse_states

if TYPE_CHECKING:
    from .bound_model import BoundModel


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
    kept = module.kernels.__dict__.setdefault("_kept", {})  # the kernel is made at the first call
    if "inverse_dynamics_derivatives" not in kept:
        kept["inverse_dynamics_derivatives"] = module.kernels.motion("inverse_dynamics_derivatives")
    every = kept["inverse_dynamics_derivatives"](q, v, a, p, u, out, t)
    return InverseDynamicsDerivatives(every[:, :n_q], every[:, n_q : n_q + n_v], every[:, n_q + n_v :])


def assembly_jacobian(module: BoundModel, t: float, x: Array) -> Array:
    """[C, C_q v + C_t, loop coordinates, their rates] by [q, v, u, p]."""
    return module.kernels.state("assembly_jacobian")(x, t=t)


def output_derivatives(module: BoundModel, t: float, x: Array, a: Array) -> Array:
    """Outputs by [q, v, a, u, p], each at fixed others; (n_y, n_x + n_v + n_u + n_p)."""
    n_q = module.n_q
    return module.kernels.motion("output_derivatives")(x[:n_q], x[n_q:], a, t=t)
