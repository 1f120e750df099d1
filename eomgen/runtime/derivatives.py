"""Stage runtime: the calls of a Module that are derivatives: of the right-hand side and of the inverse dynamics."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

from numpy.typing import ArrayLike

from ..errors import UsageError
from ..numeric.scales import Array
from .refusals import Refusal

if TYPE_CHECKING:
    from .kernels import Kernels
    from .protocols import Timed
    from .second_derivatives import FurtherDerivatives, InverseDynamicsDerivatives


class Jacobian:
    """The derivative of the complete right-hand side by the state, by the inputs or by the parameters.

    Parameters
    ----------
    kernel : Timed
        By the state; its attributes are those of this object too.
    others : dict of str to Timed
        By what else.
    """

    def __init__(self, kernel: Timed, others: dict[str, Timed]) -> None:
        self.kernel = kernel
        self.others = others

    def __call__(
        self,
        t: ArrayLike,
        x: ArrayLike,
        p: ArrayLike | None = None,
        u: ArrayLike | None = None,
        out: Array | None = None,
        wrt: str = "x",
    ) -> Array:
        """Evaluate.

        Parameters
        ----------
        t : float or (k,) array
        x : (n_x,) or (n_x, k) array
        p, u, out : arrays, optional
        wrt : {'x', 'u', 'p'}
            What ``rhs`` is differentiated by.

        Returns
        -------
        (n_x, n) or (n_x, n, k) array
            n is n_x, n_u or n_p.

        Raises
        ------
        UsageError
            Another ``wrt``.
        """
        if wrt == "x":
            return self.kernel(t, x, p, u, out)
        if not isinstance(wrt, str) or wrt not in self.others:
            raise UsageError(f"wrt must be 'x' (the state), 'u' (the inputs) or 'p' (the parameters), not {wrt!r}")
        return self.others[wrt](t, x, p, u, out)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.kernel, name)

    def __repr__(self) -> str:
        return repr(self.kernel)


class Derivatives:
    """Part of :class:`~.bound_model.BoundModel`: derivatives, each made when first asked for."""

    kernels: Kernels

    @cached_property
    def jacobian(self) -> Jacobian:
        """``jacobian(t, x)`` -> (n_x, n_x) dx'/dx; ``wrt="u"`` -> (n_x, n_u); ``wrt="p"`` -> (n_x, n_p)."""
        others = {"u": self.input_jacobian, "p": self.parameter_jacobian}
        return Jacobian(self.kernels.timed("jacobian"), others)

    @cached_property
    def input_jacobian(self) -> Timed:
        """``input_jacobian(t, x)`` -> (n_x, n_u), the derivative of the complete rhs by the inputs."""
        return self._derivative("input_jacobian")

    @cached_property
    def parameter_jacobian(self) -> Timed:
        """``parameter_jacobian(t, x)`` -> (n_x, n_p), the derivative of the complete rhs by the parameters.

        The projection is part of the rhs: where parameters move the constraints, the state is taken along to the
        nearest one on them.  Exact at states on the constraints; others are projected first.
        """
        return self._derivative("parameter_jacobian")

    def _derivative(self, name: str) -> Timed:
        layout = self.kernels.layout
        refused = layout.given_rates or not layout.projects
        return cast("Timed", Refusal(layout)) if refused else self.kernels.timed(name)

    @cached_property
    def _second(self) -> FurtherDerivatives:
        from .second_derivatives import FurtherDerivatives

        return FurtherDerivatives(self.kernels)

    def inverse_dynamics_derivatives(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        p: ArrayLike | None = None,
        u: ArrayLike | None = None,
        out: Array | None = None,
        t: ArrayLike = 0.0,
    ) -> InverseDynamicsDerivatives:
        """Differentiate the generalized forces ``inverse_dynamics(q, v, a)`` by q, by v and by a, each at fixed others.

        Parameters
        ----------
        q, v, a : (n_q,), (n_v,), (n_v,) arrays, or with a last axis k
            Coordinates, velocities and accelerations of the spanning tree.
        p, u : arrays, optional
        out : (n_v, n_q + 2 n_v) array, optional
            Where all three are written side by side; the results are views of it.
        t : float or (k,) array

        Returns
        -------
        InverseDynamicsDerivatives
            ``dtau_dq`` (n_v, n_q), ``dtau_dv`` and ``dtau_da`` (n_v, n_v); the last is the mass matrix.  Columns of
            Euler parameters are partial derivatives by the four numbers: along a rotation with angular velocity w they
            combine as ``dtau_dq @ dq`` with dq = N(q) w, the change of q at that velocity.
        """
        return self._second.inverse_dynamics_derivatives((q, v, a), p, u, out, t)

    def inverse_dynamics_hessian_product(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        weights: ArrayLike,
        direction: ArrayLike,
        p: ArrayLike | None = None,
        u: ArrayLike | None = None,
        t: ArrayLike = 0.0,
    ) -> Array:
        """Multiply the weighted sum of the Hessians of the inverse dynamics by a direction.

        With z = [q; v; a] and J = d(inverse_dynamics)/dz it is the derivative of J(z + e direction)^T weights by e at
        e = 0, which is ``sum_i weights[i] H_i direction`` with the Hessians H_i of the single forces.

        Parameters
        ----------
        q, v, a : (n_q,), (n_v,), (n_v,) arrays, or with a last axis k
        weights : (n_v,) array
            One for each generalized force.
        direction : (n_q + 2 n_v,) array
            [dq; dv; da].
        p, u : arrays, optional
        t : float or (k,) array

        Returns
        -------
        (n_q + 2 n_v,) or (n_q + 2 n_v, k) array
        """
        return self._second.inverse_dynamics_hessian_product((q, v, a), weights, direction, p, u, t)

    def rhs_hessian_product(
        self,
        t: ArrayLike,
        x: ArrayLike,
        weights: ArrayLike,
        direction: ArrayLike,
        p: ArrayLike | None = None,
        u: ArrayLike | None = None,
    ) -> Array:
        """Multiply the weighted sum of the Hessians of the right-hand side of a tree by a direction.

        With z = [x; u] and J = d(rhs)/dz it is the derivative of J(z + e direction)^T weights by e at e = 0, which is
        ``sum_i weights[i] H_i direction`` with the Hessians H_i of the single rates.

        Parameters
        ----------
        t : float or (k,) array
        x : (n_x,) or (n_x, k) array
        weights : (n_x,) array
            One for each entry of x'.
        direction : (n_x,) or (n_x + n_u,) array
            Changes of x, or of x and u.
        p, u : arrays, optional

        Returns
        -------
        array
            As long as the direction; with a last axis k for batches.

        Raises
        ------
        UnavailableError
            The model has constraints, or its rates are given.
        """
        return self._second.rhs_hessian_product(t, x, weights, direction, p, u)
