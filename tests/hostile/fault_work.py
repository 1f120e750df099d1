"""Faults of machines: one build, a fault, what came of it, and whether the next run is well again.

A fault is survived if the run gives the right numbers, or stops with an error of eomgen's own, and if the run after it,
with the fault gone, gives the right numbers.  Anything else is a breach: another number, a traceback, a crash, a hang.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from eomgen.compilation import Cache, compile_c_library, compile_sources, load_core
from eomgen.emit.sources import read_template

TESTS = Path(__file__).parents[1]
MODEL = TESTS / "compilation" / "model"
YAML = TESTS.parent / "examples" / "pendulum.yaml"
PATIENCE = 90.0  #: seconds after which a run hangs
KILLED = -signal.SIGKILL

_FRAME = """
import os, pathlib, sys
def tell(text):
    os.write(int(os.environ["EOMGEN_TOLD"]), text.encode("utf-8", "replace"))
{{before}}
from eomgen.errors import EomgenError
try:
{body}
    {{after}}
    tell("VALUE %.17g" % value)
except EomgenError as error:
    tell("NAMED %s: %s" % (type(error).__name__, error))
"""
_SOURCES = """
    folder = pathlib.Path({folder!r})
    sources = {{f.name: f.read_text() for f in sorted(folder.iterdir())}}
"""
#: What runs in a process of its own: builds the pendulum and tells its acceleration, or an error of eomgen's own.
BUILD = _FRAME.format(body=_SOURCES + """
    from eomgen.compilation import compile_sources, load_core
    core = load_core(compile_sources(sources, "pendulum"))
    value = float(core.timed("rhs", core.context(), (2,), print)(0.0, [0.5, 0.25])[1])
""")  # fmt: skip
#: The same as a library for C, which needs no layer; tells m l^2.
LIBRARY = _FRAME.format(body=_SOURCES + """
    import ctypes
    from eomgen.compilation import compile_c_library
    library = ctypes.CDLL(str(compile_c_library(sources, "pendulum").path))
    found = (ctypes.c_double * 5)()
    library.pendulum_precompute((ctypes.c_double * 3)(2.0, 0.5, 10.0), found)
    value = found[3]
""")  # fmt: skip
#: From a model file: derivation, templates, notes, the rest.
WHOLE = _FRAME.format(
    body="""
    import eomgen as eg
    module = eg.load({folder!r}).compile(target={target!r})
    value = float(module.rhs(0.0, [0.5, 0.25])[1])
