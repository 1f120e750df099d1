"""Stage verification, names and order: everything renamed, and the order of all entries changed."""

from __future__ import annotations

from typing import Any

from ...describe.build_clocks import COUNTER, EVENT
from ...describe.build_switches import CLOSED, CLOSES, OPENS, is_switched
from ...describe.description import GROUND_NAME, Description
from ...describe.element_states import states_of
from ...describe.marker_quantities import MarkerQuantity
from ...describe.names import COM
from ...describe.rewritten_texts import rewritten
from ...describe.visit import Slot, Visitor, visit
from .body_frames import WAS
from .variant import Variant, coordinates_of, kinds_of, velocities_of

#: Sections whose entries nobody needs to know the order of.
_ORDER = ("parameters", "inputs", "functions", "bodies", "joints", "forces", "constraints", "events")


def reorder(description: Description, random: Any) -> Variant:
    """The entries of every section in another order; each coordinate keeps whether the user named it."""
    made = visit(description, Visitor())
    for section in _ORDER:
        entries = made.sections[section]
        made.sections[section] = [entries[k] for k in random.permutation(len(entries))]
    return Variant(made)


def rename(description: Description, random: Any) -> Variant:
    """Every name exchanged for another, of another place in the alphabet."""
    if description.values.get("equations") is not None and "intermediates" in description.values["equations"]:
        local = set(description.values["equations"]["intermediates"])
    else:
        local = set()
    visitor = _Renamed(description, random, local)
    made = visit(description, visitor)
    bodies, words = visitor.bodies, visitor.words
    for place, entries in made.sections.items():
        for entry in entries:
            entry.name = bodies[entry.name] if place == "bodies" else words.get(entry.name, entry.name)
            entry.path = f"{place}.{entry.name}"
    for entry in made.sections["bodies"]:
        markers = entry.values.get("markers", {})
        entry.values["markers"] = {visitor.markers.get(name, name): placed for name, placed in markers.items()}
        about = entry.values.get("about")
        if isinstance(about, str) and about not in ("com", "origin"):
            entry.values["about"] = visitor.markers.get(about.rpartition(".")[2], about)

    def section(name: str) -> dict[str, str]:
        return {e.name: words[e.name] for e in description.sections[name]}

    return Variant(
        made,
        lambda values: {visitor.word(name): value for name, value in values.items()},
        outputs=section("outputs"),
        parameters=section("parameters"),
        inputs=section("inputs"),
        joints=section("joints"),
        events=section("events"),
    )


class _Renamed(Visitor):
    def __init__(self, description: Description, random: Any, local: set[str]) -> None:
        self.local = local
        joints = coordinates_of(description)
        own: list[str] = [name for names in joints.values() for name in names]
        own += [name for name in kinds_of(description) if name not in own]
        lagrangian = description.values.get("lagrangian") or description.values.get("equations") or {}
        own += [name for name in lagrangian.get("coordinates", ()) if name not in own]
        own += [name for name in lagrangian.get("velocities", ()) if not name.endswith("_dot")]
        sections = [e.name for s, entries in description.sections.items() if s != "bodies" for e in entries]
        words = list(dict.fromkeys([*own, *sections]))
        numbers = random.permutation(len(words))
        self.words = {word: f"n{number}_{'zyxwv'[number % 5]}" for word, number in zip(words, numbers, strict=True)}
        for entry in description.sections["joints"]:  # default names follow the joint's
            if "coordinate" not in entry.values and "coordinates" not in entry.values:
                for name in joints[entry.name]:
                    self.words[name] = self.words[entry.name] + name[len(entry.name) :]
        for entry in description.sections["constraints"]:
            if entry.values["type"] == "cam_contact" and "coordinate" not in entry.values:
                self.words[f"{entry.name}_contact"] = self.words[entry.name] + "_contact"
            for ending in (CLOSED, CLOSES, OPENS) if is_switched(entry) else ():
                self.words[entry.name + ending] = self.words[entry.name] + ending
        for entry in description.sections["forces"]:
            for name in states_of(entry):
                self.words[name] = self.words[entry.name] + name[len(entry.name) :]
        for entry in description.sections["states"]:
            for ending in (COUNTER, EVENT) if "period" in entry.values else ():
                self.words[entry.name + ending] = self.words[entry.name] + ending
        for name in velocities_of(description):
            if not name.endswith("_dot"):  # <joint>_wx
                joint, _, suffix = name.rpartition("_")
                self.words[name] = f"{self.words[joint]}_{suffix}"
        bodies = [e.name for e in description.sections["bodies"] if e.name != GROUND_NAME]
        self.bodies = {name: f"b{k}" for name, k in zip(bodies, random.permutation(len(bodies)), strict=True)}
        self.bodies[GROUND_NAME] = GROUND_NAME
        places = {m for e in description.sections["bodies"] for m in e.values.get("markers", {})}
        self.markers = {name: f"k{k}" for k, name in enumerate(sorted(places)) if name != WAS}

    def word(self, name: str) -> str:
        """A name, or the rate of one."""
        if name in self.words:
            return self.words[name]
        for suffix in ("_ddot", "_dot"):
            if name.endswith(suffix) and name.removesuffix(suffix) in self.words:
                return self.words[name.removesuffix(suffix)] + suffix
        return name

    def coordinate(self, name: str) -> str:
        return self.word(name)

    def body(self, name: str) -> str:
        return self.bodies[name]

    def marker(self, reference: Any, slot: Slot) -> Any:
        if not isinstance(reference, str):
            return super().marker(reference, slot)
        body, dot, name = reference.partition(".")
        return self.bodies[body] + dot + self.markers.get(name, name)

    def scalar(self, value: Any, slot: Slot) -> Any:
        hidden = {*(slot.field.local if slot.field else ()), *self.local}

        def name(word: str) -> str:
            return word if word in hidden else self.word(word)

        def locate(quantity: MarkerQuantity) -> str:
            return str(quantity.renamed(place))

        def place(marker: str) -> str:
            return marker if marker == COM and COM not in self.bodies else str(self.marker(marker, slot))

        def element(word: str) -> str:
            owner, dot, row = word.partition(".")
            return self.word(owner) + dot + row

        return rewritten(value, name, locate, lambda quantity: str(quantity.renamed(element, place)))
