"""What polynomials are made of, and how long an expression is for a reader."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import Any, Generic, NamedTuple, TypeVar

# -- atoms -------------------------------------------------------------------------------------------------------------


Number = int | Fraction | float
Monomial = tuple[tuple[int, Fraction | int], ...]  #: (atom, exponent) by rising atom; () is 1
Poly = dict[Monomial, Number]  #: coefficient of each monomial, none of them zero
Frozen = tuple[tuple[Monomial, Number], ...]  #: a Poly as a key, by rising monomial

ONE: Monomial = ()
TURNS = ("sin", "cos")
CHOICE = "select"
SUMS = ("sum", "factor")  #: kinds of atoms that are one polynomial
DIGITS = 12  #: of a decimal that is taken as it is written
ROUNDED_BY = 3  #: units in the last place that a constant may have lost to the operations that made it
SMALL = 1000  #: denominators up to which a number is written as a fraction


class Atom(NamedTuple):
    """What cannot be split.

    Kinds are ``sym``, ``pi``, ``sin``, ``cos``, ``sum`` (a polynomial that stands in a denominator or under a root),
    ``factor`` (a sum in a product), ``name`` (an intermediate), operations of :mod:`eomgen.base.operations`, and
    declared functions.
    """

    kind: str
    what: Any  #: the name of a symbol; the Frozen angle of a sine; the Frozen operands of another call


Value = TypeVar("Value")


class PerAtom(Generic[Value]):
    """A value of each atom, made once and in order: what is inside an atom has smaller numbers, however deep it is."""

    def __init__(self, make: Callable[[int], Value]) -> None:
        self._make = make
        self._known: list[Value] = []

    def __call__(self, atom: int) -> Value:
        """The value of an atom."""
        while len(self._known) <= atom:
            self._known.append(self._make(len(self._known)))
        return self._known[atom]


class Atoms:
    """A table of interned atoms."""

    def __init__(self) -> None:
        self.table: list[Atom] = []
        self._ids: dict[Atom, int] = {}
        self.names_in = PerAtom(self._names_in)  #: the atoms of names that an atom is made of, itself included
        self.choices_in = PerAtom(self._choices_in)  #: how deep choices between values stand in each other in an atom

    def id(self, kind: str, what: Any) -> int:
        """The number of an atom, the same for the same atom."""
        atom = Atom(kind, what)
        result = self._ids.get(atom)
        if result is None:
            result = self._ids[atom] = len(self.table)
            self.table.append(atom)
        return result

    def inside(self, atom: int) -> set[int]:
        """The atoms that an atom is made of, all of smaller numbers."""
        kind, what = self.table[atom]
        if kind in ("sym", "name", "pi"):
            return set()
        parts = [what] if kind in (*TURNS, *SUMS) else what
        return {a for part in parts for monomial, _ in part for a, _ in monomial}

    def all_in(self, poly: Poly) -> set[int]:
        """The atoms that stand in a polynomial, at any depth."""
        result: set[int] = set()
        left = [a for monomial in poly for a, _ in monomial]
        while left:
            atom = left.pop()
            if atom not in result:
                result.add(atom)
                left += self.inside(atom)
        return result

    def factors(self, poly: Poly, within: Collection[str] = SUMS) -> Iterator[tuple[int, Fraction | int]]:
        """The atoms of a sum of products with their exponents, and those of the kinds of factors ``within``."""
        for monomial in poly:
            for atom, n in monomial:
                yield atom, n
                if self.table[atom].kind in within:
                    yield from self.factors(dict(self.table[atom].what), within)

    def names(self, poly: Poly) -> frozenset[int]:
        """The atoms of names that stand in a polynomial, at any depth."""
        return frozenset().union(*(self.names_in(a) for monomial in poly for a, _ in monomial))

    def _names_in(self, atom: int) -> frozenset[int]:
        name = frozenset({atom} if self.table[atom].kind == "name" else ())
        return name.union(*map(self.names_in, self.inside(atom)))

    def _choices_in(self, atom: int) -> int:
        return max(map(self.choices_in, self.inside(atom)), default=0) + (self.table[atom].kind == CHOICE)

    def without_squared_signs(self, monomial: Monomial, kind: str) -> Monomial:
        """With x^2 for |x|^2; a sum in it is an atom of the kind."""
        for atom, n in monomial:
            of, what = self.table[atom]
            if of == "abs" and n % 2 == 0:
                ((inner, x), *others) = what[0]
                if not others and abs(x) == 1:
                    powers = tuple((a, n * k) for a, k in inner)
                else:
                    powers = ((self.id(kind, what[0]), n),)
                return self.without_squared_signs(join(join(monomial, ((atom, -n),)), powers), kind)
        return monomial

    def leaf(self, kind: str, value: Any) -> Poly:
        """The polynomial of a symbol or a number of the graph."""
        if kind == "sym":
            return self.poly("sym", value)
        amount, of_pi = number(value)
        return {((self.id("pi", ""), 1),) if of_pi else ONE: amount} if amount else {}

    def poly(self, kind: str, what: Any) -> Poly:
        """The polynomial of one atom."""
        return {((self.id(kind, what), 1),): 1}


def number(value: float) -> tuple[Number, bool]:
    """A double as it was probably meant, and whether it is that many times pi.

    The fraction with a denominator up to 1000, the decimal of few digits, or the multiple of pi, that is within the
    rounding of a few operations of it, such as 8.7 for 0.1 * 87.0; else the double itself.
    """
    near = Fraction(value).limit_denominator(SMALL)
    tolerance = ROUNDED_BY * math.ulp(value)
    if abs(near.numerator) < 10**12 and abs(near.numerator / near.denominator - value) <= tolerance:
        return ratio(near, 1), False
    for digits in range(1, DIGITS + 1):
        text = f"{value:.{digits}g}"
        if abs(float(text) - value) <= tolerance:
            return ratio(Fraction(text), 1), False
    turns = Fraction(value / math.pi).limit_denominator(360)
    if 0 < abs(turns.numerator) <= SMALL and abs(turns.numerator / turns.denominator * math.pi - value) <= tolerance:
        return ratio(turns, 1), True
    return value, False


def ratio(a: Number, b: Number) -> Number:
    """a / b, whole where it is: whole numbers are quick."""
    if isinstance(a, float) or isinstance(b, float):
        return a / b
    result = Fraction(a) / b
    return result.numerator if result.denominator == 1 else result


def freeze(poly: Poly) -> Frozen:
    """A polynomial as a key."""
    return tuple(sorted(poly.items()))


def add(a: Poly, b: Poly, factor: Number = 1) -> Poly:
    """a + factor b"""
    result = dict(a)
    for monomial, x in b.items():
        total = result.get(monomial, 0) + (x if factor == 1 else factor * x)
        if total:
            result[monomial] = total
        else:
            result.pop(monomial, None)
    return result


def scaled(a: Poly, factor: Number) -> Poly:
    """factor a"""
    return {m: x * factor for m, x in a.items()} if factor else {}


def join(a: Monomial, b: Monomial) -> Monomial:
    """a b"""
    if not a:
        return b
    if not b:
        return a
    powers = dict(a)
    for atom, n in b:
        total = powers.get(atom, 0) + n
        if total:
            powers[atom] = total
        else:
            del powers[atom]
    return tuple(sorted(powers.items()))


def inverse(a: Monomial) -> Monomial:
    """1 / a"""
    return tuple((atom, -n) for atom, n in a)


def common(a: Monomial, b: Monomial) -> Monomial:
    """The largest monomial that divides both, of denominators the one that both have."""
    others = dict(b)
    shared = []
    for atom, n in a:
        m = others.get(atom)
        if m is not None and (n > 0) == (m > 0):
            shared.append((atom, min(n, m) if n > 0 else max(n, m)))
    return tuple(shared)


def multiply(a: Poly, b: Poly) -> Poly:
    """a b, multiplied out."""
    if len(a) > len(b):
        a, b = b, a
    result: Poly = {}
    for m, x in a.items():
        for n, y in b.items():
            key = join(m, n)
            total = result.get(key, 0) + x * y
            if total:
                result[key] = total
            else:
                result.pop(key, None)
    return result


class TooLongError(Exception):
    """More terms were formed than may be: what is written out would be too long to read anyway."""


class Work:
    """Counts products of terms, so that effort is bounded alike on every machine."""

    def __init__(self, allowed: float) -> None:
        self.left = allowed
        self._floor = 0.0

    def spend(self, products: float) -> None:
        """Raise TooLongError when there were too many."""
        self.left -= products
        if self.left < self._floor:
            raise TooLongError

    @contextmanager
    def at_most(self, products: float) -> Iterator[None]:
        """Allow only so many in this block."""
        outer, self._floor = self._floor, max(self._floor, self.left - products)
        try:
            yield
        finally:
            self._floor = outer


# -- costs -------------------------------------------------------------------------------------------------------------


OPERATION = 4.0  #: characters that an operation weighs: textbooks write about so many an operation
SUM = 2.0  #: parentheses
MIXED = 10.0  #: around a sum of unlike quantities, such as a length and a length times a cosine
NESTED = 6.0  #: parentheses in parentheses
STACKED = 30.0  #: a fraction in a fraction: it is set small, and no line is broken there


class Costs:
    """Lengths of what is made of a table of atoms, ``of_atom`` of one by itself."""

    def __init__(self, atoms: Atoms, rates: Collection[str] = ()) -> None:
        self.atoms = atoms
        self.rates = rates
        self.of_atom = PerAtom(self._atom)
        self._roles = PerAtom(self._roles_in)
        self._fractions = PerAtom(self._fractions_in)
        self._products: dict[Monomial, float] = {}

    def _atom(self, atom: int) -> float:
        kind, what = self.atoms.table[atom]
        if kind in ("sym", "name"):
            return float(len(str(what)))
        if kind == "pi":
            return 2.0
        if kind in ("sin", "cos"):
            return OPERATION + 5.0 + self.of_terms(dict(what))
        if kind in ("sum", "factor"):
            poly = dict(what)
            nested = sum(1 for m in poly for a, _ in m if self.atoms.table[a].kind == "factor")
            mixed = len({self.roles_of(m) for m in poly}) > 1
            return SUM + self.of_terms(poly) + MIXED * mixed + NESTED * nested
        return OPERATION + len(kind) + 2.0 + sum(self.of_terms(dict(part)) for part in what)

    def roles_of(self, monomial: Monomial) -> frozenset[str]:
        """What a product holds beside lengths, masses and the like: rates, sines and cosines."""
        return frozenset(role for a, _ in monomial for role in self._roles(a))

    def _roles_in(self, atom: int) -> frozenset[str]:
        kind, what = self.atoms.table[atom]
        role = {"rate"} if kind in ("sym", "name") and what in self.rates else {"turn"} if kind in TURNS else set()
        return frozenset(role).union(*map(self._roles, self.atoms.inside(atom)))

    def of_power(self, atom: int, n: Fraction | int) -> float:
        """A power of an atom, without the sign that joins it to its neighbours."""
        cost = self.of_atom(atom)
        if abs(n) == Fraction(1, 2):
            return cost + OPERATION + 6.0
        return cost if abs(n) == 1 else cost + OPERATION + 3.0

    def of_number(self, value: Number) -> float:
        """A coefficient without its sign, and the sign that joins it; nothing for 1."""
        if value in (1, -1):
            return 0.0
        size: Number = value if value > 0 else -value
        if isinstance(size, float):
            return len(repr(size)) + OPERATION + 1.0
        return sum((len(str(n)) + OPERATION + 1.0 for n in (size.numerator, size.denominator) if n != 1), 0.0)

    def of_monomial(self, monomial: Monomial) -> float:
        """A product."""
        if not monomial:
            return 1.0
        result = self._products.get(monomial)
        if result is None:
            result = self._products[monomial] = self._product(monomial)
        return result

    def _product(self, monomial: Monomial) -> float:
        cost = sum(self.of_power(a, n) for a, n in monomial) + (OPERATION + 1.0) * (len(monomial) - 1)
        if any(n < 0 for _, n in monomial):
            cost += STACKED * sum(self._fractions(a) for a, n in monomial if n > 0)
        return cost

    def _fractions_in(self, atom: int) -> int:
        """How many fractions there are in a factored sum, at any depth."""
        kind, what = self.atoms.table[atom]
        sums = [monomial for monomial, _ in what] if kind == "factor" else []
        inside = sum(self._fractions(a) for monomial in sums for a, _ in monomial)
        return inside + sum(any(n < 0 for _, n in monomial) for monomial in sums)

    def of_term(self, monomial: Monomial, x: Number) -> float:
        """A term of a sum with the sign that joins it; nothing where x is zero."""
        return self.of_monomial(monomial) + self.of_number(x) + OPERATION + 3.0 if x else 0.0

    def of_change(self, poly: Poly, change: Poly) -> float:
        """What a sum gets longer by when a change is added to it."""
        total = 0.0
        for m, x in change.items():
            old = poly.get(m, 0)
            total += self.of_term(m, old + x) - self.of_term(m, old)
        return total

    def of_terms(self, poly: Poly) -> float:
        """A sum of products as it stands."""
        if not poly:
            return 1.0
        total = sum(self.of_term(m, x) for m, x in poly.items()) - OPERATION - 3.0
        return total + (OPERATION + 1.0 if all(x < 0 for x in poly.values()) else 0.0)
