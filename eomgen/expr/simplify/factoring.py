"""A polynomial -> sums of products of sums, short to read."""

from __future__ import annotations

from collections.abc import Callable, Collection
from fractions import Fraction
from functools import reduce
from typing import Any, NamedTuple

from ..core import LEAVES
from .atoms import (
    ONE,
    STACKED,
    SUM,
    SUMS,
    TURNS,
    Atoms,
    Costs,
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
from .expansion import Expansion, OfNodes, content, divided

# -- factors -----------------------------------------------------------------------------------------------------------

# Common factors are taken out greedily, the one that shortens most first; what several products share is taken out once
# more.  This is algebraic factoring as of logic synthesis (R. K. Brayton and C. McMullen, The decomposition and
# factorization of Boolean expressions, ISCAS 1982), with a length for readers as the cost.


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
        result = self._sum(multiply(poly, {inverse(monomial): ratio(1, amount)}))
        if len(result) == 1:
            return multiply(result, {monomial: amount})
        return self._wrapped(result, monomial, amount) if monomial or one_term else scaled(result, amount)

    def _sum(self, poly: Poly) -> Poly:
        """The shortest form found with what all terms share left in each of them."""
        key = freeze(poly)
        result = self._known.get(key)
        if result is None:
            result = self._known[key] = self._primitive(poly)
        return result

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
        result: dict[Monomial, None] = {}
        if len(terms) <= PAIRS:
            for i, a in enumerate(terms):
                for b in terms[i + 1 :]:
                    both = common(a, b)
                    if both:
                        result[both] = None
        for monomial in terms if len(terms) > PAIRS else ():
            for atom, n in monomial:
                result[((atom, 1 if n > 0 else -1 if n <= -1 else n),)] = None
        scores = []
        for divisor in result:
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


# -- exact quotients ---------------------------------------------------------------------------------------------------

# Of (2 a + a b + 4 x + 2 b x) / (2 + b) remains a + 2 x. Terms are divided together with those that differ from them in
# symbols of the denominator alone.


def without_exact_quotients(poly: Poly, atoms: Atoms) -> Poly:
    """The same, with what its denominators, atoms of kind ``sum`` where they have several terms, divide divided."""
    below = {a for m in poly for a, n in m if n <= -1 and atoms.table[a].kind == "sum"}
    for atom in sorted(below):
        poly = _divided_by(poly, atom, atoms)
    return poly


def _divided_by(poly: Poly, atom: int, atoms: Atoms) -> Poly:
    divisor: Poly = dict(atoms.table[atom].what)
    if len(divisor) < 2:
        return poly
    for (outer, power), above in _over(poly, atom, divisor, lambda n: n <= -1).items():
        quotient = divided(above, divisor) if above else None
        if quotient is not None:
            rest = ((atom, power + 1),) if power != -1 else ()
            poly = add(poly, multiply(above, {join(outer, ((atom, power),)): 1}), -1)
            poly = add(poly, multiply(quotient, {join(outer, rest): 1}))
    return poly


def _over(
    poly: Poly, atom: int, divisor: Poly, is_below: Callable[[Fraction | int], bool]
) -> dict[tuple[Monomial, Fraction | int], Poly]:
    """What stands over powers of an atom, by what is beside it but for symbols of the divisor, and by the power."""
    of_divisor = {a for m in divisor for a, _ in m}
    groups: dict[tuple[Monomial, Fraction | int], Poly] = {}
    for m, x in poly.items():
        power = dict(m).get(atom, 0)
        if is_below(power):
            outer = tuple(f for f in m if f[0] not in of_divisor and f[0] != atom)
            groups.setdefault((outer, power), {})[tuple(f for f in m if f[0] in of_divisor)] = x
    return groups


# -- signs as quotients ------------------------------------------------------------------------------------------------

# At x = 0 the quotient has none; who prints signs says so.


MADE = "sgn"  #: kind of the atoms for what was x / |x|


def with_signs(poly: Poly, atoms: Atoms) -> Poly:
    """A polynomial that is multiplied out, with the signs of what it divides by magnitudes of."""
    below = {a for m in poly for a, n in m if _is_below(a, n, atoms)}
    for atom in sorted(below):
        poly = _sign_divided_by(poly, atom, atoms)
    return poly


def _is_below(atom: int, n: Fraction | int, atoms: Atoms) -> bool:
    return atoms.table[atom].kind == "abs" and n < 0 and n % 2 == 1


def _sign_divided_by(poly: Poly, atom: int, atoms: Atoms) -> Poly:
    divisor = dict(atoms.table[atom].what[0])
    for (outer, power), above in _over(poly, atom, divisor, lambda n: _is_below(atom, n, atoms)).items():
        left, once = above, _quotient(above, divisor)
        rest = power
        while rest < 0 and once is not None and (twice := _quotient(once, divisor)) is not None:  # x^2 is |x|^2
            left, once, rest = twice, _quotient(twice, divisor), rest + 2
        if rest < 0 and once is not None:
            left, made = once, _sign(outer, rest, atom, atoms)
        else:
            made = {join(outer, ((atom, rest),)): 1}
        if left is not above:
            poly = add(poly, multiply(above, {join(outer, ((atom, power),)): 1}), -1)
            poly = add(poly, multiply(left, made))
    return poly


def _quotient(above: Poly, divisor: Poly) -> Poly | None:
    """The quotient; None where the divisor does not divide what is above."""
    if len(divisor) > 1:
        return divided(above, divisor)
    ((monomial, x),) = divisor.items()
    if any(dict(m).get(a, 0) < n for m in above for a, n in monomial):
        return None
    return multiply(above, {inverse(monomial): ratio(1, x)})


def _sign(outer: Monomial, power: Fraction | int, atom: int, atoms: Atoms) -> Poly:
    """outer sign(x) |x|^(power + 1) of the magnitude |x| that is an atom."""
    rest = join(outer, ((atom, power + 1),)) if power != -1 else outer
    sign = atoms.id(MADE, atoms.table[atom].what)
    return {atoms.without_squared_signs(join(rest, ((sign, 1),)), "sum"): 1}


# -- products as they were formed --------------------------------------------------------------------------------------


class Literal(OfNodes[Poly]):
    """Forms of nodes as they stand; sums in products are atoms of kind ``factor``."""

    def __init__(self, expansion: Expansion) -> None:
        super().__init__(expansion.graph)
        self.expansion = expansion
        self.atoms = expansion.atoms

    def _made(self, i: int, kind: str, *args: Any) -> Poly:
        if kind in LEAVES:
            return self.atoms.leaf(kind, args[0])
        parts = [self._of[k] for k in args]
        if kind in ("add", "sub"):
            return add(parts[0], parts[1], 1 if kind == "add" else -1)
        if kind == "neg":
            return scaled(parts[0], -1)
        if kind in ("mul", "absorb"):
            product = multiply(self._one_term(parts[0]), self._one_term(parts[1]))
            return {self.atoms.without_squared_signs(m, "factor"): x for m, x in product.items()}
        if kind == "div" and parts[1]:
            ((below, x),) = self._one_term(parts[1]).items()
            return multiply(self._one_term(parts[0]), {inverse(below): Fraction(1) / x})
        if kind == "sqrt" and parts[0] and next(iter(parts[0])) != ONE:
            return {((self.atoms.id("factor", freeze(parts[0])), Fraction(1, 2)),): 1}
        if kind in ("sin", "cos"):
            return self.expansion.angles.of_angle(kind, self.expansion.angles.simplified(parts[0]))
        return self.atoms.poly(kind, tuple(freeze(p) for p in parts))

    def _one_term(self, poly: Poly) -> Poly:
        return poly if len(poly) < 2 else self.atoms.poly("factor", freeze(poly))


# -- both together -----------------------------------------------------------------------------------------------------

# A damper's force c r' (r - s) / r^2 reads best as the product that it is, the inertia beside it with its terms
# collected.  Products of sums in which lengths stand, as those of springs and dampers, are kept where multiplying them
# out makes them longer; what is inertia may cancel with other inertia.


PLAIN = ("sym", "pi", "name", *TURNS, *SUMS)  #: kinds of atoms of which inertia is made


class Parts(NamedTuple):
    """What a node is the sum of."""

    kept: Poly  #: products of factored sums
    out: Poly  #: multiplied out


class Mixed(OfNodes[Parts]):
    """Sums of products that are kept and of what is multiplied out."""

    def __init__(self, expansion: Expansion, factoring: Factoring, simplified: Callable[[Poly], Poly]) -> None:
        super().__init__(expansion.graph)
        self.expansion, self.factoring, self.simplified = expansion, factoring, simplified
        self.atoms: Atoms = expansion.atoms

    def form(self, i: int) -> Poly | None:
        """The form of a node; None where nothing is kept."""
        parts = self.of(i)
        return self._whole(parts) if parts.kept else None

    def _whole(self, parts: Parts) -> Poly:
        """Both together, with common factors taken out."""
        return self.factoring.factored(add(parts.kept, self.simplified(parts.out)))

    def _made(self, i: int, kind: str, *args: Any) -> Parts:
        if kind not in ("add", "sub", "neg", "mul", "absorb", "div"):
            return Parts({}, self.expansion.of(i))
        first, *rest = (self._of[k] for k in args)
        if kind == "neg":
            return Parts(scaled(first.kept, -1), scaled(first.out, -1))
        second = rest[0]
        if kind in ("add", "sub"):
            sign = 1 if kind == "add" else -1
            return Parts(add(first.kept, second.kept, sign), add(first.out, second.out, sign))
        if kind == "div":
            return self._quotient(i, first, args[1])
        return self._product(i, first, second)

    def _product(self, i: int, a: Parts, b: Parts) -> Parts:
        if not (a.kept and b.kept):
            few, many = (a, b) if not a.kept else (b, a)
            if many.kept:  # a sum of which some products are kept: each has one more factor
                return Parts(multiply(many.kept, self._factor(few)), self.expansion.times(many.out, few.out))
            if max(len(a.out), len(b.out)) < 2:
                return Parts({}, self.expansion.of(i))
        if a.kept and b.kept:
            return Parts(multiply(self._factor(a), self._factor(b)), {})
        out = self.expansion.of(i)
        if self._has_lengths(out):
            kept = multiply(self._factor(a), self._factor(b))
            costs = self.factoring.costs.of_terms
            if costs(kept) < costs(self.factoring.factored(self.simplified(out))):
                return Parts(kept, {})
        return Parts({}, out)

    def _has_lengths(self, poly: Poly) -> bool:
        """Whether there are roots, their squares, or functions other than sines and cosines."""
        return any(self._is_length(a, n) for m in poly for a, n in m)

    def _is_length(self, atom: int, n: Fraction | int) -> bool:
        return n != int(n) or atom in self.expansion.under_roots or self.atoms.table[atom].kind not in PLAIN

    def _quotient(self, i: int, above: Parts, below: int) -> Parts:
        if not above.kept:
            return Parts({}, self.expansion.of(i))
        over = self.expansion.quotient({ONE: 1}, self.expansion.of(below))
        if len(over) != 1:
            return Parts({}, self.expansion.of(i))
        return Parts(multiply(above.kept, over), self.expansion.quotient(above.out, self.expansion.of(below)))

    def _factor(self, parts: Parts) -> Poly:
        """One term, a sum in it being one factor."""
        whole = self._whole(parts)
        return whole if len(whole) < 2 else self.factoring.product(whole, one_term=True)
