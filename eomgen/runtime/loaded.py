"""A file that Trajectory.save wrote -> Trajectory."""

from __future__ import annotations

import json
from pathlib import Path

from ..base.files import as_path
from ..errors import bad_data
from .storage import BROKEN, FORMAT, RUNS, Stored, read_arrays
from .trajectory import Trajectory


def load_trajectory(path: str | Path) -> Trajectory:
    """Read a trajectory that :meth:`Trajectory.save` wrote to an .npz file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Trajectory
        With all columns and ``metadata``; without dense output.

    Raises
    ------
    UsageError
        The file is not a trajectory saved by eomgen.
    FileNotFoundError
    """
    source = as_path("path", path)
    if not source.suffix and not source.exists():
        source = source.with_suffix(".npz")
    try:
        arrays = read_arrays(source)
        header = json.loads(str(arrays["header"]))
        if header.pop("format") != FORMAT:
            raise ValueError("another format")
        names, x, t = tuple(header.pop("names")), arrays["x"], arrays["t"]
        count = sum(name.startswith("t_events_") for name in arrays)
        t_events, x_events = ([arrays[f"{part}_events_{k}"] for k in range(count)] for part in "tx")
        columns = Stored(names, arrays["columns"], arrays.get("energies"))
    except FileNotFoundError:
        raise
    except BROKEN as error:
        told = f"a {source.suffix} is for other programs; load the .npz of the run"
        told = told if source.suffix in RUNS[1:] else str(error)
        raise bad_data(f"{source} is not a trajectory saved by eomgen: {told}") from None
    return Trajectory(t, x, columns, header, t_events, x_events)
