"""Groups of blocks: what is composed, what belongs to given rates and to loops, and what is made along
directions.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

from ..terms import Row

COMPOSED = ("mass_times", "bias", "constraint_jacobian", "gamma")  #: what M, h, C_q and gamma are put together from
RATES = ("rates", "moved", "rates_along")  #: blocks of given q' = N v + b

#: Blocks of the right-hand side of loops, and those that are tried before them where that pays.
USUAL, REGULAR = ("closing", "dynamics"), ("regular_closing", "regular_dynamics")

#: Kernels that are derivatives by something other than the state -> what.
SHIFTS = {"input_jacobian": "input", "parameter_jacobian": "parameter"}


#: Kernels whose columns are derivatives along directions where they are not written out -> the block of one.
ALONG = {"dae_jacobian": "dae_tangent", "inverse_dynamics_derivatives": "inverse_tangent"}


def flat(rows: Sequence[Row]) -> Row:
    """Rows one after the other."""
    return tuple(chain.from_iterable(rows))
