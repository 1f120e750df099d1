"""Numeric: a number of an element -> whether it lies in the range that is allowed, and what is said if it does not."""

from __future__ import annotations

from typing import Any, NamedTuple


class Flaw(NamedTuple):
    """What is wrong with numbers of an element."""

    key: str  #: what is at fault, behind the path of the place: ``[2]``, ``.tip_radius`` or nothing
    message: str
    remedy: str


class Allowed(NamedTuple):
    """Numbers from ``low`` to ``high``, None where there is no bound; a bound itself may be excluded."""

    low: float | None = None
    high: float | None = None
    above: bool = False  #: whether ``low`` is excluded
    below: bool = False  #: whether ``high`` is excluded

    def has(self, x: Any) -> Any:
        """Whether a number, or each of an array, is allowed."""
        over = x == x if self.low is None else x > self.low if self.above else x >= self.low
        under = x == x if self.high is None else x < self.high if self.below else x <= self.high
        return over & under


POSITIVE = Allowed(0.0, above=True)
NOT_NEGATIVE = Allowed(0.0)
RANGE = "range"  #: the rule of one number in a range


def judge_range(values: Any, low: Any, high: Any, above: bool, below: bool, remedy: str, message: str) -> list[Flaw]:
    """The rule of one number, for which ``{:g}`` stands in the message; that it is so great by default."""
    number = float(values[0])
    if Allowed(low, high, above, below).has(number):
        return []
    return [Flaw("", (message or "is {:g}").format(number), remedy)]
