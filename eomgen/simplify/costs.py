"""Stage simplify: how long an expression is for a reader: operations and characters together."""

from __future__ import annotations

from collections.abc import Collection
from fractions import Fraction

from .atoms import TURNS, Atoms, Monomial, Number, Poly

OPERATION = 4.0  #: characters that an operation weighs: textbooks write about so many an operation
SUM = 2.0  #: parentheses
MIXED = 10.0  #: around a sum of unlike quantities, such as a length and a length times a cosine
NESTED = 6.0  #: parentheses in parentheses
STACKED = 30.0  #: a fraction in a fraction: it is set small, and no line is broken there


class Costs:
    """Lengths of what is made of a table of atoms."""

    def __init__(self, atoms: Atoms, rates: Collection[str] = ()) -> None:
        self.atoms = atoms
        self.rates = rates
        self._of: list[float] = []
        self._roles_of: list[frozenset[str]] = []
        self._fractions_of: list[int] = []
        self._products: dict[Monomial, float] = {}

    def of_atom(self, atom: int) -> float:
        """An atom by itself."""
        while (
            len(self._of) <= atom
        ):  # those inside an atom have smaller numbers: no recursion, calls may be nested deep
            self._of.append(self._atom(len(self._of)))
        return self._of[atom]

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

    def _roles(self, atom: int) -> frozenset[str]:
        while len(self._roles_of) <= atom:
            kind, what = self.atoms.table[len(self._roles_of)]
            found = {"rate"} if kind in ("sym", "name") and what in self.rates else {"turn"} if kind in TURNS else set()
            found.update(r for part in self.atoms.inside(len(self._roles_of)) for r in self._roles_of[part])
            self._roles_of.append(frozenset(found))
        return self._roles_of[atom]

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
        found = self._products.get(monomial)
        if found is None:
            found = self._products[monomial] = self._product(monomial)
        return found

    def _product(self, monomial: Monomial) -> float:
        cost = sum(self.of_power(a, n) for a, n in monomial) + (OPERATION + 1.0) * (len(monomial) - 1)
        if any(n < 0 for _, n in monomial):
            cost += STACKED * sum(self._fractions(a) for a, n in monomial if n > 0)
        return cost

    def _fractions(self, atom: int) -> int:
        """How many fractions there are in a factored sum, at any depth."""
        while len(self._fractions_of) <= atom:
            kind, what = self.atoms.table[len(self._fractions_of)]
            sums = [monomial for monomial, _ in what] if kind == "factor" else []
            inside = sum(self._fractions_of[a] for monomial in sums for a, _ in monomial)
            self._fractions_of.append(inside + sum(any(n < 0 for _, n in monomial) for monomial in sums))
        return self._fractions_of[atom]

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
