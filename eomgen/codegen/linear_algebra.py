"""Matrices on the graph -> straight-line factors and solutions that know every zero, of trees and of rows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from heapq import heapify, heappop, heappush
from typing import NamedTuple, TypeVar

from ..base.limits.numbers import NOTHING, SINGULAR
from ..expr import vectors as vec
from ..expr.core import Expr
from ..expr.records import Record

Row = dict[int, Expr]  #: column -> entry; zeros left out
Alike = TypeVar("Alike")
FEW = 6  #: rows or terms that are not worth parts of their own


def rows_of(matrix: Sequence[Sequence[Expr]]) -> list[Row]:
    """The entries of a dense matrix that are not identically zero."""
    zero = matrix[0][0].graph.zero.id if matrix and matrix[0] else 0
    return [{k: x for k, x in enumerate(row) if x.id != zero} for row in matrix]


def transpose(rows: Sequence[Mapping[int, Expr]], n: int) -> list[Row]:
    """The columns of a matrix with n of them, as rows."""
    result: list[Row] = [{} for _ in range(n)]
    for i, row in enumerate(rows):
        for k, x in row.items():
            result[k][i] = x
    return result


def dot(a: Mapping[int, Expr], b: Mapping[int, Expr]) -> Expr | None:
    """The sum of products of what both have; None if that is nothing."""
    total: Expr | None = None
    for k, x in a.items():
        if k in b:
            total = x * b[k] if total is None else total + x * b[k]
    return None if total is None or total.is_zero else total


def in_parts(alike: Sequence[Alike], x: Sequence[Expr]) -> Iterable[Alike]:
    """Rows or terms that are treated alike; many of them as parts of the graph of x, whose code is written once."""
    return x[0].graph.marked(alike) if len(alike) > FEW else alike


def times(rows: Sequence[Mapping[int, Expr]], x: Sequence[Expr]) -> list[Expr]:
    """The product of a matrix and a dense vector."""
    result = []
    for row in in_parts(rows, x):
        total = x[0].graph.zero if x else None
        for k, entry in in_parts(list(row.items()), x):
            total = entry * x[k] if total is None or total.is_zero else total + entry * x[k]
        assert total is not None
        result.append(total)
    return result


#: Coordinates that follow from a few rows: columns of K by the rows, columns of C, the rates of these rows; B has K C.
Leg = tuple[set[int], list[Row], list[Row]]


def quadratic_form(columns: Sequence[Row], N: Sequence[Row], legs: Sequence[Leg] = ()) -> list[Row]:
    """B^T N B of B by its columns and a symmetric N, zeros left out; of legs as C^T (K^T N K) C."""
    legs = [leg for leg in legs if all(N[k].keys() <= leg[0] for k in leg[0])]
    apart = set().union(*(leg[0] for leg in legs))
    rest = [{k: x for k, x in column.items() if k not in apart} for column in columns]
    products = [{k: x for k, row in enumerate(N) if (x := dot(row, column)) is not None} for column in rest]
    result: list[Row] = [{} for _ in columns]
    for i, column in enumerate(rest):
        for k, other in enumerate(products[: i + 1]):
            if (entry := dot(column, other)) is not None:
                result[i][k] = result[k][i] = entry
    for _, K, C in legs:
        for row, more in zip(result, quadratic_form(C, quadratic_form(K, N)), strict=True):
            row |= {k: row[k] + x if k in row else x for k, x in more.items()}
    return result


def gram(rows: Sequence[Mapping[int, Expr]]) -> list[Row]:
    """Both triangles of A A^T."""
    touching: dict[int, list[int]] = {}
    for i, row in enumerate(rows):
        for k in row:
            touching.setdefault(k, []).append(i)
    result: list[Row] = [{} for _ in rows]
    for i, row in enumerate(rows):
        for j in sorted({j for k in row for j in touching[k] if j <= i}):
            entry = dot(row, rows[j])
            if entry is not None:
                result[i][j] = result[j][i] = entry
    return result


def minimum_degree(pattern: Sequence[Mapping[int, object]]) -> tuple[list[int], int]:
    """An order of elimination with little fill of a symmetric pattern, and about how many multiplications it takes.

    Of equal degrees the first is taken.
    """
    near = [set(row) - {i} for i, row in enumerate(pattern)]
    waiting = [(len(others), i) for i, others in enumerate(near)]
    heapify(waiting)
    gone = [False] * len(near)
    order, total = [], 0
    while waiting:
        degree, i = heappop(waiting)
        if gone[i] or degree != len(near[i]):  # noted again since, with another degree
            continue
        order.append(i)
        total += degree * (degree + 3) // 2
        gone[i] = True
        for k in near[i]:
            near[k] |= near[i]
            near[k] -= {i, k}
            heappush(waiting, (len(near[k]), k))
    return order, total


class SparseFactor(Record):
    """P A P^T = L D L^T: ``columns[i]`` holds column i of L below its pivot, in the original indices."""

    order: tuple[int, ...]
    columns: tuple[Row, ...]
    pivots: tuple[Expr, ...]  #: by index
    reciprocals: tuple[Expr, ...]
    term: Expr | None = None  #: what A has on its diagonal beyond the matrix that is meant

    def settle(self, right: Sequence[Expr], passes: int) -> list[Expr]:
        """The sum of the z of so many passes, each for what the last one left: (A - t I) z = right leaves t z."""
        z = total = self.solve(right)
        for _ in range(passes - 1):
            term = self.term
            assert term is not None
            z = self.solve([term * x for x in in_parts(z, z)])
            total = [a + b for a, b in in_parts(list(zip(total, z, strict=True)), z)]
        return total

    def solve(self, right: Sequence[Expr]) -> list[Expr]:
        """x with A x = right."""
        x = list(right)
        for i in self.order:
            if not x[i].is_zero:
                for k, ratio in self.columns[i].items():
                    x[k] = x[k] - ratio * x[i]
        for i in reversed(self.order):
            total = x[i] * self.reciprocals[i]
            for k, ratio in self.columns[i].items():
                if not x[k].is_zero:
                    total = total - ratio * x[k]
            x[i] = total
        return x


def factorize(
    matrix: Sequence[Mapping[int, Expr]], term: Expr | None = None, order: Sequence[int] | None = None
) -> SparseFactor:
    """Factor a symmetric positive definite matrix given by both triangles, without square roots.

    ``term`` is what its diagonal has beyond the matrix that is meant; see :meth:`SparseFactor.settle`.  Without an
    ``order`` of elimination it is one with little fill.
    """
    work = [dict(row) for row in matrix]
    order, reverse = (minimum_degree(matrix)[0], False) if order is None else (order, True)
    columns: list[Row] = [{} for _ in work]
    pivots = [row[i] for i, row in enumerate(work)]
    reciprocals = list(pivots)
    for i in order:
        pivot = pivots[i] = work[i].pop(i)
        inverse = reciprocals[i] = 1.0 / pivot
        below = sorted(work[i], reverse=reverse)
        for k in below:
            columns[i][k] = work[i][k] * inverse
            del work[k][i]
        for k in below:
            for j in (j for j in below if j <= k):
                change = columns[i][k] * work[i][j]
                work[k][j] = work[j][k] = work[k][j] - change if j in work[k] else -change
    return SparseFactor(tuple(order), tuple(columns), tuple(pivots), tuple(reciprocals), term)


class Front(NamedTuple):
    """Rows that hold some columns, all of them, and the other columns that these rows hold."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]
    others: tuple[int, ...]
    left: tuple[int, ...]  #: new rows, free of the columns


