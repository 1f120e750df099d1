"""Simulation: functions that a user gives for sampled states -> their new values at each sampling time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..errors import SimulationError, UsageError
from ..numeric.scales import Array
from ..runtime.layout import Layout
from ..runtime.near_names import check_names, require_mapping, require_time_and_state, without_dots
from ..runtime.room import as_real
from ..texts import shown


class Controller:
    """A function f(t, x) that gives the new value of one sampled state.

    Parameters
    ----------
    name : str
        The state.
    place : int
        Its place in x.
    function : callable
        (t, x) -> number; x (n_x,) is the state right before, with what was renewed before this state.
    """

    def __init__(self, name: str, place: int, function: Callable[[float, Array], Any]) -> None:
        self.name, self.place, self.function = name, place, function

    def __call__(self, t: float, x: Array) -> float:
        """The new value; a SimulationError if it is no finite number."""
        try:
            given = self.function(t, x.copy())
        except Exception as error:
            error.add_note(f"raised by the controller of {self.name}, called as f({t:.6g}, x)")
            raise
        found = as_real(given)
        if found is None or found.ndim or not np.isfinite(found):
            raise SimulationError(
                f"the controller of {self.name} must return one finite number, but returned {shown(given)} "
                f"at t = {t:.6g} s"
            )
        return float(found)


def read_controllers(layout: Layout, given: Any) -> dict[int, list[Controller]]:
    """Controllers by the event at which they act, in the order of renewal.

    Raises
    ------
    UsageError
        A name that is no sampled state, or what is no function f(t, x).
    """
    require_mapping("controllers", given)
    wanted: Mapping[str, Any] = without_dots(given)
    clocks: list[dict[str, Any]] = layout.metadata.get("clocks", [])
    sampled = [name for clock in clocks for name in clock["states"]]
    if wanted and not sampled:
        raise UsageError(
            f"controllers give the values of sampled states, and {layout.name!r} has none; declare one with "
            "m.sampled(name, period=...)"
        )
    check_names("sampled state", wanted, sampled)
    for name, function in wanted.items():
        if not callable(function):
            raise UsageError(f"the controller of {name} must be a function f(t, x), not {shown(function)}")
        require_time_and_state(f"the controller of {name}", function)
    found: dict[int, list[Controller]] = {}
    for clock in clocks:
        own = [Controller(n, layout.x.index(n), wanted[n]) for n in clock["states"] if n in wanted]
        if own:
            found[int(clock["event"])] = own
    return found
