"""What a benchmark hands back, and how it is shown: tables on the terminal, Markdown and JSON in a folder."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table as RichTable


@dataclass(frozen=True)
class Limit:
    """A number that was promised: at most ``bound``, or at least with ``at_least``."""

    what: str
    value: float
    bound: float
    unit: str = ""
    at_least: bool = False

    @property
    def met(self) -> bool:
        """Is the promise kept?"""
        return self.value >= self.bound if self.at_least else self.value <= self.bound

    def __str__(self) -> str:
        sign = "at least" if self.at_least else "at most"
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{'met' if self.met else 'MISSED'}: {self.what} {number(self.value)}{unit} ({sign} {number(self.bound)})"
        )


@dataclass(frozen=True)
class Table:
    """Rows under headings; numbers are rounded when shown."""

    title: str
    columns: tuple[str, ...]
    rows: Sequence[Sequence[Any]]


@dataclass(frozen=True)
class Report:
    """The outcome of one benchmark.

    Attributes
    ----------
    tables : tuple of Table
    limits : tuple of Limit
        What was promised, judged.
    notes : tuple of str
        What the rows mean: coordinates, what is included, what the peer does.
    details : dict
        Everything measured, for the JSON file.
    """

    tables: tuple[Table, ...]
    limits: tuple[Limit, ...] = ()
    notes: tuple[str, ...] = ()
    details: dict[str, Any] = field(default_factory=dict)


def number(value: Any) -> str:
    """Three significant digits, in plain notation where that is readable; integers and texts as they are."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "" if value is None else str(value)
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def show(report: Report, console: Console) -> None:
    """Print a report."""
    for table in report.tables:
        shown = RichTable(title=table.title, title_justify="left")
        for k, column in enumerate(table.columns):
            shown.add_column(column, justify="right" if k else "left")
        for row in table.rows:
            shown.add_row(*map(number, row))
        console.print(shown)
    for note in report.notes:
        console.print(f"  {note}", style="dim", highlight=False)
    for limit in report.limits:
        console.print(f"  {limit}", style="green" if limit.met else "bold red", highlight=False)


def markdown(name: str, report: Report, circumstances: dict[str, Any]) -> str:
    """The report as a Markdown page."""
    lines = [f"# {name}", ""]
    for table in report.tables:
        lines += [f"## {table.title}", "", f"| {' | '.join(table.columns)} |"]
        lines.append(f"|{'|'.join(['---', *['---:'] * (len(table.columns) - 1)])}|")
        lines += [f"| {' | '.join(map(number, row))} |" for row in table.rows]
        lines.append("")
    lines += [*(f"- {note}" for note in report.notes), *(f"- {limit}" for limit in report.limits)]
    calibration = ", ".join(f"{key} {number(value)}" for key, value in circumstances["calibration"].items())
    machine = ", ".join(f"{key} {value}" for key, value in circumstances["machine"].items())
    lines += ["", f"Calibration: {calibration}.", "", f"Measured with {machine}.", ""]
    return "\n".join(lines)


def write(directory: Path, name: str, report: Report, circumstances: dict[str, Any]) -> None:
    """Write ``<name>.md`` and ``<name>.json`` into a folder, made if it is not there."""
    directory.mkdir(parents=True, exist_ok=True)
    (directory / f"{name}.md").write_text(markdown(name, report, circumstances), encoding="utf-8")
    limits = [{"what": x.what, "value": x.value, "bound": x.bound, "met": x.met} for x in report.limits]
    data = {"benchmark": name, "limits": limits, "measured": report.details, **circumstances}
    (directory / f"{name}.json").write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
