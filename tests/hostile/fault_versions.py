"""Faults of versions: several versions of eomgen, of Python and of NumPy on one cache, in turns and at once."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from hostile.fault_work import BUILD, LIBRARY, TESTS, WHOLE, Outcome, Result, Work, environment

from eomgen.compilation import Cache, compile_sources

FORMAT = "from eomgen.compilation import cache as c; c.FORMAT = {value}"
PYTHON = (
    "from eomgen.compilation import cython_layer as y, build as b; real = y.describe_interpreter\n"
    "y.describe_interpreter = b.describe_interpreter = lambda: {{**real(), {what!r}: {value!r}}}"
)


PROCESSES = 20


def other_versions(work: Work, fast: bool) -> Iterator[Result]:
    """Other versions of eomgen, Python and NumPy on one cache, in turns: each has builds of its own."""
    cache = work.cache(built=True)
    entry = cache / "entries" / work.artifact.key
    (entry / "manifest.json").write_text(json.dumps({"key": work.artifact.key, "files": {}}))  # before seals
    yield work.try_fault("an entry of an earlier version under this key", cache)
    (cache / "templates").mkdir(mode=0o700, exist_ok=True)
    (cache / "templates" / "__jinja2_x.cache").write_bytes(b"j2 of another version")
    yield work.try_fault("bytecode of an earlier version", cache, code=WHOLE)
    changes = [("eomgen", LIBRARY, FORMAT.format(value=99))]
    changes += [] if fast else [
        ("eomgen, with its layer", BUILD, FORMAT.format(value=99)),
        ("Python", BUILD, PYTHON.format(what="tag", value="cpython-399")),
        ("NumPy", BUILD, PYTHON.format(what="numpy", value="9.9")),
    ]  # fmt: skip
    for name, code, before in changes:
        own = work.run(cache, code)
        count = len(Cache(cache).entries())
        outcome = work.run(cache, code, before=before, patience=300.0)
        more = len(Cache(cache).entries()) - count
        with environment(EOMGEN_CACHE_DIR=str(cache)):
            found = compile_sources(work.sources, "pendulum")
        if own.word != "right" or more == 0 or found.key != work.artifact.key or not found.from_cache:
            outcome = Outcome(f"{own}, {more} builds more, key {found.key}, from the cache: {found.from_cache}")
        yield Result(f"another version of {name}", outcome, work.run(cache, code))


#: What a changed version has elsewhere: text -> text.
SINE = "*sine = (pack)(", "*sine = -(pack)("
PATTERN = 'c="sine_of({})"', 'c="sine_of({})", numpy="(-np.sin({}))"'


class Version(NamedTuple):
    """Which Python runs which eomgen."""

    name: str
    python: str
    home: Path  #: the folder that its eomgen lies in
    factor: float  #: of its accelerations
    before: str = ""

    def run(self, work: Work, cache: Path, target: str) -> Outcome:
        """Derive, build and evaluate the pendulum; a core of another version is a breach whatever its number is."""
        after = "assert module.metadata['eomgen'] == eg.__version__, module.metadata['eomgen']"
        changes: dict[str, str | None] = {"PYTHONPATH": str(self.home), "PYTHONDONTWRITEBYTECODE": "1"}
        changes["PYTHONSAFEPATH"] = "1"  # where tests run may lie another eomgen
        return work.run(cache, WHOLE, self.before, after, target, changes, 600.0, self.python, self.factor)


def copy_eomgen(folder: Path, changed: bool) -> Path:
    """A copy of eomgen that stands alone; a changed one has another version, and takes sines for their negatives.

    In C a template does so, for NumPy the table of operations: what either made must never serve the other.
    """
    root, package = TESTS.parent, folder / "eomgen"
    skipped = shutil.ignore_patterns("__pycache__")
    shutil.copytree(root / "eomgen", package, ignore=skipped)
    for name in ("templates", "examples"):
        shutil.copytree(root / name, package / name, ignore=skipped)
    if changed:
        _replace(package / "__init__.py", '__version__ = "', '__version__ = "9.')
        _replace(package / "templates" / "c" / "eomgen_sincos.h", *SINE)
        _replace(package / "operations" / "table.py", *PATTERN)
    return folder


def _replace(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert old in text, (file, old)
    file.write_text(text.replace(old, new), encoding="utf-8")


def versions_at_once(work: Work, fast: bool) -> Iterator[Result]:
    """Twenty processes of several versions on one new cache, then each version alone: one build for each of them."""
    plain = copy_eomgen(work.folder / "plain", changed=False)
    changed = copy_eomgen(work.folder / "changed", changed=True)
    fake = PYTHON.format(what="tag", value="cpython-399")
    two = [Version("eomgen", sys.executable, plain, 1.0), Version("eomgen 9", sys.executable, changed, -1.0)]
    others = [
        Version(f"{name} on {python}", python, home, factor)
        for python in work.pythons
        for name, home, factor in (("eomgen", plain, 1.0), ("eomgen 9", changed, -1.0))
    ]
    yield from _together(work, "two versions of eomgen", two + others, "numpy")
    if not fast:
        yield from _together(work, "two versions of eomgen", two, "cython")
        tags = [two[0], Version("another ABI", sys.executable, plain, 1.0, fake)]
        yield from _together(work, "two ABIs of Python", tags, "cython")
        if others:
            yield from _together(work, f"{len(work.pythons) + 1} Pythons, two eomgens", two + others, "cython")


def _together(work: Work, what: str, versions: Sequence[Version], target: str) -> Iterator[Result]:
    cache = work.folder / f"versions{work.count}"
    work.count += 1
    chosen = [versions[k % len(versions)] for k in range(PROCESSES)]
    with ThreadPoolExecutor(PROCESSES) as pool:
        outcomes = list(pool.map(lambda version: version.run(work, cache, target), chosen))
    bad = [f"{v.name}: {o}" for v, o in zip(chosen, outcomes, strict=True) if o.word != "right"]
    kinds = {"numpy": 2} if target == "numpy" else {"extension": len(versions)}  # a text serves every Python
    made = _count(cache, kinds)
    again = [version.run(work, cache, target) for version in (*versions, *reversed(versions))]
    bad_again = [o for o in again if o.word != "right"]
    Cache(cache).sweep(grace=-1.0)
    left = list((cache / "attempts").iterdir()) if (cache / "attempts").is_dir() else []
    if made != kinds or _count(cache, kinds) != kinds or left:
        bad_again.append(Outcome(f"{made}, then {_count(cache, kinds)} entries, left {left}"))
    outcome = Outcome("; ".join(bad) if bad else "right")
    yield Result(f"{what}, {PROCESSES} processes, {target}", outcome, [*bad_again, Outcome("right")][0])


def _count(cache: Path, kinds: dict[str, int]) -> dict[str, int]:
    found = [entry.kind for entry in Cache(cache).entries()]
    return {kind: found.count(kind) for kind in kinds}
