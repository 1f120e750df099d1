"""Stage simplify: sums that stand in several others of a form -> a name for each, where that is shorter.

Common sub-sums are taken out greedily, those that save most first, as common factors are in :mod:`.factoring`, with a
length for readers as the cost.  A sum that has a name already is found in others too.
"""

from __future__ import annotations

import itertools
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator
from fractions import Fraction

from .atoms import Atoms, Frozen, Monomial, Poly, add, freeze, multiply, scaled
from .costs import Costs
from .inline import Named

NEW = 80.0  #: length that a further name has to save; a reader looks each one up
SHORT = 4.0  #: length of a name
ROUNDS = 30
NEAR = 40  #: other sums with a term up to which pairs are formed by it
LARGE = 60  #: terms of a sum that is compared with others


class SharedSums:
    """Finds what sums have in common, term by term, and puts names in its place.

    Parameters
    ----------
    atoms, costs
        Those of the form.
    named, polys
        The form.
    taken : collection of str
        Names that are not free.
    prefix : str
        New names are this and a number.
    """

    def __init__(
        self, atoms: Atoms, costs: Costs, named: Named, polys: list[Poly], taken: Collection[str], prefix: str
    ) -> None:
        self.atoms, self.costs = atoms, costs
        self.named, self.polys = list(named), list(polys)
        free = (f"{prefix}{k}" for k in itertools.count())
        self._free = (name for name in free if name not in taken)

    def shortened(self) -> tuple[Named, list[Poly]]:
        """The form with names for what its sums share."""
        for _ in range(ROUNDS):
            chosen = self._chosen()
            if not chosen:
                break
            for one in chosen:
                self._put_name(one)
        return self.named, self.polys

    # -- what is shared -----------------------------------------------------------------------------------------------
    def _sums(self) -> Counter[Frozen]:
        """Sums of the form and how often each is written."""
        found: Counter[Frozen] = Counter()

        def look_into(poly: Poly) -> None:
            for monomial in poly:
                for atom, _ in monomial:
                    kind, what = self.atoms.table[atom]
                    if kind == "factor":
                        found[what] += 1
                        look_into(dict(what))

        outputs = {freeze(poly): poly for poly in self.polys}  # one that comes twice, as M_12 and M_21, is told once
        for poly in (*(poly for _, poly in self.named), *outputs.values()):
            if len(poly) > 1:
                found[freeze(poly)] += 1
            look_into(poly)
        return found

    def _shared(self, sums: Collection[Frozen]) -> Iterator[Frozen]:
        """Sums of which at least two sums hold all terms, or all of them with the other sign."""
        dicts = [dict(one) for one in sums if len(one) <= LARGE]
        holders: defaultdict[Monomial, list[int]] = defaultdict(list)
        for k, one in enumerate(dicts):
            for monomial in one:
                holders[monomial].append(k)
        together: Counter[tuple[int, int]] = Counter()
        for of in holders.values():
            if len(of) <= NEAR:
                together.update(itertools.combinations(of, 2))
        for (a, b), count in together.items():
            if count > 1:
                for sign in (1, -1):
                    common = {m: x for m, x in dicts[a].items() if dicts[b].get(m) == sign * x}
                    if len(common) > 1:
                        yield _signed(common)

    def _chosen(self) -> list[Frozen]:
        """What saves most, as far as no two of them stand in the same sum."""
        sums = self._sums()
        dicts = {one: dict(one) for one in sums}
        known = {_signed(poly) for _, poly in self.named if len(poly) > 1}
        candidates = dict.fromkeys(
            [*self._shared(sums), *known, *(_signed(dicts[s]) for s, n in sums.items() if n > 1)]
        )
        holders: defaultdict[Monomial, list[Frozen]] = defaultdict(list)
        for one in sums:
            for monomial, _ in one:
                holders[monomial].append(one)
        found: list[tuple[float, Frozen, list[Frozen]]] = []
        for one in candidates:
            rarest = min((m for m, _ in one), key=lambda m: len(holders[m]))
            within = [other for other in holders[rarest] if _sign(dicts[other], one)]
            uses, length = sum(sums[other] for other in within), self.costs.of_terms(dict(one))
            saved = uses * (length - SHORT) - (length - SHORT if one in known else length + NEW)
            if saved > 0:
                found.append((-saved, one, within))
        chosen: list[Frozen] = []
        touched: set[Frozen] = set()
        for _, one, within in sorted(found):
            if touched.isdisjoint(within):
                chosen.append(one)
                touched.update(within)
        return chosen

    # -- names --------------------------------------------------------------------------------------------------------
    def _put_name(self, one: Frozen) -> None:
        """Put a name for a sum, in front of the first that uses it, into all sums that hold it."""
        place = next((k for k, (_, p) in enumerate(self.named) if len(p) > 1 and _signed(p) == one), None)
        if place is None:
            atom, poly = self.atoms.id("name", next(self._free)), dict(one)
            others = self.named
        else:
            atom, poly = self.named[place]
            others = [*self.named[:place], *self.named[place + 1 :]]
        name: Poly = {((atom, 1),): 1 if _signed(poly) == freeze(poly) else -1}
        new: dict[int, Poly] = {}
        changed = [(a, self._replaced(p, one, name, new)) for a, p in others]
        same = (k for k, ((_, p), (_, old)) in enumerate(zip(changed, others, strict=True)) if p is not old)
        first = next(same, None) if place is None else min(next(same, place), place)
        if first is None:  # what is asked for alone uses it: behind what it is made of
            within = self.atoms.names(poly)
            first = max((k + 1 for k, (a, _) in enumerate(changed) if a in within), default=0)
        self.polys = [self._replaced(p, one, name, new) for p in self.polys]
        self.named = [*changed[:first], (atom, poly), *changed[first:]]

    def _replaced(self, poly: Poly, one: Frozen, name: Poly, new: dict[int, Poly]) -> Poly:
        """A sum with the name in it, in the factors of its terms too; itself where nothing changes."""
        if sign := _sign(poly, one):
            inside = dict(one)
            found = add({m: x for m, x in poly.items() if m not in inside}, name, sign)
        else:
            found = poly
        terms = {m: self._term(m, one, name, new) for m in found}
        if all(term is None for term in terms.values()):
            return found
        result: Poly = {}
        for m, x in found.items():
            result = add(result, terms[m] or {m: 1}, x)
        return result

    def _term(self, monomial: Monomial, one: Frozen, name: Poly, new: dict[int, Poly]) -> Poly | None:
        """A product with the name in its factors; None where nothing changes."""
        result: Poly | None = None
        for atom, n in monomial:
            kind, what = self.atoms.table[atom]
            if kind != "factor":
                continue
            if atom not in new:
                before = dict(what)
                after = self._replaced(before, one, name, new)
                new[atom] = {} if after is before else after
            if new[atom]:
                power = self._power(new[atom], n)
                if power is not None:
                    result = multiply(result or {monomial: 1}, multiply(power, {((atom, -n),): 1}))
        return result

    def _power(self, inner: Poly, n: Fraction | int) -> Poly | None:
        """A power of a factor; None of a root of what is subtracted."""
        if len(inner) > 1:
            return {((self.atoms.id("factor", freeze(inner)), n),): 1}
        ((monomial, x),) = inner.items()
        if x == 1 or (x == -1 and n == int(n)):
            return {tuple((a, k * n) for a, k in monomial): 1 if x == 1 or n % 2 == 0 else -1}
        return None


def _signed(poly: Poly) -> Frozen:
    """A sum, or its opposite: the one whose first term is added."""
    key = freeze(poly)
    return key if key[0][1] > 0 else freeze(scaled(poly, -1))


def _sign(poly: Poly, one: Frozen) -> int:
    """1 where a sum holds all terms of another, -1 where it holds them with the other sign, else 0."""
    ((first, x), *others) = one
    sign = 1 if poly.get(first) == x else -1 if poly.get(first) == -x else 0
    return sign if sign and all(poly.get(m) == sign * y for m, y in others) else 0
