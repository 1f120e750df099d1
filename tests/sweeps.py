"""Long sweeps over many alike cases: which of them run always, and which by ``make thorough`` alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def part_of(cases: Iterable[Any], keep: Callable[[Any], bool]) -> list[Any]:
    """The cases of a sweep as parameters; those that are not to be kept are marked thorough.

    Parameters
    ----------
    cases : iterable
        Values of one parameter, tuples of values of several, or ``pytest.param``.
    keep : callable
        Whether a case runs always, of its value, or of the tuple of its values.
    """
    found = []
    for case in cases:
        values, id_, marks = (case.values, case.id, list(case.marks)) if hasattr(case, "marks") else (None, None, [])
        if values is None:
            values = case if isinstance(case, tuple) else (case,)
        kept = keep(values if len(values) > 1 else values[0])
        found.append(pytest.param(*values, id=id_, marks=[*marks, *([] if kept else [pytest.mark.thorough])]))
    return found
