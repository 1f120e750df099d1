"""A formula -> LaTeX, text or MathML, and how wide it is."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Callable
from functools import cache, partial
from typing import ClassVar

from ...base.texts import html_text
from ..latex import SUPERSCRIPTS, NotationError, mathml_form, read_latex, text_form
from ..notation import Notation, literal
from . import formula as tree

# -- LaTeX of users ----------------------------------------------------------------------------------------------------

# The pieces between spaces outside braces are symbols and signs of :mod:`eomgen.expr.notation`.


@cache
def bare_mathml(latex: str) -> str:
    """The elements of a formula, without ``<math>``."""
    return "".join(map(_piece, _pieces(latex))).replace("<mo>-</mo>", "<mo>\N{MINUS SIGN}</mo>")


def _pieces(latex: str) -> list[str]:
    result, depth = [""], 0
    for letter in latex:
        depth += (letter == "{") - (letter == "}")
        if letter == " " and depth == 0:
            result.append("")
        else:
            result[-1] += letter
    return [piece for piece in result if piece]


def _piece(latex: str) -> str:
    if latex == r"\quad":
        return "<mspace width='1em'/>"
    try:
        return mathml_form(read_latex(latex))
    except NotationError:
        return f"<mtext>{html_text(latex)}</mtext>"


# -- the writer --------------------------------------------------------------------------------------------------------


class FormulaWriter:
    """Writes the parts of a formula, each kind by the method of its name, with names as they are printed."""

    minus, plus = " - ", " + "  #: between terms
    negative = "-"  #: before a first term that is subtracted
    grouped: Callable[[str], str]  #: in parentheses
    relations: ClassVar[dict[str, str]]  #: signs that are written otherwise

    def __init__(self, names: Notation) -> None:
        self.names = names

    def write(self, formula: tree.Formula) -> str:
        """The text of a formula."""
        return str(getattr(self, type(formula).__name__.lower())(formula))

    def sum(self, formula: tree.Sum) -> str:
        """Terms with their signs."""
        result = ""
        for k, (subtracted, term) in enumerate(formula.terms):
            between = self.minus if subtracted else self.plus
            result += (self.negative * subtracted if k == 0 else between) + self.factor(term)
        return result

    def relation(self, formula: tree.Relation) -> str:
        """Sides with their sign between them."""
        return f" {self.relations.get(formula.sign, formula.sign)} ".join(map(self.write, formula.sides))

    def factor(self, formula: tree.Formula) -> str:
        """A formula in a place where a sum needs parentheses."""
        text = self.write(formula)
        return self.grouped(text) if tree.is_group(formula) else text


# -- LaTeX -------------------------------------------------------------------------------------------------------------


_LATEX = {
    "sin": r"\sin", "cos": r"\cos", "tan": r"\tan", "asin": r"\arcsin", "acos": r"\arccos", "atan": r"\arctan",
    "sinh": r"\sinh", "cosh": r"\cosh", "tanh": r"\tanh", "exp": r"\exp", "ln": r"\ln", "min": r"\min", "max": r"\max",
    "delta": r"\delta",
}  # fmt: skip
_NEXT_ROW = r" \\ "


def latex(formula: tree.Formula, names: Notation) -> str:
    """LaTeX of a formula."""
    return _LatexWriter(names).write(formula)


def fenced(inside: str) -> str:
    """In parentheses that grow with what they hold."""
    tall = r"\frac" in inside or r"\begin" in inside
    return rf"\left({inside}\right)" if tall else f"({inside})"


class _LatexWriter(FormulaWriter):
    grouped = staticmethod(fenced)
    relations: ClassVar = {"<=": r"\le", ">=": r"\ge", "and": r"\wedge", "or": r"\vee"}

    def number(self, part: tree.Number) -> str:
        return rf"{part.digits} \cdot 10^{{{part.power}}}" if part.power else part.digits

    def name(self, part: tree.Name) -> str:
        return self.names.latex(part.name)

    def letter(self, part: tree.Letter) -> str:
        return part.latex

    def words(self, part: tree.Words) -> str:
        return part.latex

    def product(self, formula: tree.Product) -> str:
        result = ""
        for text in map(self.factor, formula.factors):
            result += (r" \cdot " if result and text[0].isdigit() else " " if result else "") + text
        return result

    def quotient(self, formula: tree.Quotient) -> str:
        return rf"\frac{{{self.write(formula.above)}}}{{{self.write(formula.below)}}}"

    def power(self, formula: tree.Power) -> str:
        exponent, base = self.write(formula.exponent), formula.base
        raised = f"^{{{exponent}}}" if len(exponent) > 1 else f"^{exponent}"
        if isinstance(base, tree.Call) and base.function in _LATEX:
            return self.call(base, raised)
        text = self.write(base)
        of_abs = isinstance(base, tree.Call) and base.function == "abs"
        if not of_abs and (not tree.is_simple(base) or "^" in text or "'" in text):
            text = fenced(text)
        return f"{text}{raised}"

    def call(self, formula: tree.Call, power: str = "") -> str:
        inside = ", ".join(map(self.write, formula.arguments))
        if formula.function == "sqrt":
            return rf"\sqrt{{{inside}}}"
        if formula.function == "abs":
            return rf"\left|{inside}\right|"
        name = _LATEX.get(formula.function) or literal(formula.function, "operatorname")
        if len(formula.arguments) == 1 and tree.is_simple(formula.arguments[0]) and formula.function in _LATEX:
            return f"{name}{power} {inside}"
        return f"{name}{power}{fenced(inside)}"

    def piecewise(self, formula: tree.Piecewise) -> str:
        rows = (
            rf"{self.write(value)} & " + (r"\text{otherwise}" if when is None else rf"\text{{if }} {self.write(when)}")
            for value, when in formula.branches
        )
        return rf"\begin{{cases}}{_NEXT_ROW.join(rows)}\end{{cases}}"

    def matrix(self, formula: tree.Matrix) -> str:
        rows = (" & ".join(map(self.write, row)) for row in formula.rows)
        return rf"\begin{{bmatrix}}{_NEXT_ROW.join(rows)}\end{{bmatrix}}"


# -- text --------------------------------------------------------------------------------------------------------------


#: Between factors and within arguments of functions: lines are broken between terms before they are broken there.
TIGHT = "\u00a0"


def text(formula: tree.Formula, names: Notation) -> str:
    """One line of text; factors, and whatever stands in arguments of functions, are ``TIGHT`` apart."""
    return _TextWriter(names).write(formula)


class _TextWriter(FormulaWriter):
    grouped = staticmethod("({})".format)
    relations: ClassVar = {"<=": "≤", ">=": "≥"}

    def number(self, part: tree.Number) -> str:
        return f"{part.digits}e{part.power}" if part.power else part.digits

    def name(self, part: tree.Name) -> str:
        return self.names.text(part.name)

    def letter(self, part: tree.Letter) -> str:
        return text_form(read_latex(part.latex))

    def words(self, part: tree.Words) -> str:
        return part.text

    def product(self, formula: tree.Product) -> str:
        """A fraction of numbers stands at the end: ``m l²/3``."""
        first, others = formula.factors[0], formula.factors[1:]
        if not (
            isinstance(first, tree.Quotient)
            and isinstance(first.above, tree.Number)
            and isinstance(first.below, tree.Number)
        ):
            return TIGHT.join(map(self._atom, formula.factors))
        above = others if first.above == tree.Number("1") else (first.above, *others)
        return f"{self.product(tree.Product(above))}/{self.write(first.below)}"

    def quotient(self, formula: tree.Quotient) -> str:
        return f"{self.factor(formula.above)}/{self._atom(formula.below)}"

    def _atom(self, formula: tree.Formula) -> str:
        """A formula in a place where a product needs parentheses too."""
        return f"({self.write(formula)})" if isinstance(formula, tree.Product) else self.factor(formula)

    def power(self, formula: tree.Power) -> str:
        exponent, base = self.write(formula.exponent), formula.base
        high = exponent.translate(SUPERSCRIPTS) if exponent.isdecimal() else ""
        of_call = isinstance(base, tree.Call)
        if high and isinstance(base, tree.Call) and base.function not in ("abs", "sqrt"):
            return f"{base.function}{high}({self._inside(base)})"
        text = self.write(base)
        plain = isinstance(base, tree.Name | tree.Words) or (of_call and text.startswith("|"))
        text = text if plain and not any(c in text for c in "^*") else f"({text})"
        if high:
            return text + high
        return f"{text}^{exponent}" if exponent.isalnum() else f"{text}^({exponent})"

    def call(self, formula: tree.Call) -> str:
        inside, function = self._inside(formula), formula.function
        if function == "abs":
            return f"|{inside}|"
        rooted = function == "sqrt" and isinstance(formula.arguments[0], tree.Name)
        return f"√{inside}" if rooted else f"{function}({inside})"

    def _inside(self, formula: tree.Call) -> str:
        """Arguments, in which lines are broken last."""
        return ", ".join(map(self.write, formula.arguments)).replace(" ", TIGHT)

    def piecewise(self, formula: tree.Piecewise) -> str:
        parts = (
            f"{self.write(value)} otherwise" if when is None else f"{self.write(value)} if {self.write(when)}"
            for value, when in formula.branches
        )
        return f"{{{'; '.join(parts)}}}"

    def matrix(self, formula: tree.Matrix) -> str:
        return f"[{'; '.join(', '.join(map(self.write, row)) for row in formula.rows)}]"


# -- MathML ------------------------------------------------------------------------------------------------------------


_MATHML_FUNCTIONS = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "delta": "δ"}
MINUS_SIGN = "\u2212"
MINUS = f"<mo>{MINUS_SIGN}</mo>"
TALL = ("<mfrac", "<mtable", "<msqrt")  #: what is higher than a line
_THIN = "<mspace width='0.17em'/>"


def mathml(formula: tree.Formula, names: Notation) -> str:
    """Elements of MathML, without ``<math>``."""
    return _MathMLWriter(names).write(formula)


def row(*parts: str) -> str:
    """Elements side by side, as one."""
    return f"<mrow>{''.join(parts)}</mrow>"


def mathml_fenced(inside: str, left: str = "(", right: str = ")") -> str:
    """In parentheses that grow with what they hold; in a line of text they are those of the font."""
    grows = "" if any(tag in inside for tag in TALL) else " stretchy='false'"
    return row(f"<mo{grows}>{left}</mo>", inside, f"<mo{grows}>{right}</mo>")


def table(rows: list[list[str]], style: str = "") -> str:
    """Cells in rows, each a formula in the size of the text."""
    look = f" style='{style}'" if style else ""
    cells = ("".join(f"<mtd style='padding:0.25em 0.6em'>{cell}</mtd>" for cell in one) for one in rows)
    return f"<mtable displaystyle='true'{look}>{''.join(f'<mtr>{one}</mtr>' for one in cells)}</mtable>"


class _MathMLWriter(FormulaWriter):
    minus, plus, negative = MINUS, "<mo>+</mo>", MINUS
    grouped = staticmethod(mathml_fenced)
    relations: ClassVar = {"<=": "≤", ">=": "≥", "and": "\u2227", "or": "\u2228"}

    def number(self, part: tree.Number) -> str:
        digits = f"<mn>{part.digits}</mn>"
        if not part.power:
            return digits
        return row(digits, f"<mo>·</mo><msup><mn>10</mn><mn>{part.power.replace('-', MINUS_SIGN)}</mn></msup>")

    def name(self, part: tree.Name) -> str:
        return self.names.mathml(part.name)

    def letter(self, part: tree.Letter) -> str:
        return bare_mathml(part.latex)

    def words(self, part: tree.Words) -> str:
        return f"<mtext>{html_text(part.text)}</mtext>"

    def sum(self, formula: tree.Sum) -> str:
        return row(super().sum(formula))

    def product(self, formula: tree.Product) -> str:
        """Factors side by side; a point before one that begins with a digit."""
        result: list[str] = []
        for text in map(self.factor, formula.factors):
            begins = text.removeprefix("<mrow>").removeprefix("<msup>").startswith("<mn>")
            result += [("<mo>·</mo>" if begins else _THIN) if result else "", text]
        return row(*result)

    def quotient(self, formula: tree.Quotient) -> str:
        return f"<mfrac>{row(self.write(formula.above))}{row(self.write(formula.below))}</mfrac>"

    def power(self, formula: tree.Power) -> str:
        exponent, base = self.write(formula.exponent), formula.base
        if isinstance(base, tree.Call) and base.function not in ("sqrt", "abs"):
            return self.call(base, exponent)
        text = self.write(base)
        if not tree.is_simple(base):
            text = mathml_fenced(text)
        if text.startswith("<msub>"):  # one element: the exponent stands above the subscript
            return f"<msubsup>{text.removeprefix('<msub>').removesuffix('</msub>')}{exponent}</msubsup>"
        if text.startswith(("<msup>", "<msubsup>")):
            text = mathml_fenced(text)
        return f"<msup>{text}{exponent}</msup>"

    def call(self, formula: tree.Call, power: str = "") -> str:
        arguments = "<mo>,</mo>".join(map(self.write, formula.arguments))
        if formula.function == "sqrt":
            return f"<msqrt>{arguments}</msqrt>"
        if formula.function == "abs":
            return mathml_fenced(arguments, "|", "|")
        name = f"<mi>{html_text(_MATHML_FUNCTIONS.get(formula.function, formula.function))}</mi>"
        name = f"<msup>{name}{power}</msup>" if power else name
        if len(formula.arguments) == 1 and tree.is_simple(formula.arguments[0]):
            return row(name, _THIN, arguments)
        return row(name, mathml_fenced(arguments))

    def relation(self, formula: tree.Relation) -> str:
        sign = html_text(self.relations.get(formula.sign, formula.sign))
        return row(f"<mo>{sign}</mo>".join(map(self.write, formula.sides)))

    def piecewise(self, formula: tree.Piecewise) -> str:
        rows = []
        for value, when in formula.branches:
            condition = "<mtext>otherwise</mtext>" if when is None else row("<mtext>if&#160;</mtext>", self.write(when))
            rows.append([self.write(value), condition])
        return row("<mo>{</mo>", table(rows, "text-align:left"))

    def matrix(self, formula: tree.Matrix) -> str:
        body = table([list(map(self.write, one)) for one in formula.rows])
        return f"<mrow class='matrix'><mo>[</mo>{body}<mo>]</mo></mrow>"


# -- width -------------------------------------------------------------------------------------------------------------

# Fractions are as wide as the wider of their parts, indices and exponents are small, dots stand above letters. The unit
# is the width of a letter: about half the size of the font, so that 90 letters fill a page of 900 pixels.


PAGE = 88.0  #: letters of a line
LABEL = 4.0  #: of them before a sum in lines: "M_11 ="
SIGN = 2.2  #: between terms
SPACE = 0.4  #: between factors
FENCES = 1.7  #: parentheses
COLUMN = 1.8  #: between the columns of a matrix
INDEX = 0.7  #: size of indices and exponents
_HIGH = {*map(chr, SUPERSCRIPTS.values())}


def width(formula: tree.Formula, names: Notation) -> float:
    """About how many letters wide a formula is."""
    of = partial(width, names=names)

    def factor(part: tree.Formula) -> float:
        return of(part) + FENCES * tree.is_group(part)

    match formula:
        case tree.Number():
            return len(formula.digits) + (SIGN + 2 + INDEX * len(formula.power) if formula.power else 0.0)
        case tree.Name() | tree.Letter() | tree.Words():
            return _of_text(text(formula, names))
        case tree.Sum():
            first = SIGN * formula.terms[0][0]
            return first + sum(factor(x) for _, x in formula.terms) + SIGN * (len(formula.terms) - 1)
        case tree.Product():
            return sum(map(factor, formula.factors)) + SPACE * (len(formula.factors) - 1)
        case tree.Quotient():
            return max(of(formula.above), of(formula.below)) + 2 * SPACE
        case tree.Power():
            simple = tree.is_simple(formula.base) or isinstance(formula.base, tree.Call)
            return of(formula.base) + FENCES * (not simple) + INDEX * of(formula.exponent)
        case tree.Call():
            inside = sum(map(of, formula.arguments)) + SIGN * (len(formula.arguments) - 1)
            if formula.function in ("sqrt", "abs"):
                return inside + FENCES
            fences = SPACE if all(map(tree.is_simple, formula.arguments)) else FENCES
            return len(formula.function) + fences + inside
        case tree.Relation():
            return sum(map(of, formula.sides)) + SIGN * (len(formula.sides) - 1)
        case tree.Piecewise():
            return FENCES + max(of(x) + (of(when) if when else 9.0) + 2 * COLUMN for x, when in formula.branches)
        case tree.Matrix():
            return FENCES + sum(max(map(of, column)) + COLUMN for column in zip(*formula.rows, strict=True))


def _of_text(text: str) -> float:
    """Letters of a name, without what stands above them."""
    total = 0.0
    for c in text:
        small = c in _HIGH or unicodedata.decomposition(c).startswith("<sub>")
        total += 0.0 if c == "'" or unicodedata.combining(c) else INDEX if small else 1.0
    return total


def sums_in_lines(formula: tree.Formula, names: Notation) -> list[tree.Formula]:
    """A sum as sums that are about as wide as a page at most; anything else alone.

    A product with a sum that is wider than a line is multiplied out in as few parts as fit.
    """
    space = PAGE - LABEL
    wide = isinstance(formula, tree.Product) and width(formula, names) > space
    summands = formula.terms if isinstance(formula, tree.Sum) else ((False, formula),) if wide else ()
    terms = [(subtracted, part) for subtracted, term in summands for part in _in_parts(term, names, space)]
    if len(terms) < 2:
        return [formula]
    lines: list[list[tuple[bool, tree.Formula]]] = [[]]
    used = 0.0
    for subtracted, term in terms:
        size = width(term, names) + SIGN
        if used and used + size > space:
            lines.append([])
            used = 0.0
        lines[-1].append((subtracted, term))
        used += size
    return [tree.Sum(tuple(line)) for line in lines]


def latex_lines(formula: tree.Formula, names: Notation) -> list[str]:
    """LaTeX of a formula; of a long sum in lines, each with its sign."""
    lines = [latex(x, names) for x in sums_in_lines(formula, names)]
    return [lines[0], *(x if x.startswith("-") else f"+ {x}" for x in lines[1:])]


def mathml_lines(formula: tree.Formula, names: Notation) -> list[str]:
    """The same in MathML; the sign with which a further line begins is spaced as it is between terms."""
    first, *others = sums_in_lines(formula, names)
    result = [mathml(first, names)]
    for line in others:
        subtracted = isinstance(line, tree.Sum) and line.terms[0][0]
        text = mathml(line, names)
        sign = MINUS_SIGN if subtracted else "+"
        result.append(f"<mo form='infix'>{sign}</mo>{text.replace(MINUS, '', 1) if subtracted else text}")
    return result


def _in_parts(term: tree.Formula, names: Notation, space: float) -> list[tree.Formula]:
    """A product whose widest sum is cut where it is too wide: of a (b + c + d) a (b + c) and a d."""
    if not isinstance(term, tree.Product) or width(term, names) + SIGN <= space:
        return [term]
    sums = [x for x in term.factors if isinstance(x, tree.Sum)]
    if not sums:
        return [term]
    widest = max(sums, key=lambda x: width(x, names))
    others = width(term, names) - width(widest, names)
    if others > space / 2:  # to cut one sum would write the others again and again
        return [term]
    sizes = [width(x, names) + SIGN for _, x in widest.terms]
    each = sum(sizes) / math.ceil(sum(sizes) / (space - others))  # in parts of about the same width
    groups: list[list[tuple[bool, tree.Formula]]] = [[]]
    used = 0.0
    for part, size in zip(widest.terms, sizes, strict=True):
        if groups[-1] and used + size / 2 > each * len(groups):
            groups.append([])
        groups[-1].append(part)
        used += size
    return [tree.Product(tuple(tree.Sum(tuple(g)) if x is widest else x for x in term.factors)) for g in groups]
