"""Frozen dataclasses that are quick to define: everything eomgen describes and derives is made of them.

The standard library compiles six methods for each class when it is defined, which for all the classes of eomgen takes
a fifth of the time to its first result.  Here they are methods of the base.  Fields, defaults, ``replace``, ``fields``,
equality and hashes are the same.
"""

from __future__ import annotations

import dataclasses
import inspect
from typing import Any, ClassVar, dataclass_transform


class _Signature:
    """The fields of a class as arguments, listed when they are looked at."""

    def __get__(self, record: object, kind: type[Record]) -> inspect.Signature:
        way, listed = inspect.Parameter.POSITIONAL_OR_KEYWORD, list[inspect.Parameter]()
        for field in kind._fields.values():
            default = inspect.Parameter.empty if field.default is dataclasses.MISSING else field.default
            default = default if field.default_factory is dataclasses.MISSING else None
            listed.append(inspect.Parameter(field.name, way, default=default, annotation=field.type))
        return inspect.Signature(listed)


@dataclass_transform(frozen_default=True)
class Record:
    """A class whose subclasses are frozen dataclasses, each with its own fields beside those of its bases."""

    __signature__ = _Signature()
    _fields: ClassVar[dict[str, dataclasses.Field[Any]]]

    def __init_subclass__(cls) -> None:
        made: Any = dataclasses.dataclass(init=False, repr=False, eq=False)(cls)
        cls._fields = {field.name: field for field in dataclasses.fields(made)}
        if not all(field.init and field.compare and field.hash is None for field in cls._fields.values()):
            raise TypeError(f"a field of {cls.__qualname__} needs the standard library's dataclass")

    def __init__(self, *args: Any, **named: Any) -> None:
        members, fields = vars(self), self._fields
        for name, value in zip(fields, args, strict=False):
            members[name] = value
        for name in list(fields)[len(args) :] if len(args) < len(fields) else ():
            field = fields[name]
            if name in named:
                members[name] = named.pop(name)
            elif field.default is not dataclasses.MISSING:
                members[name] = field.default
            elif field.default_factory is not dataclasses.MISSING:
                members[name] = field.default_factory()
            else:
                raise TypeError(f"{type(self).__qualname__} needs {name}")
        if named or len(args) > len(fields):
            unknown = ", ".join(named) or f"{len(args)} values"
            raise TypeError(f"{type(self).__qualname__} takes {', '.join(fields)} once each, not {unknown}")
        self.__post_init__()

    def __post_init__(self) -> None:
        """What a class does with its fields."""

    def _values(self) -> tuple[Any, ...]:
        members = vars(self)
        return tuple([members[name] for name in self._fields])

    def __repr__(self) -> str:
        parts = (f"{name}={getattr(self, name)!r}" for name, field in self._fields.items() if field.repr)
        return f"{type(self).__qualname__}({', '.join(parts)})"

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Record) and type(other) is type(self):
            return self._values() == other._values()
        return NotImplemented

    def __hash__(self) -> int:
        return hash(self._values())

    def __setattr__(self, name: str, value: object) -> None:
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")

    def __delattr__(self, name: str) -> None:
        raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
