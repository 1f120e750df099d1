"""Stage verification, differences: a function in double arithmetic -> its derivatives, with an estimate of their error.

Central differences at halved steps, extrapolated (L. F. Richardson, The deferred approach to the limit, 1927; C. J. F.
Ridders, Accurate computation of F'(x) and F'(x) F''(x), Adv. Eng. Software 4 (1982), 75-76).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.algebra import Array

HALVINGS = 5
FIRST_STEP = 2e-2  #: relative to the size of the variable
#: Beside a singular position a long first step misjudges its error: where it disagrees, a shorter one decides.
SHORTER = 0.1
SAFETY = 20.0  #: on the estimated error


def extrapolate(f: Callable[[float], Array], noise: Array | float, step: float = FIRST_STEP) -> tuple[Array, Array]:
    """df/ds at s = 0 and how far it may be off.

    Parameters
    ----------
    f : callable
        s -> array.
    noise : array or float
        By how much rounding may move f.
    step : float
        The first step.

    Returns
    -------
    slope, error : arrays
        Entry by entry the column of the table whose estimate is the smallest.
    """
    table: list[Array] = []
    best, error = np.zeros(0), np.zeros(0)
    for i in range(HALVINGS):
        h = step * 0.5**i
        row = [(np.asarray(f(h)) - np.asarray(f(-h))) / (2.0 * h)]
        for j in range(1, i + 1):
            row.append(row[j - 1] + (row[j - 1] - table[j - 1]) / (4.0**j - 1.0))
        if i:
            for j in range(1, i + 1):
                guess = np.maximum(np.abs(row[j] - row[j - 1]), np.abs(row[j] - table[j - 1])) + 2.0 * noise / h
                if not best.size:
                    best, error = row[j], guess
                best, error = np.where(guess < error, row[j], best), np.minimum(guess, error)
        table = row
    return best, SAFETY * error
