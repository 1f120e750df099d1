"""Stage numeric: residuals along changes of inputs or parameters -> the derivative of the right-hand side by them.

Implicit differentiation of ``M a + h + C_q^T l = 0``, ``C_q a + gamma = 0`` at the projected state.  Parameters move
the constraints too; the projection then takes the state along, which counts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..base.algebra import Array, Indices
from ..errors import NonFiniteError
from .embedded import DynamicsSlopes, Terms, accelerate, embed
from .projection import minimum_norm, project
from .scales import Position, Rate, Scales


class Shifts(NamedTuple):
    """Derivatives by k inputs or parameters at fixed q, v, a, l."""

    C: Array  #: (h, k) of the holonomic rows
    r1: Array  #: (n, k) of M a + h + C_q^T l
    r2: Array  #: (m, k) of C_q a + gamma
    r3: Array  #: (m, k) of C_q v + C_t


def shift_jacobian(
    terms: Callable[[Array, Array], Terms],
    residuals: Callable[[Array, Array, Array, Array], DynamicsSlopes],
    shifts: Callable[[Array, Array, Array, Array], Shifts],
    position: Position,
    rate: Rate,
    q: Array,
    v: Array,
    scales: Scales,
    rank: int,
    independent: Sequence[int] | Indices,
) -> Array:
    """Derivative (n_x, k) of :func:`~.embedded.rhs` by inputs or parameters, projection included.

    Parameters
    ----------
    terms, residuals, shifts, position, rate : callables
        (q, v) -> Terms; (q, v, a, l) -> DynamicsSlopes and Shifts; q -> C, C_q; q -> C_t.
    q, v : (n,) arrays
        A state on the manifold, where the result is exact; others are projected first.
    """
    s = scales.q
    q, v = project(position, rate, q, v, scales)
    here = terms(q, v)
    system = embed(here.M, here.C_q, scales, rank, independent, here.indefinite)
    split = system.split
    a = accelerate(here, v, scales, system)
    multipliers = np.zeros(len(here.gamma))
    multipliers[split.rows] = split.multipliers(-s * (here.M @ a + here.h)) / scales.c[split.rows]
    shift = shifts(q, v, a, multipliers)
    columns, held = shift.r1.shape[1], len(shift.C)
    dz, dv = np.zeros((len(v), columns)), np.zeros((len(v), columns))
    r1, r2 = shift.r1, shift.r2
    dq = np.zeros((len(q), columns))
    if len(here.gamma):
        r = residuals(q, v, a, multipliers)
        if held:
            dz = -minimum_norm(here.C_q[:held], shift.C, scales)
            dq = scales.rates(q, dz)
        dv = -minimum_norm(here.C_q, r.r3_q @ dq + shift.r3, scales)
        r1, r2 = r1 + r.r1_q @ dq + r.r1_v @ dv, r2 + r.r2_q @ dq + r.r2_v @ dv
    a_p = split.particular(-r2 / scales.c[:, None])
    da = s[:, None] * (a_p - system.solve(s[:, None] * r1 + system.M @ a_p))
    if not np.isfinite(da).all():
        raise NonFiniteError("the derivative is not finite")
    return np.vstack([dv if scales.space is None else scales.space.change(q, dq, v[:, None], dv), da])
