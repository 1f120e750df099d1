"""A run -> the run and its derivatives by parameters, inputs and initial values.

Forward sensitivities: S' = J S + df/dp beside x' = f (E. Hairer, S. Norsett, G. Wanner, Solving Ordinary Differential
Equations I, 1993, section I.14), S(0) from the assembly of the initial state.

S' is linear in S, so it needs no steps of its own: along those of the compiled run, on each the four nodes of Gauss's
formula of order 8 (section II.7), all Jacobians come from one call and all steps from one set of linear systems. The
same formula applied to the run itself tells whether the steps are short enough.  Where they are not, for loops, events,
laws that bend or jump, inputs that depend on the state and many states, both are integrated together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.files import whole_file
from ..base.limits.constraints import CONTRADICTION, PASSED, STATE
from ..base.limits.impacts import OPENS
from ..base.limits.positions import SINGULAR
from ..base.limits.runs import SENSITIVITY_ATOL, SENSITIVITY_RTOL
from ..base.results import Result, ResultTable, plain, same_keys
from ..base.texts import place_of_marker
from ..errors import NoDerivativeError, SimulationError, at_odds, ill_placed, ill_typed, incomplete, untrue
from ..runtime.argument_checks import check_names, plain_name, read_names, read_number, require_steps, unknown
from ..runtime.change_points import scaled_jacobians, singular_values
from ..runtime.initial import Initial
from ..runtime.inputs import Forcing, Table
from ..runtime.kernels import place
from ..runtime.layout import Layout, start_slopes
from ..runtime.protocols import BoundValues
from ..runtime.refusals import require_support
from ..runtime.runs.bound_run import Crawling, Run
from ..runtime.runs.events import inner_run
from ..runtime.runs.integrate import Solution, choose_solver, integrate, record, require_end
from ..runtime.runs.run_arguments import check_tolerances, find_state, longest_step, ordered_times, set_up
from ..runtime.runs.simulate import simulate
from ..runtime.storage import table_path
from ..runtime.trajectory import Named, Span, Start
from .limits import QUADRATURE
from .saltation import Differentiated, EventSlopes, Saltation, SlopesNow, Variational, assembly_rows

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.protocols import Number
    from ..runtime.trajectory import Trajectory


class ReducedOptions(BoundValues, total=False):
    """Steps of a run with sensitivities."""

    max_step: Number | None
    first_step: Number | None
    min_step: float


# -- the result --------------------------------------------------------------------------------------------------------


class Sensitivities(Result):
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
        Both at fixed times; at an event that changes the state there are two columns, before and after.
    held : tuple of str
        Coordinates and rates that keep their initial values when something else changes.
    events : tuple of EventSlopes
        In the order in which they happened.
    event_times : list of (m, k) arrays
        Derivatives of ``trajectory.t_events``, also by name: ``s.event_times["floor"][0]``.
    """

    def __init__(
        self,
        trajectory: Trajectory,
        names: tuple[str, ...],
        dx: Array,
        dy: Array,
        held: Sequence[str],
        events: Sequence[EventSlopes] = (),
    ) -> None:
        self.trajectory, self.t, self.names = trajectory, trajectory.t, names
        self.dx, self.dy, self.held, self.events = dx, dy, tuple(held), tuple(events)
        watched = trajectory.t_events.names if len(trajectory.t_events) else ()
        times = [[event.dt for event in self.events if event.name == name] for name in watched]
        self._instances = trajectory.metadata.get("instances", {})
        self.event_times = Named(
            [np.array(result).reshape(-1, len(names)) for result in times], watched, self._instances
        )
        self._rows: dict[str, Array] = dict(zip(trajectory.metadata["y_names"], dy, strict=True))
        self._rows |= dict(zip(trajectory.x_names, dx, strict=True))

    KEYS = same_keys("names", "held", "steps", "final")

    @property
    def steps(self) -> int:
        """Of the run."""
        return len(self.t) - 1

    @property
    def final(self) -> dict[str, dict[str, float]]:
        """Derivatives at the end, by state or output, then by name."""
        rows = (*self.trajectory.x_names, *self.trajectory.metadata["y_names"])
        return {row: {name: float(self[row, name][-1]) for name in self.names} for row in dict.fromkeys(rows)}

    def to_dict(self) -> dict[str, Any]:
        events = [
            {"event": e.name, "t": e.t, "by": dict(zip(self.names, e.dt.tolist(), strict=True))} for e in self.events
        ]
        return super().to_dict() | {"events": plain(events)}

    @property
    def title(self) -> str:
        return f"Sensitivities of {self.trajectory.name} to {', '.join(self.names)}"

    @property
    def facts(self) -> list[tuple[str, str]]:
        return [("points", f"{len(self.t)}"), ("held at the start", ", ".join(self.held))]

    @property
    def tables(self) -> list[ResultTable]:
        """Derivatives at the end, and those of the times of events."""
        columns = ["", *self.names]
        final = [[row, *plain(list(by.values()))] for row, by in self.final.items()]
        result = [ResultTable(columns, final, f"derivatives at t = {self.t[-1]:g} s, by")]
        if self.events:
            events = [[f"{e.name}, t = {e.t:.6g} s", *e.dt.tolist()] for e in self.events]
            result.append(ResultTable(columns, events, "times of events, by"))
        return result

    def __getitem__(self, key: tuple[str, str]) -> Array:
        if not (isinstance(key, tuple) and len(key) == 2):
            raise ill_typed(f"write sensitivities[state or output, parameter], not {key!r}")
        what, name = (plain_name(part, self._instances) for part in key)
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
            with whole_file(target) as file:
                np.savez(file, t=self.t, names=self.names, x_names=x_names, y_names=y_names, dx=self.dx, dy=self.dy)
            return target
        columns = {f"d({row})/d({name})": self[row, name] for row in self._rows for name in self.names}
        table = np.column_stack([self.t, *columns.values()])
        head = ",".join(["t", *columns])
        with whole_file(target) as file:
            np.savetxt(file, table, delimiter=",", header=head, comments="", fmt="%.17g", encoding="utf-8")
        return target

    def __repr__(self) -> str:
        return f"<{self.title}: {len(self.t)} points>"


