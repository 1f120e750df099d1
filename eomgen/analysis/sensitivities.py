"""Analysis: a run -> the run and its derivatives by parameters, inputs and initial values.

Forward sensitivities: S' = J S + df/dp beside x' = f (E. Hairer, S. Norsett, G. Wanner, Solving Ordinary Differential
Equations I, 1993, section I.14), S(0) from the assembly of the initial state.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import SimulationError, UsageError
from ..numeric.scales import Array
from ..runtime.analyses import require_projection, require_velocities
from ..runtime.integrate import choose_solver, integrate
from ..runtime.names import unknown
from ..runtime.pace import Crawling, Pace, describe_crawl
from ..runtime.recording import record
from ..runtime.signals import Forcing
from ..runtime.simulate import DEFAULTS, find_span, ordered_times
from ..runtime.storage import table_path
from .linear import output_derivatives
from .start import Columns, held_names, keep_consistent, split_columns, start_sensitivity

if TYPE_CHECKING:
    from ..runtime.module import Module
    from ..runtime.trajectory import Trajectory


class Sensitivities:
    """A trajectory and its derivatives: ``s["theta", "k"]`` is d theta / d k over time, (n_t,).

    Attributes
    ----------
    trajectory : Trajectory
    t : (n_t,) array
    names : tuple of str
        What is differentiated by: parameters, inputs (a constant added to them), initial values.
    dx : (n_x, k, n_t) array
        Derivatives of the states, along the constraints.
    dy : (n_y, k, n_t) array
        Derivatives of the outputs.
    held : tuple of str
        Coordinates and rates that keep their initial values when something else changes.
    """

    def __init__(
        self, trajectory: Trajectory, names: tuple[str, ...], dx: Array, dy: Array, held: Sequence[str]
    ) -> None:
        self.trajectory, self.t, self.names = trajectory, trajectory.t, names
        self.dx, self.dy, self.held = dx, dy, tuple(held)
        self._rows: dict[str, Array] = dict(zip(trajectory.metadata["y_names"], dy, strict=True))
        self._rows |= dict(zip(trajectory.x_names, dx, strict=True))

    def __getitem__(self, key: tuple[str, str]) -> Array:
        if not (isinstance(key, tuple) and len(key) == 2):
            raise UsageError(f"ask for sensitivities[state or output, parameter], not {key!r}")
        what, name = key
        if what not in self._rows:
            raise unknown("state or output", what, self._rows)
        if name not in self.names:
            raise unknown("parameter that was differentiated by", name, self.names)
        return np.asarray(self._rows[what][self.names.index(name)])

    def save(self, path: str | Path) -> Path:
        """Write all derivatives: t, names, x_names, y_names, dx and dy to ``.npz`` (added if there is no ending), or
        columns ``d(theta)/d(k)`` to ``.csv``.

        Returns
        -------
        Path
            The file written.
        """
        target = table_path(path, "sensitivities are")
        if target.suffix == ".npz":
            x_names, y_names = self.trajectory.x_names, self.trajectory.metadata["y_names"]
            np.savez(target, t=self.t, names=self.names, x_names=x_names, y_names=y_names, dx=self.dx, dy=self.dy)
            return target
        columns = {f"d({row})/d({name})": self[row, name] for row in self._rows for name in self.names}
        table = np.column_stack([self.t, *columns.values()])
        np.savetxt(target, table, delimiter=",", header=",".join(["t", *columns]), comments="", fmt="%.17g")
        return target

    def __repr__(self) -> str:
        return f"<Sensitivities of {self.trajectory.name} to {', '.join(self.names)}: {len(self.t)} points>"


class _Coupled:
    """x' = f and S' = J S + df/dp as one system, columns of S in units of what they are taken by."""

    def __init__(self, module: Module, forcing: Forcing, columns: Columns, weights: Array) -> None:
        self.module, self.forcing, self.columns, self.weights = module, forcing, columns, weights
        kernels = module.kernels
        self.rhs, self.tangent = kernels.timed("rhs", nan=True), kernels.timed("jacobian", nan=True)
        self.by_p, self.by_u = kernels.timed("parameter_jacobian", nan=True), kernels.timed("input_jacobian", nan=True)

    def slopes(self, t: float, x: Array, S: Array) -> tuple[Array, Array]:
        """x' and S', S without weights."""
        columns, u = self.columns, self.forcing(t, x)
        J = self.tangent(t, x, u=u)
        extra = self.forcing.jacobian(t, x, self.module.rhs)
        S_dot = (J if extra is None else J + extra) @ S
        empty = np.zeros((len(x), 0))
        P = self.by_p(t, x, u=u) if columns.parameters else empty
        U = self.by_u(t, x, u=u) if columns.inputs else empty
        return self.rhs(t, x, u=u), S_dot + columns.spread(P, U)

    def __call__(self, t: float, z: Array) -> Array:
        """z' of z = [x; S * weights]."""
        n = self.module.n_x
        x_dot, S_dot = self.slopes(t, z[:n], z[n:].reshape(n, -1) / self.weights)
        return np.concatenate([x_dot, (S_dot * self.weights).ravel()])


