"""Processes that tests start: whatever happens in the test, they are ended, waited for and their pipes closed.

One left behind is found by the collector of garbage in some later test, and fails that.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import nbformat

EXECUTE = Path(__file__).parents[1] / "notebooks" / "execute.py"
#: Seconds after which a process that does not end hangs, however busy the machine is.
HANGS = 600.0


@contextmanager
def child(command: Sequence[str], **options: Any) -> Iterator[subprocess.Popen[Any]]:
    """A process in a session of its own; options are those of ``subprocess.Popen``."""
    with subprocess.Popen(command, start_new_session=True, **options) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)  # what it started too


def executed(path: Path, folder: Path, raw: bool = False) -> Any:
    """The notebook with the outputs of a fresh kernel, as the project's own script stores it in a folder, or raw."""
    words = [sys.executable, str(EXECUTE), *(["--raw"] if raw else []), "--out", str(folder), str(path)]
    setting = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}  # of readline
    with child(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=setting) as process:
        said = process.communicate(timeout=HANGS)[0]
    assert process.returncode == 0, said
    return nbformat.read(folder / path.name, as_version=4)
