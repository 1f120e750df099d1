"""Poses and motions of bodies, tables of shapes -> the sum of what all pairs of shapes exert."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.kernel_table import RECORD, WITNESS
from ..base.limits.runs import APART, BEYOND, NEAR, OUTSIDE, UP_TO, WITHIN

# -- vectors of many shapes --------------------------------------------------------------------------------------------


def dot(a: np.ndarray, b: np.ndarray) -> Any:
    """Products of vectors (n, 3, ...)."""
    return (a * b).sum(axis=1)


def parts(poses: np.ndarray) -> tuple[Any, Any, Any, Any]:
    """Position, rotation, velocity and angular velocity of poses (n, POSE, ...)."""
    rotation = poses[:, 3:12].reshape(len(poses), 3, 3, *poses.shape[2:])
    return poses[:, 0:3], rotation, poses[:, 12:15], poses[:, 15:18]


def times(m: Any, a: Any) -> Any:
    """Matrices (n, 3, 3, ...) times vectors (n, 3, ...)."""
    return m[:, :, 0] * a[:, None, 0] + m[:, :, 1] * a[:, None, 1] + m[:, :, 2] * a[:, None, 2]


def product(m: Any, n: Any) -> Any:
    """Products of matrices (n, 3, 3, ...)."""
    return m[:, :, 0, None] * n[:, None, 0] + m[:, :, 1, None] * n[:, None, 1] + m[:, :, 2, None] * n[:, None, 2]


def flat(m: np.ndarray) -> np.ndarray:
    """Matrices (n, 3, 3, ...) as rows of nine numbers."""
    return m.reshape(len(m), 9, *m.shape[3:])


def cross(a: Any, b: Any) -> np.ndarray:
    """Cross products of vectors whose first axis is x, y, z."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def row_cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of vectors (n, 3, ...)."""
    return cross(a.swapaxes(0, 1), b.swapaxes(0, 1)).swapaxes(0, 1)


# -- sums --------------------------------------------------------------------------------------------------------------

# The graph's evaluator and the ``numpy`` target use :class:`PairSum` as it is; the C target writes the same loops.  All
# vectors are in ground axes.


#: Numbers that say how a body or a shape stands and moves: position, rotation by rows, velocity, angular velocity.
POSE = 18
#: Numbers that a pair gives: force on the second shape, torques on both about their centres, the first first, energy.
RESULT = 10
WRENCH = 6  #: numbers of what a body gets
#: Columns of a row of a table of shapes before the sizes: the body, and where its position and rotation stand.
PLACE = 13
#: Columns behind the sizes: where the radius of the sphere that bounds the shape and its thickness stand.
REST = 2
#: Numbers that say how the motion of a body changes: acceleration, angular acceleration.
MOTION = 6
#: Numbers that say how shapes meet: time, penetration and thickness of the deepest pair, and its two shapes.
MEETING = 5
SORTED = 256  #: pairs of tables from which on near ones are found along an axis: below, testing all is as quick
COLUMNS = 2  #: distances count beside columns
NEVER = 1e300  #: (s) where no shapes come towards each other


