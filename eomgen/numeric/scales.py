"""Stage numeric: units of coordinates and constraint rows -> the scales that make both dimensionless."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..base.algebra import Array, Indices
from ..base.limits.numbers import ROUNDED
from .space import Space

__all__ = ["Position", "Scales", "Space"]

#: q (n_q,) -> C (h,) of the holonomic rows, C_q (m, n) of all rows, the holonomic ones first
Position: TypeAlias = Callable[[Array], tuple[Array, Array]]


class Scales(NamedTuple):
    """Typical sizes: the length scale L of the mechanism for lengths, 1 for angles; of rows that a user wrote the
    length of their scaled gradient.

    A scaled velocity is ``v / scales.q``, a scaled residual ``C / scales.c``, the scaled Jacobian
    ``C_q * scales.q / scales.c[:, None]``.  Steps and distances of coordinates are measured by the velocities that
    make them, in unit time: the same thing where q' = v, an angle of rotation for Euler parameters.
    """

    q: Array  #: (n,) of the velocities, times a second
    c: Array  #: (m,) of the constraint rows, holonomic ones first
    space: Space | None = None  #: where q' = N(q) v, how coordinates move with velocities
    long: Array | None = None  #: (n,) 1.0 for velocities of lengths, 0.0 for those of angles
    groups: Indices | None = None  #: (m,) of rows, by eomgen/kinematics/row_groups.py; None: all are compared
    known: NDArray[np.bool_] | None = None  #: (m, n) velocities that rows can know; None: all know all

    @classmethod
    def of_kinds(
        cls, velocities: Sequence[str], rows: Sequence[str | float], length: float, space: Space | None = None
    ) -> Scales:
        """Scales from kinds, each ``"angle"`` or ``"length"``, or numbers for rows, and the length scale in metres."""
        unit: dict[str | float, float] = {"length": length}
        return cls(
            np.array([unit.get(kind, 1.0) for kind in velocities]),
            np.array([unit.get(row, 1.0) if isinstance(row, str) else float(row) for row in rows]),
            space,
            np.array([float(kind == "length") for kind in velocities]),
        )

    def jacobian(self, C_q: Array) -> Array:
        """The scaled Jacobian J = diag(1/s_c) C_q diag(s_q), (m, n), of all rows or the first; or (..., m, n)."""
        return C_q * self.q / self.c[: C_q.shape[-2], None]

    def residual(self, C: Array) -> Array:
        """The scaled residual e = C / s_c, (m,), of all rows or the first."""
        return C / self.c[: len(C)]

    def rounding(self, q: Array, J: Array) -> Array:
        """What is left of the scaled residual (m,) by rounding of q alone, as between bodies on an orbit.

        64 eps |J| |q / s|; Euler parameters do not count.
        """
        if self.space is None:
            sizes = np.abs(q) if len(q) == len(self.q) else np.zeros(len(self.q))
        else:
            sizes = np.zeros(len(self.q))
            sizes[self.space.plain_v] = np.abs(q[self.space.plain_q])
        return np.asarray(ROUNDED * np.abs(J) @ (sizes / self.q))

    def move(self, q: Array, dz: Array) -> Array:
        """The coordinates (n_q,) a scaled step (n,) away."""
        return q + self.q * dz if self.space is None else self.space.move(q, self.q * dz)

    def distance(self, a: Array, b: Array) -> Array:
        """The scaled step (n,) from b to a."""
        return np.asarray((a - b if self.space is None else self.space.difference(a, b)) / self.q)

    def rates(self, q: Array, v: Array) -> Array:
        """q' = N(q) v."""
        return v if self.space is None else self.space.rates(q, v)

    def speed(self, v: Array) -> float:
        """The largest scaled velocity of v (n,), first-order states left out."""
        moving = len(self.q) if self.space is None else len(self.q) - self.space.n_states
        return float(np.abs(v[:moving] / self.q[:moving]).max(initial=0.0))

    def row_speeds(self, v: Array) -> Array:
        """The largest scaled velocity that each row can know (m,), first-order states left out."""
        if self.known is None:
            return np.full(len(self.c), self.speed(v))
        return np.asarray((self.known * np.abs(v / self.q)).max(axis=1, initial=0.0))

    def coordinates(self, velocities: Sequence[int] | Indices) -> Indices:
        """The coordinates that stand still when these velocities do."""
        chosen = np.asarray(velocities, dtype=np.intp)
        if self.space is None:
            return chosen
        space = self.space
        found = [int(space.plain_q[np.searchsorted(space.plain_v, k)]) for k in chosen if k in space.plain_v]
        found += [k for i, j in space.quaternion_slots if j in chosen for k in range(i, i + 4)]
        return np.array(found, dtype=np.intp)

    def velocities(self, coordinates: Sequence[int] | Indices) -> Indices:
        """The velocities that move these coordinates; all three for one Euler parameter."""
        chosen = np.asarray(coordinates, dtype=np.intp)
        if self.space is None:
            return chosen
        space = self.space
        found = [int(space.plain_v[np.searchsorted(space.plain_q, k)]) for k in chosen if k in space.plain_q]
        found += [k for i, j in space.quaternion_slots if any(i <= c < i + 4 for c in chosen) for k in range(j, j + 3)]
        return np.array(found, dtype=np.intp)
