"""A device in place of a GPU: the very text of the kernels compiled for the host, one state after the other."""

import ctypes
import re
import subprocess
from collections.abc import Callable, Sequence
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

#: What a GPU has and a host lacks: which thread this is.
HEAD = """
static long long host_state;
void choose_state(long long j);
void choose_state(long long j) { host_state = j; }
#define EOMGEN_KERNEL
#define EOMGEN_OWN host_state
"""
FLAGS = ("-std=c11", "-O0", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-fPIC", "-shared", "-x", "c")
OF_RUNS = {"EOMGEN_WANT_RUNS", "EOMGEN_WANT_DOP853", "EOMGEN_WANT_RK4"}
WANTED = re.compile(r"EOMGEN_WANT_\w+")


class HostArray:
    """Numbers "on the device"."""

    def __init__(self, array: np.ndarray) -> None:
        self.array, self.shape, self.dtype, self.nbytes = array, array.shape, array.dtype, array.nbytes

    @property
    def pointer(self) -> int:
        return int(self.array.ctypes.data)

    def numpy(self) -> np.ndarray:
        return self.array.copy()

    def reshaped(self, shape: Sequence[int]) -> "HostArray":
        return HostArray(self.array.reshape(shape))


class HostDevice:
    """What ``to_cuda`` and ``load`` of a package take as a device."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.copies = folder, 0
        self.libraries: dict[Any, Any] = {}

    def empty(self, shape: Sequence[int], dtype: Any) -> HostArray:
        return HostArray(np.full(shape, 77, dtype=dtype))  # memory that nobody has written

    def put(self, array: Any) -> HostArray:
        if isinstance(array, HostArray):
            return array
        self.copies += 1
        return HostArray(np.array(array, order="C"))

    def get(self, array: HostArray) -> np.ndarray:
        assert array.array.size == prod(array.shape)
        return array.numpy()

    def view(self, given: Any) -> HostArray | None:
        return given if isinstance(given, HostArray) else None

    def kernel(self, text: str, name: str, wanted: Sequence[str]) -> Callable[..., None]:
        assert set(wanted) <= set(WANTED.findall(text)), wanted
        every = {macro for macro in WANTED.findall(text) if macro not in OF_RUNS}
        macros = tuple(sorted(set(wanted) if "EOMGEN_WANT_RUNS" in wanted else every))  # all batches at once
        if (text, macros) not in self.libraries:
            path = self.folder / f"{len(self.libraries)}.so"
            source = path.with_suffix(".cu")
            source.write_text(HEAD + text, encoding="utf-8")
            defined = [f"-D{macro}" for macro in macros]
            subprocess.run(["gcc", *FLAGS, *defined, str(source), "-o", str(path), "-lm"], check=True)
            self.libraries[text, macros] = ctypes.CDLL(str(path))
        library = self.libraries[text, macros]

        def launch(count: int, *arguments: Any) -> None:
            values = [_as_c(a) for a in (np.int64(count), *arguments)]
            for j in range(count + 3):  # blocks of threads are whole: some have no state
                library.choose_state(ctypes.c_longlong(j))
                library[name](*values)

        return launch


def _as_c(value: Any) -> Any:
    if hasattr(value, "pointer"):
        return ctypes.c_void_p(value.pointer)
    kinds = {np.float64: ctypes.c_double, np.int64: ctypes.c_longlong, np.int32: ctypes.c_int}
    return kinds[type(value)](value.item())
