"""Files: the name of a plain file -> the open file; a pipe, a device or a folder is refused at once.

A pipe would be waited for, a device may have no end.
"""

from __future__ import annotations

import os
import stat
from typing import BinaryIO

from ..errors import UsageError, bad_file
from .path_names import as_name

#: What a name may stand for that is not a plain file.
KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


def open_plain(path: str | os.PathLike[str], *, follow: bool = True) -> BinaryIO:
    """Open a plain file for reading, without waiting for anybody.

    Parameters
    ----------
    path : str or path
    follow : bool, optional
        Whether a link in the place of the file is followed.

    Raises
    ------
    UsageError
        It is not a plain file, or the path is none, such as one with NUL.
    OSError
        It is not there, or cannot be read.
    """
    name = as_name("path", path)
    status = os.stat(name, follow_symlinks=follow)
    _require_plain(name, status)  # a socket cannot be opened, and some devices act when they are
    flags = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)
    descriptor = os.open(name, flags if follow else flags | getattr(os, "O_NOFOLLOW", 0))
    try:
        _require_plain(name, os.fstat(descriptor))  # another may lie there since
    except UsageError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def kind_of(path: str | os.PathLike[str]) -> str:
    """What is in the place of a plain file: a folder, a pipe, ...; empty where it is one, or nothing is there."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return ""
    return "" if stat.S_ISREG(mode) else _kind(mode)


def _kind(mode: int) -> str:
    return next((what for is_that, what in KINDS if is_that(mode)), "a link or something else")


def _require_plain(name: str, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        what = _kind(status.st_mode)
        raise bad_file(f"{name} is not a plain file but {what}; name a plain file, or copy its content into one")
