"""Analysis: a range of one coordinate, or of time alone, to and fro -> the part of each way that is known already."""

from __future__ import annotations

import numpy as np

from ..base.algebra import Array


class KnownRange:
    """What of a range to and fro on one line was followed already.

    Parameters
    ----------
    t : (n,) array
    y : (k, n) array
        Led values.
    """

    def __init__(self, t: Array, y: Array) -> None:
        moving = [row for row in (t, *y) if np.ptp(row)]
        #: values of the only coordinate that moves, or of the time, or None
        self.values = moving[0] if len(moving) == 1 else None
        self.low = self.high = 0.0 if self.values is None else float(self.values[0])

    def known(self, first: int, last: int) -> float:
        """The part of the way between two points, from the first on, that was followed and is smooth."""
        if self.values is None or not self.low <= self.values[first] <= self.high:
            return 0.0
        start, end = float(self.values[first]), float(self.values[last])
        inside = min(max(end, self.low), self.high) - start
        return inside / (end - start) if end != start else 0.0

    def note(self, first: int, last: int, smooth: bool) -> None:
        """Take note of a way; after one that is not smooth nothing is known any more."""
        if self.values is None:
            return
        ends = float(self.values[first]), float(self.values[last])
        self.low, self.high = min(self.low, *ends), max(self.high, *ends)
        if not smooth:
            self.values = None
