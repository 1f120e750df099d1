"""C functions f(t, x, u, c, out, w) of eomgen and of others behind one loop in C, which times them."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from eomgen.runtime.kernels import eager
from eomgen.toolchain.compiler import Options, compile_flags, find_compiler

from .harness import ROOT

HERE = Path(__file__).parent
#: Puts CasADi's ``f(x, u)`` behind the interface; its work array has room for all.
CASADI = """
static double casadi_work[1000000];
int kernel(double t, const double *x, const double *u, const double *c, double *out, double *w)
{
    const double *arguments[4] = {x, u};
    double *results[2] = {out};
    (void)t, (void)c, (void)w;
    return f(arguments, results, 0, casadi_work, 0);
}
"""


def our_flags(**options: Any) -> list[str]:
    """Flags of compiled models; never fast-math."""
    return compile_flags(Options(**options), find_compiler(), 0)


def compile_text(text: str, flags: Sequence[str] | None = None, link: Sequence[str] = ()) -> ctypes.CDLL:
    """A loaded library of a C text, by default with the flags of compiled models."""
    with TemporaryDirectory() as folder:
        source, product = Path(folder, "text.c"), Path(folder, "text.so")
        source.write_text(text, encoding="utf-8")
        command = [*find_compiler().command, *(our_flags() if flags is None else flags), "-shared", "-fPIC"]
        command += [f"-I{ROOT / 'eomgen' / 'native'}", str(source), *link, "-lm", "-o", str(product)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr[-2000:]}")
        return ctypes.CDLL(str(product))


@cache
def loops() -> ctypes.CDLL:
    """The loops, and the closed form of the slider-crank."""
    library = compile_text((HERE / "loops.c").read_text(encoding="utf-8"))
    library.time_kernel.restype = library.time_lanes.restype = ctypes.c_double
    return library


def addresses(*arrays: np.ndarray) -> list[ctypes.c_void_p]:
    """Of the first number of each."""
    return [ctypes.c_void_p(array.ctypes.data) for array in arrays]


class Kernel:
    """A C function and its arrays; x has a row for each call, going round, or is one row.

    Called with a number of calls it gives the seconds of one; those that are not ``tied`` may overlap, as in Python.
    """

    def __init__(self, function: Any, x: Any, n_out: int, u: Any = (), c: Any = (), n_work: int = 0) -> None:
        rows = np.atleast_2d(np.array(x, dtype=float, order="C"))
        self.out, self.loop = np.zeros(n_out), loops().time_kernel
        extra = [np.array([*values, 0.0], dtype=float) for values in (u, c)]
        self.arrays = (rows, *extra, self.out, np.zeros(n_work + 1))
        self.rows, self.tied = rows.shape, True
        self.function = function  # keeps its library
        self.address = ctypes.cast(function, ctypes.c_void_p)

    def __call__(self, calls: int) -> float:
        sizes = [ctypes.c_long(n) for n in (calls, *self.rows, len(self.out) * self.tied)]
        return float(self.loop(self.address, *sizes, *addresses(*self.arrays)))

    def result(self) -> np.ndarray:
        """What one call gives; of the first row."""
        self(1)
        return self.out


def of_module(module: Any, name: str, x: Any, u: Any = None) -> Kernel:
    """A kernel of a compiled module, at its parameters."""
    core, context = eager(module.core), module.kernels.context
    inputs = context.u if u is None else u
    size = int(np.prod(module.layout.shape(name)))
    return Kernel(core.address(name), x, size, inputs, context.c, core.sizes["n_work"])


def of_casadi(source: str, x: Any, n_out: int, u: Any = (), flags: Sequence[str] | None = None) -> Kernel:
    """CasADi's C text of ``f(x, u)``; what it writes beyond the n_out results that count is lost."""
    library = compile_text(source + CASADI, flags)
    return Kernel(library.kernel, x, n_out, u)


def lanes_of(module: Any, x: np.ndarray, u: np.ndarray) -> tuple[Any, np.ndarray] | None:
    """Seconds of a state of the right-hand side in a module's lanes, and x' of the last; None without lanes."""
    core, context, loop = eager(module.core), module.kernels.context, loops().time_lanes
    table = ctypes.CDLL(core.__file__).eomgen_model_table
    table.restype = ctypes.c_void_p
    width, n = core.lane_width, len(x)
    room = np.zeros(8 + width * (1 + len(u) + len(context.c) + 2 * n + core.sizes["n_work"]))
    room = room[-(room.ctypes.data // 8) % 8 :]  # begins at a multiple of 64 bytes
    out, arrays = np.zeros(n), (np.array(x), np.array([*u, 0.0]), np.array([*context.c, 0.0]))

    def call(calls: int) -> float:
        given = addresses(*arrays, out, room)
        return float(loop(ctypes.c_void_p(table()), ctypes.c_long(calls), n, *given))

    return None if call(1) < 0.0 else (call, out)
