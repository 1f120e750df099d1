"""Shapes of contacts that are deep in each other where a run starts -> a warning."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.algebra import Array
from ...base.limits.runs import SUNK
from ...errors import EvaluationError, calls_within
from .events import is_told_by_the_caller

if TYPE_CHECKING:
    from ..bound_model import BoundModel


class PenetrationWarning(UserWarning):
    """A run starts with shapes of contacts deep in each other, which stiff contacts drive apart at high speed."""


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
            f"{module.name} starts with shapes inside each other; {found}. Stiff contacts drive them apart at once, "
            "and a bed of soil bears what is deep in it as if it had sunk there: change the initial values, or put "
            "only shapes into groups that are apart",
            PenetrationWarning,
            stacklevel=calls_within() + 1,
        )
