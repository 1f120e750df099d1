"""Analysis: a position and what is held -> the way that leads to balance, each in turn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.algebra import Array
from ..base.limits.analyses import MOVING
from ..errors import EquilibriumError
from .newton import marquardt, newton
from .search import Search, SearchPoint
from .viscous_descent import creep

REACH = 2.0  #: scaled distance from the guess at which a balance is not near it


def find_balance(search: Search, q: Array) -> tuple[SearchPoint, int]:
    """From a position: each way in turn until one leads to balance.

    Newton's iteration finds what is near; where it stalls or leads far away, the motion of a very damped mechanism
    leads to a stable equilibrium; the others find what is far, what plain Newton finds, and what Levenberg and
    Marquardt find.

    Raises
    ------
    EquilibriumError
    """
    start = search.start(q)
    first, steps, found = newton(search, start, reach=REACH)
    if found:
        return first, steps
    ways: list[Callable[[], tuple[SearchPoint, int, bool]]] = [
        lambda: newton(search, start),
        lambda: newton(search, start, plain=True),
        lambda: marquardt(search, start),
    ]
    if not search.names:
        ways.insert(0, lambda: creep(search, start))
    ends = [start, first]
    for way in ways:
        point, more, found = way()
        ends.append(point)
        steps += more
        if not found:
            point, more, found = newton(search, point)
            steps += more
        if found:
            return point, steps
    raise _failure(search, min(ends, key=lambda end: float(np.abs(search.residual(end.here, end.here)).max())))


def _failure(search: Search, point: SearchPoint) -> EquilibriumError:
    here, layout = point.here, search.layout
    names = [layout.velocity_labels[k] for k in here.velocities]
    left = dict(zip(names, here.forces.tolist(), strict=True))
    where = ", ".join(f"{n} = {x:.6g}" for n, x in zip((*layout.q, *layout.states), (*point.q, *point.s), strict=True))
    head = f"no equilibrium of {layout.name!r} found from this guess: "
    rates = np.abs(here.v / layout.scales.q)[here.surplus]
    if rates.size and rates.max() > MOVING:
        worst = int(here.surplus[rates.argmax()])
        return EquilibriumError(
            f"{head}the nonholonomic constraints move {layout.velocity_labels[worst]} at a rate of {here.v[worst]:.6g} "
            f"at {where} even if all independent velocities are 0, so the model cannot stand still there; give another "
            "guess, or constraints that allow a state of rest",
            left,
        )
    scaled = np.abs(here.forces * layout.scales.q[here.velocities])
    worst = int(scaled.argmax())
    what = "rate of the state" if names[worst] in layout.states else "generalized force along"
    return EquilibriumError(
        f"{head}the {what} {names[worst]} is still {here.forces[worst]:.6g} at {where}; give "
        "another guess, or hold a coordinate that no force balances",
        left,
    )
