"""Stage reading: expressions -> the forms in which a hand would write them.

Several ways to share what is used more than once are tried, from everything written out to a name for each shared part,
and the shortest is taken.  Each part by itself is multiplied out, its sines and cosines are joined, and it is factored.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any

from ..graph.core import Expr, Graph
from ..graph.traverse import LEAVES, common_graph, reachable
from ..operations import CONDITION, operations_with
from ..records import dataclass
from .atoms import Poly, TooLongError, Work, add, join, multiply, ratio
from .expansion import Expansion
from .factor import Factoring
from .literal import Literal

SIZES = (1, 6, 16, 40, 120, 10**9)  #: operations up to which what is shared is written out each time, one attempt each
NAME = 20.0  #: what a name costs a reader, beyond its definition
ALONE = 30  #: operations of what is used once beyond which it gets a name in the first attempt
WRITTEN = 4_000  #: operations beyond which an attempt is not made
WORK = 100_000  #: products of terms in all attempts together
SHARED = 1.35  #: how much longer what needs no names may be
EACH = 40  #: products of terms for one expression, by its length as it stands
ONCE = 60.0  #: length up to which a definition that is used once is put in its place


@dataclass(frozen=True)
class Form:
    """Polynomials in atoms, in which names stand for others.

    Attributes
    ----------
    named : list of (int, Poly)
        The atom of each name and what it stands for, in an order in which each uses only those before it.
    polys : list of Poly
    """

    graph: Graph
    expansion: Expansion
    factoring: Factoring
    named: list[tuple[int, Poly]] = field(repr=False)
    polys: list[Poly] = field(repr=False)

    @property
    def cost(self) -> float:
        """The length for a reader."""
        costs = self.factoring.costs
        return sum(costs.of_terms(p) for _, p in self.named) + NAME * len(self.named) + sum(map(costs.of_terms, self.polys))

    def sympy(self, symbols: Callable[[str], Any] | None = None) -> tuple[list[tuple[Any, Any]], list[Any]]:
        """Named intermediates and expressions."""
        import sympy

        from .to_sympy import Raising

        make = symbols or sympy.Symbol
        raising = Raising(self.graph, self.expansion.atoms, self.factoring, make)
        named = []
        for atom, poly in self.named:
            name = self.expansion.atoms.table[atom].what
            raising.names[name] = make(name)
            named.append((raising.names[name], raising.expression(poly)))
        return named, [raising.expression(p) for p in self.polys]


def simplify(
    exprs: Sequence[Expr],
    given: Sequence[tuple[str, Expr]] = (),
    roles: Mapping[str, str] | None = None,
    meanings: Mapping[int, str] | None = None,
) -> Form | None:
    """The shortest form found of expressions.

    Parameters
    ----------
    given : sequence of (str, Expr)
        Names that stand in the expressions as symbols, and what they stand for, in order.
    roles : mapping, optional
        What each symbol is: 'coordinate', 'rate', 'input', else a parameter.
    meanings : mapping, optional
        Good names of nodes.
    """
    graph = common_graph([*exprs, *(x for _, x in given)])
    if graph is None:
        return None
    best: Form | None = None
    work = Work(WORK)
    seen: set[tuple[int, ...]] = set()
    for size in SIZES:
        cuts, total = _shared(graph, [*(x.id for _, x in given), *(x.id for x in exprs)], size)
        if cuts in seen:
            continue
        if best is not None and total > WRITTEN:
            break
        seen.add(cuts)
        form = _attempt(graph, work, exprs, given, cuts, roles or {}, meanings or {})
        if best is None or form.cost <= best.cost * (SHARED if not form.named else 1.0):
            best = form
        if work.left <= 0:
            break
    work.left = math.inf  # what stands in sines and denominators is factored as it is written
    return best


def _shared(graph: Graph, roots: Sequence[int], largest: int) -> tuple[tuple[int, ...], int]:
    """Nodes that are used more than once, of more operations than ``largest`` where those before have names.

    Also the operations that are then written.
    """
    order = reachable(graph, roots)
    uses = dict.fromkeys(order, 0)
    for i in order:
        if graph.nodes[i][0] not in LEAVES:
            for k in graph.nodes[i][1:]:
                uses[k] += 1
    for i in roots:
        uses[i] += 1
    conditions = operations_with(lambda row: row.kind == CONDITION)
    ends = set(roots)
    size: dict[int, int] = {}
    cuts: list[int] = []
    total = 0
    for i in order:
        kind, *args = graph.nodes[i]
        size[i] = 0 if kind in LEAVES else 1 + sum(size[k] for k in args)
        if size[i] > (largest if uses[i] > 1 else max(largest, ALONE)) and kind not in conditions and kind != "neg" and i not in ends:
            cuts.append(i)
            total += size[i]
            size[i] = 0
    return tuple(cuts), total + sum(size[i] for i in roots)


def _attempt(
    graph: Graph,
    work: Work,
    exprs: Sequence[Expr],
    given: Sequence[tuple[str, Expr]],
    cuts: Sequence[int],
    roles: Mapping[str, str],
    meanings: Mapping[int, str],
) -> Form:
    """The form in which these nodes have names."""
    expansion = Expansion(graph, work)
    literal = Literal(expansion)
    factoring = Factoring(expansion.atoms, work, roles)
    taken = {node[1] for node in graph.nodes if node[0] == "sym"}
    named: list[tuple[int, Poly]] = []
    number = 0

    def shortest(i: int) -> Poly:
        as_formed = literal.form(i)
        cost = factoring.costs.of_terms(as_formed)
        try:
            with work.at_most(EACH * cost):
                expanded = factoring.factored(expansion.angles.simplified(expansion.expand(i)))
        except TooLongError:
            return as_formed
        if factoring.costs.of_terms(expanded) > cost:
            return as_formed
        return expanded

    def define(i: int, name: str, hold: int) -> None:
        poly = shortest(i)
        atom = expansion.name(hold, name)
        literal.name(hold, {((atom, 1),): 1})
        named.append((atom, poly))

    known = {graph.symbol(name).id: (name, x.id) for name, x in given}
    for i in sorted({*cuts, *known}):  # operands have smaller numbers, so do names that stand in them
        if i in known:
            define(known[i][1], known[i][0], i)
            continue
        while f"z{number}" in taken:
            number += 1
        name = meanings.get(i, f"z{number}")
        number += name == f"z{number}"
        define(i, name, i)
    polys = [shortest(x.id) for x in exprs]
    named, polys = _inlined(expansion, factoring, named, polys)
    return Form(graph, expansion, factoring, named, polys)


def _inlined(
    expansion: Expansion, factoring: Factoring, named: list[tuple[int, Poly]], polys: list[Poly]
) -> tuple[list[tuple[int, Poly]], list[Poly]]:
    """Without names that are not worth it."""
    costs = factoring.costs.of_terms
    every = [*named, *((-1, poly) for poly in polys)]
    kept = []
    for k in range(len(named)):
        atom, value = every[k]
        users = [n for n in range(k + 1, len(every)) if _uses(expansion, every[n][1], atom)]
        head = _costliest(expansion, value) if len(value) == 1 and len(users) > 1 else None
        if head is not None:  # a product is named without its symbols and numbers, which may cancel
            name = {((atom, 1),): 1}
            for n in users:
                put = _put_in(expansion, factoring, every[n][1], atom, multiply(name, head[1]))
                if put is None:
                    break
            else:
                for n in users:
                    put = _put_in(expansion, factoring, every[n][1], atom, multiply(name, head[1]))
                    every[n] = (every[n][0], put or {})
                value = head[0]
                every[k] = (atom, value)
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


def _costliest(expansion: Expansion, value: Poly) -> tuple[Poly, Poly] | None:
    """A single term as a product of what is worth a name, and of symbols and numbers; None where there are none."""
    ((monomial, x),) = value.items()
    plain = tuple(f for f in monomial if expansion.atoms.table[f[0]].kind in ("sym", "pi"))
    rest = tuple(f for f in monomial if f not in plain)
    if not rest or (not plain and x == 1):
        return None
    return {rest: 1}, {plain: x}


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


def _uses(expansion: Expansion, poly: Poly, atom: int) -> bool:
    return any(a == atom or _inside(expansion, a, atom) for m in poly for a, _ in m)


def _inside(expansion: Expansion, outer: int, atom: int) -> bool:
    kind, what = expansion.atoms.table[outer]
    if kind in ("sym", "name", "pi"):
        return False
    parts = [what] if kind in ("sin", "cos", "sum", "factor") else what
    return any(_uses(expansion, dict(part), atom) for part in parts)


def _can_replace(expansion: Expansion, poly: Poly, atom: int, value: Poly) -> bool:
    for m in poly:
        for a, n in m:
            if a == atom and (n != int(n) or (n < 0 and len(value) != 1)):
                return False
            if a != atom and _inside(expansion, a, atom):
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
