"""The core of a model -> BoundModel; BoundModel -> Trajectory.

Importing it costs NumPy and little more; SciPy, pandas, matplotlib and rich load inside the calls that need them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .bound_model import BoundModel
    from .inputs import Signal
    from .minimal import Minimal
    from .protocols import Core
    from .trajectory import Trajectory, load_trajectory

_HOMES = {
    "BoundModel": "bound_model",
    "Core": "protocols",
    "Minimal": "minimal",
    "Signal": "inputs",
    "Trajectory": "trajectory",
    "load_trajectory": "trajectory",
}

__all__ = ["BoundModel", "Core", "Minimal", "Signal", "Trajectory", "load_trajectory"]


def __getattr__(name: str) -> Any:
    """Load a public name on first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    return value