def differentiate_run(
    module: Module,
    names: Sequence[str],
    span: float | tuple[float, float] | None = None,
    initial: Mapping[str, float] | ArrayLike | None = None,
    parameters: Any = None,
    inputs: Mapping[str, Any] | None = None,
    *,
    hold: Sequence[str] | None = None,
    method: Any = "DOP853",
    rtol: float = 1e-9,
    atol: float = 1e-11,
    t_eval: ArrayLike | None = None,
    **options: Any,
) -> Sensitivities:
    """See :meth:`~..runtime.analyses.Analyses.sensitivities`."""
    require_velocities(module.layout)
    require_projection(module.layout)
    forcing = Forcing(module.layout, inputs)
    bound = module.bind(parameters, forcing.constants) if parameters is not None or forcing.constants else module
    forcing.attach(bound)
    layout = bound.layout
    declared: Any = bound.metadata.get("simulation", {}).get("end") or DEFAULTS["end"]
    start, stop = find_span(span, float(declared))
    given = initial if isinstance(initial, Mapping) else None
    if initial is None or given is not None:
        x0 = bound.x0(given, t=start)
    else:
        x0 = np.array(initial, dtype=float)
        if x0.shape != (layout.n_x,):
            raise UsageError(f"initial must name values or have shape ({layout.n_x},), not {x0.shape}")
        x0 = bound.project(x0, t=start)
    held = held_names(bound, start, x0, given) if hold is None else _checked(bound, hold)
    columns = split_columns(layout, (names,) if isinstance(names, str) else tuple(names), held)
    S0 = start_sensitivity(bound.bind(u=forcing(start, x0)), start, x0, held, columns)
    weights = _weights(bound, columns)
    run = _Coupled(bound, forcing, columns, weights)
    bound.rhs(start, x0, u=forcing(start, x0))  # a failure here is the user's state, not the integration
    solver = choose_solver(method)
    times = None if t_eval is None else ordered_times(t_eval, start, stop)
    z0 = np.concatenate([x0, (S0 * weights).ravel()])
    settings = {"rtol": rtol, "atol": atol, **options}
    nodes = [start, *forcing.corners(start, stop), stop]
    fail, title = bound.kernels.fail, solver.__name__
    longest = float(options.get("max_step", np.inf))
    pace = Pace(start, stop, z0, layout.n_q, longest, lambda t, z: fail.trouble(z[: layout.n_x], t) is not None)
    try:
        with np.errstate(all="ignore"):  # NaN is how a failed evaluation shortens a step
            solution = integrate(run, nodes, z0, solver, times, [], False, settings, pace)
    except Crawling as crawl:
        trouble = "; ".join(fail.trouble(crawl.x[: layout.n_x], crawl.t) or ())
        raise SimulationError(describe_crawl(crawl, layout.x, stop, title, trouble)) from None
    if solution.status < 0 or not np.isfinite(solution.x).all():
        failure = run.rhs.failure or run.tangent.failure
        cause = None if failure is None else bound.kernels.fail.exception("rhs", *failure)
        raise SimulationError(f"{title} stopped: {solution.message} {cause or ''}".strip()) from cause
    n, k = layout.n_x, len(columns.names)
    raw = solution.x[n:].reshape(n, k, -1) / weights[:, None]
    trajectory = record(bound, forcing, solution._replace(x=solution.x[:n]), title, settings)
    dx, dy = np.empty_like(raw), np.empty((layout.n_y, k, raw.shape[2]))
    for j, time in enumerate(trajectory.t):
        x, here = trajectory.x[:, j], bound.bind(u=forcing(float(time), trajectory.x[:, j]))
        dx[..., j] = keep_consistent(here, float(time), x, raw[..., j], columns)
        if layout.n_y:
            dy[..., j] = _outputs(here, run, float(time), x, dx[..., j])
    return Sensitivities(trajectory, columns.names, dx, dy, held)


def _outputs(module: Module, run: _Coupled, t: float, x: Array, S: Array) -> Array:
    """Derivatives (n_y, k) of the outputs."""
    layout = module.layout
    n_q, n_x, n_v, n_u = layout.n_q, layout.n_x, layout.n_v, layout.n_u
    x_dot, S_dot = run.slopes(t, x, S)
    Y = output_derivatives(module, t, x, x_dot[n_q:])
    own = run.columns.spread(Y[:, n_x + n_v + n_u :], Y[:, n_x + n_v : n_x + n_v + n_u])
    return np.asarray(Y[:, :n_x] @ S + Y[:, n_x : n_x + n_v] @ S_dot[n_q:] + own)


def _weights(module: Module, columns: Columns) -> Array:
    """Sizes of what is differentiated by, so that one tolerance fits all columns."""
    weights = np.ones(len(columns.names))
    for column, index in columns.parameters:
        weights[column] = abs(module.p[index]) or 1.0
    for column, index in columns.inputs:
        weights[column] = abs(module.u[index]) or 1.0
    return weights


def _checked(module: Module, hold: Sequence[str]) -> list[str]:
    layout = module.layout
    allowed = (*layout.q, *layout.v, *layout.loops, *layout.loop_rates)
    for name in hold:
        if name not in allowed:
            raise unknown("coordinate or rate", name, allowed)
    return list(hold)
