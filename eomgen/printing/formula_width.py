"""Printing, width: a formula -> about how wide it is when it is set, and a long sum -> lines.

Fractions are as wide as the wider of their parts, indices and exponents are small, dots stand above letters.  The unit
is the width of a letter: about half the size of the font, so that 90 letters fill a page of 900 pixels.
"""

from __future__ import annotations

import math
import unicodedata

from ..base.latex import SUPERSCRIPTS
from ..base.notation import Notation
from . import formula_tree as tree
from .formula_text import text

PAGE = 88.0  #: letters of a line
LABEL = 4.0  #: of them before a sum in lines: "M_11 ="
SIGN = 2.2  #: between terms
SPACE = 0.4  #: between factors
FENCES = 1.7  #: parentheses
COLUMN = 1.8  #: between the columns of a matrix
INDEX = 0.7  #: size of indices and exponents
_HIGH = {*map(chr, SUPERSCRIPTS.values())}


def width(formula: tree.Formula, names: Notation) -> float:
    """About how many letters wide a formula is.

    Parameters
    ----------
    formula : Formula
    names : Notation
    """

    def of(part: tree.Formula) -> float:
        return width(part, names)

    def factor(part: tree.Formula) -> float:
        return of(part) + FENCES * tree.is_group(part)

    match formula:
        case tree.NumberPart():
            return len(formula.digits) + (SIGN + 2 + INDEX * len(formula.power) if formula.power else 0.0)
        case tree.Name() | tree.Letter() | tree.Words():
            return _of_text(text(formula, names))
        case tree.SumOf():
            first = SIGN * formula.terms[0][0]
            return first + sum(factor(x) for _, x in formula.terms) + SIGN * (len(formula.terms) - 1)
        case tree.Product():
            return sum(map(factor, formula.factors)) + SPACE * (len(formula.factors) - 1)
        case tree.Quotient():
            return max(of(formula.above), of(formula.below)) + 2 * SPACE
        case tree.Power():
            simple = tree.is_simple(formula.base) or isinstance(formula.base, tree.CallOf)
            return of(formula.base) + FENCES * (not simple) + INDEX * of(formula.exponent)
        case tree.CallOf():
            inside = sum(map(of, formula.arguments)) + SIGN * (len(formula.arguments) - 1)
            if formula.function in ("sqrt", "abs"):
                return inside + FENCES
            fences = SPACE if all(map(tree.is_simple, formula.arguments)) else FENCES
            return len(formula.function) + fences + inside
        case tree.Relation():
            return sum(map(of, formula.sides)) + SIGN * (len(formula.sides) - 1)
        case tree.CasesOf():
            return FENCES + max(of(x) + (of(when) if when else 9.0) + 2 * COLUMN for x, when in formula.branches)
        case tree.MatrixOf():
            return FENCES + sum(max(map(of, column)) + COLUMN for column in zip(*formula.rows, strict=True))


def _of_text(shown: str) -> float:
    """Letters of a name, without what stands above them."""
    total = 0.0
    for c in shown:
        small = c in _HIGH or unicodedata.decomposition(c).startswith("<sub>")
        total += 0.0 if c == "'" or unicodedata.combining(c) else INDEX if small else 1.0
    return total


def sums_in_lines(formula: tree.Formula, names: Notation, room: float = PAGE - LABEL) -> list[tree.Formula]:
    """A sum as sums that are about as wide as a page at most; anything else alone.

    A product with a sum that is wider than a line is multiplied out in as few parts as fit.
    """
    wide = isinstance(formula, tree.Product) and width(formula, names) > room
    given = formula.terms if isinstance(formula, tree.SumOf) else ((False, formula),) if wide else ()
    terms = [(subtracted, part) for subtracted, term in given for part in _in_parts(term, names, room)]
    if len(terms) < 2:
        return [formula]
    lines: list[list[tuple[bool, tree.Formula]]] = [[]]
    used = 0.0
    for subtracted, term in terms:
        size = width(term, names) + SIGN
        if used and used + size > room:
            lines.append([])
            used = 0.0
        lines[-1].append((subtracted, term))
        used += size
    return [tree.SumOf(tuple(line)) for line in lines]


def _in_parts(term: tree.Formula, names: Notation, room: float) -> list[tree.Formula]:
    """A product whose widest sum is cut where it is too wide: of a (b + c + d) a (b + c) and a d."""
    if not isinstance(term, tree.Product) or width(term, names) + SIGN <= room:
        return [term]
    sums = [x for x in term.factors if isinstance(x, tree.SumOf)]
    if not sums:
        return [term]
    widest = max(sums, key=lambda x: width(x, names))
    others = width(term, names) - width(widest, names)
    if others > room / 2:  # to cut one sum would write the others again and again
        return [term]
    sizes = [width(x, names) + SIGN for _, x in widest.terms]
    each = sum(sizes) / math.ceil(sum(sizes) / (room - others))  # in parts of about the same width
    groups: list[list[tuple[bool, tree.Formula]]] = [[]]
    used = 0.0
    for part, size in zip(widest.terms, sizes, strict=True):
        if groups[-1] and used + size / 2 > each * len(groups):
            groups.append([])
        groups[-1].append(part)
        used += size
    return [tree.Product(tuple(tree.SumOf(tuple(g)) if x is widest else x for x in term.factors)) for g in groups]
