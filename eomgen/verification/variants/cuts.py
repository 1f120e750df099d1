"""Stage verification, cuts: another joint of a loop is cut, and other coordinates are independent.

Which joint is cut follows from what the user named: the one joint of a loop whose coordinates bear no name of theirs.
"""

from __future__ import annotations

from typing import Any

from ...describe.description import Description
from ...describe.rewritten_texts import rewritten
from ...describe.visit import Slot, Visitor, visit
from ...joints import JOINTS
from .variant import NotApplicable, Variant, coordinates_of, sketch_of


def body_of(reference: Any) -> str:
    """The body of a marker."""
    return str(reference["body"] if not isinstance(reference, str) else reference.partition(".")[0])


def in_loops(description: Description) -> list[str]:
    """Joints without which every body is still connected as it was: those of loops, pure constraints aside."""
    joints = [e for e in description.sections["joints"] if JOINTS[e.values["type"]].role != "loop"]
    edges = [(e.name, *map(body_of, e.values["between"])) for e in joints]
    found = []
    for name, start, end in edges:
        reached, waiting = {start}, [start]
        while waiting:
            here = waiting.pop()
            for other, a, b in edges:
                for near in (b,) if a == here else (a,) if b == here else ():
                    if other != name and near not in reached:
                        reached.add(near)
                        waiting.append(near)
        if end in reached:
            found.append(name)
    return found


def cut_another(description: Description, random: Any) -> Variant:
    """A joint of a loop, chosen at random, is the only one whose coordinates have no names of their own."""
    loops = in_loops(description)
    types = {e.name: JOINTS[e.values["type"]] for e in description.sections["joints"]}
    choice = [name for name in loops if types[name].role == "either"]
    if not choice:
        raise NotApplicable("no loop has another joint that can be cut")
    chosen = choice[int(random.integers(len(choice)))]
    names = coordinates_of(description)
    taken = {name for own in names.values() for name in own} | {
        e.name for section in ("parameters", "inputs") for e in description.sections[section]
    }
    new: dict[str, str] = {}
    for entry in description.sections["joints"]:
        if entry.name == chosen:
            suffixes = [c.suffix for c in sketch_of(entry.values).coordinates]
            new = {old: entry.name + suffix for old, suffix in zip(names[chosen], suffixes, strict=True)}
    if any(name in taken and name not in new for name in new.values()):
        raise NotApplicable(f"the default name of {chosen}'s coordinate is already used")
    rates = {old + suffix: name + suffix for old, name in new.items() for suffix in ("", "_dot", "_ddot")}

    class Renamed(Visitor):
        def coordinate(self, name: str) -> str:
            return rates.get(name, name)

        def scalar(self, value: Any, slot: Slot) -> Any:
            return rewritten(value, lambda name: rates.get(name, name), str)

    made = visit(description, Renamed())
    for entry in made.sections["joints"]:
        entry.values.pop("coordinate", None)
        entry.values.pop("coordinates", None)
        if entry.name != chosen and names[entry.name]:
            entry.values["coordinates"] = list(names[entry.name])
    made.values["independent"] = []
    return Variant(made, lambda values: {rates.get(name, name): value for name, value in values.items()})
