"""Rank and motions of large Jacobians by their parts, beside NumPy's singular values of the whole matrix."""

import numpy as np
import pytest

from eomgen.limits.constraints import STRUCTURE, UNMOVED
from eomgen.numeric import algebra, choose_independent, conditioning
from eomgen.numeric.row_chains import SMALL, SparseRows, parts

SEEDS = range(12)


def row_of_loops(random, loops, unit=1.0, repeated=0):
    """Two rows a loop, three coordinates, of which one belongs to the next loop; some rows repeated in combinations."""
    J = np.zeros((2 * loops, 2 * loops + 1))
    for k in range(loops):
        across = np.linalg.qr(random.normal(size=(2, 2)))[0]
        J[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = across * random.uniform(0.5, 2.0)
        J[2 * k : 2 * k + 2, 2 * k + 2] = 0.3 * random.normal(size=2)
    for _ in range(repeated):
        i = 2 * random.integers(0, loops - 1)
        J = np.vstack([J, random.normal(size=4) @ J[i : i + 4]])
    return unit * J


def web(random, m, n, unit=1.0):
    """A part in which all rows hold coordinates at random."""
    J = random.normal(size=(m, n)) * (random.uniform(size=(m, n)) < 0.3)
    J[np.arange(m), np.arange(m)] += 2.0
    return unit * J


def hidden(random, unit=1.0):
    """Parts of all kinds and sizes, of units that differ, redundant rows and idle coordinates, in any order."""
    pieces = [
        row_of_loops(random, 40, repeated=int(random.integers(0, 6))),
        row_of_loops(random, 30, unit, repeated=3),
        web(random, 20, 31, unit),
        web(random, 25, 25),
        np.zeros((3, 4)),
        np.outer(random.normal(size=5), random.normal(size=40)) * unit,
    ]
    J = np.zeros(np.sum([piece.shape for piece in pieces], axis=0))
    i = j = 0
    for piece in pieces:
        J[i : i + len(piece), j : j + piece.shape[1]] = piece
        i, j = i + len(piece), j + piece.shape[1]
    return J[random.permutation(len(J))][:, random.permutation(J.shape[1])]


def told(J):
    """Rank and projector onto the motions, by NumPy alone."""
    _, sizes, Vt = np.linalg.svd(J)
    count = int(np.count_nonzero((sizes > STRUCTURE * sizes[0]) & (sizes > UNMOVED)))
    return count, Vt[count:].T @ Vt[count:]


@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e-6, 1e3])
@pytest.mark.parametrize("seed", SEEDS)
def test_parts_tell_the_rank_and_the_motions_of_the_whole(seed, unit):
    J = hidden(np.random.default_rng(seed), unit)
    assert J.size > SMALL
    rows, (count, along) = SparseRows(J), told(J)
    assert rows._told or unit < 1e-3  # by parts, not by singular values of the whole
    assert rows.rank == count
    motions = rows.motions(count)
    assert motions.shape == (J.shape[1] - count, J.shape[1])
    assert np.abs(motions @ motions.T - np.eye(len(motions))).max() < 1e-13
    assert np.abs(motions.T @ motions - along).max() < 1e-11 / min(unit, 1 / unit)


@pytest.mark.parametrize("seed", SEEDS)
def test_parts_are_those_of_the_pattern(seed):
    J = hidden(np.random.default_rng(seed))
    seen = np.zeros(J.shape[1], dtype=bool)
    for levels in parts(J):
        rows = np.concatenate([x.rows for x in levels])
        columns = np.concatenate([x.columns for x in levels])
        assert not seen[columns].any()
        seen[columns] = True
        outside = np.ones(J.shape[1], dtype=bool)
        outside[columns] = False
        assert not J[np.ix_(rows, np.flatnonzero(outside))].any()
        for k, level in enumerate(levels):  # rows hold coordinates of their level and of the next
            near = np.concatenate([x.columns for x in levels[k : k + 2]])
            assert np.count_nonzero(J[level.rows]) == np.count_nonzero(J[np.ix_(level.rows, near)])
    assert seen.all()


@pytest.mark.parametrize("scale", [0.1, 0.5, 0.9, 1.1, 2.0, 10.0])
def test_a_part_of_faint_rows_is_judged_beside_the_others(scale):
    """A singular value about the tolerance counts as NumPy's does, wherever the part stands."""
    random = np.random.default_rng(3)
    J = row_of_loops(random, 80)
    faint = np.linalg.svd(J, compute_uv=False)[0] * STRUCTURE * scale
    whole = np.zeros((len(J) + 1, J.shape[1] + 2))
    whole[:-1, 2:], whole[-1, :2] = J, faint / np.sqrt(2.0)
    for order in range(3):
        mixed = np.random.default_rng(order).permutation(len(whole))
        assert SparseRows(whole[mixed]).rank == told(whole)[0] == len(J) + (scale > 1.0)


def test_rows_at_the_tolerance_are_left_to_singular_values():
    random = np.random.default_rng(4)
    J, nearly = row_of_loops(random, 80), random.normal(size=161)
    judged = [SparseRows(np.vstack([J, J[0] + J[3] + x * nearly])) for x in np.geomspace(1e-10, 1e-6, 60)]
    assert [rows.rank for rows in judged] == [told(rows.J)[0] for rows in judged]
    assert {rows.rank for rows in judged} == {160, 161}
    assert {len(rows._told) for rows in judged} == {0, 1}
    assert all(len(rows.motions(160)) == 1 for rows in judged)


def test_no_large_matrix_is_decomposed(monkeypatch):
    sizes, svd = [], algebra.svd
    monkeypatch.setattr(algebra, "svd", lambda A, *rest: (sizes.append(A.size), svd(A, *rest))[1])
    monkeypatch.setattr(algebra, "singular_values", None)
    rows = SparseRows(row_of_loops(np.random.default_rng(5), 300, repeated=5))
    assert rows.rank == 600
    assert len(rows.motions(600)) == 1
    assert max(sizes) < 5000


@pytest.mark.parametrize("seed", SEEDS)
def test_order_does_not_matter_for_the_choice(seed):
    """Coordinates that move each part best are found wherever they stand."""
    random = np.random.default_rng(seed)
    J = row_of_loops(random, 90)
    first = choose_independent([SparseRows(J)], 180).tolist()
    places = random.permutation(J.shape[1])
    turned = SparseRows(J[random.permutation(180)][:, places])
    preferred = [int(np.flatnonzero(places == j)[0]) for j in range(J.shape[1])]  # the same order as before
    assert sorted(places[choose_independent([turned], 180, preferred)].tolist()) == first


@pytest.mark.parametrize("seed", SEEDS)
def test_conditioning_by_parts_is_that_of_the_whole(seed):
    J = hidden(np.random.default_rng(seed))
    rows = SparseRows(J)
    free = choose_independent([rows], rows.rank)
    expected = conditioning(J, free)
    assert rows.conditioning(free) == pytest.approx(expected, rel=1e-10)
    sizes = np.linalg.svd(np.delete(J, free, axis=1), compute_uv=False)
    assert expected == pytest.approx(sizes[rows.rank - 1] / np.linalg.svd(J, compute_uv=False)[0], rel=1e-10)
    assert rows.conditioning(free) > 1e-4
    assert rows.conditioning(free[:-1]) < 1e-12
