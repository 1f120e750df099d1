"""Target numpy: Program -> a module of Python functions of NumPy arrays, and its loading in this process."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ...errors import cannot
from ...expr.functions import Function, PythonFallback
from ...expr.without_gc import timed, without_gc
from ...toolchain.load import load_numpy
from ..c import closed_at
from ..c_functions import used_calls
from ..c_layout import describe_equations, work_areas
from ..files import SourceSet, render
from ..pair_sums import used_sums
from ..program import Program
from ..python_text import print_block, print_pair_sum, print_table

#: Ports of directions along which blocks are derivatives.
DIRECTIONS = ("dq", "dv", "da", "du", "dp", "directions")


def define_functions(program: Program) -> tuple[list[str], list[str]]:
    """Imports and definitions of ``call_<function>`` for the NumPy module; the loader puts :func:`fallbacks` into it.

    Raises UsageError (a native function has no Python fallback).
    """
    calls = used_calls(program)
    kinds = {type(f.require_evaluator()).__name__ for f, _ in calls.values() if f.native is None}
    imports = [f"from .expr.functions import {', '.join(sorted(kinds))}"] if kinds else []
    definitions = [print_table(f, "Curve", "Surface") for f, _ in calls.values() if f.native is None]
    sums = used_sums(program)
    if sums:
        imports.append("from .contact.pair_sums import PairSum")
        chosen = {len(kind.corners) for function, *_ in sums for kind in function.kinds} & {1, 2}
        if chosen:
            names = sorted({1: "nearest", 2: "facing"}[count] for count in chosen)
            imports.append(f"from .contact.pair_features import {', '.join(names)}")
        definitions += [print_pair_sum(program, function) for function, *_ in sums]
    return imports, definitions


def fallbacks(program: Program) -> dict[str, PythonFallback]:
    """Python fallbacks of the native functions a program calls, by the names that the NumPy module uses."""
    result = {}
    for f, _ in used_calls(program).values():
        if f.native is not None:
            fallback = f.require_evaluator()
            assert isinstance(fallback, PythonFallback)
            result[f"call_{f.name}"] = fallback
    return result


def emit_numpy(program: Program) -> SourceSet:
    """``_core.py``: the functions of a program, its table for the solvers, and the model made of both.

    Raises UsageError (a native function has no Python fallback).
    """
    imports, definitions = define_functions(program)
    text = json.dumps(program.metadata, allow_nan=False)
    context = {
        "aliases": program.aliases,
        "name": program.name,
        "metadata_lines": [repr(text[k : k + 100]) for k in range(0, len(text), 100)],
        "imports": imports,
        "definitions": definitions,
        "functions": [
            print_block(program, b) for b in (*program.blocks, program.precompute) if b.name not in program.aliases
        ],
        "blocks": [(b, sum(len(port.symbols) for port in b.ports if port.name in DIRECTIONS)) for b in program.blocks],
        "n_v": program.sizes.n_v,
        "table": _table(program),
    }
    return SourceSet({"_core.py": render("numpy/_core.py.j2", context)})


def _table(program: Program) -> dict[str, Any]:
    """What ``eomgen._native.Functions`` takes besides metadata and functions."""
    areas, n_work = work_areas(program, 0)
    sizes = {
        "n_p": len(program.parameters), "n_u": len(program.inputs),
        "n_const": len(program.parameters) + len(program.hoisted), "n_work": n_work,
        "closed_at": closed_at(program, areas),
    }  # fmt: skip
    result = describe_equations(program, areas) if program.drivers else None
    system = program.system if "system" in program.block_names else None
    equations = result and {
        "numbers": [int(number) for numbers, _ in result["numbers"] for number in numbers.split(",")],
        "tables": list(result["tables"].values()),
        "quaternions": [tuple(slot) for slot in program.quaternion_slots],
        "places": [system.places, system.relaxed] if system else [[], []],
        "areas": result["areas"],
        "functions": [name.removesuffix("_block") if name != "NULL" else None for name in result["functions"]],
    }
    kernels = [(k.name, k.n_in, k.n_out) for k in program.kernels]
    return {"name": repr(program.name), "sizes": sizes, "kernels": kernels, "equations": equations}


def load(
    program: Program, options: Mapping[str, Any], seconds: dict[str, float], functions: Mapping[str, Function]
) -> Any:
    """Emit and load."""
    if options:
        raise cannot(f"target 'numpy' has no options, and these are given: {', '.join(options)}")
    with without_gc(), timed(seconds, "emit"):
        sources = emit_numpy(program)
    with timed(seconds, "load"):
        return load_numpy(sources, program.name, fallbacks(program))
