"""Stage runtime: the calls of a Module that analyse it; each loads its part of :mod:`..analysis` when called."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .kernels import Kernels
    from .protocols import Timed


class Analyses:
    """Part of :class:`~.module.Module`: one call for each analysis."""

    kernels: Kernels

    @cached_property
    def input_jacobian(self) -> Timed:
        """``input_jacobian(t, x)`` -> (n_x, n_u), the derivative of the complete rhs by the inputs."""
        return self.kernels.timed("input_jacobian")

    @cached_property
    def parameter_jacobian(self) -> Timed:
        """``parameter_jacobian(t, x)`` -> (n_x, n_p), the derivative of the complete rhs by the parameters."""
        return self.kernels.timed("parameter_jacobian")
