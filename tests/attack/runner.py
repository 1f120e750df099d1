"""One case run under the guard and its limits -> what came out, with a key that is the same for the same fault.

A case is a text, or a tree of dicts, lists, texts and numbers that JSON can write; a kind of attack makes it from a
seed, and gives it to the package.
"""

import gc
import importlib.metadata
import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from attack.guard import PACKAGE, Escape, Guard

import eomgen as eg

SECONDS = 20.0  #: processor time of one case
BUILDING = 1.0  #: processor time for making the object that is given
MEMORY = 2 << 30  #: bytes that a process may hold
#: Outcomes that are findings; fine, named error and refused are not.
FINDINGS = ("escape", "traceback", "hang", "memory", "crash", "warning", "wrong")
#: Files of the generated modules, as tracebacks name those of machine code.
GENERATED = frozenset(path.name for path in Path(PACKAGE, "native").glob("*.px*"))
#: What is said of arguments that do not fit a signature.
MISFIT = re.compile(
    r"takes (no|exactly|at least|at most) |unexpected keyword|multiple values|needs keyword|missing \d+ req"
)
#: Name of a kind -> the module of this folder that holds it in ``KINDS``.
MODULES = {
    "expressions": "expressions",
    "yaml": "yaml_files",
    "sympy": "sympy_objects",
    "calls": "calls",
    "command_lines": "command_lines",
    "urdf": "robot_files",
    "mjcf": "robot_files",
    "meshes": "robot_files",
}
ANOTHER = 1 << 40  #: from the seed of a case that cannot be written down to the next one tried


class Hang(BaseException):
    """The alarm; no Exception, so that no handler takes it for a failure."""


class Wrong(Exception):
    """An answer that is no exception and yet wrong; the message says what, in few words that name its kind."""


class Outcome(NamedTuple):
    """What came out of a case."""

    kind: str  #: fine, named error, refused, or one of FINDINGS
    detail: str  #: the word of the kind, or the class of the error
    key: str = ""  #: the same for the same fault; empty unless it is a finding
    text: str = ""  #: traceback or message of a finding
    seconds: float = 0.0


class Kind:
    """One kind of attack."""

    name = ""
    #: Programs that the package may start for such a case, by the last part of their path.
    programs: frozenset[str] = frozenset()
    #: Warnings that speak of what was built, not of what the package did with it.
    unjudged: tuple[type[Warning], ...] = ()

    def prepare(self, folder: Path) -> None:
        """Import and compile what the cases need, once in each process, before the guard is armed."""

    def make(self, r: random.Random) -> Any:
        """A case; the same one for the same state of ``r``."""
        raise NotImplementedError

    def build(self, case: Any) -> Any:
        """What is given to the package: most often the case itself.  What fails here is not the package's."""
        return case

    def run(self, given: Any, folder: Path) -> str:
        """Give what was built to the package, in ``folder``, the working directory, where all its files have to stay.

        Returns a word or two on what came out.  An EomgenError is a named error; raise :class:`Wrong` for an answer that
        is no exception and yet wrong.  Anything else is a finding.
        """
        raise NotImplementedError


def find(name: str) -> Kind:
    """The kind of a name."""
    kinds: dict[str, Kind] = import_module(f"attack.{MODULES[name]}").KINDS
    return kinds[name]


def make(kind: Kind, seed: int) -> Any:
    """The case of a seed; where it is nested too deeply to be written down, another one."""
    while True:
        try:
            return kind.make(random.Random(f"{kind.name} {seed}"))
        except RecursionError:
            seed += ANOTHER


def kept(path: Path) -> Any:
    """The case of a file: a text as ``.txt``, a tree as ``.json``."""
    with path.open(encoding="utf-8", errors="surrogatepass", newline="") as file:
        text = file.read()
    return json.loads(text) if path.suffix == ".json" else text


def _load_libraries() -> None:
    """What looks through the machine when it is first used: fonts, the registry of units, installed packages."""
    model = eg.Model("first")
    model.parameter("m", value=1, unit="lb")
    model.revolute("hinge", model.ground, model.body("rod", mass="m", com=(0, 1, 0)), coordinate="q")
    assert "no picture" not in model._repr_html_()
    importlib.metadata.version("eomgen")


