"""Stage numeric: a guess of a position -> places around it from which loops may close."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..base.algebra import Array
from .scales import Scales

RADII = (0.05, 0.2, 0.5, 1.0, 1.6, 2.4)  #: scaled distance of the starts, each used for a few
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71)


def starts(guess: Array, free: Array, scales: Scales, restarts: int) -> Iterator[Array]:
    """The guess, then `restarts` places around it, ever farther away; the same ones every time."""
    yield guess
    for k in range(restarts):
        radius = RADII[min(k * len(RADII) // restarts, len(RADII) - 1)]
        # Halton sequence; the shifted index keeps later coordinates from repeating earlier ones
        unit = [_halton(k + 1 + 7 * (i // len(PRIMES)), PRIMES[i % len(PRIMES)]) for i in range(len(free))]
        yield scales.move(guess, radius * free * (2.0 * np.array(unit) - 1.0))


def _halton(index: int, base: int) -> float:
    value, part = 0.0, 1.0
    while index:
        part /= base
        value += part * (index % base)
        index //= base
    return value
