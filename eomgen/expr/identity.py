"""Expressions -> which of them vanish identically; values with bounds of their rounding.

An expression vanishes if it does so, to rounding, at three random points, with all signs of its roots.  An analytic one
that is not zero passes a point with a probability of about delta^(1/d), where delta = 1.4e-14 is what counts as
rounding of its terms and d the order of its zeros (E. J. Remez, 1936), and all three points with delta^(3/d): below
2e-14 for d up to 3.

Running error analysis (J. H. Wilkinson; N. J. Higham, *Accuracy and Stability of Numerical Algorithms*, 2nd ed. 2002,
3.3): beside every value x stands a bound e such that x is known to about eps e.  A sum adds the bounds of its terms, so
that what cancels is judged by the magnitudes of the terms that were added, not by their sum.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..base.limits.numbers import CHANCE, ROUNDED
from ..base.operations import OPERATIONS, operations_with, unit
from .core import LEAVES, Expr, Graph, common_graph, reachable, substitute, symbols_of
from .differentiate import gradient
from .evaluate import Evaluator, Value
from .vectors import Mat3, Vec3

TRIES = 3  #: random points at which an expression has to vanish
ROOTS = 4  #: of an expression, up to which all their signs are tried
DRAWS = 9  #: points that are drawn for it: some lie outside of the domain of a root or logarithm


def with_bounds(
    outputs: Sequence[Expr], values: Mapping[str, Value], likely: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Values of expressions and the bounds of their rounding, (n,) or (n, k), from exact values or (k,) arrays by name.

    Values are NaN outside of an operation's domain.  Bounds are in units of eps, and infinite or NaN where nothing is
    known, as of a square root at 0.  ``likely`` ones are at most CHANCE times those of independent roundings, which
    long chains of rotations need.
    """
    graph = common_graph(outputs)
    if graph is None:
        return np.empty(0), np.empty(0)
    nodes = _values_of_nodes(graph, outputs, values)
    result, bounds = _bounds_at(graph, outputs, nodes, values, independent=False)
    if likely:
        bounds = np.minimum(bounds, CHANCE * _bounds_at(graph, outputs, nodes, values, independent=True)[1])
    return result, bounds


def _values_of_nodes(graph: Graph, outputs: Sequence[Expr], values: Mapping[str, Value]) -> dict[int, Value]:
    """The value of every node that the outputs are made of, by id, ascending."""
    order, nodes = reachable(graph, (y.id for y in outputs)), graph.nodes
    names = [nodes[i][1] for i in order if nodes[i][0] == "sym" and nodes[i][1] in values]  # of many, few are used
    evaluate = Evaluator([Expr(graph, i) for i in order], names)
    return dict(zip(order, evaluate([values[n] for n in names]), strict=True))


