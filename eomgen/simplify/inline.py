"""Stage simplify: names that are not worth their place -> what they stand for."""

from __future__ import annotations

from .atoms import Poly, TooLongError, add, join, multiply, ratio
from .expansion import Expansion
from .factoring import Factoring

NAME = 20.0  #: what a name costs a reader, beyond its definition
ONCE = 60.0  #: length up to which a definition that is used once is put in its place
EACH = 40  #: products of terms for one expression, by its length

Named = list[tuple[int, Poly]]  #: the atom of each name and what it stands for


def inlined(expansion: Expansion, factoring: Factoring, named: Named, polys: list[Poly]) -> tuple[Named, list[Poly]]:
    """Without names that are not worth it."""
    costs = factoring.costs.of_terms
    every = [*named, *((-1, poly) for poly in polys)]
    kept = []
    for k in range(len(named)):
        atom, value = every[k]
        users = [n for n in range(k + 1, len(every)) if atom in expansion.atoms.names(every[n][1])]
        if len(value) == 1 and len(users) > 1:  # named without its symbols and numbers, which may cancel
            inner, outer = _parted(expansion, value)
            moved = multiply({((atom, 1),): 1}, outer)
            put = [_put_in(expansion, factoring, every[n][1], atom, moved) for n in users]
            if inner != value and all(p is not None for p in put):
                for n, p in zip(users, put, strict=True):
                    every[n] = (every[n][0], p or {})
                every[k] = (atom, value := inner)
        tried = None
        if len(value) == 1 or len(users) == 1:
            tried = [_put_in(expansion, factoring, every[n][1], atom, value) for n in users]
        if tried is None or any(p is None for p in tried):
            kept.append(k)
            continue
        gain = NAME + costs(value) + sum(costs(every[n][1]) - costs(p) for n, p in zip(users, tried, strict=True) if p)
        if gain < 0 or (len(users) == 1 and costs(value) > ONCE):
            kept.append(k)
            continue
        for n, p in zip(users, tried, strict=True):
            every[n] = (every[n][0], p or {})
    return [every[k] for k in kept], [p for a, p in every if a < 0]


def _parted(expansion: Expansion, value: Poly) -> tuple[Poly, Poly]:
    """A single term as a product of what is worth a name, and of symbols and numbers."""
    ((monomial, x),) = value.items()
    plain = tuple(f for f in monomial if expansion.atoms.table[f[0]].kind in ("sym", "pi"))
    rest = tuple(f for f in monomial if f not in plain)
    return ({rest: 1}, {plain: x}) if rest else (value, {(): 1})


def _put_in(expansion: Expansion, factoring: Factoring, poly: Poly, atom: int, value: Poly) -> Poly | None:
    """A polynomial with the value of a name in its place, None where that cannot be told."""
    if not _can_replace(expansion, poly, atom, value):
        return None
    replaced = _replaced(poly, atom, value)
    try:
        with expansion.work.at_most(EACH * len(replaced)):
            return factoring.factored(expansion.angles.simplified(replaced))
    except TooLongError:
        return replaced


def _can_replace(expansion: Expansion, poly: Poly, atom: int, value: Poly) -> bool:
    for m in poly:
        for a, n in m:
            if a == atom and (n != int(n) or (n < 0 and len(value) != 1)):
                return False
            if a != atom and atom in expansion.atoms.names({((a, 1),): 1}):
                return False
    return True


def _replaced(poly: Poly, atom: int, value: Poly) -> Poly:
    result: Poly = {}
    for m, x in poly.items():
        power = next((n for a, n in m if a == atom), 0)
        if not power:
            result = add(result, {m: x})
            continue
        rest = tuple((a, n) for a, n in m if a != atom)
        if len(value) == 1:
            ((monomial, y),) = value.items()
            n = int(power)
            factor = y**n if n >= 0 else ratio(1, y**-n)
            term = {join(rest, tuple((a, k * n) for a, k in monomial)): x * factor}
        else:
            term = {rest: x}
            for _ in range(int(power)):
                term = multiply(term, value)
        result = add(result, term)
    return result
