"""Stage program, solving laws of reactions: f = g(N), N = N0 + K f -> N, written out on the graph.

A law is what an entry of a load depends on reactions by: the smallest parts of it that are not linear in them, or the
reactions themselves.  Laws that are reactions themselves are eliminated first, as a linear system.  The others are met
by Newton's method, a fixed number of steps, with the exact slopes of g.

A law is taken to have slopes of any sign up to their size, as that of |N| has, in each of its pieces
(:mod:`.law_pieces`), as max(0, N) has two.  It has one solution for every N0 if I - B is an M-matrix, B[i, j] =
|dg_i/dN| |K[., j]|: then g is a contraction in a weighted maximum norm (A. Berman, R. J. Plemmons, Nonnegative Matrices
in the Mathematical Sciences (1994), ch. 6).  For one law this is |mu K| < 1, the limit beyond which Painleve's examples
have two solutions or none (P. Painleve, Sur les lois du frottement de glissement, C. R. Acad. Sci. Paris 121 (1895),
112-115).  Of laws that are reactions themselves the solution is to
follow from the one without these forces as they grow from 0 (:mod:`.linear_laws`).  Where it fails, the forces are no
numbers, and what is asked ends with an error that names the elements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from ..base.limits.systems import FIXED
from ..graph.core import Expr, sqrt
from ..graph.differentiate import jacobian
from ..graph.substitute import substitute
from ..kinematics.eliminate import Matrix, eliminate, total
from .law_pieces import dependent_on, pieces_of
from .linear_laws import grows_from_zero, solve_by_largest_pivots

#: Of Newton's method from f = 0.  Random laws of 1 to 8 forces (|N| in space, spectral radius of B up to 0.99) were met
#: to 3e-12 by then, to 1e-15 where that is 0.9.
STEPS = 7


def laws_in(entries: Sequence[Expr], speaks: Callable[[str], bool]) -> list[Expr]:
    """The laws in the entries of one load: parts in which it is linear, or the entries where they are fewer."""
    dependent = dependent_on(entries, speaks)
    found: dict[Expr, None] = {}
    for entry in entries:
        _parts(entry, dependent, found)
    spoken = [entry for entry in dict.fromkeys(entries) if entry.id in dependent]
    if len(found) <= len(spoken) or any(pieces_of(entry, speaks) is None for entry in spoken):
        return list(found)
    return list(found) if all(_is_symbol(x) for x in found) else spoken


def _parts(x: Expr, dependent: set[int], found: dict[Expr, None]) -> None:
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
            found[Expr(x.graph, i)] = None


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
    curved = [j for j in range(len(laws)) if j not in linear]
    certain = one
    if linear:
        places = [symbols.index(laws[j]) for j in linear]
        still, gain, certain = _eliminated(places, linear, curved, still, gain)
    else:
        gain = [list(row) for row in gain]
    if not curved:
        return [_if(certain, N) for N in still] if linear else list(still), {}
    return _newton([laws[j] for j in curved], symbols, still, gain, certain)


def _eliminated(
    places: Sequence[int], linear: Sequence[int], curved: Sequence[int], still: Sequence[Expr], gain: Matrix
) -> tuple[list[Expr], Matrix, Expr]:
    """N0 and K of the other laws, those that are N[places] being solved for; and 1 where these are certain."""
    one = still[0].graph.one
    A = [[-gain[i][j] + (one if k == m else 0.0) for m, j in enumerate(linear)] for k, i in enumerate(places)]
    certain = grows_from_zero(A, one)
    rest, *by = solve_by_largest_pivots(
        A, [[column[i] for i in places] for column in (still, *zip(*gain, strict=True))]
    )
    base = [
        total([N, *(row[j] * f for j, f in zip(linear, rest, strict=True))]) for N, row in zip(still, gain, strict=True)
    ]
    rows = [
        [total([row[m], *(row[j] * f for j, f in zip(linear, by[m], strict=True))]) for m in curved] for row in gain
    ]
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
    certain = certain * graph.apply("le", apart, size * FIXED)
    found = {law: _if(certain, g) for law, g in zip(laws, values[:n], strict=True)}
    return _at(still, gain, [_if(certain, f) for f in force]), found


def _if(certain: Expr, x: Expr) -> Expr:
    """A value; no number where it is not certain, also if it vanishes whatever the state is."""
    return certain.graph.apply("select", certain, x, 1.0 / certain) if x.is_zero else x / certain


def _at(still: Sequence[Expr], gain: Matrix, force: Sequence[Expr]) -> list[Expr]:
    return [total([N, *(k * f for k, f in zip(row, force, strict=True))]) for N, row in zip(still, gain, strict=True)]


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
    return _positive_pivots([[(one if i == j else graph.zero) - sizes[i][j] for j in range(n)] for i in range(n)], one)


def _positive_pivots(given: Matrix, one: Expr) -> Expr:
    """1 where all pivots of the elimination are positive, else 0."""
    graph, n, matrix = one.graph, len(given), [list(row) for row in given]
    certain = one
    for k in range(n):
        certain = certain * graph.apply("lt", 0.0, matrix[k][k])
        for i in range(k + 1, n):
            ratio = matrix[i][k] / matrix[k][k]
            for j in range(k + 1, n):
                matrix[i][j] = matrix[i][j] - ratio * matrix[k][j]
    return certain


def _length(parts: Sequence[Expr], zero: Expr) -> Expr:
    some = [x for x in parts if not x.is_zero]
    if len(some) < 2:
        return zero.graph.apply("abs", some[0]) if some else zero
    return sqrt(total([x * x for x in some]))
