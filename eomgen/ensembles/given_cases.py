"""What a user gives as values of many runs, or as a grid of values -> Cases, a column for each run."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..base.names import place_of_marker
from ..base.value_rules import read_count
from ..errors import AssemblyError, EomgenError, UsageError, at_odds, ill_shaped, incomplete, no_number
from ..runtime.argument_checks import check_names, read_axis, read_numbers, require_mapping, require_room, without_dots
from ..runtime.assembled import initial_of
from ..runtime.late_start import fixed_told, late_values, tell_fixed
from ..runtime.refusals import require_switched
from ..runtime.trajectory import last_state
from ..simulation.events import at_next_samples, require_agreement
from ..simulation.run_arguments import find_state

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.inputs import Forcing


# -- grids -------------------------------------------------------------------------------------------------------------


Groups = tuple[Any, Any, Any]


def spread_grid(module: BoundModel, grid: Any, groups: Groups) -> Groups:
    """Initial values, parameters and inputs with the columns of a grid: every combination, the last name fastest.

    Parameters
    ----------
    module : BoundModel
    grid : mapping
        Values by the name of a parameter, an input, a coordinate, a rate or an output: a list, or (low, high, count).
    groups : tuple
        Initial values, parameters and inputs beside the grid, by name.

    Raises
    ------
    UsageError
        A name that is not there, or given twice; a group that is an array.
    """
    require_mapping("grid", grid)
    grid = without_dots(grid, module.layout.instances)
    if not grid:
        raise incomplete("grid has no names; give values by name, such as {'theta': (0, 1, 11)}")
    layout = module.layout
    states = (*layout.x, *layout.loops, *layout.loop_rates, *layout.y)
    check_names("parameter, input, coordinate or rate", grid, (*module.p_names, *module.u_names, *states))
    for what, given in zip(("initial", "parameters", "inputs"), groups, strict=True):
        if given is not None and not isinstance(given, Mapping):
            raise incomplete(f"{what} must be given by name beside a grid")
        if twice := sorted({*grid} & {*without_dots(given or {}, layout.instances)}):
            raise at_odds(f"grid: {', '.join(twice)} is given in {what} too; give it once")
    axes = grid_axes(grid)
    count = math.prod(map(len, axes.values()))
    require_room(f"a grid of {count} runs", float(count) * len(axes), "give fewer values")
    columns = [column.ravel() for column in np.meshgrid(*axes.values(), indexing="ij")]
    initial, parameters, inputs = (dict(given or {}) for given in groups)
    for name, column in zip(grid, columns, strict=True):
        home = parameters if name in module.p_names else inputs if name in module.u_names else initial
        home[name] = column
    return initial, parameters, inputs


def grid_axes(grid: Mapping[str, Any]) -> dict[str, Array]:
    """The values of each name of a grid."""
    return {name: np.asarray(read_axis(f"grid {name}", values)) for name, values in grid.items()}


# -- cases -------------------------------------------------------------------------------------------------------------


Mask = np.ndarray[Any, np.dtype[np.bool_]]

UNASSEMBLED = -111  #: status of a run whose initial values could not be assembled


@dataclass(frozen=True)
class Cases:
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
    """

    count: int
    p: Array
    u: Array
    states: Array | None
    values: dict[str, Any]

    def part(self, start: int, stop: int) -> Cases:
        """The runs from `start` to before `stop`."""
        values = {name: x[start:stop] if np.ndim(x) else x for name, x in self.values.items()}
        states = None if self.states is None else self.states[:, start:stop]
        p, u = (a if a.ndim == 1 else a[:, start:stop] for a in (self.p, self.u))
        return Cases(min(stop, self.count) - start, p, u, states, values)

    @property
    def alike(self) -> bool:
        """Whether parameters and inputs are the same for all."""
        return self.p.ndim == 1 and self.u.ndim == 1

    def column(self, k: int) -> dict[str, Any]:
        """Parameters and inputs of one run, as ``Module.bind`` takes them."""
        given = [(name, a) for name, a in (("p", self.p), ("u", self.u)) if a.size or a.ndim == 1]  # of no runs: none
        return {name: a if a.ndim == 1 else a[:, k] for name, a in given}

    def digest(self) -> str:
        """SHA-256 of all of it."""
        found = hashlib.sha256(str(self.count).encode())
        for array in (self.p, self.u, self.states):
            found.update(b"none" if array is None else repr(array.shape).encode() + np.ascontiguousarray(array).data)
        for name, value in sorted(self.values.items()):
            found.update(name.encode() + np.ascontiguousarray(value, dtype=float).data)
        return found.hexdigest()


