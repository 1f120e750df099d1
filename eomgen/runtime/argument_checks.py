"""Names and numbers as a user gives them -> arrays, or errors that say what is allowed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import nullcontext
from functools import wraps
from importlib import import_module
from inspect import signature
from math import isfinite
from types import ModuleType
from typing import Any, TypeVar

import numpy as np

from ..base.algebra import Array
from ..base.kernel_table import argument
from ..base.limits.runs import MOST_NUMBERS, MOST_STEPS
from ..base.texts import quote, undotted
from ..base.value_rules import as_count, read_count
from ..errors import (
    MissingDependencyError,
    UnavailableError,
    UsageError,
    at_odds,
    ill_shaped,
    ill_typed,
    no_number,
    too_large,
)

# -- numbers, sizes and durations --------------------------------------------------------------------------------------


#: What Python or NumPy would make a float of, or NaN, though it is no real number.
UNREAL = (str, bytes, complex, np.complexfloating, np.datetime64, np.timedelta64, type(None))
#: Numbers that are read without a look at each.
PLAIN = frozenset((float, int, bool, np.float64))
DEEPEST = 64  #: lists in lists, as in NumPy


def require_size(what: str, numbers: float, remedy: str) -> None:
    """Refuse what would keep more numbers than ``MOST_NUMBERS``, before any of them is made."""
    if numbers > MOST_NUMBERS:
        raise too_large(
            f"{what} would keep {numbers:.3g} numbers ({8.0 * numbers / 2**30:.3g} GiB), and a call can keep at most "
            f"{MOST_NUMBERS:.3g}; {remedy}"
        )


def require_steps(name: str, step: float, start: float, end: float) -> None:
    """Refuse steps of limited size that are too many for a run, or too small for its times."""
    latest = max(abs(start), abs(end))
    if abs(end - start) > MOST_STEPS * step or (start != end and latest + step == latest):
        raise UsageError(
            f"{name} = {step:g} s is too small for a run from {start:g} to {end:g} s: it would not end",
            code="EG-ENDLESS",
        )


def as_real(raw: Any) -> Array | None:
    """What is given as an array of floats (float64), itself if it is one; None if these are no real numbers.

    Real numbers are what NumPy converts to float64: floats, integers, booleans, Fractions, Decimals, numbers of SymPy,
    in lists and arrays too.  Texts, dates, complex numbers, None and masked entries are none, nor is what fails to
    convert, whatever it raises.  The compiled layer has the same rule in C, eomgen/native/_arguments.pxi.
    """
    try:
        if type(raw) is np.ndarray:
            if raw.dtype == np.float64:
                return raw
            if raw.dtype.kind in "biuf" and raw.itemsize <= 8:
                return raw.astype(float)
        elif type(raw) in (list, tuple) and PLAIN.issuperset(map(type, raw)):
            return np.array(raw, dtype=float)
        elif has_masked(raw):
            return None
        array = np.asarray(raw)
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


def has_masked(raw: Any, depth: int = 0) -> bool:
    """Whether NumPy would read the value under a masked entry, or NaN, in an array or in lists of these."""
    if isinstance(raw, np.ma.MaskedArray):
        return bool(np.ma.is_masked(raw))
    if not isinstance(raw, (list, tuple)) or depth > DEEPEST or PLAIN.issuperset(map(type, raw)):
        return False
    return any(has_masked(one, depth + 1) for one in raw)


def read_numbers(what: str, raw: Any, width: float = 1.0) -> Array:
    """Real numbers as an array of floats, refused where `width` numbers for each column (n, k) would not fit.

    Raises
    ------
    UsageError
    """
    shape = np.shape(raw) if isinstance(raw, np.ndarray) else ()
    if len(shape) > 1:
        require_size(f"{what} of shape {shape}", float(np.prod(shape[1:], dtype=float)) * width, "give fewer columns")
    return _floats(what, raw, f"{what} must hold real numbers")


def read_vector(what: str, raw: Any, n: int, error: Callable[[str], Exception] = ill_shaped) -> Array:
    """An array of n floats."""
    result = as_real(raw)
    if result is None:
        raise error(f"{what} must hold real numbers, ({n},), not {quote(raw)}")
    if result.shape != (n,):
        raise error(f"{what} must have shape ({n},), not {result.shape}")
    return result


def fitting(
    out: Any, shape: tuple[int, ...], what: str = "out", error: Callable[[str], Exception] = ill_shaped
) -> Array:
    """The array that takes a result, if it can."""
    if not isinstance(out, np.ndarray) or out.shape != shape or out.dtype != np.float64:
        raw = f"{out.shape} of {out.dtype}" if isinstance(out, np.ndarray) else f"a {type(out).__name__}"
        raise error(f"{what} must be a float64 array of shape {shape}, not {raw}")
    if not out.flags.writeable:
        raise error(f"{what} is read-only")
    if out.size and any(step == 0 and n > 1 for step, n in zip(out.strides, shape, strict=True)):
        raise error(f"{what} has strides {out.strides}: several of its entries are one number in memory")
    return out


def read_state(what: str, raw: Any, names: Sequence[str]) -> Array:
    """An array of floats, one for each name.

    Raises
    ------
    UsageError
    """
    result = read_numbers(what, raw)
    if result.shape != (len(names),):
        raise ill_shaped(f"{what} must have shape ({len(names)},) [{', '.join(names)}], not {result.shape}")
    return result


def read_times(what: str, raw: Any, per_time: int) -> Array:
    """Times as an array of floats (n,), refused where a row of `per_time` numbers for each would not fit.

    Raises
    ------
    UsageError
    """
    try:
        length = len(raw)
    except Exception:  # one number, or what is no list of times
        length = 0
    require_size(f"{what} with {length} times", length * per_time, "give fewer times, or run in parts")
    return np.array(_floats(what, raw, f"{what} must be a list of times in seconds"))


def read_number(what: str, raw: Any) -> float:
    """One finite real number, or an expression of numbers as text: ``"10*pi/180"``.

    Raises
    ------
    UsageError
    """
    return read_plain(what, read_text(what, raw) if isinstance(raw, str) else raw)


def read_plain(what: str, raw: Any) -> float:
    """One finite real number, as compiled code takes it, which reads no texts."""
    if type(raw) is float:
        result = raw
    else:
        collected = as_real(raw)
        if collected is None or collected.ndim:
            raise no_number(f"{what} must be a number, not {quote(raw)}")
        result = float(collected)
    if not isfinite(result):
        raise no_number(f"{what} must be finite, not {result}")
    return result


def read_text(what: str, raw: str) -> float:
    """The value of an expression of numbers as text: ``"10*pi/180"``."""
    try:
        from ..model.expressions import constant
    except ImportError:
        raise no_number(f"{what} must be a number, not {raw!r}; only eomgen itself reads texts") from None
    return constant(raw, what)


def with_numbers(what: str, raw: Any, depth: int = 0) -> Any:
    """Lists and tuples of numbers with the values of the texts in them; anything else as it is.

    Raises
    ------
    UsageError
        A text that is no number.
    """
    if not isinstance(raw, (list, tuple)) or depth > DEEPEST or PLAIN.issuperset(map(type, raw)):
        return raw
    return [read_text(what, one) if isinstance(one, str) else with_numbers(what, one, depth + 1) for one in raw]


def read_flag(what: str, raw: Any) -> bool:
    """True or False."""
    if not isinstance(raw, (bool, np.bool_)):
        raise ill_typed(f"{what} must be True or False, not {quote(raw)}")
    return bool(raw)


def _floats(what: str, raw: Any, wanted: str) -> Array:
    result = as_real(with_numbers(what, raw))
    if result is None:
        raise ill_typed(f"{wanted}, not {quote(raw)}")
    return result


def read_axis(label: str, raw: Any) -> Array:
    """Values of one axis from (low, high, count) or from the values themselves."""
    what = f"{label}: give (low, high, count) or two or more rising or falling values"
    if isinstance(raw, tuple) and len(raw) == 3 and as_count(raw[2]) is not None:
        count = read_count(f"{label}: the third of (low, high, count)", raw[2], 2, 10_000_000)
        raw = np.linspace(read_number(what, raw[0]), read_number(what, raw[1]), count)
    values = as_real(raw)
    if values is None:
        raise ill_typed(f"{what}, not {quote(raw)}")
    steps = np.diff(values) if values.ndim == 1 else np.empty(0)
    if not steps.size or not np.isfinite(values).all() or not ((steps > 0.0).all() or (steps < 0.0).all()):
        raise ill_typed(f"{what}, not {quote(raw)}")
    return values


# -- names -------------------------------------------------------------------------------------------------------------


_SHOWS = ("animate", "animation", "film", "gif", "movie", "play", "plot", "show", "video", "view")


class UnknownNameError(UsageError, KeyError, code="EG-NAME-UNKNOWN"):
    """A key that does not exist; also a KeyError, so that mappings behave as expected."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


