"""Formulas of a text -> read by Matplotlib's parser of TeX, which like TeX takes no second superscript."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any

from matplotlib.mathtext import MathTextParser

#: A matrix or cases with none in it, which Matplotlib does not know, and what ends a cell or a line.
INNERMOST = re.compile(r"\\begin\{([a-z]+)\}((?:(?!\\begin\{|\\end\{).)*)\\end\{\1\}", re.S)
ENDS = re.compile(r"&|\\\\")


def require_tex(markdown: str) -> None:
    """Every formula between dollars is one that a TeX reader takes."""
    displays = re.findall(r"\$\$(.+?)\$\$", markdown, re.S)
    inline = re.findall(r"(?<![\\$])\$(?!\$)(.+?)(?<!\\)\$", re.sub(r"\$\$.+?\$\$", "", markdown, flags=re.S), re.S)
    for formula in (*displays, *inline):
        assert not re.search(r"\\text\{[^}]*(?<!\\)[_^&%#]", formula), formula
        for cell in _cells(formula):
            _require(re.sub(r"\\(left|right|displaystyle)\b", "", cell).replace(r"\text{", r"\mathrm{").strip())


def _cells(formula: str) -> Iterator[str]:
    """The cells of all matrices and cases, and the formula with a letter in their places."""
    while found := INNERMOST.search(formula):
        yield from ENDS.split(found[2])
        formula = f"{formula[: found.start()]} x {formula[found.end() :]}"
    yield from ENDS.split(formula)


@cache
def _require(cell: str) -> None:
    read: Any = MathTextParser("path").parse
    read(f"${cell}$") if cell else None
