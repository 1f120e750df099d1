"""Variations -> the first states of all runs, and why some have none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.algebra import Array, Indices
from ...base.continuation import LONGEST
from ...base.limits.constraints import (
    CONTRADICTION,
    EXACT,
    GIVEN,
    GONE,
    INDEPENDENT,
    SETTLED,
    STILL,
    STRUCTURE,
)
from ...errors import UsageError
from ..initial import Initial
from ..kernels import Kernels
from ..layout import silent, values_at
from ..refusals import require_switched
from ..runs.events import at_next_samples, require_agreement
from ..runs.run_arguments import find_state
from .variations import Variations

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..inputs import Forcing

Mask = np.ndarray[Any, np.dtype[np.bool_]]

UNASSEMBLED = -111  #: status of a run whose initial values could not be assembled


def assemble_states(
    module: BoundModel, varied: Variations, t: float, forcing_of: Callable[[int], Forcing]
) -> tuple[Array, Mask, list[str]]:
    """The initial states (n_x, k) of all runs on the constraints at time t, NaN where a run cannot be assembled.

    Also which these are (k,), and why, for each of them in order.  ``forcing_of(k)`` has the inputs of a run.
    """
    with silent():  # for all runs, when their values were collected
        x, reasons = _assemble_all(module, varied, t, forcing_of)
    if module.info.clocks:
        for k in set(range(varied.count)) - reasons.keys():
            x[:, k] = at_next_samples(module.bind(**varied.column(k)), t, x[:, k])
    if module.layout.switches:
        _refuse_disagreement(module, varied, t, x, reasons)
    failed = np.array([k in reasons for k in range(varied.count)], dtype=bool)
    return x, failed, [reasons[k] for k in sorted(reasons)]


def _refuse_disagreement(module: BoundModel, varied: Variations, t: float, x: Array, reasons: dict[int, str]) -> None:
    """Add the runs at whose start a constraint declared closed does not hold, or one is half closed."""
    layout, by_name = module.layout, varied.states is None and bool(module.info.rows_to_hold)
    for k in set(range(varied.count)) - reasons.keys():
        try:
            require_switched(layout, x[layout.n_x - layout.n_states :, k])
            if by_name:
                require_agreement(module.bind(**varied.column(k)), t, x[:, k], varied.values)
        except UsageError as error:
            reasons[k], x[:, k] = str(error), np.nan


@np.errstate(all="ignore")
def _assemble_all(
    module: BoundModel, varied: Variations, t: float, forcing_of: Callable[[int], Forcing]
) -> tuple[Array, dict[int, str]]:
    """The states (n_x, k), and why runs have none; what several runs have in common is solved for once."""
    layout = module.layout
    free = not module.n_rows and not layout.space
    if varied.states is not None and free:
        return np.array(varied.states), {}
    led, x = forcing_of(0).constrained, np.full((module.n_x, varied.count), np.nan)

    def assemble(columns: list[int]) -> None:
        k = columns[0]
        if led:  # constraints depend on inputs that vary
            values = {name: float(value[k] if np.ndim(value) else value) for name, value in varied.values.items()}
            raw: Any = (values or None) if varied.states is None else varied.states[:, k]
            x[:, k] = find_state(module.rebound(**varied.column(k)), raw, t, forcing_of(k))
        elif varied.states is not None:
            x[:, columns] = module.project(varied.states[:, columns], t=t, **varied.column(k))
        else:
            x[:, columns] = _assemble_named(module, varied, columns, t)

    every, good = [*range(varied.count)], np.zeros(varied.count, dtype=bool)
    if every and not (led or varied.differ):
        assemble(every)
        return x, {}
    differ = varied.starts_differ and layout.n_v <= DENSE  # the same for every block
    if varied.states is None and not led and (free or differ):
        most = max(ROOM // (layout.n_c * layout.n_v + 1), 1)
        parts = [varied.part(i, i + most) for i in range(0, varied.count, most)]
        result = [_assemble_side_by_side(module, part, t) for part in parts]
        good = np.concatenate([good[:0], *(one for _, one in result)])
        x[:, good] = np.hstack([x[:, :0], *(one for one, _ in result)])[:, good]
    return x, varied.in_groups(layout, np.flatnonzero(~good).tolist(), led, assemble)


def _assemble_named(module: BoundModel, varied: Variations, columns: list[int], t: float) -> Array:
    """The states of runs that differ, as far as starts can tell, in their named values alone."""
    kernels = Kernels(module.core, module.layout, **varied.column(columns[0]))
    initial = Initial(kernels, t, varied.values)
    raw = [initial.sort({name: float(x[k] if np.ndim(x) else x) for name, x in varied.values.items()})
             for k in columns]  # fmt: skip
    alike: dict[tuple[float, ...], list[int]] = {}
    for i, one in enumerate(raw):
        alike.setdefault(tuple(one.positions.values()), []).append(i)
    x = np.empty((module.n_x, len(columns)))
    for places in alike.values():
        first = raw[places[0]]
        q = initial.assembled(first.positions)
        rates = {name: np.array([raw[i].rates[name] for i in places]) for name in first.rates}
        v = initial.velocities(q, rates if first.positions or rates else None)
        x[: module.n_q, places] = q[:, None]
        x[module.n_q :, places] = v if v.ndim > 1 else v[:, None]
    return x


# -- starts of many runs side by side ----------------------------------------------------------------------------------

# As Initial does for one run, with one call of a kernel for all of them.  Newton's method is trusted where each step is
# so much shorter than the one before that it ends at the only position near (Kantorovich); held values go to theirs in
# short ways.  A run is left to Initial where that does not hold, where the held values do not decide the position, and
# where a value is to be refused.


ROOM = 2**21  #: numbers of Jacobians at a time
ROUNDS = 12  #: steps of Newton's method
SHRINK = 0.25  #: largest first scaled step, and largest part of the one before that a further step has
SAFE = 1e-3  #: least singular value, relative to the largest, of what follows from held values
DENSE = 200  #: largest n_v with loops; beyond it dense matrices take as long as the runs one by one
STRIDE = 0.1  #: scaled way of held values from one closed position to the next


class SideBySide:
    """The starts of runs from named values that are entries of the state.

    Attributes
    ----------
    q : (n_q, k) array
        Positions reached.
    good : (k,) bool array
        Whether a run has arrived there.
    """

    def __init__(self, module: BoundModel, varied: Variations) -> None:
        self.layout, self.varied = module.layout, varied
        names = "constraints", "constraint_jacobian", "velocity_constraints", "alignment"
        self.C, self.C_q, self.C_t, self.alignment = (module.kernels.kernel(name, nan=True) for name in names)
        sizes = np.concatenate([self.layout.scales.q, self.layout.scales.c])
        self.sizes = np.repeat(sizes[:, None], varied.count, axis=1)
        if "scales" in module.core.names and varied.p.ndim > 1:
            self.sizes = module.kernels.kernel("scales", nan=True)(np.empty((0, varied.count)), p=varied.p)
        self.q = np.repeat(self.layout.q_reference[:, None], varied.count, axis=1)
        self.good: Mask = np.ones(varied.count, dtype=bool)

    def jacobian(self, runs: Indices) -> tuple[Array, dict[str, Array]]:
        """Scaled Jacobians (k, n_c, n_v) at the positions of some runs, zero where one is no number; their p, u."""
        raw, n, sizes = self.varied.column(runs), self.layout.n_v, self.sizes[:, runs]
        J = np.ascontiguousarray((self.C_q(self.q[:, runs], **raw) * sizes[:n] / sizes[n:, None]).transpose(2, 0, 1))
        J[~np.isfinite(J).all(axis=(1, 2))] = 0.0
        return J, raw

    def close(self, held: Sequence[int], runs: Indices) -> None:
        """Close the loops of some runs with some coordinates held."""
        n, h = self.layout.n_v, self.layout.n_h
        free = np.setdiff1d(np.arange(self.layout.n_q), held)
        self.good[runs] = False
        last, before = np.ones(len(runs)), np.full(len(runs), np.inf)
        for _ in range(ROUNDS):
            if not len(runs):
                break
            J, raw = self.jacobian(runs)
            e = (self.C(self.q[:, runs], **raw) / self.sizes[n : n + h, runs]).T
            size = np.abs(e).max(axis=1, initial=0.0)
            U, steep, V = np.linalg.svd(J[:, :h, free], full_matrices=False)
            decided = (steep[:, -1:] > SAFE * steep[:, :1]).all(axis=1) & (len(free) <= h)
            done = (size <= EXACT) | (decided & (size <= SETTLED) & (size > 0.5 * before))
            self.good[runs[done]] = True
            z = _times(V.transpose(0, 2, 1), _times(U.transpose(0, 2, 1), e) / steep)
            length = np.abs(z).max(axis=1, initial=0.0)
            on = decided & ~done & (length <= np.maximum(SHRINK * last, SETTLED))
            runs, last, before = runs[on], length[on], size[on]
            self.q[np.ix_(free, runs)] -= z[on].T * self.sizes[np.ix_(free, runs)]
        if self.layout.sizes.n_alignments:
            self.good &= (self.alignment(self.q, p=self.varied.p, u=self.varied.u) > 0.0).all(axis=0)

    def lead(self, held: Sequence[int], values: Array) -> None:
        """Lead held coordinates straight to values (h, k), with the loops closed on the way."""
        start = self.q[held]
        way = np.abs((values - start) / self.sizes[held]).max(axis=0, initial=0.0)
        self.good &= way <= LONGEST
        steps = np.ceil(np.where(self.good, way, 0.0) / STRIDE).astype(int)
        for step in range(1, steps.max(initial=0) + 1):
            runs = np.flatnonzero(self.good & (steps >= step))
            part = step / steps[runs]
            there = start[:, runs] + part * (values - start)[:, runs]
            self.q[np.array(held)[:, None], runs] = np.where(part == 1.0, values[:, runs], there)
            self.close(held, runs)

    def independent(self, rows: int, raw: Sequence[int], rest: Sequence[int]) -> list[int]:
        """Those given, and of the rest, in order, what is independent of the constraints and of each other.

        Runs where that is not as at the reference position, or where one that is given can hardly move, are left.
        """
        runs, scales = np.flatnonzero(self.good), self.layout.scales
        if not rows:
            return [*raw, *rest]
        reference = scales.jacobian(self.C_q(self.layout.q_reference))
        J, kept = np.concatenate([reference[None], self.jacobian(runs)[0]])[:, :rows], list(raw)
        _, steep, V = np.linalg.svd(J)
        ranks = (steep > STRUCTURE * steep[:, :1]).sum(axis=1)
        alike, N = ranks == ranks[0], V[:, ranks[0] :]  # motions that the constraints allow
        for i in (*raw, *rest):
            size = np.linalg.norm(N[:, :, i], axis=1)
            moves = size > INDEPENDENT
            alike &= size > STILL if i in raw else moves == moves[0]
            kept += [i] * bool(i not in raw and moves[0])
            row = np.where(moves, 1.0 / size, 0.0)[:, None] * N[:, :, i]
            N = N - row[:, :, None] * _times(N.transpose(0, 2, 1), row)[:, None]
        self.good[runs[~alike[1:]]] = False
        return kept

    def velocities(self, held: Sequence[int], v: Array) -> Array:
        """Velocities (n_v, k) with those held of v, the others as small as can be."""
        layout, runs = self.layout, np.flatnonzero(self.good)
        if not (layout.n_c and len(runs)):
            return v
        n, rank = layout.n_v, layout.rank
        J, raw = self.jacobian(runs)
        steep = np.linalg.svd(J, compute_uv=False)
        determined = ((steep > STRUCTURE * steep[:, :1]).sum(axis=1) == rank) & (
            steep[:, rank - 1] > GONE * steep[:, 0]
        )
        x, free = (v[:, runs] / self.sizes[:n, runs]).T, np.setdiff1d(np.arange(n), held)
        rest = (self.C_t(np.concatenate([self.q[:, runs], 0.0 * x.T]), **raw) / self.sizes[n:, runs]).T
        inverse = np.asarray(np.linalg.pinv(J[:, :, free], rcond=GIVEN), dtype=float)
        for _ in range(2):
            x[:, free] -= _times(inverse, _times(J, x) + rest)
        speed = np.abs(np.hstack([x[:, : layout.moving], rest])).max(axis=1, initial=1.0)
        self.good[runs] = determined & (np.abs(_times(J, x) + rest).max(axis=1) <= CONTRADICTION * speed)
        v[:, runs] = x.T * self.sizes[:n, runs]
        return v


def _times(A: Array, x: Array) -> Array:
    """Matrices (k, m, n) times vectors (k, n), in bits that do not depend on k."""
    return np.asarray((A @ np.ascontiguousarray(x)[:, :, None])[:, :, 0])


def _assemble_side_by_side(module: BoundModel, varied: Variations, t: float) -> tuple[Array, Mask]:
    """The states (n_x, k) of runs, and which they are: the others are left to Initial."""
    layout, entries, starts = module.layout, [*module.layout.x], SideBySide(module, varied)
    now, n_q = values_at(layout, varied.p), layout.n_q
    values, numbers = {**layout.info.initial, **now, **varied.values}, np.zeros((layout.n_x, varied.count))
    if layout.quaternion_slots or layout.general_rates or layout.initial_outputs or not {*values} <= {*entries}:
        return numbers, np.zeros(varied.count, dtype=bool)
    for name, value in values.items():
        numbers[entries.index(name)] = value
    declared, late, raw = (
        [entries.index(name) for name in names] for names in (layout.info.initial, now, varied.values)
    )
    first, moved, wanted = ([i for i in places if i < n_q] for places in (declared, late, raw))
    if (t and layout.n_c) or (layout.n_h and moved and wanted):
        return numbers, np.zeros(varied.count, dtype=bool)
    starts.good &= np.isfinite(numbers).all(axis=0)
    if not layout.n_h:
        starts.q[first + wanted] = numbers[first + wanted]
    else:
        for i in first:
            starts.q[i] = layout.info.initial[entries[i]]
        starts.close(first, np.flatnonzero(starts.good))
        if moved:
            starts.lead(first, numbers[first])
        elif wanted:
            held = starts.independent(layout.n_h, wanted, [i for i in first if i not in wanted])
            starts.lead(held, numbers[held])
    rates, wanted = ([i - n_q for i in places if i >= n_q] for places in (declared, raw))
    if raw:
        rates = starts.independent(layout.n_c, wanted, [i for i in rates if i not in wanted])
    return np.concatenate([starts.q, starts.velocities(rates, numbers[n_q:])]), starts.good
