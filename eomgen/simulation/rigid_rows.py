"""Simulation: lists of pairs that are near, and how velocities move bodies -> rows of contacts at one instant."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..errors import SimulationError, cannot, off_range
from ..numeric.pair_sums import RECORD

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


class RigidRows(NamedTuple):
    """Contacts that may act, m of them."""

    pairs: Array  #: (m, 2) numbers of both shapes
    gaps: Array  #: (m,)
    jacobian: Array  #: (m d, n_v): velocities along the normal and across it, of the second shape relative to the first
    friction: Array  #: (m,)
    restitution: Array  #: (m,)
    places: Array  #: (m, 9): normal, first direction across, and point, in ground axes

    def chosen(self, which: Any) -> RigidRows:
        """Some of them."""
        m = len(self.gaps)
        rows = self.jacobian.reshape(m, -1, self.jacobian.shape[1])[which]
        given = (self.pairs[which], self.gaps[which], rows.reshape(-1, self.jacobian.shape[1]))
        return RigidRows(*given, self.friction[which], self.restitution[which], self.places[which])


class RigidContacts:
    """The contacts of a model.

    Raises
    ------
    UsageError
        It has none, or all of them are on soil.
    """

    def __init__(self, module: BoundModel) -> None:
        known = module.metadata.get("rigid_contacts")
        if not known:
            raise cannot(
                f"method moreau is for rigid contact between groups of shapes, and {module.name} has no contacts that "
                "can be rigid (soil yields): describe them by m.contacts(...) without soil, or choose another method"
            )
        self.lists: list[tuple[str, int, int]] = [tuple(row) for row in known["lists"]]
        parents = known["parents"]
        n = len(parents)
        self.moves = np.zeros((len(known["moved_by"]), module.layout.n_v))
        for shape, last in enumerate(known["moved_by"]):
            while last >= 0:
                self.moves[shape, last] = 1.0
                last = parents[last]
        assert n <= module.layout.n_v
        self.near = module.kernels.state("near_pairs")
        self.axes = module.kernels.state("motion_axes")

    def records(self, t: float, q: Array, u: Any) -> Array:
        """Pairs that are near (k, ``RECORD``), shapes numbered over all contacts."""
        every = self.near(q, u=u, t=t)
        found = []
        start = shapes = 0
        for name, numbers, count in self.lists:
            listed = int(every[start])
            room = (numbers - 1) // RECORD
            if listed > room:
                raise SimulationError(
                    f"contacts {name!r}: {listed} pairs of shapes are near each other at t = {t:.6g} s, and there is "
                    f"room for {room}; leave out shapes that overlap others of their body, or put shapes that "
                    "never meet into contacts of their own",
                    code="EG-TOO-LARGE",
                )
            rows = every[start + 1 : start + 1 + RECORD * listed].reshape(listed, RECORD).copy()
            rows[:, :2] += shapes
            found.append(rows)
            start, shapes = start + numbers, shapes + count
        return np.concatenate(found)

    def rows(self, t: float, q: Array, u: Any) -> RigidRows:
        """The contacts at one position.

        Raises
        ------
        UsageError
            A coefficient of friction is negative, or a restitution not within 0 and 1.
        """
        records = self.records(t, q, u)
        pairs, normal, point, flat = records[:, :2].astype(int), records[:, 2:5], records[:, 6:9], records[:, 9:12]
        self._require_law(records)
        planar = (flat != 0.0).any(axis=1)
        lone = np.zeros((len(records), 3))  # an axis far from the normal
        lone[np.arange(len(records)), 2 - np.argmin(np.abs(normal[:, ::-1]), axis=1)] = 1.0
        first = np.cross(np.where(planar[:, None], flat, lone), normal)
        first /= np.maximum(np.sqrt((first * first).sum(axis=1)), np.finfo(float).tiny)[:, None]
        ways = [normal, first]
        if not planar.all():
            ways.append(np.where(planar[:, None], 0.0, np.cross(normal, first)))
        along = np.stack(ways, axis=1)  # (m, d, 3)
        wrench = np.concatenate([np.cross(point[:, None], along), along], axis=2)
        apart = self.moves[pairs[:, 1]] - self.moves[pairs[:, 0]]
        jacobian = apart[:, None] * (wrench @ self.axes(q, u=u, t=t).T)
        laws = records[:, 12], records[:, 13]
        places = np.concatenate([normal, first, point], axis=1)
        return RigidRows(pairs, -records[:, 5], jacobian.reshape(-1, apart.shape[1]), *laws, places)

    def _require_law(self, records: Array) -> None:
        friction, restitution = records[:, 12], records[:, 13]
        bad = ~(friction >= 0.0) | ~((restitution >= 0.0) & (restitution <= 1.0))
        if bad.any():
            k = int(np.argmax(bad))
            starts = np.cumsum([count for *_, count in self.lists])
            name = self.lists[int(np.searchsorted(starts, records[k, 0], side="right"))][0]
            raise off_range(
                f"contacts {name!r}: friction is {friction[k]:.6g} and restitution {restitution[k]:.6g}; friction is "
                "0 or greater, restitution from 0 to 1"
            )