def fronts(pattern: Sequence[Iterable[int]], n: int) -> list[Front] | None:
    """The order in which columns are taken out, those of the fewest rows first; None if these cannot be independent.

    Of these, those that leave the fewest rows: a row of loops is taken from its ends, one loop after the other.
    """
    rows_left = dict(enumerate(map(set, pattern)))
    touching: list[set[int]] = [set() for _ in range(n)]
    for i, row in rows_left.items():
        for k in row:
            touching[k].add(i)
    result, waiting, new = [], set(range(n)), len(rows_left)

    known: dict[int, tuple[set[int], set[int]]] = {}  #: column -> columns of the same rows, and the others of these

    def taken(k: int) -> tuple[set[int], set[int]]:
        if k not in known:
            near = set().union(*(rows_left[i] for i in touching[k]))
            columns = {j for j in near if touching[j] <= touching[k]}
            known[k] = columns, near - columns
        return known[k]

    while waiting:
        least = min(len(touching[k]) for k in waiting)
        first = min((k for k in waiting if len(touching[k]) == least), key=lambda k: (-len(taken(k)[0]), k))
        rows, (columns, others) = touching[first], taken(first)
        if len(columns) > len(rows) or not columns:
            return None
        left = tuple(range(new, new + len(rows) - len(columns)))
        new += len(left)
        result.append(Front(tuple(sorted(rows)), tuple(sorted(columns)), tuple(sorted(others)), left))
        for k in others:
            touching[k] = (touching[k] - rows) | set(left)
        for j in others.union(*(rows_left[i] for k in others for i in touching[k] if i in rows_left)):
            known.pop(j, None)
        for i in rows:
            del rows_left[i]
        rows_left |= {i: set(others) for i in left}
        waiting -= columns
    return result


