"""All blocks of an ensemble -> what is kept of each: on threads, and in files of a folder."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.files import as_path, open_plain, remove_parts, write_whole
from ..errors import UsageError, bad_data, bad_file
from ..runtime.arrays import BROKEN, read_arrays, sealed
from .block import COUNTS, Plan, RunBlock, run_block
from .given_cases import Cases
from .reductions import GRAIN, Arrays, Reduction

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


# -- finished blocks in files ------------------------------------------------------------------------------------------


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


# -- blocks ------------------------------------------------------------------------------------------------------------


LARGEST = 16 * GRAIN  #: runs of a block at most
ROOM = 2**26  #: bytes of samples of a block, roughly
RUNS = ("t", "status", "failure", "failure_time", *COUNTS)

#: What is kept of a block, and what is to be said about its runs.
Kept = tuple[Arrays, dict[int, str]]


def reduce_block(
    module: BoundModel, cases: Cases, plan: Plan, reduction: Reduction, threads: int = 1, watch: Any = None
) -> Kept:
    """Run a block and keep of it what a reduction makes, with the numbers of each run under ``runs_``."""
    block = run_block(module, cases, plan, threads, watch)
    return keep(module, cases, plan, reduction, block, block.words)


def keep(
    module: BoundModel, cases: Cases, plan: Plan, reduction: Reduction, block: RunBlock, words: dict[int, str]
) -> Kept:
    """What a reduction makes of a block, and the numbers of each run."""
    numbers = {f"runs_{name}": getattr(block, name).copy() for name in RUNS}  # a user's function may change the block
    return {**reduction.reduce(module, cases, plan, block), **numbers}, words


def choose_size(count: int, bytes_of_a_run: int, workers: int = 1) -> int:
    """Runs of a block: several blocks for each of several workers, in whole grains, within the room."""
    shared = -(-count // (4 * workers)) if workers > 1 else count
    whole = min(max(-(-shared // GRAIN), 1) * GRAIN, LARGEST)
    fitting = max(ROOM // max(bytes_of_a_run, 1), 1)
    return whole if whole <= fitting else max(fitting // GRAIN * GRAIN, min(fitting, GRAIN))


def split(count: int, size: int) -> list[tuple[int, int]]:
    """First and last + 1 of every block; one empty block where there are no runs."""
    return [(start, min(start + size, count)) for start in range(0, max(count, 1), size)]


def run_local(
    module: BoundModel,
    cases: Cases,
    plan: Plan,
    reduction: Reduction,
    parts: list[tuple[int, int]],
    wanted: list[int],
    threads: int,
    watch: Callable[[int], None] | None,
) -> Iterator[tuple[int, Kept]]:
    """Run the wanted blocks one after the other, each on all threads."""
    before = 0
    for index in wanted:
        start, stop = parts[index]

        def told(done: int, before: int = before) -> None:
            if watch is not None:
                watch(before + done)

        yield index, reduce_block(module, cases.part(start, stop), plan, reduction, threads, told)
        before += stop - start
