"""Stage verification: what one check found, and the table of all of them."""

from __future__ import annotations

from math import isnan, nan
from typing import NamedTuple


class Finding(NamedTuple):
    """What one check found: the worst figure over all states tried, beside the limit that rounding allows."""

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

    @classmethod
    def skipped(cls, check: str, why: str) -> Finding:
        """A check that does not apply."""
        return cls(check, nan, nan, note=why)


class Verification(NamedTuple):
    """All findings about one model."""

    name: str  #: of the model
    findings: tuple[Finding, ...]

    @property
    def ok(self) -> bool:
        """Whether every check that applies keeps its limit."""
        return all(finding.ok for finding in self.findings)
