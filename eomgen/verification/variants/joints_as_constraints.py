"""Stage verification, closures: a joint that closes a loop as elementary constraints, or as written equations."""

from __future__ import annotations

from typing import Any

from ...describe.description import DescribedEntry, Description
from ...describe.visit import copied
from .cuts import in_loops
from .pieces import Frame, frames_of
from .variant import NotApplicable, References, Variant, coordinates_of, drop, entry_of

#: Joint -> elementary constraints that hold the same relative poses.
CONSTRAINTS = {
    "revolute": ("inline", "inplane", "parallel"),
    "continuous": ("inline", "inplane", "parallel"),
    "prismatic": ("inline", "orientation"),
    "cylindrical": ("inline", "parallel"),
    "spherical": ("inline", "inplane"),
    "planar": ("inplane", "parallel"),
    "weld": ("inline", "inplane", "orientation"),
}
#: Joint -> what remains beside the three equations that its points coincide.
BESIDE = {"revolute": ("parallel",), "continuous": ("parallel",), "spherical": (), "weld": ("orientation",)}


def as_constraints(description: Description, random: Any) -> Variant:
    """One joint of a loop as elementary constraints."""
    return _closed(description, random, CONSTRAINTS, False)


def as_equations(description: Description, random: Any) -> Variant:
    """One joint of a loop by equations ``x(a) - x(b) = 0`` and the like; every rod by the equation of its length."""
    return _closed(description, random, BESIDE, True)


def _closed(description: Description, random: Any, table: dict[str, tuple[str, ...]], equations: bool) -> Variant:
    made, references = copied(description), References(description)
    names = coordinates_of(description)
    candidates = [
        name
        for name in in_loops(description)
        if entry_of(made, "joints", name).values["type"] in table and not references.to((name, *names[name]))
    ]
    rods = [e for e in made.sections["joints"] if e.values["type"] == "distance"] if equations else []
    if not candidates and not rods:
        raise NotApplicable("every joint that closes a loop is named by another element")
    gone: dict[str, str] = {}
    for rod in rods:
        _equations(made, rod, rod=True)
        gone[rod.name] = ""
    if candidates:
        chosen = entry_of(made, "joints", candidates[int(random.integers(len(candidates)))])
        gone[chosen.name] = ""
        first, second = frames_of(made, chosen)
        for kind in table[chosen.values["type"]]:
            made.add("joints", f"{chosen.name}_{kind}", {"type": kind, "between": [first, second]})
        if equations:
            _equations(made, chosen, rod=False)
        drop(made, names[chosen.name])
    made.sections["joints"] = [e for e in made.sections["joints"] if e.name not in gone]
    return Variant(made, joints=gone)


def _equations(made: Description, entry: DescribedEntry, rod: bool) -> None:
    """The equations between two points that become named markers."""
    labels = [
        _marker(made, frame, f"{entry.name}_{end}") for frame, end in zip(frames_of(made, entry), "ab", strict=True)
    ]
    gaps = [f"({axis}({labels[1]}) - {axis}({labels[0]}))" for axis in "xyz"]
    if rod:
        length = entry.values["length"]
        squares = " + ".join(f"{gap}**2" for gap in gaps)
        made.add("constraints", f"{entry.name}_rod", {"type": "coupling", "equation": f"{squares} - ({length})**2"})
        return
    for axis, gap in zip("xyz", gaps, strict=True):
        made.add("constraints", f"{entry.name}_gap_{axis}", {"type": "coupling", "equation": gap})


def _marker(made: Description, frame: Frame, name: str) -> str:
    body = entry_of(made, "bodies", frame["body"])
    body.values.setdefault("markers", {})[name] = {"at": frame["at"], "rpy": frame["rpy"]}
    return f"{frame['body']}.{name}"
