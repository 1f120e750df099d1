"""Compiler: environment and options -> which compiler there is, its flags, and what its commands print.

Each command runs in a process group of its own, which is killed with all that it started when its time is over, when
it prints without end, and when the work is given up (Ctrl-C, another file that does not compile).
"""

from __future__ import annotations

import importlib.util
import os
import platform
import shutil
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, TypeVar

from ..base.texts import quote
from ..base.value_rules import as_count, read_count
from ..errors import ToolchainError, ill_typed, no_choice, off_range

if TYPE_CHECKING:
    from subprocess import CompletedProcess, Popen

T = TypeVar("T")

# -- commands ----------------------------------------------------------------------------------------------------------

#: Seconds: to say a version; to compile or link, and per byte of source: twenty times what gcc takes for large models.
ANSWER, COMPILE, PER_BYTE = 15.0, 120.0, 1.5e-3
SECONDS = "EOMGEN_COMPILER_SECONDS"  #: environment variable that sets the seconds a command may take instead
OUTPUT = 16_000_000  #: bytes that a command may print
LINGER = 1.0  #: seconds in which what a finished command left running may still print


class Commands:
    """Commands of one build, which run in threads of :func:`run_all` and are ended together."""

    def __init__(self) -> None:
        from threading import Lock

        self._lock = Lock()
        self._running: set[Popen[bytes]] = set()
        self._stopped = False

    def run(
        self, command: Sequence[str], directory: Path | None = None, seconds: float = ANSWER, task: str = ""
    ) -> CompletedProcess[str]:
        """Run a command and collect what it prints, in English, both streams in one.

        The directory is for temporary files too, so that a killed compiler leaves nothing elsewhere.  The command may
        take so many seconds, unless EOMGEN_COMPILER_SECONDS says otherwise.  An exit status other than 0 is an error if
        it is said what the command is for, by ``task``.
        Raises ToolchainError (it cannot be started, takes longer, prints without end, or fails).
        """
        import shlex
        from subprocess import DEVNULL, PIPE, STDOUT, CompletedProcess, Popen

        seconds, line = _seconds() or seconds, shlex.join(command)
        environment = {**os.environ, "LC_ALL": "C", **({"TMPDIR": str(directory)} if directory else {})}
        with self._lock:  # what starts is known before stop() looks
            if self._stopped:
                raise ToolchainError(f"the command {line} was not started, because the work was cancelled", line)
            try:
                process = Popen(
                    command, cwd=directory, env=environment, stdin=DEVNULL, stdout=PIPE, stderr=STDOUT, process_group=0
                )
            except (OSError, ValueError) as error:  # ValueError: a NUL in a word
                message = f"the command {line} cannot be started: {error}"
                raise ToolchainError(message, line, code="EG-COMPILER-MISSING") from error
            self._running.add(process)
        with process:
            try:
                printed, excess = _listen(process, seconds)
            finally:
                with self._lock:
                    self._running.discard(process)
        output = printed.decode("utf-8", "replace").strip()
        if excess:
            message = f"the command {line} did not finish: it was stopped after {excess}. Try another compiler (set CC)"
            raise ToolchainError(message, line, output[:2000])
        if task and process.returncode:
            message = f"{task} failed (exit status {process.returncode}):\n{output}"
            raise ToolchainError(f"{message}\nThe command, run in {directory or Path.cwd()}:\n{line}", line, output)
        return CompletedProcess(command, process.returncode, output)

    def stop(self) -> None:
        """End the commands that run now, in whatever thread, and begin no other."""
        with self._lock:
            self._stopped = True
            for process in self._running:
                _kill(process)


def run_all(tasks: Sequence[Callable[[Commands], T]], jobs: int | None = None) -> list[T]:
    """Do tasks, some at a time; the first that fails, or Ctrl-C, ends the commands of the others.

    No command starts in the main thread: a signal there, while Popen waits, would leave a process that nobody knows of.
    """
    from concurrent.futures import ThreadPoolExecutor  # slow to import

    commands = Commands()
    with ThreadPoolExecutor(jobs or os.cpu_count() or 1) as pool:
        try:
            return list(pool.map(lambda task: task(commands), tasks))
        except BaseException:
            commands.stop()
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def run(
    command: Sequence[str], directory: Path | None = None, seconds: float = ANSWER, task: str = ""
) -> CompletedProcess[str]:
    """One command; see :meth:`Commands.run`."""
    return run_all([partial(Commands.run, command=command, directory=directory, seconds=seconds, task=task)], 1)[0]


