"""What a run depends on -> digests that two runs can be compared by, and where a result comes from."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .inputs import Expression, Signal
from .kernels import eager

if TYPE_CHECKING:
    from .bound_model import BoundModel
    from .inputs import Forcing

# -- digests -----------------------------------------------------------------------------------------------------------


DEPTH = 6  #: of objects within objects that are looked into


def digest(value: Any) -> str:
    """SHA-256 of what a value says of itself, see :func:`spell`."""
    return hashlib.sha256(repr(spell(value)).encode("utf-8", "backslashreplace")).hexdigest()


def spell(value: Any, depth: int = DEPTH) -> Any:
    """A value as what has one exact ``repr``, the same in every process.

    Of a function: its name, its compiled code, its defaults and what it holds from around it.  Global names it reads,
    files and random numbers are not seen.  Of another object: its type, its attributes, those in slots too, and what
    it would be pickled as, where its type has a way of its own (functools.partial, types written in C).
    """
    if value is None or isinstance(value, (bool, int, float, str, bytes)):
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
        contents = [_content(cell) for cell in value.__closure__ or ()]
        around = [value.__defaults__, value.__kwdefaults__, contents]
        return ["function", value.__module__, value.__qualname__, spell(value.__code__), spell(around, depth - 1)]
    return ["object", name, getattr(value, "__qualname__", ""), spell(_attributes(value), depth - 1)]


def _content(cell: Any) -> Any:
    """What a function holds from around it; a name that was not given a value yet holds nothing."""
    try:
        return cell.cell_contents
    except ValueError:
        return None


def _attributes(value: Any) -> dict[str, Any]:
    """What an object holds, by name."""
    result = dict(getattr(value, "__dict__", {}))
    kind = type(value)
    if isinstance(value, type):
        return result
    for base in kind.__mro__:
        slots = vars(base).get("__slots__", ())
        for slot in (slots,) if isinstance(slots, str) else tuple(slots):
            name = f"_{base.__name__.lstrip('_')}{slot}" if slot[:2] == "__" and slot[-2:] != "__" else slot
            if name not in ("__dict__", "__weakref__") and hasattr(value, name):
                result.setdefault(name, getattr(value, name))
    if any(getattr(kind, way) is not getattr(object, way) for way in ("__reduce__", "__reduce_ex__", "__getstate__")):
        with suppress(Exception):  # whatever its type does; it need not know how
            result["pickled"] = list(value.__reduce_ex__(2)[1:3])
    return result


def code_digest(module: BoundModel) -> str:
    """SHA-256 of the file of a module's code, or of its metadata where it has no file."""
    core: Any = eager(module.core)
    file = getattr(core, "__file__", None)
    path = Path(file or "")
    data = path.read_bytes() if path.is_file() else str(core.metadata).encode()
    return hashlib.sha256(data).hexdigest()


# -- where a result comes from -----------------------------------------------------------------------------------------

# Nothing in it tells the time of day or the machine: the same run has the same metadata, and the same bytes on disk.


MANY = 1000  #: points of a table that are written out; of longer ones a digest tells


def origin(module: BoundModel) -> dict[str, Any]:
    """Which model a result comes from, and what calculated it.

    Returns
    -------
    dict
        ``model_digest``, SHA-256 of the model, the same for all methods and targets (None for a module of an earlier
        version); ``target``; ``versions`` of eomgen that made the code, of Python, NumPy and the compiler (None where
        there is none).
    """
    info = module.info
    return {
        "model_digest": info.model_digest,
        "target": info.target,
        "versions": {
            "eomgen": info.eomgen,
            "python": sys.version.partition(" ")[0],
            "numpy": np.__version__,
            "compiler": None if info.target == "numpy" else getattr(module.core, "compiler", None),
        },
    }


def inputs_of(module: BoundModel, forcing: Forcing) -> dict[str, Any]:
    """Every input of a run as it was given: a number, a table, a text, or the name and digest of a function."""
    result: dict[str, Any] = dict(zip(module.u_names, module.u.tolist(), strict=True))
    for name, value in forcing.values.items():
        result[name] = spell_input(value)
    return result


def spell_input(value: Any) -> Any:
    """An input as plain values."""
    if isinstance(value, Signal):
        short = len(value.times) <= MANY
        points = {"times": value.times.tolist(), "values": value.values.tolist()} if short else {
            "points": len(value.times), "sha256": digest([value.times, value.values])
        }  # fmt: skip
        return {"interpolation": value.interpolation, "corners": value.corners, **points}
    if isinstance(value, Expression):
        return value.text
    if isinstance(value, (int, float)):
        return float(value)
    named = f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', type(value).__qualname__)}"
    return {"function": named, "sha256": digest(value)}


def plain(value: Any) -> Any:
    """A number, text or array as JSON takes it; of anything else its name."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, (list, tuple, np.ndarray, np.generic)):
        return np.asarray(value).tolist()
    return str(getattr(value, "__qualname__", type(value).__qualname__))
