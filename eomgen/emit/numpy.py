"""Stage emit: Program -> ``_core.py``, a module of NumPy functions, and ``model.json``."""

from __future__ import annotations

import json

from ..program import Program
from .numpy_text import print_block, print_precompute
from .sources import SourceSet, metadata_json, render


def emit_numpy(program: Program) -> SourceSet:
    """The NumPy sources of a program.

    Returns
    -------
    SourceSet
        ``_core.py``, which imports NumPy and ``.runtime.numpy_core`` only, and ``model.json``.
    """
    text = json.dumps(program.metadata, allow_nan=False)
    twins = program.twins
    context = {
        "n_q": program.sizes.n_q,
        "n_v": program.sizes.n_v,
        "composes_terms": program.composes_terms,
        "twins": twins,
        "name": program.name,
        "metadata_lines": [repr(text[k : k + 100]) for k in range(0, len(text), 100)],
        "functions": [
            *(print_block(program, b) for b in program.blocks if b.name not in twins),
            print_precompute(program),
        ],
        "blocks": [block.name for block in program.blocks],
    }
    return SourceSet({"_core.py": render("numpy/_core.py.j2", context), "model.json": metadata_json(program)})
