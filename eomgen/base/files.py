"""Files of a user, read and written safely; files of a cache, loaded only if no other user could have written them.

A pipe would be waited for, and a device may have no end: both are refused.  Everything is written beside the file, made
durable, and takes its place by one rename.  A full disk, a crash or Ctrl-C so leaves the earlier file; only ``kill -9``
leaves the part that was written, as ``.NAME.XXXXXXXX`` beside it.

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
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from types import ModuleType
from typing import Any, BinaryIO
from weakref import WeakValueDictionary

from ..errors import UsageError, bad_cache, bad_file, ill_typed
from .texts import shown

# -- names -------------------------------------------------------------------------------------------------------------


def as_path(what: str, given: Any) -> Path:
    """A path of a text or path.

    Raises
    ------
    UsageError
        It is something else (bytes too), empty, or holds what no name can: a NUL, half of a surrogate pair.
    """
    return Path(as_name(what, given))


def as_name(what: str, given: Any) -> str:
    """The same as text, as it was written.

    Raises
    ------
    UsageError
    """
    name = usable_name(given)
    if name is None:
        raise ill_typed(f"{what} must be the name of a file or folder, as text or Path, not {shown(given)}")
    return name


def usable_name(given: Any) -> str | None:
    """The text of a path; None where it is none."""
    try:
        name = os.fspath(given)
        usable = isinstance(name, str) and name and b"\0" not in os.fsencode(name)
    except Exception:  # of an object's own __fspath__ too
        return None
    return name if usable else None


def beside(file: str, name: str) -> str:
    """The path of a file that another names: in the folder of that one, or below.

    Raises
    ------
    UsageError
        It lies outside that folder.
    """
    folder = os.path.realpath(os.path.dirname(os.path.abspath(file)))
    path = os.path.realpath(os.path.join(folder, name))
    if os.path.isabs(name) or os.path.commonpath((folder, path)) != folder:
        raise bad_file(
            f"{name} lies outside the folder of the model file; a model file can name only files in its own folder"
        )
    return path


# -- plain files are read; a pipe, a device or a folder is refused -----------------------------------------------------


#: What a name may stand for that is not a plain file.
KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


class MissingFileError(FileNotFoundError, UsageError, code="EG-FILE"):
    """There is no such file; a FileNotFoundError too, as Python's own ``open`` raises."""


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
        It is not a plain file, or the path is none, such as one with NUL; it is not there (a FileNotFoundError too).
    OSError
        It cannot be read.
    """
    name = as_name("path", path)
    try:
        status = os.stat(name, follow_symlinks=follow)
    except FileNotFoundError as error:
        raise MissingFileError(error.errno, error.strerror, name) from None
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


# -- results are written whole, or not at all --------------------------------------------------------------------------


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


# -- who could have written a file -------------------------------------------------------------------------------------


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


# -- locks of folders and files ----------------------------------------------------------------------------------------


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
    """A folder of such files.

    Parameters
    ----------
    folder : Path
        Made when the first file is written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def read(self, name: str) -> bytes | None:
        """The content of a file, or None.

        Raises
        ------
        ToolchainError
            Another user could have written it.
        """
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

    def names(self) -> Iterator[str]:
        """What is there, the remains of killed writers too."""
        with suppress(OSError):
            yield from sorted(os.listdir(self.folder))

    def remove(self, name: str) -> None:
        """Remove a file."""
        with suppress(OSError):
            (self.folder / name).unlink()


def _kept_seal(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + b"\0" + content).digest()


# -- a published build and its manifest --------------------------------------------------------------------------------


MANIFEST = "manifest.json"


def digest(data: bytes) -> str:
    """SHA-256 as 64 digits."""
    return hashlib.sha256(data).hexdigest()


def sealed(manifest: Mapping[str, Any]) -> str:
    """The text of a manifest with its seal."""
    return json.dumps({**manifest, "seal": _seal(manifest)}, indent=1)


