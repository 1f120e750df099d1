"""Stage emit: Program -> readable descriptions of the arrays: which entry is which quantity, in what unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..program import Program


def describe_layouts(program: Program) -> list[tuple[str, list[str]]]:
    """Titles with one line per entry, for headers and docstrings."""
    metadata = program.metadata
    q, v = program.coordinates, program.velocities
    moving = len(v) - program.n_states
    preferred = [i for i in program.preferred if i < moving]
    chosen = [program.coordinate_of[i] for i in preferred]
    independent = ("q_i, the independent coordinates", _entries(metadata, "q_i", [q[i] for i in chosen]))
    if -1 in chosen:
        independent = ("v_i, the independent velocities", _entries(metadata, "v_i", [v[i] for i in preferred]))
    sections = [
        (f"x = [q; v{'; s' if program.n_states else ''}], the state", _entries(metadata, "x", [*q, *v])),
        ("p, the parameters", _entries(metadata, "p", program.parameters, metadata.get("p_values"))),
        ("u, the inputs", _entries(metadata, "u", program.inputs, metadata.get("u_values"))),
        ("y, the outputs", _entries(metadata, "y", metadata.get("y_names", ()))),
        independent,
        ("C, the constraint rows", _entries(metadata, "C", metadata.get("constraint_labels", ()))),
        ("bodies of poses", _entries(metadata, "poses", metadata.get("body_names", ()))),
        ("coordinates of cut joints", _entries(metadata, "loop", metadata.get("loop_names", ()))),
    ]
    independent_is_all = program.sizes.n_dof == program.sizes.n_v
    return [(title, rows) for title, rows in sections if rows and not (independent_is_all and title == independent[0])]


def _entries(
    metadata: dict[str, Any], array: str, names: Sequence[str], values: Sequence[float | None] | None = None
) -> list[str]:
    units, docs = metadata.get("units", {}), metadata.get("docs", {})
    lines = []
    for k, name in enumerate(names):
        line = f"{array}[{k}] {name}"
        if values is not None and values[k] is not None:
            line += f" = {values[k]!r}"
        if units.get(name):
            line += f" ({units[name]})"
        if docs.get(name):
            line += f": {docs[name]}"
        lines.append(" ".join(line.split()))
    return lines
