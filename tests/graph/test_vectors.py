import numpy as np
import pytest

from eomgen.graph import Graph, evaluate
from eomgen.graph import vectors as vec


@pytest.fixture
def case():
    g = Graph()
    rng = np.random.default_rng(3)
    values = {}

    def symbols(shape, name):
        array = rng.normal(size=shape)
        values.update({f"{name}{k}": array[k] for k in np.ndindex(shape)})
        return array, [g.symbol(f"{name}{k}") for k in np.ndindex(shape)]

    a, sa = symbols((3,), "a")
    b, sb = symbols((3,), "b")
    m, sm = symbols((3, 3), "m")
    n, sn = symbols((3, 3), "n")
    as_matrix = lambda s: tuple(tuple(s[3 * i : 3 * i + 3]) for i in range(3))  # noqa: E731
    return g, values, (a, tuple(sa)), (b, tuple(sb)), (m, as_matrix(sm)), (n, as_matrix(sn))


def test_vectors_and_matrices_agree_with_numpy(case):
    g, values, (a, sa), (b, sb), (m, sm), (n, sn) = case

    def check(result, expected):
        flat = [x for row in result for x in (row if isinstance(row, tuple) else (row,))]
        np.testing.assert_allclose(evaluate(flat, values), np.ravel(expected), rtol=1e-14)

    check(vec.add(sa, sb), a + b)
    check(vec.sub(sa, sb), a - b)
    check(vec.neg(sa), -a)
    check(vec.scale(sb[0], sa), b[0] * a)
    check((vec.dot(sa, sb),), a @ b)
    check(vec.cross(sa, sb), np.cross(a, b))
    check(vec.times(sm, sa), m @ a)
    check(vec.transpose_times(sm, sa), m.T @ a)
    check(vec.transpose(sm), m.T)
    check(vec.product(sm, sn), m @ n)
    check(vec.vector(g, [1, sa[0], 2.5]), [1, a[0], 2.5])


def test_unit_and_zero_fold_away(case):
    g, _, (_, sa), _, (_, sm), _ = case
    assert vec.times(vec.identity(g), sa) == sa
    assert vec.product(vec.identity(g), sm) == sm
    assert vec.cross(vec.zero(g), sa) == vec.zero(g)
