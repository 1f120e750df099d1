"""What a user gives as values of many runs, or as a grid of values -> Variations, and the first states of all runs."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.algebra import Array, Indices
from ...base.continuation import LONGEST
from ...base.limits.constraints import (
    CONTRADICTION,
    CONVERGED,
    EXACT,
    FURTHER_ROWS,
    GONE,
    INDEPENDENT,
    STILL,
    STRUCTURE,
)
from ...base.texts import place_of_marker
from ...base.value_rules import read_count
from ...errors import (
    AssemblyError,
    EomgenError,
    ParameterError,
    Problem,
    UsageError,
    at_odds,
    ill_shaped,
    incomplete,
    no_number,
)
from ..argument_checks import check_names, read_axis, read_numbers, require_mapping, require_size, without_dots
from ..initial import Initial
from ..kernels import Kernels
from ..layout import refused_runs, silent, values_at, warn_of_fixed
from ..refusals import require_switched
from ..runs.events import at_next_samples, require_agreement
from ..runs.run_arguments import find_state
from ..trajectory import last_state

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..inputs import Forcing
    from ..layout import Layout


# -- grids -------------------------------------------------------------------------------------------------------------


Groups = tuple[Any, Any, Any]


def spread_grid(module: BoundModel, grid: Any, groups: Groups) -> Groups:
    """Initial values, parameters and inputs with the columns of a grid: every combination, the last name fastest.

    A grid has a list of values, or (low, high, count), by the name of a parameter, an input, a coordinate, a rate or an
    output; the groups are what is given beside it, by name.
    """
    require_mapping("grid", grid)
    grid = without_dots(grid, module.layout.instances)
    if not grid:
        raise incomplete("grid has no names; give values by name, such as {'theta': (0, 1, 11)}")
    layout = module.layout
    states = (*layout.x, *layout.loops, *layout.loop_rates, *layout.y)
    check_names("parameter, input, coordinate or rate", grid, (*module.p_names, *module.u_names, *states))
    for what, raw in zip(("initial", "parameters", "inputs"), groups, strict=True):
        if raw is not None and not isinstance(raw, Mapping):
            raise incomplete(f"{what} must be given by name beside a grid")
        if twice := sorted({*grid} & {*without_dots(raw or {}, layout.instances)}):
            raise at_odds(f"grid: {', '.join(twice)} is given in {what} too; give it once")
    axes = grid_axes(grid)
    count = math.prod(map(len, axes.values()))
    require_size(f"a grid of {count} runs", float(count) * len(axes), "give fewer values")
    columns = [column.ravel() for column in np.meshgrid(*axes.values(), indexing="ij")]
    initial, parameters, inputs = (dict(raw or {}) for raw in groups)
    for name, column in zip(grid, columns, strict=True):
        home = parameters if name in module.p_names else inputs if name in module.u_names else initial
        home[name] = column
    return initial, parameters, inputs


def grid_axes(grid: Mapping[str, Any]) -> dict[str, Array]:
    """The values of each name of a grid."""
    return {name: np.asarray(read_axis(f"grid {name}", values)) for name, values in grid.items()}


# -- variations --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Variations:
    """What differs between runs, and what does not.

    Attributes
    ----------
    count : int
        Number of runs, k.
    p, u : (n_p,), (n_u,) or (n_p, k), (n_u, k) arrays
    states : (n_x, k) array or None
        Initial states, not yet projected.
    values : dict of str to float or (k,) array
        Named initial values where there are no states.
    starts_differ : bool
        Whether the positions where the runs start may differ; of all runs, also in a part of them.
    refused : dict of int to str
        Runs whose parameters the model does not allow, and why.
    """

    count: int
    p: Array
    u: Array
    states: Array | None
    values: dict[str, Any]
    starts_differ: bool = False
    refused: dict[int, str] = field(default_factory=dict)

    def part(self, start: int, stop: int) -> Variations:
        """The runs from `start` to before `stop`."""
        runs = range(start, min(stop, self.count))
        refused = {k - start: self.refused[k] for k in runs if k in self.refused} if self.refused else {}
        return self.chosen(slice(start, runs.stop), len(runs), refused)

    def chosen(self, runs: slice | Indices, count: int, refused: dict[int, str]) -> Variations:
        """Some of the runs, so many, and which of them are refused."""
        values = {name: x[runs] if np.ndim(x) else x for name, x in self.values.items()}
        states = None if self.states is None else self.states[:, runs]
        p, u = (a if a.ndim == 1 else a[:, runs] for a in (self.p, self.u))
        return replace(self, count=count, p=p, u=u, states=states, values=values, refused=refused)

    @property
    def differ(self) -> bool:
        """Whether anything differs between the runs."""
        values = () if self.states is not None else self.values.values()
        return self.p.ndim > 1 or self.u.ndim > 1 or self.states is not None or any(np.ndim(x) for x in values)

    def deciding(self, layout: Layout) -> Array:
        """The parameters and inputs (n, k) that decide where runs can start."""
        p, u = self.p, self.u
        if not any(place_of_marker(n) or layout.plain(n) in layout.y for n in (*self.values, *layout.initial_outputs)):
            p, u = p[layout.start_parameters], u[layout.constraint_inputs]
        return np.vstack([a if a.ndim > 1 else np.repeat(a[:, None], self.count, axis=1) for a in (p, u)])

    def alike(self, layout: Layout, runs: Sequence[int]) -> list[list[int]]:
        """Runs by what of their parameters and inputs decides where they can start."""
        rows, groups = self.deciding(layout).T, dict[bytes, list[int]]()
        for k in runs:
            groups.setdefault(rows[k].tobytes(), []).append(k)
        return list(groups.values())

    def in_groups(
        self, layout: Layout, runs: list[int], singly: bool, work: Callable[[list[int]], None]
    ) -> dict[int, str]:
        """Work on runs that are alike together, or on each; the runs for which it fails, with the reason."""
        left = [[k] for k in runs] if singly else self.alike(layout, runs)
        reasons = dict[int, str]()
        while left:
            columns = left.pop()
            try:
                work(columns)
            except EomgenError as error:
                if len(columns) == 1:
                    reasons[columns[0]] = str(error)
                else:  # some cannot be: find out which
                    left += [[k] for k in columns]
        return reasons

    def column(self, k: int | Indices) -> dict[str, Any]:
        """Parameters and inputs of one run, as ``Module.bind`` takes them, or of some as calls of kernels do."""
        raw = [(name, a) for name, a in (("p", self.p), ("u", self.u)) if a.size or a.ndim == 1]  # of no runs: none
        return {name: a if a.ndim == 1 else a[:, k] for name, a in raw}

    def digest(self) -> str:
        """SHA-256 of all of it."""
        result = hashlib.sha256(str(self.count).encode())
        for array in (self.p, self.u, self.states):
            result.update(b"none" if array is None else repr(array.shape).encode() + np.ascontiguousarray(array).data)
        for name, value in sorted(self.values.items()):
            result.update(name.encode() + np.ascontiguousarray(value, dtype=float).data)
        return result.hexdigest()


def collect_variations(
    module: BoundModel,
    initial: Mapping[str, Any] | ArrayLike | None,
    parameters: Mapping[str, Any] | ArrayLike | None,
    inputs: Mapping[str, Any] | ArrayLike | None,
    count: int | None,
) -> Variations:
    """Bring initial values, parameters and inputs together, each by name, or as arrays (n,) or (n, k).

    The number of runs is the count where no array gives it.  Unknown names, values that are not finite, and lengths
    that differ are refused, all named; parameters that are not finite or that the model does not allow only where no
    run has others.
    """
    lengths: dict[str, int] = {} if count is None else {"count": read_count("count, of runs,", count)}
    p = _bound("parameter", module, parameters, lengths)
    u = _bound("input", module, inputs, lengths)
    states, values = None, {}
    if isinstance(initial, Mapping):
        layout = module.layout
        initial = without_dots(initial, layout.instances)
        values = {str(name): _numbers(f"initial {name}", x, lengths) for name, x in initial.items()}
        known = (*layout.x, *layout.loops, *layout.loop_rates, *layout.y, *filter(place_of_marker, values))
        check_names("coordinate or rate", values, known)
        with suppress(AssemblyError):  # of values, which differ between runs
            Initial(module.kernels, 0.0, values).sort(dict.fromkeys(values, 0.0))  # names that no run can take
    elif initial is not None:
        states = _columns("initial", last_state(initial, module.x_names), module.x_names, lengths)
    _require_one_length(lengths)
    k = next(iter(lengths.values()), 1)
    if states is None:
        declared = (*module.layout.initial, *module.layout.initial_outputs)
        warn_of_fixed(module.layout, p, [name for name in declared if name not in values])
    require_size(f"simulate_many with {k} runs", float(k) * module.n_x, "give fewer runs")
    if states is not None and states.ndim == 1:
        states = np.repeat(states[:, None], k, axis=1)
    refused = {} if parameters is None else _refused(module, p)
    varied = Variations(k, p, u, states, values, refused=refused)
    rows = varied.deciding(module.layout)
    differ = any(np.ndim(value) and name in module.layout.q for name, value in values.items())
    return replace(varied, starts_differ=bool(differ or (rows != rows[:, :1]).any()))


def _bound(what: str, module: BoundModel, raw: Any, lengths: dict[str, int]) -> Array:
    """Values (n,) or (n, k) of parameters or inputs; those not given keep the bound ones."""
    if raw is None:
        return module.p if what == "parameter" else module.u
    layout = module.layout
    names, base = (layout.p, module.p) if what == "parameter" else (layout.u, module.u)
    if not isinstance(raw, Mapping):
        return _columns(f"{what}s", raw, names, lengths, what == "input")
    raw = without_dots(raw, layout.instances)
    check_names(what, raw, names)
    values = {name: _numbers(f"{what} {name}", x, lengths, what == "input") for name, x in raw.items()}
    _require_one_length(lengths)
    k = next((len(x) for x in values.values() if np.ndim(x)), None)
    result = base.copy() if k is None else np.repeat(base[:, None], k, axis=1)
    for name, value in values.items():
        result[names.index(name)] = value
    return result


def _refused(module: BoundModel, p: Array) -> dict[int, str]:
    """Why runs with parameters (n_p,) or (n_p, k) do not begin, by run; refused at once where none would."""
    columns = p if p.ndim > 1 else p[:, None]
    problems = refused_runs(module.info, columns)
    for row, k in np.argwhere(~np.isfinite(columns)).tolist():
        one = Problem(f"parameter {module.p_names[row]}", f"must be finite; it is {columns[row, k]}", code="EG-NUMBER")
        problems.setdefault(k, []).append(one)
    if problems and len(problems) == (count := columns.shape[1]):
        where = f" in run 0, and parameters are refused in all {count} runs" * (count > 1)
        first = refused_runs(module.info, columns[:, :1]).get(0, problems[0])  # all that is wrong with it
        raise ParameterError([one._replace(message=one.message + where) for one in first])
    return {k: "; ".join(map(str, one)) for k, one in problems.items()}


def _require_one_length(lengths: Mapping[str, int]) -> None:
    if len(set(lengths.values())) > 1:
        counts = ", ".join(f"{what}: {k}" for what, k in lengths.items())
        raise ill_shaped(f"every (k,) and (n, k) array must have the same number of runs k, not {counts}")


def _columns(what: str, raw: Any, names: tuple[str, ...], lengths: dict[str, int], finite: bool = True) -> Array:
    array = _floats(what, raw, finite)
    if array.ndim not in (1, 2) or array.shape[0] != len(names):
        counts = ", ".join(names) or "none"
        raise ill_shaped(f"{what} must have shape ({len(names)},) or ({len(names)}, k) [{counts}], not {array.shape}")
    if array.ndim == 2:
        lengths[what] = array.shape[1]
    return array


def _numbers(what: str, raw: Any, lengths: dict[str, int], finite: bool = True) -> Any:
    array = _floats(what, raw, finite)
    if array.ndim > 1:
        raise ill_shaped(f"{what} must be a number or have shape (k,), not {array.shape}")
    if array.ndim:
        lengths[what] = len(array)
    return array if array.ndim else float(array)


def _floats(what: str, raw: Any, finite: bool) -> Array:
    array = np.array(read_numbers(what, raw))
    if finite and not np.isfinite(array).all():
        first = np.argwhere(~np.isfinite(array))[0].tolist()
        raise no_number(f"{what} must be finite; entry {first} is {array[tuple(first)]}")
    return array


# -- first states of all runs ------------------------------------------------------------------------------------------


Mask = np.ndarray[Any, np.dtype[np.bool_]]


def assemble_states(
    module: BoundModel, varied: Variations, t: float, forcing_of: Callable[[int], Forcing]
) -> tuple[Array, dict[int, str]]:
    """The initial states (n_x, k) of all runs on the constraints at time t, and why some cannot be assembled (NaN).

    ``forcing_of(k)`` has the inputs of a run.
    """
    with silent():  # for all runs, when their values were collected
        x, reasons = _assemble_all(module, varied, t, forcing_of)
    if module.info.clocks:
        for k in set(range(varied.count)) - reasons.keys():
            x[:, k] = at_next_samples(module.bind(**varied.column(k)), t, x[:, k])
    if module.layout.switches:
        _refuse_disagreement(module, varied, t, x, reasons)
    return x, reasons


def _refuse_disagreement(module: BoundModel, varied: Variations, t: float, x: Array, reasons: dict[int, str]) -> None:
    """Add the runs at whose start a constraint declared closed does not hold, or one is half closed."""
    layout, by_name = module.layout, varied.states is None and bool(module.info.rows_to_hold)
    for k in set(range(varied.count)) - reasons.keys():
        try:
            require_switched(layout, x[layout.n_x - layout.n_states :, k])
            if by_name:
                require_agreement(module.bind(**varied.column(k)), t, x[:, k], varied.values)
        except UsageError as error:
            reasons[k], x[:, k] = str(error), np.nan


@np.errstate(all="ignore")
def _assemble_all(
    module: BoundModel, varied: Variations, t: float, forcing_of: Callable[[int], Forcing]
) -> tuple[Array, dict[int, str]]:
    """The states (n_x, k), and why runs have none; what several runs have in common is solved for once."""
    layout = module.layout
    free = not module.n_rows and not layout.space
    if varied.states is not None and free:
        return np.array(varied.states), {}
    constrained, x = forcing_of(0).constrained, np.full((module.n_x, varied.count), np.nan)

    def assemble(columns: list[int]) -> None:
        k = columns[0]
        if constrained:  # constraints depend on inputs that vary
            values = {name: float(value[k] if np.ndim(value) else value) for name, value in varied.values.items()}
            raw: Any = (values or None) if varied.states is None else varied.states[:, k]
            x[:, k] = find_state(module.rebound(**varied.column(k)), raw, t, forcing_of(k))
        elif varied.states is not None:
            x[:, columns] = module.project(varied.states[:, columns], t=t, **varied.column(k))
        else:
            x[:, columns] = _assemble_named(module, varied, columns, t)

    every, good = [*range(varied.count)], np.zeros(varied.count, dtype=bool)
    if every and not (constrained or varied.differ):
        assemble(every)
        return x, {}
    differ = varied.starts_differ and layout.n_v <= DENSE  # the same for every block
    if varied.states is None and not constrained and (free or differ):
        most = max(JACOBIAN_NUMBERS // (layout.n_c * layout.n_v + 1), 1)
        parts = [varied.part(i, i + most) for i in range(0, varied.count, most)]
        result = [_assemble_side_by_side(module, part, t) for part in parts]
        good = np.concatenate([good[:0], *(one for _, one in result)])
        x[:, good] = np.hstack([x[:, :0], *(one for one, _ in result)])[:, good]
    return x, varied.in_groups(layout, np.flatnonzero(~good).tolist(), constrained, assemble)


def _assemble_named(module: BoundModel, varied: Variations, columns: list[int], t: float) -> Array:
    """The states of runs that differ, as far as starts can tell, in their named values alone."""
    kernels = Kernels(module.core, module.layout, **varied.column(columns[0]))
    initial = Initial(kernels, t, varied.values)
    raw = [initial.sort({name: float(x[k] if np.ndim(x) else x) for name, x in varied.values.items()})
             for k in columns]  # fmt: skip
    alike: dict[tuple[float, ...], list[int]] = {}
    for i, one in enumerate(raw):
        alike.setdefault(tuple(one.positions.values()), []).append(i)
    x = np.empty((module.n_x, len(columns)))
    for places in alike.values():
        first = raw[places[0]]
        q = initial.assembled(first.positions)
        rates = {name: np.array([raw[i].rates[name] for i in places]) for name in first.rates}
        v = initial.velocities(q, rates if first.positions or rates else None)
        x[: module.n_q, places] = q[:, None]
        x[module.n_q :, places] = v if v.ndim > 1 else v[:, None]
    return x


# -- starts of many runs side by side ----------------------------------------------------------------------------------

# As Initial does for one run, with one call of a kernel for all of them.  Newton's method is trusted where each step is
# so much shorter than the one before that it ends at the only position near (Kantorovich); held values go to theirs in
# short ways.  A run is left to Initial where that does not hold, where the held values do not decide the position, and
# where a value is to be refused.


JACOBIAN_NUMBERS = 2**21  #: numbers of Jacobians at a time
ROUNDS = 12  #: steps of Newton's method
SHRINK = 0.25  #: largest first scaled step, and largest part of the one before that a further step has
SAFE = 1e-3  #: least singular value, relative to the largest, of what follows from held values
DENSE = 200  #: largest n_v with loops; beyond it dense matrices take as long as the runs one by one
STRIDE = 0.1  #: scaled way of held values from one closed position to the next


class SideBySide:
    """The starts of runs from named values that are entries of the state.

    Attributes
    ----------
    q : (n_q, k) array
        Positions reached.
    good : (k,) bool array
        Whether a run has arrived there.
    """

    def __init__(self, module: BoundModel, varied: Variations) -> None:
        self.layout, self.varied = module.layout, varied
        names = "constraints", "constraint_jacobian", "velocity_constraints", "alignment"
        self.C, self.C_q, self.C_t, self.alignment = (module.kernels.kernel(name, nan=True) for name in names)
        sizes = np.concatenate([self.layout.scales.q, self.layout.scales.c])
        self.sizes = np.repeat(sizes[:, None], varied.count, axis=1)
        if "scales" in module.core.names and varied.p.ndim > 1:
            self.sizes = module.kernels.kernel("scales", nan=True)(np.empty((0, varied.count)), p=varied.p)
        self.q = np.repeat(self.layout.q_reference[:, None], varied.count, axis=1)
        self.good: Mask = np.ones(varied.count, dtype=bool)

    def jacobian(self, runs: Indices) -> tuple[Array, dict[str, Array]]:
        """Scaled Jacobians (k, n_c, n_v) at the positions of some runs, zero where one is no number; their p, u."""
        raw, n, sizes = self.varied.column(runs), self.layout.n_v, self.sizes[:, runs]
        J = np.ascontiguousarray((self.C_q(self.q[:, runs], **raw) * sizes[:n] / sizes[n:, None]).transpose(2, 0, 1))
        J[~np.isfinite(J).all(axis=(1, 2))] = 0.0
        return J, raw

    def close(self, fixed: Sequence[int], runs: Indices) -> None:
        """Close the loops of some runs with some coordinates held."""
        n, h = self.layout.n_v, self.layout.n_h
        free = np.setdiff1d(np.arange(self.layout.n_q), fixed)
        self.good[runs] = False
        last, before = np.ones(len(runs)), np.full(len(runs), np.inf)
        for _ in range(ROUNDS):
            if not len(runs):
                break
            J, raw = self.jacobian(runs)
            e = (self.C(self.q[:, runs], **raw) / self.sizes[n : n + h, runs]).T
            size = np.abs(e).max(axis=1, initial=0.0)
            U, steep, V = np.linalg.svd(J[:, :h, free], full_matrices=False)
            decided = (steep[:, -1:] > SAFE * steep[:, :1]).all(axis=1) & (len(free) <= h)
            done = (size <= EXACT) | (decided & (size <= CONVERGED) & (size > 0.5 * before))
            self.good[runs[done]] = True
            z = _times(V.transpose(0, 2, 1), _times(U.transpose(0, 2, 1), e) / steep)
            length = np.abs(z).max(axis=1, initial=0.0)
            on = decided & ~done & (length <= np.maximum(SHRINK * last, CONVERGED))
            runs, last, before = runs[on], length[on], size[on]
            self.q[np.ix_(free, runs)] -= z[on].T * self.sizes[np.ix_(free, runs)]
        if self.layout.sizes.n_alignments:
            self.good &= (self.alignment(self.q, p=self.varied.p, u=self.varied.u) > 0.0).all(axis=0)

    def lead(self, fixed: Sequence[int], values: Array) -> None:
        """Lead held coordinates straight to values (h, k), with the loops closed on the way."""
        start = self.q[fixed]
        way = np.abs((values - start) / self.sizes[fixed]).max(axis=0, initial=0.0)
        self.good &= way <= LONGEST
        steps = np.ceil(np.where(self.good, way, 0.0) / STRIDE).astype(int)
        for step in range(1, steps.max(initial=0) + 1):
            runs = np.flatnonzero(self.good & (steps >= step))
            part = step / steps[runs]
            there = start[:, runs] + part * (values - start)[:, runs]
            self.q[np.array(fixed)[:, None], runs] = np.where(part == 1.0, values[:, runs], there)
            self.close(fixed, runs)

    def independent(self, rows: int, raw: Sequence[int], rest: Sequence[int]) -> list[int]:
        """Those given, and of the rest, in order, what is independent of the constraints and of each other.

        Runs where that is not as at the reference position, or where one that is given can hardly move, are left.
        """
        runs, scales = np.flatnonzero(self.good), self.layout.scales
        if not rows:
            return [*raw, *rest]
        reference = scales.jacobian(self.C_q(self.layout.q_reference))
        J, kept = np.concatenate([reference[None], self.jacobian(runs)[0]])[:, :rows], list(raw)
        _, steep, V = np.linalg.svd(J)
        ranks = (steep > STRUCTURE * steep[:, :1]).sum(axis=1)
        alike, N = ranks == ranks[0], V[:, ranks[0] :]  # motions that the constraints allow
        for i in (*raw, *rest):
            size = np.linalg.norm(N[:, :, i], axis=1)
            moves = size > INDEPENDENT
            alike &= size > STILL if i in raw else moves == moves[0]
            kept += [i] * bool(i not in raw and moves[0])
            row = np.where(moves, 1.0 / size, 0.0)[:, None] * N[:, :, i]
            N = N - row[:, :, None] * _times(N.transpose(0, 2, 1), row)[:, None]
        self.good[runs[~alike[1:]]] = False
        return kept

    def velocities(self, fixed: Sequence[int], v: Array) -> Array:
        """Velocities (n_v, k) with those held of v, the others as small as can be."""
        layout, runs = self.layout, np.flatnonzero(self.good)
        if not (layout.n_c and len(runs)):
            return v
        n, rank = layout.n_v, layout.rank
        J, raw = self.jacobian(runs)
        steep = np.linalg.svd(J, compute_uv=False)
        determined = ((steep > STRUCTURE * steep[:, :1]).sum(axis=1) == rank) & (
            steep[:, rank - 1] > GONE * steep[:, 0]
        )
        x, free = (v[:, runs] / self.sizes[:n, runs]).T, np.setdiff1d(np.arange(n), fixed)
        rest = (self.C_t(np.concatenate([self.q[:, runs], 0.0 * x.T]), **raw) / self.sizes[n:, runs]).T
        inverse = np.asarray(np.linalg.pinv(J[:, :, free], rcond=FURTHER_ROWS), dtype=float)
        for _ in range(2):
            x[:, free] -= _times(inverse, _times(J, x) + rest)
        speed = np.abs(np.hstack([x[:, : layout.moving], rest])).max(axis=1, initial=1.0)
        self.good[runs] = determined & (np.abs(_times(J, x) + rest).max(axis=1) <= CONTRADICTION * speed)
        v[:, runs] = x.T * self.sizes[:n, runs]
        return v


def _times(A: Array, x: Array) -> Array:
    """Matrices (k, m, n) times vectors (k, n), in bits that do not depend on k."""
    return np.asarray((A @ np.ascontiguousarray(x)[:, :, None])[:, :, 0])


def _assemble_side_by_side(module: BoundModel, varied: Variations, t: float) -> tuple[Array, Mask]:
    """The states (n_x, k) of runs, and which they are: the others are left to Initial."""
    layout, entries, starts = module.layout, [*module.layout.x], SideBySide(module, varied)
    now, n_q = values_at(layout, varied.p), layout.n_q
    values, numbers = {**layout.info.initial, **now, **varied.values}, np.zeros((layout.n_x, varied.count))
    if layout.quaternion_slots or layout.general_rates or layout.initial_outputs or not {*values} <= {*entries}:
        return numbers, np.zeros(varied.count, dtype=bool)
    for name, value in values.items():
        numbers[entries.index(name)] = value
    declared, changed, raw = (
        [entries.index(name) for name in names] for names in (layout.info.initial, now, varied.values)
    )
    first, moved, wanted = ([i for i in places if i < n_q] for places in (declared, changed, raw))
    if (t and layout.n_c) or (layout.n_h and moved and wanted):
        return numbers, np.zeros(varied.count, dtype=bool)
    starts.good &= np.isfinite(numbers).all(axis=0)
    if not layout.n_h:
        starts.q[first + wanted] = numbers[first + wanted]
    else:
        for i in first:
            starts.q[i] = layout.info.initial[entries[i]]
        starts.close(first, np.flatnonzero(starts.good))
        if moved:
            starts.lead(first, numbers[first])
        elif wanted:
            fixed = starts.independent(layout.n_h, wanted, [i for i in first if i not in wanted])
            starts.lead(fixed, numbers[fixed])
    rates, wanted = ([i - n_q for i in places if i >= n_q] for places in (declared, raw))
    if raw:
        rates = starts.independent(layout.n_c, wanted, [i for i in rates if i not in wanted])
    return np.concatenate([starts.q, starts.velocities(rates, numbers[n_q:])]), starts.good
