"""All blocks of an ensemble -> what is kept of each, by the workers of a dask cluster."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ...base.algebra import Array
from ...base.files import MANIFEST
from ...base.value_rules import as_count
from ...errors import MissingDependencyError, ToolchainError, UsageError, bad_file, cannot, ill_typed
from ..argument_checks import require
from ..kernels import eager, find_core
from .block import LOST, MEANING, Custom, Kept, Plan, Reduction, RunBlock, Runs, keep, run_block
from .variations import Variations

if TYPE_CHECKING:
    from ..bound_model import BoundModel


# -- a module for workers on any machine -------------------------------------------------------------------------------


class Handle(NamedTuple):
    """A module as it is sent: what opens it where its file is, and what builds it elsewhere."""

    kind: type[BoundModel]
    name: str  #: import name of its code
    file: str  #: of its code, where it was made
    digest: str  #: SHA-256 of that file
    recipe: str  #: JSON of name, sources, options and needed features of the processor; empty of an installed package
    p: Array
    u: dict[str, float]

    def open(self) -> BoundModel:
        """The module: from its file if the same is here and for this processor, else built from the sources, or
        imported.

        Raises
        ------
        ToolchainError
            It cannot be built here.
        """
        return self.kind(_open(self.name, self.file, self.digest, self.recipe), self.p, self.u)


def describe(module: BoundModel) -> Handle:
    """How workers get a module."""
    core: Any = eager(module.core)
    file = Path(str(getattr(core, "__file__", "") or ""))
    if not file.is_file():
        raise cannot(f"the module of {module.name!r} is not in a file that workers could load; use target cython")
    core.take_lanes()  # here, once, so that workers find them beside the module
    return Handle(
        type(module), core.__name__, str(file), _digest(file), _recipe(file), module.p, module.constant_inputs
    )


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _recipe(file: Path) -> str:
    """What a build in the cache is made from; empty of the module of an installed package."""
    return import_module("eomgen.toolchain.load").recipe_of(file) if (file.parent / MANIFEST).is_file() else ""


@lru_cache(maxsize=8)
def _open(name: str, file: str, digest: str, recipe: str) -> Any:
    path = Path(file)
    same = path.is_file() and _digest(path) == digest
    try:
        if not recipe:
            return find_core(name, file) if same else import_module(name)
        build, load = (import_module(f"eomgen.toolchain.{part}") for part in ("build", "load"))
    except ImportError as error:
        if recipe:
            raise MissingDependencyError(
                "a worker on another machine builds the module itself, so it needs eomgen: pip install eomgen there"
            ) from error
        raise ToolchainError(
            f"this worker has no module {name}: install its package there", code="EG-PACKAGE-MISSING"
        ) from error
    how: dict[str, Any] = json.loads(recipe)
    if same and load.processor_features().issuperset(how["needs"]):
        return find_core(name, file)
    options = build.Options(**how["options"])
    return load.load_core(build.compile_sources("model", how["sources"], how["name"], options))


# -- the cluster -------------------------------------------------------------------------------------------------------


AHEAD = 3  #: blocks under way or waiting for each worker


@contextmanager
def open_client(cluster: Any) -> Iterator[Any]:
    """A client of dask.distributed for what a user names as cluster.

    Parameters
    ----------
    cluster : True or 'local', int, str, or Client
        A cluster on this machine with a worker for each processor, or with so many; the address of a scheduler; a
        client, which stays open.
    """
    distributed: Any = require("distributed", "eomgen[cluster]", "cluster=")
    if isinstance(cluster, distributed.Client):
        yield cluster
    elif cluster is True or (isinstance(cluster, str) and cluster == "local") or (as_count(cluster) or 0) > 0:
        workers = as_count(cluster) or os.cpu_count() or 1
        with (
            distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=40
            ) as local,
            distributed.Client(local) as client,
        ):
            yield client
    elif isinstance(cluster, str):
        try:
            client = distributed.Client(cluster)
        except (OSError, ValueError) as error:
            raise bad_file(f"cluster {cluster}: no scheduler answers at this address ({error})") from None
        with client:
            yield client
    else:
        raise ill_typed(
            "cluster must be True, a number of local workers, the address of a scheduler or a dask Client, "
            f"not {cluster!r}"
        )


def count_workers(client: Any) -> int:
    """Threads of all workers."""
    return sum(client.nthreads().values()) or 1


def run_on_workers(
    client: Any,
    runs: Runs,
    reduction: Reduction,
    parts: list[tuple[int, int]],
    wanted: list[int],
    watch: Callable[[int], None] | None,
) -> Iterator[tuple[int, Kept]]:
    """Run the wanted blocks on the workers and yield each as it is ready.

    A block whose worker dies is run again by another; one whose task fails is given up, and its runs are marked.
    """
    distributed: Any = require("distributed", "eomgen[cluster]", "cluster=")
    handle, waiting = describe(runs.module), iter(wanted)
    ready = distributed.as_completed()
    indices: dict[str, int] = {}

    def submit() -> None:
        index = next(waiting, None)
        if index is not None:
            start, stop = parts[index]
            future = client.submit(_task, handle, runs.varied.part(start, stop), runs.plan, reduction, pure=False)
            indices[future.key] = index
            ready.add(future)

    for _ in range(AHEAD * count_workers(client)):
        submit()
    done = 0
    for future in ready:
        index = indices.pop(future.key)
        start, stop = parts[index]
        error = future.exception()
        if isinstance(error, UsageError):
            raise error
        kept = future.result() if error is None else _lost(runs.part(start, stop), reduction, error)
        future.release()
        submit()
        done += stop - start
        if watch is not None:
            watch(done)
        yield index, kept


def _task(handle: Handle, varied: Variations, plan: Plan, reduction: Reduction) -> Kept:
    runs = Runs(handle.open(), varied, plan)
    return keep(runs, reduction, run_block(runs))


def _lost(runs: Runs, reduction: Reduction, error: BaseException) -> Kept:
    """What is kept of a block that no worker could run: runs without states, marked so."""
    block = RunBlock.blank(runs, runs.count, LOST)
    block.texts.update(dict.fromkeys(range(runs.count), f"{MEANING[LOST]}: {type(error).__name__}: {error}"))
    return keep(runs, Reduction(()) if isinstance(reduction, Custom) else reduction, block)  # it has nothing to work on
