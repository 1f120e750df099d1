"""Stage verification, pieces: a joint by its two frames, each a body, a place and a turn, the axis turned to z."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...describe.description import DescribedEntry, Description
from ...describe.placement import TURNS, axis_columns
from ...describe.rewritten_texts import number_of
from ...numeric.rotation_matrices import from_roll_pitch_yaw, roll_pitch_yaw
from .plain import values_of

Frame = dict[str, Any]


def frames_of(description: Description, entry: DescribedEntry) -> tuple[Frame, Frame]:
    """The markers of a joint, its axis as their z axis; each a mapping of body, at, rpy."""
    parameters = values_of(description)
    axis = entry.values.get("axis", "z")
    if isinstance(axis, str):
        columns = TURNS[axis]
    else:
        x, y, z = (number_of(part, parameters) for part in axis)
        columns = axis_columns((x, y, z)) or TURNS["z"]
    turn = np.array(columns, dtype=float).T
    first, second = (_frame(description, reference, turn, parameters) for reference in entry.values["between"])
    return first, second


def _frame(description: Description, reference: Any, turn: Any, parameters: Mapping[str, float]) -> Frame:
    if isinstance(reference, str):
        body, dot, name = reference.partition(".")
        placed: Mapping[str, Any] = {}
        if dot:
            own = next(e for e in description.sections["bodies"] if e.name == body)
            placed = own.values["markers"][name]
    else:
        body, placed = reference["body"], reference
    angles = [number_of(x, parameters) for x in placed.get("rpy", (0, 0, 0))]
    rpy = roll_pitch_yaw(from_roll_pitch_yaw(angles) @ turn)
    return {"body": body, "at": list(placed.get("at", (0, 0, 0))), "rpy": [float(x) for x in rpy]}


def frame_on(body: str) -> Frame:
    """The frame of a body itself."""
    return {"body": body, "at": [0, 0, 0], "rpy": [0.0, 0.0, 0.0]}
