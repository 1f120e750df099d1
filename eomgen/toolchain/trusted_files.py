"""Files of a cache, loaded only if no other user could have written them; the text of a Python module -> the module.

What a cache holds is loaded as code.  So a path counts only if nobody but this user (by the effective user id) and root
could have written it, renamed it or put it there: the file or folder itself, every folder above it up to the root of
the file system and every symbolic link on the way belong to one of the two, and nobody else may write there.  A folder
above may be one like /tmp, where everybody writes but moves only what is theirs (sticky).  Root trusts root alone.

The way is walked from the top down: whoever could still change what was looked at is known to be trusted.  So nothing
can be exchanged by others afterwards, and a path that was checked may be given to dlopen, which takes no open file.
Files that are read here are opened first and checked by their descriptor.

Where a file system has no locks everything goes on without them.  A small file of a cache that was cut, changed or
renamed counts as not there, and may be lost at any time.  The manifest of a build lists the SHA-256 of every file; its
own, under "seal", covers the rest of it.

Of modules no bytecode is read or written beside them: a damaged or foreign file of bytecode would run unchecked.  Nor
is the module entered among those of Python, where it would stay for good: it goes with its last user.
"""

from __future__ import annotations

import errno
import hashlib
import importlib.abc
import importlib.util
import json
import os
import secrets
import shlex
import stat
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from types import ModuleType
from typing import Any

from ..base.files import LOADED, MANIFEST
from ..errors import bad_cache

# -- who could have written a file -------------------------------------------------------------------------------------


LINKS = 40  #: symbolic links followed in one path, as Linux does
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
ACL = "system.posix_acl_access"


def require_trusted(path: str | os.PathLike[str]) -> None:
    """Refuse a folder or file that another user could have filled.

    Raises ToolchainError, which names the first folder, file or link from the top that another user owns or can write,
    and OSError where the path is not there.
    """
    if not hasattr(os, "geteuid"):
        return
    place, links = os.sep, 0
    ahead = os.path.abspath(path).split(os.sep)[::-1]
    _require_owner(place, os.lstat(place), above=True)
    while ahead:
        part = ahead.pop()
        if part in ("", os.curdir):
            continue
        if part == os.pardir:  # in the target of a link; the place itself has none on its way
            place = os.path.dirname(place)
            continue
        here = os.path.join(place, part)
        status = os.lstat(here)
        _require_owner(here, status, above=any(ahead))
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

    Raises ToolchainError (another user owns it or can write it), OSError (not there, or a link or pipe).
    """
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with open(os.open(path, flags), "rb", buffering=0) as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "not a regular file", os.fspath(path))
        if hasattr(os, "geteuid"):
            _require_owner(os.fspath(path), status, above=False)
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


def _require_owner(path: str, status: os.stat_result, *, above: bool) -> None:
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


# -- locks of folders and files ----------------------------------------------------------------------------------------


PATIENCE = 10.0  #: seconds to wait for a lock that is held for milliseconds; a stopped process must stop nobody else


@contextmanager
def hold(folder: Path) -> Iterator[None]:
    """Hold a folder. Raises BlockingIOError (another process, or thread, holds it)."""
    descriptor = os.open(folder, os.O_RDONLY | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0))
    try:
        _lock(descriptor)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def locked(file: Path, patience: float = PATIENCE) -> Iterator[None]:
    """Wait for a lock and hold it; after a while, or where none can be made, go on without."""
    descriptor = -1
    with suppress(OSError):
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    end = time.monotonic() + patience
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


# -- small files of a cache, each behind its digest --------------------------------------------------------------------


class Kept:
    """A folder of such files, made when the first is written."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def read(self, name: str) -> bytes | None:
        """The content of a file, or None. Raises ToolchainError (another user could have written it)."""
        try:
            require_trusted(self.folder)
            data = read_trusted(self.folder / name)
        except (OSError, ValueError):
            return None
        seal, content = data[:32], data[32:]
        return content if seal == _kept_seal(name, content) else None

    def write(self, name: str, content: bytes) -> None:
        """Keep a file, if the folder can be written."""
        part = self.folder / f".{secrets.token_hex(8)}"
        try:
            make_private(self.folder)
            require_trusted(self.folder)
            with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
                file.write(_kept_seal(name, content) + content)
            os.replace(part, self.folder / name)
        except OSError:
            with suppress(OSError):
                part.unlink()


def _kept_seal(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + b"\0" + content).digest()


# -- a published build and its manifest --------------------------------------------------------------------------------


def digest(data: bytes) -> str:
    """SHA-256 as 64 digits."""
    return hashlib.sha256(data).hexdigest()


def sealed(manifest: Mapping[str, Any]) -> str:
    """The text of a manifest with its seal."""
    return json.dumps({**manifest, "seal": _seal(manifest)}, indent=1)


def read_manifest(directory: Path) -> dict[str, Any]:
    """The manifest of an entry as it was written.

    Raises ValueError (it is damaged), OSError (it cannot be read), ToolchainError (another user could have written it).
    """
    require_trusted(directory)
    try:
        manifest = json.loads(read_trusted(directory / MANIFEST))
        if manifest.pop("seal") != _seal(manifest):
            raise ValueError("the seal is broken")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"the manifest in {directory} is damaged: {error}") from None
    result: dict[str, Any] = manifest
    return result


def read_entry(directory: Path) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The manifest of an entry and the bytes of all its files, each as it was published.

    Raises ValueError (something is damaged), OSError (something is missing), ToolchainError (another user could have
    written it).
    """
    manifest = read_manifest(directory)
    files: dict[str, str] = manifest["files"]
    for folder in {PurePosixPath(name).parent for name in files}:
        require_trusted(directory / folder)
    result = {name: read_trusted(directory / name) for name in files}
    for name, data in result.items():
        if digest(data) != files[name]:
            raise ValueError(f"{directory / name} is damaged")
    return manifest, result


def _seal(manifest: Mapping[str, Any]) -> str:
    return digest(json.dumps(manifest, sort_keys=True).encode())


# -- the text of a Python module -> the module -------------------------------------------------------------------------


class _Text(importlib.abc.SourceLoader):
    def __init__(self, path: str, data: bytes) -> None:
        self.path, self.data = path, data

    def get_filename(self, fullname: str) -> str:
        return self.path

    def get_data(self, path: Any) -> bytes:
        return self.data


def load_source(name: str, path: str, data: bytes, raw: Mapping[str, Any] | None = None) -> ModuleType:
    """Make a module from its text; ``path`` is what ``__file__`` says, ``raw`` what it knows before it runs."""
    loader = _Text(path, data)
    spec = importlib.util.spec_from_file_location(name, path, loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    vars(module).update(raw or {})
    loader.exec_module(module)
    if not raw:  # given other things, it is another module
        LOADED[name] = getattr(module, "model", module)
    return module
