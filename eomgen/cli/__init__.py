"""Command line -> exit code; a file of verbs is loaded when one of them is called."""

from __future__ import annotations

import gc
import os
import sys

#: New objects between two looks for garbage, which took a sixth of the time of imports at Python's 700.
COLLECT = 100_000

TYPE_CHECKING = False  # what is imported before main() begins cannot be interrupted without a traceback
if TYPE_CHECKING:
    from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the ``eomgen`` command and leave with its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        The words after ``eomgen``; those of the process by default.

    Raises
    ------
    SystemExit
        Always, unless the process itself ends: 0 success; 1 error in the model; 2 usage or file not found; 3 compiler
        or package; 4 the integration; 5 a verification that failed; 130 and 143 ended by SIGINT (Ctrl-C) and SIGTERM.
    """
    try:
        import signal

        if arguments is None:  # the process is this command's
            signal.signal(signal.SIGTERM, _leave)
            gc.set_threshold(COLLECT)
        from .command import run_command

        code = run_command(arguments)
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        code = 130
    if arguments is None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # Python's would print a traceback while the process ends
        _end(code)
    sys.exit(code)


def _end(code: int) -> None:
    """End the process, unless threads run, without freeing a graph object by object: a fifth of a known model's run."""
    import atexit
    import threading

    if threading.active_count() > 1:
        return
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os._exit(code)


def _leave(number: int, _: object) -> None:
    """Unwind, so that compilers and unfinished files go too; Python would end at once."""
    sys.exit(128 + number)
