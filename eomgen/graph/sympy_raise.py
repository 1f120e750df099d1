"""Stage graph: expressions of a graph -> SymPy expressions, whole or with named intermediates."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import sympy

from ..base.operations import CONDITION, OPERATIONS, operations_with
from .core import Expr, Graph
from .pair_calls import PairCall, pair_call
from .traverse import LEAVES, common_graph, reachable


def raise_inline(
    exprs: Sequence[Expr], symbols: Callable[[str], Any] = sympy.Symbol, limit: int = 100_000
) -> list[Any]:
    """SymPy expressions with everything written out.

    Parameters
    ----------
    exprs : sequence of Expr
        Expressions of one graph.
    symbols : callable, optional
        Name -> the SymPy symbol (or ``q(t)``) that stands for it.
    limit : int, optional
        Largest :func:`inlined_size` that is written out.

    Returns
    -------
    list of sympy.Expr
        One per expression.  SymPy orders sums and products its own way, so values agree up to rounding.

    Raises
    ------
    ValueError
        Written out, the expressions would exceed ``limit``; use :func:`raise_named`.
    """
    graph = common_graph(exprs)
    if graph is None:
        return []
    size = inlined_size(exprs)
    if size > limit:
        raise ValueError(f"written out, these are {size} operations, over the limit of {limit}; use raise_named")
    roots = [x.id for x in exprs]
    made: dict[int, Any] = {}
    for i in reachable(graph, roots):
        made[i] = _raised(graph, i, made, symbols)
    return [as_number(made[i]) for i in roots]


def raise_named(
    exprs: Sequence[Expr], symbols: Callable[[str], Any] = sympy.Symbol, prefix: str = "z", limit: int = 50
) -> tuple[list[tuple[Any, Any]], list[Any]]:
    """SymPy expressions with names for what is used more than once and for what grows large.

    Parameters
    ----------
    exprs : sequence of Expr
        Expressions of one graph.
    symbols : callable, optional
        Name -> the SymPy symbol (or ``q(t)``) that stands for it.
    prefix : str, optional
        Intermediates are called ``z0``, ``z1``, ...; names that the expressions use are passed over.
    limit : int, optional
        Operations in one expression beyond which a part gets a name.

    Returns
    -------
    intermediates : list of (sympy.Symbol, sympy.Expr)
        In an order in which each uses only those before it.
    expressions : list of sympy.Expr
        One per expression given.
    """
    graph = common_graph(exprs)
    if graph is None:
        return [], []
    nodes = graph.nodes
    roots = [x.id for x in exprs]
    order = reachable(graph, roots)
    uses = dict.fromkeys(order, 0)
    for i in order:
        if nodes[i][0] not in LEAVES:
            for k in nodes[i][1:]:
                uses[k] += 1
    for i in roots:
        uses[i] += 1
    conditions = operations_with(lambda row: row.kind == CONDITION)
    taken = {nodes[i][1] for i in order if nodes[i][0] == "sym"}
    made: dict[int, Any] = {}
    size: dict[int, int] = {}
    intermediates: list[tuple[Any, Any]] = []
    number = 0
    for i in order:
        kind, *args = nodes[i]
        made[i] = _raised(graph, i, made, symbols)
        size[i] = 0 if kind in LEAVES else 1 + sum(size[k] for k in args)
        # conditions and signs are read best where they stand
        if size[i] > (0 if uses[i] > 1 else limit) and kind not in conditions and kind != "neg":
            while f"{prefix}{number}" in taken:
                number += 1
            name = sympy.Symbol(f"{prefix}{number}", real=True)
            number += 1
            intermediates.append((name, made[i]))
            made[i], size[i] = name, 0
    return intermediates, [as_number(made[i]) for i in roots]


def inlined_size(exprs: Sequence[Expr]) -> int:
    """Operations in the expressions written out without sharing (at most 10^9 is counted)."""
    graph = common_graph(exprs)
    if graph is None:
        return 0
    nodes = graph.nodes
    roots = [x.id for x in exprs]
    size: dict[int, int] = {}
    for i in reachable(graph, roots):
        node = nodes[i]
        size[i] = 0 if node[0] in LEAVES else min(10**9, 1 + sum(size[k] for k in node[1:]))
    return min(10**9, sum(size[i] for i in roots))


def _raised(graph: Graph, i: int, made: Mapping[int, Any], symbols: Callable[[str], Any]) -> Any:
    """One node, its operands made already; comparisons and logic become SymPy booleans."""
    kind, *args = graph.nodes[i]
    if kind == "const":
        return _raised_number(args[0])
    if kind == "sym":
        return symbols(args[0])
    return raise_operation(graph, kind, [made[k] for k in args])


def raise_operation(graph: Graph, kind: str, operands: Sequence[Any]) -> Any:
    """An operation, or a call of a function of the graph, on SymPy expressions."""
    summed = pair_call(graph, kind)
    if summed is not None:
        return _pair_node(summed, [as_number(x) for x in operands])
    if kind in graph.calls:
        function, orders = graph.calls[kind]
        return _call(function.name, orders, [as_number(x) for x in operands])
    row = OPERATIONS[kind]
    truths = len(operands) if row.kind == CONDITION and not row.jumps else int(row.chooses)
    return row.raised(sympy, *(_as_truth(x) if n < truths else as_number(x) for n, x in enumerate(operands)))


def _pair_node(call: PairCall, operands: Sequence[Any]) -> Any:
    """A node of a sum over pairs: an unknown function of all symbols that it depends on."""
    if call.part == "sum":
        return operands[0]
    if call.part == "item":
        return sympy.Function(f"{operands[0].func}_{call.numbers[0]}")(*operands[0].args)
    symbols = sorted(set().union(*(x.free_symbols for x in operands)), key=str)
    name = call.function.name if call.part == "given" else f"{call.name}_{len(call.numbers)}"
    return sympy.Function(name)(*symbols)


def _call(name: str, orders: Sequence[int], operands: Sequence[Any]) -> Any:
    """A call of a declared function, or its derivative where the arguments are the operands."""
    function = sympy.Function(name)
    if not any(orders):
        return function(*operands)
    places, moved = list(operands), dict[Any, Any]()
    for k, x in enumerate(operands):
        others = [*operands[:k], *operands[k + 1 :]]
        if orders[k] and not (x.is_Symbol and not any(other.has(x) for other in others)):
            places[k] = sympy.Dummy(f"xi_{k + 1}")
            while x in moved.values():  # Subs takes variables at the same point for the same variable
                x = sympy.Mul(sympy.Integer(1), x, evaluate=False)
            moved[places[k]] = x
    slope = sympy.Derivative(function(*places), *((places[k], n) for k, n in enumerate(orders) if n))
    return sympy.Subs(slope, list(moved), list(moved.values())) if moved else slope


def _is_truth(value: Any) -> bool:
    return isinstance(value, sympy.logic.boolalg.Boolean) and not isinstance(value, sympy.Symbol)


def as_number(value: Any) -> Any:
    """A SymPy expression; 1 or 0 of a condition."""
    return sympy.Piecewise((sympy.Integer(1), value), (sympy.Integer(0), True)) if _is_truth(value) else value


def _as_truth(value: Any) -> Any:
    return value if _is_truth(value) else sympy.Ne(value, 0)


def _raised_number(value: float) -> Any:
    """The rational with a denominator up to 1000, or multiple of pi, whose double this is; else the double itself."""
    exact = Fraction(value)
    near = exact.limit_denominator(1000)
    if abs(near.numerator) < 10**15 and near.numerator / near.denominator == value:
        return sympy.Rational(near.numerator, near.denominator)
    turns = Fraction(value / math.pi).limit_denominator(360)
    if 0 < abs(turns.numerator) <= 1000 and turns.numerator / turns.denominator * math.pi == value:
        return sympy.Rational(turns.numerator, turns.denominator) * sympy.pi
    return sympy.Float(value)
