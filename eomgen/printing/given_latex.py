"""Printing, given LaTeX: short formulas that are written as LaTeX -> MathML.

The pieces between spaces outside braces are symbols and signs of :mod:`eomgen.base.notation`.
"""

from __future__ import annotations

from functools import cache

from ..base.latex import NotationError, mathml_form, read_latex
from ..base.texts import html_text


@cache
def given_mathml(latex: str) -> str:
    """The elements of a formula, without ``<math>``.

    Parameters
    ----------
    latex : str
    """
    return "".join(map(_piece, _pieces(latex))).replace("<mo>-</mo>", "<mo>\N{MINUS SIGN}</mo>")


def _pieces(latex: str) -> list[str]:
    found, depth = [""], 0
    for letter in latex:
        depth += (letter == "{") - (letter == "}")
        if letter == " " and depth == 0:
            found.append("")
        else:
            found[-1] += letter
    return [piece for piece in found if piece]


def _piece(latex: str) -> str:
    if latex == r"\quad":
        return "<mspace width='1em'/>"
    try:
        return mathml_form(read_latex(latex))
    except NotationError:
        return f"<mtext>{html_text(latex)}</mtext>"
