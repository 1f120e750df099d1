"""Stage runtime: an .npz file from anywhere -> its arrays, or a refusal: no pickles, bounded memory.

Every member is read whole, so that its check sum is compared; the shape it claims is compared with its bytes before
anything is made of that size.
"""

from __future__ import annotations

import io
import zlib
from pathlib import Path
from typing import Any
from zipfile import ZIP_STORED, BadZipFile, ZipFile, ZipInfo

import numpy as np
from numpy.lib import format as npy

from ..files.reading import open_plain

#: Bytes that any file may unfold to, and how many for each of its own: columns of zeros shrink a lot, these do not.
SMALL, UNFOLDED = 2**28, 100
#: What reading a file that is none of ours may raise.
BROKEN = (
    BadZipFile, zlib.error, ValueError, KeyError, TypeError, AttributeError, OSError, EOFError, RuntimeError,
    MemoryError, OverflowError,
)  # fmt: skip


def read_arrays(path: Path, compressed: bool = True) -> dict[str, Any]:
    """All arrays of an .npz file.

    Parameters
    ----------
    path : Path
    compressed : bool
        Whether its members may be; without, they take no more memory than the file has bytes.

    Raises
    ------
    FileNotFoundError
    UsageError
        It is not a plain file.
    ValueError and others of :data:`BROKEN`
        It is damaged, or holds what is no array of numbers or of text.
    """
    with open_plain(path) as file, ZipFile(file) as archive:
        members = archive.infolist()
        own = path.stat().st_size
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
