"""The sin and cos of generated C for the graph's evaluator, so that the rest can be compared to a few units in the last
place; they themselves are judged in tests/emit/test_sincos.py."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from eomgen.operations import OPERATIONS

TEMPLATES = Path(__file__).parents[1] / "templates" / "c"
SOURCE = """
#include "eomgen_sincos.h"
double c_sin(double a) { return sine_of(a); }
double c_cos(double a) { return cosine_of(a); }
"""


@cache
def compiled() -> dict[str, Any]:
    """sin and cos as functions of Python floats."""
    with TemporaryDirectory() as folder:
        source, library = Path(folder, "circular.c"), Path(folder, "circular.so")
        source.write_text(SOURCE)
        command = ["gcc", "-O1", "-std=c99", "-ffp-contract=off", f"-I{TEMPLATES}", "-fPIC", "-shared", str(source)]
        subprocess.run([*command, "-o", str(library), "-lm"], check=True)
        loaded = ctypes.CDLL(str(library))
    found = {"sin": loaded.c_sin, "cos": loaded.c_cos}
    for function in found.values():
        function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double]
    return found


@contextmanager
def circular_functions(target: str) -> Iterator[None]:
    """The evaluator takes, on floats, the sin and cos of a target."""
    if target == "numpy":
        yield
        return
    before = {name: OPERATIONS[name] for name in ("sin", "cos")}
    try:
        OPERATIONS.update({name: before[name]._replace(value=function) for name, function in compiled().items()})
        yield
    finally:
        OPERATIONS.update(before)
