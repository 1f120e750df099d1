"""Stage simplify: nodes of a graph -> polynomials in atoms, multiplied out as far as that stays short."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import gcd, lcm

from ..graph.core import Graph
from ..graph.traverse import reachable
from .atoms import (
    ONE,
    Atoms,
    Monomial,
    Number,
    Poly,
    Work,
    add,
    common,
    constant,
    freeze,
    inverse,
    join,
    multiply,
    number,
    ratio,
    scaled,
)
from .joined_angles import JoinedAngles

FEW = 3  #: terms up to which a sum of sines and cosines is taken for a product where it is one
MANY = 24  #: terms beyond which the sines and cosines of a sum are joined before it is used


class Expansion:
    """Polynomials of the nodes of one graph.

    Attributes
    ----------
    atoms : Atoms
    angles : JoinedAngles
        Simplifies sines and cosines.
    under_roots : set of int
        Sums of which roots were taken.
    """

    def __init__(self, graph: Graph, work: Work) -> None:
        self.graph = graph
        self.work = work
        self.atoms = Atoms()
        self.angles = JoinedAngles(self.atoms, work)
        self.under_roots: set[int] = set()
        self._of: dict[int, Poly] = {}

    def expand(self, i: int) -> Poly:
        """The polynomial of a node."""
        for k in reachable(self.graph, [i], stop=self._of):
            if k not in self._of:
                self._of[k] = self._expanded(k)
        return self._of[i]

    def put(self, i: int, poly: Poly) -> None:
        """Let a polynomial, such as a name, stand for a node from here on."""
        self._of[i] = poly

    def _expanded(self, i: int) -> Poly:
        kind, *args = self.graph.nodes[i]
        if kind == "const":
            value, of_pi = number(args[0])
            return {((self.atoms.id("pi", ""), 1),): value} if of_pi else constant(value)
        if kind == "sym":
            return self.atoms.poly("sym", args[0])
        parts = [self._of[k] for k in args]
        if kind in ("add", "sub"):
            return self._sum(parts[0], parts[1], 1 if kind == "add" else -1)
        if kind == "neg":
            return scaled(parts[0], -1)
        if kind in ("mul", "absorb"):
            return self.times(*parts)
        if kind == "div":
            return self.quotient(*parts)
        if kind == "sqrt":
            return self._root(parts[0])
        if kind in ("sin", "cos"):
            return self.angles.of_angle(kind, parts[0])
        return self.atoms.poly(kind, tuple(freeze(self.angles.simplified(p)) for p in parts))

    # -- arithmetic
    def times(self, a: Poly, b: Poly) -> Poly:
        """a b, multiplied out."""
        self.work.spend(len(a) * len(b))
        return self._settled(multiply(a, b))

    def _sum(self, a: Poly, b: Poly, sign: int) -> Poly:
        self.work.spend((len(a) + len(b)) // 4)
        total = add(a, b, sign)
        if len(total) > MANY:
            return self.angles.simplified(total)
        if 1 < len(total) <= FEW:  # a sum that is one product is multiplied and squared as one
            short = self.angles.simplified(total)
            return short if len(short) == 1 else total
        return total

    def _settled(self, a: Poly) -> Poly:
        """With sums to whole positive powers multiplied out again."""
        result: Poly = {}
        waiting = [a]
        while waiting:
            done: Poly = {}
            for given, x in waiting.pop().items():
                monomial, x = self.atoms.over_roots(self.atoms.without_squared_signs(given, "sum"), x)
                power = next((f for f in monomial if f[1] >= 1 and self.atoms.table[f[0]].kind == "sum"), None)
                if power is None:
                    done[monomial] = done.get(monomial, 0) + x
                    continue
                below = join(monomial, ((power[0], -1),))
                base = dict(self.atoms.table[power[0]].what)
                self.work.spend(len(base))
                waiting.append(multiply({below: x}, base))
            result = add(result, done) if result else done
        return result

    def quotient(self, a: Poly, b: Poly) -> Poly:
        """a / b"""
        b = self.angles.simplified(b)
        if not b:
            return self.atoms.poly("div", (freeze(a), freeze(b)))
        factor, below = split(b)
        ((monomial, x),) = factor.items()
        above = multiply(a, {inverse(monomial): ratio(1, x)})
        if below == {ONE: 1}:
            return self._settled(above)
        quotient = divided(above, below)
        if quotient is not None:
            return quotient
        return multiply(above, {((self.atoms.id("sum", freeze(below)), -1),): 1})

    def _root(self, a: Poly) -> Poly:
        a = self.angles.simplified(a)
        if not a or (len(a) == 1 and next(iter(a)) == ONE):
            return self.atoms.poly("sqrt", (freeze(a),))
        ((monomial, x),) = a.items() if len(a) == 1 else (((), 0),)
        if x == 1 and all(n % 2 == 0 for _, n in monomial):  # the root of a square
            base = tuple((atom, n // 2) for atom, n in monomial)
            return self.atoms.poly("abs", (freeze({base: 1}),))
        atom = self.atoms.id("sum", freeze(a))
        self.under_roots.add(atom)
        return {((atom, Fraction(1, 2)),): 1}


def content(values: Sequence[Number]) -> Number:
    """The largest fraction that divides all numbers into whole ones; 1 where one is no fraction."""
    if any(isinstance(x, float) for x in values):
        return 1
    above = gcd(*(Fraction(x).numerator for x in values))
    return ratio(above, lcm(*(Fraction(x).denominator for x in values)))


def shared(a: Poly) -> Monomial:
    """The largest monomial that divides all terms; of powers below zero the lowest, so that the rest has none."""
    terms = list(a)
    powers = dict(terms[0])
    for monomial in terms[1:]:
        others = dict(monomial)
        for atom in [k for k in powers if k not in others]:
            if powers[atom] > 0:
                del powers[atom]
        for atom, n in others.items():
            m = powers.get(atom)
            if m is None:
                if n < 0:
                    powers[atom] = n
            else:
                powers[atom] = min(m, n)
        for atom in [k for k, m in powers.items() if m < 0 and k not in others]:
            powers[atom] = min(powers[atom], 0)
    return tuple(sorted((k, m) for k, m in powers.items() if m))


def split(a: Poly) -> tuple[Poly, Poly]:
    """The common factor of a as a single term, and the rest, of leading sign +."""
    if len(a) == 1:
        return dict(a), {ONE: 1}
    monomial, amount = shared(a), content(list(a.values()))
    rest = multiply(a, {inverse(monomial): ratio(1, amount)})
    if rest[min(rest)] < 0:
        rest, amount = scaled(rest, -1), -amount
    return {monomial: amount}, rest


def _order(monomial: Monomial) -> tuple[tuple[int, Fraction | int], ...]:
    """Lexicographic order of monomials without denominators: a product keeps it."""
    return tuple((-atom, n) for atom, n in monomial)


def divided(a: Poly, b: Poly) -> Poly | None:
    """a / b where b, a sum without common factor, divides a; else None."""
    if len(a) < len(b):
        return None
    factor: Poly = {shared(a): 1}
    rest = multiply(a, {inverse(shared(a)): 1})
    lead = max(b, key=_order)
    result: Poly = {}
    for _ in range(2 * len(a)):
        if not rest:
            return multiply(result, factor)
        top = max(rest, key=_order)
        if common(top, lead) != lead:
            return None
        term = {join(top, inverse(lead)): ratio(rest[top], b[lead])}
        result = add(result, term)
        rest = add(rest, multiply(b, term), -1)
    return None
