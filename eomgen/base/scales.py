"""Units of coordinates and constraint rows -> scales without dimension, steps in v, Euler parameters, projections."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import AssemblyError
from . import algebra
from .algebra import Array, Indices
from .limits.constraints import TIKHONOV, UNMOVED
from .limits.numbers import ROUNDED, UNIT

# -- coordinates and velocities ----------------------------------------------------------------------------------------

# A ball is four Euler parameters e0 (scalar) .. e3 in q and the three components of an angular velocity in v, in the
# turned axes: e' = E-bar^T w / 2 (Shabana, Computational Dynamics, ch. 7).  All other velocities are the rates of the
# other coordinates, in the same order; first-order states stand last among the velocities and move nothing.  The length
# of e is kept by every step and means nothing.


class Space(NamedTuple):
    """Where quaternion_slots are in q and v, and what goes with what elsewhere."""

    quaternion_slots: tuple[tuple[int, int], ...]  #: first entries in q and in v
    plain_q: Indices  #: coordinates that are in no ball
    plain_v: Indices  #: their velocities

    n_states: int = 0  #: first-order states, the last of the velocities, which move no coordinate

    @classmethod
    def of(cls, n_v: int, quaternion_slots: Sequence[Sequence[int]], n_states: int = 0) -> Space | None:
        """The space of n_v velocities, states included; None where q' = v throughout."""
        if not quaternion_slots and not n_states:
            return None
        pairs = tuple((int(i), int(j)) for i, j in quaternion_slots)
        moving = n_v - n_states
        q = np.setdiff1d(np.arange(moving + len(pairs)), [k for i, _ in pairs for k in range(i, i + 4)])
        v = np.setdiff1d(np.arange(moving), [k for _, j in pairs for k in range(j, j + 3)])
        return cls(pairs, q.astype(np.intp), v.astype(np.intp), n_states)

    def rates(self, q: Array, v: Array) -> Array:
        """q' = N(q) v, (n_q,) or (n_q, k)."""
        result = np.empty((len(q), *v.shape[1:]))
        result[self.plain_q] = v[self.plain_v]
        for i, j in self.quaternion_slots:
            result[i : i + 4] = _turn(q[i : i + 4], v[j : j + 3])
        return result

    def change(self, q: Array, dq: Array, v: Array, dv: Array) -> Array:
        """The change of N(q) v."""
        result = self.rates(q, dv)
        for i, j in self.quaternion_slots:
            result[i : i + 4] += _turn(dq[i : i + 4], v[j : j + 3])
        return result

    def velocities(self, q: Array, dq: Array) -> Array:
        """The smallest v whose N v differs from dq only along the Euler parameters; (n_v,) or (n_v, k)."""
        result = np.zeros((len(q) - len(self.quaternion_slots) + self.n_states, *dq.shape[1:]))
        result[self.plain_v] = dq[self.plain_q]
        for i, j in self.quaternion_slots:
            e, d = q[i : i + 4], dq[i : i + 4]
            scale = 2.0 / (e @ e)
            result[j] = scale * (e[0] * d[1] - e[1] * d[0] + e[3] * d[2] - e[2] * d[3])
            result[j + 1] = scale * (e[0] * d[2] - e[2] * d[0] + e[1] * d[3] - e[3] * d[1])
            result[j + 2] = scale * (e[0] * d[3] - e[3] * d[0] + e[2] * d[1] - e[1] * d[2])
        return result

    def stretch(self, q: Array, dq: Array) -> Array:
        """The part of dq along the Euler parameters."""
        result = np.zeros(dq.shape)
        for i, _ in self.quaternion_slots:
            e = q[i : i + 4]
            result[i : i + 4] = np.multiply.outer(e, e @ dq[i : i + 4]) / (e @ e)
        return result

    def move(self, q: Array, d: Array) -> Array:
        """q after moving with velocities d (n_v,) for unit time."""
        result = np.array(q)
        result[self.plain_q] += d[self.plain_v]
        for i, j in self.quaternion_slots:
            half = 0.5 * float(np.sqrt(d[j : j + 3] @ d[j : j + 3]))
            result[i : i + 4] = np.cos(half) * q[i : i + 4] + np.sinc(half / np.pi) * _turn(q[i : i + 4], d[j : j + 3])
        return result

    def difference(self, a: Array, b: Array) -> Array:
        """The d (n_v,) with move(b, d) = a but for lengths and signs of Euler parameters."""
        result = np.zeros(len(a) - len(self.quaternion_slots) + self.n_states)
        result[self.plain_v] = a[self.plain_q] - b[self.plain_q]
        for i, j in self.quaternion_slots:
            e, f = a[i : i + 4], b[i : i + 4]
            w = np.array([f @ e, *_relative(f, e)])
            w = -w if w[0] < 0.0 else w
            size = float(np.sqrt(w[1:] @ w[1:]))
            result[j : j + 3] = 2.0 * np.arctan2(size, w[0]) / size * w[1:] if size else 0.0
        return result

    def normalized(self, q: Array) -> Array:
        result = np.array(q)
        for i, _ in self.quaternion_slots:
            result[i : i + 4] /= np.sqrt(q[i : i + 4] @ q[i : i + 4])
        return result

    def neutral(self) -> Array:
        """Zero, with the identity for each rotation."""
        result = np.zeros(len(self.plain_q) + 4 * len(self.quaternion_slots))
        result[[i for i, _ in self.quaternion_slots]] = 1.0
        return result