class Runner:
    """Runs cases of any kind in this process, in a folder that is emptied when a case left something behind."""

    def __init__(self, folder: Path, cache: Path) -> None:
        self.home = folder
        self.folder = folder / "case"
        self.folder.mkdir(parents=True, exist_ok=True)
        os.environ.update(EOMGEN_CACHE_DIR=str(cache), TMPDIR=str(self.folder), HOME=str(self.folder))
        tempfile.tempdir = str(self.folder)
        self.guard = Guard(str(self.folder), str(cache))
        self.warned: list[str] = []
        self.prepared: set[str] = set()
        _load_libraries()
        sys.unraisablehook = self.ignored
        os.chdir(self.folder)
        signal.signal(signal.SIGPROF, _alarm)

    def ignored(self, args: Any) -> None:
        """Note an error that a destructor lost; the alarm rings again."""
        if args.exc_type is not Hang:
            self.warned.append(f"ignored {args.exc_type.__name__}")

    def limit(self) -> None:
        """Memory beyond what is mapped already is limited from here on."""
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))

    def prepare(self, kind: Kind) -> None:
        """What a kind needs before its first case."""
        if kind.name not in self.prepared:
            kind.prepare(self.home)
            self.prepared.add(kind.name)
            gc.collect()
            gc.freeze()
        # for each kind again: libraries that load late change the filters
        warnings.resetwarnings()
        warnings.simplefilter("always")
        for category in kind.unjudged:
            warnings.simplefilter("ignore", category)
        warnings.showwarning = lambda message, category, *_: self.warned.append(f"{category.__name__}: {message}")

    def run(self, kind: Kind, case: Any) -> Outcome:
        """One case."""
        guard = self.guard
        self.warned.clear()
        guard.escapes.clear()
        guard.programs = kind.programs
        start = time.perf_counter()
        signal.setitimer(signal.ITIMER_PROF, BUILDING, 1.0)
        try:
            found = self._given(kind, case)
        except eg.EomgenError as error:
            found = Outcome("named error", type(error).__name__)
        except BaseException as error:
            found = judge(error)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
        seconds = time.perf_counter() - start
        if guard.escapes:  # also where a handler swallowed it
            found = Outcome("escape", guard.escapes[0], f"escape {_plain(guard.escapes[0])}", found.text)
        elif self.warned and found.kind not in FINDINGS:
            found = Outcome("warning", self.warned[0], f"warning {_plain(self.warned[0])}", self.warned[0])
        self.tidy()
        return found._replace(seconds=seconds)

    def _given(self, kind: Kind, case: Any) -> Outcome:
        """What the package answers."""
        try:
            given = kind.build(case)
        except (Exception, Hang):
            self.warned.clear()  # by what the case is built of
            return Outcome("refused", "not built")
        self.warned.clear()
        signal.setitimer(signal.ITIMER_PROF, SECONDS, 1.0)  # again each second, in case a handler swallows it
        try:
            self.guard.armed = True
            return Outcome("fine", kind.run(given, self.folder))
        finally:
            self.guard.armed = False

    def tidy(self) -> None:
        """Empty the folder of the case."""
        os.chdir(self.folder)
        for entry in os.scandir(self.folder):
            if entry.is_dir(follow_symlinks=False):
                shutil.rmtree(entry.path, ignore_errors=True)
            else:
                os.unlink(entry.path)


def _alarm(number: int, frame: FrameType | None) -> None:
    raise Hang


def judge(error: BaseException) -> Outcome:
    """The outcome of an exception that is no named error."""
    if isinstance(error, KeyboardInterrupt) and not isinstance(error, eg.EomgenError):
        raise error
    text = "".join(traceback.format_exception(error))[-4000:]
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if f.filename.startswith(str(PACKAGE)) or f.filename in GENERATED]
    if isinstance(error, Wrong):
        return Outcome("wrong", str(error), f"wrong {_plain(str(error))}", text)
    if isinstance(error, Escape):
        return Outcome("escape", str(error), f"escape {_plain(str(error))}", text)
    name = type(error).__name__
    place = f"{own[-1].filename.removeprefix(f'{PACKAGE}/')}:{own[-1].name}" if own else "outside the package"
    if isinstance(error, Hang):
        return Outcome("hang", place, f"hang {place}", text)
    if isinstance(error, MemoryError):
        return Outcome("memory", place, f"memory {place}", text)
    if not own or (isinstance(error, TypeError) and _misfit(str(error), own)):
        return Outcome("refused", name)  # by Python, NumPy or SymPy before the package was asked
    last = frames[-1] if frames else None
    inner = f" in {Path(last.filename).name}:{last.name}" if last is not None and last not in own else ""
    return Outcome("traceback", f"{name} {place}", f"{name} {place}{inner}", text)


def _misfit(text: str, own: list[traceback.FrameSummary]) -> bool:
    """Whether a call did not fit the signature of what the user calls, which may leave a frame where Python leaves none."""
    return (len(own) == 1 or all(f.filename in GENERATED for f in own)) and MISFIT.search(text) is not None


def _plain(text: str) -> str:
    """A message without what differs from case to case."""
    return re.sub(r"'[^']*'|\"[^\"]*\"|\d+", "#", text)[:100]
