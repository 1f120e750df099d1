"""Names of intermediates, which are worth their place and which are not."""

from __future__ import annotations

import itertools
import re
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Sequence
from fractions import Fraction

from .atoms import SUMS, TURNS, Atoms, Costs, Frozen, Monomial, Poly, TooLongError, add, freeze, multiply, ratio, scaled
from .expansion import Expansion
from .factoring import Factoring

# -- names that are not worth their place ------------------------------------------------------------------------------


NAME = 20.0  #: what a name costs a reader, beyond its definition
ONCE = 60.0  #: length up to which a definition that is used once is put in its place
FEW = 6  #: terms of a sum in a product that is multiplied out when a name in it is replaced
EACH = 40  #: products of terms for one expression, by its length

Named = list[tuple[int, Poly]]  #: the atom of each name and what it stands for


def is_plain(poly: Poly, atoms: Atoms) -> bool:
    """Whether it reads as well as a name: a number, a power of one quantity, a product of two symbols.

    A choice between values in which there is another is none: chains of them would double with each.
    """
    if len(poly) != 1:
        return not poly
    (monomial,) = poly
    if len(monomial) == 1 and atoms.choices_in(monomial[0][0]) > 1:
        return False
    return len(monomial) < 2 or (len(monomial) == 2 and all(atoms.table[a].kind == "sym" for a, _ in monomial))


def inlined(
    expansion: Expansion, factoring: Factoring, named: Named, polys: list[Poly], fixed: Collection[int] = ()
) -> tuple[Named, list[Poly]]:
    """Without names that are not worth it; the atoms in ``fixed`` keep theirs unless they read as well without."""
    costs = factoring.costs.of_terms
    every = [*named, *((-1, poly) for poly in polys)]
    names_in = [expansion.atoms.names(poly) for _, poly in every]
    kept: list[int] = []
    same: dict[Frozen, Poly] = {}

    def keep(k: int, value: Poly) -> None:
        kept.append(k)
        same[freeze(value)] = {((every[k][0], 1),): 1}

    def replace(n: int, poly: Poly) -> None:
        every[n] = (every[n][0], poly)
        names_in[n] = expansion.atoms.names(poly)

    for k in range(len(named)):
        atom, value = every[k]
        value = same.get(freeze(value), value)  # of two of one value the second is the first
        users = [n for n in range(k + 1, len(every)) if atom in names_in[n]]
        if len(value) == 1 and len(users) > 1 and atom not in fixed:
            # named without its symbols and numbers, which may cancel
            inner, outer = _parted(expansion, value)
            moved = multiply({((atom, 1),): 1}, outer)
            put = [_substituted(expansion, factoring, every[n][1], atom, moved) for n in users]
            if inner != value and all(p is not None for p in put):
                for n, p in zip(users, put, strict=True):
                    replace(n, p or {})
                value = same.get(freeze(inner), inner)
                replace(k, inner)
        tried = None
        if is_plain(value, expansion.atoms) or (atom not in fixed and (len(value) == 1 or len(users) == 1)):
            tried = [_substituted(expansion, factoring, every[n][1], atom, value) for n in users]
        if tried is None or any(p is None for p in tried):
            keep(k, value)
            continue
        gain = NAME + costs(value) + sum(costs(every[n][1]) - costs(p) for n, p in zip(users, tried, strict=True) if p)
        if not is_plain(value, expansion.atoms) and (gain < 0 or (len(users) == 1 and costs(value) > ONCE)):
            keep(k, value)
            continue
        for n, p in zip(users, tried, strict=True):
            replace(n, p or {})
    return [every[k] for k in kept], [p for a, p in every if a < 0]


def _parted(expansion: Expansion, value: Poly) -> tuple[Poly, Poly]:
    """A single term as a product of what is worth a name, and of symbols and numbers."""
    ((monomial, x),) = value.items()
    plain = tuple(f for f in monomial if expansion.atoms.table[f[0]].kind in ("sym", "pi"))
    rest = tuple(f for f in monomial if f not in plain)
    if not rest:
        return value, {(): 1}
    kind, what = expansion.atoms.table[rest[0][0]]
    inner = dict(what) if len(rest) == 1 and rest[0][1] == 1 and kind in SUMS else {rest: 1}
    return inner, {plain: x}


def _substituted(expansion: Expansion, factoring: Factoring, poly: Poly, atom: int, value: Poly) -> Poly | None:
    """A polynomial with the value of a name in its place, None where that is not known."""
    if not _can_replace(expansion.atoms, poly, atom, value):
        return None
    replaced = _replaced(expansion.atoms, poly, atom, value)
    try:
        with expansion.work.at_most(EACH * factoring.costs.of_terms(replaced)):
            return factoring.factored(expansion.angles.simplified(replaced))
    except TooLongError:
        return replaced


