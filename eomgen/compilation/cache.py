"""Cache: what a build depends on -> its published directory, complete or absent.

A build works in a private directory under ``attempts/``, writes its manifest last, and is published by one rename to
``entries/<key>``. So an entry is complete or not there, a killed build leaves only an attempt to sweep, and of two
processes that build the same thing the second to finish takes the first one's entry.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import ToolchainError

#: Layout of keys, entries and manifests; part of every key.
FORMAT = 1
#: Age in seconds after which an attempt is taken for abandoned.
GRACE = 3600.0
_MANIFEST = "manifest.json"


def cache_directory() -> Path:
    """Where builds are kept: the environment variable EOMGEN_CACHE_DIR, else eomgen's folder in the user's cache."""
    if chosen := os.environ.get("EOMGEN_CACHE_DIR"):
        return Path(chosen).expanduser().absolute()
    from platformdirs import user_cache_path

    return user_cache_path("eomgen", appauthor=False)


def compute_key(parts: Mapping[str, Any]) -> str:
    """SHA-256 of everything a build depends on, given as JSON-like data."""
    text = json.dumps({"format": FORMAT, **parts}, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class CacheEntry:
    """A published build.

    Attributes
    ----------
    key : str
        SHA-256 of everything it depends on.
    kind : str
        ``extension``, ``library``, ``layer`` or ``lanes``.
    name : str
        Name of the model.
    directory : Path
        Where it lies.
    product : Path
        The file to load or link.
    size : int
        Bytes of all its files.
    created, used : float
        When it was built and last used, in seconds since 1970.
    """

    key: str
    kind: str
    name: str
    directory: Path
    product: Path
    size: int
    created: float
    used: float


@dataclass(frozen=True, slots=True)
class Cache:
    """The builds below one directory.

    Attributes
    ----------
    root : Path
        The directory; made when the first build needs it, readable by its owner alone.
    """

    root: Path

    @property
    def _entries(self) -> Path:
        return self.root / "entries"

    @property
    def _attempts(self) -> Path:
        return self.root / "attempts"

    @property
    def shortcuts(self) -> Path:
        """Folder of notes that tell keys of builds; see :mod:`.shortcut`."""
        return self.root / "shortcuts"

    def open_templates(self) -> Path | None:
        """Folder of the templates' bytecode, made if need be; None where it cannot be written."""
        folder = self.root / "templates"
        try:
            self.root.mkdir(mode=0o700, parents=True, exist_ok=True)
            _check_private(self.root)
            folder.mkdir(mode=0o700, exist_ok=True)
        except (OSError, ToolchainError):
            return None
        return folder if os.access(folder, os.W_OK) else None

    def find(self, key: str) -> CacheEntry | None:
        """The entry of a key if it is there and every file is as it was published; notes that it was used."""
        directory = self._entries / key
        try:
            manifest = json.loads((directory / _MANIFEST).read_bytes())
            for file, digest in manifest["files"].items():
                if _hash(directory / file) != digest:
                    return None
            entry = _read(directory, manifest)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None
        if entry.key != key:
            return None
        _check_private(self.root)
        with suppress(OSError):  # a cache that cannot be written still serves
            os.utime(directory / _MANIFEST)
        return entry

    @contextmanager
    def attempt(self, key: str) -> Iterator[Path]:
        """A private directory to build in; removed at the end unless published, kept after a ToolchainError."""
        directory = self._open_attempt(key)
        try:
            yield directory
        except ToolchainError:
            raise  # its message names files in here
        except OSError as error:
            shutil.rmtree(directory, ignore_errors=True)
            raise ToolchainError(f"cannot build in the cache directory {self.root}: {error}") from error
        except BaseException:
            shutil.rmtree(directory, ignore_errors=True)
            raise
        shutil.rmtree(directory, ignore_errors=True)

    def _open_attempt(self, key: str) -> Path:
        try:
            self.root.mkdir(mode=0o700, parents=True, exist_ok=True)
            _check_private(self.root)
            for directory in (self._entries, self._attempts):
                directory.mkdir(mode=0o700, exist_ok=True)
            self.sweep()
            return self._make_attempt(key[:16])
        except OSError as error:
            raise ToolchainError(
                f"the cache directory {self.root} cannot be written: {error}. "
                "Set EOMGEN_CACHE_DIR to a directory that can"
            ) from error

    def _make_attempt(self, prefix: str) -> Path:
        import tempfile

        return Path(tempfile.mkdtemp(prefix=f"{prefix}-", dir=self._attempts))

    def publish(
        self, attempt: Path, key: str, kind: str, name: str, product: str, recipe: Mapping[str, Any]
    ) -> CacheEntry:
        """Make the entry of a key from an attempt, by one rename.

        Parameters
        ----------
        attempt : Path
            Directory from :meth:`attempt`, with the files to keep and nothing else.
        key : str
            Key of the build.
        kind, name, product : str
            As in :class:`CacheEntry`; `product` is a file name.
        recipe : mapping
            What a curious person may want to know: compiler, flags.

        Returns
        -------
        CacheEntry
            The new entry, or that of another process that was faster.
        """
        files = {str(path.relative_to(attempt)): _hash(path) for path in sorted(attempt.rglob("*")) if path.is_file()}
        manifest = {
            "key": key, "kind": kind, "name": name, "product": product, "created": time.time(),
            "size": sum((attempt / file).stat().st_size for file in files),
            "files": files, "recipe": dict(recipe),
        }  # fmt: skip
        (attempt / _MANIFEST).write_text(json.dumps(manifest, indent=1), encoding="utf-8")
        target = self._entries / key
        for _ in range(10):
            try:
                os.rename(attempt, target)
            except OSError as error:
                if error.errno not in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR, errno.EACCES):
                    raise
                if (entry := self.find(key)) is not None:
                    return entry
                self._remove(target)  # damaged
            else:
                return _read(target, manifest)
        raise ToolchainError(f"the damaged cache entry {target} cannot be replaced; remove it by hand")

    def entries(self) -> list[CacheEntry]:
        """Every readable entry, the most recently used first."""
        found = []
        for directory in self._entries.iterdir() if self._entries.is_dir() else ():
            with suppress(OSError, ValueError, KeyError, TypeError):
                found.append(_read(directory, json.loads((directory / _MANIFEST).read_bytes())))
        return sorted(found, key=lambda entry: entry.used, reverse=True)

    def prune(self, older_than: float | None = None, max_size: int | None = None) -> list[CacheEntry]:
        """Remove the entries least recently used.

        Parameters
        ----------
        older_than : float, optional
            Remove what was not used for so many seconds.
        max_size : int, optional
            Remove from the oldest on until so many bytes are left.

        Returns
        -------
        list of CacheEntry
            What was removed.
        """
        now, total, removed = time.time(), 0, []
        for entry in self.entries():
            total += entry.size
            aged = older_than is not None and now - entry.used > older_than
            if aged or (max_size is not None and total > max_size):
                self._remove(entry.directory)
                total -= entry.size
                removed.append(entry)
        self.sweep()
        self._forget()
        return removed

    def clear(self) -> int:
        """Remove every entry and abandoned attempt; returns the number of entries removed."""
        directories = list(self._entries.iterdir()) if self._entries.is_dir() else []
        for directory in directories:
            self._remove(directory)
        shutil.rmtree(self.root / "templates", ignore_errors=True)
        self.sweep()
        self._forget()
        return len(directories)

    def _forget(self) -> None:
        """Remove the notes of builds that are gone."""
        for note in self.shortcuts.iterdir() if self.shortcuts.is_dir() else ():
            with suppress(OSError, ValueError):
                if not (self._entries / note.read_text(encoding="ascii")).is_dir():
                    note.unlink()

    def sweep(self, grace: float = GRACE) -> int:
        """Remove the attempts that nobody has touched for `grace` seconds; returns their number."""
        count = 0
        for attempt in self._attempts.iterdir() if self._attempts.is_dir() else ():
            with suppress(OSError):  # another process may sweep too
                if time.time() - attempt.stat().st_mtime > grace:
                    shutil.rmtree(attempt)
                    count += 1
        return count

    def _remove(self, entry: Path) -> None:
        """Remove an entry, which disappears at once and is then taken apart."""
        try:
            self._attempts.mkdir(mode=0o700, exist_ok=True)
            away = self._make_attempt("removed")
            with suppress(FileNotFoundError):
                os.rename(entry, away / entry.name)
            shutil.rmtree(away, ignore_errors=True)
        except OSError as error:
            raise ToolchainError(f"the cache entry {entry} cannot be removed: {error}") from error


def _read(directory: Path, manifest: Mapping[str, Any]) -> CacheEntry:
    return CacheEntry(
        key=manifest["key"], kind=manifest["kind"], name=manifest["name"], directory=directory,
        product=directory / manifest["product"], size=manifest["size"], created=manifest["created"],
        used=(directory / _MANIFEST).stat().st_mtime,
    )  # fmt: skip


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _check_private(root: Path) -> None:
    """Refuse a directory that others can write to: what it holds is loaded as code."""
    if not hasattr(os, "geteuid"):
        return
    status = root.stat()
    if status.st_uid not in (os.geteuid(), 0) and os.geteuid() != 0:
        raise ToolchainError(
            f"the cache directory {root} belongs to another user; set EOMGEN_CACHE_DIR to one of your own"
        )
    if status.st_mode & 0o022:
        raise ToolchainError(f"the cache directory {root} can be written by other users; run: chmod go-w {root}")
