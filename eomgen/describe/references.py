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
        raise ill_placed(f"{value!r} is a joint; a body or a marker is expected")
    return value


def joint_reference(model: Described, value: Any) -> Any:
    """A joint, coordinate or name as a model file refers to it; raises UsageError for a handle of another model."""
    if isinstance(value, JointHandle):
        _own(model, value)
        return value.name
    if isinstance(value, MarkerHandle):
        raise ill_placed(f"{value!r} is a body or marker; a joint or a coordinate is expected")
    return value


def _own(model: Described, handle: MarkerHandle | JointHandle) -> None:
    if handle.model is not model:
        raise ill_placed(f"{handle!r} belongs to the model {handle.model.name!r}, not to {model.name!r}")
