"""Factored polynomials -> SymPy expressions."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import sympy

from ..core import Graph
from ..sympy_bridge import as_number, raise_operation
from .atoms import SMALL, TURNS, Atoms, Monomial, Number, Poly
from .factoring import MADE, Factoring


class Raising:
    """Makes SymPy expressions of polynomials over a table of atoms."""

    def __init__(self, graph: Graph, atoms: Atoms, factoring: Factoring, symbols: Callable[[str], Any]) -> None:
        self.graph = graph
        self.atoms = atoms
        self.factoring = factoring
        self.symbols = symbols
        self.names: dict[Any, Any] = {}  #: what stands for an intermediate
        self.turns: dict[int, Any] = {}  #: what stands for a sine or cosine
        self.roots: dict[int, tuple[Any, int]] = {}  #: what stands for a sum (1) or its root (2)
        self._made: dict[int, Any] = {}

    def expression(self, poly: Poly) -> Any:
        """The SymPy expression of a polynomial as it stands."""
        if len(poly) == 1:
            ((monomial, x),) = poly.items()
            if x == 1 and len(monomial) == 1 and monomial[0][1] == 1:
                return self._atom(monomial[0][0])  # a condition stays one
        return sympy.Add(*(self._term(m, x) for m, x in poly.items()))

    def _term(self, monomial: Monomial, x: Number) -> Any:
        factors = [self._power(a, n) for a, n in monomial]
        return sympy.Mul(_number(x), *factors)

    def _power(self, atom: int, n: Fraction | int) -> Any:
        symbol, times = self.roots.get(atom, (None, 1))
        n = times * n
        return sympy.Pow(symbol or as_number(self._atom(atom)), sympy.Rational(n.numerator, n.denominator))

    def root(self, atom: int) -> Any:
        """A sum or its root, written out."""
        result = self.expression(self.factoring.factored(dict(self.atoms.table[atom].what)))
        return sympy.sqrt(result) if self.roots[atom][1] == 2 else result

    def turn(self, atom: int) -> Any:
        """A sine or cosine, written out."""
        kind, angle = self.atoms.table[atom]
        return getattr(sympy, kind)(self.expression(self.factoring.factored(dict(angle))))

    def _atom(self, atom: int) -> Any:
        if atom in self.turns:
            return self.turns[atom]
        if atom not in self._made:
            stack, needed = [atom], {atom}
            while stack:  # from the inside out, as calls may be nested deep
                new = self.atoms.inside(stack.pop()).difference(needed, self._made, self.turns)
                needed |= new
                stack += new
            for a in sorted(needed):
                self._made[a] = self._raised(a)
        return self._made[atom]

    def _raised(self, atom: int) -> Any:
        kind, what = self.atoms.table[atom]
        if kind == "sym":
            return self.symbols(what)
        if kind == "name":
            return self.names[what]
        if kind == "pi":
            return sympy.pi
        if kind == "factor":
            return self.expression(dict(what))
        if kind == "sum":
            return self.expression(self.factoring.factored(dict(what)))
        if kind in TURNS:
            return self.turn(atom)
        if kind == MADE:
            of = self.expression(self.factoring.factored(dict(what[0])))
            return of / sympy.Abs(of)
        return raise_operation(self.graph, kind, [self.expression(self.factoring.factored(dict(p))) for p in what])


def _number(x: Number) -> Any:
    if isinstance(x, float):
        return sympy.Float(x)
    decimal = _decimal(x)
    if x.denominator > SMALL or (decimal and len(decimal) < len(f"{x.numerator}/{x.denominator}")):
        return sympy.Float(float(x))
    return sympy.Rational(x.numerator, x.denominator)


def _decimal(x: Fraction | int) -> str:
    """The text of a fraction as a decimal, empty where it has no end or is whole."""
    if x.denominator == 1:
        return ""
    text = f"{Decimal(x.numerator) / Decimal(x.denominator):f}"
    return text if Fraction(text) == x else ""


def in_one_fashion(expression: Any) -> Any:
    """With fractions as decimals, as far as those have an end, in an expression that has a decimal."""
    return _in_decimals(expression) if expression.has(sympy.Float) else expression


def _in_decimals(x: Any) -> Any:
    if x.is_Rational and not x.is_Integer:
        return sympy.Float(float(x)) if _decimal(Fraction(x.p, x.q)) else x
    if not x.args or not x.has(sympy.Rational):
        return x
    if x.is_Pow:
        return sympy.Pow(_in_decimals(x.base), x.exp)
    return x.func(*map(_in_decimals, x.args))
