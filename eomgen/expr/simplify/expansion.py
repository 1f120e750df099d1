"""Nodes of a graph -> polynomials in atoms, multiplied out as far as that stays short."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from fractions import Fraction
from math import gcd, lcm
from typing import Any, Generic, TypeVar

from ..core import LEAVES, Graph, reachable
from .atoms import (
    ONE,
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

# -- sums of angles ----------------------------------------------------------------------------------------------------

# The terms of a polynomial are taken together by what stands beside their sines and cosines.  Of each such group,
# a polynomial in sines and cosines with numbers, several forms are made and the shortest is kept.


MULTIPLE = 4  #: of an angle, up to which its sine is written in those of the angle
GROUP = 48  #: terms of a group beyond which only its own terms are joined


class JoinedAngles:
    """Simplifies sines and cosines in polynomials over a table of atoms."""

    def __init__(self, atoms: Atoms, work: Work) -> None:
        self.atoms = atoms
        self.work = work
        self.costs = Costs(atoms)
        self._known: dict[Frozen, Poly] = {}

    # -- making
    def of_angle(self, kind: str, angle: Poly) -> Poly:
        """sin or cos of an angle; the angle's first term is made positive."""
        angle = self.simplified(angle)
        if not angle:
            return {} if kind == "sin" else {ONE: 1}
        factor = 1
        if angle[min(angle)] < 0:
            angle = scaled(angle, -1)
            factor = -1 if kind == "sin" else 1
        return {((self.atoms.id(kind, freeze(angle)), 1),): factor}

    # -- simplifying
    def simplified(self, poly: Poly) -> Poly:
        """The polynomial with the sines and cosines of each group joined."""
        groups: dict[Monomial, Poly] = {}
        for monomial, x in poly.items():
            turns = tuple(f for f in monomial if self._turns(f[0]))
            beside = tuple(f for f in monomial if not self._turns(f[0])) if turns else monomial
            group = groups.setdefault(beside, {})
            group[turns] = x
        if all(len(group) == 1 for group in groups.values()):
            return poly
        result: Poly = {}
        for beside, group in groups.items():
            short = self._group(group) if len(group) > 1 else group
            result = add(result, {join(beside, m): x for m, x in short.items()})
        return result

    def _turns(self, atom: int) -> bool:
        return self.atoms.table[atom].kind in TURNS

    def _group(self, group: Poly) -> Poly:
        amount = group[min(group)]
        unit = {m: ratio(x, amount) for m, x in group.items()}
        key = freeze(unit)
        result = self._known.get(key)
        if result is None:
            result = self._known[key] = min(self._forms(unit), key=self.costs.of_terms)
        return scaled(result, amount)

    def _forms(self, group: Poly) -> Iterator[Poly]:
        yield group
        if len(group) > GROUP:
            return
        below = self._denominator(group)
        if below:  # over the common denominator
            above = multiply(group, {inverse(below): 1})
            yield multiply(self._group(above) if len(above) > 1 else above, {below: 1})
        yield self._joined(group)
        for full in ("sin", "cos"):
            reduced = self._reduced(group, full)
            yield reduced
            yield self._joined(reduced)
        split = self._split(group)
        if split != group and len(split) <= 4 * GROUP:
            for full in ("sin", "cos"):
                reduced = self._reduced(split, full)
                yield reduced
                yield self._joined(reduced)
            yield self._joined(split)

    @staticmethod
    def _denominator(group: Poly) -> Monomial:
        lowest: dict[int, Any] = {}
        for monomial in group:
            for atom, n in monomial:
                if n < lowest.get(atom, 0):
                    lowest[atom] = n
        return tuple(sorted(lowest.items()))

    def _reduced(self, group: Poly, full: str) -> Poly:
        """With the squares of the other function replaced by 1 - full^2: a normal form of what has single angles."""
        other = "cos" if full == "sin" else "sin"
        result: Poly = {}
        waiting = dict(group)
        while waiting:
            monomial, x = waiting.popitem()
            square = next((a for a, n in monomial if n >= 2 and self.atoms.table[a].kind == other), None)
            if square is None:
                result = add(result, {monomial: x})
                continue
            self.work.spend(2)
            counterpart = self.atoms.id(full, self.atoms.table[square].what)
            rest = join(monomial, ((square, -2),))
            waiting = add(waiting, {rest: x, join(rest, ((counterpart, 2),)): -x})
        return result

    def _split(self, group: Poly) -> Poly:
        """With the sines and cosines of sums written in those of their parts."""
        result: Poly = {}
        for monomial, x in group.items():
            below = tuple(f for f in monomial if f[1] < 0)
            term: Poly = {below: x}
            for atom, n in (f for f in monomial if f[1] > 0):
                kind, angle = self.atoms.table[atom]
                for _ in range(int(n)):
                    term = multiply(term, self._parts(kind, angle))
            result = add(result, term)
            if len(result) > 4 * GROUP:
                return group
        return result

    def _parts(self, kind: str, angle: Frozen) -> Poly:
        terms = dict(angle)
        if any(isinstance(x, float) for x in terms.values()):
            return self.atoms.poly(kind, angle)
        first = min(terms)
        size = Fraction(terms[first])
        whole = size.denominator == 1 and abs(size) <= MULTIPLE
        if len(terms) == 1 and not (whole and abs(size) > 1):
            return self.atoms.poly(kind, angle)
        step = (1 if size > 0 else -1) if whole else terms[first]
        one: Poly = {first: step}
        rest = add(terms, {first: -step})
        s, c = (self.of_angle(k, one) for k in TURNS)
        other_s, other_c = (self._parts_of(k, rest) for k in TURNS)
        if kind == "sin":
            return add(multiply(s, other_c), multiply(c, other_s))
        return add(multiply(c, other_c), multiply(s, other_s), -1)

    def _parts_of(self, kind: str, angle: Poly) -> Poly:
        made = self.of_angle(kind, angle)
        result: Poly = {}
        for monomial, x in made.items():
            if not monomial:
                result = add(result, {ONE: x})
                continue
            ((atom, _),) = monomial
            result = add(result, self._parts(*self.atoms.table[atom]), x)
        return result

    # -- joining two terms to one
    def _joined(self, group: Poly) -> Poly:
        """The changes that shorten most, until none shortens."""
        result = dict(group)
        for _ in range(2 * len(group)):
            self.work.spend(8 * len(result))
            gains = [(self.costs.of_change(result, change), change) for change in self._steps(result)]
            gains = sorted((g for g in gains if g[0] < 0.0), key=lambda g: (g[0], freeze(g[1])))
            if not gains:
                return result
            touched: set[Monomial] = set()
            for _gain, change in gains:
                if touched.isdisjoint(change):
                    touched.update(change)
                    result = add(result, change)
        return result

    def _steps(self, group: Poly) -> Iterator[Poly]:
        """Changes that are zero by a theorem and take two terms away."""
        result: dict[tuple[Monomial, Frozen, Frozen], dict[tuple[str, str], Number]] = {}
        for monomial, x in group.items():
            for rest, first, second in self._pairs(monomial):
                (ka, a), (kb, b) = sorted((self.atoms.table[i] for i in (first, second)), key=lambda atom: atom.what)
                kinds = result.setdefault((rest, a, b), {})
                kinds[ka, kb] = x
        for (rest, a, b), kinds in result.items():
            yield from self._sums(rest, a, b, kinds)

    def _pairs(self, monomial: Monomial) -> Iterator[tuple[Monomial, int, int]]:
        above = [f for f in monomial if f[1] > 0]
        for i, (a, n) in enumerate(above):
            if n >= 2:
                yield join(monomial, ((a, -2),)), a, a
            for b, _ in above[i + 1 :]:
                yield join(monomial, inverse(((a, 1), (b, 1)))), a, b

    def _product(self, rest: Monomial, *factors: tuple[str, Frozen]) -> Monomial:
        for kind, angle in factors:
            rest = join(rest, ((self.atoms.id(kind, angle), 1),))
        return rest

    def _sums(self, rest: Monomial, a: Frozen, b: Frozen, kinds: dict[tuple[str, str], Number]) -> Iterator[Poly]:
        both, less = add(dict(a), dict(b)), add(dict(a), dict(b), -1)
        for first, second, made in ((("cos", "cos"), ("sin", "sin"), "cos"), (("sin", "cos"), ("cos", "sin"), "sin")):
            x, y = kinds.get(first), kinds.get(second)
            if x is None or y is None or abs(x) != abs(y):
                continue
            if a == b and first != second and made == "sin":
                continue
            alike = x == y
            angle = less if (made == "cos") == alike else both
            change = {self._product(rest, (first[0], a), (first[1], b)): -x}
            change = add(change, {self._product(rest, (second[0], a), (second[1], b)): -y})
            yield add(change, multiply(self.of_angle(made, angle), {rest: x}))