def collect_cases(
    module: BoundModel,
    initial: Mapping[str, Any] | ArrayLike | None,
    parameters: Mapping[str, Any] | ArrayLike | None,
    inputs: Mapping[str, Any] | ArrayLike | None,
    count: int | None,
) -> Cases:
    """Bring initial values, parameters and inputs together.

    Parameters
    ----------
    module : BoundModel
    initial : mapping of str to float or (k,), or (n_x,) or (n_x, k) array, optional
    parameters : mapping of str to float or (k,), or (n_p,) or (n_p, k) array, optional
    inputs : mapping of str to float or (k,), or (n_u,) or (n_u, k) array, optional
        Constant over time.
    count : int, optional
        Number of runs, where nothing given tells it.

    Raises
    ------
    UsageError
        Unknown names, values that are not finite, and lengths that differ, all named.
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
            initial_of(module.kernels, 0.0, values).sort(dict.fromkeys(values, 0.0))  # names that no run can take
    elif initial is not None:
        states = _columns("initial", last_state(initial, module.x_names), module.x_names, lengths)
    _require_one_length(lengths)
    k = next(iter(lengths.values()), 1)
    if states is None:
        declared = (*module.layout.initial, *module.layout.initial_outputs)
        tell_fixed(module.layout, p, [name for name in declared if name not in values])
    require_room(f"simulate_many with {k} runs", float(k) * module.n_x, "give fewer runs")
    if states is not None and states.ndim == 1:
        states = np.repeat(states[:, None], k, axis=1)
    return Cases(k, p, u, states, values)


def assemble_states(
    module: BoundModel, cases: Cases, t: float, forcing_of: Callable[[int], Forcing]
) -> tuple[Array, Mask, list[str]]:
    """The initial states of all runs, on the constraints.

    Parameters
    ----------
    module : BoundModel
    cases : Cases
    t : float
        Time of the start (s).
    forcing_of : callable
        The inputs of a run by its number.

    Returns
    -------
    x : (n_x, k) array
        NaN for a run that cannot be assembled.
    failed : (k,) bool array
    words : list of str
        Why, for each of these in order.
    """
    with fixed_told():  # for all runs, when their cases were collected
        x, failed, words = _assemble_all(module, cases, t, forcing_of)
    if module.metadata.get("clocks"):
        for k in np.flatnonzero(~failed).tolist():
            x[:, k] = at_next_samples(module.bind(**cases.column(k)), t, x[:, k])
    if module.metadata.get("switched"):
        return _only_in_agreement(module, cases, t, x, failed, words)
    return x, failed, words


def _only_in_agreement(
    module: BoundModel, cases: Cases, t: float, x: Array, failed: Mask, words: list[str]
) -> tuple[Array, Mask, list[str]]:
    """The same without runs at whose start a constraint declared closed does not hold, or one is half closed."""
    layout, by_name = module.layout, cases.states is None and bool(module.metadata.get("held_rows"))
    told = dict(zip(np.flatnonzero(failed).tolist(), words, strict=True))
    for k in np.flatnonzero(~failed).tolist():
        try:
            require_switched(layout, x[layout.n_x - layout.n_states :, k])
            if by_name:
                require_agreement(module.bind(**cases.column(k)), t, x[:, k], cases.values)
        except UsageError as error:
            told[k], x[:, k] = str(error), np.nan
    return x, np.array([k in told for k in range(cases.count)], dtype=bool), [told[k] for k in sorted(told)]


def _assemble_all(
    module: BoundModel, cases: Cases, t: float, forcing_of: Callable[[int], Forcing]
) -> tuple[Array, Mask, list[str]]:
    free = not module.n_rows and not module.layout.space
    failed: Mask = np.zeros(cases.count, dtype=bool)
    words: list[str] = []
    if cases.states is not None and free:
        return np.array(cases.states), failed, words
    if forcing_of(0).constrained:
        return _assemble_each(module, cases, lambda k: _assemble_led(module, cases, k, t, forcing_of(k)))
    varying = cases.p.ndim > 1 or cases.u.ndim > 1 or any(np.ndim(x) for x in cases.values.values())
    if cases.states is None and (not varying or _is_free(module, cases, free)):
        late = {name: value for name, value in late_values(module.layout, cases.p).items() if np.ndim(value)}
        scalars = {name: 0.0 if np.ndim(x) else float(x) for name, x in (late | cases.values).items()}
        x = np.repeat(module.x0(scalars, t=t, **_shared(cases))[:, None], cases.count, axis=1)
        for name, value in (late | cases.values).items():
            if np.ndim(value):
                x[module.x_names.index(name)] = value
        for k in np.flatnonzero(~np.isfinite(x).all(axis=0)).tolist():  # of what follows from parameters
            failed[k] = True
            words.append(f"{module.x_names[int(np.argmin(np.isfinite(x[:, k])))]} is no number at the start")
        return x, failed, words
    if cases.states is not None and cases.alike:
        with suppress(EomgenError):  # some cannot be: find out which
            return module.project(cases.states, t=t, **cases.column(0)), failed, words
    if cases.states is None and cases.alike:
        with suppress(EomgenError):  # some cannot be: find out which
            return _assemble_alike(module, cases, t), failed, words
    return _assemble_each(module, cases, lambda k: _assemble_one(module, cases, k, t))


@np.errstate(all="ignore")
def _assemble_alike(module: BoundModel, cases: Cases, t: float) -> Array:
    """The initial states of runs that differ in their named values alone; each position is found once."""
    initial = initial_of(module.bind(**cases.column(0)).kernels, t, cases.values)
    given = [initial.sort({name: float(x[k] if np.ndim(x) else x) for name, x in cases.values.items()})
             for k in range(cases.count)]  # fmt: skip
    alike: dict[tuple[float, ...], list[int]] = {}
    for k, one in enumerate(given):
        alike.setdefault(tuple(one.positions.values()), []).append(k)
    x = np.empty((module.n_x, cases.count))
    for columns in alike.values():
        first = given[columns[0]]
        q = initial.assembled(first.positions)
        rates = {name: np.array([given[k].rates[name] for k in columns]) for name in first.rates}
        v = initial.velocities(q, rates if first.positions or rates else None)
        x[: module.n_q, columns] = q[:, None]
        x[module.n_q :, columns] = v if v.ndim > 1 else v[:, None]
    return x


def _assemble_each(module: BoundModel, cases: Cases, assemble: Callable[[int], Array]) -> tuple[Array, Mask, list[str]]:
    x, words = np.full((module.n_x, cases.count), np.nan), []
    failed: Mask = np.zeros(cases.count, dtype=bool)
    for k in range(cases.count):
        try:
            x[:, k] = assemble(k)
        except EomgenError as error:
            failed[k] = True
            words.append(str(error))
    return x, failed, words


def _assemble_led(module: BoundModel, cases: Cases, k: int, t: float, forcing: Forcing) -> Array:
    """The state of one run whose constraints depend on inputs that vary."""
    values: Any = {name: float(x[k] if np.ndim(x) else x) for name, x in cases.values.items()} or None
    given = values if cases.states is None else cases.states[:, k]
    return find_state(module.bind(**cases.column(k)), given, t, forcing)


def _assemble_one(module: BoundModel, cases: Cases, k: int, t: float) -> Array:
    if cases.states is not None:
        return module.project(cases.states[:, k], t=t, **cases.column(k))
    values = {name: float(x[k] if np.ndim(x) else x) for name, x in cases.values.items()}
    return module.x0(values, t=t, **cases.column(k))


def _is_free(module: BoundModel, cases: Cases, free: bool) -> bool:
    """Whether named initial values are entries of the state, whatever the others are."""
    layout = module.layout
    return free and not (layout.loops or layout.initial_outputs) and all(n in layout.x for n in cases.values)


def _shared(cases: Cases) -> dict[str, Any]:
    return {name: a for name, a in (("p", cases.p), ("u", cases.u)) if a.ndim == 1}


def _bound(what: str, module: BoundModel, given: Any, lengths: dict[str, int]) -> Array:
    """Values (n,) or (n, k) of parameters or inputs; those not given keep the bound ones."""
    if given is None:
        return module.p if what == "parameter" else module.u
    found = _read_bound(what, module, given, lengths)
    if what == "parameter":
        module.layout.require_allowed(found)
    return found


def _read_bound(what: str, module: BoundModel, given: Any, lengths: dict[str, int]) -> Array:
    layout = module.layout
    names, base = (layout.p, module.p) if what == "parameter" else (layout.u, module.u)
    if not isinstance(given, Mapping):
        return _columns(f"{what}s", given, names, lengths)
    given = without_dots(given, layout.instances)
    check_names(what, given, names)
    values = {name: _numbers(f"{what} {name}", x, lengths) for name, x in given.items()}
    _require_one_length(lengths)
    k = next((len(x) for x in values.values() if np.ndim(x)), None)
    result = base.copy() if k is None else np.repeat(base[:, None], k, axis=1)
    for name, value in values.items():
        result[names.index(name)] = value
    return result


def _require_one_length(lengths: Mapping[str, int]) -> None:
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{what}: {k}" for what, k in lengths.items())
        raise ill_shaped(f"every (k,) and (n, k) array must have the same number of runs k, not {told}")


def _columns(what: str, given: Any, names: tuple[str, ...], lengths: dict[str, int]) -> Array:
    array = _floats(what, given)
    if array.ndim not in (1, 2) or array.shape[0] != len(names):
        told = ", ".join(names) or "none"
        raise ill_shaped(f"{what} must have shape ({len(names)},) or ({len(names)}, k) [{told}], not {array.shape}")
    if array.ndim == 2:
        lengths[what] = array.shape[1]
    return array


def _numbers(what: str, given: Any, lengths: dict[str, int]) -> Any:
    array = _floats(what, given)
    if array.ndim > 1:
        raise ill_shaped(f"{what} must be a number or have shape (k,), not {array.shape}")
    if array.ndim:
        lengths[what] = len(array)
    return array if array.ndim else float(array)


def _floats(what: str, given: Any) -> Array:
    array = np.array(read_numbers(what, given))
    if not np.isfinite(array).all():
        first = np.argwhere(~np.isfinite(array))[0].tolist()
        raise no_number(f"{what} must be finite; entry {first} is {array[tuple(first)]}")
    return array
