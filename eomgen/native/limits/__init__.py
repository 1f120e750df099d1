"""Limits that C alone takes, and those of the floor: the text of a C file -> definitions, as ``KIND_NAME``.

``crossings`` of change points; ``systems``: linear systems of a method; ``contacts``: impulses of rigid ones.
"""

from __future__ import annotations

import re

from ...base.limits import constraints, numbers, runs
from . import contacts, crossings, systems

KINDS = {
    "ROUNDING": numbers,
    "CONSTRAINTS": constraints,
    "CROSSINGS": crossings,
    "INERTIA": numbers,
    "SYSTEMS": systems,
    "RIGID": contacts,
    "RUNS": runs,
}
_USED = re.compile(rf"\b({'|'.join(KINDS)})_([A-Z][A-Z_]*)\b")


def definitions(text: str) -> str:
    """``#define`` lines, one for each limit that a text names; empty if it names none."""
    used = sorted({(match[1], match[2]) for match in _USED.finditer(text)})
    return "".join(f"#define {kind}_{name} {_in_c(getattr(KINDS[kind], name))}\n" for kind, name in used)


def _in_c(limit: object) -> str:
    return "{" + ", ".join(map(repr, limit)) + "}" if isinstance(limit, tuple) else repr(limit)
