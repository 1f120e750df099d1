"""Description -> a short HTML table for notebooks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..base.texts import html_text
from ..expr.shown import shown
from .description import DescribedEntry, Description, items, label_of, text_of

LONG = 40  #: rows of a table more than which it is folded up


def reference_text(value: Any) -> str:
    """A body, marker or joint as it is shown."""
    if isinstance(value, Mapping):
        return label_of(value)
    listed = items(value)
    return text_of(value) if listed is None else " to ".join(reference_text(x) for x in listed)


def _summary(entry: DescribedEntry) -> str:
    parts = []
    for key, value in entry.values.items():
        if key == "markers":
            names = list(value) if isinstance(value, Mapping) else [name for name, _ in value]
            parts.append("markers " + ", ".join(map(shown, names)))
        elif entry.path.startswith("functions.") and key in ("x", "y", "z"):
            parts.append(f"{len(items(value) or ())} {key}")
        elif key in ("display", "solids") and all(isinstance(one, Mapping) for one in items(value) or ("",)):
            words = (text_of(one.get("shape", one.get("type"))) for one in items(value) or ())
            parts.append(f"{key} " + ", ".join(words))
        elif key in ("type", "value", "expression"):
            parts.append(text_of(value))
        elif key in ("between", "marker", "body", "joint"):
            parts.append(reference_text(value))
        elif isinstance(value, Mapping):
            parts.append(f"{key} " + ", ".join(f"{k} {text_of(v)}" for k, v in value.items()))
        elif text_of(value) not in ("", "z", "(0, 0, 0)"):
            parts.append(f"{key} {text_of(value)}")
    return "; ".join(parts)


def model_html(description: Description) -> str:
    """The model as an HTML table, one row an entry."""
    name = shown(description.values.get("name", ""))
    rows = [f"<tr><th colspan='3' style='text-align:left'>Model {html_text(name)}</th></tr>"]
    lagrangian = description.values.get("lagrangian")
    if isinstance(lagrangian, Mapping):
        text = text_of(lagrangian.get("expression"))
        rows.append(f"<tr><td>Lagrangian</td><td></td><td>{html_text(text)}</td></tr>")
    equations = description.values.get("equations")
    if isinstance(equations, Mapping):
        names = ", ".join(text_of(q) for q in items(equations.get("coordinates")) or ())
        rows.append(f"<tr><td>equations</td><td></td><td>of {html_text(names)}</td></tr>")
    for section, entries in description.sections.items():
        for k, entry in enumerate(entries):
            first = section if k == 0 else ""
            rows.append(
                f"<tr><td>{first}</td><td>{html_text(shown(entry.name))}</td>"
                f"<td style='text-align:left'>{html_text(_summary(entry))}</td></tr>"
            )
    table = f"<table>{''.join(rows)}</table>"
    if len(rows) <= LONG:
        return table
    counts = ", ".join(f"{len(entries)} {section}" for section, entries in description.sections.items() if entries)
    return f"<details><summary>{html_text(name)}: {counts}</summary>{table}</details>"
