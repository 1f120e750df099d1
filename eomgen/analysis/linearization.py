"""The result of a linearization, its eigenvalues, their rounding and stability, its second-order form."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.limits.numbers import EPS, ROUNDED_ZERO, TINY
from ..base.results import Result, ResultTable, same_keys
from ..base.texts import number
from ..errors import cannot
from ..runtime.argument_checks import check_names, require
from .limits import COUPLED, STILL

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.layout import Layout
    from .balance import TangentSpace

# -- rounding of eigenvalues -------------------------------------------------------------------------------------------

# The matrix is balanced first (B. N. Parlett, C. Reinsch, Balancing a matrix for calculation of eigenvalues and
# eigenvectors, Numer. Math. 13 (1969), 293-304), so that stiff parts do not drown slow ones; an eigenvalue is then
# uncertain as far as its component of the pseudospectrum of rounding reaches (L. N. Trefethen, M. Embree, Spectra and
# Pseudospectra, 2005, section 2).


ROUNDING = 10.0 * EPS  #: relative error of the entries of a matrix that is exact but for rounding
BALANCED = 100.0 * EPS  #: what rounding leaves of a balance, relative to what a unit displacement does to it
ROUNDS = 30  #: of balancing, at most
GAP = 10.0  #: between eigenvalues that are judged together and those apart
NODES = 32  #: of the contour around them
WAY = (0.0, 0.25, 0.5, 0.75)  #: places between the axis and an eigenvalue that are looked at
SWEEPS = 12  #: of Jacobi's method, at most


def stability_of_matrix(
    A: Array, residual: Array | None = None, error: float = ROUNDING, errors: Array | None = None
) -> str:
    """'asymptotically stable', 'marginal' or 'unstable', by the largest real part of the eigenvalues.

    Without states it is 'no freedom': what drivers and constraints hold entirely is neither.

    Parameters
    ----------
    A : (n, n) array
        Of s' = A s (1/s).
    residual : (n_dof,) array, optional
        Accelerations of the model's own forces in units of the last n_dof states' displacements (1/s^2): slopes of
        forces far below them are rounding.
    error : float
        Relative error of A.
    errors : (n, n) array, optional
        Bounds for the errors of its entries, which can split a double zero by their root.
    """
    if not A.size:
        return "no freedom"
    scale = _balance(A, residual)
    balanced = A * scale / scale[:, None]
    values = algebra.eigvals(balanced)
    far = error * float(algebra.norm2(balanced))
    zero = np.array([_reaches_axis(balanced, complex(value), far) for value in values])
    if errors is not None:
        scale = _balance(np.maximum(np.abs(A), errors), residual)  # so that what is but an error is not blown up
        balanced, scaled = A * scale / scale[:, None], errors * scale / scale[:, None]
        for k in np.flatnonzero(~zero & (values.real > 0.0)):
            zero[k] = _reaches_axis_in_cluster(balanced, scaled, np.abs(values), complex(values[k]))
    if (values.real[~zero] > 0.0).any():
        return "unstable"
    return "marginal" if zero.any() else "asymptotically stable"


def _reaches_axis(A: Array, value: complex, far: float) -> bool:
    """Whether a change of A by a norm of `far` can move an eigenvalue to the imaginary axis, straight on."""
    identity = np.eye(len(A))
    return all(algebra.singular_values(A - (1j * value.imag + part * value.real) * identity)[-1] <= far for part in WAY)


def _reaches_axis_in_cluster(A: Array, errors: Array, sizes: Array, value: complex) -> bool:
    """The same within the invariant subspace of an eigenvalue and all smaller ones, with the errors that it sees.

    The subspace is that of the spectral projector, a contour integral of the resolvent (T. Kato, Perturbation Theory
    for Linear Operators, 1980, section I.5.3), which no defective eigenvalue spoils.
    """
    sizes = np.sort(sizes)
    wider = sizes[sizes > GAP * abs(value)]
    if not wider.size:
        return False
    inner = sizes[sizes <= GAP * abs(value)]
    radius = float(np.sqrt(inner[-1] * wider[0]))
    nodes = radius * np.exp(2j * np.pi * (np.arange(NODES) + 0.5) / NODES)
    identity = np.eye(len(A))
    try:
        projector = np.mean([z * np.linalg.inv(z * identity - A) for z in nodes], axis=0).real
    except np.linalg.LinAlgError:
        return False
    basis = algebra.svd(projector)[0][:, : len(inner)]
    left = basis.T @ projector
    far = float(algebra.norm2(np.abs(left) @ errors @ np.abs(basis)))
    return _reaches_axis(left @ A @ basis, value, far)


def _balance(A: Array, residual: Array | None) -> Array:
    """Units of the states that make rows and columns alike; forces of the model keep rows from being blown up."""
    sizes = np.abs(A)
    if residual is not None and len(residual) and len(A) >= 2 * len(residual):
        n = len(residual)
        rows = np.arange(len(A) - n, len(A))
        sizes[rows, rows - n] = np.maximum(sizes[rows, rows - n], residual)
        sizes[rows - n, rows] = np.maximum(sizes[rows - n, rows], TINY)
    np.fill_diagonal(sizes, 0.0)
    d = np.ones(len(A))
    for _ in range(ROUNDS):
        worst = 1.0
        for i in range(len(A)):
            row, column = float(np.linalg.norm(sizes[i])), float(np.linalg.norm(sizes[:, i]))
            if row > 0.0 and column > 0.0:
                f = 2.0 ** round(0.5 * np.log2(row / column))
                sizes[i] /= f
                sizes[:, i] *= f
                d[i] *= f
                worst = max(worst, f, 1.0 / f)
        if worst <= 2.0:
            break
    return d


def residual_accelerations(module: BoundModel, t: float, x: Array, B: Array, velocities: Indices, mass: Array) -> Array:
    """Accelerations that the forces of the model would make if they did not balance, scaled (1/s^2), (n_dof,).

    Parameters
    ----------
    x : (n_x,) array
    B : (n_v, n_dof) array
        Virtual displacements.
    velocities : (n_dof,) indices
    mass : (n_dof, n_dof) array
        Embedded.
    """
    if not len(mass):
        return np.zeros(0)
    forces = np.abs(B).T @ np.abs(module.kernels.bias(t, x))
    try:
        return np.asarray(np.abs(np.linalg.inv(mass)) @ forces / module.layout.scales.q[velocities])
    except np.linalg.LinAlgError:
        return np.ones(len(mass))


def graded_modes(M: Array, K: Array, shapes: Array) -> tuple[Array, Array]:
    """Squares of frequencies and shapes of symmetric M and K, slow modes as accurate as K has them.

    By Jacobi's method on the nearly diagonal K of modes, which keeps small eigenvalues next to large ones (J. Demmel,
    K. Veselic, Jacobi's method is more accurate than QR, SIAM J. Matrix Anal. Appl. 13 (1992), 1204-1245).
    """
    S = shapes / np.sqrt(np.einsum("ik,ij,jk->k", shapes, M, shapes))
    T = S.T @ K @ S
    T = 0.5 * (T + T.T)
    for _ in range(SWEEPS):
        turned = False
        for i in range(len(T)):
            for j in range(i):
                if abs(T[i, j]) <= EPS * np.sqrt(abs(T[i, i] * T[j, j])) + TINY:
                    continue
                angle = 0.5 * np.arctan2(2.0 * T[i, j], T[i, i] - T[j, j])
                if T[i, i] < T[j, j]:  # the smaller of both turns
                    angle = 0.5 * np.arctan(2.0 * T[i, j] / (T[i, i] - T[j, j]))
                c, s = np.cos(angle), np.sin(angle)
                turn = np.array([[c, -s], [s, c]])
                T[:, [i, j]] = T[:, [i, j]] @ turn
                T[[i, j]] = turn.T @ T[[i, j]]
                S[:, [i, j]] = S[:, [i, j]] @ turn
                T[i, j] = T[j, i] = 0.0
                turned = turned or abs(s) > EPS
        if not turned:
            break
    order = np.argsort(T.diagonal())
    return np.asarray(T.diagonal()[order]), np.asarray(S[:, order])


# -- stability ---------------------------------------------------------------------------------------------------------

# Of a rigid body that may turn freely, and of every other neutral motion, 0 is a double eigenvalue with one
# eigenvector: an error e of the matrix splits it by sqrt(e), so that its sign says nothing. Where C has no negative
# part and K is symmetric, the sign of K decides instead (Kelvin, Tait, Chetaev: D. R. Merkin, Introduction to the
# Theory of Stability, 1997, chapter 6): no eigenvalue is on the right where K is positive semidefinite, and as many as
# K has negative ones where nothing is gyroscopic. An eigenvalue of K is wrong by e at most, not by its root.


MARGIN = 5.0 * ROUNDING  #: relative error of sums of forces, on the safe side


class SecondOrder(NamedTuple):
    """Equations of second order and bounds for the errors of their entries."""

    M: Array  #: (n, n)
    C: Array  #: (n, n)
    K: Array  #: (n, n) by the displacements that the velocities make
    C_error: Array  #: (n, n)
    K_error: Array  #: (n, n)


def stiffness_errors(M: Array, slopes: Array, residual: Array, sizes: Array, error: float = MARGIN) -> Array:
    """Bounds (n, n_z) for the errors that rounding leaves in K.

    Of the sums that make an acceleration, of the forces behind them, and of what cancels within one stiff force whose
    other directions do not show it.

    Parameters
    ----------
    M : (n, n) array
    slopes : (n, n_z) array
        Of accelerations by displacements; -M^-1 K.
    residual : (n,) array
        Accelerations of the model's own forces, each without the others, per unit displacement.
    sizes : (n_z,) array
        Unit displacements.
    error : float
        Relative error of forces.
    """
    local = np.abs(M) @ np.abs(slopes)
    if len(residual):
        local[:, : len(residual)] += np.diag(M.diagonal() * residual)
    n = len(M)
    stiffest = float((sizes[:n] * np.abs(M @ slopes)[:, :n].diagonal() * sizes[:n]).max(initial=0.0))
    rows = np.ones(n)  # of first-order states, which are no displacements
    rows[: len(sizes)] = sizes[:n]
    shared = 2.0 * EPS * max(1.0, error / MARGIN) * stiffest / np.outer(rows, sizes)
    return np.asarray(error * local + shared)


def symmetric_modes(M: Array, K: Array) -> tuple[Array, Array]:
    """Squares of frequencies, ascending, and shapes (columns, s^T M s = 1) of symmetric M and K."""
    factor = algebra.cholesky(M)
    inverse = algebra.inv(factor)
    reduced = inverse @ K @ inverse.T
    return graded_modes(M, K, inverse.T @ algebra.eigh(0.5 * (reduced + reduced.T))[1])


def uncertainty(squares: Array, shapes: Array, K_error: Array) -> Array:
    """What errors of K can do to each square: to first order, and by rounding of the shapes."""
    sizes = np.abs(shapes) + EPS * np.abs(shapes).sum(axis=1, keepdims=True)
    bound = np.einsum("ik,ij,jk->k", sizes, K_error, sizes)
    return np.asarray(np.maximum(bound, ROUNDING * EPS * np.abs(squares).max(initial=0.0)))


def verdict(
    second: SecondOrder | None,
    A: Array,
    residual: Array | None = None,
    error: float = ROUNDING,
    errors: Array | None = None,
) -> str:
    """The stability of s' = A s.

    Parameters
    ----------
    second : SecondOrder or None
        The same equations of second order, where they have that form: displacements z, then velocities z'.
    A : (n, n) array
    own, error, errors
        As for :func:`~.linearization.stability_of_matrix`, which decides where the signs of K and C do not.
    """
    if second is None or not A.size or not _is_dissipative(second):
        return stability_of_matrix(A, residual, error, errors)
    squares, shapes = symmetric_modes(second.M, 0.5 * (second.K + second.K.T))
    bound = uncertainty(squares, shapes, second.K_error)
    if (squares < -bound).any():
        gyroscopic = np.abs(second.C - second.C.T) > second.C_error + second.C_error.T
        return stability_of_matrix(A, residual, error, errors) if gyroscopic.any() else "unstable"
    if (squares <= bound).any():
        return "marginal"
    result = stability_of_matrix(A, residual, error, errors)
    return result if result == "asymptotically stable" else "stable (undamped)"  # a least potential


def _is_dissipative(second: SecondOrder) -> bool:
    """Whether K is symmetric and C takes no energy from anywhere, up to their errors."""
    K, C, M = second.K, second.C, second.M
    if (np.abs(K - K.T) > second.K_error + second.K_error.T).any():
        return False
    if not np.isfinite(C).all():
        return False
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(M))
    except np.linalg.LinAlgError:
        return False
    rates, shapes = algebra.eigh(inverse @ (0.5 * (C + C.T)) @ inverse.T)
    sizes = np.abs(inverse.T @ shapes)
    bound = np.einsum("ik,ij,jk->k", sizes, second.C_error, sizes)
    return bool((rates >= -bound - ROUNDING * np.abs(rates).max(initial=0.0)).all())


# -- the result --------------------------------------------------------------------------------------------------------


class Linearization(Result):
    """Linear equations of the motion near a state: ``s' = drift + A s + B du``, ``dy = C s + D du``.

    In the minimal form s holds the n_z independent displacements, then the n_dof independent velocities; in the full
    form it is the change of x.  At a steady motion the matrices are those of the motion with respect to it.

    Attributes
    ----------
    A, B, C, D : arrays (n, n), (n, n_u), (n_y, n), (n_y, n_u)
    states, inputs, outputs : tuple of str
        Names of the rows and columns; a small rotation in the place of Euler parameters is ``<joint>_rx, _ry, _rz``.
    x : (n_x,) array
        The state, projected onto the constraints.
    t : float
    u : (n_u,) array
    drift : (n,) array
        Rates at the state itself; 0 at an equilibrium.  The last n_dof are the accelerations: 0 in a steady motion.
    mass : (n_dof, n_dof) array or None
    damping : (n_dof, n_dof) array or None
        Gyroscopic terms included.
    stiffness : (n_dof, n_z) array or None
        ``mass w' + damping w + stiffness z = forces`` for displacements z and velocities w; symmetric at an
        equilibrium of conservative forces.  None in the full form.
    velocity_names, position_names : tuple of str
        Of w and z.
    """

    KEYS = (
        {"x": "state"}
        | same_keys("states", "inputs", "outputs", "A", "B", "C", "D", "mass", "damping", "stiffness", "drift")
        | {"velocities": "velocity_names", "positions": "position_names"}
        | {"equilibrium": "is_equilibrium", "steady": "is_steady"}
        | same_keys("eigenvalues", "stability")
    )

    def __init__(
        self,
        layout: Layout,
        t: float,
        x: Array,
        u: Array,
        matrices: tuple[Array, Array, Array, Array],
        states: tuple[str, ...],
        drift: Array,
        second: tuple[Array, Array, Array] | None = None,
        tangent: TangentSpace | None = None,
        residual: Array | None = None,
    ) -> None:
        self.own_forces = residual  # accelerations of the model's own forces, scaled (1/s^2)
        self.layout, self.name, self.t, self.x, self.u = layout, layout.name, t, x, u
        self.A, self.B, self.C, self.D = matrices
        self.states, self.inputs, self.outputs, self.drift = states, layout.u, layout.y, drift
        self.mass: Array | None = None
        self.damping: Array | None = None
        self.stiffness: Array | None = None
        if second is not None:
            self.mass, self.damping, self.stiffness = second
        self.tangent = tangent
        n_z = layout.n_q if tangent is None else len(states) - len(tangent.velocities)
        self.position_names, self.velocity_names = states[:n_z], states[n_z:]

    @property
    def state(self) -> dict[str, float]:
        """x by name."""
        return dict(zip(self.layout.x, self.x.tolist(), strict=True))

    @property
    def to_x(self) -> Array:
        """(n_x, n) array: dx = to_x @ s is the change of the state x; columns are tangent to the constraints.

        A small rotation changes the four Euler parameters of its joint, dependent coordinates follow the independent
        ones.  In the full form it is the identity.
        """
        return np.eye(len(self.states)) if self.tangent is None else np.array(self.tangent.T, dtype=float)

    @cached_property
    def _sorted(self) -> tuple[Any, Any]:
        values, vectors = algebra.eig(self.A)
        order = np.lexsort((values.imag, np.round(values.real, 9), np.round(np.abs(values), 9)))
        return values[order], vectors[:, order]

    @property
    def eigenvalues(self) -> Any:
        """(n,) complex array (1/s), slow ones first; pairs stand together."""
        return np.asarray(self._sorted[0], dtype=complex)

    @property
    def eigenvectors(self) -> Any:
        """(n, n) complex array; columns in the order of the eigenvalues, of length 1."""
        return np.asarray(self._sorted[1], dtype=complex)

    @property
    def is_equilibrium(self) -> bool:
        """Whether the state is an equilibrium, up to 1e-7 in units of the length scale, radians and seconds.

        Where the model's own forces are weaker than that, accelerations are compared with those that they would make.
        """
        n = len(self.position_names)
        return self.is_steady and bool((np.abs(self._scaled_drift[:n]) <= STILL).all())

    @property
    def is_steady(self) -> bool:
        """Whether the state belongs to a steady motion: no velocity changes, up to 1e-7.

        Where forces are stiff, up to what a relative rounding of the state (100 eps) makes of them.
        """
        left = np.abs(self._scaled_drift[len(self.position_names) :])
        return bool((left <= np.maximum(STILL * self._forces, self._rounding)).all())

    @property
    def _rounding(self) -> Array | float:
        """Accelerations (n_dof,) that rounding of the state alone can make, scaled."""
        if self.tangent is None:
            return 0.0
        n, layout, tangent = len(self.position_names), self.layout, self.tangent
        s, places = layout.scales.q, layout.place_scales.q
        v = np.abs(self.x[layout.n_q :][tangent.velocities])
        moves = np.abs(self.A[n:, :n]) @ places[tangent.positions] + np.abs(self.A[n:, n:]) @ v
        return np.asarray(BALANCED * moves / s[tangent.velocities])

    @property
    def _forces(self) -> float:
        """Accelerations that count, at most 1: those of the model's own forces, or their change over a unit."""
        if self.own_forces is None or self.tangent is None:
            return 1.0
        n, s = len(self.position_names), self.layout.scales.q
        slopes = np.abs(self.A[n:, :n]) * s[self.tangent.positions] / s[self.tangent.velocities, None]
        return min(1.0, max(float(self.own_forces.max(initial=0.0)), float(slopes.max(initial=0.0))))

    @property
    def _scaled_drift(self) -> Array:
        layout, tangent = self.layout, self.tangent
        s = layout.scales.q
        if tangent is None:
            plain = np.array([layout.length if kind == "length" else 1.0 for kind in layout.coordinate_kinds])
            return np.asarray(self.drift / np.concatenate([plain, s]))
        places = layout.place_scales.q[tangent.positions]
        return np.asarray(self.drift / np.concatenate([places, s[tangent.velocities]]))

    @property
    def stability(self) -> str:
        """By the largest real part of the eigenvalues: 'asymptotically stable', 'marginal' or 'unstable'.

        'stable (undamped)' at a minimum of the potential energy that not all motions come to rest at; 'no freedom'
        where drivers and constraints hold everything.

        'marginal' where rounding alone could move one of them to the imaginary axis, and none is beyond it: the linear
        equations do not decide.  Where the stiffness is symmetric and nothing drives the motion, the sign of the
        stiffness decides.
        """
        if self.mass is None or self.tangent is None or self.own_forces is None:
            return verdict(None, self.A, self.own_forces)
        M, n = self.mass, len(self.position_names)
        errors = np.zeros_like(self.A)
        if M.size:
            C_error = MARGIN * np.abs(M) @ np.abs(self.A[n:, n:])
            errors[n:] = np.abs(algebra.inv(M)) @ np.hstack([self.stiffness_error, C_error])
            errors[self.A == 0.0] = 0.0  # no force at all, or one that rounding has not touched
        return verdict(self._second(), self.A, self.own_forces, errors=errors)

    @property
    def stiffness_error(self) -> Array:
        """Bounds (n_dof, n_z) for what rounding does to the stiffness."""
        assert self.mass is not None
        assert self.own_forces is not None
        assert self.tangent is not None
        n = len(self.position_names)
        residual = np.zeros(0) if n != len(self.mass) else self.own_forces
        return stiffness_errors(self.mass, self.A[n:, :n], residual, self.layout.place_scales.q[self.tangent.positions])

    def _second(self) -> SecondOrder | None:
        """The equations of second order, where z' = w and nothing accelerates."""
        assert self.mass is not None
        assert self.damping is not None
        assert self.stiffness is not None
        n, M, A = len(self.position_names), self.mass, self.A
        if n != len(M) or not n or not self.is_equilibrium:
            return None
        assert self.tangent is not None
        s = self.layout.scales.q[self.tangent.positions]
        kinematic = np.hstack([A[:n, :n], A[:n, n:] - np.eye(n)]) * np.concatenate([s, s]) / s[:, None]
        if (np.abs(kinematic) > BALANCED).any():
            return None
        left = np.abs(M @ self.drift[n:])  # what is not in balance turns with the axes
        C_error = MARGIN * np.abs(M) @ np.abs(A[n:, n:])
        K_error = self.stiffness_error + np.maximum(left, left[:, None])
        return SecondOrder(M, self.damping, self.stiffness, C_error, K_error)

    def second_order(self, *names: str) -> tuple[Array, Array, Array]:
        """M, C, K of ``M z'' + C z' + K z = 0``, square.

        Parameters
        ----------
        *names : str
            Coordinates to keep; by default all independent ones.  They must not depend on the others.

        Returns
        -------
        M, C, K : (k, k) arrays

        Raises
        ------
        UsageError
            The full form has none; a name is unknown; other coordinates act on those named, or they are not the
            integrals of the velocities (nonholonomic constraints).
        """
        if self.mass is None or self.damping is None or self.stiffness is None:
            if self.layout.general_rates:
                raise cannot("no second-order form: the rates of the coordinates are given as functions; use A")
            raise cannot("the full form has no second-order form; linearize with form='minimal'")
        chosen = names or self.position_names
        rows = []
        positions, tangent = list(self.position_names), self.tangent
        assert tangent is not None
        check_names("independent coordinate", chosen, positions)
        for name in chosen:
            which = np.flatnonzero(tangent.velocities == tangent.positions[positions.index(name)])
            if not which.size:
                raise cannot(
                    f"the rate of {name} is not one of the independent velocities ({', '.join(self.velocity_names)}), "
                    f"so {name} has no equation of second order; name coordinates whose rates are independent"
                )
            rows.append(int(which[0]))
        columns = [positions.index(name) for name in chosen]
        matrices = []
        for label, matrix, kept in (("M", self.mass, rows), ("C", self.damping, rows), ("K", self.stiffness, columns)):
            others = np.delete(matrix[rows], kept, axis=1)
            size = float(np.abs(matrix).max(initial=0.0))
            if others.size and float(np.abs(others).max()) > COUPLED * size:
                worst = int(np.abs(others).max(axis=0).argmax())
                have = positions if label == "K" else [str(n) for n in self.velocity_names]
                other = [n for k, n in enumerate(have) if k not in kept][worst]
                raise cannot(f"{other} acts on {', '.join(chosen)} through {label}; name {other} too")
            matrices.append(matrix[np.ix_(rows, kept)])
        kinematic = self.A[np.ix_(columns, range(len(positions), len(self.states)))] - np.eye(self.layout.n_dof)[rows]
        if np.abs(kinematic).max(initial=0.0) > COUPLED or np.abs(self.A[columns, : len(positions)]).max() > COUPLED:
            raise cannot(f"the rates of {', '.join(chosen)} depend on other velocities too; use A, B, C, D")
        return matrices[0], matrices[1], matrices[2]

    def state_space(self) -> Any:
        """The system as a ``scipy.signal.StateSpace``.

        Raises
        ------
        UsageError
            The model has no inputs or no outputs.
        MissingDependencyError
            SciPy is not installed.
        """
        signal = require("scipy.signal", "scipy", "state_space")
        if not self.inputs or not self.outputs:
            missing = "inputs" if not self.inputs else "outputs"
            raise cannot(
                f"StateSpace needs inputs and outputs, and model {self.name!r} has no {missing}; use A, B, C, D"
            )
        return signal.StateSpace(self.A, self.B, self.C, self.D)

    def ss(self) -> Any:
        """The system as a ``control.StateSpace`` of python-control, with the names of states, inputs and outputs.

        Raises
        ------
        MissingDependencyError
            python-control is not installed.
        """
        control = require("control", "control", "ss")
        names = {"states": list(self.states), "inputs": list(self.inputs), "outputs": list(self.outputs)}
        return control.ss(self.A, self.B, self.C, self.D, name=self.name, **names)

    @property
    def title(self) -> str:
        return f"Linearization of {self.name}"

    @property
    def facts(self) -> list[tuple[str, str]]:
        kind = "equilibrium" if self.is_equilibrium else "steady motion" if self.is_steady else "no steady motion"
        lines = [("at", f"{kind}, t = {self.t:.6g} s"), ("states", ", ".join(self.states))]
        lines += [("inputs", ", ".join(self.inputs) or "-"), ("outputs", ", ".join(self.outputs) or "-")]
        if kind == "no steady motion":
            worst = int(np.abs(self._scaled_drift).argmax())
            lines.append(("largest drift", f"{self.states[worst]}, {self.drift[worst]:.6g}"))
        lines.append(("eigenvalues", ", ".join(number(value) for value in self.eigenvalues)))
        frozen = " (of the equations frozen at this time)" if kind == "no steady motion" and self.A.size else ""
        return [*lines, ("stability", self.stability + frozen)]

    @property
    def tables(self) -> list[ResultTable]:
        """A, B, C and D, those that have entries."""
        result = []
        for title, rows, columns in (
            ("A", self.states, self.states),
            ("B", self.states, self.inputs),
            ("C", self.outputs, self.states),
            ("D", self.outputs, self.inputs),
        ):
            entries = iter(without_noise(getattr(self, title).ravel().tolist()))
            if rows and columns:
                lines = [[name, *(next(entries) for _ in columns)] for name in rows]
                result.append(ResultTable(["", *columns], lines, title))
        return result


def without_noise(
    values: Sequence[float], units: Sequence[str] | None = None, sizes: Sequence[float] | None = None
) -> list[float]:
    """Values for a table, 0 where one is nothing beside the largest of its unit.

    Parameters
    ----------
    values : sequence of float
    units : sequence of str, optional
        Of each; one for all by default.
    sizes : sequence of float, optional
        What each value is like elsewhere, over a run for instance; by default the values themselves.
    """
    units = units or [""] * len(values)
    largest = dict.fromkeys(units, 0.0)
    for unit, size in zip(units, sizes if sizes is not None else values, strict=True):
        largest[unit] = max(largest[unit], abs(size)) if isfinite(size) else largest[unit]
    return [0.0 if abs(x) <= ROUNDED_ZERO * largest[unit] else float(x) for x, unit in zip(values, units, strict=True)]
