"""A run of many cases: shares them out to worker processes, watches over these, and gathers what they find."""

from __future__ import annotations

import json
import mmap
import select
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .outcome import SECONDS
from .worker import BEAT, IDLE

BATCH_SECONDS = 5.0  #: aimed at for one batch
GRACE = 10.0  #: seconds after which a case that outlived its alarm is killed with its process
SILENCE = 900.0  #: seconds a worker may take to prepare
RENEWAL = 1 << 30  #: a worker that holds more (bytes) is replaced after its batch
IDLE_DEATHS = 5  #: in a row, of workers that run no case, after which a campaign gives up
EACH = 20  #: most findings of one key that are kept as files


class Record:
    """What came of the cases of one kind."""

    def __init__(self) -> None:
        self.cases = 0
        self.seconds = self.worst = 0.0
        self.worst_seed = self.memory = 0
        self.outcomes: Counter[str] = Counter()
        self.words: Counter[str] = Counter()

    def add(self, report: dict[str, Any]) -> None:
        self.cases += sum(report["outcomes"].values())
        self.outcomes.update(report["outcomes"])
        self.words.update(report["words"])
        self.seconds += report["seconds"]
        self.memory = max(self.memory, report["memory"])
        if report["worst"] > self.worst:
            self.worst, self.worst_seed = report["worst"], report["worst_seed"]


class Died(Exception):
    """A worker ended or was killed; the message says how."""


class Campaign:
    """Cases of several kinds, in proportion."""

    def __init__(self, parts: dict[str, float], first: int, out: Path, jobs: int) -> None:
        self.parts, self.out, self.jobs = parts, out, jobs
        self.first = first
        self.next = dict.fromkeys(parts, first)
        self.records = {name: Record() for name in parts}
        self.findings: dict[tuple[str, str], list[dict[str, Any]]] = {}
        self.lock = threading.Lock()
        self.begun = time.monotonic()
        self.missing = 0  #: cases that were wanted and not run, where the run gave up

    @property
    def cases(self) -> int:
        return sum(record.cases for record in self.records.values())

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.begun

    def run(self, cases: int | None, seconds: float | None, tell: Callable[[Campaign], None]) -> None:
        """Run so many cases, or so long."""
        with tempfile.TemporaryDirectory(prefix="eomgen-fuzz-cache-", ignore_cleanup_errors=True) as cache:
            self.cache = Path(cache)  # one for all workers: compiling takes half a minute
            self._run(cases, seconds, tell)

    def _run(self, cases: int | None, seconds: float | None, tell: Callable[[Campaign], None]) -> None:
        self.begun = time.monotonic()
        self.wanted = {name: cases and max(1, round(cases * part)) for name, part in self.parts.items()}
        self.end = self.begun + seconds if seconds else float("inf")
        threads = [threading.Thread(target=self._work, args=(k,), daemon=True) for k in range(self.jobs)]
        for thread in threads:
            thread.start()
        while any(thread.is_alive() for thread in threads):
            for thread in threads:
                thread.join(timeout=10.0 / self.jobs)
            tell(self)
        self.missing = max(0, sum(self.wanted.values()) - self.cases) if cases else 0

    def take(self) -> tuple[str, int, int] | None:
        """The next batch: of the kind that is furthest behind its part."""
        with self.lock:
            if time.monotonic() > self.end:
                return None
            left = {n: w - (self.next[n] - self.first) if w else 1 << 40 for n, w in self.wanted.items()}
            open_kinds = [n for n in self.parts if left[n] > 0]
            if not open_kinds:
                return None
            name = min(open_kinds, key=lambda n: (self.next[n] - self.first) / self.parts[n])
            record = self.records[name]
            rate = record.cases / record.seconds if record.seconds > 0.5 else 4.0
            first, count = self.next[name], max(1, min(left[name], int(rate * BATCH_SECONDS), 50_000))
            self.next[name] += count
            return name, first, count

    def _work(self, number: int) -> None:
        """One worker after the other, batch after batch."""
        with tempfile.TemporaryDirectory(prefix="eomgen-fuzz-", ignore_cleanup_errors=True) as folder:
            worker: Process | None = None
            idle_deaths = 0
            while (batch := self.take()) is not None:
                name, first, count = batch
                end, skip = first + count, []
                while first < end or not count:
                    worker = worker or Process(Path(folder), self.cache)
                    job = {"name": name, "first": first, "count": end - first, "skip": skip}
                    try:
                        for report in worker.reports(job):
                            if "finding" in report:
                                self._found(report["finding"])
                            else:
                                with self.lock:
                                    self.records[name].add(report)
                                first, idle_deaths = report["next"], 0
                        self._minimise(worker, name)
                        if self.records[name].memory > RENEWAL and worker.memory() > RENEWAL:
                            raise Died
                    except Died as death:
                        seed = worker.current()
                        worker.stop()
                        worker = None
                        if str(death) and seed != IDLE:
                            outcome, _, how = str(death).partition(": ")
                            self._found(
                                {
                                    "kind": name,
                                    "outcome": outcome,
                                    "seed": seed,
                                    "key": f"{outcome} {how}",
                                    "text": how,
                                    "seconds": 0.0,
                                }
                            )
                            with self.lock:
                                self.records[name].cases += 1
                                self.records[name].outcomes[outcome] += 1
                            skip.append(seed)
                        elif str(death):  # between two cases: by no case's fault
                            idle_deaths += 1
                            if idle_deaths > IDLE_DEATHS:
                                raise
            if worker is not None:
                worker.stop()

    def _found(self, finding: dict[str, Any]) -> None:
        key = (finding["kind"], finding["key"])
        with self.lock:
            known = self.findings.setdefault(key, [])
            known.append(finding)
            if len(known) > EACH:
                known[:] = known[:EACH]  # their number is in the counts of outcomes
                return
            stem = self.out / f"{finding['kind']}_{finding['seed']}"
            stem.with_suffix(".found.json").write_text(json.dumps(finding, indent=1))

    def _minimise(self, worker: Process, name: str) -> None:
        """Make the first case of each new fault smaller."""
        for (kind, key), known in list(self.findings.items()):
            first = known[0]
            if kind != name or "smallest" in first or first["outcome"] in ("hang", "memory", "crash"):
                continue
            first["smallest"] = ""
            stem = str(self.out / f"{kind}_{first['seed']}_small")
            job = {"name": kind, "seed": first["seed"], "key": key, "stem": stem}
            for report in worker.reports(job):
                first["smallest"] = report.get("smallest", "")


