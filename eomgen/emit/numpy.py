"""Stage emit: Program -> ``_core.py``, a module of NumPy functions, and ``model.json``."""

from __future__ import annotations

import json

from ..program import Program
from .numpy_functions import define_functions, twin_files
from .numpy_text import print_block, print_precompute
from .sources import SourceSet, metadata_json, render


def emit_numpy(program: Program, bundled: bool = False) -> SourceSet:
    """The NumPy sources of a program.

    Parameters
    ----------
    program : Program
    bundled : bool, optional
        Whether the Python twins of native functions come as files; else the loader puts them into the module.

    Returns
    -------
    SourceSet
        ``_core.py``, which imports NumPy, ``.runtime.numpy_core`` and ``.numeric.user_functions`` only; ``model.json``;
        if bundled, ``native_f.py`` for a native function ``f``.

    Raises
    ------
    UsageError
        A native function has no Python twin.
    """
    imports, definitions = define_functions(program, bundled)
    files = twin_files(program) if bundled else {}
    text = json.dumps(program.metadata, allow_nan=False)
    twins = program.twins
    context = {
        "n_q": program.sizes.n_q,
        "n_v": program.sizes.n_v,
        "composes_terms": program.composes_terms,
        "twins": twins,
        "name": program.name,
        "metadata_lines": [repr(text[k : k + 100]) for k in range(0, len(text), 100)],
        "imports": imports,
        "definitions": definitions,
        "functions": [
            *(print_block(program, b) for b in program.blocks if b.name not in twins),
            print_precompute(program),
        ],
        "blocks": [block.name for block in program.blocks],
    }
    core = render("numpy/_core.py.j2", context)
    return SourceSet({"_core.py": core, **files, "model.json": metadata_json(program)})
