"""Analysis: a closed position, what is held and what is unknown -> a position where all forces are in balance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import AssemblyError, EquilibriumError, EvaluationError, UsageError
from ..numeric.scales import Array
from ..runtime.initial import Initial
from ..runtime.names import unknown
from .balance import assembly_jacobian, force_slopes, slopes, weigh
from .rounding import own_accelerations
from .tangent import displacement_names

if TYPE_CHECKING:
    from ..runtime.module import Module

STEPS = 200  #: steps at most
LONGEST = 0.5  #: largest scaled step of a coordinate
REST = 1e-10  #: scaled residual that counts as balance, relative to the largest force met
STIFFEST = 1e12  #: largest damping of a step
SMALL = 1e-12  #: scaled step at which Newton's iteration has arrived


class _Point(NamedTuple):
    """One iterate."""

    q: Array
    unknowns: Array
    module: Module
    residual: Array  #: (m,) accelerations, or forces where coordinates are held by supports; scaled
    size: float


class Held(NamedTuple):
    """A row of a held coordinate."""

    label: str
    name: str
    gradient: Array  #: (n_v,) of the coordinate in its scale, by displacements
    scale: float


class Search:
    """Newton's iteration with Levenberg's damping for one model, time and set of held coordinates."""

    def __init__(self, module: Module, t: float, held: Mapping[str, float], unknowns: Sequence[str]) -> None:
        layout = module.layout
        self.module, self.layout, self.t, self.held, self.names = module, layout, t, held, tuple(unknowns)
        for name in self.names:
            if name not in layout.p + layout.u:
                raise unknown("parameter or input", name, layout.p + layout.u)
        self.parameters = [layout.p.index(name) for name in self.names if name in layout.p]
        self.inputs = [layout.u.index(name) for name in self.names if name in layout.u]
        self.names = tuple(layout.p[k] for k in self.parameters) + tuple(layout.u[k] for k in self.inputs)
        self.supported = bool(held) and not self.names

    def bound(self, values: Array) -> Module:
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

    def held_rows(self, module: Module, q: Array) -> list[Held]:
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

    def gradients(self, module: Module, q: Array) -> Array:
        """Gradients (k, n_v) of the held coordinates by displacements, in their scales."""
        rows = [held.gradient for held in self.held_rows(module, q)]
        return np.array(rows).reshape(len(rows), self.layout.n_v)

    def at(self, q: Array, values: Array, closed: bool = False) -> _Point:
        """The iterate near q on the constraints."""
        module = self.bound(values)
        if not closed:
            initial = Initial(module.kernels, self.t)
            if self.layout.n_h:
                q = initial.close(q, self.held, restarts=0).q
            elif self.held:
                q = initial.with_values(q, self.held)
        scales = self.layout.scales
        here = weigh(module, self.t, q, self.gradients(module, q) if self.supported else None)
        s = scales.q[here.velocities]
        if self.supported:
            return _Point(q, values, module, s * here.forces / max(here.size, 1e-300), here.size)
        return _Point(q, values, module, here.a / s, here.size)

    def jacobian(self, point: _Point) -> tuple[Array, Array, Array]:
        """Residual's derivative by scaled variables, and what these move: displacements (n_v, k), unknowns (j, k)."""
        module, t, scales = point.module, self.t, self.layout.scales
        held = self.gradients(module, point.q)
        here = weigh(module, t, point.q, held if self.supported else None)
        if self.supported:
            s = scales.q[here.velocities]
            K = force_slopes(module, t, here, lambda q: self.gradients(module, q))
            return s[:, None] * K * s / max(here.size, 1e-300), here.B * s, np.zeros((0, len(s)))
        held_by = self._held_by_parameters(module, here.x)
        found = slopes(module, t, here.x, held, held_by, self.parameters, self.inputs)
        Z, by_position = found.Z, found.by_position
        if len(held):  # only displacements that leave the held coordinates alone
            split = np.linalg.svd(held @ Z)
            free = split[2][len(held) :].T
            Z, by_position = Z @ free, by_position @ free
        units = np.linalg.norm(Z / scales.q[:, None], axis=0)
        units = 1.0 / np.maximum(units, 1e-300)
        weights = np.maximum(np.abs(point.unknowns), 1e-3 * np.maximum(1.0, np.abs(point.unknowns).max(initial=0.0)))
        rows = scales.q[found.velocities, None]
        J = np.hstack([by_position * units, found.by_unknown * weights]) / rows
        moved = np.hstack([Z * units, found.motion * weights])
        changed = np.hstack([np.zeros((len(weights), Z.shape[1])), np.diag(weights)])
        return J, moved, changed

    def _held_by_parameters(self, module: Module, x: Array) -> Array:
        """Derivatives (k, n_p) of the held coordinates by the parameters, scaled; only cut joints have some."""
        layout = self.layout
        held = self.held_rows(module, x[: layout.n_q])
        rows = np.zeros((len(held), layout.n_p))
        if layout.n_k and self.parameters:
            every = assembly_jacobian(module, self.t, x)[layout.n_h + layout.n_c :, layout.n_x + layout.n_u :]
            for k, row in enumerate(held):
                if row.name in layout.loops:
                    rows[k] = every[layout.loops.index(row.name)] / row.scale
        return rows

    def run(self, q: Array) -> tuple[_Point, int]:
        """From a position: Newton's iteration; where it stalls, downhill along the forces first."""
        start = self.at(q, self.initial_unknowns())
        point, steps, found = self._newton(start)
        if found:
            return point, steps
        if not self.names:
            lower, more = self._descend(start)
            lowest, again, found = self._newton(lower)
            if found:
                return lowest, steps + more + again
        raise self._failure(point)

    def _newton(self, point: _Point) -> tuple[_Point, int, bool]:
        """The last iterate, the number of steps, and whether it is balanced."""
        residual, damping = float(np.abs(point.residual).max(initial=0.0)), 0.0
        own = self._own(point)
        for step in range(STEPS):
            size = float(np.linalg.norm(point.residual))
            J, moved, changed = self.jacobian(point)
            first = max(residual, min(1.0, max(own, float(np.abs(J).max(initial=0.0)))))
            newton = np.linalg.lstsq(J, -point.residual, rcond=1e-12)[0] if J.size else np.zeros(J.shape[1])
            left = float(np.linalg.norm(point.residual + J @ newton))
            arrived = float(np.abs(newton).max(initial=0.0)) <= SMALL and left <= 1e-6 * first
            if size == 0.0 or arrived:
                return point, step, True
            there = None
            while damping <= STIFFEST:
                change = newton if damping <= 0.0 else _damped(J, point.residual, damping)
                longest = float(np.abs(moved @ change / self.layout.scales.q).max(initial=0.0))
                change = change * min(1.0, LONGEST / longest) if longest > LONGEST else change
                there = self._try(point, moved @ change, changed @ change)
                if there is not None and np.linalg.norm(there.residual) < size:
                    break
                there = None
                if size <= REST * first:  # rounding: nothing nearer exists
                    return point, step, True
                damping = 1e-6 if damping <= 0.0 else 10.0 * damping
            if there is None:
                return point, step, False
            point, damping = there, 0.0 if damping <= 1e-5 else 0.1 * damping
        return point, STEPS, False

    def _own(self, point: _Point) -> float:
        """Size of the accelerations that the model's forces make without each other, or of their share, scaled."""
        if self.supported:
            return 1.0
        here = weigh(point.module, self.t, point.q)
        mass = self._mass(point, here.B)
        return float(own_accelerations(point.module, self.t, here.x, here.B, here.velocities, mass).max(initial=0.0))

    def _descend(self, point: _Point) -> tuple[_Point, int]:
        """Along the accelerations at rest in steps of equal length, shorter at each turn, until they no longer lead on.

        This goes down the potential where there is one, and ends near a minimum of it.
        """
        length, before = 0.1, None
        for step in range(STEPS):
            here = weigh(
                point.module, self.t, point.q, self.gradients(point.module, point.q) if self.supported else None
            )
            displacement = here.B @ np.linalg.solve(self._mass(point, here.B), here.forces)
            scaled = displacement / self.layout.scales.q
            size = float(np.linalg.norm(scaled))
            if size == 0.0 or length < 1e-4:
                return point, step
            direction = scaled / size
            if before is not None and direction @ before < 0.0:
                length *= 0.5
            before = direction
            there = self._try(point, length * direction * self.layout.scales.q, np.zeros(0))
            if there is None:
                length *= 0.5
            else:
                point = there
        return point, STEPS

    def _mass(self, point: _Point, B: Array) -> Array:
        return np.asarray(B.T @ point.module.mass_matrix(point.q, t=self.t) @ B)

    def _try(self, point: _Point, displacement: Array, change: Array) -> _Point | None:
        try:
            q = self.layout.scales.move(point.q, displacement / self.layout.scales.q)
            return self.at(q, point.unknowns + change)
        except (AssemblyError, EvaluationError, UsageError):
            return None

    def _failure(self, point: _Point) -> EquilibriumError:
        held = self.gradients(point.module, point.q) if self.supported else None
        here = weigh(point.module, self.t, point.q, held)
        names = [self.layout.freedoms[k] for k in here.velocities]
        left = dict(zip(names, here.forces.tolist(), strict=True))
        scaled = np.abs(here.forces * self.layout.scales.q[here.velocities])
        worst = int(scaled.argmax())
        where = ", ".join(f"{n} = {x:.6g}" for n, x in zip(self.layout.q, point.q, strict=True))
        return EquilibriumError(
            f"no equilibrium of {self.layout.name!r} found from this guess: the generalized force along "
            f"{names[worst]} is still {here.forces[worst]:.6g} at {where}; give another guess, or hold a coordinate "
            "that nothing balances",
            left,
        )


def _damped(J: Array, residual: Array, damping: float) -> Array:
    """Levenberg's step."""
    H = J.T @ J
    H.flat[:: len(H) + 1] += damping * max(float(H.diagonal().max(initial=0.0)), 1e-300)
    return np.asarray(np.linalg.solve(H, -J.T @ residual))
