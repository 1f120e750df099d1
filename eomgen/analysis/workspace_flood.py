"""Analysis: a grid of led values -> the positions at its points, followed from neighbour to neighbour.

It begins at the grid point next to the initial position and floods the grid, so every position hangs together
with it by a continuous motion: the assembly mode stays.  A step from one point to the next counts only if position and
direction come out as foretold; else it is halved; near singular positions the small steps are those of
:mod:`..numeric.continuation`, over change points too.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.limits.analyses import SLACK
from ..errors import AssemblyError, PartitionError
from ..numeric.continuation import Continuation
from ..numeric.projection import largest
from ..runtime.given_start import Start
from ..simulation.followed_path import LOW, DrivenCoordinates, DrivenPath, FollowedPath, Singular
from ..simulation.kinematic import complete, start_from
from .workspace_grid import Grid, Index

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

MOST = 40  #: steps between neighbours: more are left to what looks for singular positions
TRIES = 64  #: grid points tried as the first one
REACHED, LIMITED, OUT = "reached", "limits", "out of reach"


class Edge(NamedTuple):
    """A singular position between two neighbours."""

    here: Index  #: the point it was seen from
    beyond: Index
    singular: Singular


class Flood(NamedTuple):
    """Positions over a grid."""

    status: np.ndarray[Any, Any]  #: (*shape,) of str
    q: Array  #: (*shape, n_q)
    parents: dict[Index, Index]  #: the neighbour from which each point was reached, in that order
    edges: list[Edge]


class Stage:
    """A module led over a grid: values of the grid -> time and led values.

    Parameters
    ----------
    module : BoundModel
    grid : Grid
    initial : mapping or array, optional
        Position to start from.
    t : float
        Time (s), if it is not varied.
    """

    def __init__(self, module: BoundModel, grid: Grid, initial: Start, t: float) -> None:
        self.module, self.grid = module, grid
        names = tuple(name for name in grid.names if name != "t")
        layout = module.layout
        if layout.n_h < layout.n_c:
            layout.require_minimal_form()
        middle = grid.at(tuple(n // 2 for n in grid.shape))
        if "t" in grid.names and initial is not None:
            t = float(grid.axes[grid.names.index("t")][0])
        self.t, q = start_from(module, initial, t)
        if "t" not in grid.names and self.t != t:
            self.t, q = t, start_from(module, q, t)[1]
        try:
            led = complete(module, q, self.t, names)
        except PartitionError as error:
            if initial is not None:
                raise
            # the declared position is singular for them: begin in the middle of the grid
            place = dict(zip(grid.names, middle.tolist(), strict=True))
            self.t = place.pop("t", t)
            try:
                self.t, q = start_from(module, place, self.t)
                led = complete(module, q, self.t, names)
            except (AssemblyError, PartitionError):
                raise error from None
        self.q = q
        self.driven = DrivenCoordinates(module, led)
        self.y = self.driven.led_values(q, self.t)
        for k, name in enumerate(names):  # the same angle, counted as the grid counts
            if self.driven.wraps[k]:
                centre = middle[grid.names.index(name)]
                self.y[k] += 2 * np.pi * np.round((centre - self.y[k]) / (2 * np.pi))
        self.rows = [layout.q.index(name) for name in led if name in layout.q]
        self.columns = [-1 if name == "t" else names.index(name) for name in grid.names]

    def at(self, index: Index) -> tuple[float, Array]:
        """Time and led values at a grid point."""
        t, y = self.t, self.y.copy()
        for column, value in zip(self.columns, self.grid.at(index), strict=True):
            if column < 0:
                t = float(value)
            else:
                y[column] = value
        return t, y

    def along(self, axis: int) -> tuple[float, Array]:
        """Direction (dt, dy) of an axis of the grid."""
        y1 = np.zeros(len(self.y))
        column = self.columns[axis]
        if column >= 0:
            y1[column] = 1.0
        return float(column < 0), y1

    def path(self, start: tuple[float, Array], end: tuple[float, Array]) -> tuple[DrivenPath, float]:
        """The straight path between two places, and its length."""
        (t, y), (t1, y1) = start, end
        length = largest(np.concatenate([(y1 - y) / self.driven.led_scales, [t1 - t]]))
        return DrivenPath(self.driven, t, y, (t1 - t) / (length or 1.0), (y1 - y) / (length or 1.0)), length

    def step(self, q: Array, start: Index, end: Index) -> tuple[Array | None, list[Singular]]:
        """The position at a neighbour, None if the way is blocked, and what is singular on the way."""
        path, length = self.path(self.at(start), self.at(end))
        if not self.module.layout.n_c and len(self.rows) == len(self.driven.led):  # an open chain goes where it is led
            moved = q.copy()
            moved[self.rows] = path.at(length)[1]
            return moved, []
        continuation = Continuation(path, q, fewest=1)
        continuation.step = length
        points = continuation.points
        reached = continuation.to(length, steps=MOST) and not continuation.leaps
        if reached and all(p.tangent.quality > LOW and p.tangent.sign == points[0].tangent.sign for p in points):
            return points[-1].q, []
        followed = FollowedPath(path, q, length)  # a singular position is near, or in between
        stop = [] if followed.stop is None else [followed.stop]
        return (None if stop else followed.position(length)), followed.singular + stop

    def allowed(self, q: Array, t: float) -> bool:
        """Whether all limits are kept."""
        layout = self.module.layout
        if not self.grid.limits:
            return True
        zero = np.zeros(layout.n_v)
        measured = self.module.kernels.motion("loop_coordinates") if layout.n_loop_coordinates else None
        loops = () if measured is None else measured(q, zero, zero, t=t)[0]
        for name, lower, upper in self.grid.limits:
            if name in layout.q:
                value = float(q[layout.q.index(name)])
            else:
                k = layout.loops.index(name)
                value = float(loops[k])
                if layout.loop_kinds[k] == "angle" and not lower <= value <= upper:  # counted from another turn
                    finite = [x for x in (lower, upper) if np.isfinite(x)]
                    value += 2 * np.pi * np.round((sum(finite) / len(finite) - value) / (2 * np.pi))
            if not lower - SLACK <= value <= upper + SLACK:
                return False
        return True


def flood(stage: Stage) -> Flood:
    """Continuation over the whole grid.

    Raises
    ------
    PartitionError
        No point of the grid can be reached from the initial position.
    """
    grid = stage.grid
    layout = stage.module.layout
    status = np.full(grid.shape, OUT, dtype=f"U{len(OUT)}")
    q = np.full((*grid.shape, layout.n_q), np.nan)
    parents: dict[Index, Index] = {}
    edges: list[Edge] = []
    first, place = _first(stage)
    q[first] = place
    status[first] = REACHED
    parents[first] = first
    inside, outside = deque([first]), deque[Index]()
    while inside or outside:  # what limits block is followed last, to tell it from what is out of reach
        within = bool(inside)
        here = inside.popleft() if within else outside.popleft()
        for _, there in grid.neighbours(here):
            if status[there] != OUT:
                continue
            found, singular = stage.step(q[here], here, there)
            edges += [Edge(here, there, one) for one in singular]
            if found is None:
                continue
            q[there] = found
            parents[there] = here
            kept = within and stage.allowed(found, stage.at(there)[0])
            status[there] = REACHED if kept else LIMITED
            (inside if kept else outside).append(there)
    return Flood(status, q, parents, edges)


def _first(stage: Stage) -> tuple[Index, Array]:
    """The nearest grid point that a straight way leads to."""
    grid, scales = stage.grid, np.append(stage.driven.led_scales, 1.0)
    start = np.append(stage.y, stage.t)[stage.columns]
    parts = [((axis - s) / scales[c]) ** 2 for axis, s, c in zip(grid.axes, start, stage.columns, strict=True)]
    far = sum(np.ix_(*parts), np.zeros(grid.shape))
    blocked: Singular | None = None
    for flat in np.argsort(far, axis=None, kind="stable")[:TRIES]:
        index = tuple(int(k) for k in np.unravel_index(flat, grid.shape))
        path, length = stage.path((stage.t, stage.y), stage.at(index))
        q: Array | None = stage.q
        if length > 0.0:
            followed = FollowedPath(path, stage.q, length)
            q = followed.position(length) if followed.stop is None else None
            blocked = followed.stop or blocked
        if q is not None and stage.allowed(q, stage.at(index)[0]):
            return index, q
    why = "all grid points near it are beyond the limits" if blocked is None else str(blocked)
    raise PartitionError(
        f"no point of the grid can be reached from the initial position: {why}; give initial={{...}} inside the grid",
        stage.t,
        stage.q,
    )
