"""What equations show, evaluated through SymPy at numbers: the other side of every comparison."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy

from eomgen.explain.shown_values import evaluate as evaluate
from eomgen.explain.shown_values import random_state as random_state
from eomgen.explain.shown_values import state_values as state_values

#: Examples whose displays take seconds; what stands in them stands in those of the others too.
LONG = (
    "andrews_squeezer",
    "bicycle",
    "bricard",
    "delta_robot",
    "double_wishbone",
    "excavator",
    "gait_leg",
    "half_car",
    "n_four_bar",
    "puma560",
    "shaper",
    "spatial_slider_crank",
    "stewart_platform",
    "v_engine",
    "watt_six_bar",
)


def number(equations: Any, name: str, values: Mapping[str, float], part: str | None = None) -> Any:
    """The quantity of a name (and part) at numbers: float, array, or a list of arrays for named tuples."""
    named, value = equations.written(name, part)
    flat = list(value) if isinstance(value, sympy.MatrixBase) else [value]
    if isinstance(value, tuple):
        return [evaluate(named, list(one), values).reshape(-1) for one in value]
    found = evaluate(named, flat, values)
    if isinstance(value, sympy.MatrixBase):
        return found.reshape(value.shape)
    return float(found[0])