def read_manifest(directory: Path) -> dict[str, Any]:
    """The manifest of an entry as it was written.

    Raises
    ------
    ValueError
        It is damaged.
    OSError
        It cannot be read.
    ToolchainError
        Another user could have written it.
    """
    require_trusted(directory)
    try:
        manifest = json.loads(read_trusted(directory / MANIFEST))
        if manifest.pop("seal") != _seal(manifest):
            raise ValueError("the seal is broken")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"the manifest in {directory} is damaged: {error}") from None
    found: dict[str, Any] = manifest
    return found


def read_entry(directory: Path) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The manifest of an entry and the bytes of all its files, each as it was published.

    Raises
    ------
    ValueError
        Something is damaged.
    OSError
        Something is missing.
    ToolchainError
        Another user could have written it.
    """
    manifest = read_manifest(directory)
    files: dict[str, str] = manifest["files"]
    for folder in {PurePosixPath(name).parent for name in files}:
        require_trusted(directory / folder)
    found = {name: read_trusted(directory / name) for name in files}
    for name, data in found.items():
        if digest(data) != files[name]:
            raise ValueError(f"{directory / name} is damaged")
    return manifest, found


def _seal(manifest: Mapping[str, Any]) -> str:
    return digest(json.dumps(manifest, sort_keys=True).encode())


# -- the text of a Python module -> the module -------------------------------------------------------------------------


_loaded: WeakValueDictionary[str, Any] = WeakValueDictionary()


class _Text(importlib.abc.SourceLoader):
    def __init__(self, path: str, data: bytes) -> None:
        self.path, self.data = path, data

    def get_filename(self, fullname: str) -> str:
        return self.path

    def get_data(self, path: Any) -> bytes:
        return self.data


def load_source(name: str, path: str, data: bytes, given: Mapping[str, Any] | None = None) -> ModuleType:
    """Make a module from its text.

    Parameters
    ----------
    name : str
        Of the module; relative imports go by it.
    path : str
        What ``__file__`` says; not read.
    data : bytes
        The text.
    given : mapping, optional
        What the module knows before it runs.
    """
    loader = _Text(path, data)
    spec = importlib.util.spec_from_file_location(name, path, loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    vars(module).update(given or {})
    loader.exec_module(module)
    if not given:  # given other things, it is another module
        _loaded[name] = getattr(module, "model", module)
    return module


def keep_module(name: str, module: Any) -> Any:
    """Let a module, or the core of a model, be found by name as long as somebody uses it; the one that is kept."""
    return _loaded.setdefault(name, module)


def find_module(name: str) -> Any:
    """What is loaded under a name, here or by Python's import; None if there is none."""
    found = _loaded.get(name)
    return sys.modules.get(name) if found is None else found


# -- templates and examples: inside the package where installed, beside it in a clone ----------------------------------


_PACKAGE = Path(__file__).parents[1]


def shipped(name: str) -> Path:
    """A folder: ``templates`` or ``examples``."""
    clone = _PACKAGE.parent
    beside = not (_PACKAGE / name).is_dir() and (clone / "pyproject.toml").is_file()
    return (clone if beside else _PACKAGE) / name


def example_files() -> dict[str, Path]:
    """Every example by what to call it: a model file by its name alone, others with their suffix.

    Those in the folder ``large`` take seconds to compile, or move far where a centimetre is much.
    """
    found = {}
    folder = shipped("examples")
    for file in sorted([*folder.iterdir(), *(folder / "large").iterdir()], key=lambda f: f.name):
        if file.name.endswith(".yaml"):
            found[file.name.removesuffix(".yaml")] = file
        elif file.name.endswith(".urdf") or (file.name.endswith(".py") and not file.name.startswith("_")):
            found[file.name] = file
    return found


def find_example(name: str, found: dict[str, Path]) -> Path | None:
    """The file of an example, which may be called with or without its suffix."""
    return found.get(name) or found.get(name.removesuffix(".yaml")) or found.get(f"{name}.urdf")
