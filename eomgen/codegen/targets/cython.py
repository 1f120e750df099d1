"""Target cython: Program -> a library of one model, written, compiled and loaded here, or taken from the cache."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...alone import alone, timed
from ...compilation import Options, compile_model, load_core
from ...compilation.native_faults import blame_source
from ...compilation.shortcut import Shortcut
from ...errors import ToolchainError, no_such
from ...graph.functions import Function
from ..fingerprint import fingerprint
from ..program import Program


def load(
    program: Program, options: Mapping[str, Any], seconds: dict[str, float], functions: Mapping[str, Function]
) -> Any:
    """Emit, compile and load; a fault in the C source of one of the functions is reported at its place."""
    allowed = Options.__dataclass_fields__
    unknown = [name for name in options if name not in allowed]
    if unknown:
        raise no_such(f"no option {', '.join(unknown)}; there are: {', '.join(allowed)}")
    chosen = Options(**options)
    with alone(), timed(seconds, "emit"):
        shortcut = Shortcut(fingerprint(program), chosen)
        artifact = shortcut.find()
        if artifact is None:
            from ..c import emit_c
            from ..files import keep_bytecode

            keep_bytecode(shortcut.cache.templates)
            sources = emit_c(program)
    with timed(seconds, "compile"):
        if artifact is None:
            try:
                artifact = compile_model(sources, program.name, chosen)
            except ToolchainError as error:
                raise blame_source(error, functions.values()) or error from None
            shortcut.keep(artifact)
    with alone(), timed(seconds, "load"):
        return load_core(artifact)
