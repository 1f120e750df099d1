"""Stage verification, comparison: differences beside their limits -> the finding of the worst of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..base.limits.analyses import ROUNDED
from .finding import Finding

UNDERFLOW = float(np.finfo(float).tiny)  #: below it roundings are not relative (Higham 2002, sec. 2.2)
NO_LIMIT = "rounding gives no finite limit at any of the states: the system is singular there"
FAILED = np.inf  #: the figure of a check that could not be carried out


class Comparison:
    """Collects differences over states; the worst is the one that comes nearest to its limit, or exceeds it most.

    Parameters
    ----------
    check : str
        Name of the check.
    note : str
        What belongs in the table beside the figure.
    """

    def __init__(self, check: str, note: str = "") -> None:
        self.check, self.note = check, note
        self.cases = 0
        self._share = -1.0
        self._unlimited = False  #: whether an entry had no finite limit
        self._worst: tuple[float, float, str] = (0.0, 0.0, "")

    def add(
        self,
        number: int,
        difference: ArrayLike,
        limit: ArrayLike,
        size: float | None = None,
        labels: Sequence[str] = (),
    ) -> None:
        """Take the differences of one state.

        Parameters
        ----------
        number : int
            Of the state.
        difference : array
            Of any shape.
        limit : array, or float
            What rounding allows, of the same shape and unit.
        size : float, optional
            Size of what is compared; figures are told relative to it.  1 by default.
        labels : sequence of str, optional
            One for each entry.
        """
        self.cases += 1
        apart = np.abs(np.asarray(difference, dtype=float)).ravel()
        allowed = np.broadcast_to(np.asarray(limit, dtype=float), np.shape(difference)).ravel() + UNDERFLOW
        if not apart.size:
            return
        with np.errstate(all="ignore"):
            share = np.where(apart == 0.0, 0.0, apart / allowed)
        limited = np.isfinite(allowed)
        share = np.where(np.isfinite(apart), np.where(limited, share, -1.0), np.inf)
        self._unlimited |= not limited.all()
        k = int(share.argmax())
        if share[k] > self._share:
            unit = size if size and np.isfinite(size) else 1.0
            place = f"{labels[k]}, " if len(labels) == len(share) else ""
            self._share = float(share[k])
            figure = float(apart[k]) / unit if np.isfinite(apart[k]) else FAILED
            self._worst = figure, float(allowed[k]) / unit, f"{place}state {number}"

    def finding(self) -> Finding:
        """What was found; left out where rounding gives no entry a finite limit."""
        if self._share < 0.0 and self._unlimited:
            return Finding.skipped(self.check, NO_LIMIT)
        worst, limit, where = self._worst
        return Finding(self.check, worst, limit if np.isfinite(limit) else 0.0, where, self.cases, self.note)


def size_of(values: ArrayLike) -> float:
    """The largest entry."""
    return float(np.abs(np.asarray(values, dtype=float)).max(initial=0.0))


def terms_size(values: ArrayLike, bounds: ArrayLike) -> float:
    """The largest entry, or the size of the terms that cancel in it, told from the bound of its rounding."""
    return max(size_of(values), size_of(bounds) / ROUNDED)


def pairs(rows: Sequence[str], columns: Sequence[str]) -> list[str]:
    """Labels of a matrix."""
    return [f"{row} by {column}" for row in rows for column in columns]


def failed(check: str, error: Exception) -> Finding:
    """A check that raised an error where it should have given a figure."""
    text = " ".join(str(error).split())
    return Finding(check, FAILED, 0.0, "", 0, f"{type(error).__name__}: {text[:200]}")


def times(a: Array, b: Array) -> Array:
    """|A| |b|"""
    return np.asarray(np.abs(a) @ np.abs(b))
