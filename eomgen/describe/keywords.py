"""Stage describe, keywords of the builder: a class of methods -> the same, answering a misspelt one by the nearest."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

from ..constraints.switching import IN_PLACE_OF_JOINTS, SWITCHING
from ..errors import no_such
from ..joints import JOINTS
from .names import nearest

Class = TypeVar("Class", bound=type[Any])


def names_keywords(cls: Class) -> Class:
    """Make the public methods of a class raise UsageError for a keyword they do not have, naming those they have."""
    for name, value in list(vars(cls).items()):
        if inspect.isfunction(value) and not name.startswith("_"):
            setattr(cls, name, _checked(value))
    return cls


def _checked(method: Callable[..., Any]) -> Callable[..., Any]:
    parameters = list(inspect.signature(method).parameters.values())[1:]
    if any(p.kind is p.VAR_KEYWORD for p in parameters):
        return method
    allowed = [p.name for p in parameters if p.kind is not p.VAR_POSITIONAL]

    @functools.wraps(method)
    def checked(*args: Any, **keys: Any) -> Any:
        check_keywords(method.__name__, keys, allowed)
        return method(*args, **keys)

    return checked


def keywords_of(function: Callable[..., Any]) -> list[str]:
    """Arguments of a function that are given by keyword only."""
    parameters = inspect.signature(function).parameters.values()
    return [p.name for p in parameters if p.kind is p.KEYWORD_ONLY]


def check_keywords(name: str, given: Iterable[str], allowed: Sequence[str]) -> None:
    """Raise UsageError for the first keyword that a method does not have."""
    for key in given:
        if key not in allowed:
            if name in JOINTS and key in SWITCHING:
                raise no_such(f"{name} has no argument {key!r}: {IN_PLACE_OF_JOINTS}")
            raise no_such(f"{name} has no argument {key!r}; {nearest(key, allowed, 'it takes')}")
