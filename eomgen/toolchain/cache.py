"""Cache: what a build depends on -> its published directory, complete or absent.

A build works in a private directory under ``attempts/``, writes its manifest last, and is published by one rename to
``entries/<key>``. So an entry is complete or not there, a killed build leaves only an attempt to sweep, and of two
processes that build the same thing the second to finish takes the first one's entry.

What an entry holds is loaded as code. It counts only while every file is as its sealed manifest says, and while nobody
but this user and root could have written it, or any folder above it; see :mod:`.trusted_files`.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from .. import _STARTED
from ..base.files import MANIFEST, shipped
from ..errors import ToolchainError, bad_cache
from . import trusted_files as files
from .trusted_files import Kept, digest

#: Layout of keys, entries and manifests; part of every key.
FORMAT = 3
#: Age in seconds after which an attempt is taken for abandoned, if no process holds it.
GRACE = 3600.0


def cache_directory() -> Path:
    """Where builds are kept: the environment variable EOMGEN_CACHE_DIR, else eomgen's folder in the user's cache.

    Raises ToolchainError (neither can be told: there is no home directory, no such user, no current directory).
    """
    chosen = os.environ.get("EOMGEN_CACHE_DIR")
    try:
        if chosen:
            return Path(chosen).expanduser().absolute()
        from platformdirs import user_cache_path

        result = user_cache_path("eomgen", appauthor=False)
        if str(result).startswith("~"):
            raise RuntimeError("this user has no home directory")
        return result.absolute()
    except (RuntimeError, OSError) as error:
        origin = f"EOMGEN_CACHE_DIR={chosen!r}: " if chosen else ""
        raise bad_cache(
            f"{origin}the cache directory is not known: {error}. Set EOMGEN_CACHE_DIR to a directory of your own"
        ) from error


def compute_key(parts: Mapping[str, Any]) -> str:
    """SHA-256 of everything a build depends on, given as JSON-like data."""
    text = json.dumps({"format": FORMAT, **parts}, sort_keys=True)  # in ASCII: names of files may be no proper text
    return digest(text.encode())


class CacheEntry(NamedTuple):
    """A published build."""

    key: str  #: SHA-256 of everything it depends on
    kind: str  #: ``model``, ``library``, ``lanes``, ``object``, ``numpy`` or ``web``
    name: str  #: of the model
    directory: Path  #: where it lies; ``sources/`` in it holds the texts that a model was made from
    product: Path  #: the file to load or link
    size: int  #: bytes of all its files
    created: float  #: when it was built, in seconds since 1970
    used: float  #: when it was last used


@dataclass(frozen=True, slots=True)
class Cache:
    """The builds below one directory, which is made when the first build needs it, readable by its owner alone."""

    root: Path

    @property
    def _entries(self) -> Path:
        return self.root / "entries"

    @property
    def _attempts(self) -> Path:
        return self.root / "attempts"

    @property
    def templates(self) -> Kept:
        """Bytecode of templates."""
        return Kept(self.root / "templates")

    def find(self, key: str) -> CacheEntry | None:
        """The entry of a key if it is there and every file is as it was published; notes that it was used.

        Raises ToolchainError (another user could have written it).
        """
        directory = self._entries / key
        if not os.path.isdir(directory):
            return None
        try:
            self.require_owner()
            entry = _describe(directory, files.read_entry(directory)[0])
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None
        if entry.key != key:
            return None
        with suppress(OSError):  # a cache that cannot be written still serves
            os.utime(directory / MANIFEST)
        return entry

    def require_owner(self) -> None:
        """Refuse a cache whose folders others own or can write. Raises ToolchainError."""
        for folder in (self.root, self._entries, self._attempts):
            if os.path.lexists(folder):
                files.require_trusted(folder)

    def make(
        self, key: str, kind: str, name: str, build: Callable[[Path], tuple[str, Mapping[str, Any]]]
    ) -> CacheEntry:
        """The entry of a key, built if need be, by one rename; or that of another process which was faster.

        ``build`` puts the files to keep, and nothing else, into a private directory, and returns the name of the file
        to load or link and how it was made: compiler, flags, options.
        """
        if (entry := self.find(key)) is not None:
            return entry
        with self._attempt(key) as directory:
            product, recipe = build(directory)
            return self._publish(directory, key, kind, name, product, recipe)

    @contextmanager
    def _attempt(self, key: str) -> Iterator[Path]:
        """A private directory to build in; removed at the end unless published, kept after a ToolchainError."""
        try:
            for folder in (self.root, self._entries, self._attempts):
                files.make_private(folder)
                files.require_trusted(folder)
            self.sweep()
            directory = self._make_attempt(key[:16])
        except OSError as error:
            raise bad_cache(
                f"the cache directory {self.root} cannot be written: {error}. "
                "Set EOMGEN_CACHE_DIR to a directory that can"
            ) from error
        try:
            with files.hold(directory):  # so that no other process sweeps it
                yield directory
        except ToolchainError:
            raise  # its message names files in here
        except BaseException as error:
            shutil.rmtree(directory, ignore_errors=True)
            if isinstance(error, OSError):
                raise bad_cache(f"cannot build in the cache directory {self.root}: {error}") from error
            raise
        shutil.rmtree(directory, ignore_errors=True)

    def _make_attempt(self, prefix: str) -> Path:
        from tempfile import mkdtemp

        return Path(mkdtemp(prefix=f"{prefix}-", dir=self._attempts))

    def _publish(
        self, attempt: Path, key: str, kind: str, name: str, product: str, recipe: Mapping[str, Any]
    ) -> CacheEntry:
        paths = sorted(attempt.rglob("*"))
        for path in paths:  # whatever the umask of the compiler
            path.chmod(path.stat().st_mode & ~files.OTHERS_WRITE)
        contents = {str(path.relative_to(attempt)): path.read_bytes() for path in paths if path.is_file()}
        manifest = {
            "key": key, "kind": kind, "name": name, "product": product, "created": time.time(),
            "size": sum(map(len, contents.values())),
            "files": {file: digest(content) for file, content in contents.items()}, "recipe": dict(recipe),
        }  # fmt: skip
        with open(os.open(attempt / MANIFEST, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii") as f:
            f.write(files.sealed(manifest))
        target = self._entries / key
        for _ in range(10):
            with files.locked(self.root / "lock"):
                try:
                    os.rename(attempt, target)
                except OSError as error:
                    if error.errno not in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR, errno.EACCES):
                        raise
                    if not os.path.lexists(target):
                        raise  # the folder cannot be written
                    if (entry := self.find(key)) is not None:
                        return entry
                    self._remove(target)  # damaged, and nobody mends it meanwhile
                else:
                    return _describe(target, manifest)
        raise bad_cache(f"the damaged cache entry {target} cannot be replaced; remove it by hand")

    def entries(self) -> list[CacheEntry]:
        """Every readable entry, the most recently used first."""
        result = []
        for directory in self._entries.iterdir() if self._entries.is_dir() else ():
            with suppress(OSError, ValueError, KeyError, TypeError, ToolchainError):
                result.append(_describe(directory, files.read_manifest(directory)))
        return sorted(result, key=lambda entry: entry.used, reverse=True)

    def prune(self, older_than: float | None = None, max_size: int | None = None) -> list[CacheEntry]:
        """Remove and return what was not used for so many seconds, and the oldest until so many bytes are left."""
        self.require_owner()
        now, total, removed = time.time(), 0, []
        for entry in self.entries():
            total += entry.size
            if entry.used > now:  # by a clock that was wrong then, or is now
                with suppress(OSError):
                    os.utime(entry.directory / MANIFEST)
            aged = older_than is not None and now - entry.used > older_than
            if aged or (max_size is not None and total > max_size):
                self._remove(entry.directory)
                total -= entry.size
                removed.append(entry)
        self.sweep()
        return removed

    def clear(self) -> int:
        """Remove every entry and abandoned attempt; returns the number of entries removed."""
        self.require_owner()
        directories = list(self._entries.iterdir()) if self._entries.is_dir() else []
        for directory in directories:
            self._remove(directory)
        shutil.rmtree(self.templates.folder, ignore_errors=True)
        self.sweep()
        return len(directories)

    def discard(self, key: str) -> None:
        """Remove the entry of a key that turned out to be of no use, if it can be removed."""
        with suppress(ToolchainError):
            self.require_owner()
            with files.locked(self.root / "lock"):
                self._remove(self._entries / key)

    def sweep(self) -> None:
        """Remove attempts that nobody holds and nobody has touched for GRACE; in the future: a wrong clock."""
        for attempt in self._attempts.iterdir() if self._attempts.is_dir() else ():
            with suppress(OSError):  # another process may sweep too
                if abs(time.time() - attempt.stat().st_mtime) > GRACE:
                    with files.hold(attempt):
                        shutil.rmtree(attempt)

    def _remove(self, entry: Path) -> None:
        """Remove an entry, which disappears at once and is then taken apart."""
        try:
            files.make_private(self._attempts)
            away = self._make_attempt("removed")
            with suppress(FileNotFoundError):
                os.rename(entry, away / entry.name)
            shutil.rmtree(away, ignore_errors=True)
        except OSError as error:
            raise bad_cache(f"the cache entry {entry} cannot be removed: {error}") from error


def _describe(directory: Path, manifest: Mapping[str, Any]) -> CacheEntry:
    kept = {name: manifest[name] for name in ("key", "kind", "name", "size", "created")}
    used = (directory / MANIFEST).stat().st_mtime
    return CacheEntry(**kept, directory=directory, product=directory / manifest["product"], used=used)


# -- the code that writes sources --------------------------------------------------------------------------------------

#: What sources and flags follow from, apart from the program and the templates: of eomgen.
WRITERS = ("expr", "codegen", "toolchain", "base", "native")


def digest_writers() -> str | None:
    """SHA-256 of the code and templates that sources and flags follow from; None if they changed since they ran."""
    result, package = hashlib.sha256(), Path(__file__).parents[1]
    folders = [*(str(package / name) for name in WRITERS), str(shipped("templates"))]
    while folders:  # os.walk, at half its time
        with os.scandir(folders.pop()) as listing:
            listed = sorted(listing, key=lambda entry: entry.name)
        folders += [entry.path for entry in listed if entry.is_dir() and entry.name != "__pycache__"]
        for entry in listed:
            if entry.is_file():
                with open(entry.path, "rb", buffering=0) as file:
                    state, text = os.fstat(file.fileno()), file.read()
                if max(state.st_mtime, state.st_ctime) > _STARTED:
                    return None
                result.update(f"{entry.name} {len(text)}\n".encode() + text)
    return result.hexdigest()
