"""Analysis: a state -> the independent directions in which it can change without leaving the constraints.

Displacements are measured by the velocities that make them in unit time: changes of coordinates where q' = v, small
rotations about body axes for Euler parameters.  Nonholonomic rows restrict velocities and not displacements, so that
there may be more independent displacements than velocities.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base.algebra import Array, Indices
from ..errors import ill_chosen
from ..numeric.partitions import partition
from ..numeric.projection import tangent_projector
from ..numeric.ranks import rank
from ..numeric.scales import Scales
from ..runtime.near_names import read_names, unknown

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.layout import Layout


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
    module : BoundModel
    t : float
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
    C_q = module.kernels.constraint_jacobian(x[:n_q], t=t, rows="all")
    J = scales.jacobian(C_q)
    B, velocities = _basis(J, layout.rank, preferred, strict, scales)
    if n_h == layout.n_c:
        Z, positions = B, velocities
    else:  # the others follow in their order, so that as many as possible have the names of velocities
        order = np.concatenate([velocities, np.setdiff1d(np.arange(layout.n_v), velocities)])
        Z, positions = _basis(J[:n_h], rank(J[:n_h]).rank, order, False, scales)
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
    chosen, names = [], read_names("independent", names)
    for name in names:
        if name not in allowed:
            raise unknown("coordinate of the tree", name, allowed)
        chosen.append((layout.velocity_labels if name in layout.velocity_labels else layout.v).index(name))
    if len(set(chosen)) != count or len(chosen) != count:
        raise ill_chosen(f"independent must name {count} different coordinates, not {', '.join(names)}")
    return np.array([*chosen, *range(moving, layout.n_v)], dtype=np.intp)


def _basis(
    J: Array, count: int, preferred: Sequence[int] | Indices, strict: bool, scales: Scales
) -> tuple[Array, Indices]:
    """Basis of the null space of scaled rows, in units, and the columns that are independent in it."""
    split = partition(J, count, preferred, strict)
    return scales.q[:, None] * split.B / scales.q[split.independent], split.independent


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
    dz = tangent_projector(module.kernels.constraint_jacobian(q, t=t, rows="all")[: layout.n_h], scales)
    unit = np.eye(n_q)
    if space is None:
        dq = dz
    else:
        dq = np.asarray(space.rates(q, dz @ space.velocities(q, unit)) + space.stretch(q, unit))
    dq = np.hstack([dq, np.zeros((n_q, layout.n_v))])
    found = np.vstack([dq, _velocity_change(layout, x, jacobian[:n_q], dq)])
    own = slice(layout.n_x - len(layout.states), None)
    found[own, own] = np.eye(len(layout.states))
    return found
