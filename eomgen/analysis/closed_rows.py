"""Analysis: constraints that close and open -> the rows of those closed at a state, which impulses have to obey too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.algebra import Array
from ..numeric.scales import Scales

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


def closed_rows(module: BoundModel, x: Array) -> list[int]:
    """Places among the equations of constraints that close and open of those that are closed at a state (n_x,)."""
    rows = module.metadata.get("held_rows", [])
    return [k for k, (_, state, _) in enumerate(rows) if x[module.layout.x.index(state)] > 0.5]


def with_closed_rows(module: BoundModel, t: float, x: Array, C_q: Array) -> tuple[Array, Scales]:
    """The Jacobian (n_c, n_v) of the constraints with a row (by v) for each equation that is closed, and its scales."""
    layout, rows, closed = module.layout, module.metadata.get("held_rows", []), closed_rows(module, x)
    if not closed:
        return C_q, layout.scales
    moving = layout.n_v - len(layout.states)
    places = layout.n_q + np.arange(moving)
    at = np.repeat(x[:, None], 1 + moving, axis=1)  # rates of equations are linear in the velocities
    at[places] = 0.0
    at[places, 1 + np.arange(moving)] = 1.0
    rates = module.kernels.timed("held_errors")(t, at)[1::2][closed]
    more = np.zeros((len(closed), layout.n_v))
    more[:, :moving] = rates[:, 1:] - rates[:, :1]
    sizes = [layout.length if rows[k][2] == "length" else 1.0 for k in closed]
    return np.vstack([C_q, more]), layout.scales._replace(c=np.concatenate([layout.scales.c, sizes]), groups=None)
