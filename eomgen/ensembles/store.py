"""Finished blocks <-> files in a folder, so that a run that was stopped goes on where it was."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..base.files import as_path, open_plain, remove_parts, write_whole
from ..errors import UsageError, bad_data, bad_file
from ..runtime.arrays import BROKEN, read_arrays, sealed
from .run_blocks import LARGEST

FORMAT = "eomgen ensemble 2"


class Store:
    """A folder with a file for each finished block and a manifest that says which ensemble they belong to.

    Parameters
    ----------
    folder : str or Path
        Made if it is not there.
    identity : dict
        What the results depend on, JSON-like.

    Raises
    ------
    UsageError
        The folder belongs to another ensemble, or holds something else.
    """

    def __init__(self, folder: str | Path, identity: dict[str, Any]) -> None:
        self.folder = as_path("store", folder)
        manifest = self.folder / "manifest.json"
        self._identity = json.dumps({"format": FORMAT, **identity})
        wanted = json.loads(self._identity)
        if manifest.is_file():
            self._compare(manifest, wanted)
            return
        remove_parts(manifest)  # of a call that was killed before the manifest was there
        if self.folder.is_dir() and any(self.folder.iterdir()):
            raise bad_file(f"store {self.folder} is not empty and does not contain an ensemble; name another folder")
        self.folder.mkdir(parents=True, exist_ok=True)
        write_whole(manifest, json.dumps(wanted, indent=1).encode())

    def _compare(self, manifest: Path, wanted: dict[str, Any]) -> None:
        try:
            with open_plain(manifest) as file:
                found = json.load(file)
        except (ValueError, RecursionError):
            found = {}
        found = found if isinstance(found, dict) else {}
        differing = sorted(name for name in {*wanted, *found} if wanted.get(name) != found.get(name))
        if differing:
            raise bad_data(
                f"store {self.folder} belongs to another ensemble: {', '.join(differing)} differ; "
                "name another folder or remove this one"
            )

    def _path(self, index: int) -> Path:
        return self.folder / f"block_{index:06d}.npz"

    def _key(self, index: int) -> str:
        """What the seal of a block covers besides its numbers: one of another place or ensemble is none of these."""
        return f"{index} {self._identity}"

    def save(self, index: int, arrays: dict[str, Any], words: dict[int, str]) -> None:
        """Keep the arrays of a block; complete or not there."""
        import io

        buffer = io.BytesIO()
        messages = np.array(json.dumps({str(k): text for k, text in words.items()}))
        np.savez(buffer, **sealed({**arrays, "words": messages}, self._key(index)))
        write_whole(self._path(index), buffer.getvalue())

    def load(self, index: int) -> tuple[dict[str, Any], dict[int, str]] | None:
        """The arrays of a block, or None if it was not finished."""
        remove_parts(self._path(index))
        try:
            arrays = read_arrays(self._path(index), compressed=False, key=self._key(index))
            words = json.loads(str(arrays.pop("words")))
            return arrays, {int(k): str(text) for k, text in words.items()}
        except FileNotFoundError:
            return None
        except BROKEN as error:
            raise self.damaged(index, error) from None

    def damaged(self, index: int, why: object) -> UsageError:
        """The error for a block that cannot be taken."""
        return bad_data(f"{self._path(index)} cannot be read: {why}; remove it to run its block again")


def stored_length(folder: str | Path) -> int | None:
    """Runs of a block of the ensemble that a folder holds; None if it holds none."""
    try:
        with open_plain(as_path("store", folder) / "manifest.json") as file:
            found = json.load(file)["block"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return found if type(found) is int and 0 < found <= LARGEST else None
