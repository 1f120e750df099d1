"""Stage numeric: an assembled position, some velocities -> all velocities, consistent with the constraints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.limits.constraints import CONTRADICTION, GIVEN
from ..errors import AssemblyError
from .scales import Scales


class VelocityEquations(NamedTuple):
    """Rates y' = y_q v + y_t wanted for functions y(q), such as the coordinates of cut joints."""

    y_q: Array  #: (k, n)
    y_t: Array  #: (k,)
    values: Array  #: (k,) or (k, m) wanted
    scales: Array  #: (k,)
    names: Sequence[str]  #: (k,) for messages


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
) -> Array:
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
    (n,) or (n, m) array

    Raises
    ------
    AssemblyError
        The given velocities contradict the constraints or each other.
    """
    v = np.zeros(C_q.shape[1]) if guess is None else np.array(guess, dtype=float)
    free = np.ones(len(v), dtype=bool)
    free[np.asarray(held, dtype=np.intp)] = False
    J, base = scales.jacobian(C_q), C_t / scales.c
    if equations is not None:
        J = np.vstack([J, equations.y_q * scales.q / equations.scales[:, None]])
    inverse = algebra.pinv(J[:, free], rcond=GIVEN)
    for k in np.ndindex(v.shape[1:]):  # column by column, so that each has the bits that it has alone
        x, offset = v[(slice(None), *k)], base
        if equations is not None:
            offset = np.concatenate([base, (equations.y_t - equations.values[(slice(None), *k)]) / equations.scales])
        for _ in range(2):
            x[free] -= scales.q[free] * (inverse @ (J @ (x / scales.q) + offset))
        e = J @ (x / scales.q) + offset
        speed = max([1.0, scales.speed(x), *np.abs(offset)])
        if not np.abs(e).max(initial=0.0) <= CONTRADICTION * speed:
            break
    else:
        return v
    from .assembly_failure import describe_contradiction

    given = {names[i] if names else f"v[{i}]": x[i] for i in held}
    row_scales, all_labels = scales.c, list(labels) or [f"C[{i}]" for i in range(len(C_t))]
    if equations is not None:
        values = equations.values[(slice(None), *k)]
        given |= dict(zip(equations.names, values, strict=True))
        row_scales, all_labels = np.concatenate([row_scales, equations.scales]), [*all_labels, *equations.names]
    raise AssemblyError(
        describe_contradiction(given, e, row_scales, all_labels, CONTRADICTION * speed, J[: len(C_t)]),
        code="EG-CONTRADICTION",
    )