# -- the start ---------------------------------------------------------------------------------------------------------

# Values that are held stay (or change by one, for a sensitivity to an initial value); the constraints give the rest by
# implicit differentiation of C(q, p) = 0 and C_q v + C_t = 0.
#
# At a change point two branches cross. Let l be the direction in which the constraints lose rank there, l^T C_q = 0. A
# change of p with l^T C_p not zero opens the crossing, and the mechanism turns back or changes over: the motion is no
# smooth function of p.


def split_columns(layout: Layout, names: Sequence[str], fixed: Sequence[str]) -> Differentiated:
    """Sort names into parameters, inputs and held initial values."""
    names = read_names("names", names)
    parameters, inputs, initial = [], [], []
    for column, name in enumerate(names):
        if name in layout.p:
            parameters.append((column, layout.p.index(name)))
        elif name in layout.u:
            inputs.append((column, layout.u.index(name)))
        elif name in fixed:
            initial.append((column, name))
        elif name in (*layout.x, *layout.loops, *layout.loop_rates):
            which = f"{', '.join(fixed)} {'are' if len(fixed) > 1 else 'is'}" if fixed else "nothing is"
            raise ill_placed(
                f"{name} is not held at the start ({which}), so there is no derivative by it; name it in hold="
            )
        else:
            raise unknown("parameter, input or initial value", name, (*layout.p, *layout.u, *fixed))
    if not names:
        raise incomplete("name at least one parameter, input or initial value")
    if len(set(names)) != len(names):
        raise at_odds(f"give each name only once: {', '.join(names)}")
    return Differentiated(tuple(names), tuple(parameters), tuple(inputs), tuple(initial))


def names_to_hold(module: BoundModel, t: float, x: Array, raw: Mapping[str, float] | None) -> list[str]:
    """Coordinates and rates that an assembly at x holds: given ones, declared ones and independent ones, while they
    leave each other room."""
    layout = module.layout
    initial = Initial(module.kernels, t)
    q, result = x[: layout.n_q], []
    starts = [*(raw or ()), *layout.initial_outputs]
    if outputs := [name for name in starts if (name in layout.y and name not in layout.x) or place_of_marker(name)]:
        raise incomplete(
            f"derivatives need a start with held coordinates and rates, not {', '.join(outputs)}; give the "
            "coordinates that x0(...) finds for it"
        )
    declared, chosen = initial.sort(layout.initial), initial.sort(dict(raw or {}))
    free = [layout.velocity_labels[i] for i in layout.independent] + list(layout.q)
    rates = [layout.v[i] for i in layout.independent] + list(layout.v)
    for first, second, rest, positions in (
        (chosen.positions, declared.positions, [n for n in free if n in layout.q], True),
        (chosen.rates, declared.rates, rates, False),
    ):
        wanted = dict.fromkeys([*second, *rest], 0.0)
        soft = initial.compatible(q, first, {n: x for n, x in wanted.items() if n not in first}, positions=positions)
        result += [*first, *soft]
    return result


