"""Stage runtime: files of :mod:`eomgen.show`, loaded when asked for."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from ..errors import MissingDependencyError

#: What is asked for by name; a generated package is without them.
PARTS = {
    "animate": "show.animate",
    "draw": "show.draw",
    "explore": "show.explore",
    "mode_shapes": "show.animate",
}


def load_show(part: str) -> ModuleType:
    """A file of ``eomgen.show``.

    Raises
    ------
    MissingDependencyError
        In a generated package, which has no pictures.
    """
    package = __package__.rpartition(".")[0]
    try:
        return import_module(f"{package}.{PARTS[part]}")
    except ModuleNotFoundError as error:
        if error.name != f"{package}.show":
            raise
        raise MissingDependencyError(
            f"{package} draws nothing by itself; where eomgen is, Module.of({package}) draws and animates"
        ) from None