def work(order: Sequence[Front], right: int) -> int:
    """About how many multiplications the factor and solutions for so many right-hand sides take."""
    return sum(len(f.rows) ** 2 * (len(f.others) + right) + len(f.columns) * len(f.others) * right for f in order)


class Apart(NamedTuple):
    """The square of what a column has across those before it, or the product for two columns, times ``before``."""

    columns: tuple[int, ...]
    before: Expr
    square: Expr


class _Taken(NamedTuple):
    """x[columns] = inverse b[rows] - coupling x[others]; b[left] = free b[rows]."""

    front: Front
    inverse: list[Row]
    free: list[Row]
    coupling: list[Row]


class OrthogonalFactor:
    """Solutions x (n,) of A x = b in the sense of least squares; A (m, n) by rows, the order of its pattern."""

    def __init__(self, rows: Sequence[Row], n: int, order: Sequence[Front]) -> None:
        self.n, self.m = n, len(rows)
        self.apart: list[Apart] = []  #: what every column has across those before it
        self._taken: list[_Taken] = []
        rows_left = dict(enumerate(rows))
        #: squares of the lengths of the columns (n,)
        self.squares = [x for column in transpose(rows, n) if (x := dot(column, column)) is not None]
        self.parts = connected(rows)  #: columns that rows connect
        #: most columns of which one is compared with combinations of rows that the others have left
        self.longest = _longest(order)
        for front in order:
            taken = [rows_left.pop(i) for i in front.rows]
            graph = next(x.graph for row in taken for x in row.values())
            block = [[row.get(k, graph.zero) for k in front.columns] for row in taken]
            inverse, free, apart = _split(block)
            beside = [{k: row[k] for k in front.others if k in row} for row in taken]
            coupling = [_combined(part, beside) for part in inverse]
            for i, part in zip(front.left, free, strict=True):
                rows_left[i] = _combined(part, beside)
            self._taken.append(_Taken(front, inverse, free, coupling))
            self.apart += [Apart(tuple(front.columns[k] for k in x.columns), x.before, x.square) for x in apart]

    def solve(self, right: Sequence[Expr]) -> tuple[list[Expr], list[Expr]]:
        """x with A x = right, and what combinations of redundant rows leave of right."""
        zero = right[0].graph.zero
        b = dict(enumerate(right))
        values: list[list[Expr]] = []
        for front, inverse, free, _ in self._taken:
            known = {j: b[i] for j, i in enumerate(front.rows) if not b[i].is_zero}
            values.append([_product(part, known, zero) for part in inverse])
            b.update(zip(front.left, (_product(part, known, zero) for part in free), strict=True))
        x = [zero] * self.n
        for (front, _, _, coupling), value in zip(reversed(self._taken), reversed(values), strict=True):
            for k, total, row in zip(front.columns, value, coupling, strict=True):
                for j, entry in row.items():
                    if not x[j].is_zero:
                        total = total - entry * x[j]
                x[k] = total
        used = {i for front, *_ in self._taken for i in front.rows}
        return x, [y for i, y in b.items() if i not in used and not y.is_zero]


def _longest(order: Sequence[Front]) -> int:
    """Most columns of a front and of those whose left rows it takes, and so on."""
    made: dict[int, int] = {}
    columns: list[int] = []
    for k, front in enumerate(order):
        before = {made[i] for i in front.rows if i in made}
        columns.append(len(front.columns) + sum(columns[j] for j in before))
        made |= dict.fromkeys(front.left, k)
    return max(columns, default=0)


def connected(rows: Sequence[Row]) -> list[set[int]]:
    """The sets of columns that rows connect."""
    result: list[set[int]] = []
    for row in rows:
        touched = [part for part in result if not part.isdisjoint(row)]
        result = [part for part in result if part.isdisjoint(row)]
        result += [set(row).union(*touched)] if row else []
    return result


def _product(a: Row, b: Row, zero: Expr) -> Expr:
    result = dot(a, b)
    return zero if result is None else result


def _combined(part: Row, rows: Sequence[Row]) -> Row:
    result: Row = {}
    for i, factor in part.items():
        for k, x in rows[i].items():
            term = factor * x
            result[k] = result[k] + term if k in result else term
    return {k: x for k, x in result.items() if not x.is_zero}


