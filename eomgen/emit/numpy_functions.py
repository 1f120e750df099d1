"""Stage emit: the functions a program calls -> Python text that makes them; twin files."""

from __future__ import annotations

from ..errors import incomplete
from ..graph.functions import Function
from ..numeric.user_functions import Curve, Surface, Twin
from ..program import Program
from .c_functions import used_calls
from .numpy_text import print_pair_sum
from .pair_sums_used import used_sums


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