def start_sensitivity(
    module: BoundModel,
    t: float,
    x: Array,
    fixed: Sequence[str],
    columns: Differentiated,
    inputs: SlopesNow | None = None,
    slopes: Mapping[str, Array] = MappingProxyType({}),
) -> Array:
    """dx0 (n_x, k) of an assembled state, with the derivatives of the inputs there.

    ``slopes`` are those (n_p,) of held values that follow from parameters, by name.
    """
    layout, scales = module.layout, module.layout.scales
    n_q, n_v, n_x, n_h, n_c = layout.n_q, layout.n_v, layout.n_x, layout.n_h, layout.n_c
    count = len(columns.names)
    E = assembly_rows(module, t, x, inputs)
    other = columns.spread(E[:, n_x + layout.n_u :], E[:, n_x : n_x + layout.n_u])
    initial = Initial(module.kernels, t)
    wanted = {name: np.zeros(count) for name in fixed}
    for name in slopes.keys() & wanted.keys():
        (wanted[name],) = columns.spread(slopes[name][None], np.zeros((1, layout.n_u)))
    for column, name in columns.initial:
        if len(initial.gradients(x[:n_q], name)) != 1:
            raise ill_placed(f"{name} cannot change alone; use the angular velocity, or rotation: euler_angles")
        wanted[name][column] = 1.0
    N = scales.rates(x[:n_q], np.eye(n_v))
    turns = _turns(layout, x[:n_q], wanted)
    places = {name: [int(np.flatnonzero(row)[0]) for row in initial.gradients(x[:n_q], name)]
              for name in fixed if name in layout.q}  # fmt: skip

    def solve(
        J: Array, off: Array, lines: slice, of_tree: Mapping[str, list[int]], cut: Sequence[str], first: int
    ) -> Array:
        """The changes (n_v, k) for which all lines of an assembly's equations of one level stay 0."""
        rows, right = [*scales.jacobian(J[lines])], [*(-off[lines] / scales.c[: lines.stop - lines.start, None])]
        for name in fixed:
            for k in of_tree.get(name, ()):
                rows.append(np.eye(n_v)[k])
                right.append(turns.get(k, wanted[name]) / scales.q[k])
            if name in cut:
                line, size = first + cut.index(name), layout.loop_scales[cut.index(name)]
                rows.append(J[line] * scales.q / size)
                right.append((wanted[name] - off[line]) / size)
        return np.asarray(scales.q[:, None] * _solve(rows, right, n_v, count, columns))

    m = n_h + n_c
    dq = scales.rates(x[:n_q], solve(E[:, :n_q] @ N, other, slice(0, n_h), places, layout.loops, m))
    turns, rates = {}, {name: [layout.v.index(name)] for name in fixed if name in layout.v}
    other = other + E[:, :n_q] @ dq
    m += layout.n_loop_coordinates
    return np.vstack([dq, solve(E[:, n_q:n_x], other, slice(n_h, n_h + n_c), rates, layout.loop_rates, m)])


def _turns(layout: Layout, q: Array, wanted: Mapping[str, Array]) -> dict[int, Array]:
    """Rotations (k,) that changes of held Euler parameters make, by the places of their angular velocities in v."""
    result: dict[int, Array] = {}
    for i, j in layout.quaternion_slots:
        fixed = [k for k in range(4) if layout.q[i + k] in wanted]
        changes = np.array([wanted[layout.q[i + k]] for k in fixed])
        if changes.any():
            assert layout.space is not None
            G = np.stack([layout.space.rates(q, e)[i : i + 4] for e in np.eye(layout.n_v)[j : j + 3]], axis=1)
            whole = np.zeros((4, changes.shape[1]))
            whole[fixed] = changes  # of length 1, those not given are 0
            result |= dict(zip(range(j, j + 3), algebra.lstsq(G, whole, rcond=STATE), strict=True))
    return result


