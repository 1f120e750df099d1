"""Tree equations, constraints -> the embedded system in the independent coordinates, as expressions.

M_e = B^T M B and f_e = -B^T (h + M a) with v = B v_i and v' = B v_i' + a (Shabana, sec. 5.7).  For reading: compiled
modules eliminate numerically with pivoting.  Here the pivots are fixed, chosen by their size at the reference.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain, count
from typing import NamedTuple

from ...expr.core import Expr
from ...expr.evaluate import evaluate
from ...expr.tensors import dot
from ...expr.vectors import Rows
from .. import Kinematics
from ..mobility import Mobility
from ..sparse_rows import diagonal_blocks


class VelocityTransformation(NamedTuple):
    """v = B v_i + b and v' = B v_i' + a: the velocities of the tree by the independent ones, and their rates.

    ``matrix`` is B (n_v, n_dof), row by row; ``offset`` is b (n_v,), what drivers and other prescribed motions add;
    ``acceleration_offset`` is a (n_v,).
    """

    matrix: Rows
    offset: tuple[Expr, ...]
    acceleration_offset: tuple[Expr, ...]

    def project(self, forces: Sequence[Expr]) -> tuple[Expr, ...]:
        """B^T Q: generalized forces of the tree along the independent velocities."""
        return tuple(dot(column, forces) for column in zip(*self.matrix, strict=True))

    def mass_matrix(self, mass: Rows) -> Rows:
        """B^T M B."""
        columns = list(zip(*self.matrix, strict=True))
        weighted = [[dot(row, column) for row in mass] for column in columns]
        return tuple(tuple(dot(column, other) for other in weighted) for column in columns)

    def force(self, mass: Rows, right: Sequence[Expr]) -> tuple[Expr, ...]:
        """B^T (Q - M a)."""
        rest = [-f + dot(row, self.acceleration_offset) for f, row in zip(right, mass, strict=True)]
        return tuple(-x for x in self.project(rest))


def transform_velocities(
    kinematics: Kinematics, mobility: Mobility, values: Mapping[str, float], names: LoopNames | None = None
) -> VelocityTransformation:
    """B, b and a of the independent velocities of the mobility, with pivots judged by numbers as above.

    With ``names`` what loops give is named on the way; the names then stand as symbols in B, b and a.
    """
    n, c = len(kinematics.v), kinematics.constraints
    free = [kinematics.velocity_labels.index(name) for name in mobility.independent]
    rows = [[*c.jacobian[i], c.gamma[i], c.time_derivative[i]] for i in mobility.independent_rows]
    solved = solve_velocities(kinematics, mobility, rows, free, values, names)
    matrix = tuple(tuple(row[k] for k in free) for row in solved)
    return VelocityTransformation(matrix, tuple(row[n + 1] for row in solved), tuple(row[n] for row in solved))


def solve_velocities(
    kinematics: Kinematics,
    mobility: Mobility,
    rows: Sequence[Sequence[Expr]],
    free: Sequence[int],
    values: Mapping[str, float],
    names: LoopNames | None = None,
) -> list[list[Expr]]:
    """Each velocity of the tree by the columns of the rows: those in ``free``, and those behind the velocities."""
    zero, one, n = kinematics.graph.zero, kinematics.graph.one, len(kinematics.v)
    bound = [j for j in range(n) if j not in free]
    solved = eliminate(kinematics, mobility, rows, bound, values, names) if bound else {}
    width = max(map(len, rows), default=n + 2)
    return [
        [-x for x in solved[j]] if j in solved else [one if k == j else zero for k in range(width)] for j in range(n)
    ]


class LoopNames:
    """Names for what is formed on the way to the dependent velocities."""

    def __init__(self, kinematics: Kinematics, independent: Sequence[str]) -> None:
        self.parts: list[tuple[str, Expr]] = []  #: names, which stand as symbols in what follows, and their values
        self._graph = kinematics.graph
        self._labels, n = kinematics.velocity_labels, len(kinematics.v)
        self._columns = {n: "a", n + 1: "b"} | {
            self._labels.index(name): f"B_{name}" if len(independent) > 1 else "" for name in independent
        }
        self._taken = {node[1] for node in self._graph.nodes if node[0] == "sym"}

    def entry(self, j: int, column: int, value: Expr) -> Expr:
        """-B_jk, -a_j or -b_j by the name of what it is."""
        label, of = self._labels[j], self._columns.get(column)
        if of is None:
            return value
        name = f"{of}_{label}" if column >= len(self._labels) else f"B_{label}" + (f"_{of[2:]}" if of else "")
        return -self.part(name, -value)

    def part(self, name: str, value: Expr) -> Expr:
        """A name for a value that is more than a symbol or a number."""
        kind, *args = value.node
        if kind == "neg":
            kind = self._graph.nodes[args[0]][0]
        if kind in ("sym", "const"):
            return value
        name = next(x for x in chain([name], (f"{name}_{k}" for k in count(1))) if x not in self._taken)
        self._taken.add(name)
        self.parts.append((name, value))
        return self._graph.symbol(name)


def eliminate(
    kinematics: Kinematics,
    mobility: Mobility,
    matrix: Sequence[Sequence[Expr]],
    bound: Sequence[int],
    values: Mapping[str, float],
    names: LoopNames | None = None,
) -> dict[int, list[Expr]]:
    """Solve rows, as many as there are columns ``bound``, for these columns: column -> its solved row.

    Block by block: a block holds as many rows as unknowns of which no smaller part can be found by itself, such as the
    two angles of a four-bar.  One and two unknowns are solved by Cramer's rule, more by Gauss-Jordan elimination.
    """
    at = dict(values) | dict(zip(kinematics.names, mobility.q_reference, strict=True))
    at |= dict.fromkeys(kinematics.velocity_names, 0.0)
    zero, one = kinematics.graph.zero, kinematics.graph.one
    others = [k for k in range(len(matrix[0])) if k not in bound]
    solved: dict[int, list[Expr]] = {}
    for rows, unknowns in _blocks(matrix, bound):
        left = [[matrix[i][j] for j in unknowns] for i in rows]
        right = [[matrix[i][k] for k in others] for i in rows]
        for j, known in solved.items():
            factors = [matrix[i][j] for i in rows]
            right = [
                [x - f * known[k] for x, k in zip(row, others, strict=True)]
                for f, row in zip(factors, right, strict=True)
            ]
        result = _solve(left, right, at, names)
        for j, values_of_row in zip(unknowns, result, strict=True):
            row = dict(zip(others, values_of_row, strict=True))
            if names is not None:
                row = {k: names.entry(j, k, x) for k, x in row.items()}
            solved[j] = [row.get(k, one if k == j else zero) for k in range(len(matrix[0]))]
    return solved


def _blocks(matrix: Sequence[Sequence[Expr]], bound: Sequence[int]) -> list[tuple[list[int], list[int]]]:
    """Rows and unknowns of each block, in an order in which each needs only those before it."""
    blocks = diagonal_blocks([{k: None for k, j in enumerate(bound) if not row[j].is_zero} for row in matrix])
    if blocks is None:  # no order exists: a pivot will vanish
        return [(list(range(len(matrix))), list(bound))]
    return [(list(block.rows), [bound[k] for k in block.columns]) for block in blocks]


def _solve(
    left: list[list[Expr]], right: list[list[Expr]], at: Mapping[str, float], names: LoopNames | None
) -> list[list[Expr]]:
    """left^-1 right; parts get names where there are names."""
    if len(left) == 1:
        return [[x / left[0][0] for x in right[0]]]
    if len(left) == 2:
        (a, b), (c, d) = left
        below = a * d - b * c
        if names is not None:
            below = names.part("D", below)
        top = [(x * d - b * y) / below for x, y in zip(*right, strict=True)]
        return [top, [(a * y - c * x) / below for x, y in zip(*right, strict=True)]]
    n = len(left)
    rows = [[*a, *b] for a, b in zip(left, right, strict=True)]
    numbers = [[float(x) for x in evaluate(row, at)] for row in left]
    waiting = list(range(n))
    pivots: dict[int, int] = {}  # column -> row
    while waiting:
        columns = [j for j in range(n) if j not in pivots]
        # a sparse pivot row swells least; among those of fair size take it
        largest = max(abs(numbers[i][j]) for i in waiting for j in columns)
        fair = [(i, j) for i in waiting for j in columns if abs(numbers[i][j]) >= 0.05 * largest]
        i, j = min(fair, key=lambda p: (sum(not x.is_zero for x in rows[p[0]]), p))
        waiting.remove(i)
        pivots[j] = i
        pivot, size = rows[i][j], numbers[i][j]
        rows[i] = [_named(names, x / pivot) for x in rows[i]]
        numbers[i] = [x / size for x in numbers[i]]
        for k in range(n):
            factor, amount = rows[k][j], numbers[k][j]
            if k != i and not factor.is_zero:
                rows[k] = [
                    x if y.is_zero else _named(names, x - factor * y) for x, y in zip(rows[k], rows[i], strict=True)
                ]
                numbers[k] = [x - amount * y for x, y in zip(numbers[k], numbers[i], strict=True)]
    return [rows[pivots[j]][n:] for j in range(n)]


def _named(names: LoopNames | None, value: Expr) -> Expr:
    return value if names is None else names.part("w", value)
