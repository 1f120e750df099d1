"""The calls of a Module that sum over all bodies: centre of mass, momentum, centroidal inertia."""

from __future__ import annotations

from functools import cached_property
from math import prod
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..errors import UsageError, ill_shaped
from .argument_checks import read_numbers
from .argument_names import both_names
from .kernels import into

if TYPE_CHECKING:
    from .kernels import Kernels
    from .protocols import State


class Part:
    """A part of the kernel ``centroidal``, whose sums over the bodies share the work.

    Parameters
    ----------
    kernels : Kernels
    name : str
        What it is called, for messages.
    start : int
        Its first entry.
    shape : tuple of int
        Of the result for one state.
    n_in : int
        n_q for what depends on positions only, else n_x.
    """

    failure: tuple[int, float, Array] | None = None

    def __init__(self, kernels: Kernels, name: str, start: int, shape: tuple[int, ...], n_in: int) -> None:
        self.layout, self.name, self.start, self.shape, self.n_in = kernels.layout, name, start, shape, n_in
        self.whole: State = kernels.state("centroidal")

    @both_names
    def __call__(
        self,
        x: ArrayLike,
        p: ArrayLike | None = None,
        u: ArrayLike | None = None,
        out: Array | None = None,
        t: ArrayLike = 0.0,
    ) -> Array:
        """Evaluate.

        Raises
        ------
        UsageError
            A wrong shape, or a model without mass.
        """
        layout = self.layout
        if layout.n_com == 0:
            raise UsageError(
                f"model {layout.name!r} has no {self.name}: no body of it has a mass", code="EG-NO-INERTIA"
            )
        state = read_numbers("x", x)
        if state.shape[:1] != (self.n_in,) or state.ndim > 2:
            given = "q" if self.n_in == layout.n_q else "x"
            raise ill_shaped(f"{given} must have shape ({self.n_in},) or ({self.n_in}, k), not {state.shape}")
        if self.n_in != layout.n_x:
            state = np.concatenate([state, np.zeros((layout.n_x - self.n_in, *state.shape[1:]))])
        every = self.whole(state, p=p, u=u, t=t)
        return into(out, every[self.start : self.start + prod(self.shape)].reshape(self.shape + state.shape[1:]))


class Momenta:
    """Part of :class:`~.bound_model.BoundModel`: sums over all bodies, in ground axes, each made when first asked for.

    Calls raise a :class:`~..errors.UsageError` where the model has no bodies, or none with a mass.
    """

    kernels: Kernels

    def _part(self, name: str, start: int, *shape: int, rates: bool = False) -> State:
        layout = self.kernels.layout
        return cast("State", Part(self.kernels, name, start, shape, layout.n_x if rates else layout.n_q))

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
