"""Stage runtime: a module and the inputs of a run -> where a result comes from, as plain values.

Nothing in it tells the time of day or the machine: the same run has the same metadata, and the same bytes on disk.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from .identity import digest
from .inputs import Signal
from .tapes import Expression

if TYPE_CHECKING:
    from .bound_model import BoundModel
    from .inputs import Forcing

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
    facts = module.layout.metadata
    return {
        "model_digest": facts.get("model_digest"),
        "target": facts.get("target"),
        "versions": {
            "eomgen": facts.get("eomgen"),
            "python": sys.version.partition(" ")[0],
            "numpy": np.__version__,
            "compiler": getattr(module.core, "compiler", None),
        },
    }


def inputs_of(module: BoundModel, forcing: Forcing) -> dict[str, Any]:
    """Every input of a run as it was given: a number, a table, a text, or the name and digest of a function."""
    found: dict[str, Any] = dict(zip(module.u_names, module.u.tolist(), strict=True))
    for name, value in forcing.values.items():
        found[name] = spell_input(value)
    return found


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
