"""Stage runtime: files of :mod:`eomgen.show`, loaded when asked for."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

#: What is asked for by name; a generated package carries these files.
PARTS = {
    "animate": "show.animate",
    "data": "show.data",
    "draw": "show.draw",
    "explore": "show.explore",
    "mode_shapes": "show.mode_shapes",
}


def load_show(part: str) -> ModuleType:
    """A file of ``eomgen.show``."""
    return import_module(f"{__package__.rpartition('.')[0]}.{PARTS[part]}")
