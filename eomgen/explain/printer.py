"""Stage explain, printing: sides of formulas and a notation -> LaTeX and MathML."""

from __future__ import annotations

from typing import Any
from xml.dom.minidom import parseString

import sympy
from sympy.printing.latex import LatexPrinter
from sympy.printing.mathml import MathMLPresentationPrinter

from ..notation import Notation
from .document import FormulaLine, PutIn
from .formula_text import number_latex, number_mathml, text_to_mathml

WIDE = 110  #: characters of LaTeX, without commands, after which a sum goes on in the next line
#: What SymPy writes -> what browsers draw well; it does not escape signs of comparison.
_BETTER = (
    ("<mo>&InvisibleTimes;</mo>", "<mspace width='0.17em'/>"),
    ("<mo>-</mo>", "<mo>\N{MINUS SIGN}</mo>"),
    ("<mn>-", "<mo>\N{MINUS SIGN}</mo><mn>"),
    ("<mo><</mo>", "<mo>&lt;</mo>"),
    ("<mo>></mo>", "<mo>&gt;</mo>"),
)


SHORT = 14  #: nodes of a side that leaves room for another one in its line


def is_short(formula: FormulaLine) -> bool:
    """Whether all sides go into one line."""
    values = [side.expression if isinstance(side, PutIn) else side for side in formula.sides]
    kept = [x for x in values if isinstance(x, sympy.Basic | sympy.MatrixBase)]
    return all(sum(1 for _ in sympy.preorder_traversal(x)) <= SHORT for x in kept)


class _Latex(LatexPrinter):  # type: ignore[misc]  # SymPy has no types
    """SymPy's printer, with numbers of few digits."""

    def _print_Float(self, expr: Any) -> str:
        return number_latex(float(expr), 12)


class _MathML(MathMLPresentationPrinter):  # type: ignore[misc]
    """SymPy's printer, with the symbols of a notation."""

    def __init__(self, printed: dict[Any, str], settings: dict[str, Any]) -> None:
        super().__init__(settings)
        self.printed = printed

    def _elements(self, text: str) -> Any:
        row: Any = parseString(f"<mrow>{text}</mrow>".encode()).documentElement
        return row.firstChild if len(row.childNodes) == 1 else row

    def _print_Symbol(self, sym: Any, style: str = "plain") -> Any:
        text = self.printed.get(sym)
        return super()._print_Symbol(sym, style) if text is None else self._elements(text)

    def _print_Float(self, expr: Any) -> Any:
        return self._elements(number_mathml(float(expr), 12))

    def _print_Piecewise(self, expr: Any) -> Any:
        table = self.dom.createElement("mtable")
        for value, condition in expr.args:
            row = self.dom.createElement("mtr")
            when = self._elements("<mtext>else</mtext>") if condition is sympy.true else self._print(condition)
            for part in (self._print(value), when):
                cell = self.dom.createElement("mtd")
                cell.appendChild(part)
                row.appendChild(cell)
            table.appendChild(row)
        found = self.dom.createElement("mrow")
        found.appendChild(self._elements("<mo>{</mo>"))
        found.appendChild(table)
        found.appendChild(self._elements("<mo>}</mo>"))
        return found

    def _print_MatrixBase(self, m: Any) -> Any:
        table = self.dom.createElement("mtable")
        table.setAttribute("class", "matrix")
        table.setAttribute("displaystyle", "true")
        for i in range(m.rows):
            row = self.dom.createElement("mtr")
            for j in range(m.cols):
                cell = self.dom.createElement("mtd")
                cell.appendChild(self._print(m[i, j]))
                row.appendChild(cell)
            table.appendChild(row)
        return table


class Printer:
    """LaTeX and MathML of the sides of formulas, in one notation."""

    def __init__(self, notation: Notation) -> None:
        self.notation = notation
        self._symbols: dict[Any, tuple[str, str]] = {}

    def sign(self, name: str, latex: str) -> Any:
        """A SymPy symbol that is printed as the LaTeX says."""
        symbol = sympy.Symbol(name, commutative=False)  # which are printed after all other factors
        self._symbols[symbol] = latex, text_to_mathml(latex)
        return symbol

    def latex(self, side: Any) -> str:
        """LaTeX of a side, without dollars."""
        if isinstance(side, str):
            return side
        if isinstance(side, float | int):
            return number_latex(side)
        expression, printed = self._printed(side)
        names = {symbol: forms[0] for symbol, forms in printed.items()}
        times = {"mul_symbol": "dot"} if isinstance(side, PutIn) else {}
        return str(_Latex({"symbol_names": names, "mat_str": "matrix", **times}).doprint(expression))

    def mathml(self, side: Any) -> str:
        """Elements of MathML of a side, without ``<math>``."""
        if isinstance(side, str):
            return text_to_mathml(side)
        if isinstance(side, float | int):
            return number_mathml(side)
        expression, printed = self._printed(side)
        names = {symbol: forms[1] for symbol, forms in printed.items()}
        times = {"mul_symbol": "dot"} if isinstance(side, PutIn) else {}
        printer = _MathML(names, times)
        found = str(printer._print(expression).toxml())
        for written, better in _BETTER:
            found = found.replace(written, better)
        return found

    def lines(self, side: Any) -> list[Any]:
        """A side as parts to be written below each other: terms of a long sum, else the side alone."""
        put_in = side.numbers if isinstance(side, PutIn) else None
        expression = side.expression if isinstance(side, PutIn) else side
        if not isinstance(expression, sympy.Add) or sympy.count_ops(expression) < 12:
            return [side]
        found: list[list[Any]] = [[]]
        length = 0
        for term in expression.as_ordered_terms():
            wide = 6 + 3 * int(sympy.count_ops(term))
            if length + wide > WIDE and found[-1]:
                found.append([])
                length = 0
            found[-1].append(term)
            length += wide
        sums = [sympy.Add(*terms, evaluate=False) if len(terms) > 1 else terms[0] for terms in found]
        return [part if put_in is None else PutIn(part, put_in) for part in sums]

    def _printed(self, side: Any) -> tuple[Any, dict[Any, tuple[str, str]]]:
        """The expression of a side, and its symbols in both forms."""
        if not isinstance(side, PutIn):
            return side, {symbol: self._symbol(symbol) for symbol in side.free_symbols}
        symbols = side.expression.free_symbols
        known = {s: _number(side.numbers[str(s)]) for s in symbols if str(s) in side.numbers}
        return side.expression, {s: known.get(s) or self._symbol(s) for s in symbols}

    def _symbol(self, symbol: Any) -> tuple[str, str]:
        if symbol not in self._symbols:
            name = str(symbol)
            self._symbols[symbol] = self.notation.latex(name), self.notation.mathml(name)
        return self._symbols[symbol]


def _number(value: float) -> tuple[str, str]:
    """A number that stands in a formula, in brackets where it would be misread."""
    latex, mathml = number_latex(value), number_mathml(value)
    if value < 0 or "e" in f"{value:.6g}":
        return rf"\left({latex}\right)", f"<mrow><mo>(</mo>{mathml}<mo>)</mo></mrow>"
    return latex, f"<mrow>{mathml}</mrow>"
