"""Writing: what a user asked for -> a file that is there whole, or the earlier one as it was.

Everything is written beside the file, made durable, and takes its place by one rename.  A full disk, a crash or Ctrl-C
so leaves the earlier file; only ``kill -9`` leaves the part that was written, as ``.NAME.XXXXXXXX`` beside it.
"""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from ..errors import bad_file
from .path_names import as_path

TOKEN = 8  #: random digits at the end of a part's name
TRIES = 3  #: of writing, where others clean up meanwhile
PREFIX = 60  #: characters of a file's name in that of the part: names end at 255 bytes


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a file for writing whose bytes replace an earlier file when the block ends without an exception.

    The mode of an earlier file stays, its owner and group where that is allowed.  Missing folders are made.  A device
    or pipe is written as it is, and so is one that a link leads to.

    Parameters
    ----------
    path : str or path

    Yields
    ------
    binary file

    Raises
    ------
    UsageError
        The path is a symbolic link to a file, a folder or nothing: its target is not the file that was named.
    OSError
        With the path as ``filename``: it cannot be written; the earlier file is as it was.
    """
    target = as_path("path", path)
    if not target.name:
        raise bad_file(f"{target} is a folder; name a file in it")
    refuse_link(target)
    part = target.with_name(f".{target.name[:PREFIX]}.{secrets.token_hex(TOKEN // 2)}")
    try:
        earlier = _status(target)
        if earlier is not None and not stat.S_ISREG(earlier.st_mode):
            with open(target, "wb") as file:  # a folder raises here
                yield file
            return
        if earlier is not None and not os.access(target, os.W_OK):
            raise PermissionError(13, "Permission denied: the file that is there is read-only", str(target))
        target.parent.mkdir(parents=True, exist_ok=True)
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
        descriptor = os.open(part, flags, 0o666)
        try:
            with open(descriptor, "wb") as file:
                if earlier is not None:
                    _take_over(descriptor, earlier)
                yield file
                file.flush()
                os.fsync(descriptor)
            os.replace(part, target)
        except BaseException:
            with suppress(OSError):
                part.unlink()
            raise
        _sync_folder(target.parent)
    except OSError as error:
        if error.errno is None or error.filename not in (None, str(part)):
            raise
        raise type(error)(error.errno, error.strerror or str(error), str(target)) from error


def remove_parts(path: str | os.PathLike[str]) -> None:
    """Remove what writers of a file that were killed have left beside it; :func:`write_whole` alone may be at work."""
    target = Path(path)
    begin = f".{target.name[:PREFIX]}."
    for part in target.parent.iterdir() if target.parent.is_dir() else ():
        token = part.name.removeprefix(begin)
        if part.name.startswith(begin) and len(token) == TOKEN and set(token) <= set("0123456789abcdef"):
            with suppress(OSError):
                part.unlink()


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a text (UTF-8) or bytes; see :func:`whole_file`.

    Again where the part is gone before it takes its place: another call took it for one of a killed writer
    (:func:`remove_parts`).
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    for left in range(TRIES - 1, -1, -1):
        try:
            with whole_file(path) as file:
                file.write(data)
            return
        except FileNotFoundError:
            if not left:
                raise


def save_figure(figure: Any, path: str | os.PathLike[str], **options: Any) -> None:
    """Write a picture of matplotlib; the ending says its kind; see :func:`whole_file`."""
    kind = as_path("path", path).suffix[1:].lower()
    with whole_file(path) as file:
        figure.savefig(file, format=kind or None, **options)


def refuse_link(path: Path) -> None:
    """Refuse a symbolic link where a file or folder is to be written.

    Links among the folders above are followed; a link to a device or pipe, such as /dev/stdout, is one's own wish.

    Raises
    ------
    UsageError
        With the path and where it leads.
    """
    if not path.is_symlink():
        return
    found = _status(path)
    if found is not None and not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):
        return
    raise bad_file(
        f"{path} is a symbolic link to {os.readlink(path)}, and eomgen does not write through links; name that "
        "file itself, or remove the link"
    )


def _status(path: Path) -> os.stat_result | None:
    try:
        return path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return None


def _take_over(descriptor: int, earlier: os.stat_result) -> None:
    """Owner and group of the earlier file if they may be given, then its mode."""
    own = os.fstat(descriptor)
    mode = stat.S_IMODE(earlier.st_mode)
    if (own.st_uid, own.st_gid) != (earlier.st_uid, earlier.st_gid):
        try:
            os.fchown(descriptor, earlier.st_uid, earlier.st_gid)
        except OSError:
            mode &= 0o755  # rights of a group that is not the file's any more
            if own.st_gid != earlier.st_gid:
                mode &= 0o705
    with suppress(OSError):
        os.fchmod(descriptor, mode)


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable, where the file system can."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
