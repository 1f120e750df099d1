"""Stage numeric: loops that did not close, velocities that cannot be -> why: what is open, contradicts, is near."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array, Indices
from ..base.limits.constraints import CONTRADICTION, MEASURED
from .closure import FAR, ClosureSystem, close, closed, remoteness
from .projection import largest
from .ranks import rank
from .starts import starts


class AssemblyFailure(NamedTuple):
    """Everything needed to say why an assembly failed."""

    system: ClosureSystem
    guess: Array
    held: Indices
    best: Array
    flipped: bool
    names: Sequence[str]
    labels: Sequence[str]
    restarts: int

    def message(self) -> str:
        """What failed, and what to do."""
        given = self._given(self.guess, self.system.equations.values if self.system.equations else np.empty(0))
        if self.flipped:
            return (
                f"the loops close only with the axes of a joint flipped{self._with(given)}; "
                "give initial values nearer to the wanted position"
            )
        gaps = "the largest gaps are " + ", ".join(f"{label} {gap:.3g}" for label, gap in self.open_rows())
        contradiction = self._contradiction()
        if contradiction:
            return contradiction
        if not given:
            tried = f"({self.restarts + 1} starts tried)"
            return f"the loops do not close from the given guess {tried}: {gaps}; {self._advice()}"
        free = ClosureSystem(self.system.position, self.system.scales, np.ones_like(self.system.free))
        for start in starts(self.best, free.free, free.scales, self.restarts // 2):
            with np.errstate(all="ignore"):
                q, residual = close(free, start)
            if closed(residual):
                break
        else:
            return (
                f"the loops do not close{self._with(given)}, nor with these values left free "
                f"({self.restarts + 1} starts tried): {gaps}; {self._advice()}"
            )
        near = self._given(q, self.system.equations.evaluate(q)[0] if self.system.equations else np.empty(0))
        dof = len(free.free) - rank(free.evaluate(q)[1]).rank
        if len(given) > dof:
            return (
                f"the given values {', '.join(given)} are inconsistent: {len(given)} values for {dof} "
                f"degree{'s' if dof != 1 else ''} of freedom, and with all of them held {gaps}; "
                f"give fewer, or consistent ones such as {', '.join(near)}"
            )
        return f"the loops cannot close{self._with(given)}: {gaps}; a closed position nearby has {', '.join(near)}"

    def _contradiction(self) -> str:
        """Words for open rows that no position can satisfy together: they depend on each other everywhere."""
        m = len(self.system.position(self.best)[0])
        labels = (list(self.labels) or [f"C[{i}]" for i in range(m)])[:m]
        gaps = [(labels.index(label), label, gap) for label, gap in self.open_rows() if label in labels]
        rows = [i for i, _, _ in gaps]
        if not rows:
            return ""
        for start in starts(self.best, np.ones_like(self.system.free), self.system.scales, 3):
            C, C_q = self.system.position(start)
            J, e = self.system.scales.jacobian(C_q)[rows], self.system.scales.residual(C)[rows]
            if not np.isfinite(J).all():
                return ""
            out_of_reach = algebra.svd(J)[0][:, rank(J).rank :]
            if largest(out_of_reach.T @ e) <= MEASURED:
                return ""
        names = ", ".join(f"{label} (off by {gap:.3g})" for _, label, gap in gaps)
        if len(gaps) == 1:
            return f"the constraint {names} can never hold: no coordinate changes it; remove it, or correct its values"
        return (
            f"the constraints {names} contradict each other: they restrict the same motion and cannot hold together; "
            "remove one of them, or make their values agree"
        )

    def _advice(self) -> str:
        e, J = self.system.evaluate(self.guess)
        far = remoteness(e, np.sqrt((J * J).sum(axis=1)))
        if far > FAR:
            away = f"the guess is far away (about {far:.2g} times the mechanism's size)"
            return f"{away}: give a better one, or check the dimensions"
        return "check the dimensions, or give a better guess"

    def _with(self, given: list[str]) -> str:
        return f" with {', '.join(given)}" if given else ""

    def _given(self, q: Array, y: Array) -> list[str]:
        names = self.names or [f"q[{i}]" for i in range(len(q))]
        coordinates = [f"{names[i]} = {q[i]:.6g}" for i in self.system.scales.coordinates(self.held)]
        functions = self.system.equations.names if self.system.equations else ()
        return coordinates + [f"{name} = {value:.6g}" for name, value in zip(functions, y, strict=True)]

    def open_rows(self) -> list[tuple[str, float]]:
        """The three rows that stay open the most: label and gap."""
        C = self.system.position(self.best)[0]
        e, found = self.system.scales.residual(C), list(C)
        labels = list(self.labels) or [f"C[{i}]" for i in range(len(C))]
        if self.system.equations:
            y = self.system.equations.difference(self.system.equations.evaluate(self.best)[0])
            e = np.concatenate([e, y / self.system.equations.scales])
            found += list(y)
            labels += list(self.system.equations.names)
        worst = np.argsort(-np.abs(e), kind="stable")[:3].tolist()
        order = [i for i in worst if not abs(e[i]) <= CONTRADICTION] or worst[:1]
        return [(labels[i], abs(float(found[i]))) for i in order]


def describe_contradiction(
    given: Mapping[str, float], e: Array, row_scales: Array, labels: Sequence[str], limit: float, J: Array
) -> str:
    """Why velocities cannot be assembled.

    Parameters
    ----------
    given : mapping of str to float
        The rates to be held.
    e, row_scales, labels : (m,) arrays, sequence of str
        Scaled residuals of the rows, their scales and names.
    limit : float
        Scaled residuals up to which rows are fulfilled.
    J : array
        Scaled Jacobian of the constraints.
    """
    order = [i for i in np.argsort(-np.abs(e), kind="stable")[:3] if not abs(e[i]) <= limit]
    dof = J.shape[1] - rank(J).rank
    where = ", ".join(f"{labels[i]} {abs(e[i] * row_scales[i]):.3g}/s" for i in order)
    values = ", ".join(f"{name} = {value:.6g}" for name, value in given.items())
    return (
        f"{f'the given velocities {values}' if given else 'the driven constraints'} are inconsistent with {dof} "
        f"degree{'s' if dof != 1 else ''} of freedom at this position: the largest residuals are {where}; give fewer "
        "or other velocities"
    )
