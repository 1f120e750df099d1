"""Target numpy: Program -> a module of Python functions of NumPy arrays, and its loading in this process."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ...alone import alone, timed
from ...compilation.load import load_numpy
from ...errors import cannot, incomplete
from ...graph.functions import Function
from ...numeric.user_functions import Curve, Surface, Twin
from ..c_functions import used_calls
from ..files import SourceSet, metadata_json, render
from ..pair_sums import used_sums
from ..program import Program
from ..python_text import print_block, print_pair_sum, print_precompute


def define_functions(program: Program, bundled: bool) -> tuple[list[str], list[str]]:
    """Imports and definitions of ``call_<function>`` for the NumPy module.

    Parameters
    ----------
    program : Program
    bundled : bool
        Whether the twins of native functions are files of the package (:func:`twin_files`); else the loader puts them
        into the module (:func:`twins`).

    Raises
    ------
    UsageError
        A native function has no Python twin, or none that can be written to a file.
    """
    calls = used_calls(program)
    kinds = {type(f.require_evaluator()).__name__ for f, _ in calls.values() if bundled or f.native is None}
    imports = [f"from .numeric.user_functions import {', '.join(sorted(kinds))}"] if kinds else []
    definitions = []
    for f, _ in calls.values():
        if f.native is None:
            definitions.append(_table_text(f))
        elif bundled:
            imports.append(f"from . import native_{f.name}")
            functions = ", ".join(f"{orders}: native_{f.name}.{name}" for orders, name in f.native.names)
            definitions.append(f"call_{f.name} = Twin({{{functions}}})")
    sums = used_sums(program)
    if sums:
        imports.append("from .numeric.pair_sums import PairSum")
        chosen = {len(kind.corners) for function, *_ in sums for kind in function.kinds}
        if 1 in chosen:
            imports.append("from .numeric.outline_pieces import nearest")
        if 2 in chosen:
            imports.append("from .numeric.polygon_edges import facing")
        definitions += [print_pair_sum(program, function) for function, *_ in sums]
    return imports, definitions


def _table_text(function: Function) -> str:
    table = function.evaluator
    head = f"call_{function.name}"
    if isinstance(table, Curve):
        rows = "".join(f"        {tuple(row)},\n" for row in table.coefficients.tolist())
        return f"{head} = Curve(\n    {table.knots.tolist()},\n    (\n{rows}    ),\n    {table.period!r},\n)"
    assert isinstance(table, Surface)
    rows = "".join(f"        {tuple(row)},\n" for row in table.nodes.reshape(-1, 4).tolist())
    lines = f"{table.x.tolist()},\n    {table.y.tolist()}"
    return f"{head} = Surface(\n    {lines},\n    (\n{rows}    ),\n    {table.slope!r},\n)"


def twins(program: Program) -> dict[str, Twin]:
    """Python twins of the native functions a program calls, by the names that the NumPy module uses."""
    found = {}
    for f, _ in used_calls(program).values():
        if f.native is not None:
            twin = f.require_evaluator()
            assert isinstance(twin, Twin)
            found[f"call_{f.name}"] = twin
    return found


def twin_files(program: Program) -> dict[str, str]:
    """Files of the twins, for a package of the ``numpy`` target.

    Raises
    ------
    UsageError
        A twin was given as a callable, which cannot be written to a file.
    """
    files = {}
    for f, _ in used_calls(program).values():
        if f.native is None:
            continue
        f.require_evaluator()
        if not f.native.twin_text:
            raise incomplete(
                f"function {f.name!r}: a package of target numpy needs this function in Python too, in a file; give "
                f"python= the path of a file that defines {', '.join(name for _, name in f.native.names)}"
            )
        files[f"native_{f.name}.py"] = f.native.twin_text
    return files


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


def load(
    program: Program, options: Mapping[str, Any], seconds: dict[str, float], functions: Mapping[str, Function]
) -> Any:
    """Emit and load."""
    if options:
        raise cannot(f"target 'numpy' has no options, and these are given: {', '.join(options)}")
    with alone(), timed(seconds, "emit"):
        sources = emit_numpy(program)
    with timed(seconds, "load"):
        return load_numpy(sources, program.name, twins(program))
