"""Expressions -> the forms in which a hand would write them.

Several ways to share what is used more than once are tried, from everything written out to a name for each shared part,
and the shortest is taken.  Each part by itself is multiplied out, its sines and cosines are joined, and it is factored.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import field
from typing import Any

from ...base.operations import CONDITION, operations_with
from ..core import LEAVES, Expr, Graph, common_graph, operands, reachable
from ..records import Record
from .atoms import ONE, TURNS, Frozen, Poly, TooLongError, Work, freeze, scaled
from .expansion import Expansion
from .factoring import Factoring, Literal, Mixed, Parts, with_signs, without_exact_quotients
from .names import EACH, NAME, GoodNames, Named, SharedSums, inlined, is_plain

WHOLE = (10**9,)
SIZES = (1, 6, 16, 40, 120, *WHOLE)
NAMED_FROM = 30  #: operations of what is used once beyond which it gets a name in the first attempt
WRITTEN = 4_000  #: operations beyond which an attempt is not made
WORK = 100_000  #: products of terms in all attempts together
LATER = 10_000  #: products of terms that are left in any case for names that are put in
WORSE = 1.15  #: how much longer an attempt is after which none with fewer names is made
SHARED = 1.35  #: how much longer what needs no names may be


class Form(Record):
    """Polynomials in atoms, in which names stand for others."""

    graph: Graph
    expansion: Expansion
    factoring: Factoring
    named: Named = field(repr=False)  #: in an order in which each uses only those before it
    polys: list[Poly] = field(repr=False)

    @property
    def cost(self) -> float:
        """The length for a reader."""
        costs = self.factoring.costs
        return (
            sum(costs.of_terms(p) for _, p in self.named)
            + NAME * len(self.named)
            + sum(map(costs.of_terms, self.polys))
        )

    def sympy(
        self,
        symbols: Callable[[str], Any] | None = None,
        parameters: Collection[str] = (),
        prefix: str = "z",
        roots: bool = False,
    ) -> tuple[list[tuple[Any, Any]], list[Any]]:
        """Named intermediates, each a symbol and its expression, and expressions.

        ``symbols`` makes SymPy objects of names, ``parameters`` names what is constant.  Names that begin with
        ``prefix`` are changed for better ones where there are any; with ``roots`` long roots and denominators that are
        written several times get names too.
        """
        import sympy

        from .to_sympy import Raising, in_one_fashion

        raising = Raising(self.graph, self.expansion.atoms, self.factoring, symbols or sympy.Symbol)
        named: list[tuple[Any, Any]] = []
        good = self._good_names(parameters, prefix, roots)
        waiting, known = dict(good.turns), set[int]()

        def name_turns() -> None:
            """Those whose angles hold no other names than those named before."""
            for atom in [a for a in waiting if self.expansion.atoms.names({((a, 1),): 1}) <= known]:
                symbol = sympy.Symbol(waiting.pop(atom))
                named.append((symbol, raising.turn(atom)))
                raising.turns[atom] = symbol

        name_turns()
        raising.roots = {atom: (sympy.Symbol(name), n) for atom, (name, n) in good.roots.items()}
        counted: set[int] = set()

        def name_roots(poly: Poly) -> None:
            inside = self.expansion.atoms.all_in(poly)  # what a choice holds needs its roots before it too
            for root in sorted(inside.intersection(raising.roots).difference(counted)):
                counted.add(root)
                named.append((raising.roots[root][0], raising.root(root)))

        for atom, poly in self.named:
            name_roots(poly)
            name = self.expansion.atoms.table[atom].what
            raising.names[name] = sympy.Symbol(good.intermediates.get(name, name))
            named.append((raising.names[name], raising.expression(poly)))
            known.add(atom)
            name_turns()
        for poly in self.polys:
            name_roots(poly)
        written = [in_one_fashion(raising.expression(p)) for p in self.polys]
        return [(name, in_one_fashion(x)) for name, x in named], written

    def _good_names(self, parameters: Collection[str], prefix: str, roots: bool) -> GoodNames:
        atoms = self.expansion.atoms
        taken = {node[1] for node in self.graph.nodes if node[0] == "sym"} | {
            atoms.table[a].what for a, _ in self.named
        }
        good = GoodNames(atoms, self.factoring.costs, parameters, taken)
        if roots:
            good.choose_roots(self.named, self.polys)
        if self.named:
            good.choose(self.named, self.polys, prefix)
        return good


def simplify(
    exprs: Sequence[Expr],
    named: Sequence[tuple[str, Expr]] = (),
    rates: Collection[str] = (),
    prefix: str = "z",
    sizes: Sequence[int] = SIZES,
) -> Form | None:
    """The shortest form found of expressions; None of no expressions.

    ``named`` are names that stand in the expressions as symbols, and what they stand for, in order; other names begin
    with ``prefix``.  ``rates`` names velocities and accelerations: sums of them are read more easily than sums of them
    and other quantities.  Up to so many operations of ``sizes`` what is shared is written out each time, one attempt
    each; ``WHOLE`` writes out all.
    """
    graph = common_graph([*exprs, *(x for _, x in named)])
    if graph is None:
        return None
    roots = [*(x.id for _, x in named), *(x.id for x in exprs)]
    best: Form | None = None
    work = Work(WORK)
    seen: set[tuple[int, ...]] = set()
    for size in sizes:
        cuts, total = _shared(graph, roots, size)
        if cuts in seen:
            continue
        if best is not None and total > WRITTEN:
            break
        seen.add(cuts)
        form = _Attempt(graph, work, rates).form(exprs, named, cuts, prefix)
        if best is None or form.cost <= best.cost * (1.0 if form.named else SHARED):
            best = form
        if work.left <= LATER or form.cost > WORSE * best.cost:
            break
    work.left = math.inf  # what stands in sines and denominators is factored as it is written
    return best and _with_shared_sums(best, prefix)


def _with_shared_sums(form: Form, prefix: str) -> Form:
    """Of a form that has names, the same with names for the sums that others share."""
    if not form.named:
        return form
    atoms = form.expansion.atoms
    taken = {atom.what for atom in atoms.table if atom.kind in ("sym", "name")}
    named, polys = SharedSums(atoms, form.factoring.costs, form.named, form.polys, taken, prefix).shortened()
    return Form(form.graph, form.expansion, form.factoring, named, polys)


def _shared(graph: Graph, roots: Sequence[int], largest: int) -> tuple[tuple[int, ...], int]:
    """Nodes that are used more than once, of more operations than ``largest`` where those before have names.

    Also the operations that are then written.
    """
    order = reachable(graph, roots)
    uses = Counter(k for i in order for k in operands(graph.nodes[i])) + Counter(roots)
    unnamed = operations_with(lambda row: row.kind == CONDITION) | {"neg"}  # read best where they stand
    angles = _angles(graph, order)  # are joined with others
    size: dict[int, int] = {}
    cuts: list[int] = []
    total = 0
    for i in order:
        node = graph.nodes[i]
        size[i] = 0 if node[0] in LEAVES else 1 + sum(size[k] for k in operands(node))
        limit = largest if uses[i] > 1 else max(largest, NAMED_FROM)
        if size[i] > limit and node[0] not in unnamed and i not in roots and i not in angles:
            cuts.append(i)
            total += size[i]
            size[i] = 0
    return tuple(cuts), total + sum(size[i] for i in roots)


def _angles(graph: Graph, order: Sequence[int]) -> set[int]:
    """What stands in sines and cosines, and the sums in it."""
    result: set[int] = set()
    left = [graph.nodes[i][1] for i in order if graph.nodes[i][0] in TURNS]
    while left:
        i = left.pop()
        if i not in result and graph.nodes[i][0] in ("add", "sub", "neg"):
            result.add(i)
            left += operands(graph.nodes[i])
    return result


class _Attempt:
    """Makes the form in which certain nodes have names."""

    def __init__(self, graph: Graph, work: Work, rates: Collection[str]) -> None:
        self.graph, self.work = graph, work
        self.expansion = Expansion(graph, work)
        self.literal = Literal(self.expansion)
        self.factoring = Factoring(self.expansion.atoms, work, rates)
        self.mixed = Mixed(self.expansion, self.factoring, self._simplified)
        self.named: Named = []
        for name in sorted(node[1] for node in graph.nodes if node[0] == "sym"):  # so that ties fall alike
            self.expansion.atoms.id("sym", name)

    def form(
        self, exprs: Sequence[Expr], named_parts: Sequence[tuple[str, Expr]], cuts: Sequence[int], prefix: str
    ) -> Form:
        known = {self.graph.symbol(name).id: (x.id, name) for name, x in named_parts}
        taken = {node[1] for node in self.graph.nodes if node[0] == "sym"}
        free = (f"{prefix}{k}" for k in itertools.count() if f"{prefix}{k}" not in taken)
        same: dict[Frozen, Poly] = {}
        for i in sorted({*cuts, *known}):  # operands have smaller numbers, so do names that stand in them
            of, name = known.get(i, (i, ""))
            poly = self._shortest(of)
            sign = -1 if not name and len(poly) == 2 and poly.get(ONE, 0) < 0 else 1  # 1 - x^2, not x^2 - 1
            poly = scaled(poly, sign)
            alike = poly if is_plain(poly, self.expansion.atoms) else same.get(freeze(poly))
            if alike is None:
                atom = self.expansion.atoms.id("name", name or next(free))
                alike = same[freeze(poly)] = {((atom, 1),): 1}
                self.named.append((atom, poly))
            alike = scaled(alike, sign)
            self.expansion.put(i, alike)
            self.literal.put(i, alike)
            self.mixed.put(i, Parts({}, alike))
        polys = [self._shortest(x.id) for x in exprs]
        fixed = {self.expansion.atoms.id("name", name) for name, _ in named_parts}
        self.work.left = max(self.work.left, LATER)
        named, polys = inlined(self.expansion, self.factoring, self.named, polys, fixed)
        return Form(self.graph, self.expansion, self.factoring, named, polys)

    def _shortest(self, i: int) -> Poly:
        """A node multiplied out, simplified and factored, or as it stands where that is shorter."""
        as_formed = self.literal.of(i)
        cost = self.factoring.costs.of_terms(as_formed)
        try:
            with self.work.at_most(EACH * cost):
                expanded = self.factoring.factored(self._simplified(self.expansion.of(i)))
        except TooLongError:
            return as_formed
        shortest = expanded if self.factoring.costs.of_terms(expanded) <= cost else as_formed
        cost = self.factoring.costs.of_terms(shortest)
        try:
            with self.work.at_most(EACH * cost):
                mixed = self.mixed.form(i)
        except TooLongError:
            return shortest
        return mixed if mixed is not None and self.factoring.costs.of_terms(mixed) < cost else shortest

    def _simplified(self, poly: Poly) -> Poly:
        """With fractions divided that can be, and sines and cosines joined; with signs where that is shorter."""
        simplified, factoring = self.expansion.angles.simplified, self.factoring
        plain = without_exact_quotients(poly, self.expansion.atoms)
        signed = with_signs(plain, self.expansion.atoms)
        if signed is plain:
            return simplified(plain)
        forms = (simplified(signed), simplified(plain))
        return min(forms, key=lambda form: factoring.costs.of_terms(factoring.factored(form)))
