"""Stage runtime: initial values that follow from parameters -> their values and slopes at parameters given later."""

from __future__ import annotations

import warnings
from copy import copy
from typing import Any

import numpy as np

from ..errors import TO_BE_FINITE, UsageError, calls_within
from ..numeric.scales import Array
from .layout import Layout
from .tapes import play_arrays

NO_STATE = np.empty((0, 1))  #: initial values depend on parameters only


def started(layout: Layout, p: Array) -> Layout:
    """The same with initial values and guesses at parameters (n_p,) of other values."""
    found, declared = copy(layout), layout.metadata["p_values"]
    for name, places in layout.metadata.get("start_fixed", {}).items():
        if any(p[k] != declared[k] for k in places):
            warnings.warn(
                f"the initial value of {name} calls a table or a function of the model, so it stays at the declared "
                f"parameters and does not follow {', '.join(layout.p[k] for k in places)}; give {name} for the run",
                stacklevel=calls_within() + 1,
            )
    for section, (names, tape) in layout.metadata.get("start_terms", {}).items():
        values = dict(zip(names, map(float, play_arrays(tape, p, NO_STATE)), strict=True))
        if bad := [name for name, value in values.items() if not np.isfinite(value)]:
            shown = ", ".join(f"{name} = {x:.6g}" for name, x in zip(layout.p, p, strict=True))
            raise UsageError(f"{section.partition('_')[0]}.{bad[0]} is no number with {shown}: {TO_BE_FINITE}")
        setattr(found, section, getattr(layout, section) | values)
    return found


def late_values(layout: Layout, p: Array) -> dict[str, Any]:
    """Initial values that follow from parameters, (n_p,) or (n_p, k) of k runs, each a number or an array (k,)."""
    names, tape = layout.metadata.get("start_terms", {}).get("initial", ((), ((), (), ())))
    return dict(zip(names, play_arrays(tape, p, NO_STATE), strict=True))


def start_slopes(layout: Layout, p: Array) -> dict[str, Array]:
    """Derivatives (n_p,) of the initial values that follow from parameters, by name, at parameters (n_p,)."""
    places, tape = layout.metadata.get("start_slopes", ((), ((), (), ())))
    found: dict[str, Array] = {}
    for (name, k), slope in zip(places, play_arrays(tape, p, NO_STATE), strict=True):
        found.setdefault(name, np.zeros(len(p)))[k] = slope
    return found


def first_values(layout: Layout) -> dict[str, float]:
    """The initial values at the declared parameters, outputs included where the layout has them."""
    data = layout.metadata
    declared = {**data["initial"], **data.get("initial_outputs", {})}
    return {name: declared[name] for name in layout.initial}
