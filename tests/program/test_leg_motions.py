"""Quadratic forms of motions against NumPy, and what the detour over the rows of a leg saves."""

from __future__ import annotations

import numpy as np
import pytest

from eomgen.graph import Graph
from eomgen.graph.core import Expr
from eomgen.graph.count import count
from eomgen.graph.evaluate import evaluate
from eomgen.program.leg_motions import Leg, Motions, _product
from eomgen.program.sparse import dot, transpose

LEGS, ROWS, FREEDOMS = 4, 3, 6


class Platform:
    """Six freedoms of a platform, then legs of three coordinates: symbols, and their numbers."""

    def __init__(self, seed: int, coupled: bool) -> None:
        self.graph, self.rng, self.values = Graph(), np.random.default_rng(seed), dict[str, float]()
        one = self.graph.one
        n = FREEDOMS + ROWS * LEGS
        self.rows: list[dict[int, Expr]] = [{j: one} for j in range(FREEDOMS)]
        self.legs = []
        for k in range(LEGS):
            first = FREEDOMS + ROWS * k
            inverse = [{r: self.symbol(f"K{k}_{c}{r}") for r in range(ROWS)} for c in range(ROWS)]
            drive = [{r: -one, **{3 + j: self.symbol(f"C{k}_{r}{j}") for j in range(3) if j != r}} for r in range(ROWS)]
            columns = transpose(drive, FREEDOMS)
            self.rows += [{j: x for j, c in enumerate(columns) if (x := dot(row, c)) is not None} for row in inverse]
            self.legs.append(Leg((first, first + 1, first + 2), inverse, drive))
        self.N: list[dict[int, Expr]] = [{} for _ in range(n)]
        for i in range(n):
            for j in range(i + 1):
                same = i < FREEDOMS or (j >= FREEDOMS and (i - FREEDOMS) // ROWS == (j - FREEDOMS) // ROWS)
                if same or (coupled and i == n - 1 and j == 0):
                    self.N[i][j] = self.N[j][i] = self.symbol(f"N{i}_{j}")

    def symbol(self, name: str) -> Expr:
        self.values[name] = float(self.rng.uniform(-1, 1))
        return self.graph.symbol(name)

    def dense(self, rows: list[dict[int, Expr]], n: int) -> np.ndarray:
        full = [row.get(j, self.graph.zero) for row in rows for j in range(n)]
        return np.array(evaluate(full, self.values)).reshape(len(rows), n)


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_forms_are_those_of_numpy(seed: int, coupled: bool) -> None:
    """A leg that N couples with another coordinate takes the straight way."""
    platform = Platform(seed, coupled)
    B, N = platform.dense(platform.rows, FREEDOMS), platform.dense(platform.N, len(platform.N))
    found = Motions(platform.rows, FREEDOMS, platform.legs).gram(platform.N)
    values = evaluate(list(found.values()), platform.values)
    expected = B.T @ N @ B
    np.testing.assert_allclose(values, [expected[key] for key in found], rtol=0, atol=1e-13 * np.abs(expected).max())
    assert set(found) == {(i, j) for i in range(FREEDOMS) for j in range(i + 1)}


def test_legs_take_fewer_operations() -> None:
    platform = Platform(1, False)
    straight = Motions(platform.rows, FREEDOMS).gram(platform.N)
    detour = Motions(platform.rows, FREEDOMS, platform.legs).gram(platform.N)
    B = [x for row in platform.rows for x in row.values()]  # needed in any case
    counts = [count([*B, *form.values()]).total - count(B).total for form in (straight, detour)]
    assert counts[1] < 0.75 * counts[0]


def test_a_leg_of_as_few_freedoms_as_rows_takes_the_straight_way() -> None:
    platform = Platform(2, False)
    drive = [{r: platform.symbol(f"D{r}")} for r in range(ROWS)]
    inverse = platform.legs[0].inverse
    columns = transpose(drive, ROWS)
    rows = [{j: x for j, c in enumerate(columns) if (x := dot(row, c)) is not None} for row in inverse]
    N = [{j: platform.symbol(f"S{max(i, j)}{min(i, j)}") for j in range(ROWS)} for i in range(ROWS)]
    found = Motions(rows, ROWS, [Leg((0, 1, 2), inverse, drive)]).gram(N)
    assert found == _product(transpose(rows, ROWS), N)
