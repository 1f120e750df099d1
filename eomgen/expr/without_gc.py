"""Derive and generate without the garbage collector and with one thread of linear algebra, in any number of threads."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from threading import Lock
from time import perf_counter

from threadpoolctl import ThreadpoolController

LINEAR_ALGEBRA = ThreadpoolController()  #: found once: that looks through the libraries of the process
_lock = Lock()
_inside = 0  #: threads at such work
_before = ExitStack()  #: gives back what the first of them found


@contextmanager
def without_gc() -> Iterator[None]:
    """Pause the garbage collector, which would walk the many small objects of a graph again and again, and keep linear
    algebra to one thread: matrices are small, and on a busy machine threads that wait for each other take 20 times as
    long (singular values of 320 x 320: 6 ms in one thread, 110 ms in two).

    Both hold for the process, so the first thread that comes takes note of what was, and the last one gives it back.
    """
    global _inside
    with _lock:
        if not _inside:
            _before.enter_context(LINEAR_ALGEBRA.limit(limits=1, user_api="blas"))
            if gc.isenabled():
                gc.disable()
                _before.callback(gc.enable)
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if not _inside:
                _before.close()


@contextmanager
def timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Note how long a stage takes (s), whatever it leads to."""
    start = perf_counter()
    try:
        yield
    finally:
        seconds[stage] = perf_counter() - start
