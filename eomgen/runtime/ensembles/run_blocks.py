"""All blocks of an ensemble -> what is kept of each: states, samples, statistics; on threads, and in files."""

from __future__ import annotations

import functools
import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.algebra import Array
from ...base.files import as_path, open_plain, remove_parts, write_whole
from ...base.texts import shown
from ...errors import bad_data, bad_file, ill_typed, no_choice
from ..storage import BROKEN, read_arrays, sealed
from .block import COUNTS, EVENT, RunBlock, Runs

if TYPE_CHECKING:
    pass

# -- reductions --------------------------------------------------------------------------------------------------------

# A reduction turns a block into named arrays and joins those of all blocks in the order of the runs, so that the result
# does not depend on which was ready first.


Arrays = dict[str, Any]
GRAIN = 256  #: runs summarised at a time; fixed, so that rounding does not depend on blocks, threads or workers


class Reduction:
    """How blocks are reduced, and what is left of them joined; this one keeps arrays of them by name.

    Parameters
    ----------
    kept : sequence of str
        Of the last states ``x``, the ``samples`` where times were asked for, and the events, ``notes``.
    """

    def __init__(self, kept: Sequence[str] = ("x", "samples", "notes")) -> None:
        self.kept = tuple(kept)

    def reduce(self, runs: Runs, block: RunBlock) -> Arrays:
        """x (n_x, k), samples (n_x, m, k), notes (2 + n_x, m, k)."""
        return {name: getattr(block, name) for name in self.kept if getattr(block, name) is not None}

    def join(self, parts: Sequence[Arrays]) -> Arrays:
        """Side by side."""
        return {name: np.concatenate([part[name] for part in parts], axis=-1) for name in parts[0]}


class Statistics(Reduction):
    """Count, mean, variance, least and greatest of every state and output over the runs that got there.

    Means and variances of blocks are merged as in T. F. Chan, G. H. Golub, R. J. LeVeque, Algorithms for computing the
    sample variance, The American Statistician 37 (1983).
    """

    def reduce(self, runs: Runs, block: RunBlock) -> Arrays:
        """count, mean, squares, least, greatest (g, n, m) of each grain; m is 1 without t_eval."""
        times = runs.plan.t_eval
        if times is None or block.samples is None:
            ended = (block.status == 0) | (block.status == EVENT)
            states, when = np.where(ended, block.x, np.nan)[:, None, :], block.t[None]
        else:
            states, when = block.samples, np.repeat(times[:, None], runs.count, axis=1)
        grains = []
        values = [runs.with_outputs(states[:, j], t) for j, t in enumerate(when)]
        for start in range(0, max(runs.count, 1), GRAIN):
            parts = [summarise(x[:, start : start + GRAIN]) for x in values]
            grains.append(stacked(parts, -1))
        return stacked(grains, 0)

    def join(self, parts: Sequence[Arrays]) -> Arrays:
        """One grain after the other, and the variance at the end."""
        grains = [{name: rows[g] for name, rows in part.items()} for part in parts for g in range(len(part["count"]))]
        total = functools.reduce(merge, grains)
        count, squares = total["count"], total.pop("squares")
        with np.errstate(invalid="ignore", divide="ignore"):
            return total | {"variance": np.where(count > 1, squares / (count - 1.0), np.nan)}


class Custom(Reduction):
    """What a user's ``function(block)`` makes of each :class:`~.block.RunBlock`, a mapping of names to arrays."""

    def __init__(self, function: Callable[[RunBlock], Mapping[str, Any]]) -> None:
        super().__init__(())
        self.function = function

    def reduce(self, runs: Runs, block: RunBlock) -> Arrays:
        """As the function says."""
        made = self.function(block)
        if not isinstance(made, Mapping) or not all(isinstance(name, str) for name in made):
            raise ill_typed(f"the function of reduce must return a mapping of names to arrays, not {made!r}")
        return {f"made_{name}": np.asarray(value) for name, value in made.items()}

    def join(self, parts: Sequence[Arrays]) -> Arrays:
        """A list of what was made of each block, for each name."""
        names = dict.fromkeys(name for part in parts for name in part)
        return {name.removeprefix("made_"): [part[name] for part in parts if name in part] for name in names}


WANTED = "reduce must be 'states', 'statistics', 'events' or a function of a block"


def choose_reduction(reduce: Any) -> Reduction:
    """The reduction that a user names: None or 'states', 'statistics', 'events', or a function of a block."""
    if callable(reduce):
        return Custom(reduce)
    if reduce is not None and not isinstance(reduce, str):
        raise ill_typed(f"{WANTED}, not {shown(reduce)}")
    if reduce in (None, "states"):
        return Reduction()
    if reduce == "events":
        return Reduction(["notes"])
    if reduce == "statistics":
        return Statistics()
    raise no_choice(f"{WANTED}, not {reduce!r}")


