"""Stage emit: Program -> SourceSet, the text of the generated files; pure and deterministic.

What writes a language is loaded when it is first used: a model that runs in NumPy needs none of what writes C.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .sources import SourceSet

if TYPE_CHECKING:
    from .c import emit_c
    from .numpy import emit_numpy
    from .package import emit_package

_HOMES = {"emit_c": "c", "emit_numpy": "numpy", "emit_package": "package"}

__all__ = ["SourceSet", "emit_c", "emit_numpy", "emit_package"]


def __getattr__(name: str) -> Any:
    """Load a public name on first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    return value
