"""Sparse least squares on the graph by orthogonal combinations of rows, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from eomgen.graph import Graph, evaluate
from eomgen.program.orthogonal import OrthogonalFactor, connected, fronts

#: Patterns (m rows) of matrices, one for each kind of block and some that mix them: columns of each row.
PATTERNS = {
    "one by one": [[0], [0, 1], [1, 2]],
    "two by one": [[0], [0]],
    "two by two": [[0, 1], [0, 1]],
    "three by one": [[0], [0], [0]],
    "three by two": [[0, 1], [0, 1], [0, 1]],
    "three by three": [[0, 1, 2]] * 3,
    "five by four": [[0, 1, 2, 3]] * 5,
    "six by six": [[*range(6)]] * 6,
    "two legs on a platform": [[0, 1, 4, 5]] * 3 + [[2, 3, 4, 5]] * 3,
    "arms with two rods": [[0, 1, 4, 9], [0, 1, 9], [1, 4, 9, 10], *[[2, 3, 4, 9, 10]] * 3, *[[5, 6, 9, 10, 7, 8]] * 6],
    "redundant rows": [[0, 1]] * 4 + [[1, 2], [2, 3], [2, 3], [3, 0]],
    "a chain": [[k, k + 1, (k + 5) % 9] for k in range(8)] + [[0, 8]],
}


def built(pattern: list[list[int]]) -> tuple[Graph, list[dict], int]:
    graph = Graph()
    n = 1 + max(k for row in pattern for k in row)
    return graph, [{k: graph.symbol(f"a{i}_{k}") for k in row} for i, row in enumerate(pattern)], n


def dense(pattern: list[list[int]], n: int, rng: np.random.Generator) -> tuple[np.ndarray, dict[str, float]]:
    A = np.zeros((len(pattern), n))
    for i, row in enumerate(pattern):
        A[i, row] = rng.uniform(-1, 1, len(row))
    return A, {f"a{i}_{k}": A[i, k] for i, row in enumerate(pattern) for k in row}


@pytest.mark.parametrize("name", PATTERNS)
def test_solutions_are_those_of_least_squares(name: str) -> None:
    pattern, rng = PATTERNS[name], np.random.default_rng(len(name))
    graph, rows, n = built(pattern)
    order = fronts(rows, n)
    assert order is not None
    assert sorted(k for front in order for k in front.columns) == list(range(n))
    factor = OrthogonalFactor(rows, n, order)
    right = [graph.symbol(f"b{i}") for i in range(len(rows))]
    x, left = factor.solve(right)
    for _ in range(5):
        A, values = dense(pattern, n, rng)
        b = rng.uniform(-1, 1, len(pattern)) if len(pattern) == n else A @ rng.uniform(-1, 1, n)
        values |= {f"b{i}": y for i, y in enumerate(b)}
        expected = np.linalg.lstsq(A, b, rcond=None)[0]
        size = max(1.0, np.abs(expected).max()) * np.linalg.cond(A)
        np.testing.assert_allclose(evaluate(x, values), expected, rtol=0, atol=1e-14 * size)
        off = rng.uniform(-1, 1, len(pattern))  # rows that contradict each other
        values |= {f"b{i}": y for i, y in enumerate(off)}
        expected = np.linalg.lstsq(A, off, rcond=None)[0]
        size = max(1.0, np.abs(expected).max()) * np.linalg.cond(A) ** 2
        np.testing.assert_allclose(evaluate(x, values), expected, rtol=0, atol=1e-14 * size)
        missed = np.linalg.norm(off - A @ expected)  # of orthonormal combinations the length stays
        assert np.linalg.norm(evaluate(left, values)) == pytest.approx(missed, rel=1e-8, abs=1e-14 * size)


@pytest.mark.parametrize("name", PATTERNS)
def test_what_columns_have_apart_is_the_determinant_of_their_products(name: str) -> None:
    pattern, rng = PATTERNS[name], np.random.default_rng(3)
    _, rows, n = built(pattern)
    order = fronts(rows, n)
    assert order is not None
    factor = OrthogonalFactor(rows, n, order)
    A, values = dense(pattern, n, rng)
    parts = np.divide(*(evaluate([x[k] for x in factor.apart], values) for k in (2, 1)))
    assert parts.prod() == pytest.approx(np.linalg.det(A.T @ A), rel=1e-9)
    np.testing.assert_allclose(evaluate(factor.squares, values), (A**2).sum(axis=0), rtol=1e-14)
    taken: list[int] = []
    assert {len(x.columns) for x in factor.apart} <= {1, 2}
    for (columns, _, _), found in zip(factor.apart, parts, strict=True):  # each beside the columns before it
        before, now = A[:, taken], A[:, [*taken, *columns]]
        expected = np.linalg.det(now.T @ now) / (np.linalg.det(before.T @ before) if taken else 1.0)
        assert found == pytest.approx(expected, rel=1e-8)
        taken += columns


@pytest.mark.parametrize("pattern", [[[0, 1]], [[0], [1], [0, 1, 2, 3]], [[0, 1], [2], [2]]])
def test_columns_that_no_numbers_make_independent_are_told(pattern: list[list[int]]) -> None:
    assert fronts(pattern, 1 + max(k for row in pattern for k in row)) is None


def test_the_work_of_a_leg_does_not_grow_with_the_number_of_legs() -> None:
    sizes = []
    for legs in (2, 4, 8):
        pattern = [[2 * k, 2 * k + 1, 2 * legs, 2 * legs + 1] for k in range(legs) for _ in range(3)]
        order = fronts(pattern, 2 * legs + 2)
        assert order is not None
        sizes.append([(len(f.rows), len(f.columns), len(f.others)) for f in order])
        assert sizes[-1][:legs] == [(3, 2, 2)] * legs
    assert [len(x) for x in sizes] == [3, 5, 9]


def test_parts_that_no_row_connects_are_apart() -> None:
    rows = [dict.fromkeys(row) for row in ([0, 1], [2], [1, 3], [4, 5], [5, 6], [])]
    assert sorted(map(sorted, connected(rows))) == [[0, 1, 3], [2], [4, 5, 6]]  # type: ignore[arg-type]


@pytest.mark.parametrize("missing", [0, 1, 12, 13, 24])
def test_a_row_of_loops_is_taken_from_its_ends(missing: int) -> None:
    """Loop k holds columns 2 k to 2 k + 2 by two rows; one column is independent and left out."""
    pattern = [{c - (c > missing) for c in (2 * k, 2 * k + 1, 2 * k + 2) if c != missing} for k in range(12)]
    order = fronts([row for row in pattern for _ in range(2)], 24)
    assert order is not None
    assert all(len(front.rows) == len(front.columns) for front in order)
    _, rows, n = built([sorted(row) for row in pattern for _ in range(2)])
    assert OrthogonalFactor(rows, n, order).longest == 2


def test_columns_behind_the_rows_that_a_front_takes_are_counted() -> None:
    """Both legs leave a row to the platform: its two columns are compared with those of the legs."""
    _, rows, n = built(PATTERNS["two legs on a platform"])
    order = fronts(rows, n)
    assert order is not None
    assert [(len(front.columns), len(front.left)) for front in order] == [(2, 1), (2, 1), (2, 0)]
    assert OrthogonalFactor(rows, n, order).longest == 6


@pytest.mark.parametrize("seed", range(30))
def test_fronts_of_random_patterns(seed: int) -> None:
    """Each takes all rows that hold its columns, and no column is forgotten or taken twice."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 25))
    pattern = [{k, *random.integers(0, n, random.integers(0, 4)).tolist()} for k in [*range(n), *range(0, n, 5)]]
    order = fronts(pattern, n)
    assert order is not None
    held = dict(enumerate(map(set, pattern)))
    for front in order:
        assert set(front.rows) == {i for i, row in held.items() if not row.isdisjoint(front.columns)}
        near = set().union(*(held.pop(i) for i in front.rows))
        assert near == {*front.columns, *front.others}
        assert len(front.left) == len(front.rows) - len(front.columns)
        held |= {i: set(front.others) for i in front.left}
    assert sorted(k for front in order for k in front.columns) == list(range(n))
