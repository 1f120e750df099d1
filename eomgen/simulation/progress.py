"""Simulation: times an integrator visits -> a progress line on stderr."""

from __future__ import annotations

import sys
from time import perf_counter
from typing import Any

from ..runtime.room import read_flag

PATIENCE = 2.0  #: seconds before anything is shown
EVERY = 0.2  #: seconds between updates
STRIDE = 64  #: calls between looks at the clock


class Progress:
    """Shows how far a run has come, once it has taken a while.

    Parameters
    ----------
    start, end : float
        Simulated time.
    patience : float
        Seconds before it appears.
    words : str
        What is said of how far it is.
    """

    def __init__(self, start: float, end: float, patience: float = PATIENCE, words: str = "t = {:.4g} s") -> None:
        self.words = words
        self.start, self.length = start, end - start
        self.next = perf_counter() + patience
        self.calls = 0
        self.bar: Any = None
        self.task: Any = None
        self.plain = False

    def __call__(self, t: float) -> None:
        """Tell that the integrator is at time t."""
        self.calls += 1
        if self.calls % STRIDE == 0:
            self.look(t)

    def look(self, t: float) -> None:
        """Show the time t if it is long enough since something was shown."""
        now = perf_counter()
        if now < self.next:
            return
        self.next = now + EVERY
        part = min(max((t - self.start) / self.length, 0.0), 1.0) if self.length else 1.0
        if self.bar is None and not self.plain:
            self._open()
        if self.plain:
            sys.stderr.write(f"\rsimulating: {100 * part:3.0f} %  {self.words.format(t)} ")
            sys.stderr.flush()
        else:
            self.bar.update(self.task, completed=part, description=self.words.format(t))

    def close(self) -> None:
        """Clean up."""
        if self.bar is not None:
            self.bar.stop()
        elif self.plain:
            sys.stderr.write("\r" + " " * 40 + "\r")
            sys.stderr.flush()

    def _open(self) -> None:
        try:
            from rich.console import Console
            from rich.progress import Progress as Bar
        except ImportError:
            self.plain = True
            return
        self.bar = Bar(console=Console(stderr=True), transient=True)
        self.task = self.bar.add_task("simulating", total=1.0)
        self.bar.start()


def wanted(progress: bool | None) -> bool:
    """Whether to watch a run: as asked, or when stderr is a terminal."""
    return sys.stderr.isatty() if progress is None else read_flag("progress", progress)
