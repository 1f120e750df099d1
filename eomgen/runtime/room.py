"""Stage runtime: numbers as a user gives them -> arrays; what no call can keep or end is refused before it begins."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from math import isfinite
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.runs import MOST_NUMBERS, MOST_STEPS
from ..base.texts import shown
from ..base.value_rules import as_count, read_count
from ..errors import UsageError, ill_shaped, ill_typed, no_number, too_large

#: What Python or NumPy would make a float of, or NaN, though it is no real number.
UNREAL = (str, bytes, complex, np.complexfloating, np.datetime64, np.timedelta64, type(None))
#: Numbers that are read without a look at each.
PLAIN = frozenset((float, int, bool, np.float64))
DEEPEST = 64  #: lists in lists, as in NumPy


def require_room(what: str, numbers: float, remedy: str) -> None:
    """Refuse what would keep more numbers than ``MOST_NUMBERS``, before any of them is made.

    Raises
    ------
    UsageError
    """
    if numbers > MOST_NUMBERS:
        raise too_large(
            f"{what} would keep {numbers:.3g} numbers ({8.0 * numbers / 2**30:.3g} GiB), and a call can keep at most "
            f"{MOST_NUMBERS:.3g}; {remedy}"
        )


def require_steps(name: str, step: float, start: float, end: float) -> None:
    """Refuse steps of limited size that are too many for a run, or too small for its times.

    Raises
    ------
    UsageError
    """
    latest = max(abs(start), abs(end))
    if abs(end - start) > MOST_STEPS * step or (start != end and latest + step == latest):
        raise UsageError(
            f"{name} = {step:g} s is too small for a run from {start:g} to {end:g} s: it would not end",
            code="EG-ENDLESS",
        )


def as_real(given: Any) -> Array | None:
    """What is given as an array of floats (float64), itself if it is one; None if these are no real numbers.

    Real numbers are what NumPy converts to float64: floats, integers, booleans, Fractions, Decimals, numbers of SymPy,
    in lists and arrays too.  Texts, dates, complex numbers, None and masked entries are none, nor is what fails to
    convert, whatever it raises.  The compiled layer has the same rule in C, eomgen/native/_numbers.pxi.
    """
    try:
        if type(given) is np.ndarray:
            if given.dtype == np.float64:
                return given
            if given.dtype.kind in "biuf" and given.itemsize <= 8:
                return given.astype(float)
        elif type(given) in (list, tuple) and PLAIN.issuperset(map(type, given)):
            return np.array(given, dtype=float)
        elif has_masked(given):
            return None
        array = np.asarray(given)
        kind = array.dtype.kind
        if kind not in "biufO":
            return None
        if kind == "O" and any(isinstance(one, UNREAL) or has_masked(one) for one in array.flat):
            return None
        with np.errstate(over="ignore") if array.itemsize > 8 else nullcontext():
            return array.astype(float, copy=False)
    except MemoryError:
        raise
    except Exception:  # of an object's own __array__, __float__, ...
        return None


def has_masked(given: Any, depth: int = 0) -> bool:
    """Whether NumPy would read the value under a masked entry, or NaN, in an array or in lists of these."""
    if isinstance(given, np.ma.MaskedArray):
        return bool(np.ma.is_masked(given))
    if not isinstance(given, (list, tuple)) or depth > DEEPEST or PLAIN.issuperset(map(type, given)):
        return False
    return any(has_masked(one, depth + 1) for one in given)


def read_numbers(what: str, given: Any, width: float = 1.0) -> Array:
    """Real numbers as an array of floats, refused where `width` numbers for each column (n, k) would not fit.

    Raises
    ------
    UsageError
    """
    shape = np.shape(given) if isinstance(given, np.ndarray) else ()
    if len(shape) > 1:
        require_room(f"{what} of shape {shape}", float(np.prod(shape[1:], dtype=float)) * width, "give fewer columns")
    return _floats(what, given, f"{what} must hold real numbers")


def read_vector(what: str, given: Any, n: int, error: Callable[[str], Exception] = ill_shaped) -> Array:
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


def fitting(
    out: Any, shape: tuple[int, ...], what: str = "out", error: Callable[[str], Exception] = ill_shaped
) -> Array:
    """The array that takes a result, if it can."""
    if not isinstance(out, np.ndarray) or out.shape != shape or out.dtype != np.float64:
        given = f"{out.shape} of {out.dtype}" if isinstance(out, np.ndarray) else f"a {type(out).__name__}"
        raise error(f"{what} must be a float64 array of shape {shape}, not {given}")
    if not out.flags.writeable:
        raise error(f"{what} is read-only")
    if out.size and any(step == 0 and n > 1 for step, n in zip(out.strides, shape, strict=True)):
        raise error(f"{what} has strides {out.strides}: several of its entries are one number in memory")
    return out


def read_times(what: str, given: Any, per_time: int) -> Array:
    """Times as an array of floats (n,), refused where a row of `per_time` numbers for each would not fit.

    Raises
    ------
    UsageError
    """
    try:
        length = len(given)
    except Exception:  # one number, or what is no list of times
        length = 0
    require_room(f"{what} with {length} times", length * per_time, "give fewer times, or run in parts")
    return np.array(_floats(what, given, f"{what} must be a list of times in seconds"))


def read_number(what: str, given: Any) -> float:
    """One finite real number, or an expression of numbers as text: ``"10*pi/180"``.

    Raises
    ------
    UsageError
    """
    return read_plain(what, read_text(what, given) if isinstance(given, str) else given)


def read_plain(what: str, given: Any) -> float:
    """One finite real number, as compiled code takes it, which reads no texts.

    Raises
    ------
    UsageError
    """
    if type(given) is float:
        result = given
    else:
        found = as_real(given)
        if found is None or found.ndim:
            raise no_number(f"{what} must be a number, not {shown(given)}")
        result = float(found)
    if not isfinite(result):
        raise no_number(f"{what} must be finite, not {result}")
    return result


def read_text(what: str, given: str) -> float:
    """The value of an expression of numbers as text: ``"10*pi/180"``.

    Raises
    ------
    UsageError
        Texts are read where eomgen is: a generated package has no parser.
    """
    try:
        from ..describe.expressions import constant
    except ImportError:
        raise no_number(f"{what} must be a number, not {given!r}; only eomgen itself reads texts") from None
    return constant(given, what)


def with_numbers(what: str, given: Any, depth: int = 0) -> Any:
    """Lists and tuples of numbers with the values of the texts in them; anything else as it is.

    Raises
    ------
    UsageError
        A text that is no number.
    """
    if not isinstance(given, (list, tuple)) or depth > DEEPEST or PLAIN.issuperset(map(type, given)):
        return given
    return [read_text(what, one) if isinstance(one, str) else with_numbers(what, one, depth + 1) for one in given]


def read_flag(what: str, given: Any) -> bool:
    """True or False.

    Raises
    ------
    UsageError
    """
    if not isinstance(given, (bool, np.bool_)):
        raise ill_typed(f"{what} must be True or False, not {shown(given)}")
    return bool(given)


def _floats(what: str, given: Any, wanted: str) -> Array:
    found = as_real(with_numbers(what, given))
    if found is None:
        raise ill_typed(f"{wanted}, not {shown(given)}")
    return found


def read_axis(label: str, given: Any) -> Array:
    """Values of one axis from (low, high, count) or from the values themselves."""
    what = f"{label}: give (low, high, count) or two or more rising or falling values"
    if isinstance(given, tuple) and len(given) == 3 and as_count(given[2]) is not None:
        count = read_count(f"{label}: the third of (low, high, count)", given[2], 2, 10_000_000)
        given = np.linspace(read_number(what, given[0]), read_number(what, given[1]), count)
    values = as_real(given)
    if values is None:
        raise ill_typed(f"{what}, not {shown(given)}")
    steps = np.diff(values) if values.ndim == 1 else np.empty(0)
    if not steps.size or not np.isfinite(values).all() or not ((steps > 0.0).all() or (steps < 0.0).all()):
        raise ill_typed(f"{what}, not {shown(given)}")
    return values
