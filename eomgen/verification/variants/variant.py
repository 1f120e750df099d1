"""Stage verification, variants: the same mechanism described differently, and how its states are read.

Every change keeps the meaning of all outputs, so results are compared by outputs alone: the probes on every body.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from typing import Any

import numpy as np

from ...describe.build_cam_points import needs_point
from ...describe.build_joints import coordinate_names
from ...describe.description import DescribedEntry, Description
from ...describe.rewritten_texts import names_of
from ...describe.visit import Slot, Visitor, visit
from ...elements.dimensions import Dimension
from ...joints import JOINTS
from ...records import dataclass

#: Coordinates and velocities by name -> those of the variant by name.
States = Callable[[Mapping[str, float]], dict[str, float]]


class NotApplicable(Exception):
    """The change has no meaning for this model; the text says why."""


def unchanged(values: Mapping[str, float]) -> dict[str, float]:
    """The same coordinates."""
    return dict(values)


@dataclass(frozen=True)
class UnitScales:
    """Units of a variant: how many of its units one SI unit is."""

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    def of(self, dimension: Dimension) -> float:
        """Units of a variant in one SI unit of a dimension."""
        return float(self.length**dimension.length * self.mass**dimension.mass * self.time**dimension.time)

    @property
    def force(self) -> float:
        """Units of force in one newton."""
        return self.mass * self.length / self.time**2


@dataclass(frozen=True)
class Variant:
    """The same mechanism described differently.

    Attributes
    ----------
    description : Description
    state : callable
        Named coordinates and velocities of the original -> those of the variant.
    outputs, parameters, inputs, joints, events : mapping
        Name in the original -> name here, where they differ; joints that are no longer there are mapped to "".
    turn : (3, 3) array
        Takes ground axes of the original to those here.
    scales : UnitScales
        Units here.
    """

    description: Description
    state: States = unchanged
    outputs: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, str] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    joints: Mapping[str, str] = field(default_factory=dict)
    events: Mapping[str, str] = field(default_factory=dict)
    turn: Any = None
    scales: UnitScales = UnitScales()

    def then(self, change: Callable[[Description, Any], Variant], random: Any) -> Variant:
        """This variant, changed once more."""
        next_one = change(self.description, random)
        own, a, b = self.state, self.scales, next_one.scales

        def state(values: Mapping[str, float]) -> dict[str, float]:
            return next_one.state(own(values))

        first, second = (np.eye(3) if t is None else t for t in (self.turn, next_one.turn))
        return Variant(
            next_one.description,
            state,
            outputs=_chained(self.outputs, next_one.outputs),
            parameters=_chained(self.parameters, next_one.parameters),
            inputs=_chained(self.inputs, next_one.inputs),
            joints=_chained(self.joints, next_one.joints),
            events=_chained(self.events, next_one.events),
            turn=second @ first,
            scales=UnitScales(a.length * b.length, a.mass * b.mass, a.time * b.time),
        )


def _chained(first: Mapping[str, str], second: Mapping[str, str]) -> dict[str, str]:
    result = {name: second.get(new, new) for name, new in first.items()}
    taken = set(first.values())
    return result | {name: new for name, new in second.items() if name not in first and name not in taken}


def coordinates_of(description: Description) -> dict[str, tuple[str, ...]]:
    """Names of the coordinates of every joint."""
    return {
        entry.name: tuple(
            map(str, coordinate_names(entry.values["type"], entry.name, entry.values, sketch_of(entry.values))[0])
        )
        for entry in description.sections["joints"]
    }


def kinds_of(description: Description) -> dict[str, str]:
    """Coordinate -> 'angle', 'length' or 'parameter'; those of contact points of cams among them."""
    result: dict[str, str] = {}
    names = coordinates_of(description)
    for entry in description.sections["joints"]:
        joint = sketch_of(entry.values)
        result |= {name: c.kind for name, c in zip(names[entry.name], joint.coordinates, strict=True)}
    for entry in description.sections["constraints"]:
        if needs_point(entry.values):
            result[str(entry.values.get("coordinate") or f"{entry.name}_contact")] = "angle"
    return result


def velocities_of(description: Description) -> dict[str, str]:
    """Velocity -> 'angle' or 'length'."""
    result: dict[str, str] = {}
    names = coordinates_of(description)
    for entry in description.sections["joints"]:
        for v in sketch_of(entry.values).velocities:
            name = entry.name + v.suffix if v.of is None else names[entry.name][v.of] + "_dot"
            result[name] = v.kind
    for name, kind in kinds_of(description).items():
        if name + "_dot" not in result and kind == "angle":
            result[name + "_dot"] = kind
    return result


def sketch_of(values: Mapping[str, Any]) -> Any:
    """The joint of an entry, without its expressions."""
    kind = JOINTS[values["type"]]
    own = {key: values[key] for key in kind.options if key in ("sequence", "rotation") and key in values}
    rest = {key: None for key in kind.options if key not in ("sequence", "rotation")}
    return kind(**own, **rest)


class References(Visitor):
    """Notes which names a description's keys and texts refer to, outputs and initial values aside."""

    def __init__(self, description: Description) -> None:
        self.keys: set[str] = set()
        self.texts: set[str] = set()
        bare = Description()
        for section in ("forces", "constraints", "states", "events", "inputs"):
            bare.sections[section] = description.sections[section]
        visit(bare, self)

    def scalar(self, value: Any, slot: Slot) -> Any:
        self.texts |= names_of(value)
        return value

    def coordinate(self, name: str) -> str:
        self.keys.add(name)
        return name

    def to(self, names: Iterable[str]) -> bool:
        """Whether any of these coordinates, or a rate of one, is referred to."""
        found = self.keys | self.texts
        return any(name + suffix in found for name in names for suffix in ("", "_dot", "_ddot"))


def drop(description: Description, names: Iterable[str]) -> None:
    """Take coordinates that are no longer there out of outputs, initial values and the choice of independent ones."""
    gone = {name + suffix for name in names for suffix in ("", "_dot", "_ddot")}
    outputs = description.sections["outputs"]
    description.sections["outputs"] = [e for e in outputs if not names_of(e.values["expression"]) & gone]
    values = description.values
    for key in ("initial", "guess"):
        values[key] = {name: value for name, value in values.get(key, {}).items() if name not in gone}
    values["independent"] = [name for name in values.get("independent", ()) if name not in gone]


def entry_of(description: Description, section: str, name: str) -> DescribedEntry:
    """The entry of a name."""
    return next(entry for entry in description.sections[section] if entry.name == name)
