"""The state matrix of the Whipple bicycle that SymPy's test_kane3.py prints to 15 digits."""

from __future__ import annotations

import numpy as np


def state_matrix(v: float) -> np.ndarray:
    """A (4, 4) at a forward speed v (m/s), of lean, steer and their rates."""
    return np.array([
        [0, 0, 1, 0],
        [0, 0, 0, 1],
        [9.48977444677355, -0.891197738059089 * v**2 - 0.571523173729245, -0.105522449805691 * v,
         -0.330515398992311 * v],
        [11.7194768719633, -1.97171508499972 * v**2 + 30.9087533932407, 3.67680523332152 * v,
         -3.08486552743311 * v],
    ])  # fmt: skip
