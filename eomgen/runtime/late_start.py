"""Initial values that follow from parameters -> their values and slopes at parameters given later."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from copy import copy
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..errors import TO_BE_FINITE, AssemblyError, calls_within, not_finite
from .layout import Layout
from .tapes import play_arrays

NO_STATE = np.empty((0, 1))  #: initial values depend on parameters only
_SILENT: ContextVar[bool] = ContextVar("fixed_told", default=False)


def started(layout: Layout, p: Array) -> Layout:
    """The same with initial values and guesses at parameters (n_p,) of other values."""
    found = copy(layout)
    found.late = late = LateStart(layout, p)
    for section, (names, tape) in layout.metadata.get("start_terms", {}).items():
        values = dict(zip(names, map(float, play_arrays(tape, p, NO_STATE)), strict=True))
        late.leave_bad(section.partition("_")[0], values)
        setattr(found, section, getattr(layout, section) | values)
    return found


class LateStart:
    """What becomes of the start of a model with parameters (n_p,) bound later.

    A value that is no number there stays as declared, to tell the branch, and is refused where a start is made of it:
    who gives another value needs none.
    """

    def __init__(self, layout: Layout, p: Array) -> None:
        self.layout, self.p = layout, p
        self.bad: dict[str, str] = {}  #: value that stays as declared -> section and name of what is no number

    def leave_bad(self, section: str, values: dict[str, float]) -> None:
        """Take out what is no number, and with it the other Euler parameters of its rotation."""
        lacking = [name for name, value in values.items() if not np.isfinite(value)]
        rotations = [self.layout.q[i : i + 4] for i, _ in self.layout.quaternion_slots]
        for name in lacking:
            for other in next((four for four in rotations if name in four), (name,)):
                if values.pop(other, None) is not None:
                    self.bad.setdefault(other, f"{section}.{name}")

    def used(self, declared: dict[str, float]) -> dict[str, float]:
        """The same values of a start; warns of those that cannot follow from parameters.

        Raises
        ------
        UsageError
            One is no number.
        """
        if bad := [self.bad[name] for name in declared if name in self.bad]:
            shown = ", ".join(f"{name} = {x:.6g}" for name, x in zip(self.layout.p, self.p, strict=True))
            raise not_finite(f"{bad[0]} is no number with {shown}: {TO_BE_FINITE}")
        tell_fixed(self.layout, self.p, declared)
        return declared

    def follow(self, initial: Any, given: Iterable[str], rough: bool) -> Array | None:
        """The reference position with the initial values of now, but those to be `given`; None if they are as declared.

        `initial` is an :class:`~.initial.Initial`, whose file imports this one by way of the kernels.  The values are
        followed from those at the declared parameters; where these do not close the loops of now, from the
        closed position nearest to them.  Where that is blocked, the loops are closed anew, which it tells unless
        ``rough``.
        """
        layout, system = initial.layout, initial.system
        before, now = initial.sort(first_values(layout)).positions, initial.sort(layout.initial).positions
        if before == now:
            return None
        known = [name for name in given if name in (*system.names, *system.cut.names)]
        wanted = now = {name: value for name, value in now.items() if name not in known}
        blocked = start = None
        ways: tuple[dict[str, float], ...] = (before, {})
        for held in ways:
            try:
                start = system.close(layout.q_reference, held).q
                wanted = initial.compatible(start, known, now) if known else now
                return np.asarray(initial.follow(start, wanted))
            except AssemblyError as error:
                blocked = error
        found = initial.close_near(layout.q_reference, wanted)
        changed = {name: value for name, value in wanted.items() if value != before.get(name)}
        # where they stand still at the reference, it is on no branch of theirs
        if start is not None and not rough and len(initial.compatible(start, (), changed)) == len(changed):
            what = ", ".join(f"{name} = {value:.6g}" for name, value in changed.items())
            initial.tell_branch(what, blocked)
        return np.asarray(found)


def tell_fixed(layout: Layout, p: Array, names: Iterable[str]) -> None:
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
def fixed_told() -> Iterator[None]:
    """Within it :func:`tell_fixed` is silent: starts of many runs, of which the call that runs them told once."""
    token = _SILENT.set(True)
    try:
        yield
    finally:
        _SILENT.reset(token)


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
