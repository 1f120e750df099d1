"""A device in place of a GPU: the very text of the kernels compiled for the host, one state after the other."""

from __future__ import annotations

import ctypes
import re
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eomgen.compilation import find_compiler
from eomgen.device.arrays_on_device import DeviceArray
from eomgen.emit.cuda.device_text import METHODS

#: What a GPU has and a host lacks: which thread this is.
HEAD = """
static long long host_state;
void choose_state(long long j);
void choose_state(long long j) { host_state = j; }
#define EOMGEN_KERNEL
#define EOMGEN_OWN host_state
"""
FLAGS = ("-std=c11", "-O0", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-fPIC", "-shared", "-x", "c")
OF_RUNS = {f"EOMGEN_WANT_{name.upper()}" for name in ("runs", *METHODS)}
WANTED = re.compile(r"EOMGEN_WANT_\w+")


class OnHost:
    """An array of another library: it says where it lies, as those on a GPU do."""

    def __init__(self, array: np.ndarray) -> None:
        self.array = array


class HostDevice:
    """See :class:`eomgen.device.arrays_on_device.Device`."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.libraries, self.copies = folder, {}, 0

    def empty(self, shape: Sequence[int], dtype: Any) -> DeviceArray:
        array = np.full(shape, 77, dtype=dtype)  # memory that nobody has written
        return DeviceArray(self, array.ctypes.data, shape, dtype, array)

    def put(self, array: np.ndarray) -> DeviceArray:
        self.copies += 1
        copy = np.array(array, order="C")
        return DeviceArray(self, copy.ctypes.data, copy.shape, copy.dtype, copy)

    def foreign(self, array: np.ndarray) -> OnHost:
        """An array as another library would hold it on the device."""
        return OnHost(array)

    def get(self, array: DeviceArray) -> np.ndarray:
        length = max(array.nbytes, 1)
        memory = (ctypes.c_char * length).from_address(array.pointer)
        return np.frombuffer(bytes(memory)[: array.nbytes], array.dtype).reshape(array.shape).copy()

    def view(self, given: Any) -> DeviceArray | None:
        if isinstance(given, DeviceArray):
            return given
        if isinstance(given, OnHost):
            return DeviceArray(self, given.array.ctypes.data, given.array.shape, given.array.dtype, given)
        return None

    def kernel(self, text: str, name: str, wanted: Sequence[str]) -> Callable[..., None]:
        assert set(wanted) <= set(WANTED.findall(text)), wanted
        every = {macro for macro in WANTED.findall(text) if macro not in OF_RUNS}
        macros = tuple(sorted(set(wanted) if "EOMGEN_WANT_RUNS" in wanted else every))  # all batches at once
        if (text, macros) not in self.libraries:
            path = self.folder / f"{len(self.libraries)}.so"
            source = path.with_suffix(".cu")
            source.write_text(HEAD + text, encoding="utf-8")
            defined = [f"-D{macro}" for macro in macros]
            command = [*find_compiler().command, *FLAGS, *defined, str(source), "-o", str(path), "-lm"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr
            self.libraries[text, macros] = ctypes.CDLL(str(path))
        library = self.libraries[text, macros]

        def launch(count: int, *arguments: Any) -> None:
            values = [_as_c(a) for a in (np.int64(count), *arguments)]
            for j in range(count + 3):  # blocks of threads are whole: some have no state
                library.choose_state(ctypes.c_longlong(j))
                library[name](*values)

        return launch


def _as_c(value: Any) -> Any:
    if isinstance(value, DeviceArray):
        return ctypes.c_void_p(value.pointer)
    kinds = {np.float64: ctypes.c_double, np.int64: ctypes.c_longlong, np.int32: ctypes.c_int}
    return kinds[type(value)](value.item())
