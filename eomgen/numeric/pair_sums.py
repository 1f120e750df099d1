"""Stage numeric: poses and motions of bodies, tables of shapes -> the sum of what all pairs of shapes exert, by body.

The graph's evaluator and the ``numpy`` target use :class:`PairSum` as it is; the C target writes the same loops.  All
vectors are in ground axes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

#: Numbers that say how a body or a shape stands and moves: position, rotation by rows, velocity, angular velocity.
POSE = 18
#: Numbers that a pair gives: force on the second shape, torques on both about their centres, the first first, energy.
RESULT = 10
#: Columns of a row of a table of shapes before the sizes: the body, and where its position and rotation stand.
PLACE = 13

Narrow = Callable[[Sequence[Any]], Sequence[Any]]


class PairSum:
    """The loops over pairs of shapes.

    Parameters
    ----------
    bodies : int
        How many bodies are given, ground among them; ``POSE`` numbers each stand before the data.
    tables : sequence of (n, PLACE + sizes + 1) integers
        Shapes of one kind: body, then places in the data of the position (3) and rotation (9) in the body, of the
        sizes, and of the radius of a sphere that bounds the shape (-1: none does).
    kinds : sequence of (first, second, planar, law, value, slope)
        Tables of the first and the second shape; whether distances count across z of the first only; places of the
        law's numbers; the function of one pair and its directional derivative, of the numbers of the first shape, of
        the second, and of the law (and of their rates in the same order).
    """

    def __init__(self, bodies: int, tables: Sequence[Any], kinds: Sequence[tuple[int, int, bool, Any, Narrow, Narrow]]):
        self.bodies = bodies
        self.tables = [np.array(table, dtype=int) for table in tables]
        self.kinds = [(*kind, *self._pairs(*kind[:2])) for kind in kinds]

    def _pairs(self, first: int, second: int) -> tuple[np.ndarray, np.ndarray]:
        """Rows of all pairs on different bodies, each once."""
        a, b = self.tables[first], self.tables[second]
        i, j = (x.ravel() for x in np.meshgrid(np.arange(len(a)), np.arange(len(b)), indexing="ij"))
        keep = a[i, 0] != b[j, 0]
        if first == second:
            keep &= i < j
        return i[keep], j[keep]

    def __call__(self, given: Sequence[Any]) -> list[Any]:
        """Force and torque about the origin of each body, and the energy: 6 bodies + 1 numbers or arrays."""
        data = _stacked(given)
        return self._sum(data, None)

    def slope(self, given: Sequence[Any], rates: Sequence[Any]) -> list[Any]:
        """The derivative of the value in the direction of the rates of what is given."""
        both = _stacked([*given, *rates])
        return self._sum(both[: len(given)], both[len(given) :])

    def slope_along(self, given: Sequence[Any], places: Sequence[int], rates: Sequence[Any]) -> list[Any]:
        """The derivative in the direction of the rates of what is given at some places."""
        every = [0.0 * given[0] for _ in given]
        for k, rate in zip(places, rates, strict=True):
            every[k] = rate
        return self.slope(given, every)

    def _sum(self, data: np.ndarray, rates: np.ndarray | None) -> list[Any]:
        placed = [self._place(table, data, rates) for table in self.tables]
        out = np.zeros((6 * self.bodies + 1, *data.shape[1:]), dtype=data.dtype)
        if data.dtype == object:
            out = out + data[0] * 0
        for first, second, planar, law, value, slope, i, j in self.kinds:
            (a, arm_a, da, d_arm_a), (b, arm_b, db, d_arm_b) = placed[first], placed[second]
            near = self._near(a, b, planar, i, j, (self.tables[first], self.tables[second]), data)
            i, j = i[near], j[near]
            if not len(i):
                continue
            bodies = self.tables[first][i, 0], self.tables[second][j, 0]
            numbers = [*np.moveaxis(a[i], 1, 0), *np.moveaxis(b[j], 1, 0), *data[list(law)][:, None]]
            if rates is None:
                result = _table(value(numbers), len(i), data)
                force, torque_a, torque_b = result[0:3], result[3:6], result[6:9]
                torque_a = torque_a - _cross(arm_a[i].swapaxes(0, 1), force)
                torque_b = torque_b + _cross(arm_b[j].swapaxes(0, 1), force)
            else:
                assert da is not None
                assert db is not None
                moving = [*np.moveaxis(da[i], 1, 0), *np.moveaxis(db[j], 1, 0), *rates[list(law)][:, None]]
                force = _table(value(numbers), len(i), data)[0:3]
                result = _table(slope([*numbers, *moving]), len(i), data)
                turned = result[0:3]
                torque_a = result[3:6] - _cross(arm_a[i].swapaxes(0, 1), turned)
                torque_b = result[6:9] + _cross(arm_b[j].swapaxes(0, 1), turned)
                torque_a = torque_a - _cross(d_arm_a[i].swapaxes(0, 1), force)
                torque_b = torque_b + _cross(d_arm_b[j].swapaxes(0, 1), force)
                force = turned
            for body, push, turn, sign in ((bodies[0], force, torque_a, -1), (bodies[1], force, torque_b, 1)):
                for k in range(3):
                    np.add.at(out, 6 * body + k, sign * push[k])
                    np.add.at(out, 6 * body + 3 + k, turn[k])
            out[-1] = out[-1] + result[9].sum(axis=0)
        return list(out.tolist()) if out.ndim == 1 and out.dtype == float else list(out)

    def _place(self, table: np.ndarray, data: np.ndarray, rates: np.ndarray | None) -> tuple[Any, Any, Any, Any]:
        """Numbers of all shapes of a table (n, POSE + sizes, ...), their arms, and the rates of both."""
        poses = data[: POSE * self.bodies].reshape(self.bodies, POSE, *data.shape[1:])[table[:, 0]]
        local, turn = data[table[:, 1:4]], data[table[:, 4:PLACE]].reshape(len(table), 3, 3, *data.shape[1:])
        p, R, v, w = _parts(poses)
        arm = _times(R, local)
        numbers = [p + arm, _flat(_product(R, turn)), v + _across(w, arm), w, data[table[:, PLACE:-1]]]
        if rates is None:
            return np.concatenate(numbers, axis=1), arm, None, None
        moving = rates[: POSE * self.bodies].reshape(self.bodies, POSE, *rates.shape[1:])[table[:, 0]]
        d_local = rates[table[:, 1:4]]
        d_turn = rates[table[:, 4:PLACE]].reshape(len(table), 3, 3, *rates.shape[1:])
        dp, dR, dv, dw = _parts(moving)
        d_arm = _times(dR, local) + _times(R, d_local)
        changes = [
            dp + d_arm,
            _flat(_product(dR, turn) + _product(R, d_turn)),
            dv + _across(dw, arm) + _across(w, d_arm),
            dw,
            rates[table[:, PLACE:-1]],
        ]
        return np.concatenate(numbers, axis=1), arm, np.concatenate(changes, axis=1), d_arm

    def _near(
        self,
        a: np.ndarray,
        b: np.ndarray,
        planar: bool,
        i: np.ndarray,
        j: np.ndarray,
        tables: tuple[np.ndarray, np.ndarray],
        data: np.ndarray,
    ) -> np.ndarray:
        """Pairs whose bounding spheres meet, in any column."""
        bounds = tables[0][i, -1], tables[1][j, -1]
        reach = b[j, 0:3] - a[i, 0:3]
        square = (reach * reach).sum(axis=1)
        if planar:
            along = (reach * a[i][:, [5, 8, 11]]).sum(axis=1)  # z of the first shape: the last column of its rotation
            square = square - along * along
        size = data[np.maximum(bounds[0], 0)] + data[np.maximum(bounds[1], 0)]
        apart = np.asarray(square > size * size, dtype=bool)
        every = np.asarray(apart.all(axis=tuple(range(1, apart.ndim))))
        return np.asarray(~every | (bounds[0] < 0) | (bounds[1] < 0))


def _stacked(given: Sequence[Any]) -> np.ndarray:
    if all(type(x) is float for x in given):
        return np.array(given)
    kind = float if all(isinstance(x, (int, float, np.ndarray, np.generic)) for x in given) else object
    spread = np.broadcast_arrays(*(np.asarray(x, dtype=kind) for x in given))
    stacked = np.empty((len(spread), *spread[0].shape), dtype=kind)
    for k, x in enumerate(spread):
        stacked[k] = x[()]  # an array of no axes would stand there as it is
    return stacked


def _table(result: Sequence[Any], count: int, data: np.ndarray) -> np.ndarray:
    """What a function of a pair gave as an array (RESULT, count, ...); a constant entry is one number."""
    shape = (count, *data.shape[1:])
    return np.array([np.broadcast_to(np.asarray(x, dtype=data.dtype), shape) for x in result])


def _parts(poses: np.ndarray) -> tuple[Any, Any, Any, Any]:
    rotation = poses[:, 3:12].reshape(len(poses), 3, 3, *poses.shape[2:])
    return poses[:, 0:3], rotation, poses[:, 12:15], poses[:, 15:18]


def _times(m: Any, a: Any) -> Any:
    """Matrices (n, 3, 3, ...) times vectors (n, 3, ...)."""
    return m[:, :, 0] * a[:, None, 0] + m[:, :, 1] * a[:, None, 1] + m[:, :, 2] * a[:, None, 2]


def _product(m: Any, n: Any) -> Any:
    return m[:, :, 0, None] * n[:, None, 0] + m[:, :, 1, None] * n[:, None, 1] + m[:, :, 2, None] * n[:, None, 2]


def _flat(m: np.ndarray) -> np.ndarray:
    return m.reshape(len(m), 9, *m.shape[3:])


def _cross(a: Any, b: Any) -> np.ndarray:
    """Cross products of vectors whose first axis is x, y, z."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _across(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of vectors (n, 3, ...)."""
    return np.moveaxis(_cross(np.moveaxis(a, 1, 0), np.moveaxis(b, 1, 0)), 0, 1)