def allowed(size: int) -> float:
    """Seconds that compiling sources of so many bytes may take."""
    return COMPILE + PER_BYTE * size


def _seconds() -> float | None:
    text = os.environ.get(SECONDS, "").strip()
    if not text:
        return None
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0.0 < seconds < float("inf"):
        raise off_range(f"{SECONDS} must be a positive number of seconds, not {text!r}")
    return seconds


def _listen(process: Popen[bytes], seconds: float) -> tuple[bytes, str]:
    """What a process prints until it ends, and after what it was killed, if it was.

    What it left behind with its output is given a moment more, and then killed.
    """
    import select
    from subprocess import TimeoutExpired
    from time import monotonic

    assert process.stdout is not None
    printed, end = bytearray(), monotonic() + seconds
    overdue = f"{seconds:g} s ({SECONDS} sets another limit)"
    while True:
        if select.select([process.stdout], [], [], 0.1)[0]:
            data = os.read(process.stdout.fileno(), 65536)
            if not data:
                break
            printed += data
        ended = process.poll() is not None
        end = min(end, monotonic() + LINGER) if ended else end
        if len(printed) > OUTPUT or monotonic() >= end:
            _kill(process)
            excess = "" if ended else overdue
            return bytes(printed), f"{OUTPUT / 1e6:g} MB of output" if len(printed) > OUTPUT else excess
    try:
        process.wait(max(end - monotonic(), LINGER))
    except TimeoutExpired:
        _kill(process)
        return bytes(printed), overdue
    return bytes(printed), ""


def _kill(process: Popen[bytes]) -> None:
    import signal

    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


# -- which compiler ----------------------------------------------------------------------------------------------------

REMEDIES = """\
Install one of these:
  Debian, Ubuntu: apt install gcc python3-dev
  Fedora: dnf install gcc python3-devel
  macOS: xcode-select --install
  anywhere, with pip: pip install ziglang
or set CC to the command of your compiler, or use target="numpy", which needs no compiler and runs slower."""


@dataclass(frozen=True, slots=True)
class CompilerInfo:
    """A C compiler that has answered."""

    path: str  #: the executable
    command: tuple[str, ...]  #: words that start every command line; the first is ``path``
    kind: str  #: ``gcc``, ``clang``, ``zig`` or ``other``; it decides which flags are understood
    version: str  #: what it says of itself


def find_compiler(command: str | None = None) -> CompilerInfo:
    """Find the C compiler.

    Tried in this order: `command`, a command line such as ``"clang-18"`` or ``"ccache gcc"``, the environment variable
    CC, the compiler Python was built with, gcc, clang, cc, zig on the path and zig from the package ziglang. If one of
    the first two is set, no other is tried.
    Raises ToolchainError (none works; the message lists what was tried and what to install).
    """
    return _find(command, os.environ.get("CC", ""), os.environ.get("PATH", ""))


def compiler_files(command: str | None = None) -> list[Any]:
    """Programs that :func:`find_compiler` tries, with time and size: what its answer depends on; none is run."""
    variable = os.environ.get("CC", "")
    paths = [_which(candidate[0]) for candidate in _candidates(command, variable)]
    states = [(path, os.stat(path)) for path in paths if path]
    return [command, variable, *((path, state.st_mtime_ns, state.st_size) for path, state in states)]


@lru_cache(maxsize=16)
def _find(command: str | None, variable: str, search_path: str) -> CompilerInfo:
    import shlex

    tried = []
    for candidate in _candidates(command, variable):
        answer = _identify(candidate, search_path)
        if isinstance(answer, CompilerInfo):
            return answer
        tried.append(f"{shlex.join(candidate)}: {answer}")
    origin = _origin(command, variable)
    heading = f"The C compiler named by {origin} does not work." if origin else "No C compiler was found."
    raise ToolchainError(f"{heading} Tried:\n  " + "\n  ".join(tried) + f"\n{REMEDIES}", code="EG-COMPILER-MISSING")


def _origin(command: str | None, variable: str) -> str:
    """Who names a compiler; empty if nobody does."""
    return "the option compiler" if command else "the environment variable CC" if variable.strip() else ""


