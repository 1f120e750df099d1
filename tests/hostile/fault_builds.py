"""Faults of builds: killed at each of their steps, twenty at once, files of the cache cut, changed or replaced."""

from __future__ import annotations

import os
import random
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from hostile.fault_work import BUILD, LIBRARY, WHOLE, Outcome, Result, Work, environment, script

from eomgen.compilation import Cache, compile_sources
from eomgen.errors import EomgenError

#: Kills the process when it changes the cache for the n-th time.
AT_CHANGE = """
import signal
root, left = os.environ["EOMGEN_CACHE_DIR"], [{n}]
CHANGES = ("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.chmod", "os.utime", "subprocess.Popen")
def hook(event, args):
    writes = event == "open" and isinstance(args[2], int) and args[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
    if (writes or event in CHANGES) and root in repr(args):
        left[0] -= 1
        if left[0] == 0:
            os.kill(os.getpid(), signal.SIGKILL)
sys.addaudithook(hook)
"""
#: Steps of the compiler at which its parent is killed: before or after the n-th command.
CALLS = [(n, when) for n in (1, 2, 3) for when in ("before", "after")]
PROCESSES = 20


def killed_by_the_compiler(work: Work, fast: bool) -> Iterator[Result]:
    """A compiler that kills whoever called it, before or after its n-th command."""
    for n, when in CALLS[::2] if fast else CALLS:
        cache = work.cache()
        count = work.folder / f"{cache.name}.count"
        count.touch()
        kill = f'[ "$(wc -l < {count})" -eq {n} ] && kill -9 $PPID'
        body = f'{kill}; exec gcc "$@"' if when == "before" else f'gcc "$@"; status=$?; {kill}; exit $status'
        compiler = script(work.folder / f"{cache.name}.cc", f"echo x >> {count}\n{body}")
        yield work.try_fault(
            f"kill -9 {when} command {n} of the compiler", cache, code=LIBRARY, changes={"CC": compiler}
        )


def killed_at_each_change(work: Work, fast: bool) -> Iterator[Result]:
    """A build that dies at its n-th change of the cache, for every n until it is through."""
    for what, code, step in (("a build", BUILD, 9 if fast else 1), ("a model file", WHOLE, 4)):
        if fast and code is WHOLE:
            return
        n = 1
        while True:
            cache = work.cache()
            result = work.try_fault(f"kill -9 at change {n} of {what}", cache, code=code, before=AT_CHANGE.format(n=n))
            Cache(cache).sweep(grace=-1.0)
            left = [path.name for path in (cache / "attempts").iterdir()] if (cache / "attempts").is_dir() else []
            if left:
                result = Result(result.fault, result.outcome, Outcome(f"left {left}"))
            yield result
            shutil.rmtree(cache)
            if result.outcome.word != "killed":
                break
            n += step


def many_at_once(work: Work, fast: bool) -> Iterator[Result]:
    """Twenty processes build the same: nothing there yet; something damaged there; some of them killed meanwhile."""
    for kind in ("nothing", "damaged") if fast else ("nothing", "damaged", "killed"):
        cache = work.cache(built=kind == "damaged")
        if kind == "damaged":
            (cache / "entries" / work.artifact.key / work.artifact.path.name).write_bytes(b"damaged")
        chance = random.Random(1)
        deaths = [chance.randrange(1, 40) if kind == "killed" and k % 2 else 0 for k in range(PROCESSES)]

        def run(death: int, cache: Path = cache) -> Outcome:
            return work.run(cache, before=AT_CHANGE.format(n=death) if death else "")

        with ThreadPoolExecutor(PROCESSES) as pool:
            outcomes = list(pool.map(run, deaths))
        bad = [o for o in outcomes if o.word not in ("right", "killed")]
        alive = [o for o, death in zip(outcomes, deaths, strict=True) if not death and o.word != "right"]
        after = work.run(cache)
        Cache(cache).sweep(grace=-1.0)
        left = list((cache / "attempts").iterdir())
        entries = [entry.kind for entry in Cache(cache).entries()].count("extension")
        if left or entries != 1:
            after = Outcome(f"{entries} entries, left {left}")
        yield Result(f"{PROCESSES} processes, {kind} before", (bad + alive + [Outcome("right")])[0], after)


