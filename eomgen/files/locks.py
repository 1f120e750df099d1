"""Locks: a folder or file held by one process at a time; let go of when it ends, however that is.

Where a file system has no locks everything goes on without them.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PATIENCE = 10.0  #: seconds to wait for a lock that is held for milliseconds; a stopped process must stop nobody else


@contextmanager
def hold(folder: Path) -> Iterator[None]:
    """Hold a folder.

    Raises
    ------
    BlockingIOError
        Another process, or thread, holds it.
    """
    descriptor = os.open(folder, os.O_RDONLY | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0))
    try:
        _lock(descriptor)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def locked(file: Path) -> Iterator[None]:
    """Wait for a lock and hold it; after a while, or where none can be made, go on without."""
    descriptor = -1
    with suppress(OSError):
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    end = time.monotonic() + PATIENCE
    while descriptor >= 0 and time.monotonic() < end:
        try:
            _lock(descriptor)
            break
        except BlockingIOError:
            time.sleep(0.005)
    try:
        yield
    finally:
        if descriptor >= 0:
            os.close(descriptor)


def _lock(descriptor: int) -> None:
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:
        return  # no locks here
