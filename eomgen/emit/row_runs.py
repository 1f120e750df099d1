"""Stage emit: tables of integers -> runs of rows, each further than the one before by the same steps.

Shapes on alike bodies stand in a table as rows that differ by the number of the body alone.  Written as runs, the table
of 320 links is as long as that of 40.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

LONGEST = 64  #: rows of one period at most, such as the corners of one shape

Row = tuple[int, ...]


class RowRun(NamedTuple):
    """Some rows that come several times, each time further by steps of their own.

    Attributes
    ----------
    rows : sequence of tuple of int
        Those of the first time.
    steps : sequence of tuple of int
        By how much each is further the next time; empty if the rows come once.
    times : int
    """

    rows: Sequence[Row]
    steps: Sequence[Row]
    times: int


def runs_of(table: Sequence[Sequence[int]]) -> list[RowRun]:
    """A table as runs, which give its rows one after the other."""
    rows = [tuple(row) for row in table]
    found: list[RowRun] = []
    alone: list[Row] = []  # rows that fit no run
    at = 0
    while at < len(rows):
        period, times = _longest(rows, at)
        if times * period > 2 * period:  # a run holds each row of its period twice
            if alone:
                found.append(RowRun(alone, (), 1))
                alone = []
            steps = [_step(rows[at + k], rows[at + period + k]) for k in range(period)]
            found.append(RowRun(rows[at : at + period], steps, times))
            at += period * times
        else:
            alone.append(rows[at])
            at += 1
    return [*found, RowRun(alone, (), 1)] if alone else found


def _step(first: Row, second: Row) -> Row:
    return tuple(b - a for a, b in zip(first, second, strict=True))


def _longest(rows: Sequence[Row], at: int) -> tuple[int, int]:
    """Period and number of times of the run at a row that spares most rows."""
    best, spared = (1, 1), 0
    for period in range(1, min(LONGEST, (len(rows) - at) // 3) + 1):
        end = at + 2 * period
        while end < len(rows) and _goes_on(rows, end, period):
            end += 1
        times = (end - at) // period
        if (times - 2) * period > spared:
            best, spared = (period, times), (times - 2) * period
    return best


def _goes_on(rows: Sequence[Row], k: int, period: int) -> bool:
    return _step(rows[k - 2 * period], rows[k - period]) == _step(rows[k - period], rows[k])


def written(table: Sequence[Sequence[int]]) -> dict[str, list[Row]]:
    """What C needs of a table: its rows and steps, and of each run how many rows it has and how often they come."""
    runs = runs_of(table)
    return {
        "rows": [row for run in runs for row in (*run.rows, *run.steps)],
        "runs": [(len(run.rows), run.times) for run in runs],
    }
