"""Shortcut: a program that was compiled before -> its Artifact, without writing its sources again.

Sources follow from the program, from the code that writes them and from the templates; flags from the options, the
compiler and the code that chooses them.  A note in the cache under the digest of all of these tells the key of the
build.  It is no more than a hint where to look: the entry itself is checked as ever.
"""

from __future__ import annotations

import hashlib
import os
import time
from dataclasses import asdict
from functools import cache

from .. import _STARTED
from ..base.files import shipped
from .build import Artifact, describe_platform
from .cache import Cache, cache_directory, compute_key
from .compiler import find_compiler
from .options import Options
from .processor import lane_width

#: What sources, layer and flags follow from, apart from the program and the templates: of eomgen.
WRITERS = ("graph", "codegen", "compilation", "base", "numeric", "native", "layer.py")


class Shortcut:
    """Where the build of a program is noted.

    Parameters
    ----------
    fingerprint : str or None
        Of the program; None: nothing is looked up or noted.
    options : Options
    """

    def __init__(self, fingerprint: str | None, options: Options) -> None:
        self.cache = Cache(cache_directory())
        self.note: str | None = None
        if fingerprint is None or options.native:  # what "native" means takes the compiler as long to say
            return
        if changed_since(_STARTED):  # the files are not the code that runs
            return
        compiler = find_compiler(options.compiler)
        parts = {
            "kind": "shortcut", "program": fingerprint, "writers": digest_writers(), "options": asdict(options),
            "compiler": [*compiler.command, compiler.version], "platform": describe_platform(),
            "lanes": lane_width(),
        }  # fmt: skip
        self.note = compute_key(parts)

    def find(self) -> Artifact | None:
        """The build, if it was noted and is there."""
        start = time.perf_counter()
        if self.note is None:
            return None
        key = (self.cache.shortcuts.read(self.note) or b"").decode("ascii", "replace")
        entry = self.cache.find(key) if key else None
        if entry is None or entry.kind != "model":
            return None
        return Artifact(entry.product, entry.key, entry.directory, time.perf_counter() - start, True, entry.name)

    def keep(self, artifact: Artifact) -> None:
        """Note a build; a cache that cannot be written still serves."""
        if self.note is not None:
            self.cache.shortcuts.write(self.note, artifact.key.encode())


def changed_since(moment: float) -> bool:
    """Whether any of that code was written, or put in its place, after a moment."""
    return any(max(found.st_mtime, found.st_ctime) > moment for found in map(os.stat, writers()))


@cache
def digest_writers() -> str:
    """SHA-256 of the code and templates that sources, layer and flags follow from."""
    found = hashlib.sha256()
    for path in writers():
        with open(path, "rb", buffering=0) as file:
            text = file.read()
        found.update(f"{os.path.basename(path)} {len(text)}\n".encode())
        found.update(text)
    return found.hexdigest()


def writers() -> list[str]:
    """The files of that code."""
    root = os.path.dirname(os.path.dirname(__file__))
    found = [os.path.join(root, *name.split("/")) for name in WRITERS if name.endswith(".py")]
    folders = [os.path.join(root, name) for name in WRITERS if not name.endswith(".py")]
    folders.append(str(shipped("templates")))
    while folders:  # os.walk, at half its time
        with os.scandir(folders.pop()) as entries:
            listed = sorted(entries, key=lambda entry: entry.name)
        found += [entry.path for entry in listed if entry.is_file()]
        folders += [entry.path for entry in listed if entry.is_dir() and entry.name != "__pycache__"]
    return found
