"""Stage reading, by name: a SymPy matrix that is a sum with named parts; mappings whose values are made when asked."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

import sympy

from ..runtime.near_names import unknown

Value = TypeVar("Value")


class NamedSum(sympy.Matrix):  # type: ignore[misc]  # SymPy has no types
    """A column that is the sum of the columns in ``parts``; ``sum["motor"]`` is the part of that name.

    Attributes
    ----------
    parts : dict of str to sympy.Matrix
    """

    parts: Mapping[str, Any] = {}
    _plain: Callable[[str], str] = str

    @classmethod
    def of(cls, total: Sequence[Any], parts: Mapping[str, Any], plain: Callable[[str], str]) -> NamedSum:
        """The column of the total, with its parts; ``plain`` gives ``left_motor`` of ``left.motor``."""
        made = cls(len(total), 1, list(total))
        made.parts, made._plain = dict(parts), plain
        return made

    def __getitem__(self, key: Any) -> Any:
        if not isinstance(key, str):
            return super().__getitem__(key)
        name = key if key in self.parts else self._plain(key)
        if name not in self.parts:
            raise unknown("force element", name, self.parts)
        return self.parts[name]


class ByName(Mapping[str, Value], Generic[Value]):
    """Quantities by name, each made when it is first asked for; ``plain`` gives ``left_rod`` of ``left.rod``."""

    def __init__(
        self, what: str, names: Sequence[str], make: Callable[[str], Value], plain: Callable[[str], str]
    ) -> None:
        self._what, self._names, self._make, self._plain = what, tuple(names), make, plain
        self._made: dict[str, Value] = {}

    def __getitem__(self, name: str) -> Value:
        if name not in self._names and isinstance(name, str):
            name = self._plain(name)
        if name not in self._names:
            raise unknown(self._what, name, self._names)
        if name not in self._made:
            self._made[name] = self._make(name)
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return f"<by {self._what}: {', '.join(self._names)}>"


class SpatialMotion(NamedTuple):
    """Velocity or acceleration of a body or marker in ground axes, SymPy columns (3, 1).

    Attributes
    ----------
    angular : sympy.Matrix
        Angular velocity (rad/s) or acceleration (rad/s^2).
    linear : sympy.Matrix
        Of the origin of the body or marker (m/s, m/s^2).
    center_of_mass : sympy.Matrix
        Of the centre of mass of the body (m/s, m/s^2).
    """

    angular: Any
    linear: Any
    center_of_mass: Any
