"""The L^T D L factorisation on the graph against NumPy, and its cost."""

import numpy as np
import pytest

from eomgen.graph.core import Graph
from eomgen.graph.count import count
from eomgen.graph.evaluate import evaluate
from eomgen.program.factor import factorize, path, positivity, solve

TREES = {
    "chain": [-1, 0, 1, 2, 3],
    "branched": [-1, 0, 1, 1, 0, 4, 4],
    "forest": [-1, -1, 0, 1, 1],
    "star": [-1, 0, 0, 0, 0],
    "single": [-1],
}


def random_matrix(parent, rng):
    """Positive definite with the branch-induced pattern: H = L^T D L."""
    n = len(parent)
    L = np.eye(n)
    for i in range(n):
        L[i, path(parent, i)] = rng.uniform(-1.0, 1.0, len(path(parent, i)))
    return L.T @ np.diag(rng.uniform(0.5, 2.0, n)) @ L


def on_graph(H):
    g = Graph()
    rows = [[g.symbol(f"h{i}_{j}") if x else g.zero for j, x in enumerate(row)] for i, row in enumerate(H)]
    return g, rows, {f"h{i}_{j}": x for i, row in enumerate(H) for j, x in enumerate(row)}


@pytest.mark.parametrize("parent", TREES.values(), ids=TREES)
def test_the_solution_is_that_of_a_dense_solve(parent):
    rng = np.random.default_rng(len(parent))
    H = random_matrix(parent, rng)
    g, rows, values = on_graph(H)
    b = rng.uniform(-1.0, 1.0, len(parent))
    x = solve(factorize(rows, parent), [g.constant(value) for value in b])
    np.testing.assert_allclose(evaluate(x, values), np.linalg.solve(H, b), rtol=1e-12, atol=1e-12)


def test_branches_do_not_fill_in_and_cost_what_featherstone_counts():
    """RBDA section 6.5: with d_i the depth, D1 = sum(d_i - 1) ratios and D2 = sum d_i (d_i - 1) / 2 updates."""
    parent = TREES["branched"]
    _, rows, _ = on_graph(random_matrix(parent, np.random.default_rng(0)))
    factor = factorize(rows, parent)
    assert [sorted(row) for row in factor.lower] == [sorted(path(parent, i)) for i in range(len(parent))]
    depths = [len(path(parent, i)) + 1 for i in range(len(parent))]
    operations = count([*factor.pivots, *(x for row in factor.lower for x in row.values())])
    d1 = sum(d - 1 for d in depths)
    d2 = sum(d * (d - 1) // 2 for d in depths)
    assert operations.additions == d2
    assert operations.multiplications == d1 + d2
    assert operations.divisions == sum(len(path(parent, i)) > 0 for i in range(len(parent)))  # one reciprocal per row
    assert not operations.functions


@pytest.mark.parametrize(("change", "passes"), [(0.0, True), (-1.0, False), (1e-15 - 1.0, False), (-2.0, False)])
def test_positivity_notices_a_pivot_without_inertia(change, passes):
    """H = [[1, 1], [1, 2]]: the last pivot is H[1,1], the first 1 - 1 / H[1,1]."""
    g, rows, values = on_graph(np.array([[1.0, 1.0], [1.0, 2.0]]))
    values["h0_0"] = 0.5 + 0.5 * (1.0 + change)
    conditions = positivity(rows, factorize(rows, [-1, 0]), [g.one, g.one])
    assert all(evaluate(conditions, values)) == passes


def test_positivity_does_not_depend_on_units():
    """A metre or a micrometre behind a coordinate is no reason to call its inertia zero."""
    for scale in (1.0, 1e-9, 1e9):
        H = np.array([[1.0, 0.0], [0.0, scale**-2]])
        g, rows, values = on_graph(np.where(H, H, 1e-300))
        conditions = positivity(rows, factorize(rows, [-1, 0]), [g.one, g.constant(scale)])
        assert all(evaluate(conditions, values))
