"""The slowest oscillation of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .modes import modes

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


def wobble(module: BoundModel, /) -> float:
    """The lowest natural frequency (Hz) about the equilibrium nearest to the declared position.

    Raises
    ------
    EquilibriumError
        None was found.
    """
    hertz = modes(module).hertz
    return float(hertz[hertz > 0.0].min(initial=float("inf")))
