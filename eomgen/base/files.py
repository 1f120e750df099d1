"""Files of a user, read and written safely.

A pipe would be waited for, and a device may have no end: both are refused.  Everything is written beside the file, made
durable, and takes its place by one rename.  A full disk, a crash or Ctrl-C so leaves the earlier file; only ``kill -9``
leaves the part that was written, as ``.NAME.XXXXXXXX`` beside it.
"""

from __future__ import annotations

import os
import secrets
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO
from weakref import WeakValueDictionary

from ..errors import UsageError, bad_file, ill_typed
from .texts import quote

# -- names -------------------------------------------------------------------------------------------------------------


def as_path(what: str, raw: Any) -> Path:
    """A path of a text or path.

    Raises
    ------
    UsageError
        It is something else (bytes too), empty, or holds what no name can: a NUL, half of a surrogate pair.
    """
    return Path(as_name(what, raw))


def as_name(what: str, raw: Any) -> str:
    """The same as text, as it was written."""
    name = usable_name(raw)
    if name is None:
        raise ill_typed(f"{what} must be the name of a file or folder, as text or Path, not {quote(raw)}")
    return name


def usable_name(raw: Any) -> str | None:
    """The text of a path; None where it is none."""
    try:
        name = os.fspath(raw)
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
    """Open a plain file for reading, without waiting for anybody; ``follow``: also where a link leads to one.

    Refuses what is no plain file, a path that is none, such as one with NUL, and one that is not there (a
    FileNotFoundError too); an OSError says that it cannot be read.
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
    """Open a binary file for writing whose bytes replace an earlier file when the block ends without an exception.

    The mode of an earlier file stays, its owner and group where that is allowed.  Missing folders are made.  A device
    or pipe is written as it is, and so is one that a link leads to.  A symbolic link to a file, a folder or nothing is
    refused: its target is not the file that was named.  An OSError, with the path as ``filename``, says that it cannot
    be written; the earlier file is as it was.
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
    """
    if not path.is_symlink():
        return
    result = _status(path)
    if result is not None and not (stat.S_ISREG(result.st_mode) or stat.S_ISDIR(result.st_mode)):
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
    status = os.fstat(descriptor)
    mode = stat.S_IMODE(earlier.st_mode)
    if (status.st_uid, status.st_gid) != (earlier.st_uid, earlier.st_gid):
        try:
            os.fchown(descriptor, earlier.st_uid, earlier.st_gid)
        except OSError:
            mode &= 0o755  # rights of a group that is not the file's any more
            if status.st_gid != earlier.st_gid:
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


# -- modules and cores of models that are loaded outside of Python's own -----------------------------------------------


MANIFEST = "manifest.json"  #: of a build in the cache, beside its files
LOADED: WeakValueDictionary[str, Any] = WeakValueDictionary()


def keep_module(name: str, module: Any) -> Any:
    """Let a module, or the core of a model, be found by name as long as somebody uses it; the one that is kept."""
    return LOADED.setdefault(name, module)


def find_module(name: str) -> Any:
    """What is loaded under a name, by eomgen or by Python's import; None if there is none."""
    result = LOADED.get(name)
    return sys.modules.get(name) if result is None else result


# -- what eomgen ships: inside the package where installed, beside it in a clone --------------------------------------


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
    result = {}
    folder = shipped("examples")
    for file in sorted([*folder.iterdir(), *(folder / "large").iterdir()], key=lambda f: f.name):
        if file.name.endswith(".yaml"):
            result[file.name.removesuffix(".yaml")] = file
        elif file.name.endswith(".urdf") or (file.name.endswith(".py") and not file.name.startswith("_")):
            result[file.name] = file
    return result


def find_example(name: str, files: dict[str, Path]) -> Path | None:
    """The file of an example, which may be called with or without its suffix."""
    return files.get(name) or files.get(name.removesuffix(".yaml")) or files.get(f"{name}.urdf")
