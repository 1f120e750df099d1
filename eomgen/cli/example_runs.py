"""Stage cli, runs of examples: a shipped example -> what became of it, and the times."""

from __future__ import annotations

import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, NamedTuple

from ..errors import EomgenError
from .failures import MODEL, exit_code, lines_of

PART = 0.1  #: of the time in the file that is simulated


class ExampleRun(NamedTuple):
    """What became of one example.

    Attributes
    ----------
    name, file : str
    exit_code : int
        0 where it ran; else the code with which a verb would have failed.
    error : str
        First line of the failure.
    degrees_of_freedom, steps : int or None
        Of the mechanism; of its run.  None of a Python script and of what failed before.
    end : float or None
        Until which time it was simulated (s).
    seconds : dict of str to float
        ``derive``, ``compile`` and ``simulate``, or ``script``.
    warnings : list of str
        Such as that a joint passed a limit.
    """

    name: str
    file: str
    exit_code: int
    error: str
    degrees_of_freedom: int | None
    steps: int | None
    end: float | None
    seconds: dict[str, float]
    warnings: list[str]

    @property
    def ok(self) -> bool:
        return self.exit_code == 0


def run_example(name: str, file: Path, target: str) -> ExampleRun:
    """Run an example; what fails in it is told in the result."""
    seconds: dict[str, float] = {}
    found: dict[str, Any] = {"degrees_of_freedom": None, "steps": None, "end": None}
    code, error = 0, ""
    told: list[warnings.WarningMessage] = []
    try:
        if file.suffix == ".py":
            code, error = _run_script(file, seconds)
        else:
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                _run_model(file, target, seconds, found)
    except (EomgenError, OSError) as failure:
        code, error = exit_code(failure), lines_of(failure)[0]
    except Exception as failure:  # a fault of eomgen itself is a result of this verb
        code, error = MODEL, f"{type(failure).__name__}: {failure}"
    return ExampleRun(name, file.name, code, error, seconds=seconds, warnings=[str(w.message) for w in told], **found)


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = perf_counter()
    try:
        yield
    finally:
        seconds[stage] = perf_counter() - start


def _run_model(file: Path, target: str, seconds: dict[str, float], found: dict[str, Any]) -> None:
    """Derive, compile and simulate a part of the time that the file asks for."""
    from ..loading import load

    with _timed(seconds, "derive"):
        equations = load(file).derive()
    found["degrees_of_freedom"] = equations.report.degrees_of_freedom
    with _timed(seconds, "compile"):
        module = equations.compile(target=target)
    found["end"] = PART * float(module.metadata["simulation"]["end"])
    with _timed(seconds, "simulate"):
        trajectory = module.simulate(found["end"])
    found["steps"] = len(trajectory) - 1


def _run_script(file: Path, seconds: dict[str, float]) -> tuple[int, str]:
    """Run a script by this Python in an empty folder; its exit code and the last line of what it complains of."""
    with _timed(seconds, "script"), TemporaryDirectory() as folder:
        command = [sys.executable, str(file.resolve())]
        with subprocess.Popen(
            command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace"
        ) as process:
            try:
                _, said = process.communicate()
            except BaseException:
                process.terminate()  # it ends the compilers that it started
                raise
    return process.returncode, (said.strip().splitlines() or [""])[-1] if process.returncode else ""
