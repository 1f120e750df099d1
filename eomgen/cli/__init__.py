"""Stage cli: command line -> exit code; one file per verb, loaded when it is called."""

from __future__ import annotations

import sys

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
        Always: 0 fine; 1 the model is at fault; 2 usage or file not found; 3 compiler or package; 4 the integration;
        5 a verification that failed; 130 and 143 ended by SIGINT (Ctrl-C) and SIGTERM.
    """
    try:
        import signal

        if arguments is None:  # the process is this command's
            signal.signal(signal.SIGTERM, _leave)
        from .command import run_command

        code = run_command(arguments)
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        code = 130
    if arguments is None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # Python's would print a traceback while the process ends
    sys.exit(code)


def _leave(number: int, _: object) -> None:
    """Unwind, so that compilers and unfinished files go too; as in compilation.commands, which is slow to import."""
    sys.exit(128 + number)
