"""What a user gives as values of many runs, or as a grid of values -> Variations, a column for each run."""

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
from ...base.names import place_of_marker
from ...base.value_rules import read_count
from ...errors import AssemblyError, EomgenError, ParameterError, at_odds, ill_shaped, incomplete, no_number
from ..argument_checks import check_names, read_axis, read_numbers, require_mapping, require_size, without_dots
from ..initial import Initial
from ..layout import refused_runs, warn_of_fixed
from ..trajectory import last_state

if TYPE_CHECKING:
    from ..bound_model import BoundModel
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
    that differ are refused, all named; parameters that the model does not allow only where no run has others.
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
    varied = Variations(k, p, u, states, values, refused=_refused(module, p, k))
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
        return _columns(f"{what}s", raw, names, lengths)
    raw = without_dots(raw, layout.instances)
    check_names(what, raw, names)
    values = {name: _numbers(f"{what} {name}", x, lengths) for name, x in raw.items()}
    _require_one_length(lengths)
    k = next((len(x) for x in values.values() if np.ndim(x)), None)
    result = base.copy() if k is None else np.repeat(base[:, None], k, axis=1)
    for name, value in values.items():
        result[names.index(name)] = value
    return result


def _refused(module: BoundModel, p: Array, count: int) -> dict[int, str]:
    """Why runs with parameters (n_p,) or (n_p, k) do not begin, by run; refused at once where none would."""
    problems = refused_runs(module.info, p.reshape(len(p), -1))
    if problems and len(problems) == (p.shape[1] if p.ndim > 1 else 1):
        raise ParameterError(problems[0])
    return {k: str(ParameterError(one)) for k, one in problems.items()}


def _require_one_length(lengths: Mapping[str, int]) -> None:
    if len(set(lengths.values())) > 1:
        counts = ", ".join(f"{what}: {k}" for what, k in lengths.items())
        raise ill_shaped(f"every (k,) and (n, k) array must have the same number of runs k, not {counts}")


def _columns(what: str, raw: Any, names: tuple[str, ...], lengths: dict[str, int]) -> Array:
    array = _floats(what, raw)
    if array.ndim not in (1, 2) or array.shape[0] != len(names):
        counts = ", ".join(names) or "none"
        raise ill_shaped(f"{what} must have shape ({len(names)},) or ({len(names)}, k) [{counts}], not {array.shape}")
    if array.ndim == 2:
        lengths[what] = array.shape[1]
    return array


def _numbers(what: str, raw: Any, lengths: dict[str, int]) -> Any:
    array = _floats(what, raw)
    if array.ndim > 1:
        raise ill_shaped(f"{what} must be a number or have shape (k,), not {array.shape}")
    if array.ndim:
        lengths[what] = len(array)
    return array if array.ndim else float(array)


def _floats(what: str, raw: Any) -> Array:
    array = np.array(read_numbers(what, raw))
    if not np.isfinite(array).all():
        first = np.argwhere(~np.isfinite(array))[0].tolist()
        raise no_number(f"{what} must be finite; entry {first} is {array[tuple(first)]}")
    return array
