"""Stage program, events: Kinematics -> the new values of states at resets, and what runs have to know of events."""

from __future__ import annotations

from typing import Any

from ..errors import UsageError
from ..frames import GROUND
from ..graph.core import Expr
from ..joints.many_degrees import Cylindrical, Planar, Translational
from ..joints.one_degree import Prismatic
from ..joints.turning import Free
from ..kinematics import Kinematics


def describe_events(kinematics: Kinematics) -> dict[str, Any]:
    """Events, the states that they reset and the clocks of sampled states, as model.json holds them."""
    m = kinematics.mechanism
    if not m.events:
        return {}
    events = [
        {
            "name": e.name,
            "terminal": e.terminal,
            "direction": e.direction,
            "resets": bool(e.reset),
            "restitution": e.restitution,
            "doc": e.doc,
            **({} if e.friction is None else {"friction": e.friction, "slip": list(e.slip)}),
        }
        for e in m.events
    ]
    found = {"events": events, "resets": [[i, k] for i, k, _ in resets(kinematics)]}
    return found | ({"clocks": _clocks(kinematics)} if m.clocks else {})


def _clocks(kinematics: Kinematics) -> list[dict[str, Any]]:
    """Of each clock its event, the place of its counter in x, and the states that it renews."""
    events = [event.name for event in kinematics.mechanism.events]
    states = (*kinematics.names, *kinematics.velocity_names, *kinematics.state_names)
    lawless = {s.name for s in kinematics.mechanism.states if s.sampled == kinematics.graph.symbol(s.name)}
    return [
        {
            "event": events.index(c.event),
            "counter": states.index(c.counter),
            "states": list(c.states),
            "open": [name for name in c.states if name in lawless],
        }
        for c in kinematics.mechanism.clocks
    ]


def find_translations(kinematics: Kinematics) -> list[list[Any]]:
    """Joints of the tree that move bodies without turning them.

    Of each its name, the place here of the next of them towards the ground, or -1, the body, and the velocities.
    """
    found: list[list[Any]] = []
    outer = {GROUND: -1}  #: by body, the outermost of them so far
    labels = zip(kinematics.velocity_labels, kinematics.velocity_kinds, strict=True)
    lengths = {name: i for i, (name, kind) in enumerate(labels) if kind == "length"}
    for branch in kinematics.topology.branches:
        spec = kinematics.mechanism.joints[branch.joint]
        slides = isinstance(spec.joint, (Prismatic, Cylindrical, Planar, Translational, Free))
        outer[branch.body] = outer[branch.parent]
        if slides:
            places = [lengths[name] for name in spec.coordinates if name in lengths]
            outer[branch.body] = len(found)
            found.append([spec.name, outer[branch.parent], branch.body, places])
    return found


def resets(kinematics: Kinematics) -> list[tuple[int, int, Expr]]:
    """Event, state and its new value, of all resets."""
    names = (*kinematics.names, *kinematics.velocity_names, *kinematics.state_names)
    places = {name: k for k, name in enumerate(names)}
    found: list[tuple[int, int, Expr]] = []
    for i, event in enumerate(kinematics.mechanism.events):
        for name, value in (dict(event.reset) | dict(kinematics.velocities_after.get(event.name, ()))).items():
            if name not in places:
                raise UsageError(
                    f"events.{event.name}.reset: {name!r} belongs to a joint that is cut and follows from the others; "
                    f"reset {', '.join(places)}",
                    code="EG-EVENT",
                )
            found.append((i, places[name], value))
    return found
