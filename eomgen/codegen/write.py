"""The files of a package -> a folder that holds them, and none that an earlier generation left."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..base.files import open_plain, refuse_link
from ..errors import UsageError, bad_file

MANIFEST = "model.json"  #: lists the files of the package under "files"


def write_package(sources: Mapping[str, str], folder: Path) -> Path:
    """Write a package so that no file is ever half there.

    Files of an earlier generation that are not part of this one are removed; others are left alone.

    Parameters
    ----------
    sources : mapping of str to str
        Relative file names and their text; ``model.json`` among them.
    folder : Path

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    UsageError
        The folder holds something else, or a file in the way that eomgen did not write; the folder, or one in it that
        files go to, is a symbolic link.
    """
    _refuse_links(folder, sources)
    earlier = _earlier_files(folder)
    for name in sources:
        if earlier is not None and name not in earlier and os.path.lexists(folder / name):
            raise bad_file(f"{folder / name} exists and was not written by eomgen; move it, or choose another --out")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as private:
        stage = Path(private) / folder.name
        try:
            for name, text in {**sources, MANIFEST: _with_files(sources)}.items():
                (stage / name).parent.mkdir(parents=True, exist_ok=True)
                (stage / name).write_text(text, encoding="utf-8")
        except OSError as error:  # most often a full disk; nothing is in its place yet
            raise OSError(error.errno, error.strerror, str(folder)) from error
        if not folder.exists():
            os.rename(stage, folder)
            return folder
        for name in sorted(sources, key=lambda name: name == MANIFEST):  # the list of files last
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            _refuse_links(folder, (name,))
            os.replace(stage / name, folder / name)
    for name in sorted((earlier or set()) - set(sources)):
        _remove(folder, name)
    return folder


def _refuse_links(folder: Path, names: Iterable[str]) -> None:
    """Refuse links that lead elsewhere: the folder itself, and those in it that files go to.

    A link in the place of a file needs no refusal: the file replaces it.
    """
    refuse_link(folder)
    inner = {parent for name in names for parent in Path(name).parents if parent.name}
    for path in sorted(inner):
        refuse_link(folder / path)


def _earlier_files(folder: Path) -> set[str] | None:
    """Files that eomgen wrote here; None if it kept no list."""
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return set()
    try:
        with open_plain(folder / MANIFEST) as file:
            listed: Any = json.load(file)
        if not isinstance(listed, dict) or "abi" not in listed:
            raise ValueError
    except (OSError, ValueError, RecursionError, UsageError):
        message = f"{folder} exists and is not a generated package; choose another --out or remove it"
        raise bad_file(message) from None
    files = listed.get("files")
    return {name for name in files if isinstance(name, str)} if isinstance(files, list) else None


def _with_files(sources: Mapping[str, str]) -> str:
    """model.json with the list of files."""
    data = json.loads(sources[MANIFEST]) | {"files": sorted(sources)}
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def _remove(folder: Path, name: str) -> None:
    """Remove a file of an earlier generation, with its folders if nothing else is in them."""
    path = folder / name
    if Path(name).is_absolute() or ".." in Path(name).parts:
        return  # not a name that eomgen wrote
    if any(parent.is_symlink() for parent in path.parents if parent.is_relative_to(folder)):
        return  # the file lies elsewhere
    with suppress(FileNotFoundError):
        path.unlink()
    for parent in path.parents:
        if parent == folder:
            return
        shutil.rmtree(parent / "__pycache__", ignore_errors=True)  # of modules that are gone
        try:
            parent.rmdir()
        except OSError:
            return
