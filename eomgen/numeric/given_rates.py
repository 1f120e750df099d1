"""Stage numeric: given rates q' = N(q, t) v + b(q, t) at one time -> steps of the coordinates by velocities."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


class GivenRates(NamedTuple):
    """What stands for :class:`~.space.Space` where the rates of the coordinates are functions of their own."""

    of: Callable[[Array, Array], Array]  #: (q, v) -> q' (n_q,)
    moved: Callable[[Array, Array], Array]  #: (q, dv) -> N dv, dv (n_v,) or (n_v, k)
    along: Callable[[Array, Array, Array, Array], Array]  #: (q, v, dq, dv) -> the change of q', (n_q, k)
    gradient: Callable[[Array], Array]  #: q -> dC/dq of the holonomic rows, (h, n_q)

    def rates(self, q: Array, v: Array) -> Array:
        """q' (n_q,)."""
        return self.of(q, v)

    def change(self, q: Array, dq: Array, v: Array, dv: Array) -> Array:
        """The change of q', (n_q, k), where q and v change by dq (n_q, k) and dv (n_v, k)."""
        return self.along(q, v[:, 0], dq, dv)

    def move(self, q: Array, d: Array) -> Array:
        """q after a step with velocities d (n_v,) for unit time, to first order."""
        return q + self.moved(q, d)

    def normalised(self, q: Array) -> Array:
        """q as it is."""
        return q
