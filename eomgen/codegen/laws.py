"""Laws that depend on reactions -> smooth pieces, linear where they can be, and their solution."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

from ..base.operations import CONDITION, operations_with
from ..expr.core import Expr, Graph, reachable, sqrt, substitute
from ..expr.differentiate import jacobian
from ..expr.tensors import Matrix, combined, dot, eliminate, reduced, substituted_back, total
from ..native.limits import SYSTEMS_FIXED

#: Most pieces of one law: what is written out grows with them.
MANY = 64

_CONDITIONS = operations_with(lambda row: row.kind == CONDITION)
_FRAGILE = operations_with(lambda row: row.fragile)
_BENDS = {"abs", "sign", "max", "min", "select"} | _CONDITIONS  #: what has two sides


def pieces_of(law: Expr, speaks: Callable[[str], bool]) -> list[Expr] | None:
    """The smooth pieces of a law that depend on symbols of which one speaks; None where there are too many."""
    result: dict[Expr, None] = {}
    waiting: list[tuple[Expr, frozenset[int]]] = [(law, frozenset())]
    while waiting:
        x, decided = waiting.pop()
        dependent = dependent_on([x], speaks)
        choice = _next_choice(x, dependent, decided)
        if choice is not None:
            waiting += [(side, decided | {choice.id}) for side in _sides(x, choice, dependent)]
        elif x.id in dependent and -x not in result:
            result[x] = None
        if len(result) + len(waiting) > MANY:
            return None
    return list(result)


def dependent_on(entries: Sequence[Expr], speaks: Callable[[str], bool]) -> set[int]:
    """Ids of all nodes that depend on such symbols."""
    result: set[int] = set()
    for graph in {entry.graph for entry in entries}:
        for i in reachable(graph, [entry.id for entry in entries]):
            node = graph.nodes[i]
            inner = speaks(node[1]) if node[0] == "sym" else node[0] != "const" and not result.isdisjoint(node[1:])
            if inner:
                result.add(i)
    return result


def _next_choice(x: Expr, dependent: set[int], decided: frozenset[int]) -> Expr | None:
    """The choice to take a side of: of a condition, what it is made of comes first."""
    nodes = x.graph.nodes

    def open_in(roots: Sequence[int]) -> list[int]:
        result = []
        for i in reachable(x.graph, roots):
            if i in dependent and i not in decided and nodes[i][0] in _BENDS:
                by = nodes[i][1]
                if nodes[i][0] != "select" or (by in dependent and by not in decided):
                    result.append(i)
        return result

    every = open_in([x.id])
    if not every:
        return None
    top = max(every)
    operation, *operands = nodes[top]
    first = []
    if operation == "select":
        first = open_in(operands[:1])
    elif operation in _CONDITIONS:
        first = open_in(operands)
    return Expr(x.graph, min(first) if first else top)


def _sides(x: Expr, choice: Expr, dependent: set[int]) -> list[Expr]:
    """An expression with either side of a choice."""
    graph = x.graph
    operation, *operands = choice.node
    if operation in _CONDITIONS or operation == "sign":
        low = -1.0 if operation == "sign" else 0.0
        return [_with_condition(x, choice, value, dependent) for value in (1.0, low)]
    inner = Expr(graph, operands[-1])
    sides = [inner, -inner] if operation == "abs" else [Expr(graph, operands[-2]), inner]
    return [substitute([x], {choice: side})[0] for side in sides]


def _with_condition(x: Expr, condition: Expr, value: float, dependent: set[int]) -> Expr:
    graph = x.graph
    mapping = {condition: graph.lift(value)}
    for i in reachable(graph, [x.id]):
        node = graph.nodes[i]
        if node[0] == "select" and node[1] == condition.id:
            side = node[2] if value else node[3]
            if _keeps_domain(graph, side, condition.id, dependent):
                mapping[Expr(graph, i)] = Expr(graph, side)
    return substitute([x], mapping)[0]


def _keeps_domain(graph: Graph, side: int, condition: int, dependent: set[int]) -> bool:
    """Whether a branch asks for its condition again, with roots or quotients of what depends on reactions."""
    below = [graph.nodes[i] for i in reachable(graph, [side]) if i in dependent]
    again = any(node[0] == "select" and node[1] == condition for node in below)
    return again and any(node[0] in _FRAGILE and not dependent.isdisjoint(node[-1:]) for node in below)


#: How often the way is halved.  Complex eigenvalues z of K are then told from real ones where |Im z| > |z| / 16.
HALVINGS = 3


def grows_from_zero(A: Matrix, one: Expr) -> Expr:
    """1 where det(I - s (I - A)) is positive for all s from 0 to 1 for certain, else 0."""
    graph, n = one.graph, len(A)
    sums = _minor_sums(A)
    parts = [[one, *(e / math.comb(n, k) for k, e in enumerate(sums, 1))]]
    for _ in range(HALVINGS if n > 1 else 0):
        parts = [half for part in parts for half in _halves(part)]
    certain = one
    for part in parts:
        for b in part[1:]:
            certain = certain * graph.apply("lt", 0.0, b)
    return certain


def _minor_sums(A: Matrix) -> list[Expr]:
    """Sums of the principal minors of each size from 1 on (D. K. Faddeev, V. N. Faddeeva (1963), sec. 47)."""
    n, result = len(A), list[Expr]()
    power = [list(row) for row in A]
    for k in range(1, n + 1):
        e = total([power[i][i] for i in range(n)]) / float(k)
        result.append(e)
        if k < n:
            rest = [[(e if i == j else e * 0.0) - power[i][j] for j in range(n)] for i in range(n)]
            power = [[dot(row, column) for column in zip(*rest, strict=True)] for row in A]
    return result


def _halves(part: Sequence[Expr]) -> tuple[list[Expr], list[Expr]]:
    """Bernstein coefficients of either half (P. de Casteljau)."""
    row, first, last = list(part), [part[0]], [part[-1]]
    while len(row) > 1:
        row = [(a + b) * 0.5 for a, b in pairwise(row)]
        first.append(row[0])
        last.append(row[-1])
    return first, last[::-1]


def solve_by_largest_pivots(matrix: Matrix, right: Matrix) -> Matrix:
    """X with A X = B, by columns, with exchange of rows: A may be turned so that a leading entry of it vanishes."""

    def exchange(A: Matrix, columns: Matrix, k: int) -> None:
        for i in range(k + 1, len(A)):
            if not A[i][k].is_zero:
                _larger_first(A, columns, k, i)

    A, columns = reduced(matrix, right, exchange)
    return [substituted_back(A, x) for x in columns]


def _larger_first(A: Matrix, columns: Matrix, k: int, i: int) -> None:
    """Exchange rows k and i where the entry below is larger."""
    graph = A[k][k].graph
    below = graph.apply("lt", graph.apply("abs", A[k][k]), graph.apply("abs", A[i][k]))

    def exchange(a: Expr, b: Expr) -> tuple[Expr, Expr]:
        return graph.apply("select", below, b, a), graph.apply("select", below, a, b)

    for j in range(k, len(A)):
        A[k][j], A[i][j] = exchange(A[k][j], A[i][j])
    for x in columns:
        x[k], x[i] = exchange(x[k], x[i])


#: Of Newton's method from f = 0.  Random laws of 1 to 8 forces (|N| in space, spectral radius of B up to 0.99) were met
#: to 3e-12 by then, to 1e-15 where that is 0.9.
STEPS = 7


def laws_in(entries: Sequence[Expr], speaks: Callable[[str], bool]) -> list[Expr]:
    """The laws in the entries of one load: parts in which it is linear, or the entries where they are fewer."""
    dependent = dependent_on(entries, speaks)
    result: dict[Expr, None] = {}
    for entry in entries:
        _parts(entry, dependent, result)
    spoken = [entry for entry in dict.fromkeys(entries) if entry.id in dependent]
    if len(result) <= len(spoken) or any(pieces_of(entry, speaks) is None for entry in spoken):
        return list(result)
    return list(result) if all(_is_symbol(x) for x in result) else spoken


def _parts(x: Expr, dependent: set[int], result: dict[Expr, None]) -> None:
    """Note the parts of an expression in which it is linear, with factors that do not depend on reactions."""
    waiting = [x.id]
    while waiting:
        i = waiting.pop()
        if i not in dependent:
            continue
        operation, *operands = x.graph.nodes[i]
        if operation in ("add", "sub", "neg") or (operation == "mul" and not {*operands} <= dependent):
            waiting += operands
        elif operation == "div" and operands[1] not in dependent:
            waiting.append(operands[0])
        else:
            result[Expr(x.graph, i)] = None


def _is_symbol(x: Expr) -> bool:
    return bool(x.node[0] == "sym")


def solve_laws(
    laws: Sequence[Expr], symbols: Sequence[Expr], still: Sequence[Expr], gain: Matrix
) -> tuple[list[Expr], dict[Expr, Expr]]:
    """N with f = g(N), N = N0 + K f, and g(N) by the law; no numbers where one solution is not certain.

    Laws are given by themselves because a law such as max(0, N) is a number where N is none.
    """
    one = symbols[0].graph.one
    linear = [j for j, law in enumerate(laws) if _is_symbol(law)]
    nonlinear = [j for j in range(len(laws)) if j not in linear]
    certain = one
    if linear:
        places = [symbols.index(laws[j]) for j in linear]
        still, gain, certain = _eliminated(places, linear, nonlinear, still, gain)
    else:
        gain = [list(row) for row in gain]
    if not nonlinear:
        return [_if(certain, N) for N in still] if linear else list(still), {}
    return _newton([laws[j] for j in nonlinear], symbols, still, gain, certain)


def _eliminated(
    places: Sequence[int], linear: Sequence[int], nonlinear: Sequence[int], still: Sequence[Expr], gain: Matrix
) -> tuple[list[Expr], Matrix, Expr]:
    """N0 and K of the other laws, those that are N[places] being solved for; and 1 where these are certain."""
    one = still[0].graph.one
    A = [[-gain[i][j] + (one if k == m else 0.0) for m, j in enumerate(linear)] for k, i in enumerate(places)]
    certain = grows_from_zero(A, one)
    rest, *by = solve_by_largest_pivots(
        A, [[column[i] for i in places] for column in (still, *zip(*gain, strict=True))]
    )
    parts = [[row[j] for j in linear] for row in gain]
    base = [combined(N, part, rest) for N, part in zip(still, parts, strict=True)]
    rows = [[combined(row[m], part, by[m]) for m in nonlinear] for row, part in zip(gain, parts, strict=True)]
    return base, rows, certain


def _newton(
    laws: Sequence[Expr], symbols: Sequence[Expr], still: Sequence[Expr], gain: Matrix, certain: Expr
) -> tuple[list[Expr], dict[Expr, Expr]]:
    graph, n = symbols[0].graph, len(laws)
    slopes = jacobian(list(laws), list(symbols))
    places = list(slopes)
    force = [graph.zero] * n
    for _ in range(STEPS):
        here = _at(still, gain, force)
        at = dict(zip(symbols, here, strict=True))
        values = substitute([*laws, *(slopes[p] for p in places)], at)
        D = dict(zip(places, values[n:], strict=True))
        matrix = [[_slope(D, gain, i, j) for j in range(n)] for i in range(n)]
        left = [g - f for g, f in zip(values[:n], force, strict=True)]
        force = [f + x for f, x in zip(force, eliminate(matrix, left), strict=True)]
    here = _at(still, gain, force)
    names = {symbol.node[1] for symbol in symbols}
    pieces = [(i, piece) for i, law in enumerate(laws) for piece in pieces_of(law, names.__contains__) or [law]]
    bounds = jacobian([piece for _, piece in pieces], list(symbols))
    values = substitute([*laws, *bounds.values()], dict(zip(symbols, here, strict=True)))
    certain = certain * _certain([i for i, _ in pieces], dict(zip(bounds, values[n:], strict=True)), gain, n, graph.one)
    apart = total([graph.apply("abs", g - f) for g, f in zip(values[:n], force, strict=True)])
    size = total([graph.apply("abs", g) for g in values[:n]])
    certain = certain * graph.apply("le", apart, size * SYSTEMS_FIXED)
    result = {law: _if(certain, g) for law, g in zip(laws, values[:n], strict=True)}
    return _at(still, gain, [_if(certain, f) for f in force]), result


def _if(certain: Expr, x: Expr) -> Expr:
    """A value; no number where it is not certain, also if it vanishes whatever the state is."""
    return certain.graph.apply("select", certain, x, 1.0 / certain) if x.is_zero else x / certain


def _at(still: Sequence[Expr], gain: Matrix, force: Sequence[Expr]) -> list[Expr]:
    return [combined(N, row, force) for N, row in zip(still, gain, strict=True)]


def _slope(D: Mapping[tuple[int, int], Expr], gain: Matrix, i: int, j: int) -> Expr:
    """An entry of I - D K."""
    graph = gain[0][0].graph
    return total([graph.one if i == j else graph.zero, *(-(d * gain[m][j]) for (k, m), d in D.items() if k == i)])


def _certain(of: Sequence[int], D: Mapping[tuple[int, int], Expr], gain: Matrix, n: int, one: Expr) -> Expr:
    """1 where I - B is an M-matrix, all pivots of its elimination being positive, else 0.

    ``of`` tells the law of each piece, whose slopes are D.
    """
    graph = one.graph
    sizes = [[graph.zero] * n for _ in range(n)]
    for k, i in enumerate(of):
        used = [(m, d) for (piece, m), d in D.items() if piece == k]
        steep = _length([d for _, d in used], graph.zero)
        for j in range(n):
            size = steep * _length([gain[m][j] for m, _ in used], graph.zero)
            sizes[i][j] = size if sizes[i][j].is_zero else graph.apply("max", sizes[i][j], size)
    pivots, _ = reduced([[(one if i == j else graph.zero) - sizes[i][j] for j in range(n)] for i in range(n)], [])
    certain = one
    for k in range(n):
        certain = certain * graph.apply("lt", 0.0, pivots[k][k])
    return certain


def _length(parts: Sequence[Expr], zero: Expr) -> Expr:
    some = [x for x in parts if not x.is_zero]
    if len(some) < 2:
        return zero.graph.apply("abs", some[0]) if some else zero
    return sqrt(total([x * x for x in some]))