class PairSum:
    """The loops over pairs of shapes.

    Parameters
    ----------
    bodies : int
        How many bodies are given, ground among them; ``POSE`` numbers each stand before the data.
    tables : sequence of (n, PLACE + sizes + REST) integers
        Shapes of one kind: body, then places in the data of the position (3) and rotation (9) in the body, of the
        sizes, of the radius of a sphere that bounds the shape (-1: none does), and of the thickness of the body.
    kinds : sequence of (first, second, planar, thin, law, value, slope, touch, witness), or also (states, offsets)
        Tables of the first and the second shape; in which directions distances count (0 all, 1 across z of the first, 2
        beside columns that reach down along y of the first without end); how thin the first is (see ``PairKind``);
        places of the law's numbers; the function of one pair and its directional derivative, of the
        numbers of the first shape, of the second, of the law, and of the pair's states (and of their rates in the same
        order); normal, penetration and turning radius of the pair; the ``WITNESS`` numbers of :meth:`witnesses`; how
        many states a pair has, and the numbers of the rows of both tables whose sum is the place of its states.
    capacity : int
        How many pairs :meth:`witnesses` has room for.
    states : int, optional
        How many states all pairs have; they are the last of the data, and their rates the last of the results.
    """

    def __init__(
        self, bodies: int, tables: Sequence[Any], kinds: Sequence[tuple[Any, ...]], capacity: int, states: int = 0
    ):
        self.bodies, self.capacity, self.states = bodies, capacity, states
        self.tables = [np.array(table, dtype=int) for table in tables]
        self.kinds = [(*kind[:9], *self._pairs(*kind[:2])) for kind in kinds]
        self.offsets = [(kind[9], *(np.array(rows) for rows in kind[10])) if states else None for kind in kinds]

    def _pairs(self, first: int, second: int) -> tuple[np.ndarray, np.ndarray]:
        return pairs_of_rows(self.tables[first], self.tables[second], first == second)

    def __call__(self, raw: Sequence[Any]) -> list[Any]:
        """Force and torque about the origin of each body, and the energy: 6 bodies + 1 numbers or arrays."""
        data = _stacked(raw)
        return self._sum(data, None)

    def slope(self, raw: Sequence[Any], rates: Sequence[Any]) -> list[Any]:
        """The derivative of the value in the direction of the rates of what is given."""
        both = _stacked([*raw, *rates])
        return self._sum(both[: len(raw)], both[len(raw) :])

    def slope_along(self, raw: Sequence[Any], places: Sequence[int], rates: Sequence[Any]) -> list[Any]:
        """The derivative in the direction of the rates of what is given at some places."""
        every = [0.0 * raw[0] for _ in raw]
        for k, rate in zip(places, rates, strict=True):
            every[k] = rate
        return self.slope(raw, every)

    def meeting(self, raw: Sequence[Any], accelerations: Sequence[Any]) -> list[Any]:
        """Time (s) within which no two shapes that are apart meet, or get deeper than a part of their thickness.

        Distances and their rates are those of the shapes, as seen from the first one, or of the spheres about them
        where those are apart; a convex shape is at least as far as the tangent to its distance says, so that only the
        relative acceleration, here that of the present, can bring two closer.  Then how deep the deepest two are in
        each other (0 where none are), the sum of their thicknesses, and which they are: numbers of rows, over all
        tables.

        Parameters
        ----------
        raw : sequence
        accelerations : sequence of ``MOTION`` numbers for each body
            Of its origin and angular, ground axes.

        Returns
        -------
        list of ``MEETING`` numbers or arrays
        """
        both = _stacked([*raw, *accelerations])
        data, motions = both[: len(raw)], both[len(raw) :].reshape(self.bodies, MOTION, *both.shape[1:])
        placed = [self._place(table, data, None)[:2] for table in self.tables]
        least = np.full(data.shape[1:], NEVER, dtype=data.dtype)
        deepest = np.zeros((MEETING - 1, *data.shape[1:]), dtype=data.dtype)
        starts = np.cumsum([0, *map(len, self.tables)])
        for first, second, planar, thin, law, _, _, touch, _, i, j in self.kinds:
            (a, arm_a), (b, arm_b) = placed[first], placed[second]
            tables = self.tables[first], self.tables[second]
            if not len(i):
                continue
            change_a, change_b = (
                _changed(x, arm, motions[t[:, 0]]) for x, arm, t in zip((a, b), (arm_a, arm_b), tables, strict=True)
            )
            a, b, change_a, spin = a[i], b[j], change_a[i], motions[tables[0][i, 0]][:, 3:6]
            reach, speed, change = b[:, 0:3] - a[:, 0:3], b[:, 12:15] - a[:, 12:15], change_b[j] - change_a
            if planar:
                upright = a[:, [5, 8, 11]]  # z of the first shape
                reach, speed, change = (x - dot(upright, x)[:, None] * upright for x in (reach, speed, change))
            distance = np.sqrt(dot(reach, reach))
            bound = tables[0][i, -REST], tables[1][j, -REST]
            gap = distance - data[np.maximum(bound[0], 0)] - data[np.maximum(bound[1], 0)]
            free = ((bound[0] < 0) | (bound[1] < 0)).reshape(-1, *([1] * (data.ndim - 1)))
            near = free | ~(gap > 0.0) | (planar == COLUMNS)
            closing, towards = (
                -dot(reach, speed) / np.where(distance > 0.0, distance, 1.0),
                np.sqrt(dot(change, change)),
            )
            if near.any():
                numbers = [*a.swapaxes(0, 1), *b.swapaxes(0, 1), *data[list(law)][:, None]]
                nx, ny, nz, depth, radius = _table(touch(numbers), len(i), data)
                normal, turning = np.stack([nx, ny, nz], axis=1), a[:, 15:18]
                seen = speed - row_cross(turning, reach)
                felt = (
                    change
                    - row_cross(spin, reach)
                    - row_cross(turning, row_cross(turning, reach))
                    - 2.0 * row_cross(turning, seen)
                )
                turned, spun = b[:, 15:18] - turning, motions[tables[1][j, 0]][:, 3:6] - spin
                rate, own_rate, change_of_rate = (np.sqrt(dot(x, x)) for x in (turned, turning, spun))
                faster = radius * rate - dot(normal, seen)  # of points of the second shape, which turns in the first
                gap, closing = np.where(near, -depth, gap), np.where(near, faster, closing)
                most = np.sqrt(dot(felt, felt)) + radius * (change_of_rate + rate * (own_rate + rate))
                towards = np.where(near, most, towards)
            if getattr(touch, "inner", False):  # a law of what is inside: those apart meet other parts before
                gap = np.where(near, gap, NEVER)
            thick = np.broadcast_to(data[tables[0][i, -1]] + data[tables[1][j, -1]], gap.shape)
            passed = data[tables[0][i, -1]] if thin > 1 else thick
            reached = np.maximum(gap * (UP_TO if thin else np.where(free, BEYOND, UP_TO)), WITHIN * passed)
            with np.errstate(all="ignore"):
                root = np.sqrt(closing * closing + 2.0 * towards * reached)
                time = np.where(closing > 0.0, 2.0 * reached / (closing + root), (root - closing) / towards)
            time = np.where((gap > 0.0) & (time > 0.0), time, NEVER)
            least = np.minimum(least, time.min(axis=0))
            far = np.argmin(gap, axis=0)[None]
            depth = np.maximum(-np.take_along_axis(gap, far, axis=0)[0], 0.0)
            names = [np.broadcast_to(x.reshape(free.shape), gap.shape) for x in (starts[first] + i, starts[second] + j)]
            mine = [
                depth,
                *(np.take_along_axis(np.broadcast_to(x, gap.shape), far, axis=0)[0] for x in (thick, *names)),
            ]
            deepest = np.where(depth > deepest[0], np.array(mine), deepest)
        result = [least, *deepest]
        return [x if np.ndim(x) else float(x) for x in result]

    def witnesses(self, raw: Sequence[Any]) -> list[Any]:
        """How many pairs of shapes are near each other, and where: 1 + ``RECORD`` ``capacity`` numbers or arrays.

        Near are pairs that are apart by at most ``NEAR`` times the sum of their thicknesses, ``OUTSIDE`` times where
        one has no far side.  Records that are not used are 0.
        """
        data = _stacked(raw)
        out = np.zeros((1 + RECORD * self.capacity, *data.shape[1:]), dtype=data.dtype)
        for column in np.ndindex(data.shape[1:]):
            place = (slice(None), *column)
            rows = self._witnesses(data[place])
            out[(0, *column)] = len(rows)
            kept = rows[: self.capacity].ravel()
            out[(slice(1, 1 + kept.size), *column)] = kept
        return list(out.tolist()) if out.ndim == 1 else list(out)

    def _witnesses(self, data: np.ndarray) -> np.ndarray:
        """Records of one state."""
        placed = [self._place(table, data, None)[0] for table in self.tables]
        starts = np.cumsum([0, *map(len, self.tables)])
        result = [np.zeros((0, RECORD))]
        for first, second, planar, _, law, _, _, _, witness, i, j in self.kinds:
            a, b, tables = placed[first], placed[second], (self.tables[first], self.tables[second])
            thick = data[tables[0][:, -1]], data[tables[1][:, -1]]
            if not len(i):
                continue
            i, j = self._candidates(a, b, planar, (first, second), data, NEAR * (thick[0] + thick[1].max())) or (i, j)
            free = (tables[0][i, -REST] < 0) | (tables[1][j, -REST] < 0)
            margin = np.where(free, OUTSIDE, NEAR) * (thick[0][i] + thick[1][j])
            near = self._near(a, b, planar, i, j, tables, data, margin)
            i, j, margin = i[near], j[near], margin[near]
            if not len(i):
                continue
            numbers = [*a[i].T, *b[j].T, *data[list(law)][:, None]]
            values = _table(witness(numbers), len(i), data)
            places = [values[k : k + WITNESS] for k in range(0, len(values), WITNESS)]
            rows = np.stack([np.concatenate([[starts[first] + i, starts[second] + j], one]).T for one in places], 1)
            result.append(rows[np.stack([one[3] for one in places], 1) > -margin[:, None]])
        return np.concatenate(result)

    def _sum(self, data: np.ndarray, rates: np.ndarray | None) -> list[Any]:
        placed = [self._place(table, data, rates) for table in self.tables]
        out = np.zeros((6 * self.bodies + 1 + self.states, *data.shape[1:]), dtype=data.dtype)
        if data.dtype == object:
            out = out + data[0] * 0
        for (first, second, planar, _, law, value, slope, _, _, i, j), offsets in zip(
            self.kinds, self.offsets, strict=True
        ):
            (a, arm_a, da, d_arm_a), (b, arm_b, db, d_arm_b) = placed[first], placed[second]
            i, j = self._candidates(a, b, planar, (first, second), data) or (i, j)
            near = self._near(a, b, planar, i, j, (self.tables[first], self.tables[second]), data)
            i, j = i[near], j[near]
            if not len(i):
                continue
            bodies = self.tables[first][i, 0], self.tables[second][j, 0]
            numbers = [*a[i].swapaxes(0, 1), *b[j].swapaxes(0, 1), *data[list(law)][:, None]]
            places = [] if offsets is None else [offsets[1][i] + offsets[2][j] + k for k in range(offsets[0])]
            begun = len(data) - self.states
            numbers += [data[begun + at] for at in places]
            if rates is None:
                result = _table(value(numbers), len(i), data)
                force, torque_a, torque_b = result[0:3], result[3:6], result[6:9]
                torque_a = torque_a - cross(arm_a[i].swapaxes(0, 1), force)
                torque_b = torque_b + cross(arm_b[j].swapaxes(0, 1), force)
            else:
                assert da is not None
                assert db is not None
                moving = [*da[i].swapaxes(0, 1), *db[j].swapaxes(0, 1), *rates[list(law)][:, None]]
                moving += [rates[begun + at] for at in places]
                force = _table(value(numbers), len(i), data)[0:3]
                result = _table(slope([*numbers, *moving]), len(i), data)
                turned = result[0:3]
                torque_a = result[3:6] - cross(arm_a[i].swapaxes(0, 1), turned)
                torque_b = result[6:9] + cross(arm_b[j].swapaxes(0, 1), turned)
                torque_a = torque_a - cross(d_arm_a[i].swapaxes(0, 1), force)
                torque_b = torque_b + cross(d_arm_b[j].swapaxes(0, 1), force)
                force = turned
            for body, push, turn, sign in ((bodies[0], force, torque_a, -1), (bodies[1], force, torque_b, 1)):
                for k in range(3):
                    np.add.at(out, 6 * body + k, sign * push[k])
                    np.add.at(out, 6 * body + 3 + k, turn[k])
            out[6 * self.bodies] = out[6 * self.bodies] + result[9].sum(axis=0)
            for at, change in zip(places, result[RESULT:], strict=True):
                np.add.at(out, 6 * self.bodies + 1 + at, change)
        return list(out.tolist()) if out.ndim == 1 and out.dtype == float else list(out)

    def _place(self, table: np.ndarray, data: np.ndarray, rates: np.ndarray | None) -> tuple[Any, Any, Any, Any]:
        """Numbers of all shapes of a table (n, POSE + sizes, ...), their arms, and the rates of both."""
        poses = data[: POSE * self.bodies].reshape(self.bodies, POSE, *data.shape[1:])[table[:, 0]]
        local, turn = data[table[:, 1:4]], data[table[:, 4:PLACE]].reshape(len(table), 3, 3, *data.shape[1:])
        p, R, v, w = parts(poses)
        arm = times(R, local)
        numbers = [p + arm, flat(product(R, turn)), v + row_cross(w, arm), w, data[table[:, PLACE:-REST]]]
        if rates is None:
            return np.concatenate(numbers, axis=1), arm, None, None
        moving = rates[: POSE * self.bodies].reshape(self.bodies, POSE, *rates.shape[1:])[table[:, 0]]
        d_local = rates[table[:, 1:4]]
        d_turn = rates[table[:, 4:PLACE]].reshape(len(table), 3, 3, *rates.shape[1:])
        dp, dR, dv, dw = parts(moving)
        d_arm = times(dR, local) + times(R, d_local)
        changes = [
            dp + d_arm,
            flat(product(dR, turn) + product(R, d_turn)),
            dv + row_cross(dw, arm) + row_cross(w, d_arm),
            dw,
            rates[table[:, PLACE:-REST]],
        ]
        return np.concatenate(numbers, axis=1), arm, np.concatenate(changes, axis=1), d_arm

    def counts(self, raw: Sequence[Any]) -> list[tuple[int, int]]:
        """For each kind how many pairs are tested for their distance, and of how many the law is evaluated."""
        data = _stacked(raw)
        placed = [self._place(table, data, None)[0] for table in self.tables]
        result = []
        for first, second, planar, *_, i, j in self.kinds:
            a, b, tables = placed[first], placed[second], (self.tables[first], self.tables[second])
            i, j = self._candidates(a, b, planar, (first, second), data) or (i, j)
            result.append((len(i), int(self._near(a, b, planar, i, j, tables, data).sum())))
        return result

    def _candidates(
        self, a: np.ndarray, b: np.ndarray, planar: int, which: tuple[int, int], data: np.ndarray, more: Any = 0.0
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Pairs whose spheres may meet, from the order of their centres along an axis; None where all are to be tested.

        They come in the order of all pairs, so that sums keep their bits.
        """
        first, second = (self.tables[k] for k in which)
        if planar == COLUMNS or data.ndim > 1 or data.dtype != float or len(first) * len(second) < SORTED:
            return None
        if min(first[:, -REST].min(), second[:, -REST].min()) < 0:
            return None
        radii, others = data[first[:, -REST]], data[second[:, -REST]]
        spread = np.ptp(b[:, 0:3], axis=0)
        if planar:  # only axes across z of the first shapes keep distances
            spread[(a[:, [5, 8, 11]] != 0.0).any(axis=0)] = -1.0
        axis = int(np.argmax(spread))
        if spread[axis] < 0.0 or not (np.isfinite(a[:, 0:3]).all() and np.isfinite(b[:, 0:3]).all()):
            return None
        order = np.argsort(b[:, axis], kind="stable")
        places, middle = b[order, axis], a[:, axis]
        wide = radii + max(others.max(), 0.0) + more
        reach = wide + APART * (np.abs(middle) + np.abs(places).max() + wide)
        low, high = places.searchsorted(middle - reach), places.searchsorted(middle + reach, "right")
        i = np.repeat(np.arange(len(first)), high - low)
        j = order[np.arange(len(i)) - np.repeat(np.cumsum(high - low) - high, high - low)]
        keep = first[i, 0] != second[j, 0]
        if which[0] == which[1]:
            keep &= i < j
        i, j = i[keep], j[keep]
        sort = np.lexsort((j, i))
        return i[sort], j[sort]

    def _near(
        self,
        a: np.ndarray,
        b: np.ndarray,
        planar: int,
        i: np.ndarray,
        j: np.ndarray,
        tables: tuple[np.ndarray, np.ndarray],
        data: np.ndarray,
        more: Any = 0.0,
    ) -> np.ndarray:
        """Pairs whose bounding spheres, larger by a length ``more`` together, meet, in any column."""
        bounds = tables[0][i, -REST], tables[1][j, -REST]
        reach = b[j, 0:3] - a[i, 0:3]
        square = (reach * reach).sum(axis=1)
        if planar:
            along = (reach * a[i][:, [5, 8, 11]]).sum(axis=1)  # z of the first shape: the last column of its rotation
            square = square - along * along
        size = data[np.maximum(bounds[0], 0)] + data[np.maximum(bounds[1], 0)] + more
        apart = np.asarray(square > size * size, dtype=bool)
        if planar == COLUMNS:
            x, y = ((reach * a[i][:, axis]).sum(axis=1) for axis in ([3, 6, 9], [4, 7, 10]))
            wide, above = size + np.maximum(-y, 0.0), np.maximum(y, 0.0)
            apart = np.asarray(x * x + above * above > wide * wide, dtype=bool)
        every = np.asarray(apart.all(axis=tuple(range(1, apart.ndim))))
        return np.asarray(~every | (bounds[0] < 0) | (bounds[1] < 0))


def pairs_of_rows(first: Any, second: Any, same: bool) -> tuple[np.ndarray, np.ndarray]:
    """Rows of all pairs on different bodies, each once where both tables are the same."""
    a, b = np.array([row[0] for row in first]), np.array([row[0] for row in second])
    i, j = (x.ravel() for x in np.meshgrid(np.arange(len(a)), np.arange(len(b)), indexing="ij"))
    keep = a[i] != b[j]
    if same:
        keep &= i < j
    return i[keep], j[keep]


def _changed(shapes: np.ndarray, arm: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Accelerations of the centres of shapes (n, 3, ...) from those of their bodies."""
    turning = shapes[:, 15:18]
    return np.asarray(motion[:, 0:3] + row_cross(motion[:, 3:6], arm) + row_cross(turning, row_cross(turning, arm)))


def _stacked(raw: Sequence[Any]) -> np.ndarray:
    if all(type(x) is float for x in raw):
        return np.array(raw)
    kind = float if all(isinstance(x, (int, float, np.ndarray, np.generic)) for x in raw) else object
    spread = np.broadcast_arrays(*(np.asarray(x, dtype=kind) for x in raw))
    stacked = np.empty((len(spread), *spread[0].shape), dtype=kind)
    for k, x in enumerate(spread):
        stacked[k] = x[()]  # an array of no axes would stand there as it is
    return stacked


def _table(result: Sequence[Any], count: int, data: np.ndarray) -> np.ndarray:
    """What a function of a pair gave as an array (RESULT, count, ...); a constant entry is one number."""
    shape = (count, *data.shape[1:])
    return np.array([np.full(shape, x, dtype=data.dtype) for x in result])
