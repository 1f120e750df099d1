"""Emitted C as a shared library driven through its own table with ctypes."""

from __future__ import annotations

import ctypes
import json
import subprocess
from itertools import takewhile
from pathlib import Path

import numpy as np

STRICT = ("-std=c99", "-DEOMGEN_LANES=0", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-ffp-contract=off")
POINTER = ctypes.POINTER(ctypes.c_double)
FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double, *[POINTER] * 5)
PRECOMPUTE = ctypes.CFUNCTYPE(ctypes.c_int, POINTER, POINTER)

#: How far texts are optimized where a test asks for nothing else: the numbers are the same, and what warns at -O1 alone
#: has a test of its own; ``--thorough`` compiles all of them at -O1.
LEVEL = "-O0"

LANES = ctypes.CFUNCTYPE(ctypes.c_int, *[ctypes.c_void_p] * 6, ctypes.POINTER(ctypes.c_int))


class Lanes(ctypes.Structure):
    _fields_ = (
        ("width", ctypes.c_int),
        ("usable", ctypes.CFUNCTYPE(ctypes.c_int)),
        ("kernels", ctypes.POINTER(ctypes.c_void_p)),
    )


class Entry(ctypes.Structure):
    _fields_ = (("name", ctypes.c_char_p), ("call", FUNCTION), ("n_in", ctypes.c_int), ("n_out", ctypes.c_int))


class Table(ctypes.Structure):
    _fields_ = (
        ("abi", ctypes.c_int),
        ("name", ctypes.c_char_p),
        ("n_p", ctypes.c_int),
        ("n_u", ctypes.c_int),
        ("n_const", ctypes.c_int),
        ("n_work", ctypes.c_int),
        ("n_kernels", ctypes.c_int),
        ("kernels", ctypes.POINTER(Entry)),
        ("precompute", PRECOMPUTE),
        ("metadata", ctypes.POINTER(ctypes.c_char_p)),
        ("lanes", ctypes.POINTER(ctypes.POINTER(Lanes))),
    )


def write(sources, folder):
    for name, text in sources.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def compile_library(sources, folder, *flags):
    """Write, compile and link; returns the path of the library."""
    write(sources, folder)
    files = sorted(str(folder / name) for name in sources if name.endswith(".c"))
    library = Path(files[0]).with_suffix(".so")
    command = ["gcc", LEVEL, "-fPIC", "-shared", *STRICT, *flags, *files, "-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:4000]
    return library


class Library:
    """``library(kernel, x)`` -> (status, out)."""

    def __init__(self, path, p=None, u=()):
        self._library = ctypes.CDLL(str(path))
        self._library.eomgen_model_table.restype = ctypes.POINTER(Table)
        self.table = self._library.eomgen_model_table().contents
        self.entries = {e.name.decode(): e for e in (self.table.kernels[k] for k in range(self.table.n_kernels))}
        self.metadata = json.loads(b"".join(takewhile(bool, self.table.metadata)))
        self.u = np.array([*u, 0.0])
        self.c = np.full(self.table.n_const + 1, np.nan)
        self.w = np.full(self.table.n_work + 1, np.nan)
        if p is not None:
            self.set_parameters(p)

    def set_parameters(self, p):
        status = self.table.precompute(self._pointer(np.array([*p, 0.0])), self._pointer(self.c))
        assert status == 0

    @staticmethod
    def _pointer(array):
        return array.ctypes.data_as(POINTER)

    def __call__(self, name, x=(), t=0.0):
        entry = self.entries[name]
        assert len(x) == entry.n_in
        x, out = np.array([*x, 0.0], dtype=float), np.full(entry.n_out + 1, np.nan)
        out[-1] = 12345.0
        status = entry.call(t, *map(self._pointer, (x, self.u, self.c, out, self.w)))
        assert out[-1] == 12345.0
        return status, out[:-1]

    def fine(self, name, x=(), t=0.0):
        status, out = self(name, x, t)
        assert status == 0, f"{name} returned {status}"
        return out

    @property
    def lanes(self):
        """Usable widths -> their tables."""
        found, k = {}, 0
        while self.table.lanes and self.table.lanes[k]:
            lanes = self.table.lanes[k].contents
            if lanes.usable():
                found[lanes.width] = lanes
            k += 1
        return found

    def side_by_side(self, width, name, t, x, u, c):
        """A kernel in lanes: columns of x, u, c -> statuses (width,), out (n_out, width)."""
        index = list(self.entries).index(name)
        call = LANES(self.lanes[width].kernels[index])
        given = [aligned(np.reshape(a, (-1, width))) for a in (t, x, u, c)]
        n_out = self.entries[name].n_out
        out = aligned(np.full((n_out + 1, width), np.nan))
        out[-1] = 12345.0
        work = aligned(np.full((self.table.n_work + 1, width), np.nan))
        status = (ctypes.c_int * width)(*[77] * width)
        worst = call(*(a.ctypes.data for a in (*given, out, work)), status)
        assert (out[-1] == 12345.0).all()
        assert bool(worst) == any(status)
        return np.array(status), out[:-1]


def aligned(array):
    """A copy that begins at a multiple of 64 bytes; never empty."""
    room = np.zeros(array.size + 16)
    start = -(room.ctypes.data // 8) % 8
    view = room[start : start + array.size].reshape(array.shape)
    view[...] = array
    return view