def _candidates(command: str | None, variable: str) -> list[tuple[str, ...]]:
    """The commands to try, in order."""
    import shlex
    import sysconfig

    if origin := _origin(command, variable):
        line = (command or variable).strip()
        try:
            return [tuple(shlex.split(line))]
        except ValueError as error:  # a quotation without its end
            raise ToolchainError(f"{origin} is not a command: {error}: {line}", code="EG-COMPILER-MISSING") from None
    # Of Python's compiler only the program: the flags that follow it there were for building Python.
    of_python = [(program,) for program in str(sysconfig.get_config_var("CC") or "").split()[:1]]
    return [*of_python, ("gcc",), ("clang",), ("cc",), ("zig", "cc"), *((str(zig), "cc") for zig in zig_of_python())]


def zig_of_python() -> list[Path]:
    """The zig of the package ziglang, where that is installed."""
    spec = importlib.util.find_spec("ziglang")
    if spec is None or spec.origin is None:
        return []
    return [Path(spec.origin).with_name("zig.exe" if sys.platform == "win32" else "zig")]


def _which(program: str, search_path: str | None = None) -> str | None:
    return None if "\0" in program else shutil.which(program, path=search_path)


def _identify(candidate: tuple[str, ...], search_path: str) -> CompilerInfo | str:
    """The compiler behind a command, or why there is none."""
    program = candidate[0]
    path = _which(program, search_path)
    if path is None:
        return "a directory" if os.path.isdir(program) else "not executable" if os.path.isfile(program) else "not found"
    command = (os.path.abspath(path), *candidate[1:])  # it is run in other folders
    try:
        answer = run([*command, "--version"])
    except ToolchainError as error:
        return str(error)
    version = answer.stdout
    if answer.returncode != 0:
        return version or f"exit status {answer.returncode}"
    if not version:
        return "not a compiler: it prints nothing for --version"
    if any(Path(part).stem in ("zig", "ziglang") for part in command):
        kind = "zig"
        version += f"\nzig {run([*command[:-1], 'version']).stdout}"  # the above is clang's
    elif "clang" in version:
        kind = "clang"
    else:
        kind = "gcc" if "Free Software Foundation" in version else "other"
    return CompilerInfo(command[0], command, kind, version)


# -- which processor ---------------------------------------------------------------------------------------------------

#: Width of lanes -> features, by NumPy's names, without which the code of that width is of no use; the widest first.
NEEDS: dict[int, tuple[str, ...]] = {8: ("AVX512F", "AVX512VL", "AVX512DQ", "FMA3"), 4: ("AVX2", "FMA3"), 2: ()}


@cache
def lane_width() -> int:
    """States side by side in the kernels that are compiled here: what this processor takes at a time."""
    if not is_x86():
        return 2
    return next(width for width, needs in NEEDS.items() if numpy_features().issuperset(needs))


@cache
def numpy_features() -> frozenset[str]:
    """Features of this processor by NumPy's names; NumPy has asked it already, its dispatch relies on this table."""
    try:
        features = import_module("numpy._core._multiarray_umath").__cpu_features__
    except (ImportError, AttributeError):
        return frozenset()
    return frozenset(name for name, there in features.items() if there)


def is_x86() -> bool:
    """Whether this processor runs x86-64 code."""
    return platform.machine().lower() in ("x86_64", "amd64")


@lru_cache(maxsize=16)
def describe_native(compiler: CompilerInfo, flags: tuple[str, ...]) -> str:
    """What the compiler knows of this processor: its predefined macros under the flags that say "native"."""
    command = [*compiler.command, *flags, "-dM", "-E", "-x", "c", os.devnull]
    return run(command, task="asking the compiler about this processor (option native)").stdout


# -- options and flags -------------------------------------------------------------------------------------------------

#: gcc: -O1. Measured with gcc 12 on one call of a right-hand side, beside -O2, which vectorizes straight-line code
#: to its harm: Panda, UR5, Talos, ANYmal take 0.97, 0.96, 0.96, 0.91 of the time, linkages with loops 0.97 to 1, and
#: the compiler 0.6 of its time; -O3 is no faster than -O2 (``python -m benchmarks.run rhs``).
GCC_LEVEL = 1
#: Other compilers: -O2, and -O1 for models whose files are longer than this (bytes) together.
LARGE_SOURCE = 800_000
#: Lanes of processors whose instructions write a third register: -mavx, to the same bits. gcc 12 copies registers less,
#: so Talos and ANYmal take about 0.8 of the time (0.72 to 0.88 in four measurements on a Xeon), small arms 0.98.
WITH_AVX = 4


