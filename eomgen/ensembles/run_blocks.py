"""All blocks of an ensemble -> what is kept of each: here on threads, or on the workers of a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from .block import COUNTS, Plan, RunBlock, run_block
from .given_cases import Cases
from .reductions import GRAIN, Arrays, Reduction

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

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
