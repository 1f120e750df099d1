"""Stage ensembles: Ensemble -> an xarray Dataset whose dimensions are the runs, or their grid, and the times."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import cannot
from ..runtime.near_names import require
from ..runtime.storage import attributes, free

if TYPE_CHECKING:
    import xarray

STATISTICS = ("count", "mean", "variance", "least", "greatest")
#: Of each run, and what it is.
TOLD = {"status": "0 where the end was reached", "t_end": "how far the run came (s)", "steps": "steps that were taken"}


def dataset_of_runs(ensemble: Any) -> xarray.Dataset:
    """The Dataset of :meth:`.ensemble.Ensemble.to_xarray`."""
    xr = require("xarray", "xarray", "to_xarray")
    variables, coordinates = (_statistics if "variance" in ensemble.reduced else _runs)(ensemble)
    coordinates["t"] = ("t", ensemble.t, {"units": "s", "long_name": "time"})
    metadata = ensemble.metadata
    words = {"model": metadata["name"], "metadata": json.dumps(metadata)}
    made: xarray.Dataset = xr.Dataset(variables, coordinates, words)
    return made


def _statistics(ensemble: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Variables over statistics and times."""
    label = free("statistic", set(ensemble.names))
    variables = {
        name: (
            (label, "t"),
            np.array([ensemble.reduced[key][row] for key in STATISTICS], dtype=float),
            _words(ensemble, name),
        )
        for row, name in enumerate(ensemble.names)
    }
    return variables, {label: (label, list(STATISTICS))}


def _runs(ensemble: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Variables over the runs, and times where some were kept; coordinates of the runs."""
    if ensemble.x is None:
        kept = f"this ensemble kept only the results of its reduction ({', '.join(ensemble.reduced)})"
        raise cannot(f"{kept}; run it with reduce='states' or 'statistics'")
    varied = ensemble.varied()
    # an initial value of the grid is called as in `varied`, so that it does not hide the column of its name
    labels = {name: name if name in ensemble.parameters_and_inputs else f"initial_{name}" for name in ensemble.grid}
    run = free("run", {*ensemble.names, *varied})
    dimensions = tuple(labels.values()) or (run,)
    shape = tuple(map(len, ensemble.grid.values())) or (ensemble.count,)
    coordinates: dict[str, Any] = {
        labels[name]: (labels[name], values, _words(ensemble, name)) for name, values in ensemble.grid.items()
    } or {run: (run, np.arange(ensemble.count), {"long_name": "number of the run"})}
    for name, row in varied.items():
        words = _words(ensemble, name.removeprefix("initial_"))
        coordinates.setdefault(name, (dimensions, row.reshape(shape), words))
    variables: dict[str, Any] = {}
    for name in ensemble.names:
        values, words = np.asarray(ensemble[name]), _words(ensemble, name)
        if ensemble.samples is None:
            variables[name] = (dimensions, values.reshape(shape), words)
        else:
            variables[name] = ((*dimensions, "t"), values.T.reshape(*shape, len(ensemble.t)), words)
    for name, what in TOLD.items():
        own = free(name, {*variables, *coordinates})
        variables[own] = (dimensions, getattr(ensemble, name).reshape(shape), {"long_name": what})
    return variables, coordinates


def _words(ensemble: Any, name: str) -> dict[str, str]:
    return attributes(name, {name: ensemble.unit(name)}, ensemble.model_metadata)
