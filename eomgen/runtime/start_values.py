"""Initial values that follow from parameters -> their values and slopes at parameters bound later."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from copy import copy
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..errors import calls_within
from .layout import Layout
from .tapes import play_arrays

NO_STATE = np.empty((0, 1))  #: initial values depend on parameters only
_SILENT: ContextVar[bool] = ContextVar("silent", default=False)


def at_parameters(layout: Layout, p: Array) -> Layout:
    """The same with initial values and guesses at parameters (n_p,) of other values.

    A value that is no number there stays as declared, with the other Euler parameters of its rotation, to tell the
    branch; :attr:`~.layout.Layout.rebound` names it, and a start that is made of it is refused.
    """
    changed, undefined = copy(layout), dict[str, str]()
    changed.rebound = p, undefined
    rotations = [layout.q[i : i + 4] for i, _ in layout.quaternion_slots]
    for section, (names, tape) in layout.metadata.get("start_terms", {}).items():
        values = dict(zip(names, map(float, play_arrays(tape, p, NO_STATE)), strict=True))
        for name in [name for name, value in values.items() if not np.isfinite(value)]:
            for other in next((four for four in rotations if name in four), (name,)):
                if values.pop(other, None) is not None:
                    undefined.setdefault(other, f"{section.partition('_')[0]}.{name}")
        setattr(changed, section, getattr(layout, section) | values)
    return changed


def warn_of_fixed(layout: Layout, p: Array, names: Iterable[str]) -> None:
    """Warn of initial values among these that call tables, if parameters (n_p,), or (n_p, k) of runs, are others."""
    fixed, declared = layout.metadata.get("start_fixed", {}), layout.metadata["p_values"]
    for name in () if _SILENT.get() else names:
        places = fixed.get(name, ())
        if any((p[k] != declared[k]).any() for k in places):
            warnings.warn(
                f"the initial value of {name} calls a table or a function of the model, so it stays at the declared "
                f"parameters and does not follow {', '.join(layout.p[k] for k in places)}; give {name} for the run",
                stacklevel=calls_within() + 1,
            )


@contextmanager
def silent() -> Iterator[None]:
    """Within it :func:`warn_of_fixed` is silent: starts of many runs, of which the call that runs them told once."""
    token = _SILENT.set(True)
    try:
        yield
    finally:
        _SILENT.reset(token)


def values_at(layout: Layout, p: Array) -> dict[str, Any]:
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