class Process:
    """A worker process."""

    def __init__(self, folder: Path, cache: Path) -> None:
        self.beat_file = folder / "beat"
        self.beat_file.write_bytes(BEAT.pack(IDLE, 0.0))
        command = [sys.executable, "-m", "hostile.worker", str(folder), str(cache), str(self.beat_file)]
        self.errors = (folder / "stderr").open("w+b")
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.errors, cwd=Path(__file__).parents[1]
        )
        with self.beat_file.open("r+b") as file:
            self.beat = mmap.mmap(file.fileno(), BEAT.size)
        self.rest = b""

    def current(self) -> int:
        """The seed of the case that runs."""
        return int(BEAT.unpack_from(self.beat, 0)[0])

    def memory(self) -> int:
        """Bytes that it holds now."""
        fields = Path(f"/proc/{self.process.pid}/statm").read_text().split()
        return int(fields[1]) * mmap.PAGESIZE

    def reports(self, job: dict[str, Any]) -> Any:
        """The reports on one job, one after the other; raises Died where the process does not live to its end."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(json.dumps(job).encode() + b"\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            raise Died(self._end()) from None
        while True:
            report = json.loads(self._line())
            yield report
            if report.get("done"):
                return

    def _line(self) -> bytes:
        assert self.process.stdout is not None
        last, late = time.monotonic(), None
        while b"\n" not in self.rest:
            ready, _, _ = select.select([self.process.stdout], [], [], 0.5)
            if ready:
                data = self.process.stdout.read1(1 << 16)  # type: ignore[attr-defined]
                if not data:
                    raise Died(self._end())
                self.rest += data
                last = time.monotonic()
                continue
            beat, now = BEAT.unpack_from(self.beat, 0), time.monotonic()
            over = beat[0] != IDLE and now - beat[1] > SECONDS + GRACE
            seen_twice, late = over and beat == late, beat if over else None  # a beat may be read half written
            if seen_twice or now - last > SILENCE:
                self.process.kill()
                self.process.wait()
                raise Died("hang: in machine code, killed")
        line, _, self.rest = self.rest.partition(b"\n")
        return line

    def _end(self) -> str:
        code = self.process.wait()
        self.errors.seek(0)
        said = self.errors.read()[-1500:].decode(errors="replace").strip()
        return f"crash: exit status {code}, {said.splitlines()[-1] if said else 'silent'}"

    def stop(self) -> None:
        """End it."""
        if self.process.poll() is None:
            assert self.process.stdin is not None
            self.process.stdin.close()
            try:
                self.process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()
        self.errors.close()
        self.beat.close()
