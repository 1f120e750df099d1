"""Simulation: the end of a run whose steps lead nowhere, as :mod:`.stalling` finds it."""

from __future__ import annotations

from ..base.algebra import Array


class Crawling(Exception):
    """Raised inside an integration whose steps lead nowhere.

    Parameters
    ----------
    t : float
    x : (n_x,) array
    step : float
        Mean length of the last steps (s).
    """

    def __init__(self, t: float, x: Array, step: float) -> None:
        super().__init__(t, x, step)
        self.t, self.x, self.step = t, x, step
