"""Program -> C99 library: ``<name>.c``, ``<name>.h``, ``eomgen.h`` and ``model.json``."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from typing import Any

from ..base.kernel_table import KERNELS
from ..expr.texts import comment_lines
from ..toolchain.layer import PAIRS_HEADER, SOLVER, SOLVER_HEADERS, read_header, read_layer
from .c_functions import declarations, function_files, used_calls
from .c_lanes import lane_blocks, lane_files, lane_kernels, series_files
from .c_layout import describe_equations, is_straight, work_areas
from .c_rolled import print_block_of_branches, print_rolled
from .c_text import Printed, print_block, used_helpers, with_pieces
from .files import SourceSet, describe_layouts, metadata_json, render
from .loop_systems import LARGE
from .pair_sums import contact_tables, used_sums
from .program import BY_MOTIONS, BY_SYSTEM, Block, Program
from .series import NoSeriesError

#: Headers of the numbers that functions compute with, and of what stands around functions.
HEADERS = ("eomgen.h", "eomgen_real.h", "eomgen_calls.h")
#: Pieces of long functions that take more text than this (bytes) go into files of about this length each.
LENGTH = 150_000
#: Characters of a C literal, which compilers need not take longer than 4095, and of one of its lines.  gcc reads the
#: metadata of 1,600 bodies as literals in 0.06 s, as numbers in 1.0 s.
LITERAL, LINE = 4000, 112
#: A block of more inputs has no comment with their names.
NAMED = 100
#: All that could end a literal, begin an escape, a trigraph or a comment, be read as code, or is no plain character.
UNSAFE = re.compile(r"[^A-Za-z0-9 _.,:-]")


def emit_c(program: Program, precision: str | None = None, lanes: bool = True, separate: bool = True) -> SourceSet:
    """The C sources of a program.

    ``<name>.c``, ``<name>.h``, ``eomgen.h`` and other headers that are the same for all models, ``model.json``; C99, no
    dependency but libm; ``eomgen_solvers.c``, which is the same for all models, unless all functions are straight-line
    code; ``<name>_analyses.c`` with what runs do without; ``<name>_metadata.c`` with the table of functions;
    ``<name>_lanes2.c`` and so on for several states at a time.  A large model has further files ``<name>_part1.c`` and
    so on, so that they can be compiled side by side; tables stand in ``<name>_tables.c``, native functions in
    ``<name>_native_<first of them>.c``.

    ``precision``, 'double' or 'float', is that of a library that stands alone: its header says what calls cost, and it
    has a semi-implicit stepper too; one in single precision has neither lanes nor Taylor series.  Without ``lanes``
    there are no functions for several states at a time, nor Taylor series; unless ``separate``, functions that analyses
    alone need, and the pieces of a large model, are in the main file.
    """
    single = precision == "float"
    if single:
        from .standalone_c import refuse_double

        refuse_double(program)
    lanes = lanes and not single
    in_lanes = lane_kernels(program) if lanes else []
    series: dict[str, str] = {}
    about: dict[str, Any] = {"lanes": in_lanes, "series": True}
    try:
        if not lanes:
            raise NoSeriesError("single precision has too few digits for Taylor series" if single else "not asked for")
        series = series_files(program)
    except NoSeriesError as error:
        about |= {"series": False, "no_series": str(error)}
    if precision:
        about["precision"] = precision
    program = replace(program, metadata={**program.metadata, **about})
    apart = _of_analyses(program) if separate else frozenset()
    printed = _print(program, apart, lanes and precision is None)
    parts = _distribute(list(printed.values())) if separate else []
    calls = used_calls(program)
    for_lanes = _printed_for_lanes(program, printed) if in_lanes else {}
    work = max((p.work for name, p in (*printed.items(), *for_lanes.items()) if name != "precompute"), default=0)
    context = _context(program, printed, work, apart) | {"library": precision is not None, "costs": {}}
    name = program.name
    sources = {
        f"{name}.c": _model_file(program, context, printed, bool(parts), apart),
        **({f"{name}_analyses.c": _model_file(program, context, printed, bool(parts), apart, True)} if apart else {}),
        f"{name}_metadata.c": render("c/metadata.c.j2", context),
        **{f"{name}_part{k}.c": _part_file(context, k, part) for k, part in enumerate(parts, 1)},
        **(lane_files(program, context, for_lanes) if lanes else {}),
        **series,
        **function_files(program, calls),
    }
    if used_sums(program):
        from .c_pairs import pair_files

        sources |= pair_files(program)
    if program.drivers:
        sources |= {name: read_header(name) for name in SOLVER_HEADERS} | {SOLVER: read_layer()[SOLVER]}
    sources |= {name: read_header(name) for name in (*HEADERS, *([PAIRS_HEADER] if used_sums(program) else []))}
    if precision:
        from .standalone_c import in_single_precision, states_beside_change_points

        context |= {"costs": _costs(program, sources), "most_states": states_beside_change_points()}
    sources |= {f"{name}.h": render("c/model.h.j2", context), "model.json": metadata_json(program)}
    return SourceSet(in_single_precision(sources) if single else sources)


def _of_analyses(program: Program) -> frozenset[str]:
    """Names of the blocks that only kernels need which runs do without: those that a session leaves for later."""
    lazy = {k.name for k in KERNELS if k.lazy}
    first = [k.name for k in program.kernels if k.name not in lazy]
    if "rhs" not in first:  # a module for analyses
        return frozenset()
    drivers = {k.name: k.blocks for k in program.drivers}
    needed = {block for name in first for block in drivers.get(name, (program.aliases.get(name, name),))}
    return frozenset(b.name for b in program.blocks if b.name not in needed and b.name not in program.aliases)


def _model_file(
    program: Program,
    context: dict[str, Any],
    printed: Mapping[str, Printed],
    parts: bool,
    apart: Collection[str],
    analyses: bool = False,
) -> str:
    """The main file of a model, or that of what analyses alone need; ``parts``: pieces lie in files of their own."""
    here = [name for name in printed if (name in apart) == analyses]
    roots = [y for b in program.blocks if b.name in here for y in b.roots]
    roots += [] if analyses else program.hoisted
    pieces = [piece for name in here for piece, _ in printed[name].pieces]
    linked = [f"{program.name}_{name}_block" for name in _linked(program, apart)]
    return render(
        "c/model.c.j2",
        {
            **context,
            "part": ", functions that analyses alone need" if analyses else "",
            "helpers": [*used_helpers(program, roots), *context["declarations"]],
            "declared": [*(pieces if parts else []), *linked],
            "functions": [printed[name].text for name in here]
            if parts
            else with_pieces(printed[name] for name in here),
            "equations": None if analyses else context["equations"],
            "kernels": [k for k in context["kernels"] if (k["block"] in apart) == analyses],
        },
    )


def _part_file(context: dict[str, Any], number: int, part: list[tuple[str, str]]) -> str:
    """A file of pieces; it declares its own alone, so that the text grows as the pieces do."""
    names, functions = [name for name, _ in part], [text for _, text in part]
    helpers = [*context["helpers"], *context["declarations"]]
    more = {"part": f", part {number}", "helpers": helpers, "declared": names, "functions": functions}
    return render("c/model.c.j2", {**context, **more, "equations": None, "kernels": []})


def _linked(program: Program, apart: Collection[str]) -> list[str]:
    """Names of the blocks in the file for analyses that the table of the solvers names."""
    return [name for name in dict.fromkeys(b for d in program.drivers for b in d.blocks) if name in apart]


def _costs(program: Program, sources: Mapping[str, str]) -> dict[str, tuple[str, int]]:
    """Operations and bytes of stack of every public function, by name."""
    from .standalone_c import operations_of, stack_of

    metadata = f"{program.name}_metadata.c"
    texts = [text for name, text in sources.items() if name.endswith((".c", ".h")) and name != metadata]
    stacks = stack_of(texts, program.name, {"N": str(program.sizes.n_v)})
    names = [k.name for k in program.kernels]
    return {name: (operations_of(program, name), stacks[f"{program.name}_{name}"]) for name in names}


def _print(program: Program, apart: Collection[str], branches: bool = False) -> dict[str, Printed]:
    """Every straight-line function by name, the precompute first; what another file calls bears the model's name.

    ``branches``: statements of alike branches as vectors.
    """
    blocks = [program.precompute] if program.hoisted else []
    blocks += [block for block in program.blocks if block.name not in program.aliases]
    printed = {block.name: _print_function(program, block, branches) for block in blocks}
    for name in _linked(program, apart):
        text = printed[name].text.replace(f"static flag {name}_block(", f"flag {program.name}_{name}_block(")
        printed[name] = printed[name]._replace(text=text)
    return printed


def _print_function(program: Program, block: Block, branches: bool) -> Printed:
    """A block below the names of what it reads, where these are few."""
    rolled = print_rolled(program, block) if program.is_rolled(block.name) else None
    printed = rolled or (print_block_of_branches if branches else print_block)(program, block)
    if len(block.inputs) > NAMED:
        return printed
    names = comment_lines(f"{block.name}: x = {', '.join(block.inputs)}", "   ")
    return printed._replace(text=f"/* {names} */\n{printed.text.lstrip()}")


def _printed_for_lanes(program: Program, printed: Mapping[str, Printed]) -> dict[str, Printed]:
    """The straight-line functions that have lanes, by name, without vectors of their own."""
    return {
        name: print_block(program, block) if printed[name].in_pairs else printed[name]
        for name, block in lane_blocks(program).items()
    }


def _pair_declarations(program: Program) -> list[str]:
    """Declarations of sums over pairs of shapes, by what no other program loads."""
    if not used_sums(program):
        return []
    from .c_pairs import pair_declarations

    return pair_declarations(program)


def _context(program: Program, printed: Mapping[str, Printed], work: int, apart: Collection[str]) -> dict[str, Any]:
    aliases, in_lanes = program.aliases, program.metadata["lanes"]
    areas, n_work = work_areas(program, work)
    sizes = program.sizes
    results = {k.name: k.result for k in KERNELS}
    numbers = {**sizes._asdict(), "n_const": count_constants(program, printed.get("precompute")), "n_work": n_work}
    numbers |= {"n_step_work": n_work + 5 * sizes.n_x, "closed_at": closed_at(program, areas)}
    roots = [y for b in program.blocks for y in b.roots]
    straight = is_straight(program)
    stepping = (BY_SYSTEM[0], BY_MOTIONS[0]) if straight else ()  # parts of close_directly
    return {
        "name": program.name,
        "prefix": program.name.upper(),
        "metadata": program.metadata,
        "sizes": sizes,
        "numbers": {key.upper(): value for key, value in numbers.items()},
        "hoisted": len(program.hoisted),
        "work_at": len(program.parameters) + len(program.hoisted),
        "helpers": used_helpers(program, roots),
        "declarations": [*declarations(program, used_calls(program)), *_pair_declarations(program)],
        "arguments": _describe_arguments(program),
        "equations": describe_equations(program, areas, _linked(program, apart), stepping) if program.drivers else None,
        "straight": straight,
        "shorter": BY_MOTIONS[0] in program.block_names,
        "starts": {name: start for name, start, _ in areas},
        "rates_are_velocities": not (program.quaternion_slots or program.general_rates or program.n_states),
        "has_loops": program.has_loops and program.projects,
        "held": contact_tables(program),
        "system": program.system if "system" in program.block_names else None,
        "kernels": [
            {
                "name": k.name,
                "block": aliases.get(k.name, k.name) if isinstance(k, Block) else "",
                "call": f"{aliases.get(k.name, k.name)}_block" if isinstance(k, Block) else f"{k.name}_driver",
                "solver": ""
                if isinstance(k, Block)
                else "rhs_or_solved"
                if straight and k.name == "rhs"
                else f"eom_{k.name}",
                "lanes": k.name in in_lanes,
                "n_in": k.n_in,
                "n_out": k.n_out,
                "ports": [port.name for port in k.ports],
                "result": results[k.name],
            }
            for k in program.kernels
        ],
        "layouts": describe_layouts(program),
        "metadata_literals": _literals(json.dumps(program.metadata, separators=(",", ":"), allow_nan=False)),
    }


def _describe_arguments(program: Program) -> list[str]:
    """What stands in c and u, where names are few."""
    made = ", then what precompute makes of them" if program.hoisted else ""
    texts = [f"c = {', '.join(program.parameters)}{made}" if program.parameters else ""]
    texts += [f"u = {', '.join(program.inputs)}" if program.inputs else ""]
    few = len(program.parameters) + len(program.inputs) <= NAMED
    return [comment_lines(text, "      ") for text in texts if text and few]


def count_constants(program: Program, precompute: Printed | None) -> int:
    """Length of c: parameters, what is computed from them once, and the work of that."""
    return len(program.parameters) + len(program.hoisted) + (precompute.work if precompute else 0)


def closed_at(program: Program, areas: list[tuple[str, int, int]]) -> int:
    """Where in the work array the right-hand side leaves its state [q; v] on the constraints; 0 where it does not.

    Large mechanisms alone need it, to pass configurations of lost rank; others keep the steps of SciPy.
    """
    closes = any(d.name == "rhs" for d in program.drivers) and program.has_loops and program.projects
    closes = closes and program.sizes.n_v > LARGE
    return next(start for name, start, _ in areas if name == "X") if closes else 0


def _literals(text: str) -> list[list[str]]:
    """A text of ASCII characters as C literals, each in lines; what anyone could take for code is escaped.

    Octal escapes have three digits, so that none of them takes a digit of the text.
    """
    pieces = (text[k : k + LITERAL] for k in range(0, len(text), LITERAL))
    return [list(_lines(UNSAFE.sub(lambda result: f"\\{ord(result[0]):03o}", piece))) for piece in pieces]


def _lines(escaped: str) -> Iterator[str]:
    """The text in lines that cut no escape."""
    start = 0
    while start < len(escaped):
        end = start + LINE
        inside = escaped.rfind("\\", end - 3, end)
        end = inside if inside > 0 else end
        yield escaped[start:end]
        start = end


def _distribute(printed: list[Printed]) -> list[list[tuple[str, str]]]:
    """The pieces, name and text, by file; none if the model is small enough for one file."""
    pieces = [piece for p in printed for piece in p.pieces]
    total = sum(len(text) for _, text in pieces)
    if total <= LENGTH:
        return []
    files = -(-total // LENGTH)
    share = total / files
    parts: list[list[tuple[str, str]]] = [[] for _ in range(files)]
    done = 0
    for name, text in pieces:
        parts[min(int(done / share), files - 1)].append((name, text))
        done += len(text)
    return [part for part in parts if part]
