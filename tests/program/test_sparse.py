"""Sparse factors on the graph against NumPy, and how little they fill."""

from __future__ import annotations

import numpy as np
import pytest

from eomgen.graph import Graph
from eomgen.graph.count import count
from eomgen.graph.evaluate import evaluate
from eomgen.numeric.triangular import diagonal_blocks, match
from eomgen.program.sparse import factorize, fill, gram, minimum_degree, rows_of, times, transpose


def symbolic(graph: Graph, A: np.ndarray, name: str) -> tuple[list[list[object]], dict[str, float]]:
    """Symbols where the matrix is not zero."""
    values = {f"{name}{i}_{k}": float(x) for (i, k), x in np.ndenumerate(A) if x}
    return [
        [graph.symbol(f"{name}{i}_{k}") if x else graph.zero for k, x in enumerate(row)] for i, row in enumerate(A)
    ], values


@pytest.mark.parametrize("seed", range(6))
def test_a_gram_matrix_is_solved_as_by_numpy(seed: int) -> None:
    random = np.random.default_rng(seed)
    m, n = int(random.integers(2, 8)), 9
    A = random.normal(size=(m, n)) * (random.random((m, n)) < 0.4) + np.eye(m, n)
    b = random.normal(size=m)
    graph = Graph()
    rows, values = symbolic(graph, A, "a")
    right = [graph.symbol(f"b{i}") for i in range(m)]
    sparse = rows_of(rows)
    x = factorize(gram(sparse)).solve(right)
    y = times(transpose(sparse, n), x)
    found = evaluate([*x, *y], values | {f"b{i}": float(v) for i, v in enumerate(b)})
    expected = np.linalg.solve(A @ A.T, b)
    np.testing.assert_allclose(found[:m], expected, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found[m:], A.T @ expected, rtol=1e-10, atol=1e-12)


def test_a_star_is_eliminated_from_its_tips() -> None:
    """Without fill: the centre last, whatever its place."""
    star: list[dict[int, object]] = [dict.fromkeys(range(6)), *({0: None, i: None} for i in range(1, 6))]
    assert minimum_degree(star)[-2:] in ([0, 5], [5, 0])
    assert fill(star) <= 2 * 5


def test_a_chain_of_rows_costs_the_same_per_row() -> None:
    def cost(m: int) -> int:
        graph = Graph()
        A = np.zeros((m, m + 1))
        A[np.arange(m), np.arange(m)] = A[np.arange(m), np.arange(m) + 1] = 1.0
        rows, _ = symbolic(graph, A, "a")
        solved = factorize(gram(rows_of(rows))).solve([graph.symbol(f"b{i}") for i in range(m)])
        return count(solved).total

    assert cost(40) - cost(20) == cost(60) - cost(40)


@pytest.mark.parametrize("seed", range(8))
def test_blocks_can_be_solved_in_their_order(seed: int) -> None:
    """Each row of a block has entries in its own columns and those of earlier blocks only; together they are all."""
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 9))
    order = random.permutation(n)
    A = np.eye(n)[order] + (random.random((n, n)) < 0.25)
    rows: list[dict[int, object]] = [dict.fromkeys(np.flatnonzero(row).tolist()) for row in A]
    blocks = diagonal_blocks(rows)
    assert blocks is not None
    known: set[int] = set()
    for block in blocks:
        assert len(block.rows) == len(block.columns)
        known.update(block.columns)
        for i in block.rows:
            assert set(rows[i]) <= known
    assert sorted(i for b in blocks for i in b.rows) == list(range(n))
    assert known == set(range(n))
    row_of = match(rows)
    assert row_of is not None
    assert all(k in rows[i] for k, i in row_of.items())


def test_a_triangle_falls_into_single_rows_and_a_cycle_into_one_block() -> None:
    triangle: list[dict[int, object]] = [dict.fromkeys(range(i + 1)) for i in range(4)]
    blocks = diagonal_blocks(triangle)
    assert blocks is not None
    assert [b.columns for b in blocks] == [(0,), (1,), (2,), (3,)]
    cycle: list[dict[int, object]] = [{i: None, (i + 1) % 4: None} for i in range(4)]
    blocks = diagonal_blocks(cycle)
    assert blocks is not None
    assert [b.columns for b in blocks] == [(0, 1, 2, 3)]


def test_a_matrix_that_is_singular_whatever_its_numbers_is_known() -> None:
    assert match([{0: None}, {0: None}]) is None
    assert diagonal_blocks([{0: None}, {0: None}]) is None