def without_dots(raw: Mapping[Any, Any], instances: Mapping[str, str]) -> dict[Any, Any]:
    """Values by name; ``leg1.hip`` of an instance of a component is ``leg1_hip``, which must not be given beside it."""
    result = {plain_name(name, instances): value for name, value in raw.items()}
    if len(result) < len(raw):
        twice = [name for name in raw if plain_name(name, instances) != name and plain_name(name, instances) in raw]
        raise at_odds(f"{', '.join(map(repr, twice))} is given under both of its names; give it once")
    return result


def plain_name(name: object, instances: Mapping[str, str]) -> Any:
    """The name as the model has it; ``leg1.hip`` of an instance of a component is ``leg1_hip``."""
    return undotted(name, instances) if isinstance(name, str) else name


def unknown(what: str, name: object, allowed: Iterable[str], place: str = "") -> UnknownNameError:
    """The error for an unknown name, with near misses or, if there are none, what there is."""
    return _unknown(what, [name], allowed, place)


def _unknown(what: str, names: Iterable[object], allowed: Iterable[str], place: str) -> UnknownNameError:
    """The error for unknown names: a line for each hint, so that what there is stands there once."""
    hints: dict[str, list[str]] = {}
    for name in names:
        hints.setdefault(_hint(name, allowed), []).append(repr(name))
    begin = f"{place}{': ' * bool(place)}no {what}"
    return UnknownNameError("\n".join(f"{begin} {', '.join(same)}; {hint}" for hint, same in hints.items()))


