"""Soak: random models derived, compiled, simulated and verified for an hour; nothing that a process holds may grow.

``python -m hostile.soak --minutes 60`` from the folder ``tests`` prints a line a minute and exits 1 on a leak or a
wrong result.  Models of the numpy target come and go in this process; compiled ones, which Python cannot unload, in
children.
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from time import perf_counter

import numpy as np
from invariance.random_loops import random_loops
from invariance.random_models import random_tree

import eomgen as eg
from eomgen.compilation import Cache

ROOT = Path(__file__).parents[1]
BATCH, CYCLE = 24, 8  #: models between two children; compiled models, of which each child makes two
VERIFIED = 3  #: one model in so many is verified in full, which takes seconds
CACHE_SIZE = 40 * 2**20  #: bytes that the cache is cut back to after each child
SECONDS = 0.05  #: of motion
#: What a minute may add at most, by the slope over all of the run but its warm start.
LIMITS = {
    "memory": 0.25e6, "heap": 0.05e6, "blocks": 500.0, "objects": 60.0, "modules": 0.2, "descriptors": 0.2,
    "threads": 0.2, "cache_files": 30.0, "cache_bytes": 2e6, "temporary": 0.2,
}  # fmt: skip
WARM, LEAST = 0.4, 8  #: part of the run that is not judged; samples that a slope needs


class Wrong(Exception):
    """A result that contradicts another."""


@dataclass(frozen=True)
class Sample:
    """What this process holds at one moment.

    Attributes
    ----------
    minutes : float
        Since the start.
    memory : float
        Resident bytes, once malloc gave back the pages that it keeps free.
    heap : float
        Bytes in use of malloc; a leak in C shows here at once, where resident memory has the gaps between blocks too.
    blocks : int
        In use of Python's own allocator.
    objects, modules : int
        That the garbage collector follows; in ``sys.modules``.
    descriptors, threads : int
    cache_files, cache_bytes : int
    temporary : int
        Files in the folder for temporary files.
    """

    minutes: float
    memory: float
    heap: float
    blocks: int
    objects: int
    modules: int
    descriptors: int
    threads: int
    cache_files: int
    cache_bytes: int
    temporary: int


def sample(minutes: float, cache: Path, temporary: Path) -> Sample:
    """Look at this process and its folders."""
    gc.collect()
    heap = give_back()
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    kept = [path.stat().st_size for path in cache.rglob("*") if path.is_file()]
    return Sample(
        minutes, float(pages * os.sysconf("SC_PAGE_SIZE")), heap, sys.getallocatedblocks(), len(gc.get_objects()),
        len(sys.modules), len(os.listdir("/proc/self/fd")), threading.active_count(), len(kept), sum(kept),
        sum(path.is_file() for path in temporary.rglob("*")),
    )  # fmt: skip


class MallInfo(ctypes.Structure):
    """glibc's ``struct mallinfo2`` (malloc.h)."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            "arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"
        )
    )  # fmt: skip


def give_back() -> float:
    """Let malloc return free pages to the system; the bytes that are in use, 0 where the C library cannot say."""
    library = ctypes.CDLL(None)
    if not hasattr(library, "mallinfo2"):  # glibc before 2.33, or another library
        return 0.0
    library.malloc_trim(ctypes.c_size_t(0))
    library.mallinfo2.restype = MallInfo
    found = library.mallinfo2()
    return float(found.uordblks + found.hblkhd)


def slope(minutes: np.ndarray, values: np.ndarray) -> float:
    """Median of the slopes of all pairs (Theil, 1950; Sen, 1968): a single large model does not move it."""
    i, j = np.triu_indices(len(values), k=1)
    return float(np.median((values[j] - values[i]) / (minutes[j] - minutes[i])))


def judge(samples: list[Sample]) -> dict[str, float]:
    """Slope a minute of each quantity, after the warm start."""
    warm = samples[int(WARM * len(samples)) :]
    minutes = np.array([s.minutes for s in warm])
    names = [f.name for f in fields(Sample) if f.name != "minutes"]
    return {name: slope(minutes, np.array([float(getattr(s, name)) for s in warm])) for name in names}


