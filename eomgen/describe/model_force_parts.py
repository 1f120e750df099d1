"""Stage describe, the builder's forces, common parts: handles and symbols -> an entry of the forces section."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..errors import UsageError
from .described import Described
from .references import joint_reference, marker_reference

Value = Any  # a number, a text or a SymPy expression


class ForceParts(Described):
    """What the methods that add force elements share."""

    def _force(self, type_name: str, name: str, **keys: Any) -> None:
        given = {key: value for key, value in keys.items() if value is not None}
        self._description.add("forces", name, {"type": type_name, **given})

    def _marker(self, value: Any) -> Any:
        return marker_reference(self, value)

    def _joint(self, value: Any) -> Any:
        return joint_reference(self, value)

    def _pair(self, a: Any, b: Any) -> list[Any]:
        return [self._marker(a), self._marker(b)]

    def _where(self, between: tuple[Any, ...], joint: Any) -> dict[str, Any]:
        if joint is not None and not between:
            return {"joint": self._joint(joint)}
        if joint is None and len(between) == 1:
            return {"joint": self._joint(between[0])}
        if joint is None and len(between) == 2:
            return {"between": self._pair(*between)}
        raise UsageError("give one joint or two markers, and then the values")

    def _via(self, stops: Sequence[Any]) -> list[Any] | None:
        """Markers, and cylinders as mappings of around, radius, sense; None if there are none."""
        via = [
            {key: self._marker(x) if key == "around" else x for key, x in stop.items()}
            if isinstance(stop, Mapping) and "around" in stop
            else self._marker(stop)
            for stop in stops
        ]
        return via or None
