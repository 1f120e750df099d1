"""Stage runtime: what a user gives as the span and the initial state of a run, as types; the last state of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

from numpy.typing import ArrayLike

from ..errors import ill_shaped
from .trajectory import Trajectory

#: An end, or start and end (s); texts are expressions of numbers.
Span: TypeAlias = float | str | Sequence[float | str] | None
#: Named values, a state, or a run, whose last state it is.
Start: TypeAlias = Mapping[str, float | str] | ArrayLike | Trajectory | None


def last_state(given: Any, names: Sequence[str]) -> Any:
    """The last state (n_x,) of a run; anything else as it is.

    Raises
    ------
    UsageError
        The run is one of other states.
    """
    if not isinstance(given, Trajectory):
        return given
    if tuple(given.x_names) != tuple(names):
        raise ill_shaped(f"initial: the run has states {', '.join(given.x_names)}; the model has {', '.join(names)}")
    return given.x[:, -1]