class BuildOptions(TypedDict, total=False):
    """Fields of :class:`Options`, which calls pass on."""

    optimize: int | None
    native: bool
    warnings: bool
    extra: Sequence[str]
    compiler: str | None
    lanes: int | None
    jobs: int | None


@dataclass(frozen=True, slots=True)
class Options:
    """Options of the compilation.

    Attributes
    ----------
    optimize : int or None
        Level 0 to 3; None chooses what was measured to be best: 1 for gcc, else 2, and 1 for large files. Changes the
        build.
    native : bool
        Use every instruction of this processor, and contract a*b + c into one of them; results may differ in the last
        digits. Changes the build. Without it modules have -mavx where this processor has AVX2: no result changes, and
        other processors get a build of their own.
    warnings : bool
        Treat the compiler's warnings as errors. Changes the build.
    extra : sequence of str
        More flags for compiling and linking. Changes the build.
    compiler : str or None
        Command line of the compiler; None finds one. Changes the build.
    lanes : {0, 2, 4, 8} or None
        States that batches take at a time in vector registers; None takes what suits this processor, compiled when
        batches or ensembles first need it, 0 leaves them out. Results of batches are the same, to the last bit; those
        of ensembles within the tolerance. Changes the build.
    jobs : int or None
        Files compiled at a time; None takes the number of processors. Does not change the build.
    """

    optimize: int | None = None
    native: bool = False
    warnings: bool = False
    extra: Sequence[str] = ()
    compiler: str | None = None
    lanes: int | None = None
    jobs: int | None = None

    def __post_init__(self) -> None:
        for name, allowed in (("optimize", (0, 1, 2, 3)), ("lanes", (0, 2, 4, 8))):
            if (raw := getattr(self, name)) is None:
                continue
            if as_count(raw) not in allowed:
                *but, last = allowed
                raise no_choice(f"{name} must be None, {', '.join(map(str, but))} or {last}, not {quote(raw)}")
            object.__setattr__(self, name, as_count(raw))
        if self.jobs is not None:
            object.__setattr__(self, "jobs", read_count("jobs, files compiled at a time,", self.jobs, 1))
        if not isinstance(self.compiler, str | None):
            raise ill_typed(f"compiler must be a text, the command line of a compiler, not {quote(self.compiler)}")
        if isinstance(self.extra, str):
            raise ill_typed(f"extra must be a sequence of flags, not the text {self.extra!r}")
        object.__setattr__(self, "extra", tuple(self.extra))


def compile_flags(options: Options, compiler: CompilerInfo, size: int, *, portable: bool = False) -> list[str]:
    """Flags that compile one of C files of so many bytes together; ``portable``: the code may go to other computers."""
    best = GCC_LEVEL if compiler.kind == "gcc" else 1 if size > LARGE_SOURCE else 2
    level = best if options.optimize is None else options.optimize
    flags = ["-std=c99", f"-O{level}", "-fPIC", *machine_flags(options, compiler)]
    if not portable and not options.native and compiler.kind in ("gcc", "clang") and lane_width() >= WITH_AVX:
        flags.append("-mavx")
    if compiler.kind != "other":
        # errno is never read; contraction makes results depend on the processor.
        flags += [f"-ffp-contract={'fast' if options.native else 'off'}", "-fno-math-errno"]
    if compiler.kind == "gcc" and options.native and level == 1:
        flags.append("-fexpensive-optimizations")  # without which gcc contracts nothing
    if options.warnings:
        flags += ["-Wall", "-Wextra", "-Werror"]
    return [*flags, *options.extra]


def machine_flags(options: Options, compiler: CompilerInfo) -> list[str]:
    """Flags that say which processor to compile for."""
    if compiler.kind == "zig":
        # zig compiles for this very processor, and checks for undefined behaviour, unless told otherwise.
        return ["-mcpu=native" if options.native else "-mcpu=baseline", "-fno-sanitize=undefined"]
    return ["-march=native"] if options.native else []


def link_flags(options: Options, compiler: CompilerInfo, *, extension: bool = False) -> list[str]:
    """Flags that link object files into a library, or into an extension module."""
    if sys.platform == "darwin":
        kind = ["-bundle", "-undefined", "dynamic_lookup"] if extension else ["-dynamiclib"]
    else:
        # -Bsymbolic: a library finds its own functions first, whatever else the process has loaded.
        kind = ["-shared"] if compiler.kind == "other" else ["-shared", "-Wl,-Bsymbolic"]
    return [*kind, *machine_flags(options, compiler), *options.extra, "-lm"]
