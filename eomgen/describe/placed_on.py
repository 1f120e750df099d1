"""A place given from a marker -> the same place in the marker's body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.algebra import from_roll_pitch_yaw, roll_pitch_yaw
from ..errors import cannot, off_range
from .description import items
from .names import function_words
from .placement import TURNS, Numbers, axis_columns, complete_axes
from .rewritten_texts import names_of, number_of, total

Placed = Mapping[str, Any]


def is_constant(value: Any) -> bool:
    """Whether a value is a number, or a text of numbers alone such as ``-pi/6``."""
    return not isinstance(value, str) or names_of(value) <= {"pi", *function_words()}


def with_rpy(placed: Placed, parameters: Mapping[str, float]) -> dict[str, Any]:
    """A place whose turn, if it is given by axes or by a matrix, is given by roll, pitch and yaw.

    Raises
    ------
    KeyError
        A matrix depends on a parameter that has no value.
    """
    made = {key: value for key, value in placed.items() if key not in ("axes", "matrix")}
    if "matrix" in placed:
        rows = [[number_of(x, parameters) for x in items(row) or ()] for row in items(placed["matrix"]) or ()]
        made["rpy"] = [float(x) for x in roll_pitch_yaw(np.array(rows))]
    elif "axes" in placed:
        (first, a), (second, b) = ((key, _direction(axis)) for key, axis in placed["axes"].items())
        columns = complete_axes("xyz".index(first), a, "xyz".index(second), b)
        made["rpy"] = [float(x) for x in roll_pitch_yaw(np.array(columns).T)]
    return made


def _direction(axis: Any) -> Numbers:
    if isinstance(axis, str):
        return TURNS[axis][2]
    x, y, z = (number_of(part, {}) for part in axis)
    columns = axis_columns((x, y, z))
    if columns is None:
        raise off_range("has an axis without length")
    return columns[2]


def placed_on(outer: Placed, inner: Placed) -> dict[str, Any]:
    """``at`` and ``rpy`` in a body of what is placed in the axes of a frame of that body.

    Parameters
    ----------
    outer : mapping
        ``at`` (m) and ``rpy`` (rad) of the frame in the body, numbers or texts.
    inner : mapping
        ``at`` and ``rpy`` in the frame.

    Returns
    -------
    dict
        ``at`` in body axes and, where something is turned, ``rpy``.

    Raises
    ------
    UsageError
        The frame is turned by angles that depend on parameters, or a value is no list of three.
    """
    try:
        (a, turn), (b, own) = (_read(with_rpy(placed, {})) for placed in (outer, inner))
    except KeyError:
        raise cannot("is placed on a frame whose matrix depends on parameters") from None
    if turn is None:
        at = [total((1.0, 1.0), pair) for pair in zip(a, b, strict=True)]
        return {"at": at} if own is None else {"at": at, "rpy": own}
    if own is None and all(not isinstance(x, str) and x == 0 for x in b):
        return {"at": a, "rpy": turn}
    if not all(map(is_constant, [*turn, *(own or ())])):
        raise cannot("is placed on a frame that is turned by angles which depend on parameters")
    rotation = from_roll_pitch_yaw([number_of(x, {}) for x in turn])
    at = [total([1.0, *row], [x, *b]) for row, x in zip(rotation.tolist(), a, strict=True)]
    if own is not None:
        turn = [float(x) for x in roll_pitch_yaw(rotation @ from_roll_pitch_yaw([number_of(x, {}) for x in own]))]
    return {"at": at, "rpy": turn}


def _read(placed: Placed) -> tuple[list[Any], list[Any] | None]:
    at, turn = (items(placed.get(key, (0, 0, 0))) for key in ("at", "rpy"))
    if at is None or turn is None or len(at) != 3 or len(turn) != 3:
        raise cannot("has a place that is not given as at: [x, y, z] with rpy: [roll, pitch, yaw]")
    turned = any(isinstance(x, str) or x != 0 for x in turn)
    return at, turn if turned else None
