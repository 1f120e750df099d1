"""Names for sums that several formulas share: the same values as before, by numbers, and fewer operations."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from eomgen.graph.core import Expr, Graph
from eomgen.simplify.atoms import Atoms, Poly, freeze
from eomgen.simplify.costs import Costs
from eomgen.simplify.form import simplify
from eomgen.simplify.inline import Named
from eomgen.simplify.shared_sums import SharedSums


def value(atoms: Atoms, poly: Poly, known: dict[int, float]) -> float:
    """A sum at numbers of its symbols and names."""
    total = 0.0
    for monomial, x in poly.items():
        term = float(x)
        for atom, n in monomial:
            kind, what = atoms.table[atom]
            term *= (value(atoms, dict(what), known) if kind == "factor" else known[atom]) ** float(n)
        total += term
    return total


def numbers(atoms: Atoms, named: Named, polys: list[Poly], known: dict[int, float]) -> list[float]:
    """The sums, each name worked out once those before it are."""
    known = dict(known)
    for atom, poly in named:
        known[atom] = value(atoms, poly, known)
    return [value(atoms, poly, known) for poly in polys]


def shared(atoms: Atoms, named: Named, polys: list[Poly]) -> tuple[Named, list[Poly]]:
    taken = {atom.what for atom in atoms.table if atom.kind in ("sym", "name")}
    return SharedSums(atoms, Costs(atoms), named, polys, taken, "z").shortened()


def table(count: int) -> tuple[Atoms, list[int], dict[int, float]]:
    atoms = Atoms()
    symbols = [atoms.id("sym", f"length_{k}") for k in range(count)]
    return atoms, symbols, {a: 0.7 + 0.31 * k for k, a in enumerate(symbols)}


def test_a_sum_with_its_own_name_beside_it_counts_twice() -> None:
    """N = a b + c d + e f; of a b + c d + e f + N comes 2 N."""
    atoms, s, known = table(8)
    sum_: Poly = {((s[0], 1), (s[1], 1)): 1, ((s[2], 1), (s[3], 1)): 1, ((s[4], 1), (s[5], 1)): 1}
    name = atoms.id("name", "N")
    polys: list[Poly] = [{**sum_, ((name, 1),): 1}, {((s[6], 1), (atoms.id("factor", freeze(sum_)), 2)): 3}]
    named, found = shared(atoms, [(name, sum_)], polys)
    assert found[0] == {((name, 1),): 2}
    assert found[1] == {((s[6], 1), (name, 2)): 3}
    assert numbers(atoms, named, found, known) == pytest.approx(numbers(atoms, [(name, sum_)], polys, known))


def test_what_is_subtracted_elsewhere_is_found_too() -> None:
    atoms, s, known = table(10)
    terms: list[Poly] = [{((s[k], 1), (s[k + 1], 1)): 1} for k in range(0, 8, 2)]
    plus = {m: x for term in terms for m, x in term.items()}
    minus = {m: -x for m, x in plus.items()}
    polys: list[Poly] = [{**plus, ((s[8], 1),): 1}, {**minus, ((s[9], 1),): 2}, {**plus, ((s[9], 2),): 1}]
    named, found = shared(atoms, [], polys)
    assert len(named) == 1
    assert [len(poly) for poly in found] == [2, 2, 2]
    assert numbers(atoms, named, found, known) == pytest.approx(numbers(atoms, [], polys, known))


@pytest.mark.parametrize("seed", range(20))
def test_random_sums_keep_their_values_and_their_order(seed: int) -> None:
    random = np.random.default_rng(seed)
    atoms, s, known = table(12)
    parts = [((int(a), 1), (int(b), 1)) for a, b in np.sort([random.choice(12, 2, replace=False) for _ in range(9)])]

    def some(count: int) -> Poly:
        chosen = random.choice(len(parts), count, replace=False)
        return {parts[k]: int(random.choice([1, 1, -1, 2])) for k in chosen}

    named: Named = []
    polys: list[Poly] = []
    for k in range(10):
        poly = some(int(random.integers(3, 8)))
        if named and random.random() < 0.5:
            poly[((named[-1][0], 1),)] = 1
        factor = atoms.id("factor", freeze(some(4)))
        poly[tuple(sorted([(int(s[k]), 1), (factor, 1)]))] = 1
        if random.random() < 0.4:
            named.append((atoms.id("name", f"n{k}"), poly))
        else:
            polys.append(poly)
    after, found = shared(atoms, named, polys)
    assert numbers(atoms, after, found, known) == pytest.approx(numbers(atoms, named, polys, known), rel=1e-12)
    costs = Costs(atoms)
    before = sum(costs.of_terms(p) for p in (*(p for _, p in named), *polys))
    assert sum(costs.of_terms(p) for p in (*(p for _, p in after), *found)) <= before


def test_entries_of_a_symmetric_matrix_get_no_name_for_coming_twice() -> None:
    graph = Graph()
    names = [graph.symbol(f"mass_{k}") for k in range(40)]
    entry: Expr = sum((a * b for a, b in zip(names[:8], names[8:16], strict=True)), graph.zero)
    root = sum((a * b for a, b in zip(names[16:28], names[28:40], strict=True)), graph.zero)
    given = [("part", root)]
    part = graph.symbol("part")
    form = simplify([entry + part * part, entry + part * part, part], given)
    assert form is not None
    named, flat = form.sympy()
    assert [str(name) for name, _ in named] == ["part"]
    assert sp.expand(flat[0] - flat[1]) == 0
