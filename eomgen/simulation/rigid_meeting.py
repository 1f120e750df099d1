"""Simulation: one position of a mechanism with rigid contacts -> inertia and constraints, and what contacts feel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.contacts import LINKED
from .rigid_rows import RigidRows

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

Spot = tuple[int, int, int]  #: two shapes, and the number of the place where they touch


def _numbered(pairs: Sequence[Sequence[int]]) -> list[Spot]:
    """Pairs of shapes, those that touch at several places numbered."""
    found: list[Spot] = []
    seen: dict[tuple[int, int], int] = {}
    for a, b in pairs:
        place = seen.get((a, b), 0)
        seen[a, b] = place + 1
        found.append((a, b, place))
    return found


class Meeting:
    """The contacts of one position, which the two rounds of a step share.

    Attributes
    ----------
    before, start : (m, d) array
        Velocities before the impulses, and a guess of these: those of the same pairs of shapes in the last step.
    spread : (n_v, m d) array
        Velocities by impulses.
    compliance : (m d, m d) array
        Velocities of contacts by impulses.
    scale : float
        (m/s) What the tolerance of their impulses is relative to.
    """

    def __init__(self, held: HeldInertia, rows: RigidRows, v: Array, last: dict[Spot, Array]) -> None:
        m = len(rows.gaps)
        d = len(rows.jacobian) // m
        self.rows, self.scale = rows, 0.0
        self.before = (rows.jacobian @ v).reshape(m, d)
        self.spread = held.inverse @ rows.jacobian.T
        self.compliance = rows.jacobian @ self.spread
        self.keys = _numbered(rows.pairs.tolist())
        none = np.zeros(d)
        self.start = np.array([last.get(key, none)[:d] for key in self.keys])

    def shared(self, values: Array, acts: NDArray[np.bool_]) -> Array:
        """Of each contact (m,) the greatest value of those that act on each other, by impulses (m, d) that are none."""
        m, d = acts.shape
        own = np.diag(self.compliance)
        linked = (self.compliance**2 > LINKED * np.outer(own, own)).reshape(m, d, m, d).any(axis=(1, 3))
        linked &= np.outer(acts.any(axis=1), acts.any(axis=1))
        while not np.array_equal(values, more := np.maximum(values, (linked * values).max(axis=1))):
            values = more
        return values


class HeldInertia:
    """The inertia and the constraints at one position.

    ``inverse`` is the matrix A with which velocities change by A f under impulses f, constraints held.
    """

    def __init__(self, module: BoundModel, t: float, q: Array, u: Any) -> None:
        kernels = module.kernels
        self.module = module
        M = kernels.mass_matrix(q, u=u, t=t)
        self.rows: Array | None = None
        if not module.layout.n_c:
            self.inverse = algebra.inv(M)
            return
        C = kernels.constraint_jacobian(q, u=u, t=t)
        x = np.concatenate([q, np.zeros(module.layout.n_v)])
        self.drift = kernels.velocity_constraints(x, u=u, t=t)
        weight = np.trace(M) / max(float((C * C).sum()), np.finfo(float).tiny)
        whole = algebra.inv(M + weight * (C.T @ C))  # regular where M is singular but constraints hold the rest
        spread = whole @ C.T
        self.back = spread @ algebra.pinv(C @ spread)
        self.rows = C
        self.inverse = whole - self.back @ spread.T
        self.inverse = 0.5 * (self.inverse + self.inverse.T)

    def turn_round(self, v: Array) -> None:
        """Aim at velocities v+ with which the constraints hold for the mean of v and v+."""
        if self.rows is not None:
            self.wanted = -2.0 * self.drift - self.rows @ v

    def aim(self, excess: Array) -> None:
        """Aim at velocities smaller by an excess."""
        if self.rows is not None:
            self.wanted = self.wanted - self.rows @ excess

    def free(self, v: Array) -> Array:
        """Velocities as aimed at, from what forces alone would make of them."""
        return v if self.rows is None else v - self.back @ (self.rows @ v - self.wanted)

    def excess(self, q: Array, v: Array, t: float, u: Any) -> Array:
        """What velocities v (n_v,) at a position have too much for the constraints there, in the metric of here."""
        return np.asarray(self.back @ self.module.kernels.velocity_constraints(np.concatenate([q, v]), u=u, t=t))

    def closing(self, q: Array, t: float, u: Any) -> Array:
        """A displacement (n_v,) that closes the loops: a Newton step."""
        if self.rows is None or not self.module.layout.n_h:
            return np.zeros(self.inverse.shape[0])
        found = self.module.kernels.constraints(q, u=u, t=t)
        return np.asarray(-self.back[:, : len(found)] @ found)
