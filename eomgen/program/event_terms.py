"""Stage program, events: Kinematics -> the new values of states at resets, and what runs have to know of events."""

from __future__ import annotations

from typing import Any

from ..errors import UsageError
from ..graph.core import Expr
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
                    f"reset {', '.join(places)}"
                )
            found.append((i, places[name], value))
    return found
