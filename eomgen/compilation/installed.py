"""Installed: what the build of the package made of the layer -> its files, if they are what a build here would make.

The layer depends on no model. So ``setup.py`` translates it when eomgen is installed, and compiles it where there is a
compiler, into the folder ``built`` of the package. Entries bear the keys that they would have in the cache (texts,
flags, compiler, interpreter, NumPy, Cython): what was made by another compiler or for another computer is not found.
Who owns the folder is not asked: whoever could write it could write the code beside it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ..base.files import MANIFEST, digest

FOLDER = Path(__file__).parents[1] / "built"


class Installed(NamedTuple):
    """An entry that came with the package.

    Attributes
    ----------
    directory : Path
    facts : dict
        What was noted of it.
    """

    directory: Path
    facts: dict[str, Any]


def find_installed(key: str) -> Installed | None:
    """The entry of a key, if it is there and every file is as it was written."""
    directory = FOLDER / key
    try:
        manifest = json.loads((directory / MANIFEST).read_bytes())
        files, facts = manifest["files"], dict(manifest["facts"])
        if manifest["key"] != key or any(digest((directory / name).read_bytes()) != files[name] for name in files):
            return None
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None
    return Installed(directory, facts)


def write_installed(folder: Path, key: str, files: Mapping[str, bytes], facts: Mapping[str, Any]) -> None:
    """Write an entry into a folder that becomes ``built`` of a package."""
    directory = folder / key
    directory.mkdir(parents=True)
    for name, data in files.items():
        (directory / name).write_bytes(data)
    manifest = {"key": key, "files": {name: digest(data) for name, data in files.items()}, "facts": dict(facts)}
    (directory / MANIFEST).write_text(json.dumps(manifest, indent=1, sort_keys=True), encoding="ascii")
