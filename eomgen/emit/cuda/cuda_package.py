"""Stage emit, CUDA: Program -> a Python package that compiles its text by NVRTC and runs it through cuda-core."""

from __future__ import annotations

from typing import Any

from ...program import Program
from ...targets import CUDA_REQUIREMENTS, TIMED_ON_DEVICE
from ..carried import carry
from ..sources import render
from .device_text import describe_device, emit_device_text


def cuda_package(program: Program, context: dict[str, Any]) -> dict[str, str]:
    """``__init__.py``, ``<name>.cu``, and what of eomgen they need."""
    facts = describe_device(program)
    context = context | {"facts": facts, "requirements": CUDA_REQUIREMENTS, "timed": TIMED_ON_DEVICE}
    init = render("cuda/__init__.py.j2", context)
    found = carry({"__init__.py": init})
    context |= {"folders": sorted({name.partition("/")[0] for name in found if "/" in name})}
    return {
        "py.typed": "",
        "__init__.py": init,
        f"{program.name}.cu": emit_device_text(program),
        "pyproject.toml": render("cuda/pyproject.toml.j2", context),
        "README.md": render("cuda/README.md.j2", context),
        **found,
    }
