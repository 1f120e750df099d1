"""Target sizes: Program -> what its functions cost, as a page."""

from __future__ import annotations

from typing import Any

from ..program import Program


def package(program: Program, context: dict[str, Any]) -> dict[str, str]:
    """README.md: operations of each block."""
    rows = [f"| `{name}` | {count.total} |" for name, count in program.counts.items()]
    head = [f"# {program.name}", "", str(context["doc"] or ""), "", "| block | operations |", "|---|--:|"]
    return {"README.md": "\n".join([*head, *rows, ""])}
