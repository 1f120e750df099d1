"""Stage cli: command line -> exit code; one file per verb, loaded when it is called."""

from __future__ import annotations

import sys
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
        5 a verification that failed.
    """
    from .command import run_command

    sys.exit(run_command(arguments))
