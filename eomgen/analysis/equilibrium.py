"""Analysis: a guess -> a position where all forces are in balance, with parameters that make it so."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import AssemblyError, EquilibriumError, EvaluationError, UsageError
from ..numeric.scales import Array
from ..runtime.initial import Initial
from ..runtime.names import unknown
from .balance import assembly_jacobian, force_slopes, slopes, weigh
from .balanced import Equilibrium, describe
from .tangent import displacement_names

if TYPE_CHECKING:
    from ..runtime.module import Module

STEPS = 200  #: steps at most
LONGEST = 0.5  #: largest scaled step of a coordinate
REST = 1e-10  #: scaled residual that counts as balance, relative to the largest force met
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
        """Iterate from a position."""
        point = self.at(q, self.initial_unknowns())
        first = max(1.0, float(np.abs(point.residual).max(initial=0.0)))
        damping = 0.0
        for step in range(STEPS):
            size = float(np.linalg.norm(point.residual))
            if not np.isfinite(size):
                break
            J, moved, changed = self.jacobian(point)
            newton = np.linalg.lstsq(J, -point.residual, rcond=1e-12)[0] if J.size else np.zeros(J.shape[1])
            left = float(np.linalg.norm(point.residual + J @ newton))
            arrived = float(np.abs(newton).max(initial=0.0)) <= SMALL and left <= 1e-6 * max(1.0, first)
            if size == 0.0 or arrived:
                return point, step
            while damping <= 1e12:
                change = newton if damping <= 0.0 else _damped(J, point.residual, damping)
                longest = float(np.abs(moved @ change / self.layout.scales.q).max(initial=0.0))
                change = change * min(1.0, LONGEST / longest) if longest > LONGEST else change
                there = self._try(point, moved @ change, changed @ change)
                if there is not None and np.linalg.norm(there.residual) < size:
                    break
                if size <= REST * first:  # rounding: nothing nearer exists
                    return point, step
                damping = 1e-6 if damping <= 0.0 else 10.0 * damping
            else:
                break
            point, damping = there, 0.0 if damping <= 1e-5 else 0.1 * damping
        raise self._failure(point)

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


def find_equilibrium(
    module: Module,
    guess: Mapping[str, float] | ArrayLike | None = None,
    t: float = 0.0,
    *,
    p: Any = None,
    u: Any = None,
    hold: Mapping[str, float] | Sequence[str] = (),
    unknowns: Sequence[str] = (),
) -> Equilibrium:
    """See :meth:`~..runtime.analyses.Analyses.equilibrium`."""
    module = module if p is None and u is None else module.bind(p, u)
    layout, time = module.layout, float(t)
    unknowns = (unknowns,) if isinstance(unknowns, str) else tuple(unknowns)
    given = {name: float(value) for name, value in hold.items()} if isinstance(hold, Mapping) else {}
    initial = Initial(module.kernels, time)
    if initial.sort(given).rates:
        raise UsageError(f"hold takes coordinates, not rates: {', '.join(initial.sort(given).rates)}")
    q = _start(module, guess, given, time)
    if not isinstance(hold, Mapping):
        names = (hold,) if isinstance(hold, str) else tuple(hold)
        here = read_coordinates(module, q, time)
        for name in names:
            if name not in here:
                raise unknown("coordinate", name, here)
        given = initial.sort({name: here[name] for name in names}).positions
    search = Search(module, time, given, unknowns)
    rows = len(search.gradients(module, q))
    if unknowns and len(unknowns) < rows:
        raise UsageError(
            f"{rows} held coordinates need as many unknowns to be in balance, given: {', '.join(unknowns)}; without "
            "unknowns what is held is supported"
        )
    point, steps = search.run(q)
    return describe(search, point.module, point.q, point.unknowns, steps)


def _start(module: Module, guess: Any, held: Mapping[str, float], t: float) -> Array:
    """A closed position near the guess that has the held values."""
    initial = Initial(module.kernels, t)
    if guess is None or isinstance(guess, Mapping):
        values = {name: float(value) for name, value in (guess or {}).items()}
        if initial.sort(values).rates:
            raise UsageError("a guess is a position: name coordinates, not rates")
        loose = {name: value for name, value in values.items() if name not in held}
        q = initial.from_guess(loose) if loose else initial.assembled({})
    else:
        q = np.array(guess, dtype=float)
        if q.shape not in ((module.n_q,), (module.n_x,)):
            raise UsageError(f"guess must name coordinates or have shape ({module.n_q},), not {q.shape}")
        q = q[: module.n_q]
    if held:
        if not module.layout.n_h:
            return initial.with_values(q, held)
        try:
            return initial.walk(q, held)
        except AssemblyError:
            return initial.close(q, held).q
    return initial.close(q, {}).q if module.layout.n_h else q


def read_coordinates(module: Module, q: Array, t: float) -> dict[str, float]:
    """All coordinates by name, those of cut joints included."""
    values = dict(zip(module.q_names, q.tolist(), strict=True))
    if module.layout.n_k:
        y = Initial(module.kernels, t).loops(q)[0]
        values |= dict(zip(module.layout.loops, y.tolist(), strict=True))
    return values
