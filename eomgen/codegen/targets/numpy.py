"""Target numpy: Program -> a core of Python functions, loaded in this process."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...alone import alone, timed
from ...compilation.numpy_module import load_numpy
from ...emit import emit_numpy
from ...emit.numpy_functions import twins
from ...errors import cannot
from ...graph.functions import Function
from ...program import Program


def load(
    program: Program, options: Mapping[str, Any], seconds: dict[str, float], functions: Mapping[str, Function]
) -> Any:
    """Emit and load."""
    if options:
        raise cannot(f"target 'numpy' has no options, and these are given: {', '.join(options)}")
    with alone(), timed(seconds, "emit"):
        sources = emit_numpy(program)
    with timed(seconds, "load"):
        return load_numpy(sources, program.name, twins(program))
