"""Faults of places: foreign and open folders, full and read-only disks, odd environments, clocks."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from foreign import STRANGER
from hostile.fault_work import BUILD, WHOLE, Outcome, Result, Work

from eomgen.compilation import Cache

#: Lets a process that is not root see a file as another user's.
SEEN = """
from eomgen.files import ownership
judge, shown = ownership._require_own, os.lstat({path!r}).st_ino
ownership._require_own = lambda path, status, above: judge(path, os.stat_result(
    (*status[:4], {owner}, *status[5:])) if status.st_ino == shown else status, above=above)
"""


def foreign_places(work: Work, fast: bool) -> Iterator[Result]:
    """Every folder and file of a cache, and a folder above, given to another user or opened to all: never loaded."""
    above = work.folder / "above"
    cache = work.cache(above / "cache", built=True)
    above.chmod(0o700)
    work.run(cache, WHOLE)
    entry = cache / "entries" / work.artifact.key
    built = [above, cache, cache / "entries", entry, work_product(entry), entry / "manifest.json", entry / "sources"]
    places = [(path, BUILD) for path in built]
    if not fast:
        places += [(path, BUILD) for path in (entry / "sources" / "pendulum.c", cache / "attempts")]
        notes = [cache / "shortcuts", *(cache / "shortcuts").iterdir()]
        places += [(path, WHOLE) for path in notes]
    for path, code in places:
        status = path.stat()
        name = path.relative_to(work.folder)
        shown = "/".join(part[:12] for part in name.parts[1:]) or "the folder above"
        before = ""
        if os.geteuid() == 0:
            os.chown(path, STRANGER, -1)
        else:
            before = SEEN.format(path=str(path), owner=STRANGER)
        result = work.try_fault(f"{shown} belongs to another user", cache, code=code, before=before,
                                mend=lambda path=path, status=status: os.chown(path, status.st_uid, -1))  # fmt: skip
        yield _must_be_named(result)
        for mode in (0o777,) * (path.name == "entries") if fast else (0o777, 0o722, 0o770):
            path.chmod(mode)

            def mend(path: Path = path, mode: int = status.st_mode & 0o7777) -> None:
                path.chmod(mode)

            result = work.try_fault(f"{shown} has mode {mode:o}", cache, code=code, mend=mend)
            private = mode == 0o770 and path == above and os.geteuid() != 0
            yield result if private else _must_be_named(result)
    link = above / "link"
    link.symlink_to(cache)
    if os.geteuid() == 0:
        os.lchown(link, STRANGER, -1)
        yield _must_be_named(work.try_fault("a link of another user leads to the cache", link, later=cache))
        os.lchown(link, 0, -1)
    yield work.try_fault("an own link leads to the cache", link)


def work_product(entry: Path) -> Path:
    """The library in an entry."""
    return next(path for path in entry.iterdir() if path.name.startswith("_core"))


def _must_be_named(result: Result) -> Result:
    named = result.outcome.word == "named" and "EOMGEN_CACHE_DIR" in result.outcome.said
    return result if named else Result(result.fault, Outcome(f"taken: {result.outcome}"), result.after)


LIMIT = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({size}, {size}))
"""


def full_disks(work: Work, fast: bool) -> Iterator[Result]:
    """Files that cannot grow beyond a size, compilers' included; a full disk, where one can be had."""
    for size in (0, 1000) if fast else (0, 1, 100, 1000, 10_000, 20_000, 50_000, 100_000, 200_000):
        yield work.try_fault(f"no file beyond {size} bytes", work.cache(), before=LIMIT.format(size=size))
        if not fast:
            for target in ("cython", "numpy"):
                yield work.try_fault(f"no file beyond {size} bytes, model file, {target}", work.cache(), code=WHOLE,
                                     target=target, before=LIMIT.format(size=size))  # fmt: skip
    for spare in () if fast else (0, 4, 40, 200, 600):
        disk = work.folder / f"disk{spare}"
        with _disk(disk) as mounted:
            if not mounted:
                continue
            cache = work.cache(disk / "cache")
            free = os.statvfs(disk).f_bavail * os.statvfs(disk).f_bsize
            filler = disk / "filler"
            filler.write_bytes(b"x" * max(free - spare * 1024, 0))
            yield work.try_fault(f"a disk with {spare} kB left", cache, mend=filler.unlink)
    root = work.cache(built=True)
    for name in ("attempts", "entries") if not fast else ("attempts",):
        shutil.rmtree(root / name, ignore_errors=name == "attempts")
        (root / name).write_text("in the way, as a read-only folder is for any user but root")
        yield work.try_fault(f"{name} cannot be made", root, mend=(root / name).unlink, later=work.cache())


@contextmanager
def _disk(place: Path) -> Iterator[bool]:
    """A small disk of its own; False where none can be mounted."""
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=8m,mode=700", "tmpfs", str(place)]
    mounted = bool(shutil.which("mount")) and subprocess.run(command, capture_output=True, check=False).returncode == 0
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(place)], check=True)


