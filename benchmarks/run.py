"""Run benchmarks and write what they found: ``python -m benchmarks.run [NAME ...] [--quick] [--out DIR]``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from rich.console import Console

from .measure import calibrate, describe_machine
from .report import Report, show, write

BENCHMARKS = (
    *("derive", "growth", "compile", "panda", "robots", "latency"),
    *(
        "call",
        "simulate",
        "integrate",
        "stiff",
        "loops",
        "large_loops",
        "big_trees",
        "four_bars",
        "robot_loops",
        "traced",
        "fit",
    ),
    *(
        "counts",
        "operation_counts",
        "rhs",
        "robot_kernels",
        "derivatives",
        "grid_robots",
        "lanes",
        "loop_lanes",
        "ensembles",
    ),
    *("device", "equilibria", "tracks", "track_contacts", "rigid_tracks", "long_drive"),
)
APART = ("swing_up",)  #: need packages that the tests have not; by name only
EVERY = (*BENCHMARKS, *APART)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the named benchmarks, all by default; 1 if one fails or misses what was promised."""
    parser = argparse.ArgumentParser(prog="benchmarks.run", description=__doc__.split(":")[0])
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"which: {', '.join(EVERY)}; all but the last by default"
    )
    parser.add_argument("--quick", action="store_true", help="small sizes and single repeats, to see that all runs")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results", help="folder of the results")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.names if name not in EVERY]
    if unknown:
        parser.error(f"no benchmark {', '.join(unknown)}; there are: {', '.join(EVERY)}")
    console = Console(width=None if sys.stdout.isatty() else 120)
    machine = describe_machine()
    console.print(", ".join(f"{key} {value}" for key, value in machine.items()), highlight=False)
    summary: list[str] = []
    for name in options.names or BENCHMARKS:
        try:
            report, circumstances = measure(name, options.quick, console)
        except Exception:  # the others are still worth running
            console.print_exception(max_frames=4)
            summary.append(f"{name}: failed")
            continue
        write(options.out, name, report, circumstances | {"machine": machine, "quick": options.quick})
        summary += [f"{name}: {limit}" for limit in report.limits if not limit.met]
    for line in summary:
        console.print(line, style="bold red", highlight=False)
    return 1 if summary else 0


def measure(name: str, quick: bool, console: Console) -> tuple[Report, dict[str, dict[str, float]]]:
    """Run one benchmark between two calibrations and show it."""
    module = import_module(f".{name}", __package__)
    console.rule(f"{name}: {module.TITLE}")
    before = calibrate()
    report: Report = module.run(quick)
    after = calibrate()
    show(report, console)
    calibration = {key: max(before[key], after[key]) for key in before}
    console.print("  calibration: " + ", ".join(f"{k} {v:.3g}" for k, v in calibration.items()), style="dim")
    if calibration["disturbance"] > 1.3:
        console.print("  the machine was busy with other work: limits on seconds say little", style="yellow")
    return report, {"calibration": calibration}


if __name__ == "__main__":
    sys.exit(main())
