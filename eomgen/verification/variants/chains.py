"""Stage verification, chains: joints of several degrees as chains of simple ones with massless bodies between, and
bodies as two halves that are welded together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...describe.description import DescribedEntry, Description
from ...describe.rewritten_texts import scaled
from ...describe.visit import bodies_of, copied
from .pieces import frame_on, frames_of
from .variant import NotApplicable, References, Variant, coordinates_of

_SLIDES = tuple(("prismatic", axis) for axis in "xyz")


def links_of(entry: DescribedEntry) -> Sequence[tuple[str, str]] | None:
    """Type and axis of the simple joints, one for each coordinate in order; None if there is no such chain."""
    kind, values = entry.values["type"], entry.values
    if "axes" in values:
        return None
    turns = tuple(("revolute", axis) for axis in values.get("sequence", "xyz"))
    if values.get("rotation", "euler_angles") != "euler_angles":
        return None
    return {
        "spherical": turns,
        "free": (*_SLIDES, *turns),
        "cylindrical": (("prismatic", "z"), ("revolute", "z")),
        "universal": (("revolute", "x"), ("revolute", "y")),
        "planar": (*_SLIDES[:2], ("revolute", "z")),
        "translational": _SLIDES,
    }.get(kind)


def chain(description: Description, random: Any) -> Variant:
    """Every joint of several degrees for which there is one as a chain; its coordinates keep their names."""
    made = copied(description)
    names, keys = coordinates_of(description), References(description).keys
    joints: list[DescribedEntry] = []
    gone: dict[str, str] = {}
    for entry in made.sections["joints"]:
        links = links_of(entry)
        if links is None or keys & {entry.name, *names[entry.name]}:
            joints.append(entry)
            continue
        gone[entry.name] = ""
        first, last = frames_of(made, entry)
        for k, ((kind, axis), name) in enumerate(zip(links, names[entry.name], strict=True)):
            end = k == len(links) - 1
            between = [first, last if end else frame_on(f"{entry.name}_part_{k}")]
            if not end:
                made.add("bodies", f"{entry.name}_part_{k}", {"mass": 0, "markers": {}})
            values = {"type": kind, "between": between, "axis": axis, "coordinate": name}
            joints.append(DescribedEntry(f"{entry.name}_link_{k}", values, f"joints.{entry.name}_link_{k}"))
            first = frame_on(f"{entry.name}_part_{k}")
    if not gone:
        raise NotApplicable("no joint of several degrees can be replaced by a chain of joints")
    made.sections["joints"] = joints
    return Variant(made, joints=gone)


_CONTENT = ("mass", "inertia", "principal", "first_moment", "density", "line_density")


def split(description: Description, random: Any) -> Variant:
    """Every body as two halves of the same shape and place, each with half the mass and inertia, welded together."""
    if any(e.values["type"] == "point_gravity" for e in description.sections["forces"]):
        raise NotApplicable("point gravity acts on whole bodies")
    if not bodies_of(description):
        raise NotApplicable("there are no bodies")
    made = copied(description)
    for entry in bodies_of(made):
        for key, value in entry.values.items():
            entry.values[key] = _half(key, value)
        own = {key: value for key, value in entry.values.items() if key != "markers"}
        about = own.get("about")
        markers = (
            dict(entry.values.get("markers", {})) if isinstance(about, str) and about not in ("com", "origin") else {}
        )
        other = f"half_of_{entry.name}"
        made.add("bodies", other, {**own, "markers": markers})
        made.add("joints", f"weld_of_{entry.name}", {"type": "weld", "between": [entry.name, other]})
    return Variant(made)


def _half(key: str, value: Any) -> Any:
    if key in ("solids", "points"):
        return [{k: _half(k, v) for k, v in part.items()} for part in value]
    return _halved(value) if key in _CONTENT else value


def _halved(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: scaled(part, 0.5) for key, part in value.items()}
    return [_halved(part) for part in value] if isinstance(value, list) else scaled(value, 0.5)