def _cut(length: Callable[[int], int]) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(path.read_bytes()[: length(path.stat().st_size)])


def _flip(where: float) -> Callable[[Path], None]:
    def flip(path: Path) -> None:
        data = bytearray(path.read_bytes())
        data[int(where * (len(data) - 1))] ^= 16
        path.write_bytes(data)

    return flip


def _replace(make: Callable[[Path], object]) -> Callable[[Path], None]:
    def replace(path: Path) -> None:
        path.unlink()
        make(path)

    return replace


DAMAGES: dict[str, Callable[[Path], None]] = {
    "cut to nothing": _cut(lambda n: 0), "cut to 1 byte": _cut(lambda n: 1), "cut to half": _cut(lambda n: n // 2),
    "cut by 1 byte": _cut(lambda n: n - 1), "a bit flipped at the start": _flip(0.0), "in the middle": _flip(0.5),
    "at the end": _flip(1.0), "a byte longer": lambda path: path.open("ab").write(b"x") and None,
    "removed": Path.unlink, "made a folder": _replace(Path.mkdir), "made a link": _replace(
        lambda path: path.symlink_to("/etc/passwd")), "made a pipe": _replace(lambda path: os.mkfifo(path, 0o600)),
}  # fmt: skip
FEW = ("cut to nothing", "cut to half", "cut by 1 byte", "in the middle", "made a pipe")


def damaged_entries(work: Work, fast: bool) -> Iterator[Result]:
    """Every file of a build under every damage: made again, the same to the last byte."""
    cache = work.cache(built=True)
    entry = cache / "entries" / work.artifact.key
    files = sorted(path.relative_to(entry) for path in entry.rglob("*") if path.is_file())
    good = {file: (entry / file).read_bytes() for file in files}
    whole = [file for file in files if file.name != "manifest.json"]  # which holds the time

    def again() -> Outcome:
        with environment(EOMGEN_CACHE_DIR=str(cache)):
            try:
                compile_sources(work.sources, "pendulum")
            except EomgenError as error:
                return Outcome("named", str(error))
        changed = [str(file) for file in whole if (entry / file).read_bytes() != good[file]]
        return Outcome(f"other bytes in {changed}" if changed else "right")

    for file in files:
        for name in FEW if fast else DAMAGES:
            if fast and file.suffix == ".h":
                continue
            DAMAGES[name](entry / file)
            yield Result(f"{file}: {name}", again(), again())


def damaged_kept(work: Work, fast: bool) -> Iterator[Result]:
    """Bytecode of templates, notes of builds and texts of the NumPy target under every damage."""
    cache = work.cache()
    for target in ("cython", "numpy"):
        work.run(cache, WHOLE, target=target)
        entries = {entry.kind: entry.directory for entry in Cache(cache).entries()}
        built = next((path for kind, path in entries.items() if kind == "extension"), cache)
        for name in FEW[1:2] if fast else DAMAGES:
            if target == "numpy":
                places = [entries["numpy"] / "_core.py", entries["numpy"] / "manifest.json"]
            else:
                places = [*sorted((cache / "shortcuts").iterdir())[:1], *sorted((cache / "templates").iterdir())[:3]]
            for place in places[:1] if fast else places:
                if place.is_dir():  # what is kept goes on without this file
                    place.rmdir()
                if not place.is_file():
                    shutil.rmtree(built, ignore_errors=True)  # so that all is made again
                    work.run(cache, WHOLE, target=target)
                DAMAGES[name](place)
                if place.parent.name == "templates":
                    shutil.rmtree(built)  # so that the template is needed
                yield work.try_fault(
                    f"{place.parent.name[:9]}/{place.name[:9]}: {name}", cache, code=WHOLE, target=target
                )


def damaged_layer(work: Work, fast: bool) -> Iterator[Result]:
    """Objects of the Cython layer, which takes half a minute to build again."""
    for name in () if fast else ("cut to nothing", "in the middle", "removed"):
        cache = work.cache()
        (layer,) = (entry.directory for entry in Cache(cache).entries())
        DAMAGES[name](layer / "_core.o")
        yield work.try_fault(f"layer: _core.o {name}", cache, patience=300.0)