def _solve(rows: Sequence[Array], right: Sequence[Array], n: int, count: int, columns: Differentiated) -> Array:
    """The smallest solution (n, k) of rows that must be consistent."""
    A, b = np.array(rows).reshape(len(rows), n), np.array(right).reshape(len(rows), count)
    if not A.size or not count:
        return np.zeros((n, count))
    result = algebra.lstsq(A, b, rcond=STATE)
    left = np.abs(A @ result - b).max(axis=0)
    bad = np.flatnonzero(left > CONTRADICTION * np.maximum(1.0, np.abs(b).max(axis=0)))
    if bad.size:
        raise untrue(
            f"the start cannot follow a change of {columns.names[bad[0]]}: the constraints and the held values do "
            "not allow it; hold fewer values"
        )
    return np.asarray(result)


# -- branches that a change leaves -------------------------------------------------------------------------------------


def refuse_lost_branches(module: BoundModel, forcing: Forcing, run: Trajectory, columns: Differentiated) -> None:
    """Refuse parameters and inputs whose change opens a crossing that the run passes."""
    layout = module.layout
    by = [(name, layout.n_x + layout.n_u + i) for name, i in _named(columns, columns.parameters)]
    by += [(name, layout.n_x + i) for name, i in _named(columns, columns.inputs)]
    if not by or not layout.n_h or not layout.rank:
        return
    for point in run.change_points:
        x = np.concatenate([[point.coordinates[name] for name in layout.q], np.zeros(layout.n_v)])
        u = forcing(point.time, x)
        J = scaled_jacobians(module, np.array([point.time]), x[:, None], u[:, None] if len(u) else None)[0]
        U, sizes, _ = algebra.svd(J[: layout.n_h])
        lost = U[:, np.count_nonzero(sizes > 10.0 * PASSED * sizes.max(initial=0.0)) :]
        C = (
            module.bind(u=u).kernels.assembly_jacobian(x, t=point.time)[: layout.n_h]
            / layout.scales.c[: layout.n_h, None]
        )
        for name, k in by:
            length = float(np.linalg.norm(C[:, k]))
            if length > 0.0 and float(np.linalg.norm(lost.T @ C[:, k])) > OPENS * length:
                raise NoDerivativeError(
                    f"the run passes a change point at t = {point.time:.6g} s, and a change of {name} separates the "
                    f"branches that meet there, so there is no derivative by {name}; end the run before it"
                )


def _named(columns: Differentiated, pairs: tuple[tuple[int, int], ...]) -> list[tuple[str, int]]:
    return [(columns.names[column], index) for column, index in pairs]


# -- along the steps of a run ------------------------------------------------------------------------------------------

#: Nodes and weights of Gauss's formula with four nodes on [0, 1], its matrix by the conditions C(4):
#: sum_j a_ij c_j^(k-1) = c_i^k / k.
NODES, WEIGHTS = (0.5 * (np.polynomial.legendre.leggauss(4)[0] + 1.0), 0.5 * np.polynomial.legendre.leggauss(4)[1])
POWERS = np.arange(1, 5)
MATRIX = algebra.solve(NODES[None, :] ** (POWERS[:, None] - 1), (NODES[None, :] ** POWERS[:, None]) / POWERS[:, None]).T
#: Of the tolerances of the run whose steps are taken: a law that bends within a step, such as smoothed friction, weighs
#: more in the derivatives than in the run.
TIGHTER = 0.1
HALVINGS = 3  #: of steps in which the formula misses the run, as fast changes under values far from those of a fit do
FEW = 16  #: states up to which this is the faster way: the systems of a step grow with their third power
ENTRIES = 2_000_000  #: of the systems that are held at once


def serves(module: BoundModel, forcing: Forcing) -> bool:
    """Whether derivatives can be had along the steps of a run: smooth equations of no constraints, and inputs of time
    alone, smooth between corners."""
    layout, formulas = module.layout, forcing.formulas
    if layout.n_c or layout.quaternion_slots or layout.general_rates or not layout.info.smooth:
        return False
    if any(f.branches or any(op in ("x", "p") for op, *_ in f.tape[0]) for f in formulas.values()):
        return False
    return all(i in formulas or isinstance(signal, Table) for i, signal in forcing.varying.items())


