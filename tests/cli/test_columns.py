"""The variable COLUMNS sets the width of what is printed, into a pipe too."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from forked import run_python

MODEL = Path(__file__).parents[2] / "examples" / "double_wishbone.yaml"


def printed(columns: str | None, *words: str) -> list[str]:
    """Lines of a call whose output is a pipe."""
    setting = {key: value for key, value in os.environ.items() if key != "COLUMNS"}
    if columns is not None:
        setting["COLUMNS"] = columns
    done = run_python("-m", "eomgen", *words, env=setting)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def longest(lines: list[str]) -> int:
    return max(len(line) for line in lines)


@pytest.mark.parametrize("words", [("check", str(MODEL)), ("run", "--help")])
def test_lines_are_as_long_as_columns_says(words: tuple[str, ...]) -> None:
    narrow = printed("60", *words)
    assert longest(narrow) <= 62
    assert longest(printed(None, *words)) > longest(narrow)


def test_what_is_no_width_is_left_out() -> None:
    wide = printed(None, "check", str(MODEL))
    for nothing in ("0", "-3", "many", ""):
        assert printed(nothing, "check", str(MODEL)) == wide
    assert printed("1", "check", str(MODEL)) == printed("40", "check", str(MODEL))  # never narrower than can be read