def summarise(values: Array) -> Arrays:
    """Count, mean, sum of squared deviations, least and greatest (n,) over what is finite in each row."""
    finite = np.isfinite(values)
    count = finite.sum(axis=1)
    some = count > 0
    mean = np.where(some, np.where(finite, values, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)
    squares = (np.where(finite, values - np.where(some, mean, 0.0)[:, None], 0.0) ** 2).sum(axis=1)
    least = np.where(finite, values, np.inf).min(axis=1, initial=np.inf)
    greatest = np.where(finite, values, -np.inf).max(axis=1, initial=-np.inf)
    extremes = {"least": np.where(some, least, np.nan), "greatest": np.where(some, greatest, np.nan)}
    return {"count": count, "mean": mean, "squares": np.where(some, squares, np.nan), **extremes}


def stacked(parts: Sequence[Arrays], axis: int) -> Arrays:
    """Arrays of the same names along a new axis."""
    return {name: np.stack([part[name] for part in parts], axis=axis) for name in parts[0]}


def merge(one: Arrays, other: Arrays) -> Arrays:
    """Both together."""
    a, b = one["count"], other["count"]
    total = np.maximum(a + b, 1)
    gap = other["mean"] - one["mean"]
    mean, squares = one["mean"] + gap * (b / total), one["squares"] + other["squares"] + gap**2 * (a * b / total)
    return {
        "count": a + b,
        "mean": np.where(a == 0, other["mean"], np.where(b == 0, one["mean"], mean)),
        "squares": np.where(a == 0, other["squares"], np.where(b == 0, one["squares"], squares)),
        "least": np.fmin(one["least"], other["least"]),
        "greatest": np.fmax(one["greatest"], other["greatest"]),
    }


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
            found = _read_manifest(self.folder)
            if differing := sorted(name for name in {*wanted, *found} if wanted.get(name) != found.get(name)):
                raise bad_data(
                    f"store {self.folder} belongs to another ensemble: {', '.join(differing)} differ; "
                    "name another folder or remove this one"
                )
            return
        remove_parts(manifest)  # of a call that was killed before the manifest was there
        if self.folder.is_dir() and any(self.folder.iterdir()):
            raise bad_file(f"store {self.folder} is not empty and does not contain an ensemble; name another folder")
        self.folder.mkdir(parents=True, exist_ok=True)
        write_whole(manifest, json.dumps(wanted, indent=1).encode())

    def _path(self, index: int) -> Path:
        return self.folder / f"block_{index:06d}.npz"

    def _key(self, index: int) -> str:
        """What the seal of a block covers besides its numbers: one of another place or ensemble is none of these."""
        return f"{index} {self._identity}"

    def save(self, index: int, arrays: dict[str, Any], words: dict[int, str]) -> None:
        """Keep the arrays of a block; complete or not there."""
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
            path = self._path(index)
            raise bad_data(f"{path} cannot be read: {error}; remove it to run its block again") from None


def _read_manifest(folder: Path) -> dict[str, Any]:
    """Which ensemble a folder holds; nothing where it holds none, or what cannot be read."""
    try:
        with open_plain(folder / "manifest.json") as file:
            found = json.load(file)
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def stored_length(folder: str | Path) -> int | None:
    """Runs of a block of the ensemble that a folder holds; None if it holds none."""
    found = _read_manifest(as_path("store", folder)).get("block")
    return found if type(found) is int and 0 < found <= LARGEST else None


# -- blocks ------------------------------------------------------------------------------------------------------------


LARGEST = 16 * GRAIN  #: runs of a block at most
ROOM = 2**26  #: bytes of samples of a block, roughly
RUNS = ("t", "status", "failure", "failure_time", *COUNTS)

#: What is kept of a block, and what is to be said about its runs.
Kept = tuple[Arrays, dict[int, str]]


def keep(runs: Runs, reduction: Reduction, block: RunBlock) -> Kept:
    """What a reduction makes of a block, and the numbers of each run under ``runs_``."""
    numbers = {f"runs_{name}": getattr(block, name).copy() for name in RUNS}  # a user's function may change the block
    return {**reduction.reduce(runs, block), **numbers}, block.words


def choose_size(count: int, bytes_of_a_run: int, workers: int = 1) -> int:
    """Runs of a block: several blocks for each of several workers, in whole grains, within the room."""
    shared = -(-count // (4 * workers)) if workers > 1 else count
    whole = min(max(-(-shared // GRAIN), 1) * GRAIN, LARGEST)
    fitting = max(ROOM // max(bytes_of_a_run, 1), 1)
    return whole if whole <= fitting else max(fitting // GRAIN * GRAIN, min(fitting, GRAIN))


def split(count: int, size: int) -> list[tuple[int, int]]:
    """First and last + 1 of every block; one empty block where there are no runs."""
    return [(start, min(start + size, count)) for start in range(0, max(count, 1), size)]