def leaks(samples: list[Sample]) -> list[str]:
    """What grows by more than it may; needs :data:`LEAST` samples after the warm start."""
    return [f"{name} grows by {found:.3g} a minute" for name, found in judge(samples).items() if found > LIMITS[name]]


def model_of(number: int) -> eg.Model:
    """A random tree or a random closed mechanism."""
    return random_tree(number) if number % 2 else random_loops(number).model


def agree(what: str, a: np.ndarray, b: np.ndarray, limit: float) -> None:
    """Raise Wrong where two results differ by more than `limit` of the larger one's size."""
    size = max(float(np.abs(a).max(initial=0.0)), 1.0)
    error = float(np.abs(a - b).max(initial=0.0)) / size
    if not error <= limit:
        raise Wrong(f"{what} differ by {error:.3g}")


def try_one(number: int, folder: Path, verified: bool) -> None:
    """One model of the numpy target, from its text to its results and back from its files."""
    described = model_of(number)
    described.save(folder / "model.yaml")
    module = eg.load(folder / "model.yaml").compile(target="numpy")
    alone = described.derive().compile(target="numpy")  # verified without variants, of which some are compiled
    run = module.simulate(SECONDS, method="RK45", rtol=1e-6, events=[])
    if not np.isfinite(run.x).all() or run.residuals.position > 1e-9:
        raise Wrong(f"a state that is not finite, or loops open by {run.residuals.position:.2g}")
    read = eg.load_trajectory(run.save(folder / "run.npz"))
    agree("a run and its file", run.x, read.x, 0.0)
    agree("energies of a run and of its file", run.energies, read.energies, 0.0)
    again = module.simulate(SECONDS, run.x[:, 0], method="RK45", rtol=1e-6, events=[])  # from the very same start
    many = module.simulate_many(
        SECONDS, run.x[:, :1].repeat(2, axis=1), method="RK45", rtol=1e-6, events=[], store=folder / "store"
    )
    agree("a run and a run of an ensemble", again.x[:, -1], many.x[:, 1], 1e-9)
    refused = eg.Model.from_description(described.description)
    refused.body("body0", mass="nothing")
    try:
        refused.compile(target="numpy")
    except eg.ModelError:
        pass
    else:
        raise Wrong("a model with two bodies of one name and no mass was taken")
    if verified:
        verify(alone, number)


def verify(module: eg.Module, number: int) -> None:
    found = module.verify(states=1, seconds=0.5, seed=number)
    if not found.ok:
        raise Wrong(f"verification failed:\n{found}")


def try_compiled(number: int) -> None:
    """The same model compiled: all ways to run it, against the numpy target and its variants."""
    described = model_of(number)
    plain, module = described.compile(target="numpy"), described.compile()
    verify(module, number)
    x = plain.x0()
    agree("right-hand sides", plain.rhs(0.0, x), module.rhs(0.0, x), 1e-9)
    ends = [
        module.simulate(SECONDS, x, method=method, rtol=1e-9, atol=1e-11, events=[]).x[:, -1]
        for method in ("DOP853", "RK45", "Radau")
    ]
    agree("DOP853 and RK45", ends[0], ends[1], 1e-6)
    agree("DOP853 and Radau", ends[0], ends[2], 1e-6)
    many = module.simulate_many(SECONDS, x[:, None].repeat(9, axis=1), rtol=1e-9, atol=1e-11, events=[])
    agree("a run and those of an ensemble", ends[0], many.x[:, -1], 1e-6)


