"""Analysis: the result of a linearization, its eigenvalues and its second-order form."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import COUPLED, STILL
from ..base.texts import as_html, as_text, number
from ..errors import cannot
from ..runtime.near_names import require, unknown
from .eigenvalue_rounding import BALANCED
from .stability import MARGIN, SecondOrder, stiffness_errors, verdict

if TYPE_CHECKING:
    from ..runtime.layout import Layout
    from .tangent import TangentSpace


class Linearization:
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
        own: Array | None = None,
    ) -> None:
        self.own = own  # accelerations of the model's own forces, scaled (1/s^2)
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
        if self.own is None or self.tangent is None:
            return 1.0
        n, s = len(self.position_names), self.layout.scales.q
        slopes = np.abs(self.A[n:, :n]) * s[self.tangent.positions] / s[self.tangent.velocities, None]
        return min(1.0, max(float(self.own.max(initial=0.0)), float(slopes.max(initial=0.0))))

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
        if self.mass is None or self.tangent is None or self.own is None:
            return verdict(None, self.A, self.own)
        M, n = self.mass, len(self.position_names)
        errors = np.zeros_like(self.A)
        if M.size:
            C_error = MARGIN * np.abs(M) @ np.abs(self.A[n:, n:])
            errors[n:] = np.abs(algebra.inv(M)) @ np.hstack([self.stiffness_error, C_error])
            errors[self.A == 0.0] = 0.0  # no force at all, or one that rounding has not touched
        return verdict(self._second(), self.A, self.own, errors=errors)

    @property
    def stiffness_error(self) -> Array:
        """Bounds (n_dof, n_z) for what rounding does to the stiffness."""
        assert self.mass is not None
        assert self.own is not None
        assert self.tangent is not None
        n = len(self.position_names)
        own = np.zeros(0) if n != len(self.mass) else self.own
        return stiffness_errors(self.mass, self.A[n:, :n], own, self.layout.place_scales.q[self.tangent.positions])

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
            if self.layout.given_rates:
                raise cannot("no second-order form: the rates of the coordinates are given as functions; use A")
            raise cannot("the full form has no second-order form; linearize with form='minimal'")
        chosen = names or self.position_names
        rows = []
        positions, tangent = list(self.position_names), self.tangent
        assert tangent is not None
        for name in chosen:
            if name not in positions:
                raise unknown("independent coordinate", name, positions)
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
    def facts(self) -> list[tuple[str, str]]:
        """Label and value of each line of the description."""
        kind = "equilibrium" if self.is_equilibrium else "steady motion" if self.is_steady else "no steady motion"
        lines = [("at", f"{kind}, t = {self.t:.6g} s"), ("states", ", ".join(self.states))]
        lines += [("inputs", ", ".join(self.inputs) or "-"), ("outputs", ", ".join(self.outputs) or "-")]
        if kind == "no steady motion":
            worst = int(np.abs(self._scaled_drift).argmax())
            lines.append(("largest drift", f"{self.states[worst]}, {self.drift[worst]:.6g}"))
        lines.append(("eigenvalues", ", ".join(number(value) for value in self.eigenvalues)))
        frozen = " (of the equations frozen at this time)" if kind == "no steady motion" and self.A.size else ""
        return [*lines, ("stability", self.stability + frozen)]

    def __repr__(self) -> str:
        return as_text(f"Linearization of {self.name}", self.facts)

    def _repr_html_(self) -> str:
        return as_html(f"Linearization of {self.name}", self.facts)
