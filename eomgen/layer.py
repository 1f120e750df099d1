"""The Cython layer: what every compiled module has besides its model's own sources, the same text for all."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path

#: Parts of the steppers' source, in order: a part may use what stands in those before it.
STEPPERS = (
    "control",
    "signals",
    "tape",
    "dop853",
    "rk45",
    "rk23",
    "rk4_step",
    "rk4",
    "event_values",
    "event_zero",
    "crossings",
    "loop",
)

#: The layer's files, the first translated by Cython, and the templates each is put together from.
LAYER = {
    "_core.pyx": ("cython/_core.pyx",),
    "_batches.pxi": ("cython/_batches.pxi",),
    "_steppers.pxi": ("cython/_steppers.pxi",),
    "_journeys.pxi": ("cython/_journeys.pxi",),
    "eomgen_steppers.h": ("c/steppers/eomgen_steppers.h",),
    "eomgen_loop.h": ("c/steppers/eomgen_loop.h",),
    "eomgen_steppers.c": tuple(f"c/steppers/{name}.c" for name in STEPPERS),
}


@cache
def read_layer() -> dict[str, str]:
    """The texts of the layer by file name."""
    root = Path(import_module("eomgen.templates").__path__[0])
    return {
        name: "\n".join((root / part).read_text(encoding="utf-8") for part in parts) for name, parts in LAYER.items()
    }
