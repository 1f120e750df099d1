"""Stage runtime: inner NumPy blocks of one model -> its kernels that need linear algebra or iterations.

Each driver has the signature of a block for a single state: ``f(t, x, u, c) -> out``.  The algorithms are those of
:mod:`..numeric`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from ..base import algebra
from ..base.algebra import Array, correlated
from ..base.limits.crossings import NEAR, UNTOLD
from ..base.limits.numbers import SINGULAR
from ..errors import PartitionError, SingularMassMatrixError, UnsolvedError
from ..numeric import embedded, passing, projection
from ..numeric.dependent import kinematics as kinematics_of
from ..numeric.partitions import partition
from ..numeric.scales import GivenRates, Scales
from ..numeric.shifts import Shifts, shift_jacobian
from ..numeric.system import Balanced, Pattern
from .layout import Layout

#: driver -> blocks it is made from; a tree needs neither position nor rate
NEEDS = {
    "rhs": ("terms",),
    "jacobian": ("terms",),
    "mass_matrix": ("terms",),
    "embedded_mass_matrix": (),
    "bias": ("terms",),
    "constraints": ("position",),
    "constraint_jacobian": ("position",),
    "velocity_constraints": ("position", "rate"),
    "project": (),
    "outputs": ("accelerated_outputs",),
    "kinematics": (),
}

#: derivatives by something other than the state -> the residuals along it, and the accelerations where those are known
SHIFTS = {"input_jacobian": "input_shift", "parameter_jacobian": "parameter_shift"}
SHIFTED = {"input_jacobian": "input_acceleration", "parameter_jacobian": "parameter_acceleration"}

#: kernels whose columns are derivatives along directions -> the block of one
ALONG = {"dae_jacobian": "dae_tangent", "inverse_dynamics_derivatives": "inverse_tangent"}

#: (t, x, u, c) -> [x, x', anything] of the projected state, and the weakest pivot there
Motion: TypeAlias = Callable[[float, Array, Array, Array], tuple[Array, float]]


class Drivers:
    """The kernels of one model that are not straight-line.

    Parameters
    ----------
    layout : Layout
    blocks : mapping of str to callable
        ``f(t, x, u, c) -> (n_out, ...)``.
    """

    def __init__(self, layout: Layout, blocks: Mapping[str, Callable[..., Any]]) -> None:
        self.layout = layout
        self.blocks = blocks
        loops = layout.n_c > 0
        names = [name for name, needs in NEEDS.items() if all(block in blocks for block in needs)]
        if "residual_jacobian" not in blocks and "residual_tangent" not in blocks:
            names = [name for name in names if name != "jacobian"]
        if not loops:
            names = [n for n in names if n not in ("constraints", "constraint_jacobian", "velocity_constraints")]
        elif "position" not in blocks or "rate" not in blocks:
            names = [n for n in names if n not in ("rhs", "jacobian", "project", "outputs", "kinematics")]
        if "terms" not in blocks and "rhs" not in blocks:
            names = [n for n in names if n != "outputs"]
        if "mass_times" in blocks:
            names += ["mass_matrix", "embedded_mass_matrix"]
        elif "terms" not in blocks and ("mass_matrix" not in blocks or (loops and "position" not in blocks)):
            names = [n for n in names if n != "embedded_mass_matrix"]
        if "acceleration_tangent" in blocks:
            names.append("jacobian")
        names += [name for name, what in SHIFTS.items() if not blocks.keys().isdisjoint((what, SHIFTED[name]))]
        if loops and "terms" not in blocks:
            names = [n for n in names if n != "kinematics"]
        if "system" in blocks:
            self.pattern = Pattern(layout.metadata["system"])
            names += ["rhs", *(["outputs"] if "accelerated_outputs" in blocks else [])]
            if not layout.projects and ("residual_jacobian" in blocks or "residual_tangent" in blocks):
                names.append("jacobian")
        self.names = (*names, *(name for name, block in ALONG.items() if block in blocks))
        self._scales: tuple[Array, Scales] | None = None

    def make(self, name: str) -> Callable[..., Array]:
        """The driver of a kernel."""
        driver: Callable[..., Array] = getattr(self, f"_{name}")
        return driver

    def singular(self, name: str, t: float, x: Array, u: Array, c: Array) -> int:
        """The status of a result that is not finite: 2 if a singular mass matrix is why, else 1."""
        known = "mass_matrix" in self.blocks or "mass_times" in self.blocks
        if name in ("rhs", "jacobian", "outputs", *SHIFTS) and known and not self.layout.n_c:
            M = self._matrix(t, x[: self.layout.n_q], u, c)
            if np.isfinite(M).all() and algebra.eigvalsh(correlated(M))[0] <= SINGULAR:
                return 2
        return 1

    # what numeric/ wants as functions of q and v, at one time and with one set of constants

    def scales(self, c: Array) -> Scales:
        """The scales for a set of constants; the last ones are kept."""
        if "scales" not in self.blocks:
            return self.layout.scales
        kept = self._scales  # read once: another thread may replace it
        if kept is None or kept[0] is not c:
            values = np.asarray(self.blocks["scales"](0.0, np.empty(0), np.empty(0), c), dtype=float)
            n = self.layout.n_v
            self._scales = kept = (c, self.layout.scales._replace(q=values[:n], c=values[n:]))
        return kept[1]

    def position(self, t: float, u: Array, c: Array, q: Array) -> tuple[Array, Array]:
        """C (h,) of the holonomic rows, C_q (m, n) of all."""
        h, m, n = self.layout.n_h, self.layout.n_c, self.layout.n_v
        if not m:
            return np.empty(0), np.empty((0, n))
        flat = np.asarray(self.blocks["position"](t, q, u, c), dtype=float)
        return flat[:h], flat[h:].reshape(m, n)

    def rate(self, t: float, u: Array, c: Array, q: Array) -> Array:
        """C_t (m,)."""
        return np.asarray(self.blocks["rate"](t, q, u, c), dtype=float) if self.layout.n_c else np.empty(0)

    def terms(self, t: float, u: Array, c: Array, q: Array, v: Array) -> embedded.Terms:
        """M, h, C_q, gamma."""
        flat = np.asarray(self.blocks["terms"](t, np.concatenate([q, v]), u, c), dtype=float)
        indefinite = bool(self.layout.metadata.get("indefinite"))
        return embedded.unpack_terms(flat, self.layout.n_v, self.layout.n_c, indefinite)

    def residuals(
        self, t: float, u: Array, c: Array, q: Array, v: Array, a: Array, l: Array
    ) -> embedded.DynamicsSlopes:
        """The derivatives of the residuals."""
        n, m, n_q = self.layout.n_v, self.layout.n_c, self.layout.n_q
        x = np.concatenate([q, v, a, l])
        shapes = ((n, n_q), (n, n), (m, n_q), (m, n), (m, n_q))
        if "residual_jacobian" in self.blocks:
            flat = np.asarray(self.blocks["residual_jacobian"](t, x, u, c), dtype=float)
            parts = np.split(flat, np.cumsum([k * width for k, width in shapes[:-1]]))
            return embedded.DynamicsSlopes(*(part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)))
        directions = np.eye(n_q + n)
        x = np.vstack([np.repeat(x[:, None], n_q + n, axis=1), directions])
        flat = np.asarray(self.blocks["residual_tangent"](t, x, u, c), dtype=float)
        r1, r2, r3 = np.split(flat, [n, n + m])
        return embedded.DynamicsSlopes(r1[:, :n_q], r1[:, n_q:], r2[:, :n_q], r2[:, n_q:], r3[:, :n_q])

    def _bound(self, t: float, u: Array, c: Array) -> tuple[Any, Any, Any]:
        return (partial(f, t, u, c) for f in (self.terms, self.position, self.rate))  # type: ignore[return-value]

    def given(self, t: float, u: Array, c: Array) -> GivenRates | None:
        """The rates of the coordinates where they are given, else None."""
        if not self.layout.given_rates:
            return None
        layout, blocks = self.layout, self.blocks
        n_q, n, m = layout.n_q, layout.n_v, layout.n_c

        def along(name: str, q: Array, v: Array, dq: Array, dv: Array) -> Array:
            fixed = np.concatenate([q, v, np.zeros(n + m)])
            changes = np.concatenate([dq, dv])
            if changes.ndim == 2:
                fixed = np.repeat(fixed[:, None], changes.shape[1], axis=1)
            return np.asarray(blocks[name](t, np.concatenate([fixed, changes]), u, c), dtype=float)

        return GivenRates(
            lambda q, v: np.asarray(blocks["rates"](t, np.concatenate([q, v]), u, c), dtype=float),
            lambda q, dv: along("moved", q, np.zeros(n), np.zeros((n_q, *dv.shape[1:])), dv),
            partial(along, "rates_along"),
            lambda q: np.asarray(blocks["coordinate_slopes"](t, q, u, c), dtype=float).reshape(layout.n_h, n_q),
        )

    # drivers

    def _rhs(self, t: float, x: Array, u: Array, c: Array) -> Array:
        layout = self.layout
        if "system" in self.blocks and not (layout.n_c and layout.projects):
            return np.concatenate([layout.scales.rates(x[: layout.n_q], x[layout.n_q :]), self._solve(t, x, u, c)[0]])
        return self._across(self._motion, t, x, u, c)[layout.n_x :]

    def _motion(self, t: float, x: Array, u: Array, c: Array) -> tuple[Array, float]:
        """[x, x'] of the projected state, and the weakest pivot there."""
        n, layout, scales = self.layout.n_q, self.layout, self.scales(c)
        if "system" in self.blocks:
            x, weakest = self._closed(t, x, u, c)
            return np.concatenate([x, scales.rates(x[:n], x[n:]), self._solve(t, x, u, c)[0]]), weakest
        terms, position, rate = self._bound(t, u, c)
        given = self.given(t, u, c)
        return embedded.motion(terms, position, rate, x[:n], x[n:], scales, layout.rank, layout.independent, given)

    def _closed(self, t: float, x: Array, u: Array, c: Array) -> tuple[Array, float]:
        """The projected state, and the weakest pivot there."""
        layout, n, scales = self.layout, self.layout.n_q, self.scales(c)
        _, position, rate = self._bound(t, u, c)
        q, v = projection.project(position, rate, x[:n], x[n:], scales, self.given(t, u, c))
        weakest = 1.0
        if layout.n_c:
            try:
                J = scales.jacobian(position(q)[1])
                weakest = partition(J, layout.rank, layout.independent, sizes=scales.row_sizes(J)).weakest
            except PartitionError:
                weakest = 0.0
        return np.concatenate([q if layout.space is None else layout.space.normalised(q), v]), weakest

    def _across(self, function: Motion, t: float, x: Array, u: Array, c: Array) -> Array:
        """What a function makes of a state; next to a change point from states on both sides of it."""
        try:
            values, weakest = function(t, x, u, c)
        except (PartitionError, UnsolvedError):
            better = self._better(function, t, x, u, c, self._closed(t, x, u, c)[1])
            if better is None:
                raise
            return better
        better = self._better(function, t, x, u, c, weakest)
        if better is None and weakest < UNTOLD:
            raise PartitionError("no closed position is told from the change point that is here")
        return values if better is None else better

    def _better(self, function: Motion, t: float, x: Array, u: Array, c: Array, weakest: float) -> Array | None:
        """The same from states on both sides of a change point, where that is better."""
        layout, n, scales = self.layout, self.layout.n_q, self.scales(c)
        if not layout.n_c or layout.given_rates or not weakest < NEAR:
            return None
        around = passing.Around(
            lambda at: partial(self.position, at, u, c), scales, layout.rank, layout.independent,
            t, x[:n], x[n:], bool(self.rate(t, u, c, x[:n]).any()),
        )  # fmt: skip
        found = passing.across(around, lambda at, q, v: function(at, np.concatenate([q, v]), u, c)[0], weakest)
        if found is not None and layout.space is not None:
            found[:n] = layout.space.normalised(found[:n])
        return found

    def _jacobian(self, t: float, x: Array, u: Array, c: Array) -> Array:
        n, layout = self.layout.n_q, self.layout
        if "acceleration_tangent" in self.blocks:
            unit, space = np.eye(layout.n_x), layout.space
            along = np.vstack([np.repeat(x[:, None], layout.n_x, axis=1), unit])
            changes = np.asarray(self.blocks["acceleration_tangent"](t, along, u, c), dtype=float)
            dq, dv = unit[:n], unit[n:]
            return np.vstack([dv if space is None else space.change(x[:n], dq, x[n:, None], dv), changes])
        if not layout.projects:
            return self._jacobian_given(t, x, u, c)
        return self._across(self._derivative, t, x, u, c)[2 * layout.n_x :].reshape(layout.n_x, layout.n_x)

    def _derivative(self, t: float, x: Array, u: Array, c: Array) -> tuple[Array, float]:
        """[x, x', dx'/dx row by row] of the projected state, and the weakest pivot there."""
        n, layout = self.layout.n_q, self.layout
        values, weakest = self._motion(t, x, u, c)
        terms, position, rate = self._bound(t, u, c)
        residuals = partial(self.residuals, t, u, c)
        given, scales = self.given(t, u, c), self.scales(c)
        slopes = embedded.jacobian(
            terms, residuals, position, rate, x[:n], x[n:], scales, layout.rank, layout.independent, given
        )
        return np.concatenate([values, slopes.ravel()]), weakest

    def _input_jacobian(self, t: float, x: Array, u: Array, c: Array) -> Array:
        return self._shift("input_jacobian", self.layout.n_u, t, x, u, c)

    def _parameter_jacobian(self, t: float, x: Array, u: Array, c: Array) -> Array:
        return self._shift("parameter_jacobian", self.layout.n_p, t, x, u, c)

    def _shift(self, name: str, count: int, t: float, x: Array, u: Array, c: Array) -> Array:
        """dx' for the unit change of each of the inputs or parameters."""
        layout, unit = self.layout, np.eye(count)
        n_q, n, h, m = layout.n_q, layout.n_v, layout.n_h, layout.n_c

        def along(block: str, *state: Array) -> Array:
            at = np.concatenate(state)
            columns = np.vstack([np.repeat(at[:, None], count, axis=1), unit])
            return np.asarray(self.blocks[block](t, columns, u, c), dtype=float)

        if SHIFTED[name] in self.blocks:
            return np.vstack([np.zeros((n_q, count)), along(SHIFTED[name], x)])
        terms, position, rate = self._bound(t, u, c)

        def shifts(*state: Array) -> Shifts:
            return Shifts(*np.split(along(SHIFTS[name], *state), np.cumsum([h, n, m])))

        residuals = partial(self.residuals, t, u, c)
        return shift_jacobian(
            terms, residuals, shifts, position, rate, x[:n_q], x[n_q:], self.scales(c), layout.rank, layout.independent
        )

    def _solve(self, t: float, x: Array, u: Array, c: Array) -> tuple[Array, Array, Balanced]:
        """Accelerations (n_v,) at a state by the method's linear system, all its unknowns, and its factors."""
        flat = np.asarray(self.blocks["system"](t, x, u, c), dtype=float)
        places = len(self.pattern.places[0])
        entries, r, sizes = np.split(flat, [places, places + self.pattern.size])
        system = self.pattern.balance(entries, sizes)
        z = system.solve(r)
        a = self.blocks["joint_accelerations"](t, np.concatenate([x, z]), u, c)
        return np.asarray(a, dtype=float), z, system

    def _dae_jacobian(self, t: float, x: Array, u: Array, c: Array) -> Array:
        n = self.layout.n_dae
        along = np.vstack([np.repeat(x[: 2 * n, None], n, axis=1), np.eye(n), x[2 * n] * np.eye(n)])
        return np.asarray(self.blocks["dae_tangent"](t, along, u, c), dtype=float)

    def _inverse_dynamics_derivatives(self, t: float, x: Array, u: Array, c: Array) -> Array:
        along = np.vstack([np.repeat(x[:, None], len(x), axis=1), np.eye(len(x))])
        return np.asarray(self.blocks["inverse_tangent"](t, along, u, c), dtype=float)

    def _jacobian_given(self, t: float, x: Array, u: Array, c: Array) -> Array:
        """The derivative of a right-hand side that does not project: K [da; dl] = -[dr1; dr2]."""
        layout = self.layout
        n, n_q, space = layout.n_v, layout.n_q, layout.space
        q, v = x[:n_q], x[n_q:]
        a, z, system = self._solve(t, x, u, c)
        r = self.residuals(t, u, c, q, v, a, z[n:])
        right = np.vstack([np.hstack([r.r1_q, r.r1_v]), np.hstack([r.r2_q, r.r2_v])])
        da = system.solve(-right)[:n]
        dq, dv = np.eye(n_q, n_q + n), np.eye(n, n_q + n, n_q)
        return np.vstack([dv if space is None else space.change(q, dq, v[:, None], dv), da])

    def _matrix(self, t: float, q: Array, u: Array, c: Array) -> Array:
        """M, written out or column by column."""
        n = self.layout.n_v
        if "mass_matrix" in self.blocks:
            return np.asarray(self.blocks["mass_matrix"](t, q, u, c), dtype=float).reshape(n, n)
        return self._mass_matrix(t, q, u, c)

    def _mass_matrix(self, t: float, x: Array, u: Array, c: Array) -> Array:
        if "mass_times" in self.blocks:
            columns = np.vstack([np.repeat(x[:, None], self.layout.n_v, axis=1), np.eye(self.layout.n_v)])
            M = np.asarray(self.blocks["mass_times"](t, columns, u, c), dtype=float)
            return np.asarray(np.triu(M) + np.triu(M, 1).T)
        return self.terms(t, u, c, x, np.zeros(self.layout.n_v)).M

    def _bias(self, t: float, x: Array, u: Array, c: Array) -> Array:
        return self.terms(t, u, c, x[: self.layout.n_q], x[self.layout.n_q :]).h

    def _embedded_mass_matrix(self, t: float, x: Array, u: Array, c: Array) -> Array:
        layout = self.layout
        M = self._matrix(t, x, u, c)
        C_q = self.position(t, u, c, x)[1]
        return embedded.embedded_mass(M, C_q, self.scales(c), layout.rank, layout.independent)

    def _constraints(self, t: float, x: Array, u: Array, c: Array) -> Array:
        return self.position(t, u, c, x)[0]

    def _constraint_jacobian(self, t: float, x: Array, u: Array, c: Array) -> Array:
        return self.position(t, u, c, x)[1]

    def _velocity_constraints(self, t: float, x: Array, u: Array, c: Array) -> Array:
        q, v = x[: self.layout.n_q], x[self.layout.n_q :]
        return np.asarray(self.position(t, u, c, q)[1] @ v + self.rate(t, u, c, q))

    def _project(self, t: float, x: Array, u: Array, c: Array) -> Array:
        closed, weakest = self._closed(t, x, u, c)
        moves = "rhs" in self.names and self.layout.projects and (closed != x).any()
        better = self._better(self._motion, t, x, u, c, weakest) if moves else None
        return closed if better is None else better[: self.layout.n_x]

    def _outputs(self, t: float, x: Array, u: Array, c: Array) -> Array:
        x = self._project(t, x, u, c)
        if not self.layout.metadata.get("output_accelerations", True):  # positions and velocities need no masses
            a = np.zeros(self.layout.n_v)
        elif "system" in self.blocks:
            a = self._solve(t, x, u, c)[0]
        else:
            x_dot = self.blocks["rhs"](t, x, u, c) if "rhs" in self.blocks else self._rhs(t, x, u, c)
            a = np.asarray(x_dot, dtype=float)[self.layout.n_q :]
        if not np.isfinite(a).all() and self.singular("outputs", t, x, u, c) == 2:
            raise SingularMassMatrixError("the mass matrix is singular")
        return np.asarray(self.blocks["accelerated_outputs"](t, np.concatenate([x, a]), u, c), dtype=float)

    def _kinematics(self, t: float, x: Array, u: Array, c: Array) -> Array:
        layout, k = self.layout, self.layout.n_dof
        free = k - layout.n_states
        q_i, v_i, a_i, guess = np.split(x, (free, free + k, free + 2 * k))
        terms, position, rate = self._bound(t, u, c)
        return np.concatenate(
            kinematics_of(
                position,
                rate,
                lambda q, v: terms(q, v).gamma,
                q_i,
                v_i,
                a_i,
                guess,
                self.scales(c),
                layout.rank,
                layout.independent,
            )
        )
