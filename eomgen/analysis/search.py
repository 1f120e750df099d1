"""Analysis: a closed position, what is held and what is unknown -> a position where all forces are in balance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.limits.analyses import DIFFERENCES, LEAST_UNKNOWN
from ..errors import AssemblyError, EvaluationError, PartitionError, UsageError
from ..numeric.projection import largest
from ..runtime.derivative_calls import assembly_jacobian
from ..runtime.initial import Initial
from ..runtime.near_names import unknown
from .balance import Balance, balance_forces, force_slopes, slopes
from .eigenvalue_rounding import own_accelerations
from .linear_step import RANK, LinearizedResidual, Solver
from .tangent import displacement_names

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


class SearchPoint(NamedTuple):
    """One iterate."""

    q: Array
    s: Array  #: first-order states
    unknowns: Array
    module: BoundModel
    here: Balance


class Held(NamedTuple):
    """A row of a held coordinate."""

    label: str
    name: str
    gradient: Array  #: (n_v,) of the coordinate in its scale, by displacements
    scale: float


class Search:
    """The equations of balance for one model, time and set of held coordinates, and the ways to solve them."""

    def __init__(
        self, module: BoundModel, t: float, held: Mapping[str, float], unknowns: Sequence[str], s: Array
    ) -> None:
        layout = module.layout
        self.first = s  #: first-order states where the search begins
        self.scale = np.array(layout.scales.q)  #: (n_v,) of displacements; of states what they are about to change by
        self.moving = layout.n_v - len(s)
        self.scale[self.moving :] = np.maximum(1.0, np.abs(s))
        self.module, self.layout, self.t, self.held, self.names = module, layout, t, held, tuple(unknowns)
        for name in self.names:
            if name not in layout.p + layout.u:
                raise unknown("parameter or input", name, layout.p + layout.u)
        self.parameters = [layout.p.index(name) for name in self.names if name in layout.p]
        self.inputs = [layout.u.index(name) for name in self.names if name in layout.u]
        self.names = tuple(layout.p[k] for k in self.parameters) + tuple(layout.u[k] for k in self.inputs)
        self.supported = bool(held) and not self.names

    def bound(self, values: Array) -> BoundModel:
        """The module with values of the unknowns."""
        if not self.names:
            return self.module
        p, u = self.module.p, self.module.u
        count = len(self.parameters)
        p[self.parameters], u[self.inputs] = values[:count], values[count:]
        return self.module.bind(p, u)

    def initial_unknowns(self) -> Array:
        """What is bound now."""
        return np.concatenate([self.module.p[self.parameters], self.module.u[self.inputs]])

    def held_rows(self, module: BoundModel, q: Array) -> list[Held]:
        """The held coordinates, three rows for a rotation."""
        initial, layout, found = Initial(module.kernels, self.t), self.layout, []
        for name in self.held:
            for row in initial.gradients(q, name):
                moved = np.flatnonzero(row)
                if name in layout.loops:
                    label, scale = name, float(layout.loop_scales[layout.loops.index(name)])
                else:
                    label, scale = displacement_names(layout)[moved[0]], float(layout.scales.q[moved[0]])
                found.append(Held(label, name, row / layout.scales.q, scale))
        return found

    def gradients(self, module: BoundModel, q: Array) -> Array:
        """Gradients (k, n_v) of the held coordinates by displacements, in their scales."""
        rows = [held.gradient for held in self.held_rows(module, q)]
        return np.array(rows).reshape(len(rows), self.layout.n_v)

    def start(self, q: Array) -> SearchPoint:
        """The first iterate; the scales of states become the changes that the linear equations tell there."""
        point = self.at(q, self.first, self.initial_unknowns())
        if len(self.first):
            solver = Solver(self.linearize(point))
            change = solver.linear.moved @ solver.solve(self.residual(point.here, point.here))
            found = np.abs(change[self.moving :]) * self.scale[self.moving :]
            self.scale[self.moving :] = np.maximum(self.scale[self.moving :], np.nan_to_num(found, posinf=0.0))
        return point

    def longest(self, displacement: Array) -> float:
        """The largest entry of a scaled displacement (n_v,), states left out: none leads them out of their range."""
        return largest(displacement[: self.moving])

    def distance(self, a: SearchPoint, b: SearchPoint) -> Array:
        """The scaled displacement (n_v,) from b to a."""
        d = self.layout.scales.distance(a.q, b.q)
        d[self.moving :] = (a.s - b.s) / self.scale[self.moving :]
        return d

    def at(self, q: Array, states: Array, values: Array, preferred: Indices | None = None) -> SearchPoint:
        """The iterate near q on the constraints."""
        module = self.bound(values)
        initial = Initial(module.kernels, self.t)
        if self.layout.n_h:
            q = initial.system.close(q, self.held, restarts=0).q
        elif self.held:
            q = initial.system.with_values(q, self.held)
        held = self.gradients(module, q) if self.supported else None
        return SearchPoint(q, states, values, module, balance_forces(module, self.t, q, states, held, preferred))

    def residual(self, here: Balance, like: Balance) -> Array:
        """What must vanish, at the independent velocities and surplus displacements of another place."""
        s = self.scale
        forces = s[here.velocities] * here.forces if self.supported else (here.a / s)[like.velocities]
        return np.concatenate([forces, (here.v / s)[like.surplus]])

    def linearize(self, point: SearchPoint) -> LinearizedResidual:
        """The equations near an iterate, by displacements of length 1 that are at right angles (scaled)."""
        here, s = point.here, self.scale
        if self.supported:
            K, rates = force_slopes(point.module, self.t, here, lambda q: self.gradients(point.module, q))
            basis, inverse = _orthonormal(here.Z / s[:, None])
            J = np.vstack([s[here.velocities, None] * K, (rates / s[:, None])[here.surplus]]) @ inverse
            sizes = np.abs(here.B * s[here.velocities]).T @ np.abs(point.module.kernels.bias(self.t, here.x))
            sizes = np.concatenate([sizes, np.zeros(len(here.surplus))])
            flow: Array | None = None if len(here.surplus) else basis @ (inverse.T @ K @ inverse)
            return LinearizedResidual(
                J, basis, np.zeros((0, J.shape[1])), sizes + np.abs(J).sum(axis=1), DIFFERENCES, flow
            )
        held = self.gradients(point.module, point.q)
        held_by = self._held_by_parameters(point.module, here.x)
        found = slopes(point.module, self.t, here.x, held, held_by, self.parameters, self.inputs)
        basis, inverse = _orthonormal(found.Z / s[:, None])
        if len(held):  # only displacements that leave the held coordinates alone
            split = algebra.svd(held * s @ basis)
            free = split[2][len(held) :].T
            basis, inverse = basis @ free, inverse @ free
        sizes = np.abs(point.unknowns)
        weights = np.maximum(sizes, LEAST_UNKNOWN * max(1.0, float(sizes.max(initial=0.0))))
        unknown_rates = np.zeros((len(s), len(weights)))
        J = np.vstack([
            (np.hstack([found.by_position @ inverse, found.by_unknown * weights]) / s[:, None])[here.velocities],
            (np.hstack([found.rates @ inverse, unknown_rates]) / s[:, None])[here.surplus],
        ])  # fmt: skip
        moved = np.hstack([basis, found.motion * weights / s[:, None]])
        changed = np.hstack([np.zeros((len(weights), basis.shape[1])), np.diag(weights)])
        flow = (found.by_position + found.rates) @ inverse / s[:, None]
        return LinearizedResidual(J, moved, changed, self._sizes(point, J), RANK, flow)

    def _sizes(self, point: SearchPoint, J: Array) -> Array:
        """Sizes of the terms in each row: a unit displacement, and the forces of the model, each without the others."""
        here, n = point.here, len(point.here.velocities)
        if not n:
            return np.asarray(np.abs(J).sum(axis=1))
        mass = self.mass(point)
        spread = np.abs(algebra.inv(mass)) @ np.abs(mass)
        s = self.scale[here.velocities]
        own = own_accelerations(point.module, self.t, here.x, here.B, here.velocities, mass)
        rows = spread @ (np.abs(J[:n]).sum(axis=1) * s) / s
        return np.concatenate([rows + own, np.abs(J[n:]).sum(axis=1)])

    def _held_by_parameters(self, module: BoundModel, x: Array) -> Array:
        """Derivatives (k, n_p) of the held coordinates by the parameters, scaled; only cut joints have some."""
        layout = self.layout
        held = self.held_rows(module, x[: layout.n_q])
        rows = np.zeros((len(held), layout.n_p))
        if layout.n_loop_coordinates and self.parameters:
            every = assembly_jacobian(module, self.t, x)[layout.n_h + layout.n_c :, layout.n_x + layout.n_u :]
            for k, row in enumerate(held):
                if row.name in layout.loops:
                    rows[k] = every[layout.loops.index(row.name)] / row.scale
        return rows

    def drive(self, here: Balance) -> Array:
        """What pulls at the scaled displacements of the tree: accelerations and enforced velocities, or forces."""
        s = self.scale
        return np.asarray(s * here.tree if self.supported else (here.a + here.v) / s)

    def metric(self, point: SearchPoint, basis: Array) -> Array:
        """The metric in which the drive is the gradient of a potential, if there is one."""
        if self.supported:
            return np.eye(basis.shape[1])
        s = self.scale
        return np.asarray(basis.T @ (s[:, None] * point.module.kernels.mass_matrix(point.q, t=self.t) * s) @ basis)

    def mass(self, point: SearchPoint) -> Array:
        """Mass matrix of the independent velocities."""
        B = point.here.B
        return np.asarray(B.T @ point.module.kernels.mass_matrix(point.q, t=self.t) @ B)

    def rounded(self, point: SearchPoint) -> float:
        """Scaled size of the numbers that the position is made of, at least 1."""
        s, q = self.layout.scales, self.layout.space
        sizes = np.abs(point.q) / s.q if q is None else np.abs(point.q[q.plain_q]) / s.q[q.plain_v]
        return max(1.0, float(sizes.max(initial=0.0)))

    def step(self, point: SearchPoint, displacement: Array, change: Array) -> SearchPoint | None:
        """The iterate a scaled displacement (n_v,) and a change of the unknowns away; None where there is none."""
        try:
            q = self.layout.scales.move(point.q, displacement)
            states = point.s + self.scale[self.moving :] * displacement[self.moving :]
            there = self.at(q, states, point.unknowns + change, point.here.velocities)
        except (AssemblyError, EvaluationError, PartitionError, UsageError):
            return None
        finite = np.isfinite(there.here.a).all() and np.isfinite(there.here.tree).all()
        return there if finite else None


def _orthonormal(Z: Array) -> tuple[Array, Array]:
    """Z R^-1 with columns of length 1 at right angles, and R^-1."""
    basis, R = np.linalg.qr(Z)
    return basis, algebra.inv(R)
