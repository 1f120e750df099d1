"""Frozen dataclasses that are quick to define: everything eomgen describes and derives is made of them.

The standard library compiles six methods for each class when it is defined, which for all the classes of eomgen took a
fifth of the time to its first result.  Here ``__init__`` is compiled when it is needed often, and the other methods are
made without compiling.  Fields, defaults, ``replace``, ``fields``, equality, hashes and errors are the same.
"""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Any, ClassVar, dataclass_transform

#: Objects of a class after which its ``__init__`` is compiled.
MANY = 100


@dataclass_transform(frozen_default=True)
class Record:
    """A class whose subclasses are frozen dataclasses, each with its own fields beside those of its bases."""

    _field_names: ClassVar[tuple[str, ...]]

    def __init_subclass__(cls) -> None:
        made: Any = dataclasses.dataclass(init=False, repr=False, eq=False)(cls)
        fields = dataclasses.fields(made)
        if not all(field.init and field.compare and field.hash is None for field in fields):
            raise TypeError(f"a field of {cls.__qualname__} needs the standard library's dataclass")
        cls._field_names = tuple(field.name for field in fields)
        if "__init__" not in vars(cls):
            made.__init__ = _Init(cls, fields)

    def _values(self) -> tuple[Any, ...]:
        return tuple([getattr(self, name) for name in self._field_names])

    def __repr__(self) -> str:
        fields: Any = dataclasses.fields(self)  # type: ignore[arg-type]
        parts = (f"{field.name}={getattr(self, field.name)!r}" for field in fields if field.repr)
        return f"{type(self).__qualname__}({', '.join(parts)})"

    def __eq__(self, other: object) -> bool:
        return (
            self._values() == other._values()
            if isinstance(other, Record) and type(other) is type(self)
            else NotImplemented
        )

    def __hash__(self) -> int:
        return hash(self._values())

    def __setattr__(self, name: str, value: object) -> None:
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")

    def __delattr__(self, name: str) -> None:
        raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


class _Init:
    """The ``__init__`` of a class until it is worth compiling."""

    def __init__(self, kind: Any, fields: tuple[dataclasses.Field[Any], ...]) -> None:
        self.kind, self.fields, self.calls = kind, fields, 0

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        self.calls += 1
        if instance is not None and self.calls < MANY:
            return partial(self.fill, instance)
        return self.compiled().__get__(instance, owner)

    def compiled(self) -> Any:
        """What takes its place."""
        if vars(self.kind)["__init__"] is self:
            self.kind.__init__ = _compile_init(self.kind, self.fields)
        return vars(self.kind)["__init__"]

    def fill(self, record: Any, *args: Any, **named: Any) -> None:
        """Set the fields; whatever does not fit is left to the compiled function, which says so."""
        members, values, rest = vars(record), iter(args), dict(named)
        for field in self.fields:
            name = field.name
            value = next(values, dataclasses.MISSING)
            if value is dataclasses.MISSING:
                value = rest.pop(name, field.default)
                if value is dataclasses.MISSING:
                    make: Any = field.default_factory
                    if make is dataclasses.MISSING:
                        return self.compiled()(record, *args, **named)  # type: ignore[no-any-return]
                    value = make()
            members[name] = value
        if rest or len(args) > len(self.fields):
            return self.compiled()(record, *args, **named)  # type: ignore[no-any-return]
        if hasattr(record, "__post_init__"):
            record.__post_init__()
        return None


def _compile_init(kind: type, fields: tuple[dataclasses.Field[Any], ...]) -> Any:
    """What the standard library makes for a class of these fields."""
    body: dict[str, Any] = {"__annotations__": {field.name: field.type for field in fields}}
    for field in fields:
        if field.default is not dataclasses.MISSING:
            body[field.name] = field.default
        elif field.default_factory is not dataclasses.MISSING:
            body[field.name] = dataclasses.field(default_factory=field.default_factory)
    if hasattr(kind, "__post_init__"):
        body["__post_init__"] = None
    body |= {"__doc__": kind.__doc__ or kind.__name__, "__module__": kind.__module__}
    standard: Any = dataclasses.dataclass(frozen=True, repr=False, eq=False)(type(kind.__name__, (), body))
    made = vars(standard)["__init__"]
    made.__qualname__ = f"{kind.__qualname__}.__init__"
    return made
