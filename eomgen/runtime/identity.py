"""Stage runtime: what a run depends on -> plain values and digests that two runs can be compared by."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .late import eager

if TYPE_CHECKING:
    from .module import Module

DEPTH = 6  #: of objects within objects that are looked into


def digest(value: Any) -> str:
    """SHA-256 of what a value says of itself, see :func:`spell`."""
    return hashlib.sha256(repr(spell(value)).encode("utf-8", "backslashreplace")).hexdigest()


def spell(value: Any, depth: int = DEPTH) -> Any:
    """A value as what has one exact ``repr``, the same in every process.

    Of a function: its name, its compiled code, its defaults and what it holds from around it.  Global names it reads,
    files and random numbers are not seen.  Of another object: its type and its attributes, in slots too; of one that
    shows none, such as ``functools.partial``, what it would be pickled as.
    """
    if value is None or isinstance(value, (bool, int, float, complex, str, bytes)):
        return value
    if isinstance(value, (np.ndarray, np.generic)):
        array = np.asarray(value)
        if array.dtype.hasobject:
            return ["objects", spell(array.tolist(), depth)]
        return [array.shape, array.dtype.str, hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()]
    name = f"{type(value).__module__}.{type(value).__qualname__}"
    if depth == 0:
        return name
    if isinstance(value, Mapping):
        return ["mapping", *sorted((repr(spell(k, depth - 1)), spell(v, depth - 1)) for k, v in value.items())]
    if isinstance(value, (tuple, list)):
        return ["list", *(spell(one, depth - 1) for one in value)]
    if isinstance(value, (set, frozenset)):
        return ["set", *sorted(repr(spell(one, depth - 1)) for one in value)]
    if hasattr(value, "co_code"):
        return ["code", value.co_code, value.co_names, spell(value.co_consts, depth - 1)]
    if hasattr(value, "__func__"):
        return ["method", spell(value.__func__, depth - 1), spell(value.__self__, depth - 1)]
    if hasattr(value, "__code__"):
        around = [value.__defaults__, value.__kwdefaults__, [_held(cell) for cell in value.__closure__ or ()]]
        return ["function", value.__module__, value.__qualname__, spell(value.__code__), spell(around, depth - 1)]
    if isinstance(value, type):
        return ["type", f"{value.__module__}.{value.__qualname__}"]
    return ["object", name, spell(_state(value), depth - 1)]


def _held(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # nothing yet
        return None


def _state(value: Any) -> Any:
    """The attributes of an object, or what it would be pickled as if it shows none."""
    slots = [name for kind in type(value).__mro__ for name in np.atleast_1d(getattr(kind, "__slots__", ())).tolist()]
    found = {name: getattr(value, name) for name in slots if hasattr(value, name) and not name.startswith("__")}
    found |= getattr(value, "__dict__", {})
    if found:
        return found
    try:
        return value.__reduce_ex__(4)
    except Exception:  # it cannot be pickled
        return getattr(value, "__qualname__", "")


def code_digest(module: Module) -> str:
    """SHA-256 of the file of a module's code, or of its metadata where it has no file."""
    core: Any = eager(module.core)
    file = getattr(core, "__file__", None)
    path = Path(file or "")
    data = path.read_bytes() if path.is_file() else str(core.metadata).encode()
    return hashlib.sha256(data).hexdigest()


def differences(wanted: Mapping[str, Any], found: Mapping[str, Any], path: str = "") -> list[str]:
    """Dotted names of what two mappings do not have in common."""
    names = []
    for name in dict.fromkeys((*wanted, *found)):
        a, b = wanted.get(name), found.get(name)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            names += differences(a, b, f"{path}{name}.")
        elif a != b and not (a != a and b != b):  # NaN is like NaN here
            names.append(f"{path}{name}")
    return names
