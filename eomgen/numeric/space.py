"""Stage numeric: coordinates and velocities with q' = N(q) v -> steps in v, differences, unit Euler parameters.

A ball is four Euler parameters e0 (scalar) .. e3 in q and the three components of an angular velocity in v, in the
turned axes: e' = E-bar^T w / 2 (Shabana, Computational Dynamics, ch. 7).  All other velocities are the rates of the
other coordinates, in the same order; first-order states stand last among the velocities and move nothing.  The length
of e is kept by every step and means nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..base.algebra import Array, Indices
from ..base.limits.numbers import UNIT
from ..errors import AssemblyError


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

    def normalised(self, q: Array) -> Array:
        """q with Euler parameters of length 1."""
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

    Those left out are 0; together they must have length 1, up to rounding.

    Parameters
    ----------
    names, kinds : sequences of str
        Coordinates; the kind of Euler parameters, which come in fours, is ``"parameter"``.
    values : mapping of str to float

    Raises
    ------
    AssemblyError
        They have another length.
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
            shown = ", ".join(f"{name} = {x:.6g}" for name, x in zip(four, e, strict=True))
            raise AssemblyError(
                f"the Euler parameters {shown} have length {length:.6g}, not 1 (those not given are 0): "
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
