"""The attack: hostile cases of all kinds in long-lived processes; ``make fuzz`` runs it.

    python -m hostile.run [KIND ...] [--cases N | --hours H] [--out DIR] [--first N] [--jobs N] [--results]
    python -m hostile.run KIND --seed N

The first form runs a mix, prints how far it is, and ends with exit status 1 if it found anything; the second makes one
case again, shows it and what comes of it.  Run it in the folder ``tests``.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from .campaign import Campaign
from .kind import MODULES, find, keep, make
from .outcome import FINDINGS, Runner
from .report import RESULTS, progress, summary

#: Kind -> its part of the cases of a mixed run, the rest by proportion.
#: By what a case costs on a quiet core (ms): 0.13, 6, 4, 100, 2.4, 1, 13, 6; a million take half an hour.
MIX = {
    "expressions": 0.59,
    "yaml": 0.13,
    "urdf": 0.06,
    "mjcf": 0.002,
    "meshes": 0.02,
    "calls": 0.173,
    "sympy": 0.02,
    "command_lines": 0.005,
}
CASES = 100_000


def main() -> int:
    """The command line."""
    options = arguments()
    if options.seed is not None:
        return one(options.kinds[0], options.seed)
    out = options.out or Path(tempfile.mkdtemp(prefix="eomgen-fuzz-"))
    out.mkdir(parents=True, exist_ok=True)
    kinds = options.kinds or [name for name in MIX if name in MODULES]
    parts = {name: MIX[name] / sum(MIX[k] for k in kinds) for name in kinds}
    first = options.first
    if first is None:  # a run by the hour tries new cases, a counted one is repeatable
        first = int(time.time()) * 1000 if options.hours else 0
    cases = None if options.hours else options.cases
    print(f"{'mix' if len(kinds) > 1 else kinds[0]}: seeds from {first}; findings go to {out}", flush=True)
    campaign = Campaign(parts, first, out, options.jobs)
    campaign.run(cases, options.hours and options.hours * 3600, progress)
    text = summary(campaign)
    print(text)
    if options.results:
        RESULTS.write_text(text, encoding="utf-8")
    if campaign.missing:
        print(f"the run gave up before its end: {campaign.missing:,} cases are missing", file=sys.stderr)
    return 1 if campaign.findings or campaign.missing else 0


def one(name: str, seed: int) -> int:
    """Make one case again and say what comes of it."""
    with tempfile.TemporaryDirectory(prefix="eomgen-fuzz-") as folder:
        kind = find(name)
        runner = Runner(Path(folder) / "home", Path(folder) / "cache")
        runner.prepare(kind)
        case = make(kind, name, seed)
        path = keep(case, Path(folder) / "shown")
        print(
            path.read_text(encoding="utf-8", errors="surrogatepass")
            .encode("unicode_escape" if isinstance(case, str) else "utf-8", "backslashreplace")
            .decode()
        )
        found = runner.run(kind, case)
    print(f"{found.kind}: {found.detail} ({found.seconds:.2f} s)\n{found.text}")
    return int(found.kind in FINDINGS)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="hostile.run", description=str(__doc__).split("\n")[0])
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"of {', '.join(MODULES)}; all unless given")
    parser.add_argument("--cases", type=int, default=CASES, help=f"how many in all ({CASES})")
    parser.add_argument("--hours", type=float, help="run so long instead, with new seeds")
    parser.add_argument("--first", type=int, help="first seed of each kind (0; by the clock with --hours)")
    parser.add_argument(
        "--out", type=Path, help="folder for what is found (a new one in the folder of temporary files)"
    )
    parser.add_argument("--jobs", type=int, default=1, help="processes that run cases (1)")
    parser.add_argument("--results", action="store_true", help=f"write {RESULTS.name} beside the sources")
    parser.add_argument("--seed", type=int, help="only this case, shown")
    options = parser.parse_args()
    unknown = [name for name in options.kinds if name not in MODULES]
    if unknown:
        parser.error(f"no kind {', '.join(unknown)}; there are: {', '.join(MODULES)}")
    if options.seed is not None and len(options.kinds) != 1:
        parser.error("--seed needs one KIND")
    return options


if __name__ == "__main__":
    sys.exit(main())
