"""Stage numeric: an assembled position, some velocities -> all velocities, consistent with the constraints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import AssemblyError, UnavailableError
from ..limits.constraints import CONTRADICTION, GIVEN
from . import algebra
from .scales import Array, Indices, Scales


class VelocityEquations(NamedTuple):
    """Rates y' = y_q v + y_t wanted for functions y(q), such as the coordinates of cut joints."""

    y_q: Array  #: (k, n)
    y_t: Array  #: (k,)
    values: Array  #: (k,) or (k, m) wanted
    scales: Array  #: (k,)
    names: Sequence[str]  #: (k,) for messages


class Rates(NamedTuple):
    """Assembled velocities."""

    v: Array  #: (n,) or (n, m)
    residual: float  #: largest scaled residual


@np.errstate(all="ignore")
def assemble_velocity(
    C_q: Array,
    C_t: Array,
    scales: Scales,
    guess: Array | None = None,
    held: Sequence[int] | Indices = (),
    equations: VelocityEquations | None = None,
    names: Sequence[str] = (),
    labels: Sequence[str] = (),
) -> Rates:
    """Velocities with C_q v + C_t = 0, nearest to a guess.

    Parameters
    ----------
    C_q : (m, n) array
        Constraint Jacobian at the assembled position, all rows.
    C_t : (m,) array
    scales : Scales
    guess : (n,) or (n, m) array, optional
        Zero by default; the held velocities have their exact values here.  m columns are m motions at this position.
    held : sequence of int
        Velocities that are held exactly.
    equations : VelocityEquations, optional
        Rates of functions of q to reach exactly.
    names, labels : sequences of str
        Names of the velocities (n,) and of the constraint rows (m,), for messages.

    Returns
    -------
    Rates

    Raises
    ------
    AssemblyError
        The given velocities contradict the constraints or each other.
    """
    v = np.zeros(C_q.shape[1]) if guess is None else np.array(guess, dtype=float)
    held = np.asarray(held, dtype=np.intp)
    free = np.ones(len(v), dtype=bool)
    free[held] = False
    column = (slice(None), *[None] * (v.ndim - 1))
    size, J, offset = scales.q[column], scales.jacobian(C_q), (C_t / scales.c)[column]
    if equations is not None:
        J = np.vstack([J, equations.y_q * scales.q / equations.scales[:, None]])
        wanted = (equations.y_t[column] - equations.values) / equations.scales[column]
        offset = np.concatenate([np.broadcast_to(offset, (len(C_t), *v.shape[1:])), wanted])
    inverse = algebra.pinv(J[:, free], rcond=GIVEN)
    for _ in range(2):
        v[free] -= size[free] * (inverse @ (J @ (v / size) + offset))
    e = J @ (v / size) + offset
    rates = np.concatenate([scales.moving(v), np.broadcast_to(offset, e.shape)])
    speed = np.abs(rates).max(axis=0, initial=1.0)
    bad = ~(np.abs(e).max(axis=0, initial=0.0) <= CONTRADICTION * speed)
    if not bad.any():
        return Rates(v, float(np.abs(e).max(initial=0.0)))
    if v.ndim > 1:  # the first that cannot be says why
        k = int(np.argmax(bad))
        one = None if equations is None else equations._replace(values=equations.values[:, k])
        return assemble_velocity(C_q, C_t, scales, v[:, k], held, one, names, labels)
    try:
        from .assembly_failure import describe_contradiction
    except UnavailableError:
        raise AssemblyError("the given velocities are inconsistent with the constraints; give others") from None
    given = {names[i] if names else f"v[{i}]": v[i] for i in held}
    row_scales, all_labels = scales.c, list(labels) or [f"C[{i}]" for i in range(len(C_t))]
    if equations is not None:
        given |= dict(zip(equations.names, equations.values, strict=True))
        row_scales, all_labels = np.concatenate([row_scales, equations.scales]), [*all_labels, *equations.names]
    raise AssemblyError(describe_contradiction(given, e, row_scales, all_labels, CONTRADICTION * speed, J[: len(C_t)]))
