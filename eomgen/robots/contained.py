"""Robots, files that a model names -> their bytes, read from one folder and nowhere else.

MuJoCo is never given a name from a model: what it may read is read here and handed to it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence

from ..base.files import open_plain
from ..base.limits.numbers import NAME
from ..errors import ModelError, Problem, UsageError
from .xml_text import XmlElement

_ELSEWHERE = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:/")  # a drive, or the scheme of a URL


def plain(name: str) -> str:
    """A name in a model with the separators of this machine: MuJoCo takes backslashes for slashes."""
    return name.replace("\\", "/")


def stem(name: str) -> str:
    """The name that MuJoCo gives what has a file and no name: the file's without folders and its last suffix."""
    base = plain(name).rpartition("/")[2]
    return base.rpartition(".")[0] if "." in base else base


class Folder:
    """A folder that files are read from; links that lead out of it are not followed."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = os.path.realpath(path)

    def holds(self, path: str) -> bool:
        """Whether a path without links is this folder or lies in it."""
        return path == self.path or path.startswith(os.path.join(self.path, ""))

    def find(self, element: XmlElement, name: str, bases: Iterable[Sequence[str]]) -> str | Problem:
        """Where a file is that an element names.

        Parameters
        ----------
        element : XmlElement
        name : str
            As the element has it.
        bases : iterable of sequences of str
            Folders within folders that the name may start from, the first that has it counts.

        Returns
        -------
        str or Problem
            A path without links inside the folder; a problem where it lies outside, or nowhere.
        """
        path, remedy = f"{element.tag}.file", "give its path from the model's folder"
        if not name or len(name) > NAME:
            message = "names no file" if not name else f"{name[:20]!r}... is too long for the name of a file"
            return element.problem(path, message, f"at most {NAME:,} characters" if name else remedy, "EG-FILE")
        for base in bases:
            steps = [plain(step) for step in (*base[1:], name)]
            place = os.path.realpath(os.path.join(base[0], *steps))
            if not self.holds(place) or (os.name == "posix" and any(map(_ELSEWHERE.match, steps))):
                message = f"{name!r} is outside the folder {self.path}, so it is not read"
                remedy = "name a folder that holds all files of the model: assets=..., or --assets"
                return element.problem(path, message, remedy, "EG-FILE")
            if os.path.isfile(place):
                return place
        return element.problem(path, f"{name!r} cannot be read: no plain file has that name", remedy, "EG-FILE")

    def read(self, element: XmlElement, path: str, most: int) -> bytes:
        """The bytes of a file that :meth:`find` found.

        Raises
        ------
        ModelError
            It is not a plain file (a pipe, a device), has more than ``most`` bytes, or cannot be read.
        """
        try:
            with open_plain(path, follow=False) as file:
                data = file.read(most + 1)
        except (OSError, MemoryError, UsageError) as error:
            raise self._refusal(element, path, f"cannot be read: {getattr(error, 'strerror', error)}") from None
        if len(data) > most:
            raise self._refusal(element, path, "is too large", f"at most {most:,} bytes are left for it")
        return data

    def _refusal(self, element: XmlElement, path: str, message: str, remedy: str = "") -> ModelError:
        return ModelError([element.problem(f"{element.tag}.file", f"{path} {message}", remedy, "EG-FILE")])