def _split(block: Sequence[Sequence[Expr]]) -> tuple[list[Row], list[Row], list[Apart]]:
    """Of independent columns (m, k): the pseudo-inverse (k, m), orthonormal rows (m - k, m) across them, and what they
    have apart.
    """
    m, k = len(block), len(block[0])
    graph = block[0][0].graph
    if (m, k) in ((1, 1), (2, 2), (3, 3)):
        return _square(block)
    if m == 2:
        (p,), (r,) = block
        square = p * p + r * r
        length = 1.0 / graph.apply("sqrt", square)
        p, r = p * length, r * length
        return [_row(p * length, r * length)], [_row(-r, p)], [Apart((0,), graph.one, square)]
    if (m, k) == (3, 2):
        a, b = ((block[0][j], block[1][j], block[2][j]) for j in (0, 1))
        normal = vec.cross(a, b)
        square = vec.dot(normal, normal)
        length = 1.0 / graph.apply("sqrt", square)
        unit = vec.scale(length, normal)
        short = vec.scale(length, unit)
        inverse = [_row(*vec.cross(b, short)), _row(*vec.cross(short, a))]
        return inverse, [_row(*unit)], [Apart((0, 1), graph.one, square)]
    return _reflected(block)


def _row(*entries: Expr) -> Row:
    return {i: x for i, x in enumerate(entries) if not x.is_zero}


def _square(block: Sequence[Sequence[Expr]]) -> tuple[list[Row], list[Row], list[Apart]]:
    """Of as many rows as columns, up to three."""
    one = block[0][0].graph.one
    if len(block) == 1:
        pivot = block[0][0]
        return [_row(1.0 / pivot)], [], [Apart((0,), one, pivot * pivot)]
    if len(block) == 2:
        (p, q), (r, t) = block
        determinant = p * t - q * r
        inverse = 1.0 / determinant
        rows = [_row(t * inverse, -q * inverse), _row(-r * inverse, p * inverse)]
        return rows, [], [Apart((0, 1), one, determinant * determinant)]
    a, b, c = ((block[0][j], block[1][j], block[2][j]) for j in range(3))
    first, second, third = vec.cross(b, c), vec.cross(c, a), vec.cross(a, b)
    determinant = vec.dot(a, first)
    inverse = 1.0 / determinant
    rows = [_row(*vec.scale(inverse, x)) for x in (first, second, third)]
    square = vec.dot(third, third)
    return rows, [], [Apart((0, 1), one, square), Apart((2,), square, determinant * determinant)]


def _reflected(block: Sequence[Sequence[Expr]]) -> tuple[list[Row], list[Row], list[Apart]]:
    """By Householder's reflections, for any number of rows."""
    m, k = len(block), len(block[0])
    graph = block[0][0].graph
    zero, one = graph.zero, graph.one
    columns = [[row[j] for row in block] for j in range(k)]
    turned = [[one if i == j else zero for i in range(m)] for j in range(m)]  # columns of Q^T
    apart = []
    for j in range(k):
        column = columns[j]
        square = dot(dict(enumerate(column[j:])), dict(enumerate(column[j:])))
        assert square is not None
        apart.append(Apart((j,), one, square))
        length = graph.apply("sqrt", square)
        length = graph.apply("select", graph.apply("lt", column[j], zero), -length, length)
        head = column[j] + length
        tail = column[j + 1 :]
        factor = 1.0 / (length * head)
        for other in (*columns[j + 1 :], *turned):
            pairs = [head * other[j], *(x * y for x, y in zip(tail, other[j + 1 :], strict=True))]
            total = zero
            for pair in pairs:
                total = total + pair
            total = total * factor
            other[j] = other[j] - total * head
            for i, x in enumerate(tail, j + 1):
                other[i] = other[i] - total * x
        column[j] = -length
    reciprocals = [1.0 / columns[j][j] for j in range(k)]
    inverse: list[list[Expr]] = [[] for _ in range(k)]
    for j in reversed(range(k)):
        for i in range(m):
            total = turned[i][j]
            for c in range(j + 1, k):
                total = total - columns[c][j] * inverse[c][i]
            inverse[j].append(total * reciprocals[j])
    free = [_row(*(turned[i][j] for i in range(m))) for j in range(k, m)]
    return [_row(*x) for x in inverse], free, apart


# -- mass matrices of trees --------------------------------------------------------------------------------------------
# R. Featherstone, *Rigid Body Dynamics Algorithms* (2008), section 6.5: M = L^T D L with L unit lower triangular and
# L[i, j] non-zero only where j lies on the path from i to ground, so that branches never fill in.
LONG = 24  #: velocities on the way to ground, on average, with which a mass matrix is written out


