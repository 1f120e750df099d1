"""Stage runtime: arguments of the derivatives of inverse dynamics and of the second derivatives -> calls of kernels."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import UnavailableError, UsageError
from ..numeric.scales import Array
from .refusals import require_velocities
from .room import read_numbers

if TYPE_CHECKING:
    from .kernels import Kernels
    from .protocols import Motion, State, Timed

Triple = tuple[ArrayLike, ArrayLike, ArrayLike]


class InverseDynamicsDerivatives(NamedTuple):
    """Derivatives of the generalized forces of the inverse dynamics, each at fixed other arguments."""

    dtau_dq: Array  #: (n_v, n_q)
    dtau_dv: Array  #: (n_v, n_v)
    dtau_da: Array  #: (n_v, n_v), the mass matrix


class FurtherDerivatives:
    """The kernels behind the methods of :class:`~.derivatives.Derivatives` of the same names, which say more."""

    def __init__(self, kernels: Kernels) -> None:
        self.kernels = kernels
        self.layout = kernels.layout

    @cached_property
    def _slopes(self) -> Motion:
        return self.kernels.motion("inverse_dynamics_derivatives")

    @cached_property
    def _of_forces(self) -> State:
        return self.kernels.state("inverse_dynamics_hessian_product")

    @cached_property
    def _of_rates(self) -> Timed:
        require_velocities(self.layout)
        if self.layout.n_c:
            raise UnavailableError(
                f"model {self.layout.name!r} has constraints, and second derivatives of its right-hand side are not "
                "derived; take inverse_dynamics_hessian_product of its tree, or differences of jacobian"
            )
        return self.kernels.timed("rhs_hessian_product")

    def inverse_dynamics_derivatives(
        self, motion: Triple, p: Any, u: Any, out: Any, t: Any
    ) -> InverseDynamicsDerivatives:
        """By q, v and a."""
        n_q, n_v = self.layout.n_q, self.layout.n_v
        every = self._slopes(*motion, p, u, out, t)
        return InverseDynamicsDerivatives(every[:, :n_q], every[:, n_q : n_q + n_v], every[:, n_q + n_v :])

    def inverse_dynamics_hessian_product(
        self, motion: Triple, weights: Any, direction: Any, p: Any, u: Any, t: Any
    ) -> Array:
        """By q, v and a, once more along the direction."""
        n_q, n_v = self.layout.n_q, self.layout.n_v
        given = zip("qva", motion, (n_q, n_v, n_v), strict=True)
        x = _stacked([*given, ("weights", weights, n_v), ("direction", direction, n_q + 2 * n_v)])
        return self._of_forces(x, p, u, None, t)

    def rhs_hessian_product(self, t: Any, x: ArrayLike, weights: Any, direction: Any, p: Any, u: Any) -> Array:
        """By x and u, once more along the direction."""
        kernel = self._of_rates
        d, n_x, n = read_numbers("direction", direction), self.layout.n_x, self.layout.n_x + self.layout.n_u
        if whole := d.shape[:1] != (n_x,):
            z = _stacked([("x", x, n_x), ("weights", weights, n_x), ("direction", d, n)])
        else:
            still = ("direction", np.zeros(n - n_x), n - n_x)
            z = _stacked([("x", x, n_x), ("weights", weights, n_x), ("direction", d, n_x), still])
        found = kernel(t, z, p, u)
        return found if whole else found[:n_x]


def _stacked(parts: list[tuple[str, Any, int]]) -> Array:
    """Arguments one below the other; those of one state are repeated for every column of a batch."""
    read = [(name, read_numbers(name, value), n) for name, value, n in parts]
    columns = max((x.shape[1:] for _, x, _ in read), key=len)
    for name, x, n in read:
        if x.shape not in ((n,), (n, *columns)) or x.ndim > 2:
            batch = columns[0] if columns else "k"
            raise UsageError(f"{name} must have shape ({n},) or ({n}, {batch}), not {x.shape}")
    return np.concatenate(
        [x if x.shape[1:] == columns else np.repeat(x[:, None], columns[0], axis=1) for _, x, _ in read]
    )
