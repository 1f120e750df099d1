"""Kept: small files in a folder of the cache, each behind the SHA-256 of its name and content.

One that was cut, changed or renamed counts as not there.  They may be lost at any time: nothing depends on them.
"""

from __future__ import annotations

import hashlib
import os
import secrets
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from .ownership import make_private, read_trusted, require_trusted


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
        return content if seal == _seal(name, content) else None

    def write(self, name: str, content: bytes) -> None:
        """Keep a file, if the folder can be written."""
        part = self.folder / f".{secrets.token_hex(8)}"
        try:
            make_private(self.folder)
            require_trusted(self.folder)
            with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
                file.write(_seal(name, content) + content)
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


def _seal(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + b"\0" + content).digest()
