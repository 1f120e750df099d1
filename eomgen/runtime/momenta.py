"""The calls of a Module that sum over all bodies: centre of mass, momentum, centroidal inertia."""

from __future__ import annotations

from functools import cached_property
from math import prod
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..errors import UsageError, ill_shaped
from .argument_checks import read_numbers
from .kernels import DerivedState

if TYPE_CHECKING:
    from .kernels import Kernels
    from .protocols import State


class Momenta:
    """Part of :class:`~.bound_model.BoundModel`: sums over all bodies, in ground axes, each made when first asked for.

    Calls raise a :class:`~..errors.UsageError` where the model has no bodies, or none with a mass.
    """

    kernels: Kernels

    def _part(self, name: str, start: int, *shape: int, rates: bool = False) -> State:
        """A part of the kernel ``centroidal``, whose sums over the bodies share the work."""
        layout, whole = self.kernels.layout, self.kernels.state("centroidal")
        n = layout.n_x if rates else layout.n_q

        def find(x: ArrayLike, **given: Any) -> Array:
            if layout.n_com == 0:
                raise UsageError(f"model {layout.name!r} has no {name}: no body of it has a mass", code="EG-NO-INERTIA")
            state = read_numbers("x", x)
            if state.shape[:1] != (n,) or state.ndim > 2:
                raise ill_shaped(f"{'x' if rates else 'q'} must have shape ({n},) or ({n}, k), not {state.shape}")
            full = np.concatenate([state, np.zeros((layout.n_x - n, *state.shape[1:]))])
            found = whole(full, **given)[start : start + prod(shape)]
            return np.array(found.reshape(shape + state.shape[1:]))

        return cast("State", DerivedState(name, find))

    @cached_property
    def center_of_mass(self) -> State:
        """``center_of_mass(q)`` -> (3,) of all bodies (m)."""
        return self._part("center_of_mass", 0, 3)

    @cached_property
    def com_jacobian(self) -> State:
        """``com_jacobian(q)`` -> (3, n_v): the velocity of the centre of mass is this times v."""
        return self._part("com_jacobian", 3, 3, self.kernels.layout.n_v)

    @cached_property
    def momentum(self) -> State:
        """``momentum(x)`` -> (6,): linear (kg m/s), then angular about the centre of mass (kg m^2/s)."""
        return self._part("momentum", 3 + 3 * self.kernels.layout.n_v, 6, rates=True)

    @cached_property
    def centroidal_inertia(self) -> State:
        """``centroidal_inertia(q)`` -> (3, 3) about the centre of mass of all bodies (kg m^2)."""
        return self._part("centroidal_inertia", 9 + 3 * self.kernels.layout.n_v, 3, 3)
