"""Sums over pairs of shapes -> C files: loops over tables of shapes, the tables written as runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from ..base.kernel_table import RECORD, WITNESS
from ..base.limits.runs import APART, BEYOND, NEAR, OUTSIDE, UP_TO, WITHIN
from ..contact.pair_features import CHOSEN, OTHER, OWN, PIECE
from ..contact.pair_sums import MEETING, MOTION, NEVER, PLACE, POSE, REST, RESULT, SORTED
from ..contact.pairs import PairFunction, PairKind, PairPart
from ..expr.core import Expr, symbols_of
from .c_functions import plain_declarations
from .c_text import print_pieces, used_helpers
from .files import render
from .pair_sums import (
    STATE_RECORD,
    SumAgain,
    UsedSum,
    has_columns,
    placed_length,
    plain_numbers,
    record_of,
    room_of_states,
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
    function = used.function
    parts: list[tuple[PairPart, str]] = [("outputs", "")] if used.sums or used.slopes else []
    parts += [("slopes", "_slope")] if used.slopes else []
    parts += [("touch", "_touch")] if used.meets else []
    parts += [("witness", "_witness")] if used.lists else []
    tables = _tables(function)
    for k in {kind.first for kind in function.kinds if kind.lines}:
        tables[k]["lined"] = True
    functions: list[str] = []
    helpers: list[str] = []
    kinds: list[dict[str, Any]] = []
    for kind in function.kinds:
        named = f"{function.name}_{kind.name}"
        for part, ending in parts:
            name = f"{named}{ending}"
            ending = ("", "_chosen", "_facing")[len(kind.corners)]
            text, needed = _law(program, kind, f"{name}{ending}", part, tables)
            functions.append(text)
            if kind.corners:
                functions.append(_choosing(kind, name, part, tables))
            helpers += [helper for helper in needed if helper not in helpers]
        touch = kind.expressions("touch")
        kinds.append(
            {
                "n": len(kinds),
                "name": kind.name,
                "sorted": _is_sorted(function, kind),
                "turns": not touch[-1].is_zero,
                "shaped": any(name.startswith("l") for name in symbols_of(touch)),  # by numbers behind the bodies
                "function": named,
                "first": tables[kind.first],
                "second": tables[kind.second],
                "planar": kind.extent,
                "thin": kind.thin,
                "lines": kind.lines,
                "law": kind.law,
                "states": kind.states,
                "pieces": kind.corners[0] if len(kind.corners) == 1 else 0,
                "places": len(kind.witness) // WITNESS,
                "held": [written([(at,) for at in places]) for places in kind.held],
            }
        )
    calls = {op: call for kind in function.kinds for op, call in kind.calls}
    context = used._asdict() | {
        "name": program.name,
        "sum": function.name,
        "prefix": f"{program.name}_pairs_{function.name}",
        "bodies": function.bodies,
        "pose": POSE,
        "pair": RESULT,
        "place": PLACE,
        "results": function.results,
        "states": function.states,
        "first_state": function.first_state,
        "numbers": [repr(x) for x in plain_numbers(function)] or ["0.0"],
        "tables": tables,
        "kinds": kinds,
        "functions": functions,
        "polygons": max((max(kind.corners) for kind in function.kinds if len(kind.corners) == 2), default=0),
        "outlines": any(len(kind.corners) == 1 for kind in function.kinds),
        "piece": PIECE,
        "chosen": CHOSEN,
        "own": OWN,
        "other": OTHER,
        "helpers": helpers,
        "called": plain_declarations(program.name, calls.values()),
        "moving": len(function.data) - function.states,
        "most": max((kind["second"]["count"] for kind in kinds if kind["sorted"]), default=0),
        "lined": any(table["lined"] for table in tables),
        "longest": max(table["length"] for table in tables),
        "apart": repr(APART),
        "witness": WITNESS,
        "record": RECORD,
        "room": function.room,
        "near": repr(NEAR),
        "outside": repr(OUTSIDE),
        "turns": any(kind["turns"] for kind in kinds),
        "never": repr(NEVER),
        "meeting": MEETING,
        "beyond": repr(BEYOND),
        "up_to": repr(UP_TO),
        "within": repr(WITHIN),
        "again": again is not None,
        "held": has_columns(program, function),
        "held_record": STATE_RECORD,
        "room_of_states": room_of_states(function),
        **(_columns(again) if again is not None else {}),
        "kept": record_of(function),
        "slots": slots_of(function),
        "given": function.count,
        "shapes": sum(map(len, function.tables)),
        "scratch": sum(table["count"] * table["length"] for table in tables),
    }
    return render("c/pairs.c.j2", context)


def _columns(again: SumAgain) -> dict[str, Any]:
    """Which numbers have rates and which results are read, as patterns that all bodies share."""
    function = again.function
    poses, forces = POSE * function.bodies, RATES * function.bodies
    unread = set(range(function.bodies)).difference(k // RATES for k in again.read if k < forces)
    return {
        "rated": sorted({k % POSE for k in again.rated if k < poses}),
        "further": len(function.data) if any(k >= poses for k in again.rated) else 0,
        "components": sorted({k % RATES for k in again.read if k < forces}),
        "unread": sorted(unread) if len(unread) <= SINGLED else [],
        "behind": forces if forces in again.read else forces + 1,
    }


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
            shape = POSE + (OWN if letter == "a" else OTHER)
        elif kind.corners and letter == "a":
            shape = POSE + CHOSEN
        step = law_length if letter in "ls" else shape
        number += len(kind.law) * (letter == "s")
        places[graph.symbol(symbol).id] = f"{'xucc'['abls'.index(letter)]}[{number + rate * step}]"
    inner = replace(program, graph=graph)
    guards = [Expr(graph, i) for i in kind.meets if part in ("outputs", "slopes")]
    pieces = cut(graph, outputs, (), frozenset(), len(graph.nodes) + 1, guards=guards)
    return print_pieces(inner, name, pieces, places).text, used_helpers(inner, [*outputs, *guards])


def _choosing(kind: PairKind, name: str, part: PairPart, tables: Sequence[dict[str, Any]]) -> str:
    """The function of two polygons or the inside of an outline, which calls that of the numbers that matter."""
    first, second = tables[kind.first], tables[kind.second]
    context = {"name": name, "first": first["length"], "second": second["length"], "corners": kind.corners}
    return render("c/pairs_chosen.c.j2", {**context, "own": OWN, "other": OTHER, "sloped": part == "slopes"})


def pair_declarations(program: Program) -> list[str]:
    """Declarations of the sums, in every lane, for the files that call them."""
    again = {one.function.name for one in sums_again(program)}
    return [
        _declared(program.name, used, used.function.name in again, has_columns(program, used.function))
        for used in used_sums(program)
    ]


def _declared(program: str, used: UsedSum, again: bool, held: bool) -> str:
    function = used.function
    prefix, n, results = f"{program}_pairs_{function.name}", function.count, function.results
    text = f"#define pairs_{function.name}_numbers {prefix}_numbers\n"
    text += f"EOMGEN_PIECE extern const double {prefix}_numbers[{max(1, len(plain_numbers(function)))}];\n"
    parts = {
        "sum": (used.sums, "", (n, 0, results)),
        "witnesses": (used.lists, "", (n, 0, function.witnesses)),
        "meeting": (used.meets, "const double *accelerations, ", (n, MOTION * function.bodies, MEETING)),
        "slope": (used.slopes, "const double *rates, ", (n, n, results)),
    }
    for part, (wanted, more, sizes) in parts.items():
        if wanted:
            text += f"EOMGEN_PIECE void {prefix}_{part}(const double *given, {more}double *out, double *work);\n"
            text += _each(f"pairs_{function.name}_{part}", f"{prefix}_{part}", sizes)
    if held:
        text += f"EOMGEN_PIECE void {prefix}_held(const double *given, double *out, double *work);\n"
    if again:
        text += (
            f"EOMGEN_PIECE void {prefix}_again(const double *given, const double *rates, double *out, double *met, "
            f"double *kept);\n#define pairs_{function.name}_again {prefix}_again\n"
        )
    return text


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
