"""Commands: words -> what a program said, within bounds of time and output.

Each command runs in a process group of its own, which is killed with all that it started when its time is over, when
it prints without end, and when the work is given up (Ctrl-C, SIGTERM, another file that does not compile).
"""

from __future__ import annotations

import os
import selectors
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn

from ..errors import ToolchainError, off_range

#: Seconds: to say a version; to compile or link, and per byte of source: twenty times what gcc takes for large models.
ANSWER, COMPILE, PER_BYTE = 15.0, 120.0, 1.5e-3
#: Environment variable that sets the seconds a command may take instead.
SECONDS = "EOMGEN_COMPILER_SECONDS"
OUTPUT = 16_000_000  #: bytes, of all that a command may print
LINGER = 1.0  #: seconds in which what a finished command left running may still print


@contextmanager
def unwound_by_sigterm() -> Iterator[None]:
    """Let SIGTERM, which would end Python alone and at once, unwind what is in here and exit with 143.

    Only in the main thread, where signals are handled, and where nobody else handles this one.
    """
    mine = threading.current_thread() is threading.main_thread()
    if not mine or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


class Running:
    """Commands that belong together, such as those of one build, so that they can be ended together."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: set[subprocess.Popen[bytes]] = set()
        self._stopped = False

    def run(
        self, command: Sequence[str], directory: Path | None = None, seconds: float = ANSWER
    ) -> subprocess.CompletedProcess[str]:
        """Run a command and collect what it says, in English; see :func:`run`."""
        with unwound_by_sigterm():
            return self._run(command, directory, seconds)

    def _run(self, command: Sequence[str], directory: Path | None, seconds: float) -> subprocess.CompletedProcess[str]:
        seconds = _given() or seconds
        environment = {**os.environ, "LC_ALL": "C"}
        if directory is not None:
            environment["TMPDIR"] = str(directory)
        words = shlex.join(command)
        with self._lock:
            if self._stopped:
                raise ToolchainError(f"the command {words} was not started, because the work was cancelled", words)
            process = _start(command, directory, environment)
            self._running.add(process)
        with process:
            try:
                said, trouble = _listen(process, seconds)
            except BaseException:
                _kill(process)
                raise
            finally:
                with self._lock:
                    self._running.discard(process)
        out, err = (b"".join(parts).decode("utf-8", "replace") for parts in said)
        if trouble:
            raise ToolchainError(
                f"the command {words} did not finish: it was stopped after {trouble}. Try another compiler (set CC)",
                words,
                (err + out)[:2000],
            )
        return subprocess.CompletedProcess(list(command), process.returncode, out, err)

    def stop(self) -> None:
        """End the commands that run now, in whatever thread, and begin no other."""
        with self._lock:
            self._stopped = True
            for process in self._running:
                _kill(process)


def run(
    command: Sequence[str], directory: Path | None = None, seconds: float = ANSWER
) -> subprocess.CompletedProcess[str]:
    """Run a command and collect what it says, in English.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    directory : Path, optional
        Working directory, also for temporary files, so that a killed compiler leaves nothing elsewhere.
    seconds : float
        That it may take, unless EOMGEN_COMPILER_SECONDS says otherwise.

    Raises
    ------
    ToolchainError
        It cannot be started, takes longer, or prints more than anybody reads.
    """
    return Running().run(command, directory, seconds)


def allowed(size: int) -> float:
    """Seconds that compiling sources of so many bytes may take."""
    return COMPILE + PER_BYTE * size


def raise_failure(task: str, result: subprocess.CompletedProcess[str], directory: Path) -> NoReturn:
    """Raise the ToolchainError of a command that failed, with the command and the compiler's own words."""
    command, said = shlex.join(result.args), (result.stderr + result.stdout).strip()
    raise ToolchainError(
        f"{task} failed (exit status {result.returncode}):\n{said}\nThe command, run in {directory}:\n{command}",
        command,
        said,
    )


def _given() -> float | None:
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


def _start(command: Sequence[str], directory: Path | None, environment: dict[str, str]) -> subprocess.Popen[bytes]:
    """Begin a command, in a thread: a signal that came while Popen waits would leave a process that nobody knows of."""
    with ThreadPoolExecutor(1) as starter:
        started = starter.submit(
            subprocess.Popen, command, cwd=directory, env=environment, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, process_group=0,
        )  # fmt: skip
        try:
            return started.result()
        except (OSError, ValueError) as error:  # ValueError: a NUL in a word
            words = shlex.join(command)
            raise ToolchainError(
                f"the command {words} cannot be started: {error}", words, code="EG-COMPILER-MISSING"
            ) from error
        except BaseException:
            if started.exception() is None:
                _kill(started.result())
            raise


def _listen(process: subprocess.Popen[bytes], seconds: float) -> tuple[tuple[list[bytes], list[bytes]], str]:
    """What both streams say until they close, and after what the process was killed, if it was.

    Once a process has ended, whatever it left behind is given a moment and then killed.
    """
    assert process.stdout is not None
    assert process.stderr is not None
    said: tuple[list[bytes], list[bytes]] = ([], [])
    end, size = time.monotonic() + seconds, 0
    with selectors.DefaultSelector() as selector:
        for stream, parts in zip((process.stdout, process.stderr), said, strict=True):
            selector.register(stream, selectors.EVENT_READ, parts)
        while selector.get_map():
            for key, _ in selector.select(0.1):
                data = os.read(key.fd, 65536)
                if not data:
                    selector.unregister(key.fileobj)
                key.data.append(data)
                size += len(data)
            ended = process.poll() is not None
            if size > OUTPUT:
                _kill(process)
                return said, f"{OUTPUT / 1e6:g} MB of output"
            if ended:
                end = min(end, time.monotonic() + LINGER)
            if time.monotonic() >= end:
                _kill(process)
                return said, "" if ended else _late(seconds)
    try:
        process.wait(max(end - time.monotonic(), LINGER))
    except subprocess.TimeoutExpired:
        _kill(process)
        return said, _late(seconds)
    return said, ""


def _late(seconds: float) -> str:
    return f"{seconds:g} s ({SECONDS} sets another limit)"


def _kill(process: subprocess.Popen[bytes]) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
