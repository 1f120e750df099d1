"""Simulation: times an integrator visits -> a progress line on stderr, or a bar in a notebook."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from time import perf_counter
from typing import Any

from ..runtime.room import read_flag

PATIENCE = 2.0  #: seconds before anything is shown
EVERY = 0.2  #: seconds between updates
STRIDE = 64  #: calls between looks at the clock


_asked: list[Any] = [None, False]  #: stderr at the last run, and whether it is a terminal


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
        self.page: Any = None
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
        if self.bar is None and self.page is None and not self.plain:
            self._open()
        if self.plain:
            sys.stderr.write(f"\rsimulating: {100 * part:3.0f} %  {self.words.format(t)} ")
            sys.stderr.flush()
        elif self.page is not None:
            self.page.update(_Bar(part, self.words.format(t)))
        else:
            self.bar.update(self.task, completed=part, description=self.words.format(t))

    def close(self) -> None:
        """Clean up."""
        if self.page is not None:
            self.page.update(_Bar(None, ""))
        elif self.bar is not None:
            self.bar.stop()
        elif self.plain:
            sys.stderr.write("\r" + " " * 40 + "\r")
            sys.stderr.flush()

    def _open(self) -> None:
        if in_notebook():
            self.page = sys.modules["IPython"].display.display(_Bar(0.0, ""), display_id=True)
            if self.page is not None:
                return
        try:
            from rich.console import Console
            from rich.progress import Progress as Bar
        except ImportError:
            self.plain = True
            return
        self.bar = Bar(console=Console(stderr=True), transient=True)
        self.task = self.bar.add_task("simulating", total=1.0)
        self.bar.start()


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """Say on stderr what a call does, once it has taken a while."""
    timer = Timer(PATIENCE, lambda: print(f"eomgen: {what} ...", file=sys.stderr, flush=True))
    timer.daemon = True
    if wanted(None):
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


class _Bar:
    """A bar as notebooks show it; nothing without a part."""

    def __init__(self, part: float | None, words: str) -> None:
        self.part, self.words = part, words

    def __repr__(self) -> str:
        return "" if self.part is None else f"simulating: {100 * self.part:3.0f} %  {self.words}"

    def _repr_html_(self) -> str:
        if self.part is None:
            return ""
        return f"simulating <progress value='{self.part:.4f}' max='1'></progress> {100 * self.part:.0f} % {self.words}"


def in_notebook() -> bool:
    """Whether this runs in the kernel of a notebook."""
    module = sys.modules.get("IPython")
    if module is None:
        return False
    shell = getattr(module, "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


def wanted(progress: bool | None) -> bool:
    """Whether to watch a run: as asked, or when stderr is a terminal or this is a notebook."""
    if progress is not None:
        return read_flag("progress", progress)
    if _asked[0] is not sys.stderr:  # to ask takes as long as the start of a short run
        _asked[:] = sys.stderr, sys.stderr.isatty()
    return _asked[1] or in_notebook()