def in_a_child(first: int, count: int) -> None:
    """Compiled models in a process of their own."""
    words = [sys.executable, "-W", "ignore", "-m", "hostile.soak", "--compiled", str(first), str(count)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Wrong(f"compiled models {first} to {first + count - 1}: {(done.stdout + done.stderr)[-2000:]}")


def numbered(count: int, batch: int) -> Iterator[tuple[int, bool]]:
    """Numbers of models, and whether a child is due after each."""
    for number in range(count):
        yield number, number % batch == batch - 1


def soak(
    minutes: float, first: int, tell: Callable[[str], None], every: float = 60.0, verified: int = VERIFIED,
    batch: int = BATCH, most: int = 10**9,
) -> tuple[list[Sample], list[str]]:  # fmt: skip
    """Work through models for some time, or `most` of them.

    Returns
    -------
    list of Sample
        One every `every` seconds.
    list of str
        What was wrong.
    """
    samples: list[Sample] = []
    wrong: list[str] = []
    kinds: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix="eomgen-soak-") as name:
        cache, temporary, folder = (Path(name) / part for part in ("cache", "temporary", "work"))
        for part in (cache, temporary, folder):
            part.mkdir(mode=0o700)
        before = {key: os.environ.get(key) for key in ("EOMGEN_CACHE_DIR", "TMPDIR")}
        os.environ.update(EOMGEN_CACHE_DIR=before["EOMGEN_CACHE_DIR"] or str(cache), TMPDIR=str(temporary))
        cache, tempfile.tempdir = Path(os.environ["EOMGEN_CACHE_DIR"]), None
        start = shown = perf_counter()
        try:
            for number, child in numbered(most, batch):
                try:
                    try_one(first + number, folder, number % verified == 0)
                    if child:
                        in_a_child(number // batch * 2 % CYCLE, 2)
                        kinds["compiled"] += 2
                        Cache(cache).prune(max_size=CACHE_SIZE)
                    kinds["fine"] += 1
                except (Wrong, eg.EomgenError) as error:
                    kinds["wrong"] += 1
                    wrong.append(f"model {first + number}: {type(error).__name__}: {error}")
                    tell(wrong[-1])
                finally:
                    shutil.rmtree(folder)
                    folder.mkdir(mode=0o700)
                now = perf_counter()
                if now - shown >= every:
                    shown = now
                    samples.append(sample((now - start) / 60.0, cache, temporary))
                    tell(spell(samples[-1], kinds))
                if now - start >= 60.0 * minutes:
                    break
        finally:
            for key, value in before.items():
                os.environ.pop(key, None) if value is None else os.environ.update({key: value})
            tempfile.tempdir = None
    return samples, wrong


def spell(s: Sample, kinds: Counter[str]) -> str:
    """A line for a sample."""
    return (
        f"{s.minutes:6.1f} min  {s.memory / 1e6:7.1f} MB  {s.heap / 1e6:6.2f} MB of malloc  {s.blocks} blocks  "
        f"{s.objects:7d} objects  {s.modules} modules  "
        f"{s.descriptors} descriptors  {s.threads} threads  cache {s.cache_files} files {s.cache_bytes / 1e6:.1f} MB  "
        f"{s.temporary} temporary files  {', '.join(f'{n} {kind}' for kind, n in sorted(kinds.items()))}"
    )


def main() -> int:
    """Soak for as long as asked, and judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--first", type=int, default=0, help="number of the first model")
    parser.add_argument("--compiled", type=int, nargs=2, metavar=("FIRST", "COUNT"), help="what a child does")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    if given.compiled:
        for number in range(given.compiled[0], sum(given.compiled)):
            try_compiled(number)
        return 0
    samples, wrong = soak(given.minutes, given.first, lambda line: print(line, flush=True))
    if int((1.0 - WARM) * len(samples)) < LEAST:
        print(f"too short to judge: {len(samples)} samples; give --minutes {LEAST / (1.0 - WARM) + 1:.0f} or more")
        return 1
    for name, found in judge(samples).items():
        print(f"{name:14}{found:+12.4g} a minute, at most {LIMITS[name]:g}")
    growing = leaks(samples)
    print("; ".join([*growing, *(["wrong results: see above"] if wrong else [])]) or "nothing grows, nothing wrong")
    return 1 if growing or wrong else 0


if __name__ == "__main__":
    sys.exit(main())
