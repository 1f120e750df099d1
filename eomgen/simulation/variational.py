"""Simulation: a run and its derivatives -> x' and S', how inputs and laws vary with what it is differentiated by."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..errors import cannot
from ..runtime.derivative_calls import output_derivatives
from ..runtime.signals import Forcing
from .input_slopes import InputSlopes
from .sensitivity_start import Differentiated

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


class Move(NamedTuple):
    """Changes of all that a law may depend on, for unit changes of the k names."""

    x: Array  #: (n_x, k)
    t: Array  #: (k,)
    u: Array  #: (n_u, k), NaN for an input whose rate is not known
    p: Array  #: (n_p, k)

    def along(self, slopes: Array, what: str, names: tuple[str, ...]) -> Array:
        """The changes (m, k) of a law from its derivatives (m, ...) by x, t, u and p.

        Raises
        ------
        UsageError
            It depends on the rate of an input that is a Python function.
        """
        n_x, n_u = len(self.x), len(self.u)
        by_u = slopes[:, n_x + 1 : n_x + 1 + n_u]
        for j in np.flatnonzero(by_u.any(axis=0) & ~np.isfinite(self.u).all(axis=1)):
            raise cannot(
                f"{what} depends on input {names[j]}, a Python function, and its rate is not known; give it as an "
                "expression in a text, or as a table"
            )
        known = np.isfinite(self.u).all(axis=1)
        found = slopes[:, :n_x] @ self.x + np.multiply.outer(slopes[:, n_x], self.t)
        return np.asarray(found + by_u[:, known] @ self.u[known] + slopes[:, n_x + 1 + n_u :] @ self.p)


class Variational:
    """x' = f and S' = J S + df/dp as one system z = [x; S * weights].

    Parameters
    ----------
    module : BoundModel
        With parameters and constant inputs bound.
    forcing : Forcing
        The inputs of the run.
    columns : Differentiated
        What is differentiated by.
    """

    def __init__(self, module: BoundModel, forcing: Forcing, columns: Differentiated) -> None:
        self.module, self.forcing, self.columns = module, forcing, columns
        self.inputs = InputSlopes(module.layout, forcing, module.p)
        self.weights = _weights(module, columns)
        kernels, layout = module.kernels, module.layout
        self.rhs, self.tangent = kernels.timed("rhs", nan=True), kernels.timed("jacobian", nan=True)
        self.by_p, self.by_u = kernels.timed("parameter_jacobian", nan=True), kernels.timed("input_jacobian", nan=True)
        k = len(columns.names)
        self.dp = columns.spread(np.eye(layout.n_p), np.zeros((layout.n_p, layout.n_u)))
        self.du = columns.spread(np.zeros((layout.n_u, layout.n_p)), np.eye(layout.n_u))
        self.still = Move(np.zeros((layout.n_x, k)), np.zeros(k), self.du, self.dp)

    def slopes(self, t: float, x: Array, S: Array) -> tuple[Array, Array]:
        """x' and S', S without weights."""
        u = self.forcing(t, x)
        S_dot = self.tangent(t, x, u=u) @ S
        if self.columns.parameters:
            S_dot = S_dot + self.by_p(t, x, u=u) @ self.dp
        if self.columns.inputs or self.inputs.by_state_or_parameters:
            S_dot = S_dot + self.by_u(t, x, u=u) @ self.move(t, x, S).u
        return self.rhs(t, x, u=u), S_dot

    def move(self, t: float, x: Array, dx: Array, dt: Array | None = None) -> Move:
        """Everything that goes with changes of the state (n_x, k), and of the time (k,) at which it is looked at."""
        moved = self.still._replace(x=dx)
        if not self.forcing:
            return moved if dt is None else moved._replace(t=dt)
        by_t, by_x, by_p = self.inputs(t, x)
        du = self.du + by_x @ dx + by_p @ self.dp
        if dt is None:
            return moved._replace(u=du)
        return moved._replace(t=dt, u=du + np.multiply.outer(by_t, dt))

    def __call__(self, t: float, z: Array) -> Array:
        """z' of z."""
        x, S = self.split(z)
        x_dot, S_dot = self.slopes(t, x, S)
        return self.joined(x_dot, S_dot)

    def split(self, z: Array) -> tuple[Array, Array]:
        """x (n_x,) and S (n_x, k) without weights."""
        n = self.module.n_x
        return z[:n], z[n:].reshape(n, -1) / self.weights

    def joined(self, x: Array, S: Array) -> Array:
        """z of x and S."""
        return np.concatenate([x, (S * self.weights).ravel()])

    def outputs(self, t: float, x: Array, S: Array) -> Array:
        """Derivatives (n_y, k) of the outputs."""
        layout, here = self.module.layout, self.module.bind(u=self.forcing(t, x))
        n_q, n_x, n_v, n_u = layout.n_q, layout.n_x, layout.n_v, layout.n_u
        x_dot, S_dot = self.slopes(t, x, S)
        Y, move = output_derivatives(here, t, x, x_dot[n_q:]), self.move(t, x, S)
        by_u, by_p = Y[:, n_x + n_v : n_x + n_v + n_u], Y[:, n_x + n_v + n_u :]
        return np.asarray(Y[:, :n_x] @ S + Y[:, n_x : n_x + n_v] @ S_dot[n_q:] + by_u @ move.u + by_p @ move.p)


def _weights(module: BoundModel, columns: Differentiated) -> Array:
    """Sizes of what is differentiated by, so that one tolerance fits all columns."""
    weights = np.ones(len(columns.names))
    for column, index in columns.parameters:
        weights[column] = abs(module.p[index]) or 1.0
    for column, index in columns.inputs:
        weights[column] = abs(module.u[index]) or 1.0
    return weights
