"""The terminal that results are printed to, and lines as long as it is wide."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from textwrap import wrap

NARROWEST = 40  #: characters of a line, however narrow the terminal is


def terminal_width() -> int | None:
    """Characters of a line: what the variable ``COLUMNS`` says, else the width of the terminal that is printed to.

    None where the standard output is a file, a pipe or a notebook and ``COLUMNS`` is no positive number.
    """
    said = os.environ.get("COLUMNS", "")
    if not sys.stdout.isatty() and not (said.isdecimal() and int(said) > 0):
        return None
    return max(shutil.get_terminal_size().columns, NARROWEST)  # which looks at COLUMNS first


def fold(text: str, width: int, first: str = "", rest: str = "") -> list[str]:
    """The text in lines of at most so many characters, broken between words; each begins with ``first`` or ``rest``."""
    return wrap(
        text, width, initial_indent=first, subsequent_indent=rest, break_long_words=False, break_on_hyphens=False
    )


def aligned_rows(rows: Sequence[tuple[str, str]]) -> list[str]:
    """Lines of labels and values, the values aligned; on a terminal, long values go on in the lines below."""
    label_width = max((len(label) for label, _ in rows), default=0) + 4
    width = terminal_width()
    lines: list[str] = []
    for label, value in rows:
        first = f"  {label}".ljust(label_width)
        folded = fold(value, max(width, label_width + 20), first, " " * label_width) if width else []
        lines += folded or [first + value]
    return lines
