"""Simulation: a run with rigid contacts as a trajectory that has the forces of these too."""

from __future__ import annotations

from typing import Any, cast

from ..base.algebra import Array
from ..runtime.columns import Columns
from ..runtime.trajectory import Trajectory
from .contact_forces import ContactForces

MEANS = {"normal": "N", "friction": "N"}  #: columns of each of the contacts between groups, and their units


class RigidRun(Trajectory):
    """A motion with rigid contacts: a :class:`~..runtime.trajectory.Trajectory` with the mean forces of steps.

    Columns beside the others are ``normal(track)``, the sum of the normal forces of contacts ``track``, and
    ``friction(track)``, the sum of the sizes of their friction forces (N): means over the step that ends at each time.

    Attributes
    ----------
    contact_forces : ContactForces
        These and, of runs with ``contact_forces=True``, single contacts and forces on bodies.  Pickles have it; of
        saved runs the columns remain.
    """

    contact_forces: ContactForces

    @classmethod
    def of(cls, parts: tuple[Any, ...], forces: ContactForces) -> RigidRun:
        """Make the run from the parts of a Trajectory and the forces."""
        run = cls(*parts)
        run.contact_forces = forces
        return run

    @classmethod
    def beside(cls, run: Trajectory, forces: ContactForces) -> RigidRun:
        """The same run with forces."""
        columns = ColumnsWithForces(cast("Columns", run.columns), forces)
        header = run._header | {"units": run.units | columns.units}
        return cls.of((run.t, run.x, columns, header, (), (), run._sample, run._described), forces)

    def __reduce__(self) -> tuple[Any, ...]:
        _, parts = super().__reduce__()
        return type(self).of, (parts, self.contact_forces)


class ColumnsWithForces(Columns):
    """The columns of a run, and behind them those of its contact forces."""

    def __init__(self, others: Columns, forces: ContactForces) -> None:
        super().__init__(others.module, others.t, others.x, others.u, others._steps)
        own = {f"{what}({name})": (what, name) for name in forces.names for what in MEANS}
        self.forces, self._own = forces, {name: what for name, what in own.items() if name not in self.names}
        self.names = (*self.names, *self._own)
        self.units = {name: MEANS[what] for name, (what, _) in self._own.items()}

    def __getitem__(self, name: str) -> Array:
        if name not in self._own:
            return super().__getitem__(name)
        what, contacts = self._own[name]
        found: Array = getattr(self.forces, what)(contacts)
        return found
