"""Analysis: a position at rest -> the generalized forces along its degrees of freedom, and how they change.

The principle of virtual work (A. A. Shabana, Computational Dynamics, "virtual work in static analysis"): B^T Q = 0 for
all virtual displacements B that the constraints allow, Q all forces of the model at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.limits.analyses import DISPLACED
from ..base.limits.constraints import STATE
from ..base.limits.numbers import TINY
from ..numeric.partitions import Partition, partition
from ..numeric.ranks import rank
from ..runtime.derivative_calls import assembly_jacobian
from .tangent import find_tangent

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


class Balance(NamedTuple):
    """A position at rest, with k of its coordinates held or none.

    Rest means that the independent velocities are 0.  Nonholonomic rows A(q) v + b(q) = 0 leave more displacements
    than velocities, and b gives the surplus ones a velocity, which vanishes in an equilibrium.
    """

    x: Array  #: (n_x,) independent velocities 0
    velocities: Indices  #: (n_dof - k,) independent velocities
    B: Array  #: (n_v, n_dof - k) virtual displacements of the tree
    positions: Indices  #: (n_z,) independent displacements, at least as many
    Z: Array  #: (n_v, n_z) displacements of the tree that the holonomic rows allow
    surplus: Indices  #: displacements, held or not, whose velocities follow from others
    a: Array  #: (n_v,) accelerations of the tree when let go, nothing held
    forces: Array  #: (n_dof - k,) B^T Q
    tree: Array  #: (n_v,) Q of the tree
    size: float  #: largest entry of Q, scaled, to compare with
    n_states: int  #: first-order states, which count as displacements whose accelerations are their rates

    @property
    def v(self) -> Array:
        """(n_v,) velocities that the constraints enforce, 0 for first-order states."""
        v = np.array(self.x[len(self.x) - len(self.a) :])
        v[len(v) - self.n_states :] = 0.0
        return v


def balance_forces(
    module: BoundModel,
    t: float,
    q: Array,
    s: Array,
    held: Array | None = None,
    preferred: Indices | None = None,
) -> Balance:
    """The forces at a position on the constraints.

    Where constraints move in time the velocities are those that they enforce, and the forces are those of that motion.

    Parameters
    ----------
    module : BoundModel
    t : float
    q : (n_q,) array
    s : (n_s,) array
        First-order states.
    held : (k, n_v) array, optional
        Gradients of held coordinates by displacements, which no virtual displacement may change.
    preferred : (n_dof,) indices, optional
    """
    layout = module.layout
    scales, n_q, n_h, order = layout.scales, layout.n_q, layout.n_h, layout.independent
    rest = np.concatenate([q, np.zeros(layout.n_v - len(s)), s])
    J = scales.jacobian(module.kernels.constraint_jacobian(q, t=t, rows="all"))
    split = partition(J, layout.rank, order if preferred is None else preferred)
    rate = scales.residual(module.velocity_constraints(rest, t=t, rows="all"))
    x = np.concatenate([q, scales.q * split.particular(-rate)])
    x[len(x) - len(s) :] = s
    a = module.rhs(t, x)[n_q:]
    if rate.any():
        tree = module.kernels.mass_matrix(q, t=t) @ a
    else:  # nothing moves: no mass matters
        tree = -module.kernels.bias(t, x)
    wider = _displacements(J[:n_h], split.independent) if n_h < layout.n_c else split
    surplus = np.setdiff1d(wider.independent, split.independent)
    if held is not None and len(held):
        holding = unit_rows(held * scales.q)
        stacked = np.vstack([J, holding])
        split = partition(stacked, rank(stacked).rank, order if preferred is None else preferred)
        wider = _displacements(np.vstack([J[:n_h], holding]), split.independent) if n_h < layout.n_c else split
    B, Z = (scales.q[:, None] * one.B / scales.q[one.independent] for one in (split, wider))
    size = float(np.abs(scales.q * tree).max(initial=0.0))
    return Balance(x, split.independent, B, wider.independent, Z, surplus, a, B.T @ tree, tree, size, len(s))


def _displacements(J: Array, velocities: Indices) -> Partition:
    """The independent displacements of scaled holonomic rows, independent velocities first."""
    others = np.setdiff1d(np.arange(J.shape[1]), velocities)
    return partition(J, rank(J).rank, np.concatenate([velocities, others]))


def unit_rows(rows: Array) -> Array:
    """Rows of length 1, so that all balance_forces alike."""
    return np.asarray(rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), TINY))


class BalanceSlopes(NamedTuple):
    """How the accelerations of the tree at rest change, and the velocities that constraints enforce."""

    Z: Array  #: (n_v, n_z) independent displacements
    by_position: Array  #: (n_v, n_z) accelerations along them
    rates: Array  #: (n_v, n_z) velocities along them
    by_unknown: Array  #: (n_v, k) accelerations for unit changes of the unknowns
    motion: Array  #: (n_v, k) displacements that these take along


def slopes(
    module: BoundModel,
    t: float,
    x: Array,
    held: Array,
    held_by: Array,
    parameters: Sequence[int],
    inputs: Sequence[int],
) -> BalanceSlopes:
    """Exact derivatives of the accelerations and velocities at rest by displacements, parameters and inputs.

    Parameters
    ----------
    module : BoundModel
    t : float
    x : (n_x,) array
    held : (k_h, n_v) array
        Gradients of held coordinates by displacements: unknowns leave them where they are.
    held_by : (k_h, n_p) array
        Their derivatives by the parameters, for coordinates of cut joints.
    parameters, inputs : sequences of int
        The unknowns.
    """
    layout = module.layout
    n_q, n_h, scales = layout.n_q, layout.n_h, layout.scales
    J = module.jacobian(t, x)
    tangent = find_tangent(module, t, x, J, states=True)
    P = module.parameter_jacobian(t, x)[:, list(parameters)]
    U = module.input_jacobian(t, x)[:, list(inputs)]
    by_unknown = np.hstack([P, U])[n_q:]
    motion = np.zeros_like(by_unknown, shape=(layout.n_v, by_unknown.shape[1]))
    if len(parameters) and n_h:
        moved = assembly_jacobian(module, t, x)[:n_h, layout.n_x + layout.n_u :][:, list(parameters)]
        C_q = module.kernels.constraint_jacobian(x[:n_q], t=t, rows="all")[:n_h]
        stacked = np.vstack([scales.jacobian(C_q), held * scales.q])
        wanted = np.vstack([moved / scales.c[:n_h, None], held_by[:, list(parameters)]])
        step = -algebra.lstsq(stacked, wanted, rcond=STATE)
        motion[:, : len(parameters)] = scales.q[:, None] * step
        by_unknown = by_unknown + (J[:, :n_q] @ scales.rates(x[:n_q], motion))[n_q:]
    along = tangent.T[:, : tangent.Z.shape[1]]
    rates = np.array(along[n_q:])
    rates[layout.n_v - len(layout.states) :] = 0.0
    return BalanceSlopes(tangent.Z, (J @ along)[n_q:], rates, by_unknown, motion)


def force_slopes(
    module: BoundModel, t: float, here: Balance, gradients: Callable[[Array], Array], step: float = DISPLACED
) -> tuple[Array, Array]:
    """Changes of the forces (n_dof - k, n_z) and of the enforced velocities (n_v, n_z) along the columns of Z.

    Central differences at closed positions.

    Parameters
    ----------
    module : BoundModel
    t : float
    here : Balance
    gradients : callable
        q -> gradients of the held coordinates, as for :func:`balance_forces`.
    step : float
        Scaled displacement.
    """
    layout, scales = module.layout, module.layout.scales
    forces, rates = [], []
    moving, s = layout.n_v - here.n_states, here.x[layout.n_x - here.n_states :]
    for k, column in zip(here.positions, here.Z.T, strict=True):
        h, sides = step * (scales.q[k] if k < moving else max(1.0, abs(s[k - moving]))), []
        for sign in (1.0, -1.0):
            q = scales.move(here.x[: layout.n_q], sign * h * column / scales.q)
            q = module.project(np.concatenate([q, np.zeros(layout.n_v)]), t=t)[: layout.n_q]
            there = s + sign * h * column[moving:]
            sides.append(balance_forces(module, t, q, there, gradients(q), here.velocities))
        forces.append((sides[0].forces - sides[1].forces) / (2.0 * h))
        rates.append((sides[0].v - sides[1].v) / (2.0 * h))
    width = len(here.positions)
    return np.array(forces).reshape(width, len(here.velocities)).T, np.array(rates).reshape(width, layout.n_v).T
