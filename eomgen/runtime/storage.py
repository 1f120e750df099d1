"""Trajectory <-> a file that needs only NumPy to be read, which comes from anywhere."""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO
from zipfile import ZIP_STORED, ZipFile, ZipInfo

import numpy as np
from numpy.lib import format as npy

from ..base.algebra import Array
from ..base.files import as_name, as_path, open_plain, whole_file
from ..base.texts import visible
from ..errors import bad_file, cannot
from .argument_checks import require

if TYPE_CHECKING:
    import xarray


# -- sealed arrays -----------------------------------------------------------------------------------------------------

# A seal, the SHA-256 of all arrays with their names, types and shapes, is written beside them, so that a file whose
# arrays were renamed, cut or changed is refused as a whole.  The shape that a member claims is compared with its bytes
# before anything is made of that size.


#: Bytes that any file may unfold to, and how many for each of its own: columns of zeros shrink a lot, these do not.
SMALL, UNFOLDED = 2**28, 100
#: What reading a file that is none of ours may raise.
BROKEN = (ValueError, LookupError, TypeError, AttributeError, OSError, RuntimeError)
SEAL = "seal"  #: name of the seal among the arrays


def sealed(arrays: Mapping[str, Any], key: str = "") -> dict[str, Any]:
    """Arrays with their seal, for :func:`read_arrays` with the same key."""
    return {**arrays, SEAL: np.array(_seal(arrays, key))}


def _seal(arrays: Mapping[str, Any], key: str) -> str:
    result = hashlib.sha256(key.encode())
    for name in sorted(arrays):
        array = np.asarray(arrays[name])
        result.update(f"\n{name} {array.dtype.str} {array.shape}\n".encode("utf-8", "surrogatepass"))
        result.update(array.tobytes())
    return result.hexdigest()


def read_arrays(path: Path, compressed: bool = True, key: str = "") -> dict[str, Any]:
    """All arrays of a .npz file sealed with a key.

    Members that may not be compressed take no more memory than the file has bytes.
    """
    with open_plain(path) as file:
        try:
            result = _read(file, path.stat().st_size, compressed)
        except Exception as error:  # whatever zipfile, zlib and NumPy's parser of headers raise
            raise ValueError(str(error) or type(error).__name__) from None
    if SEAL not in result:
        raise ValueError("it has no seal, which is another format, as that of earlier versions")
    if str(result.pop(SEAL)) != _seal(result, key):
        raise ValueError("its arrays differ from those that eomgen wrote")
    return result


def _read(file: BinaryIO, header: int, compressed: bool) -> dict[str, Any]:
    with ZipFile(file) as archive:
        members = archive.infolist()
        allowed = max(SMALL, UNFOLDED * header) if compressed else header
        if sum(member.file_size for member in members) > allowed:
            raise ValueError(f"its arrays would take more than {allowed} bytes")
        names = [member.filename.removesuffix(".npy") for member in members]
        if len(set(names)) < len(names):
            raise ValueError("an array is there twice")
        return {name: _array(archive, member, compressed) for name, member in zip(names, members, strict=True)}


def _array(archive: ZipFile, member: ZipInfo, compressed: bool) -> Any:
    if member.compress_type != ZIP_STORED and not compressed:
        raise ValueError(f"{member.filename} is compressed")
    data = archive.read(member)
    stream = io.BytesIO(data)
    version = npy.read_magic(stream)
    if version != (1, 0):
        raise ValueError(f"{member.filename} has format {version}")
    shape, fortran, kind = npy.read_array_header_1_0(stream)
    if kind.kind not in "biufcU":
        raise ValueError(f"{member.filename} holds {kind} instead of numbers")
    count = 1
    for size in shape:
        count *= size
    if min(shape, default=0) < 0 or count * kind.itemsize != len(data) - stream.tell():
        raise ValueError(f"{member.filename} has {len(data)} bytes, which is not an array of shape {shape}")
    flat = np.frombuffer(data, dtype=kind, count=count, offset=stream.tell()) if count else np.empty(0, kind)
    return flat.reshape(shape, order="F" if fortran else "C").copy(order="K")


# -- files -------------------------------------------------------------------------------------------------------------


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
    """Where a table is written: an ending of ``.npz`` is added if there is none."""
    target = as_path("path", path)
    if as_name("path", path).endswith(("/", os.sep)):
        raise bad_file(f"{path} is a folder; name a file in it")
    target = target if target.suffix else target.with_suffix(".npz")
    if target.suffix not in endings:
        raise bad_file(f"{target}: {what} written as {' or '.join(endings)}, not {target.suffix!r}")
    return target


def save(trajectory: Any, path: str | Path) -> Path:
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


def dataset(trajectory: Any) -> xarray.Dataset:
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
    texts = {"model": trajectory.name, "metadata": json.dumps(metadata)}
    made: xarray.Dataset = xr.Dataset(variables, coordinates, texts)
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


def _write_for_others(trajectory: Any, target: Path) -> Path:
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
