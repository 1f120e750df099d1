"""An Ensemble -> HTML with a small picture of its columns, and what the runs came to."""

from __future__ import annotations

from typing import Any

from ..base.inline_pictures import picture_html, side_by_side
from ..base.texts import html_table, html_text
from ..errors import UsageError
from ..runtime.near_names import require

PANELS = 3  #: columns that are drawn
ROWS = 12  #: columns whose numbers are listed
FAILURES = 5  #: runs that are named


def ensemble_html(ensemble: Any) -> str:
    """A picture of the first columns, and mean, deviation, least and greatest of all."""
    failed = ensemble.failures()
    facts = [("runs", f"{ensemble.count}" + (f", {len(failed)} of which failed" if failed else ""))]
    facts += [("times", f"{len(ensemble.t)}"), ("end", f"{ensemble.t[-1]:.6g} s")]
    facts += [(f"run {one.run} failed", f"at t = {one.t:.6g} s: {one.message}") for one in failed[:FAILURES]]
    text = html_table(repr(ensemble).strip("<>").partition(":")[0], facts)
    try:
        summary = ensemble.summary()
    except UsageError:  # a reduction of the user's own kept something else
        return text
    return side_by_side(picture_html(lambda: _figure(ensemble)), text + _table(summary))


def _table(summary: dict[str, dict[str, float]]) -> str:
    heads = ("", "mean", "deviation", "least", "greatest")
    rows = [f"<tr>{''.join(f'<th>{head}</th>' for head in heads)}</tr>"]
    for name, values in list(summary.items())[:ROWS]:
        cells = "".join(f"<td>{values[head]:.5g}</td>" for head in heads[1:])
        rows.append(f"<tr><th style='text-align:left'>{html_text(name)}</th>{cells}</tr>")
    if len(summary) > ROWS:
        rows.append(f"<tr><td colspan='5'>and {len(summary) - ROWS} more: summary()</td></tr>")
    return f"<table>{''.join(rows)}</table>"


def _figure(ensemble: Any) -> Any:
    names = ensemble.names[:PANELS]
    figure = require("matplotlib.figure", "matplotlib", "a picture").Figure
    made = figure(figsize=(5.6, 0.6 + 1.7 * len(names)), layout="constrained")
    for k, name in enumerate(names):
        ensemble.plot(name, made.add_subplot(len(names), 1, k + 1))
    return made
