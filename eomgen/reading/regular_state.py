"""Stage reading, regular states: matrices at a state that symbols tell -> refusals of states without a linearization.

Symbols that are left have any values, so a matrix is singular there if it is at every one of a few samples of them:
the declared numbers with other positions, then numbers that are made up.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..base import algebra
from ..base.algebra import correlated
from ..base.limits.numbers import LEAST, SINGULAR
from ..errors import NonFiniteError, PartitionError, SingularMassMatrixError
from ..graph.core import Expr
from ..graph.evaluate import evaluate
from ..graph.substitute import symbols_of
from .quantities import Quantities


def require_inverse(quantities: Quantities, mass: Sequence[Sequence[Expr]], at: Mapping[str, Any]) -> None:
    """Refuse a state at which no acceleration of the independent coordinates follows.

    Raises
    ------
    PartitionError
        The mass matrix is not finite: the independent velocities do not tell the others.
    SingularMassMatrixError
        It has no inverse.
    """
    n, mobility = len(mass), quantities.mobility
    if n == 0:
        return
    samples = [np.reshape(x, (n, n)) for x in _samples(quantities, [x for row in mass for x in row])]
    finite = [M for M in samples if np.abs(M).max(initial=0.0) * SINGULAR < 1.0]  # 1/0 is large by rounding
    if samples and not finite:
        names = ", ".join(mobility.independent)
        raise PartitionError(
            f"linearize: the velocities of {names} do not tell the others {told(at)}: constraint_jacobian without "
            "their columns has no inverse there (a dead centre), so mass_matrix is not finite; linearize at another "
            "state, or derive with independent=[...] of another coordinate"
        )
    if not finite or any(_least(M)[0] > LEAST for M in finite):
        return
    motion = np.abs(_least(finite[0])[1])
    still = [name for name, x in zip(mobility.independent, motion, strict=True) if x > 0.1 * motion.max()]
    raise SingularMassMatrixError(
        f"linearize: mass_matrix ({n}, {n}) has no inverse {told(at)}: moving {', '.join(still)} meets no inertia, so "
        "no acceleration follows; linearize at another state, or give the bodies behind the named coordinates mass or "
        "inertia"
    )


def require_finite(
    quantities: Quantities, matrices: Mapping[str, Sequence[Sequence[Expr]]], at: Mapping[str, Any]
) -> None:
    """Refuse a state at which an entry of a matrix has no value.

    Raises
    ------
    NonFiniteError
        It names the first such entry.
    """
    for letter, rows in matrices.items():
        for i, row in enumerate(rows):
            samples = list(_samples(quantities, row))
            for j in range(len(row)):
                if samples and not any(np.isfinite(sample[j]) for sample in samples):
                    raise NonFiniteError(
                        f"linearize: {letter}[{i}, {j}] has no finite value {told(at)}; a force, a constraint or a "
                        "rotation has no derivative there, such as a spring of length 0: linearize at another state"
                    )


def _least(M: Any) -> tuple[float, Any]:
    """The smallest size of an eigenvalue of M with its diagonal scaled to 1, and the motion that belongs to it."""
    values, motions = algebra.eigh(correlated(M))
    k = int(np.abs(values).argmin())
    return float(abs(values[k])), motions[:, k]


def _samples(quantities: Quantities, expressions: Sequence[Expr]) -> Iterator[Any]:
    """The expressions at a few values of their symbols; none where they hold functions that are not known here."""
    if quantities.graph.functions:
        return
    kinematics, left = quantities.kinematics, sorted(symbols_of(expressions))
    places = zip(kinematics.names, quantities.mobility.q_reference, strict=True)
    declared = quantities.numbers | {name: x + 0.3 + 0.1 * k for k, (name, x) in enumerate(places)}
    for first in (0.7, 0.4, 1.3):
        made_up = {name: first + 0.17 * k for k, name in enumerate(left)}
        with np.errstate(all="ignore"):
            yield np.array(evaluate(expressions, made_up | declared if first == 0.7 else made_up), dtype=float)


def told(at: Mapping[str, Any]) -> str:
    """The state in words."""
    return f"at {', '.join(f'{name} = {value}' for name, value in at.items())}" if at else "at any state"