def settle(names: Sequence[str], kinds: Sequence[str], values: Mapping[str, float]) -> dict[str, float]:
    """Named coordinates with all four Euler parameters of a rotation where some are given.

    Those left out are 0; together they must have length 1, up to rounding.  Their kind, in fours, is ``"parameter"``.
    """
    result = dict(values)
    parameters = [name for name, kind in zip(names, kinds, strict=True) if kind == "parameter"]
    for k in range(0, len(parameters), 4):
        four = parameters[k : k + 4]
        if not any(name in values for name in four):
            continue
        e = np.array([values.get(name, 0.0) for name in four])
        length = float(np.sqrt(e @ e))
        if not abs(length - 1.0) <= UNIT:
            listed = ", ".join(f"{name} = {x:.6g}" for name, x in zip(four, e, strict=True))
            raise AssemblyError(
                f"the Euler parameters {listed} have length {length:.6g}, not 1 (those not given are 0): "
                f"give {four[0]} = cos(angle/2) and {four[1]} .. {four[3]} = axis * sin(angle/2)",
                code="EG-CONTRADICTION",
            )
        result.update(zip(four, (e / length).tolist(), strict=True))
    return result


def _turn(e: Array, w: Array) -> Array:
    """E-bar^T w / 2; e and w (4,) and (3,), or with a last axis."""
    e0, e1, e2, e3 = e
    x, y, z = 0.5 * w
    return np.array([-(e1 * x + e2 * y + e3 * z), e0 * x - e3 * y + e2 * z, e3 * x + e0 * y - e1 * z,
                     e1 * y - e2 * x + e0 * z])  # fmt: skip


def _relative(f: Array, e: Array) -> Array:
    """Vector part of f^-1 e: E-bar(f) e."""
    return np.array([
        f[0] * e[1] - f[1] * e[0] + f[3] * e[2] - f[2] * e[3],
        f[0] * e[2] - f[2] * e[0] + f[1] * e[3] - f[3] * e[1],
        f[0] * e[3] - f[3] * e[0] + f[2] * e[1] - f[1] * e[2],
    ])  # fmt: skip


# -- scales ------------------------------------------------------------------------------------------------------------


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
    groups: Indices | None = None  #: (m,) of rows, by eomgen/mechanics/constraint_functions.py; None: all are compared
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
        result = [int(space.plain_q[np.searchsorted(space.plain_v, k)]) for k in chosen if k in space.plain_v]
        result += [k for i, j in space.quaternion_slots if j in chosen for k in range(i, i + 4)]
        return np.array(result, dtype=np.intp)

    def velocities(self, coordinates: Sequence[int] | Indices) -> Indices:
        """The velocities that move these coordinates; all three for one Euler parameter."""
        chosen = np.asarray(coordinates, dtype=np.intp)
        if self.space is None:
            return chosen
        space = self.space
        result = [int(space.plain_v[np.searchsorted(space.plain_q, k)]) for k in chosen if k in space.plain_q]
        result += [k for i, j in space.quaternion_slots if any(i <= c < i + 4 for c in chosen) for k in range(j, j + 3)]
        return np.array(result, dtype=np.intp)


# -- the least changes that give constraint rows what they ask for -----------------------------------------------------


def largest(values: Array) -> float:
    """The largest magnitude, 0.0 of nothing, NaN if one is NaN."""
    return float(np.abs(values).max()) if values.size else 0.0


def least(J: Array, y: Array) -> Array:
    """The least x, (n,) or (n, k), with J x = y of a scaled Jacobian J (m, n), y (m,) or (m, k).

    Rows may be redundant, with y to match.  Rows that are all zero to rounding, as where parameters alone decide
    whether a loop closes, ask for nothing.
    """
    if not largest(J) > UNMOVED and np.isfinite(J).all():
        return np.zeros((J.shape[1], *y.shape[1:]))
    return algebra.lstsq(J, y, rcond=TIKHONOV**0.5)


def minimum_norm(C_q: Array, y: Array, scales: Scales) -> Array:
    """The smallest scaled x (n, k) with C_q x = y (m, k); y must be consistent, as rates of redundant rows are."""
    return np.asarray(scales.q[:, None] * least(scales.jacobian(C_q), y / scales.c[: len(y), None]))


def tangent_projector(C_q: Array, scales: Scales) -> Array:
    """``P = I - S^2 C_q^T (C_q S^2 C_q^T)^+ C_q`` (n, n).

    The derivative, at a point of the manifold, of the projected q by q and of the projected v by v.
    """
    return np.asarray(np.eye(len(scales.q)) - minimum_norm(C_q, C_q, scales))
