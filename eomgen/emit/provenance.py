"""Stage emit: Program and what was asked for -> where a package comes from, as plain values.

Nothing in it tells the time of day or the machine: the same model and versions give the same package, to the last byte.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib import metadata
from typing import Any

from ..program import Program

#: Packages whose versions are told: what derived the equations and wrote the text.
USED = ("numpy", "sympy")


def trace_provenance(program: Program, target: str, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Where a package comes from.

    Parameters
    ----------
    program : Program
    target : str
    asked : mapping of str to object
        Options of the generation by name, those that change the equations or the numbers.

    Returns
    -------
    dict
        ``model``, ``model_digest`` (SHA-256 of the mechanism, the same for all methods and targets), ``options``
        (``method`` as it was chosen, and whatever was asked for), ``versions``.
    """
    facts = program.metadata
    found = {name: metadata.version(name) for name in USED}
    return {
        "model": program.name,
        "model_digest": facts.get("model_digest"),
        "options": {"method": facts.get("method"), "target": target, **asked},
        "versions": {"eomgen": facts.get("eomgen"), "python": platform.python_version(), **found},
    }
