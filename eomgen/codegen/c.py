"""Program -> C99 library: ``<name>.c``, ``<name>.h``, ``eomgen.h`` and ``model.json``."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..base.kernel_table import KERNELS
from ..base.texts import comment_lines
from ..layer import SOLVER, SOLVER_HEADERS, read_header, read_layer
from .c_bounds import operations_of, stack_of, states_beside_change_points
from .c_branches import print_block_of_branches
from .c_functions import declarations, function_files, used_calls
from .c_lanes import lane_blocks, lane_files, lane_kernels
from .c_layout import describe_equations, is_straight, work_areas
from .c_pairs import pair_declarations, pair_files
from .c_parts import distribute, part_names
from .c_rolled import print_rolled, print_rolled_precompute
from .c_series import series_files
from .c_text import Printed, print_block, print_precompute, used_helpers
from .files import SourceSet, describe_layouts, metadata_json, render
from .held_states import held_tables
from .loops.loop_blocks import LARGE
from .program import Block, Program
from .series import NoSeriesError
from .single_precision import in_single_precision, refuse_double

#: Headers of the numbers that functions compute with, and those that lanes need besides.
NUMBERS = ("eomgen_real.h", "eomgen_sincos.h", "eomgen_angles.h")
PROCESSORS = ("eomgen_processor.h", "eomgen_contraction.h")
#: Characters of a C literal, which compilers need not take longer than 4095, and of one of its lines, which become four
#: times as long at most.  gcc reads the metadata of 1,600 bodies as literals in 0.06 s, as numbers in 1.0 s.
LITERAL, LINE = 4000, 28
#: A block of more inputs has no comment with their names.
NAMED = 100
#: All that could end a literal, begin an escape, a trigraph or a comment, be read as code, or is no plain character.
UNSAFE = re.compile(r"[^A-Za-z0-9 _.,:-]")


def emit_c(program: Program, precision: str | None = None, lanes: bool = True, separate: bool = True) -> SourceSet:
    """The C sources of a program.

    Parameters
    ----------
    precision : {'double', 'float'}, optional
        Of a library that stands alone: its header says what calls cost, and it has a semi-implicit stepper too.  One
        in single precision has neither lanes nor Taylor series.
    lanes : bool, optional
        Whether there are functions for several states at a time, and Taylor series.
    separate : bool, optional
        Whether the pieces of a large model go into files of their own.

    Returns
    -------
    SourceSet
        ``<name>.c``, ``<name>.h``, ``eomgen.h`` and other headers that are the same for all models, ``model.json``;
        C99, no dependency but libm; ``eomgen_solvers.c``, which is the same for all models, unless all functions are
        straight-line code; ``<name>_lanes2.c`` and so on for several states at a time.  A large model has
        further files ``<name>_part1.c``, ..., so that they can be compiled side by side; tables stand in
        ``<name>_tables.c``, native functions in ``<name>_native_<first of them>.c``.
    """
    single = precision == "float"
    if single:
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
    printed = _print(program, lanes and precision is None)
    parts = distribute(program, printed) if separate else []
    calls = used_calls(program)
    for_lanes = _printed_for_lanes(program, printed) if in_lanes else {}
    work = max((p.work for p in (*printed[1:], *for_lanes.values())), default=0)
    context = _context(program, printed, work) | {"parts": parts, "part_names": part_names(printed) if parts else []}
    context |= {
        "printed": for_lanes,
        "library": precision is not None,
        "costs": {},
        "most_states": states_beside_change_points(),
    }
    further = {
        f"{program.name}_part{k}.c": render(
            "c/part.c.j2",  # each declares its own pieces alone, so that the text grows as the pieces do
            {**context, "part_names": [name for name, _ in part], "functions": [text for _, text in part]},
        )
        for k, part in enumerate(parts, 1)
    }
    sources = {
        f"{program.name}.c": render("c/model.c.j2", context),
        **further,
        **(lane_files(program, context) if lanes else {}),
        **series,
        **function_files(program, calls),
        **pair_files(program),
    }
    if program.drivers:
        sources |= {name: read_header(name) for name in SOLVER_HEADERS} | {SOLVER: read_layer()[SOLVER]}
    if precision:
        context["costs"] = _costs(program, sources)
    sources |= {
        f"{program.name}.h": render("c/model.h.j2", context),
        **{name: read_header(name) for name in ("eomgen.h", *NUMBERS, *(PROCESSORS if lanes else ()))},
        "model.json": metadata_json(program),
    }
    return SourceSet(in_single_precision(sources) if single else sources)


def _costs(program: Program, sources: Mapping[str, str]) -> dict[str, tuple[str, int]]:
    """Operations and bytes of stack of every public function, by name."""
    stacks = stack_of(text for name, text in sources.items() if name.endswith(".c"))
    names = [k.name for k in program.kernels]
    return {name: (operations_of(program, name), stacks[f"{program.name}_{name}"]) for name in names}


def _print(program: Program, branches: bool = False) -> list[Printed]:
    """Every straight-line function, the precompute first; ``branches``: statements of alike branches as vectors."""
    blocks = [_print_function(program, b, branches) for b in program.blocks if b.name not in program.twins]
    return [_print_precompute(program) if program.hoisted else Printed("", (), 0), *blocks]


def _print_precompute(program: Program) -> Printed:
    rolled = print_rolled_precompute(program) if program.is_rolled("precompute") else None
    return rolled or print_precompute(program)


def _print_function(program: Program, block: Block, branches: bool) -> Printed:
    """A block below the names of what it reads, where these are few."""
    rolled = print_rolled(program, block) if program.is_rolled(block.name) else None
    printed = rolled or (print_block_of_branches if branches else print_block)(program, block)
    if len(block.inputs) > NAMED:
        return printed
    names = comment_lines(f"{block.name}: x = {', '.join(block.inputs)}", "   ")
    return printed._replace(text=f"/* {names} */\n{printed.text.lstrip()}")


def _printed_for_lanes(program: Program, printed: list[Printed]) -> dict[str, Printed]:
    """The straight-line functions that have lanes, by name, without vectors of their own."""
    found = dict(zip((b.name for b in program.blocks if b.name not in program.twins), printed[1:], strict=True))
    return {
        name: print_block(program, block) if found[name].in_pairs else found[name]
        for name, block in lane_blocks(program).items()
    }


def _context(program: Program, printed: list[Printed], work: int) -> dict[str, Any]:
    twins, in_lanes = program.twins, program.metadata["lanes"]
    areas, n_work = work_areas(program, work)
    n_const = count_constants(program, printed[0])
    sizes = program.sizes
    results = {k.name: k.result for k in KERNELS}
    numbers = {**sizes._asdict(), "n_const": n_const, "n_work": n_work, "n_step_work": n_work + 5 * sizes.n_x}
    numbers["closed_at"] = closed_at(program, areas)
    roots = [y for b in program.blocks for y in b.roots]
    straight = is_straight(program)
    return {
        "name": program.name,
        "prefix": program.name.upper(),
        "guard": f"EOMGEN_MODEL_{program.name.upper()}_H",
        "metadata": program.metadata,
        "sizes": sizes,
        "numbers": [(key.upper(), value) for key, value in numbers.items()],
        "n_const": n_const,
        "n_work": n_work,
        "hoisted": len(program.hoisted),
        "closed_at": numbers["closed_at"],
        "work_at": len(program.parameters) + len(program.hoisted),
        "helpers": [
            *used_helpers(program, roots),
            *declarations(program, used_calls(program)),
            *pair_declarations(program),
        ],
        "blocks": printed if program.hoisted else printed[1:],
        "equations": describe_equations(program, areas) if program.drivers else None,
        "straight": straight,
        "starts": {name: start for name, start, _ in areas},
        "n_states": program.n_states,
        "quaternion_slots": program.quaternion_slots,
        "rates_are_velocities": not (program.quaternion_slots or program.given_rates or program.n_states),
        "has_loops": program.has_loops and program.projects,
        "held": held_tables(program),
        "system": program.system if "system" in program.block_names else None,
        "kernels": [
            {
                "name": k.name,
                "call": f"{twins.get(k.name, k.name)}_block" if isinstance(k, Block) else f"{k.name}_driver",
                "straight": straight and k.name == "rhs",
                "lanes": k.name in in_lanes,
                "driver": not isinstance(k, Block),
                "n_in": k.n_in,
                "n_out": k.n_out,
                "ports": [port.name for port in k.ports],
                "result": results[k.name],
            }
            for k in program.kernels
        ],
        "lanes": in_lanes,
        "series": program.metadata["series"],
        "layouts": describe_layouts(program),
        "metadata_literals": _literals(json.dumps(program.metadata, separators=(",", ":"), allow_nan=False)),
    }


def count_constants(program: Program, precompute: Printed) -> int:
    """Length of c: parameters, what is computed from them once, and the work of that."""
    return len(program.parameters) + len(program.hoisted) + precompute.work


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
    return [
        [UNSAFE.sub(lambda found: f"\\{ord(found[0]):03o}", piece[k : k + LINE]) for k in range(0, len(piece), LINE)]
        for piece in pieces
    ]
