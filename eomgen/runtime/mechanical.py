"""Stage runtime: kernels whose velocities are [v; s], with first-order states s -> the calls of v alone, for users.

A state is a velocity of unit inertia that no constraint touches, so that its rows and columns are left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..errors import ill_shaped
from .argument_names import both_names
from .kernels import into
from .room import read_numbers

if TYPE_CHECKING:
    from .kernels import Kernels


class Mechanical:
    """The functions of M, h and the constraints of a model that has first-order states.

    Parameters
    ----------
    kernels : Kernels
    """

    def __init__(self, kernels: Kernels) -> None:
        layout = kernels.layout
        count = len(layout.states)
        n, free = layout.n_v - count, layout.n_dof - count
        self.mass_matrix: Any = MechanicalPart(kernels.mass_matrix, n, n)
        self.embedded_mass_matrix: Any = MechanicalPart(kernels.embedded_mass_matrix, free, free)
        self.bias: Any = MechanicalPart(kernels.bias, n)
        self.constraint_jacobian: Any = MechanicalPart(kernels.constraint_jacobian, None, n)
        self.inverse_dynamics: Any = MechanicalInverse(kernels, n)


class MechanicalPart:
    """The first rows and columns of a function's result; None: all."""

    def __init__(self, function: Any, *kept: int | None) -> None:
        self.function, self.kept = function, tuple(slice(None, k) for k in kept)

    def __call__(self, *args: Any, out: Array | None = None, **options: Any) -> Array:
        """Evaluate; arguments are those of the function."""
        return into(out, np.array(self.function(*args, **options)[self.kept]))

    def __repr__(self) -> str:
        return repr(self.function)


class MechanicalInverse:
    """Generalized forces to add, (n_v,), for accelerations a at q and [v; s]."""

    def __init__(self, kernels: Kernels, n: int) -> None:
        self.layout, self.function, self.n = kernels.layout, kernels.inverse_dynamics, n

    @both_names
    def __call__(self, q: Any, v: Any, a: Any, p: Any = None, u: Any = None, out: Any = None, t: Any = 0.0) -> Array:
        """Evaluate at q (n_q,), [v; s] (n_v + n_s,) and a (n_v,), or with a last axis k.

        Raises
        ------
        UsageError
            The states are missing, on which forces depend.
        """
        given, rates = read_numbers("v", v), read_numbers("a", a)
        whole = self.layout.n_v
        if given.shape[:1] != (whole,):
            names = ", ".join(self.layout.states)
            raise ill_shaped(
                f"inverse_dynamics of a model with first-order states takes v = [v; s], ({whole},) or ({whole}, k), "
                f"not {given.shape}: forces depend on the states {names}, which come after the velocities"
            )
        if rates.shape[:1] == (self.n,):
            rates = np.concatenate([rates, np.zeros((whole - self.n, *rates.shape[1:]))])
        return into(out, np.array(self.function(q, given, rates, p=p, u=u, t=t)[: self.n]))

    def __repr__(self) -> str:
        return repr(self.function)
