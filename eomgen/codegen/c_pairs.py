"""Sums over pairs of shapes -> C files: loops over tables of shapes, the tables written as runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from ..base.kernel_table import WITNESS
from ..base.limits.runs import APART, BEYOND, NEAR, OUTSIDE, UP_TO, WITHIN
from ..contact.pair_features import CHOSEN, FIRST, OTHER
from ..contact.pair_sums import MEETING, MOTION, NEVER, PLACE, POSE, REST, SORTED
from ..contact.pairs import PairFunction, PairKind, PairPart
from ..expr.core import Expr
from .c_functions import plain_declarations
from .c_text import print_pieces, used_helpers
from .files import render
from .pair_sums import (
    SumAgain,
    UsedSum,
    has_columns,
    placed_length,
    plain_numbers,
    slots_of,
    sums_again,
    used_sums,
)
from .program import Program
from .statements import cut

LONGEST = 64  #: rows of one period at most, such as the corners of one shape

Row = tuple[int, ...]


class RowRun(NamedTuple):
    """Some rows that come several times, each time further by steps of their own."""

    rows: Sequence[Row]  #: those of the first time
    steps: Sequence[Row]  #: by how much each is further the next time; empty if the rows come once
    times: int


def runs_of(table: Sequence[Sequence[int]]) -> list[RowRun]:
    """A table as runs, which give its rows one after the other."""
    rows = [tuple(row) for row in table]
    result: list[RowRun] = []
    single: list[Row] = []  # rows that fit no run
    at = 0
    while at < len(rows):
        period, times = _longest(rows, at)
        if times * period > 2 * period:  # a run holds each row of its period twice
            if single:
                result.append(RowRun(single, (), 1))
                single = []
            steps = [_step(rows[at + k], rows[at + period + k]) for k in range(period)]
            result.append(RowRun(rows[at : at + period], steps, times))
            at += period * times
        else:
            single.append(rows[at])
            at += 1
    return [*result, RowRun(single, (), 1)] if single else result


def _step(first: Row, second: Row) -> Row:
    return tuple(b - a for a, b in zip(first, second, strict=True))


def _longest(rows: Sequence[Row], at: int) -> tuple[int, int]:
    """Period and number of times of the run at a row that spares most rows."""
    best, spared = (1, 1), 0
    for period in range(1, min(LONGEST, (len(rows) - at) // 3) + 1):
        end = at + 2 * period
        while end < len(rows) and _goes_on(rows, end, period):
            end += 1
        times = (end - at) // period
        if (times - 2) * period > spared:
            best, spared = (period, times), (times - 2) * period
    return best


def _goes_on(rows: Sequence[Row], k: int, period: int) -> bool:
    return _step(rows[k - 2 * period], rows[k - period]) == _step(rows[k - period], rows[k])


def written(table: Sequence[Sequence[int]]) -> dict[str, list[Row]]:
    """What C needs of a table: its rows and steps, and of each run how many rows it has and how often they come."""
    runs = runs_of(table)
    return {
        "rows": [row for run in runs for row in (*run.rows, *run.steps)],
        "runs": [(len(run.rows), run.times) for run in runs],
    }


#: Limits by their names in C, where they stand behind ``PAIRS_``.
_LIMITS = {
    "APART": APART, "NEAR": NEAR, "OUTSIDE": OUTSIDE, "UP_TO": UP_TO, "BEYOND": BEYOND, "WITHIN": WITHIN,
    "NEVER": NEVER,
}  # fmt: skip
_ENDINGS = {"outputs": "", "slopes": "_slope", "touch": "_touch", "witness": "_witness"}  #: of names of laws
RATES = 6  #: results of a body: force and torque
SINGLED = 8  #: bodies of which no result is read, up to which the text names them


def _tables(function: PairFunction) -> list[dict[str, Any]]:
    """The tables of shapes, and where the shapes stand in the work array; places count from behind the bodies."""
    result: list[dict[str, Any]] = []
    start = number = 0
    begun = POSE * function.bodies
    for k, rows in enumerate(function.tables):
        table = written([(row[0], *(x - begun if x >= 0 else x for x in row[1:])) for row in rows])
        sizes, length = len(rows[0]) - PLACE - REST, placed_length(rows)
        counts = {"k": k, "count": len(rows), "columns": len(rows[0]), "sizes": sizes, "length": length, "lined": False}
        result.append({**table, **counts, "start": start, "number": number})
        number += len(rows)
        start += len(rows) * length
    return result


def pair_files(program: Program) -> dict[str, str]:
    """The C files of the sums that a program uses."""
    again = {one.function.name: one for one in sums_again(program)}
    return {
        f"{program.name}_pairs_{used.function.name}.c": _file(program, used, again.get(used.function.name))
        for used in used_sums(program)
    }


def _file(program: Program, used: UsedSum, again: SumAgain | None) -> str:
    """The file of a sum, with derivatives along one direction after another if they are taken."""
    function, prefix = used.function, f"{program.name}_pairs_{used.function.name}"
    wanted: dict[PairPart, bool] = {
        "outputs": used.sums or used.slopes, "slopes": used.slopes, "touch": used.meets, "witness": used.lists,
    }  # fmt: skip
    tables = _tables(function)
    for k in {kind.first for kind in function.kinds if kind.lines}:
        tables[k]["lined"] = True
    laws: list[str] = []
    functions: list[str] = []
    helpers: list[str] = []
    kinds: list[dict[str, Any]] = []
    for kind in function.kinds:
        numbers = dict.fromkeys(wanted, 0)  # of laws, from 1 on
        for part in [part for part, needed in wanted.items() if needed]:
            laws.append(f"{function.name}_{kind.name}{_ENDINGS[part]}")
            numbers[part] = len(laws)
            text, more = _law(program, kind, laws[-1], part, tables)
            functions.append(text)
            helpers += [helper for helper in more if helper not in helpers]
        turns, places = not kind.expressions("touch")[-1].is_zero, len(kind.witness) // WITNESS
        is_sorted = int(_is_sorted(function, kind))
        kinds.append(
            {
                "n": len(kinds),
                "name": kind.name,
                "first": kind.first,
                "second": kind.second,
                "counts": (kind.extent, kind.thin, is_sorted, int(turns), places, kind.states, len(kind.law)),
                "corners": (*kind.corners, 0, 0)[:2],
                "lines": kind.lines,
                "law": kind.law,
                "held": [written([(at,) for at in places]) | {"columns": 1} for places in kind.offsets],
                "laws": numbers.values(),
            }
        )
    calls = {op: call for kind in function.kinds for op, call in kind.calls}
    sorted_counts = [tables[kind["second"]]["count"] for kind in kinds if kind["counts"][2]]
    counts = {
        "BODIES": function.bodies,
        "RESULTS": function.results,
        "FIRST_STATE": function.first_state,
        "GIVEN": function.count,
        "ALL_TABLES": len(tables),
        "ALL_KINDS": len(kinds),
        "ALL_SHAPES": sum(map(len, function.tables)),
        "SHAPES": sum(table["count"] * table["length"] for table in tables),
        "WIDEST": max(table["columns"] for table in tables),
        "LONGEST": max(table["length"] for table in tables),
        "LAWS": max(len(kind.law) + kind.states for kind in function.kinds),
        "STATED": max(kind.states for kind in function.kinds),
        "CORNERS": max((max(kind.corners) for kind in function.kinds if len(kind.corners) == 2), default=1),
        "MOST": max(sorted_counts, default=1),
        "ROOM": function.capacity,
        "SLOPES": int(used.slopes),
        "LISTS": int(used.lists),
        "MEETS": int(used.meets),
        "HELD": int(has_columns(program, function)),
        "LINED": int(any(table["lined"] for table in tables)),
        "OUTLINES": int(any(len(kind.corners) == 1 for kind in function.kinds)),
        "POLYGONS": int(any(len(kind.corners) == 2 for kind in function.kinds)),
    }
    context = {
        "name": program.name,
        "sum": function.name,
        "prefix": prefix,
        "limits": {name: repr(x) for name, x in _LIMITS.items()},
        "counts": counts | (_columns(again) if again is not None else {}),
        "again": again,
        **(_patterns(again) if again is not None else {}),
        "numbers": [repr(x) for x in plain_numbers(function)] or ["0.0"],
        "called": plain_declarations(program.name, calls.values()),
        "helpers": helpers,
        "functions": functions,
        "laws": laws,
        "tables": tables,
        "kinds": kinds,
        "parts": [
            (_prototype(f"{prefix}_{part}", arguments), f"pairs_{part}({', '.join(arguments)})")
            for part, arguments in _parts(program, used, again is not None).items()
        ],
    }
    return render("c/pairs.c.j2", context)


def _columns(again: SumAgain) -> dict[str, int]:
    """Sizes of the columns of a derivative."""
    function, patterns = again.function, _patterns(again)
    poses, forces = POSE * function.bodies, RATES * function.bodies
    return {
        "SLOTS": slots_of(function),
        "RATED": len(patterns["rated"]),
        "FURTHER": len(function.data) if any(k >= poses for k in again.rated) else 0,
        "READ": len(patterns["components"]),
        "NOT_READ": len(patterns["unread"]),
        "BEHIND": forces if forces in again.read else forces + 1,
    }


def _patterns(again: SumAgain) -> dict[str, list[int]]:
    """Which numbers have rates and which results are read, as patterns that all bodies share."""
    poses, forces = POSE * again.function.bodies, RATES * again.function.bodies
    unread = set(range(again.function.bodies)).difference(k // RATES for k in again.read if k < forces)
    return {
        "rated": sorted({k % POSE for k in again.rated if k < poses}),
        "components": sorted({k % RATES for k in again.read if k < forces}),
        "unread": sorted(unread) if len(unread) <= SINGLED else [],
    }


def _parts(program: Program, used: UsedSum, again: bool) -> dict[str, tuple[str, ...]]:
    """What of a sum is called, and the names of the arguments, all numbers."""
    wanted: dict[str, tuple[Any, tuple[str, ...]]] = {
        "sum": (used.sums, ("given", "out", "work")),
        "witnesses": (used.lists, ("given", "out", "work")),
        "meeting": (used.meets, ("given", "accelerations", "out", "work")),
        "slope": (used.slopes, ("given", "rates", "out", "work")),
        "held": (has_columns(program, used.function), ("given", "out", "work")),
        "again": (again, ("given", "rates", "out", "met", "kept")),
    }
    return {part: arguments for part, (needed, arguments) in wanted.items() if needed}


def _prototype(function: str, arguments: Sequence[str]) -> str:
    read = ("given", "rates", "accelerations")
    typed = [f"{'const ' if name in read else ''}double *{name}" for name in arguments]
    return f"void {function}({', '.join(typed)})"


def _is_sorted(function: PairFunction, kind: PairKind) -> bool:
    """Whether pairs are found along an axis: where they are many and every shape has bounds."""
    rows = function.tables[kind.first], function.tables[kind.second]
    return (
        not kind.lines
        and len(rows[0]) * len(rows[1]) >= SORTED
        and all(row[-REST] >= 0 for table in rows for row in table)
    )


def _law(
    program: Program, kind: PairKind, name: str, part: PairPart, tables: Sequence[dict[str, Any]]
) -> tuple[str, list[str]]:
    """The function of one pair and the helpers that it needs."""
    outputs = kind.expressions(part)
    graph = outputs[0].graph
    places: dict[int, str] = {}
    count = len(kind.plain)
    for k, symbol in enumerate(kind.symbols):
        rate = k >= count
        plain = symbol.removeprefix("d_")
        letter, number = plain[0], int(plain[1:])
        law_length = len(kind.law) + kind.states  # states stand behind the numbers of the law
        shape = tables[kind.first if letter == "a" else kind.second]["length"]
        if len(kind.corners) == 2:
            shape = POSE + (FIRST if letter == "a" else OTHER)
        elif kind.corners and letter == "a":
            shape = POSE + CHOSEN
        step = law_length if letter in "ls" else shape
        number += len(kind.law) * (letter == "s")
        places[graph.symbol(symbol).id] = f"{'xucc'['abls'.index(letter)]}[{number + rate * step}]"
    inner = replace(program, graph=graph)
    guards = [Expr(graph, i) for i in kind.meets if part in ("outputs", "slopes")]
    pieces = cut(graph, outputs, (), frozenset(), len(graph.nodes) + 1, guards=guards)
    return print_pieces(inner, name, pieces, places).text, used_helpers(inner, [*outputs, *guards])


def pair_declarations(program: Program) -> list[str]:
    """Declarations of the sums, in every lane, for the files that call them."""
    again = {one.function.name for one in sums_again(program)}
    return [_declared(program, used, used.function.name in again) for used in used_sums(program)]


def _declared(program: Program, used: UsedSum, again: bool) -> str:
    function = used.function
    prefix, n, results = f"{program.name}_pairs_{function.name}", function.count, function.results
    text = f"#define pairs_{function.name}_numbers {prefix}_numbers\n"
    text += f"EOMGEN_PIECE extern const double {prefix}_numbers[{max(1, len(plain_numbers(function)))}];\n"
    sizes = {
        "sum": (n, 0, results),
        "witnesses": (n, 0, function.witnesses),
        "meeting": (n, MOTION * function.bodies, MEETING),
        "slope": (n, n, results),
    }
    for part, arguments in _parts(program, used, again).items():
        text += f"EOMGEN_PIECE {_prototype(f'{prefix}_{part}', arguments)};\n"
        if part in sizes:
            text += _each(f"pairs_{function.name}_{part}", f"{prefix}_{part}", sizes[part])
    return text + (f"#define pairs_{function.name}_again {prefix}_again\n" if again else "")


def _each(name: str, called: str, sizes: tuple[int, int, int]) -> str:
    """The function that calls a sum in every lane; sizes of what is given, of its rates and of the results."""
    n, more, results = sizes
    rates, passed = (", const real *rates", ", rates") if more else ("", "")
    taken = n + more
    also = (
        f"        for (int i = 0; i < {more}; i++) {{ plain[{n} + i] = EOMGEN_LANE(rates[i], k); }}\n" if more else ""
    )
    lanes = f"plain, plain + {n}" if more else "plain"
    return (
        f"EOMGEN_SHARED inline void {name}(const real *given{rates}, real *out, real *work)\n{{\n"
        f"#ifdef EOMGEN_PLAIN\n    {called}(given{passed}, out, work);\n#else\n"
        "    typedef double __attribute__((may_alias)) number;\n"
        "    number *const plain = (number *)work;\n"
        "    for (int k = 0; k < EOMGEN_WIDTH; k++) {\n"
        f"        for (int i = 0; i < {n}; i++) {{ plain[i] = EOMGEN_LANE(given[i], k); }}\n{also}"
        f"        {called}({lanes}, plain + {taken}, plain + {taken + results});\n"
        f"        for (int i = 0; i < {results}; i++) {{ EOMGEN_LANE(out[i], k) = plain[{taken} + i]; }}\n"
        "    }\n#endif\n}\n"
    )
