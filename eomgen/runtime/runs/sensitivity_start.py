"""How an assembled initial state changes with parameters and values; the result of sensitivities."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...base import algebra
from ...base.algebra import Array
from ...base.files import whole_file
from ...base.limits.constraints import CONTRADICTION, PASSED, STATE
from ...base.limits.impacts import OPENS
from ...base.names import place_of_marker
from ...base.numeric.projection import minimum_norm
from ...base.results import Result, ResultTable, plain, same_keys
from ...errors import NoDerivativeError, at_odds, cannot, ill_placed, ill_typed, incomplete, untrue
from ..argument_checks import plain_name, read_names, unknown
from ..change_points import scaled_jacobians
from ..columns import Named
from ..initial import Initial
from ..inputs import Forcing, Table, rate_places
from ..layout import Layout
from ..storage import table_path

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..trajectory import Trajectory

# -- the result --------------------------------------------------------------------------------------------------------


class EventSlopes(NamedTuple):
    """What happened at one event, and its derivatives by the k names.

    The states' derivatives go with the event: they are those of the state at the event, whenever that is, as a
    Poincare section takes them.  Those at a fixed time are in ``Sensitivities.dx``.
    """

    name: str
    t: float  #: time (s)
    before: Array  #: (n_x,) state right before
    after: Array  #: (n_x,) state right after, the same without a reset
    dt: Array  #: (k,) of the time
    d_before: Array  #: (n_x, k)
    d_after: Array  #: (n_x, k)


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
        self.event_times = Named([np.array(found).reshape(-1, len(names)) for found in times], watched, self._instances)
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
        found = [ResultTable(columns, final, f"derivatives at t = {self.t[-1]:g} s, by")]
        if self.events:
            events = [[f"{e.name}, t = {e.t:.6g} s", *e.dt.tolist()] for e in self.events]
            found.append(ResultTable(columns, events, "times of events, by"))
        return found

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


# -- inputs ------------------------------------------------------------------------------------------------------------


class SlopesNow(NamedTuple):
    """Derivatives of all inputs at a time and state."""

    by_t: Array  #: (n_u,)
    by_x: Array  #: (n_u, n_x)
    by_p: Array  #: (n_u, n_p)


class InputSlopes:
    """Derivatives of the inputs of one run.

    An expression is differentiated on the graph, a table piece by piece.  A Python function is called without the
    state from here on: one that reads it has derivatives that nobody knows.

    Parameters
    ----------
    layout : Layout
    forcing : Forcing
        Attached to the module of the run.
    p : (n_p,) array
    """

    def __init__(self, layout: Layout, forcing: Forcing, p: Array) -> None:
        self.layout = layout
        self.formulas = {i: formula.slopes(p) for i, formula in forcing.formulas.items()}
        self.forcing = forcing
        self.rates = rate_places(layout)
        self.tables: dict[int, Table] = {}
        self.functions: set[int] = set()
        for i, signal in forcing.varying.items():
            if i in self.formulas:
                continue
            if isinstance(signal, Table):
                self.tables[i] = signal.derivative()
            else:
                self.functions.add(i)
                forcing.varying[i] = AtOneState(layout.u[i], signal)

    @property
    def by_state_or_parameters(self) -> bool:
        """Whether an input may depend on more than time."""
        return bool(self.formulas)

    def __call__(self, t: float, x: Array) -> SlopesNow:
        """The derivatives; NaN by time for a Python function, unless its rate is an input too."""
        n_u, n_x, n_p = self.layout.n_u, self.layout.n_x, self.layout.n_p
        every = np.zeros((n_u, 1 + n_x + n_p))
        for i, slopes in self.formulas.items():
            every[i] = slopes(t, x)
        within = self.forcing.within
        for i, table in self.tables.items():
            every[i, 0] = table.beside(t, t if within is None else min(max(t, within[0]), within[1]))
        for i in self.functions:
            rate = self.rates.get(i)
            every[i, 0] = np.nan if rate is None else self.forcing(t, x)[rate]
        return SlopesNow(every[:, 0], every[:, 1 : 1 + n_x], every[:, 1 + n_x :])


class AtOneState:
    """A user's function f(t, x) as one of time alone.

    Parameters
    ----------
    name : str
        Of the input.
    function : callable f(t, x)
    """

    def __init__(self, name: str, function: Callable[[float, Any], float]) -> None:
        self.name, self.function = name, function

    def __call__(self, t: float, x: Array) -> float:
        """The value, without the state.

        Raises
        ------
        UsageError
            The function reads the state.
        """
        try:
            return self.function(t, None)
        except Exception:
            self.function(t, x)  # a fault of its own comes out as it is
        raise cannot(
            f"input {self.name} is a Python function of the state, and its derivatives are not known; give it as an "
            'expression in a text, such as "-k*theta", or as a function of time alone'
        )


class Differentiated(NamedTuple):
    """What a trajectory is differentiated by: k names, each a parameter, an input or an initial value."""

    names: tuple[str, ...]
    parameters: tuple[tuple[int, int], ...]  #: (column, index of the parameter)
    inputs: tuple[tuple[int, int], ...]  #: (column, index of the input)
    initial: tuple[tuple[int, str], ...]  #: (column, name of the coordinate or rate)

    def spread(self, by_parameters: Array, by_inputs: Array) -> Array:
        """Derivatives (rows, k) from those by all parameters and all inputs; zero for initial values."""
        result = np.zeros((len(by_parameters), len(self.names)))
        for column, index in self.parameters:
            result[:, column] = by_parameters[:, index]
        for column, index in self.inputs:
            result[:, column] = by_inputs[:, index]
        return result


def split_columns(layout: Layout, names: Sequence[str], held: Sequence[str]) -> Differentiated:
    """Sort names into parameters, inputs and held initial values.

    Raises
    ------
    UsageError
        A name is none of them.
    """
    names = read_names("names", names)
    parameters, inputs, initial = [], [], []
    for column, name in enumerate(names):
        if name in layout.p:
            parameters.append((column, layout.p.index(name)))
        elif name in layout.u:
            inputs.append((column, layout.u.index(name)))
        elif name in held:
            initial.append((column, name))
        elif name in (*layout.x, *layout.loops, *layout.loop_rates):
            which = f"{', '.join(held)} {'are' if len(held) > 1 else 'is'}" if held else "nothing is"
            raise ill_placed(
                f"{name} is not held at the start ({which}), so there is no derivative by it; name it in hold="
            )
        else:
            raise unknown("parameter, input or initial value", name, (*layout.p, *layout.u, *held))
    if not names:
        raise incomplete("name at least one parameter, input or initial value")
    if len(set(names)) != len(names):
        raise at_odds(f"give each name only once: {', '.join(names)}")
    return Differentiated(tuple(names), tuple(parameters), tuple(inputs), tuple(initial))


def held_names(module: BoundModel, t: float, x: Array, given: Mapping[str, float] | None) -> list[str]:
    """Coordinates and rates that an assembly at x holds: given ones, declared ones and independent ones, while they
    leave each other room."""
    layout = module.layout
    initial = Initial(module.kernels, t)
    q, found = x[: layout.n_q], []
    starts = [*(given or ()), *layout.initial_outputs]
    if outputs := [name for name in starts if (name in layout.y and name not in layout.x) or place_of_marker(name)]:
        raise incomplete(
            f"derivatives need a start with held coordinates and rates, not {', '.join(outputs)}; give the "
            "coordinates that x0(...) finds for it"
        )
    declared, chosen = initial.sort(layout.initial), initial.sort(dict(given or {}))
    free = [layout.velocity_labels[i] for i in layout.independent] + list(layout.q)
    rates = [layout.v[i] for i in layout.independent] + list(layout.v)
    for first, second, rest, positions in (
        (chosen.positions, declared.positions, [n for n in free if n in layout.q], True),
        (chosen.rates, declared.rates, rates, False),
    ):
        wanted = dict.fromkeys([*second, *rest], 0.0)
        soft = initial.compatible(q, first, {n: x for n, x in wanted.items() if n not in first}, positions=positions)
        found += [*first, *soft]
    return found


def assembly_rows(module: BoundModel, t: float, x: Array, inputs: SlopesNow | None) -> Array:
    """The derivatives of what an assembly solves, inputs that depend on the state and on parameters included."""
    layout, E = module.layout, module.kernels.assembly_jacobian(x, t=t)
    if inputs is not None:
        by_u = E[:, layout.n_x : layout.n_x + layout.n_u]
        by_x, by_p = E[:, : layout.n_x], E[:, layout.n_x + layout.n_u :]
        E = np.hstack([by_x + by_u @ inputs.by_x, by_u, by_p + by_u @ inputs.by_p])
    return E


def start_sensitivity(
    module: BoundModel,
    t: float,
    x: Array,
    held: Sequence[str],
    columns: Differentiated,
    inputs: SlopesNow | None = None,
    slopes: Mapping[str, Array] = MappingProxyType({}),
) -> Array:
    """dx0 (n_x, k) of an assembled state, with the derivatives of the inputs there.

    ``slopes`` are those (n_p,) of held values that follow from parameters, by name.

    Raises
    ------
    UsageError
        The held values cannot all stay when a parameter changes.
    """
    layout, scales = module.layout, module.layout.scales
    n_q, n_v, n_x, n_h, n_c = layout.n_q, layout.n_v, layout.n_x, layout.n_h, layout.n_c
    count = len(columns.names)
    E = assembly_rows(module, t, x, inputs)
    other = columns.spread(E[:, n_x + layout.n_u :], E[:, n_x : n_x + layout.n_u])
    initial = Initial(module.kernels, t)
    wanted = {name: np.zeros(count) for name in held}
    for name in slopes.keys() & wanted.keys():
        (wanted[name],) = columns.spread(slopes[name][None], np.zeros((1, layout.n_u)))
    for column, name in columns.initial:
        if len(initial.gradients(x[:n_q], name)) != 1:
            raise ill_placed(f"{name} cannot change alone; use the angular velocity, or rotation: euler_angles")
        wanted[name][column] = 1.0
    N = scales.rates(x[:n_q], np.eye(n_v))
    turns = _turns(layout, x[:n_q], wanted)
    places = {name: [int(np.flatnonzero(row)[0]) for row in initial.gradients(x[:n_q], name)]
              for name in held if name in layout.q}  # fmt: skip

    def solve(
        J: Array, off: Array, lines: slice, own: Mapping[str, list[int]], cut: Sequence[str], first: int
    ) -> Array:
        """The changes (n_v, k) for which all lines of an assembly's equations of one level stay 0."""
        rows, right = [*scales.jacobian(J[lines])], [*(-off[lines] / scales.c[: lines.stop - lines.start, None])]
        for name in held:
            for k in own.get(name, ()):
                rows.append(np.eye(n_v)[k])
                right.append(turns.get(k, wanted[name]) / scales.q[k])
            if name in cut:
                line, size = first + cut.index(name), layout.loop_scales[cut.index(name)]
                rows.append(J[line] * scales.q / size)
                right.append((wanted[name] - off[line]) / size)
        return np.asarray(scales.q[:, None] * _solve(rows, right, n_v, count, columns))

    m = n_h + n_c
    dq = scales.rates(x[:n_q], solve(E[:, :n_q] @ N, other, slice(0, n_h), places, layout.loops, m))
    turns, rates = {}, {name: [layout.v.index(name)] for name in held if name in layout.v}
    other = other + E[:, :n_q] @ dq
    m += layout.n_loop_coordinates
    return np.vstack([dq, solve(E[:, n_q:n_x], other, slice(n_h, n_h + n_c), rates, layout.loop_rates, m)])


