"""Stage numeric: units of coordinates and constraint rows -> the scales that make both dimensionless."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.intp]
#: q (n,) -> C (m,), C_q (m, n)
Position: TypeAlias = Callable[[Array], tuple[Array, Array]]
#: q (n,) -> C_t (m,)
Rate: TypeAlias = Callable[[Array], Array]


class Scales(NamedTuple):
    """Typical sizes: the length scale L of the mechanism for lengths, 1 for angles.

    A scaled coordinate is ``q / scales.q``, a scaled residual ``C / scales.c``, the scaled Jacobian
    ``C_q * scales.q / scales.c[:, None]``.
    """

    q: Array  #: (n,) of the coordinates
    c: Array  #: (m,) of the constraint rows

    @classmethod
    def of_kinds(cls, coordinates: Sequence[str], rows: Sequence[str], length: float) -> Scales:
        """Scales from kinds, each ``"angle"`` or ``"length"``, and the length scale in metres."""
        return cls(
            np.array([length if kind == "length" else 1.0 for kind in coordinates]),
            np.array([length if kind == "length" else 1.0 for kind in rows]),
        )

    def jacobian(self, C_q: Array) -> Array:
        """The scaled Jacobian J = diag(1/s_c) C_q diag(s_q), (m, n)."""
        return C_q * self.q / self.c[:, None]

    def residual(self, C: Array) -> Array:
        """The scaled residual e = C / s_c, (m,)."""
        return C / self.c
