"""Contacts between groups -> which shapes are near each other, and how velocities move them.

The twist of a body about the origin of the ground is the sum of the same columns for all bodies that a velocity moves,
so that one column for each velocity says the motion of all (R. Featherstone, Rigid Body Dynamics Algorithms, 2008,
section 4.3.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..elements.forces.force import Force
from ..elements.frames import GROUND
from ..expr import vectors as vec
from ..expr.core import Expr, symbols_of
from .kinematics import Kinematics


def near_pairs(kinematics: Kinematics) -> list[Expr]:
    """The list of each contact, one after the other."""
    found = [x for force in kinematics.mechanism.forces for x in force.near(kinematics.motion)]
    return kinematics.resolve(found)


def motion_axes(kinematics: Kinematics) -> list[Expr]:
    """Per velocity the angular velocity that it causes (3), and the velocity (3) of the point at the origin."""
    found = [kinematics.graph.zero] * (6 * len(kinematics.v))
    for k, link in enumerate(kinematics.links):
        place = kinematics.poses.link(k)
        for n, (angular, linear) in enumerate(link.columns, link.first):
            turning = vec.times(place.rotation, angular)
            moving = vec.add(vec.times(place.rotation, linear), vec.cross(place.position, turning))
            found[6 * n : 6 * n + 6] = [*turning, *moving]
    return kinematics.resolve(found)


def describe_contacts(kinematics: Kinematics) -> dict[str, Any]:
    """What is known of contacts beside their numbers.

    ``lists`` has name, numbers and shapes of each contact; ``moved_by`` the last velocity that moves each shape, -1 for
    ground; ``parents`` the velocity before each towards ground; ``bodies`` the body of each shape.  ``rigid_only``
    names contacts without a law of force; ``rigid_by_motion`` those whose friction or restitution as rigid bodies
    depends on velocities or first-order states, and on which.
    """
    forces = [force for force in kinematics.mechanism.forces if force.near(kinematics.motion)]
    if not forces:
        return {}
    last: dict[int, int] = {GROUND: -1}
    links = kinematics.links
    for link in links:
        above = -1 if link.parent == GROUND else last[links[link.parent].body]
        last[link.body] = link.first + len(link.columns) - 1 if link.columns else above
    parents = [-1] * len(kinematics.v)
    for link in links:
        above = -1 if link.parent == GROUND else last[links[link.parent].body]
        for n in range(len(link.columns)):
            parents[link.first + n] = above if n == 0 else link.first + n - 1
    listed = [[force.name, len(force.near(kinematics.motion)), len(force.met_shapes())] for force in forces]
    return {
        "rigid_contacts": {
            "lists": listed,
            "moved_by": [last[body] for force in forces for body in force.met_bodies],
            "parents": parents,
            "bodies": [_name(kinematics, body) for force in forces for body in force.met_bodies],
        },
        **({"rigid_by_motion": moving} if (moving := _by_motion(kinematics, forces)) else {}),
        **({"rigid_only": rigid} if (rigid := [force.name for force in forces if force.is_rigid]) else {}),
    }


def _by_motion(kinematics: Kinematics, forces: Sequence[Force]) -> dict[str, list[str]]:
    """Velocities and states on which what is near depends, by contact."""
    moving = (*kinematics.velocity_names, *kinematics.state_names)
    used = {force.name: symbols_of(kinematics.resolve(list(force.near(kinematics.motion)))) for force in forces}
    return {name: found for name, of in used.items() if (found := [one for one in moving if one in of])}


def _name(kinematics: Kinematics, body: int) -> str:
    return "ground" if body == GROUND else kinematics.mechanism.bodies[body].name
