"""Target c: Program -> a C library that stands alone, what builds it, and a program that steps it in real time."""

from __future__ import annotations

from typing import Any

from ..c import emit_c
from ..files import example_state, number_texts, render
from ..program import Program
from ..standalone_c import in_single_precision


def c_library(program: Program, context: dict[str, Any]) -> dict[str, str]:
    """Sources, headers, Makefile, CMakeLists.txt, README."""
    name, precision = program.name, context["precision"]
    sources = dict(emit_c(program, precision))
    c_files = [file for file in sources if file.endswith(".c")]
    context |= {
        "c_files": c_files,
        "object_files": [f"{file.removesuffix('.c')}.o" for file in c_files],
        "x_values": number_texts(example_state(program)),
        "has_step": "rhs" in {k.name for k in program.kernels},
    }
    example = {f"{name}_real_time.c": render("c/real_time.c.j2", context)} if context["has_step"] else {}
    return {
        **sources,
        **(in_single_precision(example) if precision == "float" else example),
        "Makefile": render("c/Makefile.j2", context),
        "CMakeLists.txt": render("c/CMakeLists.txt.j2", context),
        "README.md": render("c/README.md.j2", context),
    }
