"""Stage kinematics: scaled constraint Jacobian -> which coordinates can be independent, and how well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..base.limits.constraints import CHOSEN
from ..numeric.ranks import conditioning

Array = NDArray[np.float64]
LARGEST = 120  #: coordinates up to which every one is judged


def rate_candidates(J: Array, chosen: Sequence[int]) -> dict[int, float]:
    """How well each coordinate would do as independent: columns -> conditioning, the best first.

    Parameters
    ----------
    J : (m, n) array
        Scaled Jacobian at one configuration.
    chosen : sequence of int
        The independent columns there.

    Returns
    -------
    dict of int to float
        For a chosen column the conditioning of the chosen set, for any other that of the best set in which it takes
        the place of a chosen one; columns that cannot are left out.  Empty where there is no choice.
    """
    n = J.shape[1]
    if not len(J) or not chosen or n > LARGEST or (n - len(chosen)) * len(chosen) > LARGEST:
        return {}
    found = dict.fromkeys(chosen, conditioning(J, chosen))
    for k in range(n):
        if k not in found:
            swaps = ([k if i == old else i for i in chosen] for old in chosen)
            found[k] = max(conditioning(J, columns) for columns in swaps)
    ordered = sorted(found.items(), key=lambda item: -round(item[1], 6))
    return {k: value for k, value in ordered if value > CHOSEN}
