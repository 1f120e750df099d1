"""What one check came to, from differences beside their limits, and the table of all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite, isnan, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..base.texts import fold, terminal_width
from .limits import ROUNDED

# -- findings ----------------------------------------------------------------------------------------------------------


WIDTH = 118  #: of the table
NOT_REACHED = "not reached"  #: how the note of a check begins for which no time was left
#: Why nothing is integrated of a model with contacts that have no law of force.
RIGID = "its rigid contacts exert impulses, which only method moreau solves for"
HEADER = ("", "check", "worst", "limit", "where")


class Finding(NamedTuple):
    """The result of one check: the worst figure over all states tried, and the limit that rounding allows."""

    check: str  #: what was compared, such as "accelerations: free-body balance"
    worst: float  #: the largest difference found, relative to the size of what was compared; nan where left out
    limit: float  #: the most that rounding allows there
    where: str = ""  #: body, joint, row or coordinate and the state of the worst figure
    states_compared: int = 0  #: number of states compared
    note: str = ""  #: why the check does not apply, or failed to run

    @property
    def ok(self) -> bool:
        """Whether the figure keeps its limit, or the check does not apply to this model."""
        return self.left_out or self.worst <= self.limit

    @property
    def left_out(self) -> bool:
        """Whether the check does not apply to this model; `note` says why."""
        return isnan(self.worst) and isnan(self.limit)

    @property
    def verdict(self) -> str:
        """``ok``, ``BREACH`` or ``-`` for a check that was left out."""
        return "-" if self.left_out else "ok" if self.ok else "BREACH"

    def as_dict(self) -> dict[str, Any]:
        """Plain values, as JSON has them: figures that are no numbers are None."""
        figures = {
            key: value if isfinite(value) else None for key, value in (("worst", self.worst), ("limit", self.limit))
        }
        facts = {"check": self.check, "ok": self.ok, "left_out": self.left_out}
        return facts | figures | {"where": self.where, "cases": self.states_compared, "note": self.note}

    @classmethod
    def skipped(cls, check: str, why: str) -> Finding:
        """A check that does not apply."""
        return cls(check, nan, nan, note=why)


class Verification(NamedTuple):
    """The results of all checks of one model."""

    name: str  #: of the model
    findings: tuple[Finding, ...]
    seconds: float = 0.0  #: that it took

    @property
    def ok(self) -> bool:
        """Whether every check that applies keeps its limit, and at least one does."""
        return all(finding.ok for finding in self.findings) and not all(f.left_out for f in self.findings)

    @property
    def not_reached(self) -> int:
        """Number of checks for which no time was left."""
        return sum(finding.note.startswith(NOT_REACHED) for finding in self.findings)

    @property
    def breaches(self) -> tuple[Finding, ...]:
        """The checks whose figures exceed their limits."""
        return tuple(finding for finding in self.findings if not finding.ok)

    @property
    def table(self) -> str:
        """One line for each check: verdict, worst figure, limit, where; notes below the lines they belong to."""
        rows = [HEADER, *(_cells(finding) for finding in self.findings)]
        widths = [max(len(row[k]) for row in rows) for k in range(len(HEADER) - 1)]
        lines = []
        columns = min(WIDTH, terminal_width() or WIDTH)
        for row, note in zip(rows, ("", *(f.note for f in self.findings)), strict=True):
            cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
            lines.append("  ".join([*cells, row[-1]]).rstrip())
            indent = " " * (widths[0] + 4)
            lines += fold(note, columns, indent, indent)
        return "\n".join(lines)

    def __str__(self) -> str:
        checked = [f for f in self.findings if not f.left_out]
        left_out = len(self.findings) - len(checked)
        ending = f"{len(checked)} checks, {len(self.breaches)} breaches"
        ending += f", {left_out} left out" if left_out else ""
        ending += f", {self.not_reached} of them for lack of time: give more seconds" if self.not_reached else ""
        return f"verification of {self.name}\n\n{self.table}\n\n{'ok' if self.ok else 'BREACH'}: {ending}"

    def __repr__(self) -> str:
        return str(self)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, as JSON has them."""
        facts = {"name": self.name, "ok": self.ok, "not_reached": self.not_reached}
        return facts | {"findings": [f.as_dict() for f in self.findings]}


def _cells(finding: Finding) -> tuple[str, ...]:
    if finding.left_out:
        return "-", finding.check, "", "", ""
    return finding.verdict, finding.check, f"{finding.worst:.1e}", f"{finding.limit:.1e}", finding.where


# -- comparisons -------------------------------------------------------------------------------------------------------


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
        self.states_compared = 0
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
        self.states_compared += 1
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
        if self._share < 0.0 and self._unlimited:
            return Finding.skipped(self.check, NO_LIMIT)
        worst, limit, where = self._worst
        return Finding(self.check, worst, limit if np.isfinite(limit) else 0.0, where, self.states_compared, self.note)


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


# -- derivatives by differences ----------------------------------------------------------------------------------------

# Central differences at halved steps, extrapolated (L. F. Richardson, The deferred approach to the limit, 1927; C. J.
# F. Ridders, Accurate computation of F'(x) and F'(x) F''(x), Adv. Eng. Software 4 (1982), 75-76).


HALVINGS = 5
FIRST_STEP = 2e-2  #: relative to the size of the variable
#: Beside a singular position a long first step misjudges its error: where it disagrees, a shorter one decides.
SHORTER = 0.1
SAFETY = 20.0  #: on the estimated error


def extrapolate(f: Callable[[float], Array], noise: Array | float, step: float = FIRST_STEP) -> tuple[Array, Array]:
    """df/ds at s = 0 and how far it may be off.

    Parameters
    ----------
    f : callable
        s -> array.
    noise : array or float
        By how much rounding may move f.
    step : float
        The first step.

    Returns
    -------
    slope, error : arrays
        Entry by entry the column of the table whose estimate is the smallest.
    """
    table: list[Array] = []
    best, error = np.zeros(0), np.zeros(0)
    for i in range(HALVINGS):
        h = step * 0.5**i
        row = [(np.asarray(f(h)) - np.asarray(f(-h))) / (2.0 * h)]
        for j in range(1, i + 1):
            row.append(row[j - 1] + (row[j - 1] - table[j - 1]) / (4.0**j - 1.0))
        if i:
            for j in range(1, i + 1):
                guess = np.maximum(np.abs(row[j] - row[j - 1]), np.abs(row[j] - table[j - 1])) + 2.0 * noise / h
                if not best.size:
                    best, error = row[j], guess
                best, error = np.where(guess < error, row[j], best), np.minimum(guess, error)
        table = row
    return best, SAFETY * error
