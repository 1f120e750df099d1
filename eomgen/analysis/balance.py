"""A state -> its independent directions; a position at rest -> the generalized forces along them.

The principle of virtual work (A. A. Shabana, Computational Dynamics, "virtual work in static analysis"): B^T Q = 0 for
all virtual displacements B that the constraints allow, Q all forces of the model at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices, Partition, partition, rank
from ..base.limits.constraints import STATE
from ..base.limits.numbers import TINY
from ..base.scales import tangent_projector
from ..errors import ill_chosen
from ..runtime.argument_checks import check_names, read_names
from .limits import DISPLACED

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.layout import Layout

# -- independent directions --------------------------------------------------------------------------------------------

# Displacements are measured by the velocities that make them in unit time: changes of coordinates where q' = v, small
# rotations about body axes for Euler parameters.  Nonholonomic rows restrict velocities and not displacements, so that
# there may be more independent displacements than velocities.


class TangentSpace(NamedTuple):
    """Directions of a state x = [q; v] on the constraints; n_z displacements, n_dof velocities."""

    positions: Indices  #: (n_z,) independent displacements, as indices of velocities
    velocities: Indices  #: (n_dof,) independent velocities
    Z: Array  #: (n_v, n_z) displacements of the tree for unit independent ones
    B: Array  #: (n_v, n_dof) velocities of the tree for unit independent ones
    T: Array  #: (n_x, n_z + n_dof) changes of x for unit changes of the independent ones


def displacement_names(layout: Layout) -> tuple[str, ...]:
    """What the displacement of each velocity is called: its coordinate, or ``<joint>_rx`` for an angular velocity."""
    return tuple(f"{n[:-2]}r{n[-1]}" if n == layout.v[k] else n for k, n in enumerate(layout.velocity_labels))


def find_tangent(
    module: BoundModel,
    t: float,
    x: Array,
    jacobian: Array,
    independent: Sequence[str] | None = None,
    states: bool = False,
) -> TangentSpace:
    """The independent directions at a state on the constraints.

    Parameters
    ----------
    x : (n_x,) array
    jacobian : (n_x, n_x) array
        dx'/dx there.
    independent : sequence of str, optional
        n_dof coordinates or velocities to take; by default those of the model as far as they serve here.
    states : bool, optional
        Whether changes of first-order states count among the displacements; they are among the velocities anyway.

    Raises
    ------
    PartitionError
        The rank of the constraints drops here, or the chosen ones cannot move the mechanism.
    UsageError
        An unknown name, or a wrong number of them.
    """
    layout = module.layout
    scales, n_q, n_h = layout.scales, layout.n_q, layout.n_h
    preferred = layout.independent if independent is None else choose_velocities(layout, independent)
    strict = independent is not None
    C_q = module.kernels.constraint_jacobian(x[:n_q], t=t)
    J = scales.jacobian(C_q)
    B, velocities = null_basis(J, layout.rank, preferred, strict, scales.q)
    if n_h == layout.n_c:
        Z, positions = B, velocities
    else:  # the others follow in their order, so that as many as possible have the names of velocities
        order = np.concatenate([velocities, np.setdiff1d(np.arange(layout.n_v), velocities)])
        Z, positions = null_basis(J[:n_h], rank(J[:n_h]).rank, order, False, scales.q)
    moving = layout.n_v - len(layout.states)
    Z, positions = (Z, positions) if states else (Z[:, positions < moving], positions[positions < moving])
    dq = scales.rates(x[:n_q], Z)
    dv = _velocity_change(layout, x, jacobian[:n_q, :n_q] @ dq, dq)
    dv = dv - B @ dv[velocities]  # the independent velocities stay
    dv[moving:] = Z[moving:]
    T = np.block([[dq, np.zeros((n_q, B.shape[1]))], [dv, B]])
    return TangentSpace(positions, velocities, Z, B, T)


def choose_velocities(layout: Layout, names: Sequence[str]) -> Indices:
    """Indices of n_dof velocities from their names or those of their coordinates."""
    moving, count = layout.n_v - len(layout.states), layout.n_dof - len(layout.states)
    allowed = dict.fromkeys((*layout.velocity_labels[:moving], *layout.v[:moving]))
    names = read_names("independent", names)
    check_names("coordinate of the tree", names, allowed)
    chosen = [(layout.velocity_labels if name in layout.velocity_labels else layout.v).index(name) for name in names]
    if len(set(chosen)) != count or len(chosen) != count:
        raise ill_chosen(f"independent must name {count} different coordinates, not {', '.join(names)}")
    return np.array([*chosen, *range(moving, layout.n_v)], dtype=np.intp)


def null_basis(J: Array, count: int, preferred: Indices, strict: bool, s: Array) -> tuple[Array, Indices]:
    """Basis of the null space of scaled rows, in the units of sizes s (n,), and the columns independent in it."""
    split = partition(J, count, preferred, strict)
    return s[:, None] * split.B / s[split.independent], split.independent


def _velocity_change(layout: Layout, x: Array, rates: Array, dq: Array) -> Array:
    """The dv (n_v, k) of the projected v behind changes of q'."""
    space, q, v = layout.space, x[: layout.n_q], x[layout.n_q :]
    if space is None:
        return rates
    return space.velocities(q, rates - space.change(q, dq, v[:, None], np.zeros((len(v), dq.shape[1]))))


