"""Stage numeric: what a user gives as a whole number -> int, or an error that says what is allowed."""

from __future__ import annotations

from operator import index
from typing import Any

from ..base.texts import shown
from ..errors import off_range

MOST = 10**15  #: all whole numbers up to here are doubles, and their products with sizes of models no infinities


def read_count(what: str, given: Any, least: int = 0, most: int | None = None) -> int:
    """A whole number within limits.

    Raises
    ------
    UsageError
    """
    found = as_count(given)
    if found is None or found < least or found > (MOST if most is None else most):
        endless = most is None and (found is None or found < least)
        limits = f"of at least {least}" if endless else f"from {least} to {MOST if most is None else most}"
        raise off_range(f"{what} must be a whole number {limits}, not {shown(given)}")
    return found


def as_count(given: Any) -> int | None:
    """A whole number of Python, NumPy or SymPy; None if it is none, as True and 2.0 are."""
    if isinstance(given, (bool, float)):
        return None
    try:
        return index(given)
    except Exception:  # of an object's own __index__ too
        return None