def _turns(layout: Layout, q: Array, wanted: Mapping[str, Array]) -> dict[int, Array]:
    """Rotations (k,) that changes of held Euler parameters make, by the places of their angular velocities in v."""
    found: dict[int, Array] = {}
    for i, j in layout.quaternion_slots:
        held = [k for k in range(4) if layout.q[i + k] in wanted]
        changes = np.array([wanted[layout.q[i + k]] for k in held])
        if changes.any():
            assert layout.space is not None
            G = np.stack([layout.space.rates(q, e)[i : i + 4] for e in np.eye(layout.n_v)[j : j + 3]], axis=1)
            whole = np.zeros((4, changes.shape[1]))
            whole[held] = changes  # of length 1, those not given are 0
            found |= dict(zip(range(j, j + 3), algebra.lstsq(G, whole, rcond=STATE), strict=True))
    return found


def _solve(rows: Sequence[Array], right: Sequence[Array], n: int, count: int, columns: Differentiated) -> Array:
    """The smallest solution (n, k) of rows that must be consistent."""
    A, b = np.array(rows).reshape(len(rows), n), np.array(right).reshape(len(rows), count)
    if not A.size or not count:
        return np.zeros((n, count))
    found = algebra.lstsq(A, b, rcond=STATE)
    left = np.abs(A @ found - b).max(axis=0)
    bad = np.flatnonzero(left > CONTRADICTION * np.maximum(1.0, np.abs(b).max(axis=0)))
    if bad.size:
        raise untrue(
            f"the start cannot follow a change of {columns.names[bad[0]]}: the constraints and the held values do "
            "not allow it; hold fewer values"
        )
    return np.asarray(found)


