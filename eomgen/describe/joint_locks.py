"""Stage describe, joints that close and open: their keys -> constraints of type lock, and of type hold for welds.

While a joint with coordinates is closed, these stay where they are; open, it is the joint that it says.  A weld holds
its bodies while it is closed, and not at all while it is open.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..constraints.switching import SWITCHING
from ..joints import JOINTS
from .description import DescribedEntry, Description

WELD = "weld"


def with_locks(description: Description) -> Description:
    """The description with a constraint for each joint that closes and opens; the same one where there is none."""
    joints = [_parts(entry) for entry in description.sections["joints"]]
    added = [constraint for _, constraint in joints if constraint is not None]
    if not added:
        return description
    sections = description.sections | {
        "joints": [joint for joint, _ in joints if joint is not None],
        "constraints": [*description.sections["constraints"], *added],
    }
    return replace(description, sections=sections)


def _parts(entry: DescribedEntry) -> tuple[DescribedEntry | None, DescribedEntry | None]:
    """What of an entry remains a joint, and what is a constraint."""
    kind: Any = entry.values.get("type")
    own = {key: value for key, value in entry.values.items() if key in SWITCHING}
    if not own or not isinstance(kind, str) or kind not in JOINTS:
        return entry, None
    rest = {key: value for key, value in entry.values.items() if key not in SWITCHING}
    if kind == WELD:
        held = {"axes": "xyz", "turning": "xyz", **{key: x for key, x in rest.items() if key != "type"}}
        return None, replace(entry, values={"type": "hold", **held, **own})
    if not JOINTS[kind].coordinates:
        return entry, None
    return replace(entry, values=rest), replace(entry, values={"type": "lock", "joint": entry.name, **own})
