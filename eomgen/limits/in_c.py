"""Limits: the text of a C file -> definitions of the limits that it uses, as ``KIND_NAME``."""

from __future__ import annotations

import re

from . import constraints, crossings, inertia, rounding, runs, systems

KINDS = {
    "ROUNDING": rounding,
    "CONSTRAINTS": constraints,
    "CROSSINGS": crossings,
    "INERTIA": inertia,
    "SYSTEMS": systems,
    "RUNS": runs,
}
_USED = re.compile(rf"\b({'|'.join(KINDS)})_([A-Z][A-Z_]*)\b")


def definitions(text: str) -> str:
    """``#define`` lines, one for each limit that a text names; empty if it names none."""
    used = sorted({(match[1], match[2]) for match in _USED.finditer(text)})
    return "".join(f"#define {kind}_{name} {getattr(KINDS[kind], name)!r}\n" for kind, name in used)
