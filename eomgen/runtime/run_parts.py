"""Stage runtime: what a run's result consists of, besides its states: residuals, events by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, SupportsIndex, overload

from ..base.algebra import Array
from .near_names import unknown


class Named(list[Array]):
    """What belongs to each event, by its place or its name.

    It is a list, so that a loop over it meets the arrays; ``in``, ``keys()``, ``items()`` and ``get`` go by name.
    """

    def __init__(self, values: Sequence[Array], names: Sequence[str]) -> None:
        super().__init__(values)
        self.names = tuple(names)

    @classmethod
    def of(cls, values: Sequence[Array], header: Mapping[str, Any]) -> Named:
        """What belongs to the events of a run, by the names in its header; without names they are counted."""
        return cls(values, header.get("event_names") or [f"event_{k}" for k in range(len(values))])

    @overload
    def __getitem__(self, key: str | SupportsIndex) -> Array: ...
    @overload
    def __getitem__(self, key: slice) -> list[Array]: ...
    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            if key not in self.names:
                raise unknown("event", key, self.names)
            key = self.names.index(key)
        return super().__getitem__(key)

    def __contains__(self, name: object) -> bool:
        """Whether an event has this name; an array is in it if it is one of those here."""
        if isinstance(name, str):
            return name in self.names
        return any(name is values for values in self)

    def keys(self) -> tuple[str, ...]:
        """Names of the events."""
        return self.names

    def values(self) -> list[Array]:
        """What belongs to each event."""
        return list(self)

    def items(self) -> list[tuple[str, Array]]:
        """Names, and what belongs to them."""
        return list(zip(self.names, self, strict=True))

    def get(self, name: str, default: Any = None) -> Any:
        """What belongs to the event of a name, ``default`` if there is none."""
        return self[name] if name in self.names else default

    def __reduce__(self) -> tuple[Any, ...]:
        return Named, (list(self), self.names)


class Residuals(NamedTuple):
    """Largest violation of the constraints over a run, all rows, redundant ones included."""

    raw_position: float = 0.0  #: of the integrator's states (m, rad)
    raw_velocity: float = 0.0  #: (m/s, rad/s)
    position: float = 0.0  #: of the stored, projected states
    velocity: float = 0.0
    correction_position: float = 0.0  #: largest change of a coordinate by the projection
    correction_velocity: float = 0.0  #: largest change of a velocity

    @classmethod
    def of(cls, given: Residuals | Mapping[str, float] | Callable[[], Residuals]) -> Residuals:
        """Residuals as a run has them: themselves, by name, or a function that evaluates them."""
        if isinstance(given, Residuals):
            return given
        return given() if callable(given) else cls(**given)
