"""The texts of ``eomgen._native``: kernels, steppers, ensembles and contacts, the same for all models."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache

from ..base.files import shipped
from ..base.operations import tape_rows
from ..native.limits import definitions

#: Parts of the steppers' source, in order: a part may use what stands in those before it.
STEPPERS = (
    *("control", "plain", "rk4", "lu", "lu_complex", "newton", "radau"),
    *("taylor_terms", "taylor", "events", "loop"),
)

#: Headers of the solvers, which models include whose functions are not all straight-line code.
SOLVER_HEADERS = ("eomgen_solvers.h", "eomgen_straight.h")
SOLVER = "eomgen_solvers.c"
#: Parts of that source, in order.
SOLVERS = ("linear_algebra", "projection", "embedding", "systems", "singular", "trees", "jacobian")

#: The layer's files, the first translated by Cython, and the templates each is put together from.
LAYER = {
    "_native.pyx": ("_native.pyx",),
    "eomgen_steppers.h": ("steppers/eomgen_steppers.h",),
    "eomgen_loop.h": ("steppers/eomgen_loop.h",),
    "eomgen_methods.h": ("steppers/dop853.c", "steppers/rk45.c"),
    "eomgen_steppers.c": tuple(f"steppers/{name}.c" for name in STEPPERS),
    SOLVER: tuple(f"{name}.c" for name in SOLVERS),
    "eomgen_contacts.h": ("contacts/eomgen_contacts.h",),
    "eomgen_contact_steps.h": (
        *("contacts/maps.c", "steppers/lu.c"),
        *("contacts/impulses.c", "contacts/collide.c", "contacts/step.c"),
    ),
    "eomgen_contacts.c": ("contacts/plain.c",),
    "eomgen_wide_contacts.c": ("contacts/wide.c",),
    "eomgen_wide_steps.c": ("steppers/wide.c",),
    "eomgen_ensembles.h": ("ensembles/eomgen_ensembles.h",),
    "eomgen_ensembles.c": ("ensembles/ensembles.c",),
    "eomgen_lane_runs.h": ("ensembles/lane_steps.c", "steppers/taylor_terms.c", "ensembles/lane_runs.c"),
    **{f"eomgen_runs{width}.c": ("ensembles/lanes.c",) for width in (2, 4, 8)},
}

#: Headers that models and the layer share.
HEADERS = ("eomgen.h", "eomgen_real.h", "eomgen_calls.h", *SOLVER_HEADERS)


@cache
def read_layer() -> dict[str, str]:
    """The texts of the layer by file name."""
    texts = {name: "\n".join(map(_read, parts)) for name, parts in LAYER.items()}
    texts["_native.pyx"] = re.sub(r'include "(\w+\.pxi)"\n', lambda part: _read(part[1]), texts["_native.pyx"])
    texts["eomgen_steppers.c"] = tape_rows() + texts["eomgen_steppers.c"]
    for width in (2, 4, 8):
        texts[f"eomgen_runs{width}.c"] = f"#define LANES {width}\n" + texts[f"eomgen_runs{width}.c"]
    return {name: definitions(text) + text if name.endswith((".c", ".h")) else text for name, text in texts.items()}


def read_sources(parts: Sequence[str]) -> str:
    """The text of some parts of the layer's C source, as ``steppers/loop``, with the limits that it names."""
    text = "\n".join(_read(f"{part}.c") for part in parts)
    return definitions(text) + text


@cache
def read_native() -> dict[str, str]:
    """All texts that ``eomgen._native`` is compiled from by file name."""
    return {**read_layer(), **{header: read_header(header) for header in HEADERS}}


def read_header(name: str) -> str:
    """The text of a header that models and the layer share, as it comes with eomgen."""
    text = _read(name)
    return definitions(text) + text


def _read(part: str) -> str:
    return (shipped("native") / part).read_text(encoding="utf-8")
