"""Put every fault of the list into a copy of the sources, one at a time, and run the tests that must notice it.

    python tests/mutations/run.py [IDS...] [--jobs 2]

All tests named are run on the sources as they are first, and must pass.  Prints a line for each fault; a run of the
whole list writes ``RESULTS.md`` beside this file.  Exit status 1 if a fault survives.
"""

import argparse
import sys
import tempfile
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from mutations.copies import Copy, Outcome
from mutations.fault import FAULTS, Fault

RESULTS = Path(__file__).with_name("RESULTS.md")
FAILED = 1  #: pytest's status of a run in which tests failed
HEAD = """# Deliberate faults and the tests that caught them

Written by `make mutations` (`python tests/mutations/run.py`), which puts each fault into a copy of the sources.

| fault | where | what it breaks | caught by | s |
|---|---|---|---|---|
"""


def select(ids: Sequence[str]) -> list[Fault]:
    """The faults of these names, or all."""
    known = {fault.id: fault for fault in FAULTS}
    missing = [name for name in ids if name not in known]
    if missing:
        sys.exit(f"no fault {', '.join(missing)}; there are {', '.join(known)}")
    return [known[name] for name in ids] if ids else list(FAULTS)


def check_unharmed(copy: Copy, faults: Sequence[Fault]) -> None:
    """Run all tests that are to catch something on the sources as they are; leave if one fails."""
    tests = sorted({test for fault in faults for test in fault.caught_by})
    outcome = copy.run(tests, first=False)
    if outcome.code:
        sys.exit(f"the tests do not pass without a fault:\n{outcome.text[-6000:]}")
    print(f"{len(tests)} tests or files pass without a fault ({outcome.seconds:.0f} s)", flush=True)


def run(faults: Sequence[Fault], jobs: int) -> list[tuple[Fault, Outcome]]:
    """The outcome of each fault, in the order of the list."""
    with tempfile.TemporaryDirectory(prefix="eomgen-mutations-") as folder:
        own, first = threading.local(), Copy(Path(folder) / "copy")
        check_unharmed(first, faults)
        spare = [first, *(Copy(Path(folder) / f"copy{k}") for k in range(1, jobs))]

        def one(fault: Fault) -> tuple[Fault, Outcome]:
            if not hasattr(own, "copy"):
                own.copy = spare.pop()
            outcome = own.copy.run_with(fault, fault.caught_by)
            caught = outcome.code == FAILED
            sys.stdout.write(f"{fault.id:32} {outcome.by if caught else 'SURVIVES':80} {outcome.seconds:5.1f}\n")
            sys.stdout.flush()
            if outcome.code not in (0, FAILED):
                print(outcome.text[-3000:], flush=True)
            return fault, outcome

        with ThreadPoolExecutor(jobs) as pool:
            return list(pool.map(one, faults))


def write_table(outcomes: Sequence[tuple[Fault, Outcome]]) -> None:
    """The results as a table in Markdown."""
    lines = []
    for fault, outcome in outcomes:
        by = f"`{outcome.by}`" if outcome.code == FAILED else "**nobody**"
        lines.append(f"| {fault.id} | `{fault.where}` | {fault.breaks} | {by} | {outcome.seconds:.0f} |")
    RESULTS.write_text(HEAD + "\n".join(lines) + "\n", encoding="utf-8")


def main() -> int:
    """0 if every fault was caught."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ids", nargs="*", help="faults to try; all if none are named")
    parser.add_argument("--jobs", type=int, default=1, help="copies that are tried side by side")
    given = parser.parse_args()
    faults = select(given.ids)
    outcomes = run(faults, max(1, given.jobs))
    alive = [fault.id for fault, outcome in outcomes if outcome.code != FAILED]
    if not given.ids:
        write_table(outcomes)
    print(f"{len(outcomes) - len(alive)} of {len(outcomes)} caught", *(f"survives: {name}" for name in alive), sep="\n")
    return bool(alive)


if __name__ == "__main__":
    sys.exit(main())
