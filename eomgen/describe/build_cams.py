"""Contact points on contours, and profiles that close after a turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

from ..base.value_rules import TURN
from ..constraints import Constraint
from ..constraints.cams import Profile
from ..errors import ModelError
from ..frames import Frame, Marker
from ..graph import vectors as vec
from ..graph.core import symbols_of
from ..joints import JOINTS
from .description import DescribedEntry
from .mechanism import Body, JointSpec
from .printed_names import take_latex
from .requirements import Requirements
from .sympy_face import name_of
from .values import Reader


@dataclass
class Contacts:
    """Contact points: the coordinate of each by the path of its entry, and the bodies and joints made for them."""

    coordinates: dict[str, str] = field(default_factory=dict)
    bodies: list[Body] = field(default_factory=list)
    joints: list[JointSpec] = field(default_factory=list)

    def place(self, reader: Reader, entry: DescribedEntry, cam: Marker, index: int) -> Marker | None:
        """A marker at a cam's axis on a new body ``index`` without mass, whose x axis points to the contact point."""
        graph, name = reader.graph, f"{entry.name}_contact"
        if name in reader.bodies:
            message = f"the contact point needs a body named {name!r}, and there is one already"
            reader.faults.add(entry.path, message, "rename one of them", "EG-NAME-TAKEN")
            return None
        o = vec.zero(graph)
        point = Marker(index, Frame(reader.identity, o), name)
        coordinate = self.coordinates[entry.path]
        self.bodies.append(Body(name, graph.zero, o, (o, o, o)))
        self.joints.append(JointSpec(name, JOINTS["revolute"](), cam, point, (coordinate,), False))
        return point


def needs_point(values: dict[str, Any]) -> bool:
    """Whether a cam's contact is found by an angle of its own."""
    return (
        values.get("type") == "cam_contact" and "contour" in values and values.get("shape") in ("roller", "flat_face")
    )


def declare_contacts(reader: Reader, entries: list[DescribedEntry]) -> Contacts:
    """Take the polar angles of all contact points into the namespace."""
    contacts = Contacts()
    for entry in entries:
        if needs_point(entry.values) and isinstance(entry.name, str):
            given = entry.values.get("coordinate")
            name = f"{entry.name}_contact" if given is None else name_of(given)
            path = entry.path if given is None else f"{entry.path}.coordinate"
            reader.names.declare("coordinate", name, path)
            contacts.coordinates[entry.path] = str(name)
            take_latex(reader, f"{entry.path}.latex", name, entry.values.get("latex", ""))
    return contacts


def check_turns(constraints: Sequence[Constraint], requirements: Requirements) -> None:
    """Note periodic profiles that jump where a turn ends, as far as the values of parameters tell."""
    for constraint in constraints:
        for own in fields(constraint):
            profile = getattr(constraint, own.name)
            turn = profile.over_a_turn() if isinstance(profile, Profile) else None
            if turn is None:
                continue
            laws, angle = turn
            where = " at the declared values" if symbols_of(laws) - {angle} else ""
            try:
                requirements.judge(f"constraints.{constraint.name}.{own.name}", TURN, laws, (), [angle], where)
            except ModelError:  # native code without a twin in Python
                continue
