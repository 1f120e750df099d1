"""Stage cli, screen: results -> stdout, progress -> stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import isfinite
from time import perf_counter
from typing import Any

import click

WIDTH = 120  #: of tables that do not go to a terminal


def print_json(value: Any) -> None:
    """One JSON object on stdout."""
    click.echo(json.dumps(value, indent=2, allow_nan=False, default=_plain))


def _plain(value: Any) -> Any:
    """NumPy scalars and arrays, tuples and paths as what JSON knows."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def print_heading(text: str) -> None:
    """A heading on stdout."""
    click.echo("\n" + click.style(text, bold=True))


def print_rows(rows: Sequence[tuple[str, str]]) -> None:
    """Label and value pairs on stdout, aligned."""
    width = max((len(label) for label, _ in rows), default=0) + 2
    for label, value in rows:
        click.echo(f"  {label:<{width}}{value}")


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[int] = ()) -> None:
    """A table on stdout; the columns in ``right`` are aligned to the right."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for k, name in enumerate(header):
        table.add_column(name, justify="right" if k in right else "left")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    Console(width=None if sys.stdout.isatty() else WIDTH).print(table)


@contextmanager
def stage(name: str) -> Iterator[dict[str, float]]:
    """Show on stderr that a stage runs and how long it took; on a terminal with a moving sign meanwhile.

    Yields
    ------
    dict of str to float
        To be filled with the seconds of its parts, which are shown too.
    """
    start = perf_counter()
    parts: dict[str, float] = {}
    if sys.stderr.isatty():
        from rich.console import Console

        with Console(stderr=True).status(name):
            yield parts
    else:
        yield parts
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