# -- polynomials -------------------------------------------------------------------------------------------------------


Made = TypeVar("Made")


class OfNodes(ABC, Generic[Made]):
    """What is made of the nodes of a graph, of each once, from its operands."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self._of: dict[int, Made] = {}

    def put(self, i: int, made: Made) -> None:
        """Let something, such as a name, stand for a node from here on."""
        self._of[i] = made

    def of(self, i: int) -> Made:
        """What is made of a node."""
        for k in reachable(self.graph, [i], stop=self._of):
            if k not in self._of:
                self._of[k] = self._made(k, *self.graph.nodes[k])
        return self._of[i]

    @abstractmethod
    def _made(self, i: int, kind: str, *args: Any) -> Made:
        """Of a node whose operands are made."""


class Expansion(OfNodes[Poly]):
    """Polynomials of the nodes of one graph, multiplied out; ``under_roots`` are sums of which roots were taken."""

    def __init__(self, graph: Graph, work: Work) -> None:
        super().__init__(graph)
        self.work = work
        self.atoms = Atoms()
        self.angles = JoinedAngles(self.atoms, work)
        self.under_roots: set[int] = set()

    def _made(self, i: int, kind: str, *args: Any) -> Poly:
        if kind in LEAVES:
            return self.atoms.leaf(kind, args[0])
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
        return self._rounded(multiply(a, b))

    def _sum(self, a: Poly, b: Poly, sign: int) -> Poly:
        self.work.spend((len(a) + len(b)) // 4)
        return add(a, b, sign)

    def _rounded(self, a: Poly) -> Poly:
        """With sums to whole positive powers multiplied out again."""
        result: Poly = {}
        waiting = [a]
        while waiting:
            done: Poly = {}
            for powers, x in waiting.pop().items():
                monomial = self.atoms.without_squared_signs(powers, "sum")
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
            return self._rounded(above)
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
