"""Simulation: functions that a user gives for sampled states -> their new values at each sampling time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.texts import shown
from ..errors import SimulationError, cannot, ill_typed
from ..runtime.layout import Layout
from ..runtime.near_names import check_names, require_mapping, require_time_and_state, without_dots
from ..runtime.room import as_real
from .events import WAIT, Events

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.inputs import Forcing


class Controller:
    """A function f(t, x) that gives the new value of one sampled state.

    Parameters
    ----------
    name : str
        The state.
    place : int
        Its place in x.
    function : callable
        (t, x) -> number; x (n_x,) is the state right before, with what was renewed before this value.
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
                f"at t = {t:.6g} s",
                code="EG-NUMBER",
            )
        return float(found)


class ControlledEvents(Events):
    """The events of a run in which functions give the new values of sampled states.

    Parameters
    ----------
    layout : Layout
    given : None, or one event or several
        As for :class:`Events`.
    controllers : mapping of str to callable
        Sampled state -> f(t, x).

    Raises
    ------
    UsageError
        A name that is no sampled state without a law, or what is no function f(t, x).
    """

    def __init__(self, layout: Layout, given: Any, controllers: Any) -> None:
        found = _by_event(layout, controllers)
        super().__init__(layout, given)
        self.controllers = found
        for i in found:
            self.model[i].action = WAIT  # compiled loops ask Python there

    def reset(self, module: BoundModel, forcing: Forcing, t: float, x: Array, fired: Sequence[int]) -> Array:
        """The state after the events that happened at time t."""
        gaps = [i for i in fired if self.model[i].action == WAIT and i not in self.controllers]
        after = np.array(x, dtype=float)
        for i in (i for i in fired if i not in gaps):
            if i not in self.controllers:
                after = super().reset(module, forcing, t, after, [i])
                continue
            after = self.renewed(module, forcing, t, after, i)
            for control in self.controllers[i]:
                after[control.place] = control(t, after)
            after = np.asarray(module.project(after, t=t, u=forcing(t, after)))
        return super().reset(module, forcing, t, after, gaps)


def _by_event(layout: Layout, given: Any) -> dict[int, list[Controller]]:
    """Controllers by the event at which they act, in the order of renewal."""
    require_mapping("controllers", given)
    wanted: Mapping[str, Any] = without_dots(given, layout.instances)
    clocks: list[dict[str, Any]] = layout.metadata.get("clocks", [])
    taken = [name for clock in clocks for name in clock["open"]]
    if wanted and not taken:
        raise cannot(
            f"controllers give the values of sampled states without a law, and {layout.name!r} has none; declare one "
            "with m.sampled(name, period=...)"
        )
    check_names("sampled state without a law", wanted, taken)
    for name, function in wanted.items():
        if not callable(function):
            raise ill_typed(f"the controller of {name} must be a function f(t, x), not {shown(function)}")
        require_time_and_state(f"the controller of {name}", function)
    found: dict[int, list[Controller]] = {}
    for clock in clocks:
        own = [Controller(n, layout.x.index(n), wanted[n]) for n in clock["open"] if n in wanted]
        if own:
            found[int(clock["event"])] = own
    return found
