"""Stage emit: the straight-line functions of a model once more, for several states side by side (lanes)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..program import Block, Program
from .c_functions import declarations, used_calls
from .c_text import used_helpers
from .sources import render

#: Public functions that have lanes where they are straight-line code.
LANES = ("rhs", "mass_matrix", "bias", "inverse_dynamics", "energy", "outputs")

#: Width -> instructions it needs on x86-64 beyond those that every such processor has, and their name in
#: eomgen_processor.h.
WIDTHS: dict[int, tuple[tuple[str, ...], str]] = {
    2: ((), ""),
    4: (("avx2",), "EOMGEN_AVX2"),
    8: (("avx512f", "avx512vl", "avx512dq"), "EOMGEN_AVX512"),
}


def lane_blocks(program: Program) -> dict[str, Block]:
    """The blocks that have lanes, by name."""
    wanted = {program.twins.get(name, name) for name in LANES}
    public = {program.twins.get(k.name, k.name) for k in program.kernels if isinstance(k, Block)}
    return {b.name: b for b in program.blocks if b.name in wanted & public}


def lane_kernels(program: Program) -> list[str]:
    """Names of the public functions that have lanes."""
    blocks, twins = lane_blocks(program), program.twins
    return [k.name for k in program.kernels if twins.get(k.name, k.name) in blocks]


def lane_files(program: Program, context: Mapping[str, Any]) -> dict[str, str]:
    """The header with the text of the functions, and a file for each width; none without such functions."""
    blocks = lane_blocks(program)
    if not blocks:
        return {}
    name = program.name
    rhs = program.twins.get("rhs", "rhs")
    blocks = dict(sorted(blocks.items(), key=lambda item: item[0] != rhs))
    roots = [y for b in blocks.values() for y in (*b.outputs, *b.checks)]
    inside = {
        **context,
        "helpers": [*used_helpers(program, roots), *declarations(program, used_calls(program))],
        "blocks": [context["printed"][b] for b in blocks],
        "alone": rhs in blocks,
    }
    files = {f"{name}_lanes.h": render("c/lanes.h.j2", inside)}
    for width, (tests, feature) in WIDTHS.items():
        shown = {"name": name, "width": width, "tests": tests, "feature": feature, "contracted": rhs in blocks}
        shown["series"] = context["series"]
        files[f"{name}_lanes{width}.c"] = render("c/lanes.c.j2", shown)
        if rhs in blocks:
            fused = {**shown, "tests": (*tests, "fma") if tests else (), "call": f"{rhs}_block"}
            files[f"{name}_contracted_lanes{width}.c"] = render("c/contracted.c.j2", fused)
            if context["series"]:
                files[f"{name}_series_lanes{width}.c"] = render("c/series_lanes.c.j2", fused)
    return files
