"""Simulation: the result of :mod:`.sensitivities`: a trajectory with its derivatives, and those of its events."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.files import whole_file
from ..errors import ill_typed
from ..runtime.near_names import unknown
from ..runtime.run_parts import Named
from ..runtime.storage import table_path

if TYPE_CHECKING:
    from ..runtime.trajectory import Trajectory


class EventSlopes(NamedTuple):
    """What happened at one event, and its derivatives by the k names.

    The states' derivatives go with the event: they are those of the state at the event, whenever that is, as a
    Poincare section takes them.  Those at a fixed time are in ``Sensitivities.dx``.
    """

    name: str
    t: float  #: time (s)
    before: Array  #: (n_x,) state right before
    after: Array  #: (n_x,) state right after, the same without a reset
    dt: Array  #: (k,) of the time
    d_before: Array  #: (n_x, k)
    d_after: Array  #: (n_x, k)


class Sensitivities:
    """A trajectory and its derivatives: ``s["theta", "k"]`` is d theta / d k over time, (n_t,).

    Attributes
    ----------
    trajectory : Trajectory
    t : (n_t,) array
    names : tuple of str
        What is differentiated by: parameters, inputs (a constant added to them), initial values.
    dx : (n_x, k, n_t) array
        Derivatives of the states, along the constraints.
    dy : (n_y, k, n_t) array
        Derivatives of the outputs.
        Both at fixed times; at an event that changes the state there are two columns, before and after.
    held : tuple of str
        Coordinates and rates that keep their initial values when something else changes.
    events : tuple of EventSlopes
        In the order in which they happened.
    event_times : list of (m, k) arrays
        Derivatives of ``trajectory.t_events``, also by name: ``s.event_times["floor"][0]``.
    """

    def __init__(
        self,
        trajectory: Trajectory,
        names: tuple[str, ...],
        dx: Array,
        dy: Array,
        held: Sequence[str],
        events: Sequence[EventSlopes] = (),
    ) -> None:
        self.trajectory, self.t, self.names = trajectory, trajectory.t, names
        self.dx, self.dy, self.held, self.events = dx, dy, tuple(held), tuple(events)
        watched = trajectory.t_events.names if len(trajectory.t_events) else ()
        times = [[event.dt for event in self.events if event.name == name] for name in watched]
        self.event_times = Named([np.array(found).reshape(-1, len(names)) for found in times], watched)
        self._rows: dict[str, Array] = dict(zip(trajectory.metadata["y_names"], dy, strict=True))
        self._rows |= dict(zip(trajectory.x_names, dx, strict=True))

    def __getitem__(self, key: tuple[str, str]) -> Array:
        if not (isinstance(key, tuple) and len(key) == 2):
            raise ill_typed(f"write sensitivities[state or output, parameter], not {key!r}")
        what, name = key
        if what not in self._rows:
            raise unknown("state or output", what, self._rows)
        if name not in self.names:
            raise unknown("parameter that was differentiated by", name, self.names)
        return np.asarray(self._rows[what][self.names.index(name)])

    def save(self, path: str | Path) -> Path:
        """Write all derivatives: t, names, x_names, y_names, dx and dy to ``.npz`` (added if there is no ending), or
        columns ``d(theta)/d(k)`` to ``.csv``.

        Returns
        -------
        Path
            The file written.
        """
        target = table_path(path, "sensitivities are")
        if target.suffix == ".npz":
            x_names, y_names = self.trajectory.x_names, self.trajectory.metadata["y_names"]
            with whole_file(target) as file:
                np.savez(file, t=self.t, names=self.names, x_names=x_names, y_names=y_names, dx=self.dx, dy=self.dy)
            return target
        columns = {f"d({row})/d({name})": self[row, name] for row in self._rows for name in self.names}
        table = np.column_stack([self.t, *columns.values()])
        head = ",".join(["t", *columns])
        with whole_file(target) as file:
            np.savetxt(file, table, delimiter=",", header=head, comments="", fmt="%.17g", encoding="utf-8")
        return target

    def __repr__(self) -> str:
        return f"<Sensitivities of {self.trajectory.name} to {', '.join(self.names)}: {len(self.t)} points>"
