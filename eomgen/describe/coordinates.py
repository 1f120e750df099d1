"""Stage describe, coordinates: what a user named, a joint or a coordinate -> the coordinate, its kind, its joint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..elements.entry import Found
from ..graph.shown import quoted, shown
from .build_joints import Declared
from .names import nearest
from .sympy_face import name_of
from .values import Reader


def find_coordinate(reader: Reader, joints: Sequence[Declared], path: str, value: Any) -> Found | None:
    """The coordinate meant by the name of a joint of one degree, or by its own; None, and a fault, if there is none."""
    faults, given = reader.faults, name_of(value)
    own = next((j for j in joints if j.entry.name == given), None)
    home = next((j for j in joints if given in j.coordinates), None)
    if own is not None and home is not None and own is not home:
        remedy = "rename one of them"
        faults.add(path, f"{given!r} is a joint, and a coordinate of {home.entry.name!r}", remedy, "EG-NAME-TAKEN")
        return None
    if home is not None:
        return Found(str(given), home.joint.coordinates[home.coordinates.index(given)].kind, home.entry.name)
    if own is not None:
        if len(own.coordinates) == 1:
            return Found(own.coordinates[0], own.joint.coordinates[0].kind, own.entry.name)
        names = ", ".join(own.coordinates) or "none"
        message = f"joint {quoted(given)} has {len(own.coordinates)} coordinates"
        faults.add(path, message, f"name one of them: {names}", "EG-REFERENCE")
        return None
    if isinstance(given, str) and reader.names.kinds.get(given) == "coordinate":
        return Found(given, "angle", None)
    if faults.under(f"joints.{given}"):
        return None  # the joint itself is at fault, which is told already
    known = [j.entry.name for j in joints]
    known += [c for c in reader.names.of("coordinate") if c not in known]
    faults.add(
        path, f"no joint {quoted(given)}", nearest(shown(given), known, "joints and coordinates"), "EG-NAME-UNKNOWN"
    )
    return None
