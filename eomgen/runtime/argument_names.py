"""Stage runtime: p and parameters, u and inputs name the same arguments, whichever of them a function has."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import TypeVar

from ..errors import UsageError

Function = TypeVar("Function", bound=Callable[..., object])
PAIRS = (("p", "parameters"), ("u", "inputs"), ("parameters", "p"), ("inputs", "u"))


def both_names(function: Function) -> Function:
    """The same function, which takes each argument of PAIRS under either name.

    Raises
    ------
    UsageError
        A call gives both.
    """
    taken = signature(function).parameters
    others = {other: name for name, other in PAIRS if name in taken and other not in taken}
    place = {name: k for k, name in enumerate(taken)}

    @wraps(function)
    def call(*args, **given):  # type: ignore[no-untyped-def]
        for other in others.keys() & given.keys() if given else ():
            if others[other] in given or place[others[other]] < len(args):
                raise UsageError(f"{others[other]} and {other} are the same argument; give one of them")
            given[others[other]] = given.pop(other)
        return function(*args, **given)

    return call  # type: ignore[return-value]
