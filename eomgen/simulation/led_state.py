"""Simulation: inputs that move constraints and depend on the state -> a first state that fits both."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.constraints import ALIKE
from ..errors import AssemblyError

if TYPE_CHECKING:
    from ..runtime.inputs import Forcing
    from ..runtime.layout import Layout

#: Assemblies in turn, by secant steps, with inputs that depend on the state.
ROUNDS = 50


def find_led_state(layout: Layout, forcing: Forcing, t: float, assembled: Callable[[Array], Array]) -> Array:
    """The state (n_x,) that is assembled with the inputs that it gives itself.

    Parameters
    ----------
    layout : Layout
    forcing : Forcing
    t : float
    assembled : callable
        u (n_u,) -> the state assembled with these inputs.

    Raises
    ------
    AssemblyError
        None was found.
    """
    places = layout.constraint_inputs

    def assemble(u: Array) -> tuple[Array, Array]:
        """The state at inputs u, and the inputs at this state."""
        x = assembled(u)
        found = forcing(t, x)
        forcing.require_finite()
        return x, found

    u = forcing(t, np.concatenate([layout.q_reference, np.zeros(layout.n_v)]))
    forcing.require_finite()
    secant, before = -np.eye(len(places)), None  # with this first guess of the slope a step takes what was found
    for _ in range(ROUNDS):
        x, found = assemble(u)
        gap = (found - u)[places]
        if np.all(np.abs(gap) <= ALIKE * (1.0 + np.abs(u[places]))):
            return x
        if before is not None:  # Broyden's update: the slope that explains the last step
            move, change = before
            secant += np.outer(gap - change - secant @ move, move) / (move @ move)
        move = algebra.lstsq(secant, -gap, rcond=None)
        if not np.isfinite(move).all() or not move.any():
            break
        before, u = (move, gap), found.copy()
        u[places] = found[places] - gap + move
    names = ", ".join(layout.u[i] for i in places)
    given, gives = (", ".join(f"{value:.6g}" for value in values[places]) for values in (u, forcing(t, x)))
    raise AssemblyError(
        f"the inputs {names} change with the state that the constraints give, and no state that fits both was found at "
        f"t = {t:.6g} s: the last state was assembled with {given}, but there the inputs are {gives}; "
        "give initial values nearer to such a state, or write the inputs in t",
        [],
        code="EG-CONTRADICTION",
    )
