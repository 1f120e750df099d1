"""Run benchmarks and write what they found: ``python -m benchmarks.run [NAME ...] [--quick] [--out FILE]``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from . import calls, derivation, device, robots, runs, tracks  # noqa: F401
from .harness import BENCHMARKS, Report, calibrate, describe_machine, number, write

PAGE = Path(__file__).parent / "results.md"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the named benchmarks, all by default; 1 if one fails or misses what was promised."""
    parser = argparse.ArgumentParser(prog="benchmarks.run", description=__doc__.split(":")[0])
    there = ", ".join(BENCHMARKS)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which: {there}; all by default")
    parser.add_argument("--quick", action="store_true", help="small sizes and single repeats, to see that all runs")
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="page of the results; results.md by default, none if quick"
    )
    options = parser.parse_args(arguments)
    if unknown := [name for name in options.names if name not in BENCHMARKS]:
        parser.error(f"no benchmark {', '.join(unknown)}; there are: {there}")
    page = options.out or (None if options.quick else PAGE)
    console = Console(width=None if sys.stdout.isatty() else 120)
    machine = describe_machine()
    console.print(machine, highlight=False)
    summary: list[str] = []
    for name in options.names or BENCHMARKS:
        title, function = BENCHMARKS[name]
        console.rule(f"{name}: {title}")
        report, before = Report(), calibrate()
        try:
            function(report, options.quick)
        except Exception:  # the others are still worth running
            console.print_exception(max_frames=4)
            summary.append(f"{name}: failed")
            continue
        speed = {key: max(before[key], now) for key, now in calibrate().items()}
        calibration = ", ".join(f"{key} {number(x)}{'' if key == 'disturbance' else ' ns'}" for key, x in speed.items())
        report.show(console)
        console.print(f"  {calibration}", style="dim")
        if speed["disturbance"] > 1.3:
            console.print("  the machine was busy with other work: limits on seconds say little", style="yellow")
        if page is not None:
            write(page, name, report, machine)
        summary += [f"{name}: {limit}" for limit in report.limits if not limit.met]
    for line in summary:
        console.print(line, style="bold red", highlight=False)
    return 1 if summary else 0


if __name__ == "__main__":
    sys.exit(main())
