"""What the compiler says of a user's C -> a ModelError that names the user's file, line and function."""

from __future__ import annotations

import re
from collections.abc import Iterable

from ..errors import ModelError, Problem, ToolchainError
from ..graph.functions import Function

REMEDY = "correct the C source; it may include system headers only, and a function is double f(double, ...)"


def blame_source(error: ToolchainError, functions: Iterable[Function]) -> ModelError | None:
    """The fault of the users' sources that a compiler found, or None if it found another.

    Parameters
    ----------
    error : ToolchainError
        With the compiler's output.
    functions : iterable of Function
        Those called by the model.
    """
    problems = []
    for function in functions:
        if function.native is None:
            continue
        file = function.native.file
        said = rf"^(?:.*[/\\])?{re.escape(file)}:(\d+):(?:\d+:)? *(?:fatal )?error: *(.*)$"
        found = re.findall(said, error.output, re.MULTILINE)
        for line, words in dict(reversed(found)).items():  # the first of each line
            problems.append(
                Problem(
                    f"functions.{function.name}",
                    f"the compiler says: {words}",
                    REMEDY,
                    file,
                    int(line),
                    code="EG-COMPILER-FAILED",
                )
            )
    unique = {(p.file, p.line, p.message): p for p in reversed(problems)}  # of functions that share a file, the first
    return ModelError(sorted(unique.values(), key=lambda p: (p.file, p.line))) if problems else None