def _can_replace(atoms: Atoms, poly: Poly, atom: int, value: Poly) -> bool:
    for m in poly:
        for a, n in m:
            if a == atom:
                if n != int(n) or (n < 0 and len(value) != 1):
                    return False
            elif atom in atoms.names_in(a):
                kind, what = atoms.table[a]
                if kind not in SUMS or not _can_replace(atoms, dict(what), atom, value):
                    return False
    return True


def _replaced(atoms: Atoms, poly: Poly, atom: int, value: Poly) -> Poly:
    result: Poly = {}
    for m, x in poly.items():
        term: Poly = {(): x}
        for a, n in m:
            if a == atom:
                term = multiply(term, _power(value, int(n)))
            elif atom in atoms.names_in(a):
                kind, what = atoms.table[a]
                inner = _replaced(atoms, dict(what), atom, value)
                if kind == "factor" and n == 1 and len(inner) <= FEW:  # so that its terms may join
                    term = multiply(term, inner)
                else:
                    term = multiply(term, {((atoms.id(kind, freeze(inner)), n),): 1})
            else:
                term = multiply(term, {((a, n),): 1})
        result = add(result, term)
    return result


def _power(value: Poly, n: int) -> Poly:
    if len(value) == 1:
        ((monomial, x),) = value.items()
        return {tuple((a, k * n) for a, k in monomial): x**n if n >= 0 else ratio(1, x**-n)}
    result: Poly = {(): 1}
    for _ in range(n):
        result = multiply(result, value)
    return result


# -- names that say what they are --------------------------------------------------------------------------------------


NUMBERED = re.compile(r"([A-Za-z]+?)_?(\d+)")
LETTERED = re.compile(r"([A-Za-z]+)_([A-Za-z])")
ROOT, BELOW = "r", "D"  #: begin names of roots and of denominators
LONG = 30.0  #: length of a root or denominator from which it is worth a name
CONSTANT = "k"  #: begins names of what parameters and numbers alone give


class GoodNames:
    """Chooses names."""

    def __init__(self, atoms: Atoms, costs: Costs, parameters: Collection[str], taken: Collection[str]) -> None:
        self.atoms, self.costs, self.parameters = atoms, costs, parameters
        self._taken = set(taken)
        self.turns: dict[int, str] = {}  #: of sines and cosines that are worth one
        self.intermediates: dict[str, str] = {}  #: better names of intermediates
        #: of long sums in several roots and denominators: the name of the root and 2, or of the sum and 1
        self.roots: dict[int, tuple[str, int]] = {}

    def choose_roots(self, named: Named, polys: Sequence[Poly]) -> None:
        """Of a form, the long sums that are written several times in roots and denominators."""
        uses: Counter[int] = Counter()
        in_root: set[int] = set()
        for poly in (*(poly for _, poly in named), *polys):
            for atom, n in self.atoms.factors(poly):
                if self.atoms.table[atom].kind in SUMS and (n < 0 or n != int(n)):
                    uses[atom] += 1
                    in_root.update([atom] if n != int(n) else [])
        for atom, count in sorted(uses.items()):
            length = self.costs.of_atom(atom)
            if length >= LONG and (count - 1) * length > 2 * count + NAME:
                name = self._free(ROOT if atom in in_root else BELOW)
                self.roots[atom] = name, 2 if atom in in_root else 1
                self._taken.add(name)

    def choose(self, named: Named, polys: Sequence[Poly], prefix: str) -> None:
        """Of a form with intermediates, those that begin with ``prefix`` and a number get better names."""
        every = [*(poly for _, poly in named), *polys]
        turns = (a for poly in every for a, _ in self.atoms.factors(poly) if self.atoms.table[a].kind in TURNS)
        for atom, uses in sorted(Counter(turns).items()):
            name = self._of_turn(atom)
            saved = uses * (self.costs.of_atom(atom) - len(name)) - self.costs.of_atom(atom) - NAME
            if saved > 0 and name not in self._taken:
                self.turns[atom] = name
                self._taken.add(name)
        numbered = re.compile(re.escape(prefix) + r"\d+")
        self._taken -= {text for atom, _ in named if numbered.fullmatch(text := self.atoms.table[atom].what)}
        constant: set[int] = set()
        for atom, poly in named:
            text = self.atoms.table[atom].what
            if self._is_constant(poly, constant):
                constant.add(atom)
            if numbered.fullmatch(text):
                better = self._of_sum(poly)
                if better is None or better in self._taken:
                    better = self._free(CONSTANT if atom in constant else prefix)
                self.intermediates[text] = better
                self._taken.add(better)

    def _of_turn(self, atom: int) -> str:
        kind, angle = self.atoms.table[atom]
        symbols = [self.atoms.table[a] for monomial, _ in angle for a, _ in monomial]
        plain = all(x in (1, -1) and len(monomial) == 1 and monomial[0][1] == 1 for monomial, x in angle)
        if not plain or any(s.kind != "sym" for s in symbols):
            return self._free(kind[0])
        parts = [NUMBERED.fullmatch(s.what) for s in symbols]
        signs = "".join("" if x > 0 else "m" for _, x in angle)
        if all(parts) and len({p[1] for p in parts if p}) == 1 and not signs:
            digits = [p[2] for p in parts if p]
            return f"{kind[0]}_{('' if max(map(len, digits)) == 1 else '_').join(digits)}"
        return f"{kind[0]}_" + "_".join(
            ("" if x > 0 else "m") + s.what for s, (_, x) in zip(symbols, angle, strict=True)
        )

    def _of_sum(self, poly: Poly) -> str | None:
        """m_12 of m1 + m2, m_FR of m_F + m_R."""
        if any(
            x != 1 or len(m) != 1 or m[0][1] != 1 or self.atoms.table[m[0][0]].kind != "sym" for m, x in poly.items()
        ):
            return None
        names = [self.atoms.table[m[0][0]].what for m in poly]
        for pattern in (NUMBERED, LETTERED):
            parts = [part for name in names if (part := pattern.fullmatch(name))]
            if len(parts) == len(names) > 1 and len({part[1] for part in parts}) == 1:
                below = [part[2] for part in parts]
                return f"{parts[0][1]}_{('' if max(map(len, below)) == 1 else '_').join(below)}"
        return None

    def _is_constant(self, poly: Poly, constant: set[int]) -> bool:
        """Whether parameters and numbers alone are in it."""
        table = ((a, *self.atoms.table[a]) for a in self.atoms.all_in(poly))
        return not any(
            (kind == "sym" and what not in self.parameters) or (kind == "name" and a not in constant)
            for a, kind, what in table
        )

    def _free(self, stem: str) -> str:
        return next(name for k in range(10**9) if (name := f"{stem}{k}") not in self._taken)


