"""motions v = B y of all coordinates by the independent ones, and quadratic forms B^T N B of them.

A leg of a platform follows the few rows that hold it, and these the many freedoms of the platform: B = K C for the leg,
with K of the leg alone and C y the rates of its rows where it is held.  (K C)^T N (K C) as C^T (K^T N K) C takes the
inertia of the leg there first, as articulated bodies do: fewer operations with 3 rows and 6 freedoms.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

from ...graph.core import Expr
from ..linear_algebra import Row, dot, transpose

Lower = dict[tuple[int, int], Expr]  #: the lower triangle of a symmetric matrix, zeros left out


class Leg(NamedTuple):
    """Coordinates that follow from as many rows alone: B = K C."""

    columns: tuple[int, ...]
    inverse: list[Row]  #: K, by coordinate and row
    drive: list[Row]  #: C, by row and freedom


class Motions:
    """B (n, f) by its rows, and legs in it."""

    def __init__(self, rows: list[Row], n_dof: int, legs: Sequence[Leg] = ()) -> None:
        self.rows, self.n_dof, self.legs = rows, n_dof, legs

    @cached_property
    def columns(self) -> list[Row]:
        return transpose(self.rows, self.n_dof)

    def gram(self, N: Sequence[Row]) -> Lower:
        """B^T N B of a symmetric N (n, n)."""
        legs = [leg for leg in self.legs if _is_shorter(leg, N)]
        apart = {k for leg in legs for k in leg.columns}
        found = _product([{k: x for k, x in column.items() if k not in apart} for column in self.columns], N)
        for leg in legs:
            place = {k: i for i, k in enumerate(leg.columns)}
            own = [{place[j]: x for j, x in N[k].items()} for k in leg.columns]
            held = _product(transpose(leg.inverse, len(leg.drive)), own)
            carried: list[Row] = [{} for _ in leg.drive]
            for (i, j), x in held.items():
                carried[i][j] = carried[j][i] = x
            for key, x in _product(transpose(leg.drive, self.n_dof), carried).items():
                found[key] = found[key] + x if key in found else x
        return found


def _product(columns: Sequence[Row], N: Sequence[Row]) -> Lower:
    """A^T N A of A by its columns."""
    across = [{k: x for k, row in enumerate(N) if (x := dot(row, column)) is not None} for column in columns]
    pairs = {(i, k): dot(column, across[k]) for i, column in enumerate(columns) for k in range(i + 1)}
    return {key: x for key, x in pairs.items() if x is not None}


def _is_shorter(leg: Leg, N: Sequence[Row]) -> bool:
    """Whether the detour takes fewer multiplications, by the patterns; N must not couple the leg with others."""
    if any(not set(N[k]).issubset(leg.columns) for k in leg.columns):
        return False
    d, r, entries = len(leg.columns), len(leg.drive), sum(len(N[k]) for k in leg.columns)
    drives = [column for column in transpose(leg.drive, 1 + max(j for row in leg.drive for j in row)) if column]
    f = len(drives)
    factors = [sum(not _is_unit(x) for x in column.values()) for column in drives]
    alone = {i for column in drives if len(column) == 1 for i, x in column.items() if _is_unit(x)}  # columns of K in B
    detour = (r - len(alone)) * r * d + r * entries + d * r * (r + 1) // 2
    detour += sum(n * (r + f - i) for i, n in enumerate(factors))
    return detour < f * entries + d * f * (f + 1) // 2


def _is_unit(x: Expr) -> bool:
    return x.value is not None and abs(x.value) == 1.0
