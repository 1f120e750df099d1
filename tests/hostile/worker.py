"""A process that runs batches of cases, one after the other: jobs as JSON lines on stdin, reports on stdout."""

from __future__ import annotations

import json
import mmap
import os
import resource
import struct
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from .kind import Kind, find, keep, make
from .outcome import FINDINGS, Outcome, Runner

BEAT = struct.Struct("qd")  #: seed of the case that runs, or -1; when it began (s, monotonic clock)
REPORT = 2.0  #: seconds between two reports
TRIES, PATIENCE = 400, 30.0  #: most runs and seconds to make one case smaller
IDLE = -1

Report = Callable[[dict[str, Any]], None]


class Tally:
    """What came out since the last report."""

    def __init__(self, kind: str, at: int) -> None:
        self.kind, self.first, self.next = kind, at, at
        self.outcomes: Counter[str] = Counter()
        self.words: Counter[str] = Counter()
        self.worst, self.worst_seed, self.begun = 0.0, at, time.monotonic()

    def add(self, seed: int, found: Outcome) -> None:
        self.next = seed + 1
        self.outcomes[found.kind] += 1
        self.words[f"{found.kind}: {found.detail}" if found.kind not in FINDINGS else found.kind] += 1
        if found.seconds > self.worst:
            self.worst, self.worst_seed = found.seconds, seed

    def report(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "next": self.next,
            "outcomes": self.outcomes,
            "words": self.words,
            "worst": self.worst,
            "worst_seed": self.worst_seed,
            "seconds": time.monotonic() - self.begun,
            "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10,
        }


class Worker:
    """Runs jobs until stdin ends."""

    def __init__(self, folder: Path, cache: Path, beat: mmap.mmap, report: Report) -> None:
        self.runner = Runner(folder, cache)
        self.runner.limit()
        self.beat, self.report = beat, report

    def case(self, kind: Kind, seed: int, case: Any) -> Outcome:
        """One case, which the parent can see run."""
        BEAT.pack_into(self.beat, 0, seed, time.monotonic())
        found = self.runner.run(kind, case)
        BEAT.pack_into(self.beat, 0, IDLE, time.monotonic())  # the two numbers are not written at once
        return found

    def batch(self, name: str, first: int, count: int, skip: list[int]) -> None:
        """Cases of consecutive seeds."""
        kind = find(name)
        self.runner.prepare(kind)
        tally = Tally(name, first)
        for seed in range(first, first + count):
            if seed in skip:
                continue
            found = self.case(kind, seed, make(kind, name, seed))
            tally.add(seed, found)
            if found.kind in FINDINGS:
                fault = {"outcome": found.kind, "seed": seed, "key": found.key, "text": found.text}
                self.report({"finding": fault | {"kind": name, "seconds": found.seconds}})
            if time.monotonic() - tally.begun > REPORT:
                self.report(tally.report())
                tally = Tally(name, seed + 1)
        tally.next = first + count
        self.report(tally.report() | {"done": True})

    def minimise(self, name: str, seed: int, key: str, stem: str) -> None:
        """Write the smallest case found that still ends in the same fault."""
        kind = find(name)
        self.runner.prepare(kind)
        case = make(kind, name, seed)
        smallest = smaller(kind, case, lambda other: self.case(kind, seed, other).key == key)
        self.report({"smallest": str(keep(smallest, Path(stem))), "done": True})


def smaller(kind: Kind, case: Any, same: Callable[[Any], bool]) -> Any:
    """The smallest case found, within so many tries and seconds, for which ``same`` holds."""
    tries, end = TRIES, time.monotonic() + PATIENCE

    def next_smaller(case: Any) -> Iterator[Any]:
        nonlocal tries
        for other in kind.smaller(case):
            if tries <= 0 or time.monotonic() > end:
                return
            tries -= 1
            if other != case and same(other):
                yield other
                return

    while (found := next(next_smaller(case), None)) is not None:
        case = found
    return case


def main() -> None:
    """``python -m hostile.worker FOLDER CACHE BEAT``."""
    folder, cache, beat = (Path(word) for word in sys.argv[1:4])
    jobs = sys.stdin
    # what a case prints goes nowhere; reports have a descriptor of their own
    out = os.fdopen(os.dup(1), "w", buffering=1)
    null = os.open(os.devnull, os.O_RDWR)
    os.dup2(null, 1)

    def report(line: dict[str, Any]) -> None:
        out.write(json.dumps(line) + "\n")

    with beat.open("r+b") as file, mmap.mmap(file.fileno(), BEAT.size) as shared:
        worker = Worker(folder, cache, shared, report)
        for line in jobs:
            job = json.loads(line)
            (worker.minimise if "key" in job else worker.batch)(**job)


if __name__ == "__main__":
    main()
