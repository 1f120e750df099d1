"""The straight-line functions of a model once more, for several states side by side (lanes).

The right-hand side of closed loops has lanes where it is made of straight-line blocks: lanes that need more, such as
pivoting, are left to the function of one state (eomgen_straight.h).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .c_text import Printed, used_helpers, with_pieces
from .files import render
from .program import BY_MOTIONS, BY_SYSTEM, Block, Program

#: Public functions that have lanes where they are straight-line code.
LANES = ("rhs", "mass_matrix", "bias", "inverse_dynamics", "energy", "outputs")
#: Likewise, in modules that are made of them alone: they are long, and few who have the others in batches want these.
DERIVATIVES = ("inverse_dynamics_derivatives",)

#: Width -> instructions it needs on x86-64 beyond those that every such processor has, and their name in
#: eomgen_processor.h.
WIDTHS: dict[int, tuple[tuple[str, ...], str]] = {
    2: ((), ""),
    4: (("avx2",), "EOMGEN_AVX2"),
    8: (("avx512f", "avx512vl", "avx512dq"), "EOMGEN_AVX512"),
}


#: Blocks of which the right-hand side of loops in lanes is made.
CLOSED = (*BY_SYSTEM, *BY_MOTIONS)


def loops_in_lanes(program: Program) -> bool:
    """Whether there are loops whose right-hand side has lanes."""
    driven = {name for d in program.drivers if d.name == "rhs" for name in d.blocks}
    return driven.issuperset(BY_SYSTEM) and not program.given_rates


def rhs_blocks(program: Program) -> list[str]:
    """Names of the blocks of the right-hand side in lanes; none if it has no lanes."""
    if loops_in_lanes(program):
        return [name for name in CLOSED if name in program.block_names]
    rhs = program.twins.get("rhs", "rhs")
    return [rhs] if rhs in public_blocks(program) else []


def public_blocks(program: Program) -> set[str]:
    """Names of the blocks behind public functions that are straight-line code and have lanes."""
    made = {k.name for k in program.kernels}
    wanted = {program.twins.get(name, name) for name in (*LANES, *(DERIVATIVES if made <= {*DERIVATIVES} else ()))}
    return wanted & {program.twins.get(k.name, k.name) for k in program.kernels if isinstance(k, Block)}


def lane_blocks(program: Program) -> dict[str, Block]:
    """The blocks that have lanes, by name; those of the right-hand side first."""
    first = rhs_blocks(program)
    named = public_blocks(program).union(first)
    found = [b for b in program.blocks if b.name in named]
    return {b.name: b for b in sorted(found, key=lambda b: b.name not in first)}


def lane_kernels(program: Program) -> list[str]:
    """Names of the public functions that have lanes."""
    blocks, twins, closed = public_blocks(program), program.twins, loops_in_lanes(program)
    return [k.name for k in program.kernels if twins.get(k.name, k.name) in blocks or (closed and k.name == "rhs")]


def lane_files(program: Program, context: Mapping[str, Any], printed: Mapping[str, Printed]) -> dict[str, str]:
    """The header with the text of the functions, and files for each width; none without such functions.

    A library that stands alone has no ensembles, which take their own ``rhs`` and series.
    """
    blocks, first = lane_blocks(program), rhs_blocks(program)
    if not blocks:
        return {}
    name = program.name
    roots = [y for b in blocks.values() for y in b.roots]
    inside = {
        **context,
        "helpers": [*used_helpers(program, roots), *context["declarations"]],
        "first": with_pieces(printed[b] for b in first),
        "others": with_pieces(printed[b] for b in blocks if b not in first),
        "closed": loops_in_lanes(program),
    }
    call = next((k["call"] for k in context["kernels"] if k["name"] == "rhs"), "")
    ensembles = bool(first) and not context["library"]
    files = {f"{name}_lanes.h": render("c/lanes.h.j2", inside)}
    for width, (tests, feature) in WIDTHS.items():
        shown = {"name": name, "width": width, "tests": tests, "feature": feature, "contracted": ensembles}
        shown["series"] = ensembles and context["series"]
        files[f"{name}_lanes{width}.c"] = render("c/lanes.c.j2", shown)
        if ensembles:
            fused = {**shown, "tests": (*tests, "fma") if tests else (), "call": call}
            files[f"{name}_contracted_lanes{width}.c"] = render("c/contracted.c.j2", fused)
            if shown["series"]:
                files[f"{name}_series_lanes{width}.c"] = render("c/series_lanes.c.j2", fused)
    return files
