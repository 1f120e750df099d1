"""Ownership: a path -> nothing, or a ToolchainError that says which other user could have put something there.

What a cache holds is loaded as code.  So a path counts only if nobody but this user (by the effective user id) and root
could have written it, renamed it or put it there: the file or folder itself, every folder above it up to the root of
the file system and every symbolic link on the way belong to one of the two, and nobody else may write there.  A folder
above may be one like /tmp, where everybody writes but moves only what is theirs (sticky).  Root trusts root alone.

The way is walked from the top down: whoever could still change what was looked at is known to be trusted.  So nothing
can be exchanged by others afterwards, and a path that was checked may be given to dlopen, which takes no open file.
Files that are read here are opened first and checked by their descriptor.
"""

from __future__ import annotations

import errno
import os
import shlex
import stat
from contextlib import suppress

from ..errors import bad_cache

LINKS = 40  #: symbolic links followed in one path, as Linux does
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
ACL = "system.posix_acl_access"


def require_trusted(path: str | os.PathLike[str]) -> None:
    """Refuse a folder or file that another user could have filled.

    Parameters
    ----------
    path : str or path
        Must be there.

    Raises
    ------
    ToolchainError
        Naming the first folder, file or link from the top that another user owns or can write, with owner and mode.
    OSError
        The path is not there.
    """
    if not hasattr(os, "geteuid"):
        return
    place, links = os.sep, 0
    ahead = os.path.abspath(path).split(os.sep)[::-1]
    _require_own(place, os.lstat(place), above=True)
    while ahead:
        part = ahead.pop()
        if part in ("", os.curdir):
            continue
        if part == os.pardir:  # in the target of a link; the place itself has none on its way
            place = os.path.dirname(place)
            continue
        here = os.path.join(place, part)
        status = os.lstat(here)
        _require_own(here, status, above=any(ahead))
        if not stat.S_ISLNK(status.st_mode):
            place = here
            continue
        links += 1
        if links > LINKS:
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), os.fspath(path))
        target = os.readlink(here)
        place = os.sep if os.path.isabs(target) else place
        ahead += target.split(os.sep)[::-1]


def read_trusted(path: str | os.PathLike[str]) -> bytes:
    """The bytes of a file in a folder that was checked, after a look at who owns the open file.

    Raises
    ------
    ToolchainError
        Another user owns it or can write it.
    OSError
        It is not there, or is no regular file: a link, a pipe.
    """
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with open(os.open(path, flags), "rb", buffering=0) as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "not a regular file", os.fspath(path))
        if hasattr(os, "geteuid"):
            _require_own(os.fspath(path), status, above=False)
        return file.readall()


def make_private(folder: str | os.PathLike[str]) -> None:
    """Make a folder, and those above it that are missing, for this user alone."""
    name, missing = os.path.abspath(folder), []
    with suppress(FileNotFoundError, NotADirectoryError):
        os.lstat(name)  # a name that is too long is told before anything is made
    while not os.path.isdir(name):
        missing.append(name)
        name = os.path.dirname(name)
    for name in reversed(missing):
        with suppress(FileExistsError):  # of another process; else what follows says what is in the way
            os.mkdir(name, 0o700)


def _require_own(path: str, status: os.stat_result, *, above: bool) -> None:
    """Refuse one part of a path; `above` says that more follows below it."""
    owner, me = status.st_uid, os.geteuid()
    if owner not in (me, 0) and not (above and _unmapped(owner)):
        raise bad_cache(
            f"{_describe(path, status)} belongs to another user than {_name(me)}, and what a cache holds is loaded as "
            "code; set EOMGEN_CACHE_DIR to a folder of your own, in one that only you or root can write"
        )
    if stat.S_ISLNK(status.st_mode) or not status.st_mode & OTHERS_WRITE:
        return
    if above and status.st_mode & stat.S_ISVTX:
        return
    if above and not status.st_mode & stat.S_IWOTH and _private_group(path, status.st_gid, me):
        return
    raise bad_cache(
        f"{_describe(path, status)} can be written by other users; run: chmod go-w {shlex.quote(path)}, or set "
        "EOMGEN_CACHE_DIR to a folder that nobody else can write: what a cache holds is loaded as code"
    )


def _describe(path: str, status: os.stat_result) -> str:
    kinds = {stat.S_IFLNK: "the symbolic link", stat.S_IFDIR: "the directory"}
    kind = kinds.get(stat.S_IFMT(status.st_mode), "the file")
    return f"{kind} {path} (owner {_name(status.st_uid)}, mode {stat.S_IMODE(status.st_mode):04o})"


def _name(uid: int) -> str:
    import pwd

    try:
        return f"{pwd.getpwuid(uid).pw_name}, uid {uid}"
    except KeyError:
        return f"uid {uid}"


def _private_group(path: str, gid: int, me: int) -> bool:
    """Whether a group is this user's own and holds nobody else, as where the umask is 002; never for root."""
    import grp
    import pwd

    try:
        user, group = pwd.getpwuid(me), grp.getgrgid(gid)
    except KeyError:
        return False
    if me == 0 or (user.pw_gid, user.pw_name) != (gid, group.gr_name) or set(group.gr_mem) - {user.pw_name}:
        return False
    with suppress(OSError):
        return not hasattr(os, "getxattr") or not os.getxattr(path, ACL)  # the bits of a group tell what a list allows
    return True


def _unmapped(uid: int) -> bool:
    """Whether this is the number that stands, in a user namespace, for all users outside, root among them.

    Sandboxes show / and its first folders so.  Where no namespace hides them it is a user like any other.
    """
    try:
        with open("/proc/sys/kernel/overflowuid", encoding="ascii") as file:
            overflow = int(file.read())
        with open("/proc/self/uid_map", encoding="ascii") as file:
            ranges = [tuple(map(int, line.split())) for line in file]
    except (OSError, ValueError):
        return False
    return uid == overflow and not any(first <= uid < first + count for first, _, count in ranges)
