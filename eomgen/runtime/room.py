"""Stage runtime: numbers as a user gives them -> arrays; what no call can keep or end is refused before it begins."""

from __future__ import annotations

from contextlib import suppress
from math import isfinite
from typing import Any

import numpy as np

from ..errors import UsageError
from ..limits.runs import MOST_NUMBERS, MOST_STEPS
from ..numeric.scales import Array

#: What Python or NumPy would make a float of, or NaN, though it is no real number.
UNREAL = (str, bytes, complex, np.complexfloating, np.datetime64, np.timedelta64, type(None))


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


def as_real(given: Any) -> Array | None:
    """What is given as an array of floats (float64), itself if it is one; None if these are no real numbers.

    Real numbers are what NumPy converts to float64: floats, integers, booleans, Fractions, Decimals, numbers of SymPy,
    in lists and arrays too.  Texts, dates, complex numbers, None and masked entries are none.
    """
    if type(given) is np.ndarray and given.dtype == np.float64:
        return given
    try:
        array = np.asarray(given)
        kind = array.dtype.kind
        if kind not in "biufO" or (kind == "O" and any(isinstance(one, UNREAL) for one in array.flat)):
            return None
        if isinstance(given, np.ma.MaskedArray) and np.ma.is_masked(given):
            return None
        return array.astype(float, copy=False)
    except (TypeError, ValueError, OverflowError):
        return None


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


def read_vector(what: str, given: Any, n: int, error: type[Exception] = UsageError) -> Array:
    """An array of n floats.

    Raises
    ------
    error
    """
    found = as_real(given)
    if found is None:
        raise error(f"{what} must hold real numbers, ({n},), not {shown(given)}")
    if found.shape != (n,):
        raise error(f"{what} must have shape ({n},), not {found.shape}")
    return found


def read_times(what: str, given: Any, per_time: int) -> Array:
    """Times as an array of floats (n,), refused where a row of `per_time` numbers for each would not fit.

    Raises
    ------
    UsageError
    """
    with suppress(TypeError):  # no length: one number, or what is no list of times
        require_room(f"{what} with {len(given)} times", len(given) * per_time, "give fewer, or run in parts")
    return np.array(_floats(given, f"{what} must be a list of times in seconds"))


def read_number(what: str, given: Any) -> float:
    """One finite real number.

    Raises
    ------
    UsageError
    """
    if type(given) is float:
        result = given
    else:
        found = as_real(given)
        if found is None or found.ndim:
            raise UsageError(f"{what} must be a number, not {shown(given)}")
        result = float(found)
    if not isfinite(result):
        raise UsageError(f"{what} must be finite, not {result}")
    return result


def read_count(what: str, given: Any) -> int:
    """A whole number that is not negative.

    Raises
    ------
    UsageError
    """
    if isinstance(given, bool) or not isinstance(given, (int, np.integer)) or given < 0:
        raise UsageError(f"{what}, not {shown(given)}")
    return int(given)


def read_flag(what: str, given: Any) -> bool:
    """True or False.

    Raises
    ------
    UsageError
    """
    if not isinstance(given, (bool, np.bool_)):
        raise UsageError(f"{what} must be True or False, not {shown(given)}")
    return bool(given)


def _floats(given: Any, wanted: str) -> Array:
    found = as_real(given)
    if found is None:
        raise UsageError(f"{wanted}, not {shown(given)}")
    return found


def shown(given: Any) -> str:
    """What was given, in one line of a message."""
    text = " ".join(repr(given).split())
    return text if len(text) <= 80 else f"{text[:80]}..."