def displacement_rates(layout: Layout, x: Array, rates: Array, displacements: Array) -> Array:
    """Rates (n_v, k) of displacements from changes of q' (n_q, k), in axes that move with the state.

    Small rotations r about body axes change by r x w besides what the change of the angular velocity does.
    """
    space = layout.space
    if space is None:
        return rates
    result = space.velocities(x[: layout.n_q], rates)
    for _, j in space.quaternion_slots:
        w = x[layout.n_q + j : layout.n_q + j + 3]
        result[j : j + 3] += 0.5 * np.cross(displacements[j : j + 3], w, axisa=0, axisb=0, axisc=0)
    return result


def projected_directions(module: BoundModel, t: float, x: Array, jacobian: Array) -> Array:
    """Derivative (n_x, n_x) of the projected state by the state, at a state on the constraints."""
    layout = module.layout
    n_q, scales, space = layout.n_q, layout.scales, layout.space
    if not layout.n_c:
        return np.eye(layout.n_x)
    q = x[:n_q]
    dz = tangent_projector(module.kernels.constraint_jacobian(q, t=t)[: layout.n_h], scales)
    unit = np.eye(n_q)
    if space is None:
        dq = dz
    else:
        dq = np.asarray(space.rates(q, dz @ space.velocities(q, unit)) + space.stretch(q, unit))
    dq = np.hstack([dq, np.zeros((n_q, layout.n_v))])
    result = np.vstack([dq, _velocity_change(layout, x, jacobian[:n_q], dq)])
    of_states = slice(layout.n_x - len(layout.states), None)
    result[of_states, of_states] = np.eye(len(layout.states))
    return result


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
    fixed: Array | None = None,
    preferred: Indices | None = None,
) -> Balance:
    """The forces at a position on the constraints.

    Where constraints move in time the velocities are those that they enforce, and the forces are those of that motion.

    Parameters
    ----------
    q : (n_q,) array
    s : (n_s,) array
        First-order states.
    fixed : (k, n_v) array, optional
        Gradients of held coordinates by displacements, which no virtual displacement may change.
    preferred : (n_dof,) indices, optional
    """
    layout = module.layout
    scales, n_q, n_h, order = layout.scales, layout.n_q, layout.n_h, layout.independent
    rest = np.concatenate([q, np.zeros(layout.n_v - len(s)), s])
    J = scales.jacobian(module.kernels.constraint_jacobian(q, t=t))
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
    if fixed is not None and len(fixed):
        holding = unit_rows(fixed * scales.q)
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
    fixed: Array,
    held_by: Array,
    parameters: Sequence[int],
    inputs: Sequence[int],
) -> BalanceSlopes:
    """Exact derivatives of the accelerations and velocities at rest by displacements, parameters and inputs.

    Parameters
    ----------
    x : (n_x,) array
    fixed : (k_h, n_v) array
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
        moved = module.kernels.assembly_jacobian(x, t=t)[:n_h, layout.n_x + layout.n_u :][:, list(parameters)]
        C_q = module.kernels.constraint_jacobian(x[:n_q], t=t)[:n_h]
        stacked = np.vstack([scales.jacobian(C_q), fixed * scales.q])
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
