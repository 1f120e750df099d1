"""Target cython: Program -> a library of one model, written, compiled and loaded here, or taken from the cache."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from ...errors import ModelError, Problem, ToolchainError, no_such
from ...expr.functions import Function
from ...expr.without_gc import timed, without_gc
from ...toolchain.build import compile_sources, key_of_program
from ...toolchain.cache import Cache, cache_directory
from ...toolchain.compiler import Options
from ...toolchain.load import load_core
from ..build import fingerprint
from ..program import Program


def load(
    program: Program, options: Mapping[str, Any], seconds: dict[str, float], functions: Mapping[str, Function]
) -> Any:
    """Emit, compile and load; a fault in the C source of one of the functions is reported at its place."""
    allowed = Options.__dataclass_fields__
    unknown = [name for name in options if name not in allowed]
    if unknown:
        raise no_such(f"no option {', '.join(unknown)}; there are: {', '.join(allowed)}")
    chosen, cache = Options(**options), Cache(cache_directory())
    with without_gc(), timed(seconds, "emit"):
        key = key_of_program(fingerprint(program), chosen)
        entry = None if key is None else cache.find(key)
        if entry is None:
            from ..c import emit_c
            from ..files import keep_bytecode

            keep_bytecode(cache.templates)
            sources = emit_c(program)
    with timed(seconds, "compile"):
        if entry is None:
            try:
                entry = compile_sources("model", sources, program.name, chosen, key=key)
            except ToolchainError as error:
                raise _blame_source(error, functions.values()) or error from None
    with without_gc(), timed(seconds, "load"):
        return load_core(entry)


def _blame_source(error: ToolchainError, functions: Iterable[Function]) -> ModelError | None:
    """The faults of users' C sources that a compiler reported, at their lines; None if it reports others."""
    remedy = "correct the C source; it may include system headers only, and a function is double f(double, ...)"
    problems: dict[tuple[str, int, str], Problem] = {}
    for function in functions:
        if function.native is None:
            continue
        file = function.native.file
        line = rf"^(?:.*[/\\])?{re.escape(file)}:(\d+):(?:\d+:)? *(?:fatal )?error: *(.*)$"
        reported = re.findall(line, error.output, re.MULTILINE)
        for number, message in dict(reversed(reported)).items():  # the first of each line
            what = f"the compiler says: {message}"
            place = f"functions.{function.name}"
            problem = Problem(place, what, remedy, file, int(number), code="EG-COMPILER-FAILED")
            problems.setdefault((file, int(number), what), problem)  # of functions that share a file, the first
    return ModelError([problems[key] for key in sorted(problems)]) if problems else None
