"""Analysis: positions over a grid -> outputs, their Jacobian by the led coordinates, and where either is singular.

J = dy/dx of the chosen outputs y by the led coordinates x, along the constraints (C. Gosselin and J. Angeles,
Singularity analysis of closed-loop kinematic chains, 1990): J loses rank where the outputs cannot move in some
direction, and does not exist where the constraint Jacobian with the led rows does (:mod:`~..simulation.followed_path`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import DEGENERATE, NEGLIGIBLE, NULL, SINGULAR
from ..errors import cannot
from ..numeric.roots import find_root
from ..simulation.followed_path import SHARE, Singular
from .workspace_flood import OUT, Flood, Stage
from .workspace_grid import Index


class WorkspaceSingular(NamedTuple):
    """A singular position of a workspace.

    Attributes
    ----------
    kind : {'stop', 'change point', 'outputs'}
        The grid's coordinates go no further; branches meet; the outputs cannot move in some direction.
    point : tuple of int
        The grid point it is at, or beside which, towards a neighbour.
    values : dict
        Coordinate of the grid -> its value there.
    q : (n_q,) array
    names : tuple of str
        Coordinates that can move while those of the grid stand still; the outputs that lose a direction.
    joints : tuple of str
        Joints and constraints that do not hold that motion.
    """

    kind: str
    point: Index
    values: dict[str, float]
    q: Array
    names: tuple[str, ...]
    joints: tuple[str, ...] = ()

    def __str__(self) -> str:
        place = ", ".join(f"{name} = {value:.6g}" for name, value in self.values.items())
        what = {"stop": "can still move", "change point": "can branch", "outputs": "cannot move in one direction"}
        joints = f" (joints {', '.join(self.joints)})" if self.joints else ""
        return f"{self.kind} at {place}: {', '.join(self.names)} {what[self.kind]}{joints}"


class Conditions(NamedTuple):
    """What is known at the reached points; NaN elsewhere."""

    y: Array  #: (*shape, n_of)
    J: Array  #: (*shape, n_of, n_over)
    quality: Array  #: (*shape,)
    singular: np.ndarray[Any, Any]  #: (*shape,) bool
    found: list[WorkspaceSingular]


class ConditionReader:
    """Outputs and their Jacobian at single positions.

    Parameters
    ----------
    stage : Stage
    """

    def __init__(self, stage: Stage) -> None:
        self.stage, self.driven = stage, stage.driven
        module, self.layout = stage.module, stage.module.layout
        of, layout = stage.grid.of, self.layout
        self.outputs = [name in layout.y and name not in layout.q + layout.loops for name in of]
        kernels = module.kernels
        if any(self.outputs):
            self._values, self._slopes = kernels.motion("motion_outputs"), kernels.motion("output_derivatives")
        self._loops = kernels.motion("loop_coordinates") if layout.n_loop_coordinates else None
        self._loop_q = kernels.state("loop_coordinate_jacobian", nan=True) if layout.n_loop_coordinates else None
        self._still = np.zeros(layout.n_v)
        #: outputs that are angles of cut joints, which come without their turns
        self.wraps = [name in layout.loops and layout.loop_kinds[layout.loops.index(name)] == "angle" for name in of]

    def values(self, q: Array, t: float) -> Array:
        """y (n_of,)."""
        layout, zero = self.layout, self._still
        outputs = self._values(q, zero, zero, t=t) if any(self.outputs) else ()
        loops = self._loops(q, zero, zero, t=t)[0] if self._loops is not None else ()
        found = [
            outputs[layout.y.index(name)]
            if output
            else q[layout.q.index(name)]
            if name in layout.q
            else loops[layout.loops.index(name)]
            for name, output in zip(self.stage.grid.of, self.outputs, strict=True)
        ]
        return np.array(found, dtype=float)

    def motion(self, q: Array, t: float) -> tuple[Array, float]:
        """Velocities (n_v, n_over) along each axis of the grid, and the quality of the position."""
        K = self.driven.matrix(q, t)
        U, S, W = algebra.svd(K, full_matrices=False)
        R = np.array([self.driven.right(q, t, *self.stage.along(k)) for k in range(len(self.stage.grid.names))]).T
        V = W.T @ np.divide(U.T @ R, S[:, None], out=np.zeros((len(S), R.shape[1])), where=S[:, None] > NULL * S[0])
        return self.driven.scales.q[:, None] * V, float(S[-1] / S[0])

    def jacobian(self, q: Array, t: float, V: Array) -> Array:
        """J (n_of, n_over) from the velocities along the axes."""
        layout, zero = self.layout, self._still
        Q = np.array([self.driven.scales.rates(q, v) for v in V.T]).T
        Y = self._slopes(q, zero, zero, t=t) if any(self.outputs) else np.empty((0, 0))
        L = self._loop_q(q, t=t) if self._loop_q is not None else np.empty((0, 0))
        rows = []
        for name, output in zip(self.stage.grid.of, self.outputs, strict=True):
            if output:
                rows.append(Y[layout.y.index(name), : layout.n_q] @ Q)
            elif name in layout.q:
                rows.append(Q[layout.q.index(name)])
            else:
                rows.append(L[layout.loops.index(name)] @ V)
        return np.array(rows, dtype=float)

    def require_positions(self, q: Array, t: float) -> None:
        """Refuse outputs that are rates, forces or accelerations.

        Raises
        ------
        UsageError
        """
        if not any(self.outputs):
            return
        n_q, n = self.layout.n_q, self.layout.n_v
        v = np.cos(np.arange(n) + 1.0)
        moving = [self._slopes(q, x, x, t=t)[:, n_q : n_q + 2 * n] for x in (self._still, v)]
        for name, output in zip(self.stage.grid.of, self.outputs, strict=True):
            k = self.layout.y.index(name) if output else -1
            if output and any(np.any(Y[k]) for Y in moving):
                raise cannot(f"output {name!r} depends on velocities or accelerations; a workspace has positions")


def find_conditions(stage: Stage, reader: ConditionReader, filled: Flood) -> Conditions:
    """Outputs, Jacobians and singular positions of all reached points."""
    grid = stage.grid
    n_y, n_x = len(grid.of), len(grid.names)
    y, J = np.full((*grid.shape, n_y), np.nan), np.full((*grid.shape, n_y, n_x), np.nan)
    quality = np.full(grid.shape, np.nan)
    singular = np.zeros(grid.shape, dtype=bool)
    lost = np.zeros(grid.shape, dtype=bool)
    found = [_known(stage, one, index) for index, _, one in filled.edges]
    for index, beyond, _ in filled.edges:
        singular[index] = True
        singular[beyond] |= bool(filled.status[beyond] != OUT)
    for index, parent in filled.parents.items():
        q, t = filled.q[index], stage.at(index)[0]
        y[index] = reader.values(q, t)
        for k in np.flatnonzero(reader.wraps):
            y[index][k] += 2 * np.pi * np.round((y[parent][k] - y[index][k]) / (2 * np.pi))
        V, quality[index] = reader.motion(q, t)
        if quality[index] < SINGULAR:
            singular[index] = lost[index] = True
            continue
        A = J[index] = reader.jacobian(q, t, V)
        U, S, _ = algebra.svd(A)
        if not S[-1] > DEGENERATE * S[0]:
            singular[index] = lost[index] = True
            found.append(_lost(stage, index, stage.at(index), q, U[:, len(S) - 1]))
    if n_y == n_x:
        for one, other, place in _crossings(stage, reader, filled, J, lost):
            singular[one] = singular[other] = True
            found.append(place)
    return Conditions(y, J, quality, singular, found)


def _known(stage: Stage, one: Singular, index: Index) -> WorkspaceSingular:
    known = {**one.values, "t": one.t}
    values = {name: float(known[name]) for name in stage.grid.names}
    return WorkspaceSingular(one.kind, index, values, one.q, one.moving, one.joints)


def _lost(stage: Stage, index: Index, place: tuple[float, Array], q: Array, direction: Array) -> WorkspaceSingular:
    """The outputs that have a part in the direction in which they cannot move."""
    part = np.abs(direction)
    names = tuple(stage.grid.of[k] for k in np.flatnonzero(part >= SHARE * part.max()))
    t, y = place
    values = {n: float(t if c < 0 else y[c]) for n, c in zip(stage.grid.names, stage.columns, strict=True)}
    return WorkspaceSingular("outputs", index, values, q, names)


def _crossings(
    stage: Stage, reader: ConditionReader, filled: Flood, J: Array, lost: np.ndarray[Any, Any]
) -> list[tuple[Index, Index, WorkspaceSingular]]:
    """Where det J changes its sign between two neighbours; ``lost`` are points known to be singular themselves."""
    with np.errstate(invalid="ignore"):
        size = np.linalg.det(J)
    found = []
    for axis, n in enumerate(stage.grid.shape):
        low, high = np.take(size, range(n - 1), axis), np.take(size, range(1, n), axis)
        with np.errstate(invalid="ignore"):
            crossed = low * high < 0.0
        for one in map(tuple, np.argwhere(crossed).tolist()):
            other = (*one[:axis], one[axis] + 1, *one[axis + 1 :])
            if lost[one] or lost[other]:
                continue
            place = _locate(stage, reader, filled, one, other)
            if place is not None:
                found.append((one, other, place))
    return found


def _locate(stage: Stage, reader: ConditionReader, filled: Flood, one: Index, other: Index) -> WorkspaceSingular | None:
    """The zero of det J between two neighbours; None if they do not lie on one branch."""
    driven = stage.driven
    q = filled.q[one]
    path, length = stage.path(stage.at(one), stage.at(other))
    gap = driven.scales.distance(filled.q[other], q)

    def position(s: float) -> Array | None:
        return driven.position(*path.at(s), driven.scales.move(q, gap * s / length))

    def value(s: float) -> float:
        here = position(s)
        if here is None:
            return float("nan")
        t = path.at(s)[0]
        det = float(np.linalg.det(reader.jacobian(here, t, reader.motion(here, t)[0])))
        return det if abs(det) > enough else 0.0

    enough = 0.0
    ends = value(0.0), value(length)
    enough = NEGLIGIBLE * max(map(abs, ends))
    if not ends[0] * ends[1] < 0.0:
        return None
    s = find_root(value, 0.0, length, *ends)
    here = position(s)
    if here is None:
        return None
    t = path.at(s)[0]
    A = reader.jacobian(here, t, reader.motion(here, t)[0])
    U, S, _ = algebra.svd(A)
    near = one if s <= 0.5 * length else other
    return _lost(stage, near, path.at(s), here, U[:, -1]) if S[-1] < SINGULAR * S[0] else None
