"""Hostile cases by the hundred thousand: ``make fuzz``, or ``python -m attack.fuzz [KIND ...]`` in the folder ``tests``.

Cases run one after the other in a worker process, each with 20 s of the processor and 2 GB, under the guard; a worker that dies or hangs
in machine code is replaced.  What is found is printed with its seed, by which ``--seed`` runs that case again, shown.
Seeds below 0 are the cases in ``kept/``, which once were findings.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from attack.runner import FINDINGS, MODULES, SECONDS, Runner, find, kept, make

KEPT = Path(__file__).with_name("kept")
#: Kind -> its part of the cases of a mixed run, by what a case costs.
MIX = dict(zip(MODULES, (0.3, 0.18, 0.03, 0.3, 0.02, 0.12, 0.01, 0.04), strict=True))
GRACE = 200.0  #: seconds on the clock after which a case that outlived its alarm is killed with its process
PREPARING = 900.0  #: seconds that a worker may take before its first case
RENEWED = 20_000  #: cases after which a worker is replaced

Job = tuple[str, int, int]  #: kind, first seed, seed behind the last


def files_of(name: str) -> list[Path]:
    """The kept cases of a kind."""
    return sorted((KEPT / name).glob("*.*"))


def case_of(name: str, seed: int) -> Any:
    """The case of a seed."""
    return kept(files_of(name)[-seed - 1]) if seed < 0 else make(find(name), seed)


def work(folder: Path, jobs: list[Job]) -> None:
    """What a worker does: a line with the seed before each case, one of JSON for a finding and for a job that ends."""
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_RDWR), 1)  # what a case prints goes nowhere
    runner = Runner(folder / "home", folder / "cache")
    runner.limit()
    for number, (name, first, end) in enumerate(jobs):
        runner.prepare(find(name))
        counts: Counter[str] = Counter()
        for seed in range(first, end):
            out.write(f"{number} {seed}\n")
            found = runner.run(find(name), case_of(name, seed))
            counts[found.kind] += 1
            if found.kind in FINDINGS:
                out.write(json.dumps({"kind": name, "seed": seed, **found._asdict()}) + "\n")
        out.write(json.dumps({"done": name, "counts": counts}) + "\n")


def attack(jobs: list[Job], folder: Path) -> Iterator[dict[str, Any]]:
    """Run jobs in workers; yields findings, and the counts of outcomes."""
    command = [sys.executable, "-m", "attack.fuzz", "--worker", str(folder)]
    while jobs:
        with subprocess.Popen(
            [*command, json.dumps(jobs)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=KEPT.parents[1]
        ) as process:
            assert process.stdout is not None and process.stderr is not None  # noqa: PT018
            limit = [time.monotonic() + PREPARING]
            threading.Thread(target=watch, args=(process, limit), daemon=True).start()
            number, seed = 0, None
            for line in process.stdout:
                if line.startswith("{"):
                    yield json.loads(line)
                    limit[0] = time.monotonic() + PREPARING
                else:
                    number, seed = map(int, line.split())
                    limit[0] = time.monotonic() + SECONDS + GRACE
            said = process.stderr.read()[-3000:]
        if process.returncode == 0:
            return
        if seed is None:
            raise RuntimeError(f"a worker died before its first case: {said}")
        kind = "hang" if time.monotonic() > limit[0] else "crash"
        yield {"kind": jobs[number][0], "seed": seed, "key": kind, "text": f"exit {process.returncode}: {said}"}
        jobs = [(jobs[number][0], seed + 1, jobs[number][2]), *jobs[number + 1 :]]


def watch(process: subprocess.Popen[str], limit: list[float]) -> None:
    """Kill a worker that says nothing for too long."""
    while process.poll() is None:
        time.sleep(0.5)
        if time.monotonic() > limit[0]:
            process.kill()


def campaign(kinds: list[str], cases: int, hours: float | None) -> int:
    """So many cases, from seed 0, or new ones so long; 1 if anything was found."""
    first = int(time.time()) * 1000 if hours else 0
    end = time.monotonic() + 3600 * hours if hours else None
    counts: dict[str, Counter[str]] = {name: Counter() for name in kinds}
    found: Counter[str] = Counter()
    done = dict.fromkeys(kinds, 0)
    with tempfile.TemporaryDirectory(prefix="eomgen-fuzz-", ignore_cleanup_errors=True) as name:
        while any(end or done[k] < cases * MIX[k] / sum(map(MIX.get, kinds)) for k in kinds):  # type: ignore[arg-type]
            jobs = []
            for kind in kinds:
                count = round(min(cases, RENEWED) * MIX[kind] / sum(MIX[k] for k in kinds)) + 1
                jobs.append((kind, first + done[kind], first + done[kind] + count))
                done[kind] += count
            for report in attack(jobs, Path(name)):
                if "done" in report:
                    counts[report["done"]].update(report["counts"])
                    continue
                found[report["key"]] += 1
                if found[report["key"]] <= 3:
                    print(f"{report['kind']} --seed {report['seed']}: {report['key']}\n{report['text']}", flush=True)
            told = "; ".join(f"{kind} {dict(outcomes)}" for kind, outcomes in counts.items())
            print(f"{time.strftime('%H:%M')} {sum(done.values())} cases: {told}", flush=True)
            if end and time.monotonic() > end:
                break
    print("\n".join(f"{number} x {key}" for key, number in found.items()) or "nothing found")
    return int(bool(found))


def shown(name: str, seed: int) -> int:
    """Make one case again and say what comes of it."""
    with tempfile.TemporaryDirectory(prefix="eomgen-fuzz-") as folder:
        runner = Runner(Path(folder) / "home", Path(folder) / "cache")
        runner.prepare(find(name))
        case = case_of(name, seed)
        print(case.encode("unicode_escape").decode() if isinstance(case, str) else json.dumps(case, indent=1))
        found = runner.run(find(name), case)
    print(f"{found.kind}: {found.detail} ({found.seconds:.2f} s)\n{found.text}")
    return int(found.kind in FINDINGS)


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="attack.fuzz", description=str(__doc__).split("\n")[0])
    parser.add_argument("kinds", nargs="*", metavar="KIND", choices=[*MODULES, []], help=f"of {', '.join(MODULES)}")
    parser.add_argument("--cases", type=int, default=20_000, help="how many in all (20000)")
    parser.add_argument("--hours", type=float, help="run so long instead, with new seeds")
    parser.add_argument("--seed", type=int, help="only this case of one KIND, shown")
    parser.add_argument("--worker", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        work(Path(options.worker[0]), json.loads(options.worker[1]))
        return 0
    if options.seed is not None:
        if len(options.kinds) != 1:
            parser.error("--seed needs one KIND")
        return shown(options.kinds[0], options.seed)
    return campaign(options.kinds or list(MODULES), options.cases, options.hours)


if __name__ == "__main__":
    sys.exit(main())
