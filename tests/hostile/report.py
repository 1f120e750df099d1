"""What a run found, as a line while it goes and as a table at its end."""

from __future__ import annotations

import platform
from pathlib import Path
from typing import TYPE_CHECKING

from .outcome import FINDINGS

if TYPE_CHECKING:
    from .campaign import Campaign, Record

RESULTS = Path(__file__).with_name("RESULTS.md")
CALM = ("fine", "named error", "refused")


def progress(campaign: Campaign) -> None:
    """One line on how far a run is."""
    found = {word: sum(r.outcomes[word] for r in campaign.records.values()) for word in FINDINGS}
    shown = ", ".join(f"{n} {word}" for word, n in found.items() if n) or "no findings"
    per_kind = " ".join(f"{name} {record.cases}" for name, record in campaign.records.items())
    distinct = f" ({len(campaign.findings)} distinct)" if campaign.findings else ""
    print(f"{campaign.seconds:6.0f} s  {campaign.cases} cases: {per_kind}; {shown}{distinct}", flush=True)


def summary(campaign: Campaign) -> str:
    """The table, in Markdown; without dates, so that two runs of the same seeds can be compared."""
    head = ["kind", "cases", *CALM, *FINDINGS, "s in all", "ms each", "worst s (seed)", "most memory (MB)"]
    how = f"Python {platform.python_version()}, {campaign.jobs} process(es), {campaign.seconds:,.0f} s"
    lines = [
        "# What was attacked, and what came of it",
        "",
        f"Written by `make fuzz RESULTS=1`: {campaign.cases:,} cases, seeds from {campaign.first}, {how}.",
        "A named error is a refusal that says what is wrong; refused: before the package was entered.",
        "",
        f"| {' | '.join(head)} |",
        f"|{'---|' * len(head)}",
    ]
    lines += [_row(name, record) for name, record in campaign.records.items()]
    if not campaign.findings:
        return "\n".join([*lines, "", "Nothing was found.", ""])
    lines += ["", "| found in | first seed | fault |", "|---|---|---|"]
    for (name, key), known in sorted(campaign.findings.items()):
        lines.append(f"| {name} | {known[0]['seed']} | {' '.join(key.replace('|', '/').split())} |")
    return "\n".join([*lines, ""])


def _row(name: str, record: Record) -> str:
    counts = " | ".join(f"{record.outcomes[word]:,}" for word in (*CALM, *FINDINGS))
    each = 1e3 * record.seconds / max(record.cases, 1)
    worst, memory = f"{record.worst:.2f} ({record.worst_seed})", record.memory / 2**20
    cells = [name, f"{record.cases:,}", counts, f"{record.seconds:,.0f}", f"{each:.2f}", worst, f"{memory:,.0f}"]
    return f"| {' | '.join(cells)} |"