ODD = {
    "an accent and a surrogate": b"\xc3\xa9\xff", "spaces and quotes": b" a 'b\" ", "a newline": b"a\nb",
    "the end of a comment": b"a*", "shell words": b"$(x);&|`y`%s", "a backslash at its end": b"a\\",
    "a hash and a colon": b"#a:b", "a leading dash": b"-o", "200 letters": b"x" * 200,
}  # fmt: skip
LOCALES = {
    "C": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    "POSIX": {"LANG": "POSIX", "LC_ALL": None, "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    "none such": {"LC_ALL": "xx_YY.nothing", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    "UTF-8": {"LC_ALL": "C.UTF-8"},
}


def odd_places(work: Work, fast: bool) -> Iterator[Result]:
    """Caches with odd names under odd locales."""
    few = ("an accent and a surrogate", "the end of a comment")
    for name, place in ODD.items():
        if fast and name not in few:
            continue
        for locale, changes in LOCALES.items():
            if locale != "C" and (fast or name != few[0]):
                continue
            cache = work.cache(Path(os.fsdecode(os.fsencode(work.folder) + b"/%d/" % work.count + place + b"/c")))
            for code in (BUILD,) if fast else (BUILD, WHOLE):
                yield work.try_fault(f"{name} in the path, locale {locale}", cache, code=code, changes=changes)
            again = work.run(cache, changes=changes)
            yield Result(f"{name} in the path, locale {locale}, from the cache", again, again)
    if not fast:
        cache = work.folder / "l\u00e9 '\"\n*" / "c"  # the layer, too, is built here
        cache.parent.mkdir()
        changes = {**LOCALES["C"]}
        yield work.try_fault("all of it in the path, the layer too", cache, changes=changes, patience=300.0)


def odd_environments(work: Work, fast: bool) -> Iterator[Result]:
    """No home, no folder for temporary files, no path, few files, closed streams, strange rights of new files."""
    cases: dict[str, tuple[dict[str, str | None], str]] = {
        "no TMPDIR": ({"TMPDIR": "/nowhere/at/all"}, ""),
        "an empty TMPDIR": ({"TMPDIR": ""}, ""),
        "no PATH": ({"PATH": ""}, ""),
        "no current folder": ({}, "import tempfile; os.chdir(tempfile.mkdtemp()); os.rmdir(os.getcwd())"),
        "closed streams": ({}, "os.close(0); os.close(1); os.close(2)"),
        "umask 0": ({}, "os.umask(0)"),
        "umask 777": ({}, "os.umask(0o777)"),
        "umask 002": ({}, "os.umask(2)"),
        "8 open files": ({}, "import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (8, 8))"),
        "20 open files": ({}, "import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (20, 20))"),
        "no bytecode": ({"PYTHONDONTWRITEBYTECODE": "1"}, ""),
        "optimised Python": ({"PYTHONOPTIMIZE": "2"}, ""),
        "hash seed": ({"PYTHONHASHSEED": "1"}, ""),
    }  # fmt: skip
    for name, (changes, before) in cases.items():
        if fast and name not in ("no TMPDIR", "umask 0", "no current folder"):
            continue
        yield work.try_fault(name, work.cache(), changes=changes, before=before)
    nothing: dict[str, str | None] = {"EOMGEN_CACHE_DIR": None, "XDG_CACHE_HOME": None}
    homes: dict[str, dict[str, str | None]] = {
        "a home that is a file": {"HOME": "/etc/passwd"}, "a home in /proc": {"HOME": "/proc/nowhere"},
        "a cache of no user": {"EOMGEN_CACHE_DIR": "~nobody_of_this_name/cache"},
        "a cache in a file": {"EOMGEN_CACHE_DIR": "/etc/passwd/cache"},
        "a cache in /dev/null": {"EOMGEN_CACHE_DIR": "/dev/null"},
        "a cache with too long a name": {"EOMGEN_CACHE_DIR": "/tmp/" + "x" * 300},
        "a cache with too long a path": {"EOMGEN_CACHE_DIR": "/tmp" + "/x" * 3000},
    }  # fmt: skip
    for name, changes in homes.items():
        if fast and name not in ("a home that is a file", "a cache of no user"):
            continue
        yield work.try_fault(name, "unused", changes={**nothing, **changes}, later=work.cache())
    lost = "import pwd; os.environ.pop('HOME', None); pwd.getpwuid = lambda uid: {}['nobody']"
    yield work.try_fault("no home at all", "unused", changes=nothing, before=lost, later=work.cache())


SHIFT = "import time; clock = time.time; time.time = lambda: clock() + {shift}"


def wrong_clocks(work: Work, fast: bool) -> Iterator[Result]:
    """Times of files in 1970 and in the future, clocks that jump while a build goes on."""
    now = time.time()
    for name, moment in (("1970", 0.0), ("in 30 years", now + 1e9)):
        cache = work.cache(built=True)
        (cache / "attempts" / "left").mkdir(parents=True, mode=0o700)
        (cache / "attempts").chmod(0o700)
        for path in [*cache.rglob("*"), cache]:
            os.utime(path, (moment, moment))
        yield work.try_fault(f"every file is of {name}", cache)
        built = Cache(cache)
        built.prune(older_than=3600.0)
        kept = [entry.kind for entry in built.entries()]
        swept = built.sweep() + (0 if (cache / "attempts" / "left").exists() else 1)
        well = swept and (not kept or name != "1970" or kept == ["extension"])
        yield Result(f"prune and sweep after {name}", Outcome("right" if well else f"kept {kept}, swept {swept}"),
                     work.run(work.cache()))  # fmt: skip
    for shift in (-1e9, 1e9) if not fast else (1e9,):
        yield work.try_fault(f"a clock {shift:+.0e} s off", work.cache(), before=SHIFT.format(shift=shift))
    cache = work.cache()
    with Cache(cache).attempt("0" * 64) as attempt, pytest.MonkeyPatch.context() as patch:
        patch.setattr(time, "time", lambda: now + 1e6)
        swept = Cache(cache).sweep()
        word = "right" if attempt.is_dir() and not swept else "a build of another process was swept away"
    yield Result("the clock jumps while another process builds", Outcome(word), work.run(cache))
