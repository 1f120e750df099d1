"""Nodes of a graph that are the same function of their symbols -> one of them, the shortest.

What a rotation matrix gives with itself is 0 or 1, many a product is formed twice in different ways, and what does not
depend on an angle at all is written shorter where that angle is 0.  Whether functions are the same is tried at random
values of their symbols (J. T. Schwartz, Fast probabilistic algorithms for verification of polynomial identities, J. ACM
27 (1980), 701-717): analytic functions that agree to rounding at several random points are the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...base.limits.numbers import ALIKE
from ..core import LEAVES, Expr, Graph, is_comparison, operands, reachable, substitute
from ..identity import dependence, is_rounding, with_bounds
from .atoms import CHOICE

POINTS = 12  #: random points
MOVED = 4  #: of these, at which each symbol is changed alone
LEAST = 6  #: points at which two functions must be finite to be compared
NUMBERS = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0)  #: what a node may be for a constant
OPEN = ("add", "sub", "mul", "div", "neg", "sin", "cos", "sqrt")  #: operations that are looked into
MOST = 4_000_000  #: values that are looked at
LONG = 20_000  #: operations from which expressions need names for what they share
WORK = 100_000  #: nodes that are formed anew to leave out symbols
CHOICES = 100  #: choices between values up to which their conditions are looked for in their branches

NamedExprs = Sequence[tuple[str, Expr]]


def joined_nodes(
    exprs: Sequence[Expr], named: NamedExprs = (), unit: Sequence[Sequence[str]] = ()
) -> tuple[list[Expr], list[tuple[str, Expr]]]:
    """Expressions, and what names in them stand for, with nodes of one function made one node, in a graph of their own.

    ``named`` are names that stand in the expressions as symbols, and what they stand for, in order; ``unit`` symbols
    whose squares have the sum 1, such as the Euler parameters of a joint.
    """
    roots = [*(x for _, x in named), *exprs]
    if not roots:
        return [], []
    roots, graph = with_known_conditions(roots), roots[0].graph
    opened = Opened(graph, [x.id for x in roots])
    order = reachable(graph, [*opened.roots, *opened.operands])
    left = [name for name, _ in named]
    names = sorted(graph.nodes[i][1] for i in order if graph.nodes[i][0] == "sym" and graph.nodes[i][1] not in left)
    result: dict[int, int] = {}
    if names and len(order) * (POINTS + MOVED * len(names)) <= MOST:
        meant = list(zip(left, (Expr(graph, i) for i in opened.roots), strict=False))
        joined = _Joined(Values(graph, order, names, meant, unit), left)
        result = joined.nodes()
        long = sum(joined.size[result[i]] for i in opened.roots) > LONG
        if long and len(reachable(graph, [result[i] for i in opened.roots])) > len(reachable(graph, opened.roots)):
            result = {}  # parts written anew share less with the others
    ids = opened.closed(result)
    made = _copied(graph, ids)
    return made[len(left) :], list(zip(left, made, strict=False))


def with_known_conditions(exprs: Sequence[Expr]) -> list[Expr]:
    """Expressions whose choices take their condition for true in the first branch, for false in the second."""
    graph, new = exprs[0].graph, dict[Expr, Expr]()
    choices = [i for i in reachable(graph, [x.id for x in exprs]) if graph.nodes[i][0] == CHOICE]
    if len(choices) > CHOICES:
        return list(exprs)
    for i in choices:  # those inside come first
        condition, yes, no = substitute([Expr(graph, k) for k in operands(graph.nodes[i])], new)
        if is_comparison(condition):
            (yes,), (no,) = substitute([yes], {condition: graph.one}), substitute([no], {condition: graph.zero})
        new[Expr(graph, i)] = graph.apply(CHOICE, condition, yes, no)
    return substitute(exprs, new)


class Opened:
    """Expressions with symbols for what is no analytic function, as ``max``, or is lost beside others, as ``exp``.

    ``roots`` are the nodes with symbols in them, ``operands`` those of the operations for which symbols stand.
    """

    def __init__(self, graph: Graph, roots: Sequence[int]) -> None:
        self.graph = graph
        self._stands_for: dict[int, tuple[str, tuple[int, ...]]] = {}
        new: dict[int, int] = {}
        for i in reachable(graph, roots):
            operation, parts = graph.nodes[i][0], operands(graph.nodes[i])
            if not parts:
                new[i] = i
            elif operation in OPEN:
                new[i] = graph.make(operation, *(new[k] for k in parts))
            else:
                new[i] = graph.symbol(f"node {i}").id
                self._stands_for[new[i]] = operation, tuple(new[k] for k in parts)
        self.roots = [new[i] for i in roots]
        self.operands = [k for _, parts in self._stands_for.values() for k in parts]

    def closed(self, result: Mapping[int, int]) -> list[int]:
        """The roots with what was found for their nodes, and with the operations in the place of the symbols."""
        graph, final = self.graph, dict[int, int]()

        def copy(i: int) -> int:
            for k in reachable(graph, [i], stop=final):
                parts = operands(graph.nodes[k])
                if k not in final and parts:
                    final[k] = graph.make(graph.nodes[k][0], *(final.get(p, p) for p in parts))
            return final.get(i, i)

        for symbol, (operation, parts) in self._stands_for.items():
            final[symbol] = graph.make(operation, *(copy(result.get(k, k)) for k in parts))
        return [copy(result.get(i, i)) for i in self.roots]


def _copied(graph: Graph, roots: Sequence[int]) -> list[Expr]:
    """The same expressions in a new graph, one after the other."""
    copy = Graph()
    copy.calls.update(graph.calls)
    new: dict[int, int] = {}
    for root in roots:
        for i in reachable(graph, [root], stop=new):
            if i in new:
                continue
            kind, *args = graph.nodes[i]
            if kind == "const":
                new[i] = copy.constant(args[0]).id
            else:
                new[i] = copy.symbol(args[0]).id if kind == "sym" else copy.make(kind, *(new[k] for k in args))
    return [Expr(copy, new[i]) for i in roots]


class Values:
    """Values of nodes at random points ``at``, with bounds of their rounding: (POINTS,) arrays by node.

    ``depends`` has the bits of the names, by their places, on which a node depends.
    """

    def __init__(
        self, graph: Graph, order: Sequence[int], names: Sequence[str], named: NamedExprs, unit: Sequence[Sequence[str]]
    ) -> None:
        self.graph, self.order, self.names = graph, order, names
        random = np.random.default_rng(5)
        at = {name: random.uniform(-3.0, 3.0, POINTS) for name in names}
        for four in unit:
            part = random.standard_normal((len(four), POINTS))
            at |= dict(zip(four, part / np.linalg.norm(part, axis=0), strict=True))
        moved = {name: random.uniform(-3.0, 3.0, MOVED) for name in names}
        values, bounds, same = dependence([Expr(graph, i) for i in order], at, moved, named)
        self.values, self.bounds = dict(zip(order, values, strict=True)), dict(zip(order, bounds, strict=True))
        self.at = at
        bits = {i: np.flatnonzero(~same[k]).tolist() for k, i in enumerate(order)}
        self.depends = {i: sum(1 << bit for bit in row) for i, row in bits.items()}

    def same(self, i: int, values: np.ndarray, bounds: np.ndarray) -> bool:
        """Whether a node has these values."""
        v, e = self.values[i], self.bounds[i]
        both = np.isfinite(v) & np.isfinite(e)
        if both.sum() < LEAST or not (both == (np.isfinite(values) & np.isfinite(bounds))).all():
            return False
        return bool(is_rounding(v[both] - values[both], np.maximum(e[both] + bounds[both], np.abs(v[both]))).all())


class _Joined:
    """Finds a new node for each."""

    def __init__(self, values: Values, names: Sequence[str]) -> None:
        self.values, self.graph, self.order = values, values.graph, values.order
        self.size: dict[int, float] = {}
        self.symbols: dict[int, int] = {}
        self.rank: dict[int, int] = {}
        self.of_name = {name: k for k, name in enumerate(names, 1)}
        self.place = {name: 1 << k for k, name in enumerate(values.names)}
        self.left = WORK
        for i in self.order:
            self._measure(i)

    def _measure(self, i: int) -> None:
        """Operations of a node written out; its symbols, -1 where it has names; the last of its names."""
        node = self.graph.nodes[i]
        self.rank[i] = self.of_name.get(node[1], 0) if node[0] == "sym" else 0
        parts = operands(node)
        self.size[i] = 0.0 if node[0] in LEAVES else 1.0 + sum(self.size[k] for k in parts)
        self.symbols[i] = self.place.get(node[1], -1) if node[0] == "sym" else 0
        for k in parts:
            self.symbols[i] |= self.symbols[k]
            self.rank[i] = max(self.rank[i], self.rank[k])

    def _measured(self, i: int) -> int:
        """A node, new ones below it measured."""
        for k in reachable(self.graph, [i], stop=self.size):
            if k not in self.size:
                self._measure(k)
        return i

    def nodes(self) -> dict[int, int]:
        """The new node of each."""
        known: dict[tuple[int, int, int], list[int]] = {}
        new: dict[int, int] = {}
        # by size, so that what a node is made of comes before it, and what is found for it is no longer than it
        for i in sorted(self.order, key=lambda i: (self.size[i], i)):
            node = self.graph.nodes[i]
            parts = operands(node)
            new[i] = self._measured(self.graph.make(node[0], *(new[k] for k in parts))) if parts else i
            if node[0] == "const":
                continue
            result = self._known(i, new, known)
            if result is None and parts:
                new[i] = self._without_symbols(i, new[i])
            elif result is not None:
                new[i] = self._measured(result)
        return new

    def _known(self, i: int, new: Mapping[int, int], known: dict[tuple[int, int, int], list[int]]) -> int | None:
        """A number or an earlier node that is the same as node i; else i is known from here on."""
        v, e = self.values.values[i], self.values.bounds[i]
        finite = np.isfinite(v) & np.isfinite(e)
        if finite.sum() < LEAST:
            return None
        first = int(np.flatnonzero(finite)[0])
        sign = 1.0 if v[first] > 0 else -1.0
        for number in NUMBERS:
            if is_rounding(v[finite] - sign * number, np.maximum(e[finite], number)).all():
                return self.graph.constant(sign * number).id
        mantissa, exponent = np.frexp(abs(v[first]))
        key = (first, int(mantissa / ALIKE), int(exponent))
        for near in (0, 1, -1):
            for j in known.get((first, key[1] + near, key[2]), ()):
                if self.rank[new[j]] > self.rank[i]:
                    continue  # a name cannot stand in what it stands for
                turned = sign if self.values.values[j][first] > 0 else -sign
                if self.values.same(i, turned * self.values.values[j], self.values.bounds[j]):
                    return new[j] if turned > 0 else self.graph.neg(new[j])
        known.setdefault(key, []).append(i)
        return None

    def _without_symbols(self, i: int, new: int) -> int:
        """With 0 for the symbols on which node i does not depend, if that is the same and shorter."""
        symbols = self.symbols[new]
        absent = symbols & ~self.values.depends[i]
        if symbols < 0 or not absent or self.left < 0:
            return new
        graph = self.graph
        self.left -= len(reachable(graph, [new]))
        put = {graph.symbol(name): graph.zero for name, bit in self.place.items() if absent & bit}
        (tried,) = substitute([Expr(graph, new)], put)
        self._measured(tried.id)
        if self.size[tried.id] >= self.size[new]:
            return new
        values, bounds = with_bounds([tried], self.values.at)
        return tried.id if self.values.same(i, values[0], bounds[0]) else new
