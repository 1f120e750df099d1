"""A model as differential-algebraic equations F(t, y, y') = 0, for solvers such as IDA of SUNDIALS.

The stabilised form of index 2 (C. W. Gear, B. Leimkuhler, G. K. Gupta, Automatic integration of Euler-Lagrange
equations with constraints, J. Comput. Appl. Math. 12-13 (1985), 77-90): y = [q; v; l; m] with

    q' - N (v - S^2 C_q^T m) = 0        M v' + h + C_q^T l = 0        C = 0        C_q v + C_t = 0

where the corrections m of the holonomic rows are 0 in every solution, and S are the typical sizes of the velocities.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array
from ..errors import ill_shaped
from .argument_checks import read_numbers
from .kernels import into

if TYPE_CHECKING:
    from .bound_model import BoundModel


class DaeForm:
    """The differential-algebraic form of a model; of redundant constraints the independent rows alone.

    Attributes
    ----------
    y_names : tuple of str
        Of y = [q; v; l; m]: coordinates, velocities, multipliers ``lambda_<row>``, corrections ``mu_<row>``.
    n_y : int
    algebraic : (k,) array of int
        Entries of y whose rates are not in F: multipliers and corrections.
    """

    def __init__(self, module: BoundModel) -> None:
        layout = module.layout
        rows, holonomic = layout.rows, layout.rows[layout.rows < layout.n_h]
        first, n_c, n_h = layout.n_x, layout.n_c, layout.n_h
        states = np.arange(first)
        self._module, self._layout = module, layout
        self._unknowns = np.concatenate([states, first + rows, first + n_c + holonomic])
        self._equations = np.concatenate([states, first + holonomic, first + n_h + rows])
        self._n_full = first + n_c + n_h
        labels = layout.constraint_labels
        self.y_names = (
            *layout.x,
            *(f"lambda_{labels[i]}" for i in rows),
            *(f"mu_{labels[i]}" for i in holonomic),
        )
        self.n_y = len(self.y_names)
        self.algebraic = np.arange(first, self.n_y)
        self._residual = module.kernels.timed("dae_residual")
        self._jacobian = module.kernels.timed("dae_jacobian")

    def __repr__(self) -> str:
        return f"<differential-algebraic form of {self._module.name}: {self.n_y} equations>"

    def _full(self, y: ArrayLike, yp: ArrayLike, *more: float) -> Array:
        """[y; y'] of all rows, the redundant ones 0."""
        result = np.zeros(2 * self._n_full + len(more))
        for start, part, label in ((0, y, "y"), (self._n_full, yp, "yp")):
            given = read_numbers(label, part)
            if given.shape != (self.n_y,):
                raise ill_shaped(f"{label} must have shape ({self.n_y},), not {given.shape}")
            result[start + self._unknowns] = given
        result[2 * self._n_full :] = more
        return result

    def residual(
        self, t: float, y: ArrayLike, yp: ArrayLike, res: Array | None = None, u: ArrayLike | None = None
    ) -> Array:
        """F(t, y, y') (n_y,), written into ``res`` if it is given; u (n_u,) as bound by default."""
        return into(res, self._residual(t, self._full(y, yp), u=u)[self._equations])

    def jacobian(
        self,
        t: float,
        y: ArrayLike,
        yp: ArrayLike,
        cj: float = 0.0,
        out: Array | None = None,
        u: ArrayLike | None = None,
    ) -> Array:
        """dF/dy + cj dF/dy' (n_y, n_y), exact, written into ``out`` if it is given."""
        every = self._jacobian(t, self._full(y, yp, cj), u=u)
        return into(out, every[np.ix_(self._equations, self._unknowns)])

    def initial(self, x: ArrayLike | None = None, t: float = 0.0, u: ArrayLike | None = None) -> tuple[Array, Array]:
        """Consistent y and y' (n_y,) of a state x, the declared initial one by default; x is projected first.

        Rates of multipliers and corrections, which F does not hold, are 0.
        """
        module, layout = self._module, self._layout
        x = module.x0(t=t, u=u) if x is None else module.project(x, t=t, u=u)
        rates = module.rhs(t, x, u=u)
        y, yp = np.zeros(self.n_y), np.zeros(self.n_y)
        y[: layout.n_x], yp[: layout.n_x] = x, rates
        if len(layout.rows):
            q, v, a = x[: layout.n_q], x[layout.n_q :], rates[layout.n_q :]
            J = layout.scales.jacobian(module.kernels.constraint_jacobian(q, t=t, u=u, rows="all"))[layout.rows]
            force = layout.scales.q * module.kernels.inverse_dynamics(q, v, a, t=t, u=u)
            l = algebra.lstsq(J.T, -force, rcond=None)
            y[layout.n_x : layout.n_x + len(l)] = l / layout.scales.c[layout.rows]
        return y, yp