def path(parent: Sequence[int], index: int) -> list[int]:
    """Indices on the path from `index` (excluded) to ground, nearest first."""
    result = []
    while (index := parent[index]) >= 0:
        result.append(index)
    return result


def factorize_tree(matrix: Sequence[Sequence[Expr]], parent: Sequence[int]) -> SparseFactor:
    """Factor a symmetric matrix with the branch-induced pattern of `parent`; only its lower triangle is read."""
    rows: list[Row] = [{i: row[i]} for i, row in enumerate(matrix)]
    for i, row in enumerate(matrix):
        for j in path(parent, i):
            if not row[j].is_zero:
                rows[i][j] = rows[j][i] = row[j]
    return factorize(rows, order=range(len(rows))[::-1])


def positivity(matrix: Sequence[Sequence[Expr]], factor: SparseFactor, scales: Sequence[Expr]) -> list[Expr]:
    """Conditions (each 1.0 or 0.0) that all hold exactly where the matrix is safely positive definite.

    Each pivot, made dimensionless by the scales of the coordinates, must exceed 1e-13 of its own diagonal entry, and
    1e-22 of the largest, so that sizes of independent motions do not matter.
    """
    if not matrix:
        return []
    graph = matrix[0][0].graph
    if len(matrix) == 1:
        return [graph.apply("lt", 0.0, matrix[0][0])]
    squares = [s * s for s in scales]
    sizes = [matrix[i][i] * squares[i] for i in range(len(matrix))]
    return exceeding([d * s for d, s in zip(factor.pivots, squares, strict=True)], sizes)


def exceeding(pivots: Sequence[Expr], sizes: Sequence[Expr]) -> list[Expr]:
    """Conditions (each 1.0 or 0.0): each pivot exceeds 1e-13 of its size and 1e-22 of the largest size."""
    graph = pivots[0].graph
    largest, *rest = sizes
    for entry in graph.marked(rest):
        largest = _larger(largest, entry)
    nothing = largest * NOTHING
    conditions = []
    for size, d in graph.marked(zip(sizes, pivots, strict=True)):
        reduced = not (size - d).is_zero
        if reduced:
            conditions.append(graph.apply("lt", size * SINGULAR, d))
        if len(sizes) > 1 or not reduced:
            conditions.append(graph.apply("lt", nothing, d))
    return conditions


def outward(pivots: Sequence[Expr], parent: Sequence[int]) -> list[Expr]:
    """For each articulated inertia the largest of those from there to the leaves, which it is left over from."""
    sizes = list(pivots)
    for k in pivots[0].graph.marked(reversed(range(len(sizes)))):
        if parent[k] >= 0:
            sizes[parent[k]] = _larger(sizes[parent[k]], sizes[k])
    return sizes


def articulated_positivity(pivots: Sequence[Expr], scales: Sequence[Expr], parent: Sequence[int]) -> list[Expr]:
    """Conditions as of :func:`positivity`, by articulated inertias."""
    graph = pivots[0].graph
    pivots = [d * s * s for d, s in graph.marked(zip(pivots, scales, strict=True))]
    if len(pivots) == 1:
        return [graph.apply("lt", graph.zero, pivots[0])]
    return exceeding(pivots, outward(pivots, parent))


def _larger(a: Expr, b: Expr) -> Expr:
    """Plain comparison, not "max": NaN is caught with the result, and this is one instruction."""
    return a.graph.apply("select", a.graph.apply("lt", a, b), b, a)


def _depths(parent: Sequence[int]) -> list[int]:
    """How many velocities lie between each one and ground."""
    depths: list[int] = []
    for above in parent:
        depths.append(depths[above] + 1 if above >= 0 else 0)
    return depths


def factoring_operations(parent: Sequence[int]) -> int:
    """Operations of L^T D L and one solution, in loops over the paths to ground (Featherstone, RBDA, table 6.5).

    Ratios, products and differences; then two substitutions and the division by the pivot.
    """
    return sum(n + n * (n + 1) + 4 * n + 1 for n in _depths(parent))


def has_long_paths(parent: Sequence[int]) -> bool:
    """Whether the mass matrix has too many entries to be written out: more than :data:`LONG` for each velocity."""
    return sum(_depths(parent)) > (LONG - 1) * len(parent)


def is_unrolled(parent: Sequence[int], limit: int) -> bool:
    """Whether factoring the mass matrix takes no more operations than that of a chain of ``limit`` velocities does."""
    return factoring_operations(parent) <= factoring_operations(range(-1, limit - 1))
