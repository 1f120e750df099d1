"""Stage verification: what one check found, and the table of all of them."""

from __future__ import annotations

from math import isfinite, isnan, nan
from typing import Any, NamedTuple

from ..base.texts import fold, terminal_width

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
    cases: int = 0  #: number of states compared
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
        own = {"check": self.check, "ok": self.ok, "left_out": self.left_out}
        return own | figures | {"where": self.where, "cases": self.cases, "note": self.note}

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
        room = min(WIDTH, terminal_width() or WIDTH)
        for row, note in zip(rows, ("", *(f.note for f in self.findings)), strict=True):
            cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
            lines.append("  ".join([*cells, row[-1]]).rstrip())
            indent = " " * (widths[0] + 4)
            lines += fold(note, room, indent, indent)
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
        own = {"name": self.name, "ok": self.ok, "not_reached": self.not_reached}
        return own | {"findings": [f.as_dict() for f in self.findings]}


def _cells(finding: Finding) -> tuple[str, ...]:
    if finding.left_out:
        return "-", finding.check, "", "", ""
    return finding.verdict, finding.check, f"{finding.worst:.1e}", f"{finding.limit:.1e}", finding.where
