"""The state z = [q; p], coordinates and momenta -> the canonical equations of a model and its Hamiltonian."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array, correlated
from ..base.limits.constraints import STATE
from ..base.limits.numbers import SINGULAR
from ..errors import UnavailableError, ill_shaped
from .argument_checks import read_numbers
from .refusals import require_support

if TYPE_CHECKING:
    from .bound_model import BoundModel


class Canonical:
    """Hamilton's equations of a model derived by method ``hamilton``, on ``z = [q; p]`` with p = dT/dv (n_v,).

    q are all coordinates of the tree, and p their momenta, those of angular velocities where Euler parameters are.
    With constraints the equations are embedded: of the velocities only those are taken that the constraints allow,
    and p' holds the forces of the constraints.  States are single vectors (n_z,).

    Attributes
    ----------
    z_names, p_names : tuple of str
    n_z : int
    """

    def __init__(self, module: BoundModel) -> None:
        layout = module.layout
        require_support(layout, "the canonical form")
        if layout.sizes.n_momenta != layout.n_v:
            raise UnavailableError(
                f"model {layout.name!r} was derived by method {layout.info.method!r}, which has no momenta; "
                "derive it with method='hamilton'"
            )
        self._module = module
        self.p_names = tuple(f"p_{name}" for name in layout.velocity_labels)
        self.z_names = layout.q + self.p_names
        self.n_z = len(self.z_names)
        self._terms = module.kernels.canonical

    def __repr__(self) -> str:
        return f"<canonical form of {self._module.name}: z = [{', '.join(self.z_names)}]>"

    def momenta(self, x: ArrayLike, t: float = 0.0) -> Array:
        """The momenta p (n_v,) of a state x = [q; v]."""
        return np.array(self._terms(x, t=t)[0])

    def of(self, x: ArrayLike, t: float = 0.0) -> Array:
        """The canonical state z (n_z,) of a state x = [q; v], which is projected first."""
        x = self._module.project(x, t=t)
        return np.concatenate([x[: self._module.n_q], self.momenta(x, t)])

    def z0(self, values: Mapping[str, float] | None = None, /, *, t: float = 0.0, **named: float) -> Array:
        """An assembled canonical state (n_z,), from the same named values as ``Module.x0``."""
        return self.of(self._module.x0(values, t=t, **named), t)

    def expand(self, z: ArrayLike, t: float = 0.0) -> Array:
        """The state x = [q; v] (n_x,) with these momenta, on the constraints.

        Raises
        ------
        SingularMassMatrixError
            No inertia is behind some motion.
        UsageError
            A wrong shape.
        """
        module, layout = self._module, self._module.layout
        z = read_numbers("z", z)
        if z.shape != (self.n_z,):
            raise ill_shaped(f"z must have shape ({self.n_z},) [{', '.join(self.z_names)}], not {z.shape}")
        n, s = layout.n_q, layout.scales.q
        q, p = z[:n], z[n:]
        rate, N = np.zeros(layout.n_c), np.eye(layout.n_v)
        if layout.n_c:
            q = module.project(np.concatenate([q, np.zeros(layout.n_v)]), t=t)[:n]
            J = layout.scales.jacobian(module.kernels.constraint_jacobian(q, t=t))
            rest = np.concatenate([q, np.zeros(layout.n_v)])
            rate = layout.scales.residual(module.velocity_constraints(rest, t=t, rows="all"))
            N = algebra.svd(J)[2][layout.rank :].T
            least = -algebra.lstsq(J, rate, rcond=STATE)
        else:
            least = np.zeros(layout.n_v)
        still = self.momenta(np.concatenate([q, np.zeros(layout.n_v)]), t)  # what p is at v = 0
        M = s[:, None] * module.kernels.mass_matrix(q, t=t) * s
        right = N.T @ (s * (p - still) - M @ least)  # N^T (M v + b) = N^T p, v = least + N y
        embedded = N.T @ M @ N
        sizes = algebra.eigvalsh(correlated(embedded)) if np.isfinite(embedded).all() else np.zeros(1)
        if layout.info.indefinite:
            sizes = np.abs(sizes)
        if sizes.min(initial=np.inf) <= SINGULAR:  # momenta determine no velocities
            raise module.kernels.fail.exception("canonical", 2, t, np.concatenate([q, np.zeros(layout.n_v)]))
        y = algebra.solve(embedded, right)
        return np.concatenate([q, s * (least + N @ y)])

    def rhs(self, t: float, z: ArrayLike) -> Array:
        """z' = [q'; p'] (n_z,): q' = dH/dp and p' = -dH/dq + Q, with the forces of constraints.

        A pure function, which plain SciPy integrates.
        """
        module, layout = self._module, self._module.layout
        x = self.expand(z, t)
        q, v = x[: layout.n_q], x[layout.n_q :]
        rates = np.array(self._terms(x, t=t)[1])
        if layout.n_c:  # -C_q^T l = M a + h
            rates += module.kernels.inverse_dynamics(q, v, module.rhs(t, x)[layout.n_q :], t=t)
        return np.concatenate([layout.scales.rates(q, v), rates])

    def hamiltonian(self, z: ArrayLike, t: float = 0.0) -> float:
        """H = p v - L (J), which is the energy T + V where nothing is driven in time."""
        x, n = self.expand(z, t), self._module.n_q
        still = np.concatenate([x[:n], np.zeros(len(x) - n)])
        moving = self.momenta(x, t) - self.momenta(still, t)  # M v: T may have linear terms, L of a Lagrangian others
        return float(0.5 * moving @ x[n:] - self._module.energy(still, t=t)[0] + self._module.energy(x, t=t)[1])
