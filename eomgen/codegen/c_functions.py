"""The functions a program calls -> C files of their own: tables as constants, native sources as they are.

The arithmetic is that of :mod:`eomgen.expr.functions`.  Everything is re-entrant: tables are constant.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import numpy as np

from ..contact.pairs import pair_call
from ..errors import incomplete
from ..expr.functions import Curve, Function, Orders, Surface, base_orders, difference_step, first_excess, lowered
from .files import render
from .program import Program

Calls = dict[str, tuple[Function, list[Orders]]]  # by name of the function, its derivatives in use


def used_calls(program: Program) -> Calls:
    """The functions that a program calls, with the orders of derivatives that it needs, by name."""
    graph, operations = program.graph, program.called
    result: Calls = {}
    pairs = {call.function.name: call.function for op in operations if (call := pair_call(graph, op)) is not None}
    called = [graph.calls[op] for op in operations if pair_call(graph, op) is None]
    inner = {op: call for f in pairs.values() for kind in f.kinds for op, call in kind.calls}
    called += [call for op, call in inner.items() if op not in operations]
    for function, orders in sorted(called, key=lambda call: (call[0].name, call[1])):
        result.setdefault(function.name, (function, []))[1].append(orders)
    return result


def c_name(program: str, function: str, orders: Sequence[int]) -> str:
    """Name of the C function behind one call."""
    return f"{program}_call_{function}_{'_'.join(map(str, orders))}"


def each_name(function: str, orders: Sequence[int]) -> str:
    """Name of the function that blocks call: the C function of one call, in every lane."""
    return f"each_{function}_{'_'.join(map(str, orders))}"


def each_definition(name: str, arguments: Sequence[str], called: str) -> str:
    """The function of this name that calls one of doubles in every lane."""
    lanes = ", ".join(f"EOMGEN_LANE({x}, k)" for x in arguments)
    return (
        f"EOMGEN_SHARED inline real {name}({', '.join(f'real {x}' for x in arguments)})\n{{\n    real y = same(0.0);\n"
        f"    for (int k = 0; k < EOMGEN_WIDTH; k++) {{ EOMGEN_LANE(y, k) = {called}({lanes}); }}\n    return y;\n}}\n"
    )


def _each(program: str, function: Function, orders: Sequence[int]) -> str:
    arguments = [f"x{k}" for k in range(function.arity)]
    return each_definition(each_name(function.name, orders), arguments, c_name(program, function.name, orders))


def _head(name: str, arity: int) -> str:
    return f"double {name}({', '.join(f'double x{k}' for k in range(arity))})"


def declarations(program: Program, calls: Calls) -> list[str]:
    """Declarations of all calls, for the files that make them; none if there are no calls."""
    lines = [
        f"EOMGEN_PIECE {_head(c_name(program.name, f.name, orders), f.arity)};\n{_each(program.name, f, orders)}"
        for f, used in calls.values()
        for orders in used
    ]
    return ["".join(lines)] if lines else []


def plain_declarations(program: str, called: Iterable[tuple[Function, Orders]]) -> list[str]:
    """Declarations of calls for a file that computes with doubles alone, by the names that blocks have for them."""
    result = []
    for f, orders in called:
        name, each = c_name(program, f.name, orders), each_name(f.name, orders)
        result.append(f"EOMGEN_PIECE {_head(name, f.arity)};\n#define {each} {name}")
    return result


def function_files(program: Program, calls: Calls) -> dict[str, str]:
    """The C files of the functions: one for all tables, one for each source of native functions."""
    files = {}
    tables = [_table(program.name, f, used) for f, used in calls.values() if f.native is None]
    if tables:
        files[f"{program.name}_tables.c"] = render("c/tables.c.j2", {"name": program.name, "tables": tables})
    for group in _by_source(calls):
        files[f"{program.name}_native_{group[0][0].name}.c"] = render("c/native.c.j2", _native(program, group))
    return files


def _table(program: str, function: Function, used: Sequence[Orders]) -> dict[str, object]:
    """What the template of a table shows."""
    table = function.evaluator
    calls = [{"name": c_name(program, function.name, orders), "orders": orders} for orders in used]
    if isinstance(table, Curve):
        return {
            "name": function.name,
            "curve": True,
            "knots": _knots("X", table.knots),
            "rows": [_numbers(row) for row in table.coefficients.tolist()],
            "period": None if table.period is None else repr(table.period),
            "calls": calls,
        }
    if isinstance(table, Surface):
        return {
            "name": function.name,
            "curve": False,
            "axes": [_knots("X", table.x), _knots("Y", table.y)],
            "rows": [_numbers(row) for row in table.nodes.reshape(-1, 4).tolist()],
            "slope": repr(float(table.slope)),
            "calls": calls,
        }
    raise incomplete(f"function {function.name!r} has neither a table nor C code")


def _knots(axis: str, knots: np.ndarray) -> dict[str, object]:
    """An axis; where it is nearly uniform, the piece of an argument is computed, not searched."""
    n = len(knots)
    step = float(knots[-1] - knots[0]) / (n - 1)
    even = bool(np.max(np.abs(knots - (knots[0] + step * np.arange(n)))) <= 0.5 * step)
    lines = [_numbers(knots[k : k + 4].tolist()) for k in range(0, n, 4)]
    return {"axis": axis, "n": n, "lines": lines, "inverse": repr(1.0 / step if even else 0.0)}


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(repr(float(x)) for x in values)


def _by_source(calls: Calls) -> list[list[tuple[Function, list[Orders]]]]:
    """Native functions of the same source together, so that what it defines is there once."""
    groups: dict[str, list[tuple[Function, list[Orders]]]] = {}
    for f, used in calls.values():
        if f.native is not None:
            groups.setdefault(f.native.text, []).append((f, used))
    return list(groups.values())


def _native(program: Program, group: Sequence[tuple[Function, list[Orders]]]) -> dict[str, object]:
    """What the template of one source shows."""
    first, code = group[0][0].name, group[0][0].native
    assert code is not None
    renamed: set[str] = set()
    wrappers: dict[str, str] = {}
    for f, used in group:
        assert f.native is not None
        known = dict(f.native.names)
        renamed.update(known.values())
        for orders in used:
            base = base_orders(orders, list(known))
            differences = sum(orders) - sum(base)
            call = _differences(program.name, f, orders, base, differences, known, wrappers)
            head = _head(c_name(program.name, f.name, orders), f.arity)
            arguments = ", ".join(f"x{k}" for k in range(f.arity))
            wrappers[head] = f"EOMGEN_PIECE {head};\n{head}\n{{\n    return {call}({arguments});\n}}\n"
    return {
        "name": program.name,
        "functions": ", ".join(f.name for f, _ in group),
        "first": first,
        "file": re.sub(r"[^\w.\-]", "_", code.file, flags=re.ASCII),
        "source": code.text if code.text.endswith("\n") else code.text + "\n",
        "renamed": [(name, f"{program.name}_native_{first}_{name}") for name in sorted(renamed)],
        "wrappers": list(wrappers.values()),
    }


def _differences(
    program: str,
    function: Function,
    orders: Orders,
    base: Orders,
    total: int,
    known: dict[Orders, str],
    wrappers: dict[str, str],
) -> str:
    """Name of a C function of these orders: the source's own, or nested central differences of it."""
    if orders == base:
        return known[base]
    i = first_excess(orders, base)
    below = _differences(program, function, lowered(orders, i), base, total, known, wrappers)
    name = f"{program}_slope_{function.name}_{'_'.join(map(str, orders))}_of_{total}_{'_'.join(map(str, base))}"
    if name not in wrappers:
        up, down = (", ".join(side if k == i else f"x{k}" for k in range(function.arity)) for side in ("up", "down"))
        wrappers[name] = (
            f"static {_head(name, function.arity)}\n{{\n"
            f"    const double h = {difference_step(total)!r}*(fabs(x{i}) > 1.0 ? fabs(x{i}) : 1.0);\n"
            f"    const double up = x{i} + h, down = x{i} - h;\n"
            f"    return ({below}({up}) - {below}({down}))/(up - down);\n}}\n"
        )
    return name
