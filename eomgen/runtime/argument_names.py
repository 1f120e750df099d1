"""Arguments: p and parameters, u and inputs name the same arguments; ``leg.hip`` of an instance is ``leg_hip``."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import TYPE_CHECKING, Any, TypeVar

from ..base.kernel_table import argument
from ..errors import at_odds

if TYPE_CHECKING:
    from .layout import Layout

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
                raise at_odds(f"{others[other]} and {other} are the same argument; give one of them")
            given[others[other]] = given.pop(other)
        try:
            return function(*args, **given)
        except TypeError as error:
            _, own, fault = str(error).partition(f"{function.__qualname__}()")
            if not own:
                raise
            name = getattr(args[0], "name", "f") if function.__name__ == "__call__" else function.__name__
            needed = [n for n, one in taken.items() if one.default is one.empty and n not in ("self", "module")]
            fault = fault.replace("'x'", f"'{argument(name, 'x')}'")
            raise TypeError(f"{name}({', '.join(argument(name, n) for n in needed)}){fault}") from None

    return call  # type: ignore[return-value]


def plain_names(function: Function) -> Function:
    """The same function of a model, which takes names of instances with dots, in lists and mappings too.

    Texts that name nothing of the model, such as those of files, stay as they are.
    """

    @wraps(function)
    def call(model, *args, **given):  # type: ignore[no-untyped-def]
        layout = model.layout
        if layout.instances:
            args = tuple(_plain(layout, value) for value in args)
            given = _plain(layout, given)
        return function(model, *args, **given)

    return call  # type: ignore[return-value]


def _plain(layout: Layout, value: Any) -> Any:
    if isinstance(value, str):
        found = layout.plain(value)
        return found if found in layout.names or found.partition(".")[0] in layout.bodies else value
    if isinstance(value, dict):
        found = {_plain(layout, name): _plain(layout, x) for name, x in value.items()}
        return found if len(found) == len(value) else value  # a name given twice is told where it is read
    if type(value) in (list, tuple) and any(isinstance(x, str | dict | tuple) for x in value):
        return type(value)(_plain(layout, x) for x in value)
    return value
