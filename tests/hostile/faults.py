"""Faults of machines, every one of them: ``python -m hostile.faults [--fast] [--write] [NAME ...]`` from tests/.

Prints every breach and a table; exits 1 if there was one.  ``--write`` keeps the table in FAULTS.md.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from time import perf_counter

from hostile import fault_builds, fault_compilers, fault_places, fault_versions
from hostile.fault_work import Result, Work

#: Kind of fault -> what tries all of them (or a few, where the second argument says so).
FAULTS: dict[str, Callable[[Work, bool], Iterator[Result]]] = {
    "killed by the compiler's hand": fault_builds.killed_by_the_compiler,
    "killed at every change of the cache": fault_builds.killed_at_each_change,
    "20 processes at once": fault_builds.many_at_once,
    "damaged files of a build": fault_builds.damaged_entries,
    "damaged notes, bytecode, texts": fault_builds.damaged_kept,
    "damaged Cython layer": fault_builds.damaged_layer,
    "foreign and open places": fault_places.foreign_places,
    "full and read-only disks": fault_places.full_disks,
    "odd paths and locales": fault_places.odd_places,
    "odd environments": fault_places.odd_environments,
    "wrong clocks": fault_places.wrong_clocks,
    "other versions on one cache": fault_versions.other_versions,
    "versions at once on one cache": fault_versions.versions_at_once,
    "broken compilers": fault_compilers.broken_compilers,
    "compilers that lied once": fault_compilers.lied_once,
}


def table(found: dict[str, tuple[list[Result], float]]) -> str:
    """The table of all kinds, in Markdown."""
    lines = ["| faults | tried | right | named error | killed | breaches | seconds |", "|---|--:|--:|--:|--:|--:|--:|"]
    total: Counter[str] = Counter()
    for name, (results, seconds) in [*found.items()]:
        words = Counter(result.outcome.word for result in results)
        words["breaches"] = sum(not result.survived for result in results)
        words["tried"], words["seconds"] = len(results), round(seconds)
        total += words
        lines.append(_row(name, words))
    return "\n".join([*lines, _row("all", total)]) + "\n"


def _row(name: str, words: Counter[str]) -> str:
    return "| " + " | ".join([name, *(str(words[key]) for key in COLUMNS)]) + " |"


COLUMNS = ("tried", "right", "named", "killed", "breaches", "seconds")


def main() -> int:
    """Try what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"parts of: {', '.join(FAULTS)}")
    parser.add_argument("--fast", action="store_true", help="the few that the tests try")
    parser.add_argument("--write", action="store_true", help="keep the table in FAULTS.md")
    parser.add_argument("--python", action="append", default=[], help="another interpreter, with what eomgen needs")
    parser.add_argument("--verbose", action="store_true", help="print every fault")
    given = parser.parse_args()
    found: dict[str, tuple[list[Result], float]] = {}
    with tempfile.TemporaryDirectory(prefix="eomgen-faults-") as folder:
        work = Work(Path(folder), Path(folder) / "layer", given.python)
        for name, attempt in FAULTS.items():
            if given.names and not any(part in name for part in given.names):
                continue
            start, results = perf_counter(), []
            for result in attempt(work, given.fast):
                results.append(result)
                if given.verbose or not result.survived:
                    mark = "survived" if result.survived else "BREACH"
                    print(f"{mark}: {result.fault}: {result.outcome} then {result.after}", flush=True)
            found[name] = results, perf_counter() - start
            print(f"# {name}: {len(results)} in {found[name][1]:.0f} s", file=sys.stderr, flush=True)
    print(table(found))
    if given.write:
        text = Path(__file__).with_name("FAULTS.md")
        text.write_text(f"{HEADING}\n{table(found)}\n{interpreters(given.python)}", encoding="utf-8")
    return int(any(not result.survived for results, _ in found.values() for result in results))


def interpreters(others: Sequence[str]) -> str:
    """Which Pythons ran: this one, and the others beside it on the caches of the versions."""
    ask = "import platform, numpy, Cython; print(platform.python_version(), numpy.__version__, Cython.__version__)"
    every = [subprocess.run([python, "-c", ask], capture_output=True, text=True, check=True).stdout.split()
             for python in (sys.executable, *others)]  # fmt: skip
    told = "".join(f"- Python {python}, NumPy {numpy}, Cython {cython}\n" for python, numpy, cython in every)
    return f"Versions at once, 20 processes on one new cache, then each alone from its own build, ran on\n\n{told}"


HEADING = """# Faults of machines: the last run

`cd tests && python -m hostile.faults --write` repeats it (`--python PATH` adds an interpreter to the versions).  Each
fault strikes one build; it is survived if that run gives the right numbers, or stops with an error of eomgen's own (or
was killed by the fault), and the run after it, with the fault gone, gives the right numbers.
"""

if __name__ == "__main__":
    sys.exit(main())