def _bounds_at(
    graph: Graph,
    outputs: Sequence[Expr],
    collected: Mapping[int, Value],
    values: Mapping[str, Value],
    independent: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """What :func:`with_bounds` gives, from the values of all nodes; of independent roundings squares add up.

    That is no strict bound, but stays near the error in long products of rotations, where the other grows.
    """
    nodes = graph.nodes
    bounds: dict[int, Value] = {}
    with np.errstate(all="ignore"):
        for i, y in collected.items():
            operation, *operands = nodes[i]
            if operation == "sym":
                bounds[i] = 0.0
                continue
            if operation == "const":
                bounds[i] = abs(y)
                continue
            row = OPERATIONS.get(operation)
            if isinstance(y, list):  # of a sum over pairs, whose entries are nodes of their own
                bounds[i] = 0.0
                continue
            bound = 0.0 if row is not None and row.exact else abs(y)
            bound = bound * bound if independent else bound
            if row is not None and row.rates:  # a table or a function in C knows its value
                try:
                    x = [collected[k] for k in operands]
                    for rate, k in zip(row.rates, operands, strict=True):
                        e = bounds[k]
                        if e if type(e) is float else np.any(e):
                            more = e if rate is unit else rate(y, *x) * e
                            bound += more * more if independent else more
                except (ValueError, ArithmeticError):
                    bound = math.inf
            bounds[i] = bound**0.5 if independent else bound
    shape = (len(outputs), *np.broadcast_shapes(*(np.shape(x) for x in values.values())))
    result = np.empty(shape), np.empty(shape)
    for k, y in enumerate(outputs):
        result[0][k], result[1][k] = collected[y.id], bounds[y.id]
    return result


def vanishes(
    outputs: Sequence[Expr], within: float | None = None, pieces: bool = False, unknown: bool = False
) -> list[bool]:
    """Which expressions are zero at all values of their symbols; the module's page says how surely.

    ``within`` is what counts as zero of numbers that a user wrote in so many digits.  By default it is rounding, and
    the derivatives have to be rounding too: beside large numbers that cancel, a term of size 1 may be lost in the
    value.  With ``pieces`` expressions that are not analytic are judged by such points too, so that ``max(x, 0)``, zero
    in a part of its domain, may count as zero; they never do otherwise.  ``unknown`` is what is returned of an
    expression that is zero wherever it has a value, but has one at fewer points.
    """
    graph = common_graph(outputs)
    if graph is None:
        return []
    of = [frozenset[int]()] * len(outputs) if pieces else _roots(graph, outputs)
    plain = [k for k, roots in enumerate(of) if roots is not None]
    result = _vanish([outputs[k] for k in plain], within, unknown)
    passed = {k for k, zero in zip(plain, result, strict=True) if zero}
    for roots in {each for k in passed if (each := of[k])}:
        alike = [k for k in sorted(passed) if of[k] == roots]
        signed = [outputs[k] for k in alike]
        for root in (Expr(graph, i) for i in sorted(roots)):
            signed += substitute(signed, {root: -root})
        others = np.reshape(_vanish(signed[len(alike) :], within, unknown), (-1, len(alike)))
        zeros: np.ndarray = np.all(others, axis=0)
        passed -= {k for k, zero in zip(alike, zeros, strict=True) if not zero}
    return [k in passed for k in range(len(outputs))]


def _vanish(flat: Sequence[Expr], within: float | None, unknown: bool) -> list[bool]:
    """What :func:`vanishes` gives, with the signs that roots have alone."""
    left = dict.fromkeys(range(len(flat)), 0)  # points passed
    result, values = set[int](), dict[str, float]()
    random = np.random.default_rng(11)
    for draw in range(DRAWS):
        if not left:
            break
        tried = [flat[k] for k in left]
        values |= random_point(tried, random, signs=draw < TRIES)
        numbers, bounds = with_bounds(tried, values)
        zero = is_rounding(numbers, bounds) if within is None else np.abs(numbers) < within
        known = np.isfinite(numbers) & np.isfinite(bounds)
        left = {k: left[k] + z for k, z, some in zip(left, zero, known, strict=True) if z or not some}
        done = [k for k, passed in left.items() if passed == TRIES]
        left = {k: passed for k, passed in left.items() if passed < TRIES}
        if within is None and done:
            rounding = is_rounding(*with_bounds([flat[k] for k in done], values, likely=True))
            done = [k for k, zero in zip(done, rounding, strict=True) if zero]
            done = [
                k for k, flat_there in zip(done, _are_flat([flat[k] for k in done], values), strict=True) if flat_there
            ]
        result |= set(done)
    return [k in result or (unknown and k in left) for k in range(len(flat))]


def dependence(
    outputs: Sequence[Expr],
    at: dict[str, np.ndarray],
    moved: Mapping[str, np.ndarray],
    named: Sequence[tuple[str, Expr]] = (),
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values and bounds (n, k) at k points, and (n, names) whether each output stays the same as a symbol moves alone.

    ``moved`` has other values of symbols at the first points; names ``named`` stand for expressions and join ``at``.
    """
    k, m = (len(next(iter(values.values()), ())) for values in (at, moved))
    wide = {name: np.concatenate([x, np.tile(x[:m], len(moved))]) for name, x in at.items()}
    for j, (name, x) in enumerate(moved.items()):
        wide[name][k + m * j : k + m * (j + 1)] = x
    for name, expression in named:
        wide[name] = with_bounds([expression], wide)[0][0]
        at[name] = wide[name][:k]
    values, bounds = with_bounds(outputs, wide)
    v, e = (x[:, k:].reshape(len(outputs), len(moved), m) for x in (values, bounds))
    before, known = (x[:, None, :m] for x in (values, bounds))
    with np.errstate(all="ignore"):
        same: np.ndarray = np.all(is_rounding(v - before, np.maximum(known + e, np.abs(before))), axis=2)
    return values[:, :k], bounds[:, :k], same


def random_point(outputs: Sequence[Expr], random: np.random.Generator, signs: bool = False) -> dict[str, float]:
    """Values of all symbols of expressions, from 0.2 to 1.4, on request of either sign."""
    names = sorted(symbols_of(outputs))
    sizes = random.uniform(0.2, 1.4, len(names))
    return dict(zip(names, (sizes * random.choice((-1.0, 1.0), len(names)) if signs else sizes).tolist(), strict=True))


def _are_flat(outputs: Sequence[Expr], values: Mapping[str, float]) -> list[bool]:
    """Whether the slopes by each symbol are rounding, also of the terms' own slopes, which folded constants hide."""
    names = [sorted(symbols_of([x])) for x in outputs]
    slopes = [gradient(x, [x.graph.symbol(name) for name in row]) for x, row in zip(outputs, names, strict=True)]
    result, bounds = with_bounds([slope for row in slopes for slope in row], values, likely=True)
    terms = [_slopes_of_terms(x, row, values) for x, row in zip(outputs, names, strict=True)]
    strict, likely = (np.concatenate([row[k] for row in terms]) if terms else np.empty(0) for k in (0, 1))
    zero = iter(is_rounding(result, np.maximum(bounds, np.minimum(strict, CHANCE * likely))))
    return [bool(np.all([next(zero) for _ in row])) for row in names]


def _slopes_of_terms(x: Expr, names: Sequence[str], values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Of each symbol, the sum of the magnitudes of the slopes of all terms by it: (n,), from the result backwards.

    And the root of the sum of their squares.
    """
    graph = x.graph
    result, nodes = _values_of_nodes(graph, [x], values), graph.nodes
    weights, squares = dict.fromkeys(result, 0.0), dict.fromkeys(result, 0.0)
    weights[x.id] = squares[x.id] = 1.0
    with np.errstate(all="ignore"):
        for i in reversed(result):
            operation, *operands = nodes[i]
            weight, square, y, row = weights[i], squares[i], result[i], OPERATIONS.get(operation)
            if not weight or isinstance(y, list) or row is None or not row.rates:
                continue
            try:
                at = [result[k] for k in operands]
                for rate, k in zip(row.rates, operands, strict=True):
                    slope = 1.0 if rate is unit else float(rate(y, *at))
                    weights[k] += slope * weight
                    squares[k] += slope * slope * square  # infinite where ** would raise
            except (ValueError, ArithmeticError):
                for k in operands:
                    weights[k] = squares[k] = math.inf
    ids = [graph.symbol(name).id for name in names]
    return np.array([weights.get(i, 0.0) for i in ids]), np.array([squares.get(i, 0.0) ** 0.5 for i in ids])


def is_rounding(values: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Whether each value cannot be distinguished from zero by what is known of its rounding."""
    return np.asarray(np.isfinite(bounds) & (np.abs(values) <= ROUNDED * bounds))


def terms_of(x: Expr) -> Expr:
    """The sum of the magnitudes of the terms of a sum of products, as an expression; |x| where nothing is added."""
    graph = x.graph
    result: dict[int, Expr] = {}
    for i in reachable(graph, [x.id]):
        operation, *operands = graph.nodes[i]
        if operation in ("add", "sub"):
            result[i] = result[operands[0]] + result[operands[1]]
        elif operation in ("mul", "absorb"):
            result[i] = result[operands[0]] * result[operands[1]]
        elif operation == "div":
            result[i] = result[operands[0]] / graph.apply("abs", Expr(graph, operands[1]))
        elif operation == "neg":
            result[i] = result[operands[0]]
        else:
            result[i] = graph.apply("abs", Expr(graph, i))
    return result[x.id]


def _roots(graph: Graph, outputs: Sequence[Expr]) -> list[frozenset[int] | None]:
    """The roots in each output, whose signs are all to be tried, as sqrt(x^2) - x vanishes for one of them alone.

    None of one that is not analytic but for a few roots beside each other.
    """
    analytic = operations_with(lambda row: row.analytic)
    none = frozenset[int]()
    known: dict[int, frozenset[int] | None] = {}
    for i in reachable(graph, (y.id for y in outputs)):
        operation, *operands = graph.nodes[i]
        inside = [] if operation in LEAVES else [known[k] for k in operands]
        roots = none.union(*(each for each in inside if each))
        if operation == "sqrt":
            fits, roots = not roots, frozenset((i,))
        else:
            fits = operation in LEAVES or operation in analytic
        known[i] = roots if fits and None not in inside and len(roots) <= ROOTS else None
    return [known[y.id] for y in outputs]


def rounded_vector(a: Vec3, size: float) -> Vec3:
    """A vector whose constant components are exactly 0 where they are rounding of terms of a size."""
    x, y, z = (c.graph.zero if c.value is not None and abs(c.value) <= ROUNDED * size else c for c in a)
    return (x, y, z)


def rounded_rotation(m: Mat3) -> Mat3:
    """A rotation whose constant entries are exactly 0, 1 or -1 where rounding alone keeps them from it."""
    rows = [list(rounded_vector(row, 1.0)) for row in m]
    graph = m[0][0].graph
    for i, row in enumerate(rows):
        result = [j for j, x in enumerate(row) if not x.is_zero]
        single = len(result) == 1 and all(other[result[0]].is_zero for k, other in enumerate(rows) if k != i)
        if single and (value := row[result[0]].value) is not None:
            row[result[0]] = graph.constant(math.copysign(1.0, value))
    return tuple((x, y, z) for x, y, z in rows)  # type: ignore[return-value]


def size_of(*vectors: Vec3) -> float:
    """The sum of the largest constant components of some vectors."""
    return sum(max((abs(c.value) for c in a if c.value is not None), default=0.0) for a in vectors)
