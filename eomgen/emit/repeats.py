"""Stage emit: a list of statements -> stretches that repeat themselves, so that each can be written once.

What Python's loops make without a mark of the graph (rows of constraints, pivots of their factor, sums over a chain)
comes out as the same operations again and again.  A repeat of period p is a stretch in which every statement is like
the one p places before it.  Longest gains are taken first, and what they leave of the others is looked at again.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from heapq import heapify, heappop, heappush

import numpy as np

FEW = 3  #: segments of fewer members are not worth a loop
#: A repeat saves the text of so many statements, or is left alone: a loop is a function of its own, which keeps what
#: others read in memory.
WORTH = 60


def find_repeats(letters: Sequence[Hashable], longest: int, worth: int = WORTH) -> list[tuple[int, int, int]]:
    """Start, period and count of stretches that repeat themselves, in order, none overlapping another.

    Parameters
    ----------
    letters : sequence
        What each statement is like, equal for those that may be alike.
    longest : int
        The longest period.
    worth : int
        How many statements a repeat spares at least.
    """
    numbers: dict[Hashable, int] = {}
    text = np.array([numbers.setdefault(x, len(numbers)) for x in letters], dtype=np.int32)
    waiting = []
    for period in range(1, min(longest, len(text) // FEW) + 1):
        waiting += [_offer(start, period, end) for start, end in _stretches(text, period, worth)]
    heapify(waiting)
    taken = np.zeros(len(text), dtype=bool)
    found = []
    while waiting:
        _, period, start, end = heappop(waiting)
        free = _free_parts(taken, start, end)
        if free == [(start, end)]:
            count = (end - start) // period
            found.append((start, period, count))
            taken[start : start + count * period] = True
            continue
        for first, last in free:
            if _saved(first, period, last) >= worth:
                heappush(waiting, _offer(first, period, last))
    return sorted(found)


def _saved(start: int, period: int, end: int) -> int:
    """Statements that need not be written; none of too few members."""
    count = (end - start) // period
    return (count - 1) * period if count >= FEW else 0


def _offer(start: int, period: int, end: int) -> tuple[int, int, int, int]:
    return -_saved(start, period, end), period, start, end


def _stretches(text: np.ndarray, period: int, worth: int) -> list[tuple[int, int]]:
    """Start and end of all that repeat themselves after a period and are worth a loop."""
    unlike = np.flatnonzero(text[period:] != text[:-period])
    edges = np.concatenate(([-1], unlike, [len(text) - period]))
    starts, ends = edges[:-1] + 1, edges[1:] + period
    count = (ends - starts) // period
    good = (count >= FEW) & ((count - 1) * period >= worth)
    return list(zip(starts[good].tolist(), ends[good].tolist(), strict=True))


def _free_parts(taken: np.ndarray, start: int, end: int) -> list[tuple[int, int]]:
    """What of a stretch is not taken."""
    free = np.concatenate(([True], taken[start:end], [True]))
    edges = np.flatnonzero(free[1:] != free[:-1]) + start
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
