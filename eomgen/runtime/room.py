"""Stage runtime: numbers as a user gives them -> arrays; what no call can keep or end is refused before it begins."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

from ..errors import UsageError
from ..limits.runs import MOST_NUMBERS, MOST_STEPS
from ..numeric.scales import Array


def require_room(what: str, numbers: float, remedy: str) -> None:
    """Refuse what would keep more numbers than ``MOST_NUMBERS``, before any of them is made.

    Raises
    ------
    UsageError
    """
    if numbers > MOST_NUMBERS:
        raise UsageError(
            f"{what} would keep {numbers:.3g} numbers ({8.0 * numbers / 2**30:.3g} GiB), and a call keeps "
            f"{MOST_NUMBERS:.3g} at most; {remedy}"
        )


def require_steps(name: str, step: float, start: float, end: float) -> None:
    """Refuse steps of limited size that are too many for a run, or too small for its times.

    Raises
    ------
    UsageError
    """
    latest = max(abs(start), abs(end))
    if abs(end - start) > MOST_STEPS * step or (start != end and latest + step == latest):
        raise UsageError(f"{name} = {step:g} s is too small for a run from {start:g} to {end:g} s: it would not end")


def read_numbers(what: str, given: Any, width: float = 1.0) -> Array:
    """Real numbers as an array of floats, refused where `width` numbers for each column (n, k) would not fit.

    Raises
    ------
    UsageError
    """
    shape = np.shape(given) if isinstance(given, np.ndarray) else ()
    if len(shape) > 1:
        require_room(f"{what} of shape {shape}", float(np.prod(shape[1:], dtype=float)) * width, "give fewer columns")
    return _floats(given, f"{what} must hold real numbers")


def read_times(what: str, given: Any, per_time: int) -> Array:
    """Times as an array of floats (n,), refused where a row of `per_time` numbers for each would not fit.

    Raises
    ------
    UsageError
    """
    with suppress(TypeError):  # no length: one number, or what np.array refuses
        require_room(f"{what} with {len(given)} times", len(given) * per_time, "give fewer, or run in parts")
    return np.array(_floats(given, f"{what} must be a list of times in seconds"))


def _floats(given: Any, wanted: str) -> Array:
    try:
        if np.iscomplexobj(given):
            raise TypeError
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise UsageError(f"{wanted}, not {_short(given)}") from None


def _short(given: Any) -> str:
    text = repr(given)
    return text if len(text) <= 80 else f"{text[:80]}..."
