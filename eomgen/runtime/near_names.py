"""Stage runtime: a name that does not fit -> an error that suggests the nearest ones."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from importlib import import_module
from types import ModuleType
from typing import Any

from ..base.names import undotted
from ..base.texts import shown
from ..errors import MissingDependencyError, UnavailableError, UsageError, at_odds, ill_typed

_SHOWS = ("animate", "animation", "film", "gif", "movie", "play", "plot", "show", "video", "view")


class UnknownNameError(UsageError, KeyError, code="EG-NAME-UNKNOWN"):
    """A key that does not exist; also a KeyError, so that mappings behave as expected."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


def without_dots(given: Mapping[Any, Any], instances: Mapping[str, str]) -> dict[Any, Any]:
    """Values by name; ``leg1.hip`` of an instance of a component is ``leg1_hip``, which must not be given beside it."""
    found = {plain_name(name, instances): value for name, value in given.items()}
    if len(found) < len(given):
        twice = [name for name in given if plain_name(name, instances) != name and plain_name(name, instances) in given]
        raise at_odds(f"{', '.join(map(repr, twice))} is given under both of its names; give it once")
    return found


def plain_name(name: object, instances: Mapping[str, str]) -> Any:
    """The name as the model has it; ``leg1.hip`` of an instance of a component is ``leg1_hip``."""
    return undotted(name, instances) if isinstance(name, str) else name


def unknown(what: str, name: object, allowed: Iterable[str], place: str = "") -> UnknownNameError:
    """The error for an unknown name, with near misses or, if there are none, what there is."""
    return UnknownNameError(f"{place}{': ' * bool(place)}no {what} {name!r}; {_hint(name, allowed)}")


def find_lacking(one: object, kind: str, name: str) -> Any:
    """What ``__getattr__`` of a class has to say of an attribute that Python did not find.

    Names that begin with an underscore are asked for by copy, pickle and notebooks, and are looked up nowhere.

    Raises
    ------
    UnavailableError
        With near misses, an AttributeError too; a property that raised one raises its own again.
    """
    if name.startswith("_"):
        raise AttributeError(f"{kind} has no attribute {name!r}", name=name)
    if (own := next((vars(base)[name] for base in type(one).__mro__ if name in vars(base)), None)) is not None:
        return own.__get__(one, type(one))
    public = sorted(n for n in {*dir(type(one)), *vars(one)} if not n.startswith("_"))
    answer = "simulate(...) returns a run, which has animate() and plot(); a module has draw() and explore()"
    meant = answer if name in _SHOWS and "rhs" in public else _hint(name, public, len(public))
    raise UnavailableError(f"{kind} has no attribute {name!r}; {meant}")


def _hint(name: object, allowed: Iterable[str], most: int = 20) -> str:
    choice = list(dict.fromkeys(allowed))
    if near := import_module("..base.names", __package__).closest(name, choice, 3):
        return f"did you mean {' or '.join(near)}?"
    if not choice:
        return "there are none"
    first = ", ".join(choice[:most])
    return f"there {'is' if len(choice) == 1 else 'are'} {first}{' ...' if len(choice) > most else ''}"


def check_names(
    what: str, given: Mapping[str, object], allowed: Collection[str], further: Collection[str] = ()
) -> None:
    """Raise :class:`UnknownNameError` for the first name not allowed; `further` ones are suggested too."""
    for name in given:
        if name not in allowed:
            raise unknown(what, name, [*allowed, *further])


def read_names(what: str, given: Any) -> tuple[str, ...]:
    """One name or several as a tuple of texts.

    Raises
    ------
    UsageError
    """
    if isinstance(given, str):
        return (given,)
    try:
        names = tuple(given)
    except TypeError:
        names = (None,)
    if not all(isinstance(name, str) for name in names):
        raise ill_typed(f"{what} must be a name or a list of names, not {shown(given)}")
    return names


def require_mapping(what: str, given: Any) -> None:
    """Refuse what does not give values by name.

    Raises
    ------
    UsageError
    """
    if not isinstance(given, Mapping):
        raise ill_typed(f"{what} must be a mapping of names to values, not {shown(given)}")


def require(module: str, extra: str, purpose: str) -> ModuleType:
    """Import an optional package, or say in one line what to install."""
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        if error.name is not None and error.name.partition(".")[0] != package:
            raise  # the package is there and something it needs is not
        raise MissingDependencyError(f"{purpose} needs {package}: pip install {extra}") from error


def require_time_and_state(label: str, function: Callable[..., Any]) -> None:
    """Refuse a function that cannot be called as f(t, x); one that shows no signature is left to its first call."""
    from inspect import signature

    try:
        taken = signature(function)
    except (TypeError, ValueError):
        return
    try:
        taken.bind(0.0, None)
    except TypeError:
        given = f"{getattr(function, '__name__', type(function).__name__)}{taken}"
        remedy = "write it with both, as lambda t, x: ..." if len(taken.parameters) < 2 else "bind its other arguments"
        raise ill_typed(f"{label} must be callable as f(t, x), and {given} is not; {remedy}") from None
