"""A SymPy expression -> the tree that is printed, factors and terms in a textbook's order."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from decimal import Decimal
from typing import Any, NamedTuple

import sympy
from sympy.core.function import AppliedUndef

# -- order -------------------------------------------------------------------------------------------------------------

# Factors: number, masses and inertias, gravity, other parameters, coordinates and rates, sums, functions,
# variations:
# ``m_1 l_1^2``, ``(m_1 + m_2) g l_1 sin(theta_1)``.  Terms: inputs, squares of rates, what has no rates, rates.


NUMBER, MASS, INERTIA, INERTIAL_SUM, INPUT, GRAVITY, PARAMETER, SUM_OF_PARAMETERS = range(8)
NAMED, COORDINATE, RATE, SUM, FUNCTION, VARIATION = range(8, 14)
Key = tuple[Any, ...]


class Order:
    """The order of names, and what follows from it for factors and terms.

    ``kinds`` gives names their kind, of those above, in the order of declaration; other names are intermediates.
    """

    def __init__(self, kinds: Mapping[str, int]) -> None:
        self.kinds = {name: (kind, place) for place, (name, kind) in enumerate(kinds.items())}
        self._known: dict[Any, Key] = {}

    def of_name(self, name: str) -> Key:
        """Kind and place of a name."""
        return self.kinds.get(name) or (NAMED, len(self.kinds), _natural(name))

    def of_factor(self, factor: Any) -> Key:
        """What factors are sorted by."""
        if factor not in self._known:
            self._known[factor] = self._of_factor(factor)
        return self._known[factor]

    def _of_factor(self, factor: Any) -> Key:
        if factor.is_Number or factor.is_NumberSymbol:
            return (NUMBER,)
        if factor.is_Symbol:
            return self.of_name(factor.name)
        if factor.is_Pow and factor.base.is_Symbol and factor.exp.is_Number:
            return self.of_factor(factor.base)
        names = sorted(self.of_name(str(symbol)) for symbol in factor.free_symbols)
        if type(factor).__name__ == "delta":
            return (VARIATION, *names)
        if factor.atoms(sympy.Function) or not names:
            return (FUNCTION, len(names), *names)
        if names[-1][0] <= PARAMETER:
            inertial = names[0][0] in (MASS, INERTIA)
            return (INERTIAL_SUM if inertial else SUM_OF_PARAMETERS, len(names), *names)
        return (SUM, len(names), *names)

    def of_term(self, term: Any) -> Key:
        """What terms are sorted by."""
        degree = rates = 0
        keys: list[Key] = []
        for factor in sympy.Mul.make_args(term):
            base, exponent = factor.as_base_exp() if factor.is_Pow else (factor, sympy.S.One)
            key = self.of_factor(base)
            times = int(exponent) if exponent.is_Integer and 0 < exponent < 10 else 1
            if key[0] == NUMBER:
                continue
            degree += times
            keys += [key] * times
            if any(self.of_name(str(s))[0] == RATE for s in base.free_symbols):
                rates += times if base.is_Symbol else max(times, _degree(base, self._is_rate))
        keys.sort()
        has_input = any(key[0] == INPUT for key in keys)
        family = 0 if has_input else (2, 3, 1)[min(rates, 2)]
        heavy = not keys or keys[0][0] > INERTIAL_SUM
        function = bool(keys) and keys[-1][0] >= FUNCTION
        return (family, heavy, function, degree, _flat(keys))

    def _is_rate(self, symbol: Any) -> bool:
        return bool(self.of_name(str(symbol))[0] == RATE)

    def factors(self, factors: Iterable[Any]) -> list[Any]:
        """Factors in order."""
        return sorted(factors, key=lambda f: (_flat([self.of_factor(f)]), sympy.default_sort_key(f)))

    def terms(self, terms: Iterable[Any]) -> list[Any]:
        """Terms in order; the first is not subtracted if one is added."""
        result = sorted(terms, key=lambda x: (self.of_term(x), sympy.default_sort_key(x)))
        added = next((k for k, term in enumerate(result) if not is_subtracted(term)), 0)
        return [result[added], *result[:added], *result[added + 1 :]]


def is_subtracted(term: Any) -> bool:
    """Whether the number in front of a term is negative."""
    return bool(term.as_coeff_Mul()[0].is_negative)


def _degree(expression: Any, counts: Any) -> int:
    """Degree of a sum of products in the symbols that count, as far as it is seen without expansion."""
    degrees = [0]
    for term in sympy.Add.make_args(expression):
        degree = 0
        for factor in sympy.Mul.make_args(term):
            base, exponent = factor.as_base_exp() if factor.is_Pow else (factor, sympy.S.One)
            if base.is_Symbol and counts(base) and exponent.is_Integer:
                degree += int(exponent)
            elif base.is_Add:
                degree += _degree(base, counts)
        degrees.append(degree)
    return max(degrees)


def _natural(name: str) -> Key:
    """``z9`` before ``z10``."""
    letters = name.rstrip("0123456789")
    return (letters, int(name[len(letters) :] or 0))


def _flat(keys: Iterable[Any]) -> tuple[str, ...]:
    """Keys of different shapes as texts that can be compared."""
    result: list[str] = []
    for key in keys:
        if isinstance(key, tuple):
            result += _flat(key)
        else:
            result.append(f"{key:06d}" if isinstance(key, int) else str(key))
    return tuple(result)


# -- the tree ----------------------------------------------------------------------------------------------------------


class Number(NamedTuple):
    """A number without a sign, as it is printed; ``power`` is the power of ten after it."""

    digits: str
    power: str = ""


class Name(NamedTuple):
    """A name of the model or of an intermediate."""

    name: str


class Letter(NamedTuple):
    r"""A symbol of a display that no name of the model stands for, in LaTeX: ``M_{12}``, ``B^T``."""

    latex: str


class Sum(NamedTuple):
    """Terms, each with whether it is subtracted."""

    terms: tuple[tuple[bool, Formula], ...]


class Product(NamedTuple):
    """Factors side by side."""

    factors: tuple[Formula, ...]


class Quotient(NamedTuple):
    """One over the other."""

    above: Formula
    below: Formula


class Power(NamedTuple):
    """A base and its exponent."""

    base: Formula
    exponent: Formula


class Call(NamedTuple):
    """A function of arguments: ``sin``, ``sqrt``, ``abs``, ``min``, ..."""

    function: str
    arguments: tuple[Formula, ...]


class Relation(NamedTuple):
    """Formulas with signs between them: < > <= >= = and or."""

    sign: str
    sides: tuple[Formula, ...]


class Piecewise(NamedTuple):
    """Values and the conditions under which they hold; the last may hold otherwise."""

    branches: tuple[tuple[Formula, Formula | None], ...]


class Matrix(NamedTuple):
    """Formulas in rows."""

    rows: tuple[tuple[Formula, ...], ...]


class Words(NamedTuple):
    """What no other part is for, as SymPy writes it: in text and in LaTeX."""

    text: str
    latex: str


Formula = Number | Name | Letter | Sum | Product | Quotient | Power | Call | Relation | Piecewise | Matrix | Words


def times(formula: Formula, factor: Formula) -> Formula:
    """A formula with one more factor, within its fraction: of ``3 m/2`` and ``s``, ``3 m s/2``, which reads one way."""
    match formula:
        case Quotient():
            return formula._replace(above=times(formula.above, factor))
        case Product():
            return Product((*formula.factors, factor))
        case Number("1", ""):
            return factor
        case _:
            return Product((formula, factor))


def is_group(formula: Formula) -> bool:
    """Whether a formula needs parentheses to be one factor."""
    return isinstance(formula, Sum | Relation)


def is_simple(formula: Formula) -> bool:
    """Whether a formula is one symbol."""
    return isinstance(formula, Name | Letter) or (isinstance(formula, Number) and not formula.power)


# -- from SymPy --------------------------------------------------------------------------------------------------------


_SIGNS = {"StrictLessThan": "<", "StrictGreaterThan": ">", "LessThan": "<=", "GreaterThan": ">=", "Equality": "=",
          "And": "and", "Or": "or"}  # fmt: skip
DIGITS = 15  #: of a decimal that is meant as it stands
PRINTED = 8  #: digits up to which a decimal is printed in full
ROUNDED = 6  #: digits of one with more, in displays
_NAMES = {"Abs": "abs", "Max": "max", "Min": "min", "log": "ln", "ceiling": "ceil"}


class Formulas:
    """Makes trees of expressions; parts that appear again are made once.

    ``numbers`` stand in the places of names; decimals that have more than ``PRINTED`` digits get ``digits`` of them.
    Of what was made up to now, ``rounded`` tells whether a number has more digits than are printed, ``signs`` whether
    sgn(x) stands for x / |x|, which has no value at x = 0.
    """

    def __init__(self, order: Order, numbers: Mapping[str, float] | None = None, digits: int = DIGITS) -> None:
        self.order, self.digits = order, digits
        self.rounded = self.signs = False
        self._made: dict[Any, Formula] = {sympy.Symbol(name): number(x) for name, x in (numbers or {}).items()}

    def __call__(self, expression: Any) -> Formula:
        """The tree of an expression or a matrix."""
        if isinstance(expression, sympy.MatrixBase):
            return Matrix(tuple(tuple(map(self, row)) for row in expression.tolist()))
        result = self._made.get(expression)
        if result is None:
            result = self._made[expression] = self._formula(expression)
        return result

    def _formula(self, x: Any) -> Formula:
        if x.is_Symbol:
            return Name(x.name)
        if x.is_Add:
            return Sum(tuple(self._signed(term) for term in self.order.terms(x.args)))
        if x.is_Mul or x.is_Number:
            subtracted, term = self._signed(x)
            return Sum(((True, term),)) if subtracted else term
        if x.is_Pow:
            return self._power(x.base, x.exp)
        if isinstance(x, AppliedUndef) and x.args == (sympy.Symbol("t"),):
            return Name(x.func.__name__)
        if isinstance(x, sympy.Derivative) and isinstance(x.expr, AppliedUndef) and len(x.variable_count) == 1:
            return Name(f"{x.expr.func.__name__}_{'d' * int(x.variable_count[0][1])}ot")
        if isinstance(x, sympy.Piecewise):
            branches = ((self(value), None if when == sympy.true else self(when)) for value, when in x.args)
            return Piecewise(tuple(branches))
        kind = type(x).__name__
        if kind in _SIGNS:
            return Relation(_SIGNS[kind], tuple(map(self, x.args)))
        if kind == "delta":  # the variation of a name, which no number stands for
            return Call(kind, (Name(x.args[0].name),))
        if isinstance(x, sympy.Function | sympy.Max | sympy.Min) and x.args:
            return Call(_NAMES.get(kind, kind), tuple(map(self, x.args)))
        if x == sympy.pi:
            return Name("pi")
        return Words(str(x), sympy.latex(x))

    def _signed(self, x: Any) -> tuple[bool, Formula]:
        """Whether a term is subtracted, and the term without its sign."""
        number, rest = x.as_coeff_Mul()
        above, below = [], []
        for factor in sympy.Mul.make_args(rest):
            if factor.is_Pow and factor.exp.is_Number and factor.exp.is_negative:
                below.append(sympy.Pow(factor.base, -factor.exp, evaluate=False))
            elif factor != 1:
                above.append(factor)
        if below:
            above, below = self._with_signs(above, below)
        subtracted = is_subtracted(x)
        number = -number if subtracted else number
        upper, lower = self._factors(above), self._factors(below)
        if not number.is_Rational:
            upper = (self._decimal(number), *upper)
        elif number.q == 1:
            upper = (Number(str(number)), *upper) if number != 1 or not upper else upper
        elif decimal := _as_decimal(number):
            upper = (Number(decimal), *upper)
        elif lower:
            upper = (Number(str(number.p)), *upper) if number.p != 1 or not upper else upper
            lower = (Number(str(number.q)), *lower)
        else:
            upper = (Quotient(Number(str(number.p)), Number(str(number.q))), *upper)
        return subtracted, Quotient(_product(upper), _product(lower)) if lower else _product(upper)

    def _with_signs(self, above: list[Any], below: list[Any]) -> tuple[list[Any], list[Any]]:
        """Factors above and below a line with sgn(x) for x / |x|, where |x| is the root of x^2."""
        for size in list(below):
            root = _root(size.base) if size.is_Pow and size.exp == sympy.Rational(1, 2) else None
            for x in () if root is None else (root, -root):
                result = _without(above, x)
                if result is not None:
                    above = [*result, sympy.Function("sgn")(x)]
                    below.remove(size)
                    self.signs = True
                    break
        return above, below

    def _decimal(self, x: Any) -> Formula:
        if not x.is_Float or not x.is_finite:
            return Words(str(x), sympy.latex(x))
        full = number(float(x), DIGITS)
        part = full if isinstance(full, Number) else full.terms[0][1] if isinstance(full, Sum) else None
        kept = not isinstance(part, Number) or len(part.digits.replace(".", "").lstrip("0")) <= PRINTED
        if kept or self.digits >= DIGITS:
            return full
        self.rounded = True
        return number(float(x), self.digits)

    def _factors(self, factors: list[Any]) -> tuple[Formula, ...]:
        return tuple(self(factor) for factor in self.order.factors(factors))

    def _power(self, base: Any, exponent: Any) -> Formula:
        if exponent.is_Number and exponent.is_negative:
            return Quotient(Number("1"), self._power(base, -exponent))
        root = _root(base) if (2 * exponent).is_Integer and not exponent.is_Integer else None
        if root is not None:  # (x^2)^(n/2) is |x|^n
            size = Call("abs", (self(root),))
            return size if exponent == sympy.Rational(1, 2) else Power(size, self(2 * exponent))
        if exponent == sympy.Rational(1, 2):
            return Call("sqrt", (self(base),))
        if exponent == 1:
            return self(base)
        return Power(self(base), self(exponent))


def _root(base: Any) -> Any:
    """x of x^2, also of products and higher powers; None where it is no square of names and sums."""
    result = []
    for factor in sympy.Mul.make_args(base):
        if not (factor.is_Pow and factor.exp.is_Integer and factor.exp % 2 == 0):
            return None
        result.append(sympy.Pow(factor.base, factor.exp / 2))
    return sympy.Mul(*result)


def _without(factors: list[Any], x: Any) -> list[Any] | None:
    """Factors without those of x; None where one is not among them."""
    left = list(factors)
    for part in sympy.Mul.make_args(x):
        if part not in left:
            return None
        left.remove(part)
    return left


def _product(factors: tuple[Formula, ...]) -> Formula:
    if not factors:
        return Number("1")
    return factors[0] if len(factors) == 1 else Product(factors)


def _as_decimal(number: Any) -> str:
    """The decimal of a fraction that no hand would write, such as 981/100; empty of fractions such as 3/4 or 7/20."""
    if number.q % 25 or 10**DIGITS % number.q:
        return ""
    text = f"{Decimal(int(number.p)) / Decimal(int(number.q)):f}"
    return text if len(text) <= DIGITS else ""


def number(value: float, digits: int = 6) -> Formula:
    """A number of at most so many digits; one below 0 is a sum that subtracts it."""
    text, _, power = f"{abs(value):.{digits}g}".partition("e")
    part = Number(text, str(int(power)) if power else "")
    return Sum(((True, part),)) if value < 0 else part