def find_lacking(one: object, kind: str, name: str) -> Any:
    """What ``__getattr__`` of a class has to say of an attribute that Python did not find.

    Names that begin with an underscore are requested by copy, pickle and notebooks, and are looked up nowhere.
    """
    if name.startswith("_"):
        raise AttributeError(f"{kind} has no attribute {name!r}", name=name)
    if (attribute := next((vars(base)[name] for base in type(one).__mro__ if name in vars(base)), None)) is not None:
        return attribute.__get__(one, type(one))
    public = sorted(n for n in {*dir(type(one)), *vars(one)} if not n.startswith("_"))
    answer = "simulate(...) returns a run, which has animate() and plot(); a module has draw() and page()"
    meant = answer if name in _SHOWS and "rhs" in public else _hint(name, public, len(public))
    raise UnavailableError(f"{kind} has no attribute {name!r}; {meant}")


def _hint(name: object, allowed: Iterable[str], most: int = 20) -> str:
    choice = list(dict.fromkeys(allowed))
    if near := import_module("..base.texts", __package__).closest(name, choice, 3):
        return f"did you mean {' or '.join(near)}?"
    if not choice:
        return "there are none"
    first = ", ".join(choice[:most])
    return f"there {'is' if len(choice) == 1 else 'are'} {first}{' ...' if len(choice) > most else ''}"


def check_names(
    what: str, raw: Iterable[object], allowed: Collection[str], further: Collection[str] = (), place: str = ""
) -> None:
    """Raise :class:`UnknownNameError` for all names not allowed; `further` ones are suggested too."""
    if wrong := [name for name in dict.fromkeys(raw) if name not in allowed]:
        raise _unknown(what, wrong, [*allowed, *further], place)


