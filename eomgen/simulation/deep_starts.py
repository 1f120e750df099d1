"""Simulation: the first state of a run -> a warning where shapes of contacts are deep in each other."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EvaluationError
from ..limits.runs import SUNK
from ..numeric.scales import Array
from .events import calls_within, is_told_by_the_caller

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


class PenetrationWarning(UserWarning):
    """A run starts with shapes of contacts deep in each other, which will drive them apart at high speed."""


def deep_start(module: BoundModel, t: float, x: Array, u: Any) -> str | None:
    """The two shapes of contacts between groups that are deepest in each other, if they are deeper than they should."""
    if "meeting_time" not in module.kernels.core.names:
        return None
    q, v = np.array(x[: module.n_q]), np.array(x[module.n_q :])
    try:
        found = module.kernels.motion("meeting_time")(q, v, np.zeros_like(v), u=u, t=t)
    except EvaluationError:
        return None  # the run tells of it
    _, depth, thickness, first, second = (float(number) for number in found)
    if depth <= SUNK * thickness:
        return None
    (name, one), (_, other) = (module.metadata["contact_shapes"][int(k)] for k in (first, second))
    return f"contacts {name!r}: {one} and {other} are {depth:.3g} m deep in each other"


def warn_of_depth(module: BoundModel, t: float, x: Array, u: Any) -> None:
    """Tell the line of the user's that called of a start inside each other."""
    found = None if is_told_by_the_caller() else deep_start(module, t, x, u)
    if found is not None:
        warnings.warn(
            f"{module.name} starts with shapes inside each other; {found}. Their force drives them apart at once: "
            "change the initial values, or put only shapes into groups that are apart",
            PenetrationWarning,
            stacklevel=calls_within() + 1,
        )
