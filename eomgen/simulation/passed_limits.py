"""Simulation: a trajectory beside the declared limits of joints -> a warning where it passes one."""

from __future__ import annotations

import warnings

import numpy as np

from ..errors import calls_within
from ..runtime.layout import Layout
from ..runtime.trajectory import Trajectory
from .events import is_told_by_the_caller

SHOWN = 4  #: limits that a warning names


class LimitWarning(UserWarning):
    """A run passed a limit of a joint, at which nothing stops it."""


def passed_limits(trajectory: Trajectory, layout: Layout, rtol: float, atol: float) -> list[str]:
    """What a run passes: each limit of position or speed, when first and how far.

    A coordinate that rests at its limit may be beyond it by what the tolerances of the run leave of it.
    """
    found: list[str] = []
    for name, limits in layout.limits.items() if layout.metadata.get("limits_told", True) else ():
        for key in ("lower", "upper", "velocity"):
            limit = limits.get(key)
            column = name if key != "velocity" else f"{name}_dot"
            if limit is None or not np.isfinite(limit) or column not in trajectory:
                continue
            values = trajectory[column]
            beyond = limit - values if key == "lower" else (np.abs(values) if key == "velocity" else values) - limit
            passed = np.flatnonzero(beyond > 10.0 * (atol + rtol * (1.0 + abs(limit))))
            if passed.size:
                first, worst = int(passed[0]), int(np.nanargmax(beyond))
                found.append(f"{column} {key} {limit:g} at t = {trajectory.t[first]:.4g} s (to {values[worst]:.4g})")
    return found


def warn_of_limits(trajectory: Trajectory, layout: Layout, rtol: float, atol: float) -> None:
    """Tell the line of the user's that called of limits that a run passes."""
    found = [] if is_told_by_the_caller() else passed_limits(trajectory, layout, rtol, atol)
    if found:
        more = f", and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
        warnings.warn(
            f"the run passes limits of joints: {'; '.join(found[:SHOWN])}{more}. Limits alone stop nothing: load a "
            "robot with limits='stop', or add forces of type stop to a model; limits: off turns this warning off",
            LimitWarning,
            stacklevel=calls_within() + 1,
        )
