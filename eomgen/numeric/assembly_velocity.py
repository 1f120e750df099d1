"""Stage numeric: an assembled position, some velocities -> all velocities, consistent with the constraints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import AssemblyError
from ..limits.constraints import CONTRADICTION, GIVEN
from . import algebra
from .ranks import rank
from .scales import Array, Indices, Scales


class VelocityEquations(NamedTuple):
    """Rates y' = y_q v + y_t wanted for functions y(q), such as the coordinates of cut joints."""

    y_q: Array  #: (k, n)
    y_t: Array  #: (k,)
    values: Array  #: (k,) wanted
    scales: Array  #: (k,)
    names: Sequence[str]  #: (k,) for messages


class Rates(NamedTuple):
    """Assembled velocities."""

    v: Array  #: (n,)
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
    guess : (n,) array, optional
        Zero by default; the held velocities have their exact values here.
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
    J, row_scales, offset = scales.jacobian(C_q), scales.c, C_t
    all_labels = list(labels) or [f"C[{i}]" for i in range(len(C_t))]
    if equations is not None:
        J = np.vstack([J, equations.y_q * scales.q / equations.scales[:, None]])
        row_scales = np.concatenate([row_scales, equations.scales])
        offset = np.concatenate([C_t, equations.y_t - equations.values])
        all_labels += list(equations.names)
    inverse = algebra.pinv(J[:, free], rcond=GIVEN)
    for _ in range(2):
        e = J @ (v / scales.q) + offset / row_scales
        v[free] -= scales.q[free] * (inverse @ e)
    e = J @ (v / scales.q) + offset / row_scales
    worst = float(np.abs(e).max()) if e.size else 0.0
    speed = max([1.0, scales.speed(v), *np.abs(offset / row_scales)])
    if worst <= CONTRADICTION * speed:
        return Rates(v, worst)
    velocity_names = names or [f"v[{i}]" for i in range(len(v))]
    given = [f"{velocity_names[i]} = {v[i]:.6g}" for i in held]
    if equations is not None:
        given += [f"{name} = {value:.6g}" for name, value in zip(equations.names, equations.values, strict=True)]
    gaps = e * row_scales
    order = [i for i in np.argsort(-np.abs(e), kind="stable")[:3] if not abs(e[i]) <= CONTRADICTION * speed]
    dof = len(v) - rank(scales.jacobian(C_q)).rank
    where = ", ".join(f"{all_labels[i]} {abs(gaps[i]):.3g}/s" for i in order)
    what = f"the given velocities {', '.join(given)}" if given else "the driven constraints"
    raise AssemblyError(
        f"{what} are inconsistent with {dof} degree{'s' if dof != 1 else ''} of freedom at this position: "
        f"the largest residuals are {where}; give fewer or other velocities"
    )
