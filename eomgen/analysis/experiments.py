"""What a user measured -> experiments, each with times, columns, initial values and inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.texts import quote
from ..errors import ill_typed, incomplete, off_range
from ..runtime.argument_checks import check_names, read_numbers, unknown
from ..runtime.storage import split_head

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

TIME = "t"


@dataclass(frozen=True)
class Experiment:
    """One run that was measured.

    Attributes
    ----------
    t : (m,) array
        Increasing times; the run starts at the first.
    columns : dict of str to (m,) array
        States and outputs; NaN where nothing was measured.
    initial : mapping or state or None
    inputs : mapping or None
    """

    t: Array
    columns: dict[str, Array]
    initial: Any
    inputs: Any


def read_experiments(module: BoundModel, data: Any, initial: Any, inputs: Any) -> list[Experiment]:
    """All experiments of a call of ``fit``."""
    several = isinstance(data, list | tuple)
    raw = list(data) if several else [data]
    if not raw:
        raise incomplete("data is an empty list; give at least one experiment")
    problems: list[str] = []
    starts, driven = (
        _one_each(what, x, len(raw), several, problems) for what, x in (("initial", initial), ("inputs", inputs))
    )
    result = []
    for k, one in enumerate(raw):
        where = f"data[{k}]" if several else "data"
        read = _read(module, where, one, problems)
        if read is not None:
            result.append(Experiment(*read, starts[k], driven[k]))
    if problems:
        raise ill_typed("; ".join(problems))
    return result


def _one_each(what: str, raw: Any, count: int, several: bool, problems: list[str]) -> list[Any]:
    """One value for each experiment: a list of as many, or one for all."""
    listed = (
        several
        and isinstance(raw, list | tuple)
        and not np.isscalar(raw)
        and (not raw or not isinstance(raw[0], int | float))
    )
    if not listed:
        return [raw] * count
    if len(raw) != count:
        problems.append(f"{what} is a list of {len(raw)}, and there are {count} experiments; give one for each")
        return [None] * count
    return list(raw)


def _read(module: BoundModel, where: str, data: Any, problems: list[str]) -> tuple[Array, dict[str, Array]] | None:
    before = len(problems)
    columns = _columns(data, where, module, problems)
    if columns is None:
        return None
    t = columns.pop(TIME, None)
    if t is None:
        problems.append(f"{where} has no times; give a column 't' (s), or a table with the times as its index")
        return None
    if t.ndim != 1 or len(t) < 2 or not np.isfinite(t).all() or (np.diff(t) <= 0).any():
        problems.append(f"{where}: the times must be at least two, finite and increasing")
    if not columns:
        problems.append(f"{where} has no columns beside the times; give states or outputs by name")
    known = (*module.x_names, *module.y_names)
    for name, values in columns.items():
        if name not in known:
            problems.append(f"{where}: {unknown('state or output', name, known)}")
        elif values.shape != t.shape:
            problems.append(f"{where}: {name} has shape {values.shape}, and the times have {t.shape}")
        elif not np.isfinite(values).any():
            problems.append(f"{where}: {name} has no finite value")
        elif np.isinf(values).any():
            problems.append(f"{where}: {name} contains infinite values; write NaN where nothing was measured")
    return (t, columns) if len(problems) == before else None


def _columns(data: Any, where: str, module: BoundModel, problems: list[str]) -> dict[str, Array] | None:
    """Columns by name, ``t`` among them, of a trajectory, a table of pandas or xarray, or a mapping."""
    if hasattr(data, "x_names") and hasattr(data, "t"):  # a Trajectory: only what can be measured
        return {TIME: np.asarray(data.t), **{name: np.asarray(data[name]) for name in data.x_names}}
    units: dict[str, Any] = {}
    if hasattr(data, "to_dataframe"):  # an xarray Dataset
        raw = {str(name): data[name].values for name in (*data.coords, *data.data_vars)}
        units = {str(name): data[name].attrs.get("units") for name in raw}
    elif hasattr(data, "columns") and hasattr(data, "index"):  # a pandas DataFrame
        raw = {str(name): data[name] for name in data.columns}
        raw = raw if TIME in raw else {TIME: data.index, **raw}
        units_of_data = data.attrs.get("units")
        units = dict(units_of_data) if isinstance(units_of_data, Mapping) else {}
    elif isinstance(data, Mapping):
        raw = {str(name): values for name, values in data.items()}
    else:
        problems.append(f"{where} must be a trajectory, a table or a mapping of names to values, not {quote(data)}")
        return None
    heads = {name: split_head(name) for name in raw}
    units = {heads[name][0]: unit or units.get(name) for name, (_, unit) in heads.items()}
    raw = {heads[name][0]: values for name, values in raw.items()}
    states = [name for name in module.x_names if name in raw]
    if states and getattr(data, "attrs", {}).get("model") == module.name:  # the table of a run: as of the run itself
        raw = {name: values for name, values in raw.items() if name in (TIME, *states)}
    result = {}
    for name, values in raw.items():
        try:
            result[name] = _numbers(values) * _unit_factor(units.get(name), module.layout.unit(name))
        except (TypeError, ValueError) as error:
            problems.append(f"{where}: {name} {error}")
    return result


def _numbers(values: Any) -> Array:
    """The numbers of a column, durations in seconds; ValueError if it has none."""
    array = np.asarray(values)
    if array.dtype.kind == "m":
        return np.asarray(array / np.timedelta64(1, "s"), dtype=float)
    if array.dtype.kind == "M":
        raise ValueError("holds dates; give seconds from the start of the run")
    try:
        return np.asarray(array, dtype=float)
    except (TypeError, ValueError):
        raise ValueError("is not a list of numbers") from None


def _unit_factor(raw: Any, declared: str) -> float:
    """What values in the unit that a table tells are multiplied by; 1 where it tells none."""
    if not raw or raw == declared:
        return 1.0
    try:
        from ..model.units import UnitError, read_unit
    except ModuleNotFoundError:
        raise ValueError(f"is in {raw!r}; only eomgen itself converts units, so give it in {declared!r}") from None
    try:
        unit, wanted = read_unit(str(raw)), read_unit(declared)
    except UnitError as error:
        raise ValueError(f"is in {raw!r}: {error}; {error.remedy}") from None
    if declared and unit.dimension != wanted.dimension:
        raise ValueError(f"is in {raw!r}, which cannot be turned into {declared!r}")
    return unit.size / wanted.size


def read_sigma(raw: Any, names: Sequence[str]) -> dict[str, float] | None:
    """Standard deviations of the columns, one for each; None where the fit is to find them."""
    if raw is None:
        return None
    table = dict(raw) if isinstance(raw, Mapping) else dict.fromkeys(names, raw)
    check_names("measured column", table, names)
    missing = [name for name in names if name not in table]
    if missing:
        raise incomplete(f"sigma lacks {', '.join(missing)}; give a standard deviation for every measured column")
    result = {name: float(read_numbers(f"sigma of {name}", table[name])) for name in names}
    for name, value in result.items():
        if not value > 0.0:
            raise off_range(f"sigma of {name} must be greater than 0, not {value:g}")
    return result