# -- sums that stand in several others ---------------------------------------------------------------------------------

# Common sub-sums are taken out greedily, those that save most first, as common factors are in :mod:`.factoring`, with a
# length for readers as the cost.  A sum that has a name already is found in others too.


NEW = 80.0  #: length that a further name has to save; a reader looks each one up
SHORT = 4.0  #: length of a name
ROUNDS = 30
NEAR = 40  #: other sums with a term up to which pairs are formed by it
LARGE = 60  #: terms of a sum that is compared with others


class SharedSums:
    """Finds what sums have in common, term by term, and puts names in its place: the prefix and a number."""

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
        result: Counter[Frozen] = Counter()
        outputs = {freeze(poly): poly for poly in self.polys}  # one that comes twice, as M_12 and M_21, counts once
        for poly in (*(poly for _, poly in self.named), *outputs.values()):
            if len(poly) > 1:
                result[freeze(poly)] += 1
            inside = (self.atoms.table[a] for a, _ in self.atoms.factors(poly, ("factor",)))
            result.update(what for kind, what in inside if kind == "factor")
        return result

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
        result: list[tuple[float, Frozen, list[Frozen]]] = []
        for one in candidates:
            rarest = min((m for m, _ in one), key=lambda m: len(holders[m]))
            within = [other for other in holders[rarest] if _sign(dicts[other], one)]
            uses, length = sum(sums[other] for other in within), self.costs.of_terms(dict(one))
            saved = uses * (length - SHORT) - (length - SHORT if one in known else length + NEW)
            if saved > 0:
                result.append((-saved, one, within))
        chosen: list[Frozen] = []
        touched: set[Frozen] = set()
        for _, one, within in sorted(result):
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
        if first is None:  # outputs alone use it: behind what it is made of
            within = self.atoms.names(poly)
            first = max((k + 1 for k, (a, _) in enumerate(changed) if a in within), default=0)
        self.polys = [self._replaced(p, one, name, new) for p in self.polys]
        self.named = [*changed[:first], (atom, poly), *changed[first:]]

    def _replaced(self, poly: Poly, one: Frozen, name: Poly, new: dict[int, Poly]) -> Poly:
        """A sum with the name in it, in the factors of its terms too; itself where nothing changes."""
        if sign := _sign(poly, one):
            inside = dict(one)
            collected = add({m: x for m, x in poly.items() if m not in inside}, name, sign)
        else:
            collected = poly
        terms = {m: self._term(m, one, name, new) for m in collected}
        if all(term is None for term in terms.values()):
            return collected
        result: Poly = {}
        for m, x in collected.items():
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
