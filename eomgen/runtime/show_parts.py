"""Stage runtime: files of :mod:`eomgen.show`, loaded when asked for; a generated package has no copy of them."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from ..errors import MissingDependencyError


def load_show(part: str, purpose: str) -> ModuleType:
    """A file of ``eomgen.show``.

    Raises
    ------
    MissingDependencyError
        This is a generated package, and eomgen is not installed.
    """
    for home in (f"{__package__.rpartition('.')[0]}.show", "eomgen.show"):
        try:
            return import_module(f"{home}.{part}")
        except ModuleNotFoundError as error:
            if error.name is None or not f"{home}.{part}".startswith(error.name):
                raise
    raise MissingDependencyError(f"{purpose} of a generated package needs eomgen too: pip install eomgen")
