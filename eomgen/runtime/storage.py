"""Stage runtime: Trajectory <-> a file that needs only NumPy to be read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from ..files.path_names import as_path
from ..files.writing import whole_file
from ..numeric.scales import Array

if TYPE_CHECKING:
    from .protocols import TrajectoryLike

FORMAT = "eomgen trajectory 1"


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
            raise UsageError("the model of this trajectory has no energy: it has no kinetic_energy")
        if self._energies is None:  # a file of an earlier version
            return np.array([self["T"], self["V"], self["energy"]])
        return self._energies


def table_path(path: str | Path, what: str) -> Path:
    """Where a table is written: an ending of ``.npz`` is added if there is none.

    Raises
    ------
    UsageError
        Another ending than ``.npz`` or ``.csv``.
    """
    target = as_path("path", path)
    target = target if target.suffix else target.with_suffix(".npz")
    if target.suffix not in (".npz", ".csv"):
        raise UsageError(f"{target}: {what} written as .npz or .csv, not {target.suffix!r}")
    return target


def save(trajectory: TrajectoryLike, path: str | Path) -> Path:
    """Write a trajectory; see :meth:`.trajectory.Trajectory.save`."""
    target = table_path(path, "a trajectory is")
    names = trajectory.names
    values = trajectory.to_numpy()
    if target.suffix == ".csv":
        heads = [_head(trajectory, name) for name in ("t", *names)]
        table = np.vstack([trajectory.t, values]).T
        with whole_file(target) as file:
            np.savetxt(file, table, fmt="%.17g", delimiter=",", header=",".join(heads), comments="", encoding="utf-8")
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
        np.savez_compressed(file, **arrays)
    return target


def _head(trajectory: TrajectoryLike, name: str) -> str:
    unit = trajectory.units.get(name, "")
    return f"{name} [{unit}]" if unit else name
