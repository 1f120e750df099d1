"""Simulation: impulses of rigid contacts in each step -> mean forces over the steps, of contacts and on bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..errors import cannot, off_range
from ..runtime.near_names import unknown
from ..runtime.room import read_number


class ContactForce(NamedTuple):
    """The mean force of one contact over one step."""

    contacts: str  #: name of the contacts between groups
    first: str  #: the first shape
    second: str  #: the second shape, on which the force acts; the opposite one acts on the first
    first_body: str  #: name of its body, or ground
    second_body: str
    point: Array  #: (3,) where it acts (m), ground axes, in the middle of the step
    normal: Array  #: (3,) from the first shape to the second, ground axes
    force: Array  #: (3,) (N) on the second shape, ground axes
    pressing: float  #: (N) its part along the normal
    friction: float  #: (N) the size of its part across the normal


class ContactForces:
    """Mean forces of rigid contacts over the steps of a run by method moreau: impulses over the size of the step.

    Forces of rigid contacts are impulses at times; their mean over a step is what the scheme knows of them.  Times a
    step, all of them together with the other forces change the momentum of bodies exactly as the run did.

    Attributes
    ----------
    names : tuple of str
        The contacts between groups.
    t : (n_t,) array
        The times at which the run is stored.  Values there are of the step that ends at this time, or has it within; at
        the start of the run, of the first step.
    """

    def __init__(
        self,
        known: Mapping[str, Any],
        shapes: Sequence[Sequence[str]],
        t: Array,
        ends: Array,
        sums: Array,
        kept: Sequence[Array] | None,
    ) -> None:
        self.names = tuple(name for name, *_ in known["lists"])
        self.t, self._ends, self._sums, self._kept = t, ends, sums, kept
        self._shapes, self._bodies = shapes, known["bodies"]
        self._steps = np.clip(np.searchsorted(ends, t), 0, max(len(ends) - 1, 0))

    def _of(self, name: str, row: int) -> Array:
        if name not in self.names:
            raise unknown("contacts", name, self.names)
        return self._sums[self.names.index(name), row, self._steps] if len(self._ends) else np.zeros(len(self.t))

    def normal(self, name: str) -> Array:
        """The sum of normal forces (N) of contacts, (n_t,)."""
        return self._of(name, 0)

    def friction(self, name: str) -> Array:
        """The sum of the sizes of friction forces (N) of contacts, (n_t,)."""
        return self._of(name, 1)

    def count(self, name: str) -> Array:
        """How many contacts press, (n_t,)."""
        return self._of(name, 2)

    def on(self, body: str, contacts: str | None = None) -> Array:
        """Force (N) and moment about the origin of ground (N m) of contacts on a body, ground axes, (6, n_t).

        Parameters
        ----------
        body : str
            Its name, or ``"ground"``.
        contacts : str, optional
            Only those of this name.

        Raises
        ------
        UsageError
            The run was made without ``contact_forces=True``; the body has no shape in contacts.
        """
        kept = self._single()
        if body not in self._bodies:
            raise unknown("body with shapes in contacts", body, sorted(set(self._bodies)))
        if contacts is not None and contacts not in self.names:
            raise unknown("contacts", contacts, self.names)
        mine = np.array([one == body for one in self._bodies])
        if contacts is not None:
            mine &= np.array([name == contacts for name, _ in self._shapes])
        found = np.zeros((6, len(kept)))
        for k, rows in enumerate(kept):
            first, second = rows[:, 0].astype(int), rows[:, 1].astype(int)
            force = forces_on_second(rows)
            part = (mine[second] * 1.0 - mine[first] * 1.0)[:, None] * np.concatenate(
                [force, np.cross(rows[:, 8:11], force)], axis=1
            )
            found[:, k] = part.sum(axis=0)
        return found[:, self._steps] if len(kept) else np.zeros((6, len(self.t)))

    def at(self, t: float) -> list[ContactForce]:
        """All contacts of the step that ends at a time, or has it within.

        Raises
        ------
        UsageError
            The run was made without ``contact_forces=True``; the time is not within the run.
        """
        kept, time = self._single(), read_number("t", t)
        if not len(kept) or not self.t[0] <= time <= self._ends[-1]:
            raise off_range(f"t must be a time of the run, from {self.t[0]:.6g} to {self.t[-1]:.6g} s, not {time:.6g}")
        rows = kept[min(int(np.searchsorted(self._ends, time)), len(kept) - 1)]
        found = []
        for row, force in zip(rows, forces_on_second(rows), strict=True):
            first, second = int(row[0]), int(row[1])
            (name, one), (_, other) = self._shapes[first], self._shapes[second]
            ends = self._bodies[first], self._bodies[second]
            across = float(np.hypot(row[12], row[13]))
            found.append(ContactForce(name, one, other, *ends, row[8:11], row[2:5], force, float(row[11]), across))
        return found

    def _single(self) -> Sequence[Array]:
        if self._kept is None:
            raise cannot("single contacts of this run were not kept: simulate with contact_forces=True")
        return self._kept


def forces_on_second(rows: Array) -> Array:
    """Forces (m, 3) on second shapes, of contacts (m, 14) with forces in place of impulses."""
    normal, first = rows[:, 2:5], rows[:, 5:8]
    return np.asarray(rows[:, 11:12] * normal + rows[:, 12:13] * first + rows[:, 13:14] * np.cross(normal, first))


class ForceSums:
    """What is added up of the contacts of each step.

    Parameters
    ----------
    lists : sequence of (str, int, int)
        Name, numbers and shapes of each contact between groups.
    steps : int
    keep : bool
        Keep single contacts as well.
    """

    def __init__(self, lists: Sequence[tuple[str, int, int]], steps: int, keep: bool) -> None:
        self.starts = np.cumsum([count for *_, count in lists])
        self.sums = np.zeros((len(lists), 3, steps))
        self.kept: list[Array] | None = [] if keep else None

    def add(self, k: int, parts: list[Array], h: float) -> None:
        """The contacts of step k, of its parts where it was divided; the list is emptied."""
        rows = parts[0] if len(parts) == 1 else np.concatenate(parts)
        parts.clear()
        rows[:, 11:] /= h
        if len(rows):
            group = np.searchsorted(self.starts, rows[:, 0], side="right")
            across = np.hypot(rows[:, 12], rows[:, 13])
            n = len(self.starts)
            self.sums[:, 0, k] = np.bincount(group, rows[:, 11], n)
            self.sums[:, 1, k] = np.bincount(group, across, n)
            self.sums[:, 2, k] = np.bincount(group, rows[:, 11] > 0.0, n)
        if self.kept is not None:
            self.kept.append(rows)
