"""Stage runtime: arrays <-> an .npz file, which comes from anywhere: no pickles, bounded memory, nothing changed since.

A seal, the SHA-256 of all arrays with their names, types and shapes, is written beside them, so that a file whose
arrays were renamed, cut or changed is refused as a whole.  The shape that a member claims is compared with its bytes
before anything is made of that size.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO
from zipfile import ZIP_STORED, ZipFile, ZipInfo

import numpy as np
from numpy.lib import format as npy

from ..base.files import open_plain

#: Bytes that any file may unfold to, and how many for each of its own: columns of zeros shrink a lot, these do not.
SMALL, UNFOLDED = 2**28, 100
#: What reading a file that is none of ours may raise.
BROKEN = (ValueError, LookupError, TypeError, AttributeError, OSError, RuntimeError)
SEAL = "seal"  #: name of the seal among the arrays


def sealed(arrays: Mapping[str, Any], key: str = "") -> dict[str, Any]:
    """Arrays with their seal, for :func:`read_arrays` with the same key."""
    return {**arrays, SEAL: np.array(_seal(arrays, key))}


def _seal(arrays: Mapping[str, Any], key: str) -> str:
    found = hashlib.sha256(key.encode())
    for name in sorted(arrays):
        array = np.asarray(arrays[name])
        found.update(f"\n{name} {array.dtype.str} {array.shape}\n".encode("utf-8", "surrogatepass"))
        found.update(array.tobytes())
    return found.hexdigest()


def read_arrays(path: Path, compressed: bool = True, key: str = "") -> dict[str, Any]:
    """All arrays of a sealed .npz file.

    Parameters
    ----------
    path : Path
    compressed : bool
        Whether its members may be; without, they take no more memory than the file has bytes.
    key : str
        What it was sealed with.

    Raises
    ------
    FileNotFoundError
    UsageError
        It is not a plain file.
    ValueError
        It is damaged, or is none of ours.
    """
    with open_plain(path) as file:
        try:
            found = _read(file, path.stat().st_size, compressed)
        except Exception as error:  # whatever zipfile, zlib and NumPy's parser of headers raise
            raise ValueError(str(error) or type(error).__name__) from None
    if SEAL not in found:
        raise ValueError("it has no seal, which is another format, as that of earlier versions")
    if str(found.pop(SEAL)) != _seal(found, key):
        raise ValueError("its arrays are not those that eomgen sealed it with")
    return found


def _read(file: BinaryIO, own: int, compressed: bool) -> dict[str, Any]:
    with ZipFile(file) as archive:
        members = archive.infolist()
        allowed = max(SMALL, UNFOLDED * own) if compressed else own
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
