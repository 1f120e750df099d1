"""Stage simplify: names that are not worth their place -> what they stand for."""

from __future__ import annotations

from collections.abc import Collection

from .atoms import SUMS, Atoms, Frozen, Poly, TooLongError, add, freeze, multiply, ratio
from .expansion import Expansion
from .factoring import Factoring

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
    held = [expansion.atoms.names(poly) for _, poly in every]
    kept: list[int] = []
    same: dict[Frozen, Poly] = {}

    def keep(k: int, value: Poly) -> None:
        kept.append(k)
        same[freeze(value)] = {((every[k][0], 1),): 1}

    def put_in(n: int, poly: Poly) -> None:
        every[n] = (every[n][0], poly)
        held[n] = expansion.atoms.names(poly)

    for k in range(len(named)):
        atom, value = every[k]
        value = same.get(freeze(value), value)  # of two of one value the second is the first
        users = [n for n in range(k + 1, len(every)) if atom in held[n]]
        if len(value) == 1 and len(users) > 1 and atom not in fixed:
            # named without its symbols and numbers, which may cancel
            inner, outer = _parted(expansion, value)
            moved = multiply({((atom, 1),): 1}, outer)
            put = [_put_in(expansion, factoring, every[n][1], atom, moved) for n in users]
            if inner != value and all(p is not None for p in put):
                for n, p in zip(users, put, strict=True):
                    put_in(n, p or {})
                value = same.get(freeze(inner), inner)
                put_in(k, inner)
        tried = None
        if is_plain(value, expansion.atoms) or (atom not in fixed and (len(value) == 1 or len(users) == 1)):
            tried = [_put_in(expansion, factoring, every[n][1], atom, value) for n in users]
        if tried is None or any(p is None for p in tried):
            keep(k, value)
            continue
        gain = NAME + costs(value) + sum(costs(every[n][1]) - costs(p) for n, p in zip(users, tried, strict=True) if p)
        if not is_plain(value, expansion.atoms) and (gain < 0 or (len(users) == 1 and costs(value) > ONCE)):
            keep(k, value)
            continue
        for n, p in zip(users, tried, strict=True):
            put_in(n, p or {})
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


def _put_in(expansion: Expansion, factoring: Factoring, poly: Poly, atom: int, value: Poly) -> Poly | None:
    """A polynomial with the value of a name in its place, None where that cannot be told."""
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
