"""Stage describe, references: handles, symbols and names -> what a model file would write."""

from __future__ import annotations

from typing import Any

from ..errors import ill_placed
from .described import Described
from .handles import JointHandle, MarkerHandle


def marker_reference(model: Described, value: Any) -> Any:
    """A marker, body or name as a model file refers to it; raises UsageError for a handle of another model."""
    if isinstance(value, MarkerHandle):
        _own(model, value)
        return value.reference
    if isinstance(value, JointHandle):
        raise ill_placed(f"{value.name} is a joint; a body or a marker is expected")
    return value


def joint_reference(model: Described, value: Any) -> Any:
    """A joint, coordinate or name as a model file refers to it; raises UsageError for a handle of another model."""
    if isinstance(value, JointHandle):
        _own(model, value)
        return value.name
    if isinstance(value, MarkerHandle):
        raise ill_placed(f"{value.label} is a body or marker; a joint or a coordinate is expected")
    return value


def _own(model: Described, handle: MarkerHandle | JointHandle) -> None:
    if handle.model is not model:
        name = handle.label if isinstance(handle, MarkerHandle) else handle.name
        other = f"the model {handle.model.name!r}, not to {model.name!r}"
        if handle.model.name == model.name:
            other = f"another model that is called {model.name!r} too"
        raise ill_placed(f"{name} belongs to {other}; use a handle of this model")
