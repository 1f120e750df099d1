"""Stage cli, failures: an exception of eomgen -> plain lines on stderr, an object if --json, and the exit code."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from ..errors import (
    EomgenError,
    EvaluationError,
    MissingDependencyError,
    ModelError,
    ParameterError,
    SimulationError,
    ToolchainError,
    UsageError,
)

MODEL, USAGE, TOOLCHAIN, INTEGRATION, BREACH = 1, 2, 3, 4, 5

#: What messages call an argument in Python, and the option it is here.
OPTIONS = {
    "initial={...}": "--set NAME=VALUE",
    "step=,": "--step,",
    "limits=True": "--within-limits",
    "; give limits={name: ..}": "",
    "method='embedding'": "--method embedding",
    "method='moreau'": "--solver moreau",
    "leave dense_output out and give t_eval, or take DOP853, RK45 or Radau in compiled code": "leave --plot out, "
    "or take --solver DOP853, RK45 or Radau with --target cython",
}

Verb = TypeVar("Verb", bound=Callable[..., Any])


def exit_code(error: BaseException) -> int:
    """The exit code that says which kind of failure this is."""
    if isinstance(error, ParameterError):
        return MODEL
    if isinstance(error, UsageError | OSError):
        return USAGE
    if isinstance(error, ToolchainError | MissingDependencyError):
        return TOOLCHAIN
    if isinstance(error, SimulationError):
        return INTEGRATION
    return MODEL


def lines_of(error: BaseException, file: str = "") -> list[str]:
    """What to print: one line a fault, ``FILE:LINE: path: ...`` where a place in a model file is known."""
    if isinstance(error, ModelError):
        prefix = f"{file}: " if file else ""
        return [str(p) if p.file else f"{prefix}{p}" for p in error.problems]
    if isinstance(error, OSError) and error.strerror:
        return [f"{error.filename}: {error.strerror}" if error.filename else error.strerror]
    text = told(error)
    if isinstance(error, ToolchainError):
        extra = [part for part in (error.command, error.output.strip()) if part and part not in text]
        return "\n".join([text, *extra]).splitlines()
    if file and isinstance(error, EomgenError) and not isinstance(error, UsageError | MissingDependencyError):
        text = text if text.startswith(file) else f"{file}: {text}"
    return text.splitlines() or [type(error).__name__]


def told(error: BaseException) -> str:
    """The message of an exception in the words of the command line."""
    text = str(error)
    for argument, option in OPTIONS.items():
        text = text.replace(argument, option)
    return text


def to_dict(error: BaseException) -> dict[str, Any]:
    """The failure as plain values, for --json."""
    problems = [p._asdict() for p in error.problems] if isinstance(error, ModelError) else []
    return {
        "error": {
            "type": type(error).__name__,
            "code": getattr(error, "code", "EG-FILE"),
            "exit_code": exit_code(error),
            "message": told(error),
            "problems": problems,
        }
    }


@contextmanager
def after_integration() -> Iterator[None]:
    """Turn a kernel's failure at a state of the run into a failure of the integration."""
    try:
        yield
    except EvaluationError as error:
        raise SimulationError(f"the run cannot be evaluated: {error}") from error


def reports_failures(verb: Verb) -> Verb:
    """Make a verb leave with lines and an exit code instead of a traceback, when eomgen raised the error on purpose."""

    @functools.wraps(verb)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        try:
            return verb(*args, **kwargs)
        except BrokenPipeError:
            raise
        except (EomgenError, OSError) as error:
            from . import screen

            if kwargs.get("as_json"):
                screen.print_json(to_dict(error))
            for line in lines_of(error, str(kwargs.get("model") or "")):
                screen.say(line, err=True)
            sys.exit(exit_code(error))

    return wrapped  # type: ignore[return-value]