"""
)


@dataclass(frozen=True)
class Outcome:
    """What a run came to: ``right``, ``named`` (an error of eomgen's own), ``killed``, or a breach, in words."""

    word: str
    said: str = ""

    @property
    def breach(self) -> bool:
        return self.word not in ("right", "named", "killed")


@dataclass(frozen=True)
class Result:
    """A fault, what the run came to, and the run after it."""

    fault: str
    outcome: Outcome
    after: Outcome

    @property
    def survived(self) -> bool:
        return not self.outcome.breach and self.after.word == "right"


class Work:
    """A folder with sources and caches that have the Cython layer, which takes half a minute to build.

    Parameters
    ----------
    folder : Path
        For everything that is made.
    layer : Path
        A cache that has the layer, or will have it.
    pythons : sequence of str
        Other interpreters that have what eomgen needs.
    """

    def __init__(self, folder: Path, layer: Path, pythons: Sequence[str] = ()) -> None:
        self.folder, self.layer, self.count, self.pythons = folder, layer, 0, tuple(pythons)
        self.sources = {f.name: f.read_text() for f in sorted(MODEL.iterdir())}
        self.sources["eomgen.h"] = read_template("c/eomgen.h")
        self.texts = folder / "texts"
        self.texts.mkdir()
        for name, text in self.sources.items():
            (self.texts / name).write_text(text)
        with environment(EOMGEN_CACHE_DIR=str(layer)):
            self.artifact = compile_sources(self.sources, "pendulum")
            self.library = compile_c_library(self.sources, "pendulum")
            core = load_core(self.artifact)
        refuse: Callable[..., None] = print
        value = float(core.timed("rhs", core.context(), (2,), refuse)(0.0, [0.5, 0.25])[1])
        self.values = {BUILD: value, LIBRARY: 0.5, WHOLE: -9.81 * 0.479425538604203}  # of the example, g / l = 9.81

    def cache(self, place: Path | None = None, *, built: bool = False) -> Path:
        """A new cache with the layer, and with the pendulum if it shall be built already."""
        self.count += 1
        root = place or self.folder / f"cache{self.count}"
        (root / "entries").mkdir(parents=True)
        for part in (root, root / "entries"):
            part.chmod(0o700)
        for entry in Cache(self.layer).entries():
            if entry.kind == "layer" or (built and entry.key == self.artifact.key):
                shutil.copytree(entry.directory, root / "entries" / entry.directory.name)
        return root

    def run(
        self, cache: Path | str, code: str = BUILD, before: str = "", after: str = "pass", target: str = "cython",
        changes: Mapping[str, str | None] | None = None, patience: float = PATIENCE, python: str = sys.executable,
        factor: float = 1.0,
    ) -> Outcome:  # fmt: skip
        """Build and evaluate in another process; ``changes`` are of its environment, None removes.

        ``factor`` is what the value has to be multiplied with to be right, where another version of eomgen runs.
        """
        folder = str(YAML if code is WHOLE else self.texts)
        text = code.format(before=before, after=after, folder=folder, target=target)
        return judge([python, "-c", text], self._environment(cache, changes), patience,
                     factor * self.values[code])  # fmt: skip

    def try_fault(
        self, fault: str, cache: Path | str, *, code: str = BUILD, target: str = "cython", before: str = "",
        after: str = "pass", changes: Mapping[str, str | None] | None = None, mend: Callable[[], object] = lambda: None,
        patience: float = PATIENCE, later: Path | None = None,
    ) -> Result:  # fmt: skip
        """One run under a fault, and one after it, on another cache if the first can be none."""
        try:
            outcome = self.run(cache, code, before, after, target, changes, patience)
        finally:
            mend()
        return Result(fault, outcome, self.run(later or cache, code, target=target))

    def _environment(self, cache: Path | str, changes: Mapping[str, str | None] | None) -> dict[str, str]:
        found = {**os.environ, "EOMGEN_CACHE_DIR": str(cache), "PYTHONPATH": str(TESTS.parent)}
        found.pop("CC", None)
        for name, value in (changes or {}).items():
            if value is None:
                found.pop(name, None)
            else:
                found[name] = value
        return found


def judge(command: Sequence[str], env: Mapping[str, str], patience: float, expected: float, **how: object) -> Outcome:
    """Run a command and say what came of it."""
    tell, told = os.pipe()
    start = time.monotonic()
    with subprocess.Popen(
        command, env={**env, "EOMGEN_TOLD": str(told)}, pass_fds=(told,),
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True, **how,  # type: ignore[call-overload]
    ) as process:  # fmt: skip
        os.close(told)
        try:
            err = process.communicate(timeout=patience)[1].decode("utf-8", "replace")
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            os.close(tell)
            return Outcome(f"hangs for {time.monotonic() - start:.0f} s")
    with open(tell, "rb") as stream:
        said = stream.read().decode("utf-8", "replace")
    if process.returncode == KILLED:
        return Outcome("killed")
    if "Traceback" in err or process.returncode != 0:
        return Outcome(f"exit {process.returncode}: {err.strip()[-600:]}", said)
    word, _, rest = said.partition(" ")
    if word == "NAMED":
        return Outcome("named", rest)
    if word == "VALUE":
        return Outcome("right") if abs(float(rest) - expected) <= 1e-12 else Outcome(f"wrong number {rest}")
    return Outcome(f"no answer: {said!r} {err[-300:]}")


@contextmanager
def environment(**values: str) -> Iterator[None]:
    """Variables of the environment for a while."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def script(path: Path, text: str) -> str:
    """An executable shell script."""
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return str(path)
