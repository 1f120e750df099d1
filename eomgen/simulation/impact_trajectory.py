"""Simulation: a run with impacts as a trajectory that has two points at each."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from ..base.algebra import Array
from ..runtime.trajectory import Trajectory
from .impact import Impact

if TYPE_CHECKING:
    from ..runtime.protocols import Source


class ImpactRun(Trajectory):
    """A motion with impacts: a :class:`~..runtime.trajectory.Trajectory` that has two points at each impact.

    Attributes
    ----------
    t : (n_t,) array
        Times (s); each impact has two, the same one before and after.
    x : (n_x, n_t) array
    impacts : list of (float, Impact)
    t_events, x_events : lists
        Times and states before the impacts of each gap, also by name: ``run.t_events["gap"]``.
    ended : {'end', 'impacts', 'rest', 'event'}
        Why it ended: the span is over; as many impacts as allowed; a gap that is pressed together and no longer opens
        (bodies that stay in contact need a joint or a contact force); an event of the model that ends runs.
    """

    impacts: list[tuple[float, Impact]]
    breaks: list[int]
    ended: str

    @classmethod
    def of(
        cls, parts: tuple[Any, ...], impacts: Sequence[tuple[float, Impact]], breaks: Sequence[int], ended: str
    ) -> ImpactRun:
        """Make the run from the parts of a Trajectory and the impacts."""
        run = cls(*parts)
        run.impacts, run.breaks, run.ended = list(impacts), list(breaks), ended
        return run

    def __repr__(self) -> str:
        return (
            f"<ImpactRun of {self.name}: {len(self.t)} points, t = {self.t[0]:.6g} .. {self.t[-1]:.6g} s, {self.count}>"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        _, parts = super().__reduce__()
        return type(self).of, (parts, self.impacts, self.breaks, self.ended)

    @property
    def count(self) -> str:
        """The number of impacts and the reason for the end, as a text."""
        reasons = {
            "end": "",
            "impacts": "; as many as allowed (most=)",
            "rest": "; a gap stays closed",
            "event": "; an event ended it",
        }
        return f"{len(self.impacts)} impact{'s' * (len(self.impacts) != 1)}{reasons[self.ended]}"

    @property
    def pieces(self) -> list[Trajectory]:
        """The trajectories between impacts."""
        ends = [0, *self.breaks, len(self.t)]
        found = []
        for a, b in pairwise(ends):
            header = self.metadata | {"span": [float(self.t[a]), float(self.t[b - 1])], "event_names": []}
            found.append(Trajectory(self.t[a:b], self.x[:, a:b], TrajectoryPart(self.columns, a, b), header))
        return found


class TrajectoryPart:
    """Columns from one point of a run to another."""

    def __init__(self, whole: Source, first: int, last: int) -> None:
        self.whole, self.names, self.range = whole, whole.names, slice(first, last)

    def __getitem__(self, name: str) -> Array:
        return self.whole[name][self.range]

    @property
    def has_energies(self) -> bool:
        return self.whole.has_energies

    @property
    def energies(self) -> Array:
        return self.whole.energies[:, self.range]
