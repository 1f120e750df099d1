"""Results on stdout, progress and failures on stderr: lines, tables, one JSON object, and the exit code."""

from __future__ import annotations

import functools
import json
import re
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ..base.results import Result, ResultTable, plain
from ..base.texts import aligned_rows, terminal_width, visible
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

if TYPE_CHECKING:
    from ..api.equations import Equations

WIDTH = 120  #: of tables that do not go to a terminal


def say(text: str, err: bool = False) -> None:
    """Lines on stdout or stderr; what does not print is shown as its number, so that no text drives the terminal."""
    click.echo(visible(text), err=err)


def print_json(value: Any) -> None:
    """One JSON object on stdout."""
    click.echo(json.dumps(plain(value), indent=2, allow_nan=False))


def show(
    as_json: bool, values: Mapping[str, Any], *parts: Result | ResultTable | str, files: Sequence[object] | None = ()
) -> None:
    """What a verb found: with --json its values as one object, else its parts in order; last the files it wrote."""
    if as_json:
        print_json({**values, **({"files": list(map(str, files))} if files is not None else {})})
        return
    for part in parts:
        if isinstance(part, ResultTable):
            print_table(part)
        else:
            say(str(part))
        for table in part.tables if isinstance(part, Result) else ():
            print_table(table)
    for file in files or ():
        say(f"wrote {file}")


def print_table(table: ResultTable) -> None:
    """A table on stdout, its last column wrapped on a narrow terminal; one without headings as labels and values."""
    if table.title:
        click.echo("\n" + click.style(visible(table.title), bold=True))
    if not table.columns:
        for fact in aligned_rows([(label, value) for label, value in table.cells]):
            say(fact)
        return
    header, rows = list(table.columns), table.cells
    right = range(1, len(header)) if table.right is None else table.right
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    columns = terminal_width() or WIDTH
    last = len(header) - 1
    if last not in right:
        widths[last] = max(min(widths[last], columns - sum(widths[:last]) - 2 * last - 1), 20)

    def line(cells: Sequence[str]) -> str:
        placed = [
            f"{c:>{w}}" if k in right else f"{c:<{w}}" for k, (c, w) in enumerate(zip(cells, widths, strict=True))
        ]
        return f" {'  '.join(placed)}".rstrip()

    click.echo("\n" + click.style(visible(line(header)), bold=True))
    say(" " + "─" * (sum(widths) + 2 * last))
    for row in rows:
        folded = textwrap.wrap(row[last], widths[last]) or [""]
        say(line([*row[:last], folded[0]]))
        for more in folded[1:]:
            say(line([*[""] * last, more]))


@contextmanager
def stage(name: str) -> Iterator[dict[str, float]]:
    """Show on stderr that a stage runs and how long it took.

    Yields
    ------
    dict of str to float
        To be filled with the seconds of its parts, which are shown too.
    """
    start = perf_counter()
    parts: dict[str, float] = {}
    if sys.stderr.isatty():
        click.echo(f"{name} ...\r", nl=False, err=True)
    try:
        yield parts
    finally:
        if sys.stderr.isatty():
            click.echo("\r\x1b[K", nl=False, err=True)
    detail = ", ".join(f"{part} {seconds:.3f}" for part, seconds in parts.items())
    click.echo(f"{name:<10}{perf_counter() - start:8.3f} s" + (f"   {detail}" if detail else ""), err=True)


def readable_size(size: int) -> str:
    """A number of bytes as people read it."""
    if size < 1000:
        return f"{size} B"
    return f"{size / 1000:.0f} kB" if size < 1_000_000 else f"{size / 1e6:.1f} MB"


def summary(derived: Equations) -> dict[str, Any]:
    """What was derived, as plain values."""
    return {
        "name": derived.name,
        "method": derived.method,
        "choice": derived.choice.operations if derived.choice else None,
        "report": derived.report.to_dict(),
        "operations": {name: count.as_dict() | {"total": count.total} for name, count in derived.operations.items()},
        "system": derived.system_size and dict(zip(("unknowns", "entries"), derived.system_size, strict=True)),
        "seconds": derived.seconds,
    }


def operations_of(derived: Equations) -> Iterator[ResultTable | str]:
    """The operations of each part of the equations: a heading, what was chosen, a table."""
    yield ResultTable((), (), f"equations by {derived.method}: operations")
    if derived.choice:
        yield str(derived.choice)
    if derived.system_size:
        unknowns, entries = derived.system_size
        yield f"a linear system of {unknowns} unknowns with {entries} nonzero entries"
    rows = [
        [name, *map(str, (c.multiplications, c.additions, c.divisions, c.total, sum(c.functions.values())))]
        for name, c in derived.operations.items()
    ]
    yield ResultTable(["", "multiply", "add", "divide", "total", "functions"], rows)


# -- failures ----------------------------------------------------------------------------------------------------------

MODEL, USAGE, TOOLCHAIN, INTEGRATION, BREACH = 1, 2, 3, 4, 5

#: What messages call an argument in Python, and the option it is here.
OPTIONS = {
    "initial={...}": "--set NAME=VALUE",
    "step=,": "--step,",
    "method='moreau'": "--solver moreau",
    "treat any gap as closed (closed=True, --closed)": "treat any gap as closed by --closed",
    "floating=True, or --floating": "--floating",
    "partial=True": "--partial",
    "weights={name: weight}": "--weight NAME=W",
    "weights='mass'": "--mass",
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
    text = name_options(str(error))
    if isinstance(error, ToolchainError):
        extra = [part for part in (error.command, error.output.strip()) if part and part not in text]
        return "\n".join([text, *extra]).splitlines()
    if file and isinstance(error, EomgenError) and not isinstance(error, UsageError | MissingDependencyError):
        text = text if text.startswith(file) else f"{file}: {text}"
    return text.splitlines() or [type(error).__name__]


def name_options(text: str) -> str:
    """A message that names options of the command line instead of Python's arguments."""
    for argument, option in OPTIONS.items():
        text = text.replace(argument, option)
    return re.sub(r"\b(limits|method|precision)='(\w+)'", r"--\1 \2", text)


def to_dict(error: BaseException) -> dict[str, Any]:
    """The failure as plain values, for --json."""
    problems = [p._asdict() for p in error.problems] if isinstance(error, ModelError) else []
    return {
        "error": {
            "type": type(error).__name__,
            "code": getattr(error, "code", "EG-FILE"),
            "exit_code": exit_code(error),
            "message": name_options(str(error)),
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
            if kwargs.get("as_json"):
                print_json(to_dict(error))
            for line in lines_of(error, str(kwargs.get("model") or "")):
                say(line, err=True)
            sys.exit(exit_code(error))

    return wrapped  # type: ignore[return-value]
