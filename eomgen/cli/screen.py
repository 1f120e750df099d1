"""Stage cli, screen: results -> stdout, progress -> stderr."""

from __future__ import annotations

import json
import sys
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import isfinite
from time import perf_counter
from typing import Any

import click

from ..base.texts import aligned_rows, terminal_width, visible

WIDTH = 120  #: of tables that do not go to a terminal


def say(text: str, err: bool = False) -> None:
    """Lines on stdout or stderr; what does not print is shown as its number, so that no text drives the terminal."""
    click.echo(visible(text), err=err)


def print_json(value: Any) -> None:
    """One JSON object on stdout."""
    click.echo(json.dumps(value, indent=2, allow_nan=False, default=_plain))


def _plain(value: Any) -> Any:
    """NumPy scalars and arrays, tuples and paths as what JSON knows."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def print_heading(text: str) -> None:
    """A heading on stdout."""
    click.echo("\n" + click.style(visible(text), bold=True))


def print_rows(rows: Sequence[tuple[str, str]]) -> None:
    """Label and value pairs on stdout, aligned; on a terminal, long values go on below."""
    for line in aligned_rows(rows):
        say(line)


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[int] = ()) -> None:
    """A table on stdout; the columns in ``right`` are aligned to the right, the last one wraps on a narrow terminal."""
    columns = list(zip(header, *rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    room = terminal_width() or WIDTH
    last = len(header) - 1
    if last not in right:
        widths[last] = max(min(widths[last], room - sum(widths[:last]) - 2 * last - 1), 20)

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


def finite(value: float) -> float | None:
    """A number that JSON can hold: None stands for what is not finite."""
    number = float(value)
    return number if isfinite(number) else None
