"""Formulas of a text -> read by Matplotlib's parser of TeX, which like TeX takes no second superscript."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from matplotlib.mathtext import MathTextParser

#: What Matplotlib does not know, and which ends a cell of a matrix or a line of aligned equations.
CELLS = re.compile(r"\\begin\{[a-z]+\}|\\end\{[a-z]+\}|&|\\\\")


def require_tex(markdown: str) -> None:
    """Every formula between dollars is one that a TeX reader takes."""
    displays = re.findall(r"\$\$(.+?)\$\$", markdown, re.S)
    inline = re.findall(r"(?<![\\$])\$(?!\$)(.+?)(?<!\\)\$", re.sub(r"\$\$.+?\$\$", "", markdown, flags=re.S), re.S)
    for formula in (*displays, *inline):
        assert not re.search(r"\\text\{[^}]*(?<!\\)[_^&%#]", formula), formula
        for cell in CELLS.split(formula):
            _require(re.sub(r"\\(left|right|displaystyle)\b", "", cell).replace(r"\text{", r"\mathrm{").strip())


@cache
def _require(cell: str) -> None:
    read: Any = MathTextParser("path").parse
    read(f"${cell}$") if cell else None
