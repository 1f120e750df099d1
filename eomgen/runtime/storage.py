"""Stage runtime: Trajectory <-> a file that needs only NumPy to be read; files and Datasets for other programs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.files import as_path, whole_file
from ..base.texts import visible
from ..errors import bad_file, cannot
from .arrays import sealed
from .near_names import require

if TYPE_CHECKING:
    import xarray

    from .protocols import TrajectoryLike

TABLES = (".npz", ".csv")
RUNS = (".npz", ".csv", ".nc", ".parquet")  #: endings of files of a run
FORMAT = "eomgen trajectory 2"


class Stored:
    """Columns read from a file."""

    def __init__(self, names: tuple[str, ...], values: Array, energies: Array | None = None) -> None:
        self.names = names
        self._energies = energies
        self._rows = dict(zip(names, values, strict=True))

    def __getitem__(self, name: str) -> Array:
        return np.asarray(self._rows[name])

    @property
    def has_energies(self) -> bool:
        """Whether the model knows its energy."""
        return self._energies is not None or {"T", "V", "energy"} <= self._rows.keys()

    @property
    def energies(self) -> Array:
        """Kinetic, potential and total energy (3, n_t)."""
        if not self.has_energies:
            raise cannot("the model of this trajectory has no energy: it has no kinetic_energy")
        if self._energies is None:  # a file of an earlier version
            return np.array([self["T"], self["V"], self["energy"]])
        return self._energies


def table_path(path: str | Path, what: str, endings: tuple[str, ...] = TABLES) -> Path:
    """Where a table is written: an ending of ``.npz`` is added if there is none.

    Raises
    ------
    UsageError
        Another ending than those allowed.
    """
    target = as_path("path", path)
    target = target if target.suffix else target.with_suffix(".npz")
    if target.suffix not in endings:
        raise bad_file(f"{target}: {what} written as {' or '.join(endings)}, not {target.suffix!r}")
    return target


def save(trajectory: TrajectoryLike, path: str | Path) -> Path:
    """Write a trajectory; see :meth:`.trajectory.Trajectory.save`."""
    target = table_path(path, "a trajectory is", RUNS)
    if target.suffix in (".nc", ".parquet"):
        return _write_for_others(trajectory, target)
    names = trajectory.names
    values = trajectory.to_numpy()
    if target.suffix == ".csv":
        table = np.vstack([trajectory.t, values]).T
        with whole_file(target) as file:
            np.savetxt(
                file, table, fmt="%.17g", delimiter=",", header=",".join(("t", *names)), comments="", encoding="utf-8"
            )
        return target
    header = {"format": FORMAT, "names": list(names), **trajectory.metadata}
    arrays: dict[str, Any] = {
        "t": trajectory.t,
        "x": trajectory.x,
        "columns": values,
        "header": np.array(json.dumps(header)),
    }
    if trajectory.has_energies:
        arrays["energies"] = trajectory.energies
    for k, (t, x) in enumerate(zip(trajectory.t_events, trajectory.x_events, strict=True)):
        arrays[f"t_events_{k}"], arrays[f"x_events_{k}"] = t, x
    with whole_file(target) as file:
        np.savez_compressed(file, **sealed(arrays))
    return target


def split_head(head: str) -> tuple[str, str]:
    """Name and unit of the head of a column, ``theta`` or ``theta [rad]``; tables of other programs have units."""
    name, bracket, unit = head.strip().partition(" [")
    return (name.strip(), unit[:-1].strip()) if bracket and unit.endswith("]") else (head.strip(), "")


def dataset(trajectory: TrajectoryLike) -> xarray.Dataset:
    """The columns of a trajectory over the dimension ``t``; see :meth:`.trajectory.Trajectory.to_xarray`."""
    xr = require("xarray", "xarray", "to_xarray")
    metadata = trajectory.metadata
    variables: dict[str, Any] = {
        name: ("t", np.asarray(trajectory[name]), attributes(name, trajectory.units, metadata))
        for name in trajectory.names
    }
    coordinates: dict[str, Any] = {"t": ("t", trajectory.t, {"units": "s", "long_name": "time"})}
    named = zip(metadata.get("event_names") or (), trajectory.t_events, trajectory.x_events, strict=False)
    for name, t, x in named:
        times, states = (free(f"{part}_events_{name}", variables) for part in "tx")
        state, each = free("state", trajectory.names), free(f"event_{name}", trajectory.names)
        variables[times] = (each, t, {"units": "s", "long_name": f"times of {name}"})
        of = np.reshape(x, (len(metadata["x_names"]), -1))
        variables[states] = ((state, each), of, {"long_name": f"states at {name}"})
        coordinates[state] = (state, np.array(metadata["x_names"], dtype=object))
    words = {"model": trajectory.name, "metadata": json.dumps(metadata)}
    made: xarray.Dataset = xr.Dataset(variables, coordinates, words)
    return made


def attributes(name: str, units: Mapping[str, str], metadata: Mapping[str, Any]) -> dict[str, str]:
    """Unit and meaning of a column, as the CF conventions for climate and forecast data call them."""
    doc = visible(metadata.get("docs", {}).get(name, ""))  # HDF5 takes no NUL
    return {"units": units.get(name, ""), **({"long_name": doc} if doc else {})}


def free(name: str, taken: Iterable[str]) -> str:
    """The name, with underscores after it until nothing else has it."""
    while name in taken:
        name += "_"
    return name


def _write_for_others(trajectory: TrajectoryLike, target: Path) -> Path:
    """Write a trajectory as netCDF (``.nc``) by xarray, or as Parquet by pandas."""
    if target.suffix == ".nc":
        return write_netcdf(dataset(trajectory), target)
    require("pyarrow", "pyarrow", "a .parquet file")
    frame: Any = trajectory.to_pandas()
    frame.attrs["metadata"] = json.dumps(trajectory.metadata)
    with whole_file(target) as file:
        frame.to_parquet(file)
    return target


def write_netcdf(made: xarray.Dataset, target: Path) -> Path:
    """Write a Dataset to a file that is there whole, or not at all."""
    require("h5netcdf", "h5netcdf h5py", "a .nc file")
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder, whole_file(target) as file:
        part = Path(folder, "part.nc")
        made.to_netcdf(part, engine="h5netcdf")
        file.write(part.read_bytes())
    return target