def read_names(what: str, raw: Any) -> tuple[str, ...]:
    """One name or several as a tuple of texts."""
    if isinstance(raw, str):
        return (raw,)
    try:
        names = tuple(raw)
    except TypeError:
        names = (None,)
    if not all(isinstance(name, str) for name in names):
        raise ill_typed(f"{what} must be a name or a list of names, not {quote(raw)}")
    return names


def require_mapping(what: str, raw: Any) -> None:
    """Refuse what does not give values by name."""
    if not isinstance(raw, Mapping):
        raise ill_typed(f"{what} must be a mapping of names to values, not {quote(raw)}")


def require(module: str, extra: str, purpose: str) -> ModuleType:
    """Import an optional package, or say in one line what to install."""
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        if error.name is not None and error.name.partition(".")[0] != package:
            raise  # the package is there and something it needs is not
        raise MissingDependencyError(f"{purpose} needs {package}: pip install {extra}") from error


def require_time_and_state(label: str, function: Callable[..., Any]) -> None:
    """Refuse a function that cannot be called as f(t, x); one that shows no signature is left to its first call."""
    try:
        taken = signature(function)
    except (TypeError, ValueError):
        return
    try:
        taken.bind(0.0, None)
    except TypeError:
        raw = f"{getattr(function, '__name__', type(function).__name__)}{taken}"
        remedy = "write it with both, as lambda t, x: ..." if len(taken.parameters) < 2 else "bind its other arguments"
        raise ill_typed(f"{label} must be callable as f(t, x), and {raw} is not; {remedy}") from None


# -- names of arguments ------------------------------------------------------------------------------------------------

# p and parameters, u and inputs name the same arguments; ``leg.hip`` of an instance is ``leg_hip``.


Function = TypeVar("Function", bound=Callable[..., object])
PAIRS = (("p", "parameters"), ("u", "inputs"), ("parameters", "p"), ("inputs", "u"))


def both_names(function: Function) -> Function:
    """The same function, which takes each argument of PAIRS under either name."""
    taken = signature(function).parameters
    others = {other: name for name, other in PAIRS if name in taken and other not in taken}
    place = {name: k for k, name in enumerate(taken)}

    @wraps(function)
    def call(*args, **raw):  # type: ignore[no-untyped-def]
        for other in others.keys() & raw.keys() if raw else ():
            if others[other] in raw or place[others[other]] < len(args):
                raise at_odds(f"{others[other]} and {other} are the same argument; give one of them")
            raw[others[other]] = raw.pop(other)
        try:
            return function(*args, **raw)
        except TypeError as error:
            _, subject, fault = str(error).partition(f"{function.__qualname__}()")
            if not subject:
                raise
            name = getattr(args[0], "name", "f") if function.__name__ == "__call__" else function.__name__
            needed = [n for n, one in taken.items() if one.default is one.empty and n not in ("self", "module")]
            fault = fault.replace("'x'", f"'{argument(name, 'x')}'")
            raise TypeError(f"{name}({', '.join(argument(name, n) for n in needed)}){fault}") from None

    return call  # type: ignore[return-value]


def plain_names(function: Function) -> Function:
    """The same function of a model, which takes names of instances with dots, in lists and mappings too.

    Texts that name nothing of the model, such as those of files, stay as they are.
    """

    @wraps(function)
    def call(model, *args, **raw):  # type: ignore[no-untyped-def]
        layout = model.layout
        if layout.instances:
            args = tuple(_plain(layout, value) for value in args)
            raw = _plain(layout, raw)
        return function(model, *args, **raw)

    return call  # type: ignore[return-value]


def _plain(layout: Any, value: Any) -> Any:
    if isinstance(value, str):
        result = layout.plain(value)
        return result if result in layout.names or result.partition(".")[0] in layout.bodies else value
    if isinstance(value, dict):
        result = {_plain(layout, name): _plain(layout, x) for name, x in value.items()}
        return result if len(result) == len(value) else value  # a name given twice is told where it is read
    if type(value) in (list, tuple) and any(isinstance(x, str | dict | tuple) for x in value):
        return type(value)(_plain(layout, x) for x in value)
    return value
