"""The texts of ``eomgen._native``: kernels, steppers, ensembles and contacts, the same for all models."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache

from ..base.files import shipped
from ..base.operations import tape_rows
from ..native.limits import definitions

#: Headers of the solvers, which models include whose functions are not all straight-line code.
SOLVER_HEADERS = ("eomgen_solvers.h", "eomgen_straight.h")
SOLVER = "eomgen_solvers.c"
PAIRS_HEADER = "eomgen_pairs.h"  #: included by models with contacts between groups alone

#: The layer's files, the first translated by Cython, and what each is put together from, in order: a part may use what
#: stands in those before it.
LAYER = {
    "_native.pyx": ("_native.pyx",),
    "eomgen_steppers.h": ("steppers/eomgen_steppers.h",),
    "eomgen_methods.h": ("steppers/runge_kutta.c", "steppers/taylor.c"),
    "eomgen_steppers.c": tuple(f"steppers/{name}.c" for name in ("control", "lu", "radau", "loop")),
    SOLVER: ("linear_algebra.c", "projection.c", "embedding.c", "right_hand_side.c", "jacobian.c"),
    "eomgen_contacts.h": ("contacts/eomgen_contacts.h",),
    "eomgen_contact_steps.h": ("steppers/lu.c", "contacts/impulses.c", "contacts/step.c"),
    "eomgen_contacts.c": ("contacts/contacts.c",),
    "eomgen_ensembles.h": ("ensembles/eomgen_ensembles.h",),
    "eomgen_ensembles.c": ("ensembles/ensembles.c",),
    "eomgen_lane_runs.h": ("ensembles/lanes.c",),
}
#: Texts that are compiled again for other processors, or for other numbers of lanes: macro and included file.
AGAIN = {
    "eomgen_wide_contacts.c": ("EOMGEN_WIDE", "eomgen_contacts.c"),
    "eomgen_wide_steps.c": ("EOMGEN_WIDE", "eomgen_methods.h"),
    **{f"eomgen_runs{width}.c": (f"LANES {width}", "eomgen_lane_runs.h") for width in (2, 4, 8)},
}

#: Headers that models and the layer share.
HEADERS = ("eomgen.h", "eomgen_real.h", "eomgen_calls.h", *SOLVER_HEADERS)


@cache
def read_layer() -> dict[str, str]:
    """The texts of the layer by file name."""
    texts = {name: "\n".join(map(_read, parts)) for name, parts in LAYER.items()}
    texts["_native.pyx"] = re.sub(r'include "(\w+\.pxi)"\n', lambda part: _read(part[1]), texts["_native.pyx"])
    texts["eomgen_steppers.c"] = tape_rows() + texts["eomgen_steppers.c"]
    texts |= {name: f'#define {macro}\n#include "{text}"\n' for name, (macro, text) in AGAIN.items()}
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
