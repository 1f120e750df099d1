"""Stage simplify: a polynomial -> sums of products of sums, short to read.

Common factors are taken out greedily, the one that shortens most first; what several products share is taken out once
more.  This is algebraic factoring as of logic synthesis (R. K. Brayton and C. McMullen, The decomposition and
factorization of Boolean expressions, ISCAS 1982), with a length for readers as the cost.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from functools import reduce

from .atoms import (
    ONE,
    Atoms,
    Frozen,
    Monomial,
    Number,
    Poly,
    Work,
    add,
    common,
    freeze,
    inverse,
    join,
    multiply,
    ratio,
    scaled,
)
from .costs import STACKED, SUM, Costs
from .expansion import content

PAIRS = 40  #: terms up to which all pairs are tried for their common factor
TRIED = 3  #: factors that are tried to the end where there are few terms
FEW = 8  #: terms
LARGEST = 12  #: whole number that stands in a sum of decimals with a common factor


class Factoring:
    """Factors polynomials over a table of atoms.

    A factored sum is a polynomial whose atoms may be factored sums, of kind ``factor``.
    """

    def __init__(self, atoms: Atoms, work: Work, rates: Collection[str] = ()) -> None:
        self.atoms = atoms
        self.work = work
        self.costs = Costs(atoms, rates)
        self._known: dict[Frozen, Poly] = {}

    def factored(self, poly: Poly) -> Poly:
        """The shortest form found: a product, or a sum of terms that share nothing worth while."""
        if len(poly) < 2:
            return poly
        together = self.product(poly)
        if not reduce(common, poly):
            return together
        apart = self._sum(poly)
        return together if self.costs.of_terms(together) <= self.costs.of_terms(apart) else apart

    def product(self, poly: Poly, one_term: bool = False) -> Poly:
        """With all that is common taken out; numbers alone stay in the terms unless it has to be one term."""
        amount, monomial = readable_content(list(poly.values())), reduce(common, poly)
        if one_term and ONE in poly and amount < 1 and not all(-1 <= ratio(x, amount) <= 1 for x in poly.values()):
            amount = 1  # x - 1/10, not (10 x - 1)/10
        if all(x < 0 for x in poly.values()):
            amount = -amount
        found = self._sum(multiply(poly, {inverse(monomial): ratio(1, amount)}))
        if len(found) == 1:
            return multiply(found, {monomial: amount})
        return self._wrapped(found, monomial, amount) if monomial or one_term else scaled(found, amount)

    def _sum(self, poly: Poly) -> Poly:
        """The shortest form found with what all terms share left in each of them."""
        key = freeze(poly)
        found = self._known.get(key)
        if found is None:
            found = self._known[key] = self._primitive(poly)
        return found

    def _wrapped(self, sum_: Poly, monomial: Monomial, amount: Number) -> Poly:
        """amount monomial (sum), one term."""
        atom = self.atoms.id("factor", freeze(sum_))
        return {join(monomial, ((atom, 1),)): amount}

    def _primitive(self, poly: Poly) -> Poly:
        if len(poly) < 2:
            return poly
        for sign in (1, -1):
            square = self._square(scaled(poly, sign))
            if square is not None:
                return scaled(square, sign)
        candidates = self._divisors(poly)
        best, cost = poly, self.costs.of_terms(poly)
        whole = reduce(common, poly)
        for divisor in [d for d in candidates if d != whole][: TRIED if len(poly) <= FEW else 1]:
            tried = self._merged(self._taken_out(poly, divisor))
            price = self.costs.of_terms(tried)
            if price < cost:
                best, cost = tried, price
        return best

    def _taken_out(self, poly: Poly, divisor: Monomial) -> Poly:
        inside = {m: x for m, x in poly.items() if common(m, divisor) == divisor}
        rest = {m: x for m, x in poly.items() if m not in inside}
        taken = self.factored(inside)
        return add(self.factored(rest), taken)

    def _merged(self, poly: Poly) -> Poly:
        """Terms that share a factored sum are taken together: a F + b F = (a + b) F."""
        while (together := self._sharing(poly)) is not None:
            rest = {m: x for m, x in poly.items() if m not in together}
            poly = add(rest, self.product({m: poly[m] for m in together}))
        return poly

    def _sharing(self, poly: Poly) -> list[Monomial] | None:
        """Terms that share a factored sum, above or below; None where there are no two."""
        uses: dict[tuple[int, bool], list[Monomial]] = {}
        for monomial in poly:
            for atom, n in monomial:
                if self.atoms.table[atom].kind == "factor":
                    uses.setdefault((atom, n > 0), []).append(monomial)
        return next((monomials for monomials in uses.values() if len(monomials) > 1), None)

    def _divisors(self, poly: Poly) -> list[Monomial]:
        """Common factors of two or more terms, the one that saves most first."""
        terms = list(poly)
        self.work.spend(len(terms) ** 2 // 2)
        found: dict[Monomial, None] = {}
        if len(terms) <= PAIRS:
            for i, a in enumerate(terms):
                for b in terms[i + 1 :]:
                    both = common(a, b)
                    if both:
                        found[both] = None
        for monomial in terms if len(terms) > PAIRS else ():
            for atom, n in monomial:
                found[((atom, 1 if n > 0 else -1 if n <= -1 else n),)] = None
        scores = []
        for divisor in found:
            inside = [m for m in terms if common(m, divisor) == divisor]
            if len(inside) > 1 and len(inside) <= len(terms):
                saved = (len(inside) - 1) * (self.costs.of_monomial(divisor) + 5.0) - SUM
                if any(n < 0 for _, n in divisor):
                    saved -= STACKED * sum(any(n < 0 for _, n in join(m, inverse(divisor))) for m in inside)
                scores.append((-saved, divisor))
        return [divisor for saved, divisor in sorted(scores) if saved < 0]

    def _square(self, poly: Poly) -> Poly | None:
        """The square of a sum of k terms, which has k (k + 1) / 2."""
        k = int((2 * len(poly)) ** 0.5)
        if k < 2 or k * (k + 1) // 2 != len(poly):
            return None
        roots = []
        for monomial, x in poly.items():
            if not isinstance(x, float) and x > 0 and all(n % 2 == 0 for _, n in monomial):
                top, below = (_whole_root(y) for y in (x.numerator, x.denominator))
                if top and below:
                    roots.append((tuple((a, n // 2) for a, n in monomial), ratio(top, below)))
        if len(roots) != k:
            return None
        head = roots[0]
        base: Poly = {head[0]: head[1]}
        for monomial, x in roots[1:]:
            cross = poly.get(join(head[0], monomial))
            if cross is None or abs(cross) != 2 * head[1] * x:
                return None
            base[monomial] = x if cross > 0 else -x
        if multiply(base, base) != poly:
            return None
        ((monomial, amount),) = self.product(base, one_term=True).items()  # a^2 (1 + b)^2 of (a + a b)^2
        return {tuple((atom, 2 * n) for atom, n in monomial): amount * amount}


def readable_content(values: list[Number]) -> Number:
    """What divides all numbers into whole ones, if these are short; 1 beside decimals, 0.39 a + 0.5 b being one."""
    amount = content(values)
    if isinstance(amount, float) or amount.denominator % 25:
        return amount
    return amount if all(-LARGEST <= ratio(x, amount) <= LARGEST for x in values) else 1


def _whole_root(n: int) -> int:
    root = int(n**0.5 + 0.5)
    return root if root * root == n else 0


def sums_in(polys: Iterable[Poly], atoms: Atoms) -> dict[int, int]:
    """How often each factored sum is used, its uses inside others included."""
    count: dict[int, int] = {}
    stack = list(polys)
    while stack:
        poly = stack.pop()
        for monomial in poly:
            for atom, _ in monomial:
                if atoms.table[atom].kind == "factor":
                    count[atom] = count.get(atom, 0) + 1
                    if count[atom] == 1:
                        stack.append(dict(atoms.table[atom].what))
    return count
