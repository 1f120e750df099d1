"""Stage explain, texts of formulas: LaTeX that the sections write -> MathML.

The pieces between spaces outside braces are symbols and signs of :mod:`eomgen.notation`.
"""

from __future__ import annotations

from functools import cache

from ..notation import NotationError, read_latex
from ..notation.printing import mathml_form
from ..texts import html_text


@cache
def text_to_mathml(latex: str) -> str:
    """The elements of a formula, without ``<math>``."""
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


def number_latex(value: float, digits: int = 6) -> str:
    r"""A number: ``0.35``, ``-1.2\cdot10^{-5}``."""
    mantissa, _, exponent = f"{value + 0.0:.{digits}g}".partition("e")
    return rf"{mantissa}\cdot10^{{{int(exponent)}}}" if exponent else mantissa


def number_mathml(value: float, digits: int = 6) -> str:
    """A number as elements of MathML."""
    mantissa, _, exponent = f"{value + 0.0:.{digits}g}".partition("e")
    sign = "<mo form='prefix'>\N{MINUS SIGN}</mo>" if mantissa.startswith("-") else ""
    found = f"{sign}<mn>{mantissa.lstrip('-')}</mn>"
    if not exponent:
        return found
    power = int(exponent)
    raised = f"<mrow><mo>\N{MINUS SIGN}</mo><mn>{-power}</mn></mrow>" if power < 0 else f"<mn>{power}</mn>"
    return f"{found}<mo>·</mo><msup><mn>10</mn>{raised}</msup>"