def keep_consistent(
    module: BoundModel,
    t: float,
    x: Array,
    S: Array,
    columns: Differentiated,
    inputs: SlopesNow | None = None,
) -> Array:
    """The nearest sensitivities (n_x, k) that keep the constraints to first order, at a state on them.

    ``inputs`` are the derivatives of the inputs there.
    """
    layout, scales = module.layout, module.layout.scales
    n_q, n_x, n_h, n_c = layout.n_q, layout.n_x, layout.n_h, layout.n_c
    if not n_c:
        return S
    E = assembly_rows(module, t, x, inputs)
    other = columns.spread(E[:, n_x + layout.n_u :], E[:, n_x : n_x + layout.n_u])
    N = scales.rates(x[:n_q], np.eye(layout.n_v))
    dq, dv = S[:n_q], S[n_q:]
    if n_h:
        C_q = E[:n_h, :n_q]
        dq = dq - scales.rates(x[:n_q], minimum_norm(C_q @ N, C_q @ dq + other[:n_h], scales))
    lines = slice(n_h, n_h + n_c)
    gap = E[lines, :n_q] @ dq + E[lines, n_q:n_x] @ dv + other[lines]
    return np.vstack([dq, dv - minimum_norm(E[lines, n_q:n_x], gap, scales)])


# -- branches that a change leaves -------------------------------------------------------------------------------------


def refuse_lost_branches(module: BoundModel, forcing: Forcing, run: Trajectory, columns: Differentiated) -> None:
    """Refuse parameters and inputs whose change opens a crossing that the run passes.

    Raises
    ------
    NoDerivativeError
        Names the parameter or input, and the time.
    """
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