def find_along(run: Variational, simulated: Callable[..., Trajectory], corners: Sequence[float], S: Array,
               times: Array, settings: Mapping[str, Any]) -> Array | None:  # fmt: skip
    """S (n_t, n_x, k) at times of a run, from S at its start, where Gauss's formula meets the run; else None.

    Steps are those of the run, or halves of them where the formula misses the run.
    """
    tight = {**settings, **{name: TIGHTER * settings[name] for name in ("rtol", "atol")}}
    grid = np.unique(np.concatenate([simulated(**tight).t, times, corners]))
    for _ in range(HALVINGS + 1):
        result, missed = along_steps(run, partial(simulated, **tight), grid, S, times, settings)
        if not missed.any():
            return result
        grid = np.sort(np.concatenate([grid, (grid[:-1] + 0.5 * np.diff(grid))[missed]]))
    return None


def along_steps(run: Variational, simulated: Callable[..., Trajectory], grid: Array, S: Array, times: Array,
                settings: Mapping[str, Any]) -> tuple[Array | None, Array]:  # fmt: skip
    """S at times (None where a step misses), and which of the first steps that were looked at miss the run."""
    h, n_x, s = np.diff(grid), len(S), len(NODES)
    t = (grid[:-1, None] + h[:, None] * NODES).ravel()
    whole = simulated(t_eval=np.unique(np.concatenate([t, grid])))
    x, ends = whole.x[:, np.searchsorted(whole.t, t)], whole.x[:, np.searchsorted(whole.t, grid)]
    sizes, at = np.abs(whole.x).max(axis=1), np.searchsorted(grid, times)
    allowed = np.minimum(settings["atol"] + np.minimum(settings["rtol"], QUADRATURE) * sizes, QUADRATURE * sizes.max())
    result, count, bad = list[Array](), max(1, ENTRIES // (s * n_x) ** 2), np.zeros(len(h), dtype=bool)
    for first in range(0, len(h), count):
        steps, nodes = h[first : first + count], slice(s * first, s * (first + count))
        _, rate, J, by, _ = run.rates(t[nodes], x[:, nodes], None)
        missed = steps * (rate.reshape(n_x, -1, s) @ WEIGHTS) - np.diff(ends[:, first : first + count + 1])
        bad[first : first + count] = ~(np.abs(missed) <= allowed[:, None]).all(axis=0)
        if bad.any():
            return None, bad
        S_here = integrate_linear(steps, J, by, S)
        result += [S_here[k - first] for k in at[(first <= at) & (at < first + len(steps))]]
        S = S_here[-1]
    return np.array([*result, *[S] * (len(times) - len(result))]), bad


def integrate_linear(h: Array, J: Array, by: Array, start: Array) -> Array:
    """S (steps + 1, n, k) of S' = J S + by, J and by at the nodes of all steps.

    Slopes K_i = J_i (S + h sum_j a_ij K_j) + by_i: of each step one system in all K_i, with S and by on its right side.
    """
    count, n, s = len(h), start.shape[0], len(NODES)
    J, by = J.reshape(count, s, n, n), by.reshape(count, s, n, -1)
    system = -np.einsum("m,ij,mipq->mipjq", h, MATRIX, J).reshape(count, s * n, s * n)
    system[:, range(s * n), range(s * n)] += 1.0
    right = np.concatenate([J, by], axis=-1).reshape(count, s * n, -1)
    K = algebra.solve(system, right).reshape(count, s, n, -1)
    gain = h[:, None, None] * np.einsum("i,mipq->mpq", WEIGHTS, K)
    result = np.empty((count + 1, *start.shape))
    result[0] = start
    for m in range(count):
        result[m + 1] = result[m] + gain[m, :, :n] @ result[m] + gain[m, :, n:]
    return result


# -- the run -----------------------------------------------------------------------------------------------------------


OPTIONS = ("max_step", "first_step", "min_step")  #: of solvers, besides tolerances


def sensitivities(
    module: BoundModel,
    /,
    names: Sequence[str],
    span: Span = None,
    initial: Start = None,
    parameters: Any = None,
    inputs: Mapping[str, Any] | None = None,
    *,
    hold: Sequence[str] | None = None,
    method: Any = "DOP853",
    rtol: Number = SENSITIVITY_RTOL,
    atol: Number | ArrayLike = SENSITIVITY_ATOL,
    t_eval: ArrayLike | None = None,
    events: Any = None,
    **options: Unpack[ReducedOptions],
) -> Sensitivities:
    """Integrate a run together with its derivatives by parameters, inputs and initial values.

    Parameters
    ----------
    names : sequence of str
        What to differentiate by: parameters, inputs (a constant added to each) and initial values that are held.
    span, initial, parameters, inputs : optional
        As for ``simulate``.
    hold : sequence of str, optional
        Coordinates and rates that keep their initial values when something else changes; the constraints give the
        rest, by the smallest change where they leave a choice.  By default those given in ``initial``, then the
        declared ones, then the independent ones, while they leave each other room; declared ones that are
        expressions of parameters follow these then, as a run with other parameters does.
    method : str or OdeSolver subclass, optional
        Of SciPy.
    rtol, atol, t_eval, events : optional
        As for ``simulate``.
    **options
        max_step, first_step, as for ``simulate``.

    Returns
    -------
    Sensitivities
        ``s["theta", "k"]``, ``s.dx`` (n_x, k, n_t), ``s.dy`` (n_y, k, n_t), ``s.trajectory``.

    Raises
    ------
    UsageError
        An unknown name, or one that is not held.
    SimulationError, AssemblyError, MissingDependencyError
        As for ``simulate``.
    """
    require_support(module.layout, "sensitivities")
    check_names("option of sensitivities", options, OPTIONS, ("method", "rtol", "atol", "t_eval", "events"))
    bound, forcing, start, stop = set_up(module, span, parameters, inputs)
    layout = bound.layout
    corners = forcing.corners(start, stop)
    nodes = [start, *corners, stop]
    forcing.enter(*nodes[:2])
    x0 = find_state(bound, initial, start, forcing)
    here = bound.bind(u=forcing(start, x0))
    supplied = {n: read_number(n, x) for n, x in initial.items()} if isinstance(initial, Mapping) else None
    fixed = names_to_hold(here, start, x0, supplied) if hold is None else _checked(bound, hold)
    columns = split_columns(layout, read_names("names", names), fixed)
    run = Variational(bound, forcing, columns)
    chosen = longest_step(bound, method) | {name: value for name, value in options.items() if value is not None}
    settings = check_tolerances(layout.n_x, abs(stop - start), {"rtol": rtol, "atol": atol, **chosen})
    require_steps("max_step", float(settings.get("max_step", np.inf)), start, stop)
    salts = Saltation(run, events, (start, stop), (settings["rtol"], settings["atol"]), corners)
    single = None
    if salts:
        with inner_run():
            single = simulate(bound, (start, stop), x0, None, inputs, events=events, method=method, **settings)
    bound.rhs(start, x0, u=forcing(start, x0))  # a failure here is the user's state, not the integration
    follows = start_slopes(layout, bound.kernels.context.p) if initial is None or supplied is not None else {}
    follows = {} if hold is not None else {name: by_p for name, by_p in follows.items() if name not in (supplied or ())}
    S0 = start_sensitivity(here, start, x0, fixed, columns, run.input_slopes(start, x0), follows)
    width = layout.n_x * (1 + len(columns.names))
    times = None if t_eval is None else ordered_times(t_eval, start, stop, width)
    few = layout.n_x <= FEW or method == "Taylor"
    if few and not salts and stop > start and serves(bound, forcing):
        texts = {layout.u[i]: formula for i, formula in forcing.formulas.items()}  # read once
        read = {name: texts.get(name, value) for name, value in (inputs or {}).items()}
        simulated = partial(simulate, bound, (start, stop), x0, None, read, events=events)
        every = forcing.corners(start, stop, every_jump=True)
        with inner_run():
            trajectory = simulated(**settings, method=method, t_eval=times)
            method = "DOP853" if method == "Taylor" else method  # whose steps are too long, and which SciPy lacks
            S = find_along(run, partial(simulated, method=method), every, S0, trajectory.t, settings)
        if S is not None:
            return Sensitivities(trajectory, columns.names, *run.with_outputs(trajectory, S), fixed)
    solver = choose_solver(method, "sensitivities")
    if np.ndim(settings["atol"]):  # of each state, and of its derivatives alike
        settings["atol"] = np.concatenate([settings["atol"], np.repeat(settings["atol"], len(columns.names))])
    z0 = run.joined(x0, S0)
    title, watch = solver.__name__, Run(bound, forcing)
    watch.begin(start, stop, x0, float(settings.get("max_step", np.inf)), len(z0) if times is None else 0)
    try:
        solution, _, raised = integrate(
            bound, forcing, nodes, z0, solver, times, False, settings, salts, None, watch.look, run
        )
        if raised is not None:
            raise raised
    except Crawling as crawl:
        _refuse_change_point(bound, forcing, crawl.t, crawl.x)
        raise watch.gave_up(crawl, stop, title, {"atol": np.max(settings["atol"])}) from None
    if solution.status < 0 or not np.isfinite(solution.x).all():
        failure = run.rhs.failure or run.tangent.failure
        cause = None if failure is None else bound.kernels.fail.exception("rhs", *failure)
        raise SimulationError(f"{title} stopped: {solution.message} {cause or ''}".strip()) from cause
    require_end(solution, stop)
    if solution.status == 1:
        _note_end(salts, solution)
    n, k = layout.n_x, len(columns.names)
    kept = _distinct(solution)
    steps = None if solution.steps is None else (solution.steps[0], solution.steps[1][:n])
    states = solution._replace(
        t=solution.t[kept], x=solution.x[:n, kept], x_events=[result[:n] for result in solution.x_events], steps=steps
    )
    raw = solution.x[n:, kept].reshape(n, k, -1) / run.weights[:, None]
    trajectory = record(bound, forcing, states, title, settings, salts.names)
    if single is not None:
        _require_same(trajectory, single)
    refuse_lost_branches(bound, forcing, trajectory, columns)
    S = np.array([run.consistent(float(t), trajectory.x[:, j], raw[..., j]) for j, t in enumerate(trajectory.t)])
    return Sensitivities(trajectory, columns.names, *run.with_outputs(trajectory, S), fixed, salts.crossed)


def _refuse_change_point(module: BoundModel, forcing: Forcing, t: float, x: Array) -> None:
    """Tell of a loss of rank at the state where the derivatives grow without bound."""
    if not module.layout.rank:
        return
    u = forcing(t, x)[:, None] if module.layout.constraint_inputs else None
    if singular_values(module, np.array([t]), x[:, None], u)[0, module.layout.rank - 1] < SINGULAR:
        raise NoDerivativeError(
            f"the run passes a change point at t = {t:.6g} s{place(module.layout.x, x)}: the mobility changes there, "
            "and a small change of a parameter can close or open the branch, so there is no derivative; end the run "
            "before it"
        )


def _require_same(result: Trajectory, single: Trajectory) -> None:
    """Refuse a run that passes over events which the run by itself finds."""
    for name, ours, theirs in zip(result.t_events.names, result.t_events, single.t_events, strict=True):
        if len(ours) != len(theirs):
            raise SimulationError(
                f"event {name} is found {len(theirs)} times by simulate, but {len(ours)} times together with the "
                "derivatives, because it appears and disappears within one step of the solver; give max_step",
                code="EG-EVENT",
            )


def _note_end(salts: Saltation, solution: Solution) -> None:
    ending = [k for k, event in enumerate(salts.every) if event.terminal and len(solution.t_events[k])]
    last = max(ending, key=lambda k: abs(float(solution.t_events[k][-1] - solution.ends[0])))
    salts.stop(float(solution.t_events[last][-1]), solution.x_events[last][:, -1], last)


def _distinct(solution: Solution) -> Indices:
    """Points other than those that repeat the one before, as where an event changes nothing."""
    same = (np.diff(solution.t) == 0.0) & (np.diff(solution.x, axis=1) == 0.0).all(axis=0)
    return np.flatnonzero(np.concatenate([[True], ~same]))


def _checked(module: BoundModel, hold: Sequence[str]) -> list[str]:
    layout = module.layout
    allowed = (*layout.q, *layout.v, *layout.loops, *layout.loop_rates)
    names = read_names("hold", hold)
    check_names("coordinate or rate", names, allowed)
    return list(names)
