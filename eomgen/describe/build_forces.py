"""Stage describe, forces: entries of the forces section -> force elements (geometry times law)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..forces import Actuator, BodyTorque, Damper, Force, Path, PointForce, Spring
from .build_contacts import build_friction, build_point_plane, build_sphere_plane, build_sphere_sphere, build_stop
from .build_joints import Declared
from .build_laws import build_bushing, build_element, build_muscle, build_point_gravity, build_torsional_element
from .checks import check_names
from .description import Entry
from .force_entry import Context, ForceEntry
from .mechanism import Body, Parameter
from .reading import Reader


def build_forces(
    reader: Reader,
    entries: list[Entry],
    joints: Sequence[Declared],
    bodies: Sequence[Body],
    parameters: Sequence[Parameter],
) -> tuple[Force, ...]:
    """Force elements of all entries without faults; the faults are noted."""
    usable = check_names(entries, "force", reader.faults)
    context = Context(bodies, {p.name: p.value for p in parameters if p.value is not None})
    made = [_build(ForceEntry(reader, entry, joints, context)) for entry in usable]
    return tuple(force for force in made if force is not None)


def _build(e: ForceEntry) -> Force | None:
    given = e.known_type()
    if given is None:
        return None
    result = BUILDERS[given](e)
    return None if e.reader.faults.under(e.entry.path) else result


def _point_force(e: ForceEntry) -> Force | None:
    value, axes = e.vector("value"), e.choice("axes")
    marker = e.reader.marker(f"{e.entry.path}.marker", e.values["marker"]) if "marker" in e.values else None
    return None if marker is None else PointForce(e.name, marker, value, axes)


def _torque(e: ForceEntry) -> Force | None:
    if "joint" in e.values:
        if "axes" in e.values:
            e.reader.faults.add(f"{e.entry.path}.axes", "a torque on a joint has no axes", "leave it out")
        path, value = e.coordinate(), e.law("value")
        return None if path is None else Actuator(e.name, path, value)
    marker = e.reader.marker(f"{e.entry.path}.body", e.values["body"])
    vector, axes = e.vector("value"), e.choice("axes")
    return None if marker is None else BodyTorque(e.name, marker, vector, axes)


def _spring(path: Callable[[ForceEntry], Path | None], rest: str) -> Callable[[ForceEntry], Force | None]:
    def build(e: ForceEntry) -> Force | None:
        where, stiffness, length = path(e), e.law("stiffness"), e.law(rest)
        return None if where is None else Spring(e.name, where, stiffness, length)

    return build


def _damper(path: Callable[[ForceEntry], Path | None], key: str) -> Callable[[ForceEntry], Force | None]:
    def build(e: ForceEntry) -> Force | None:
        where, damping = path(e), e.law(key)
        return None if where is None else Damper(e.name, where, damping)

    return build


def _actuator(e: ForceEntry) -> Force | None:
    where, value = e.joint_or_line(), e.law("value")
    return None if where is None else Actuator(e.name, where, value)


#: How each type of :data:`~eomgen.describe.fields.FORCE` is made.
BUILDERS: dict[str, Callable[[ForceEntry], Force | None]] = {
    "force": _point_force,
    "torque": _torque,
    "spring": _spring(ForceEntry.line, "length"),
    "damper": _damper(ForceEntry.line, "damping"),
    "torsional_spring": _spring(ForceEntry.rotation, "angle"),
    "torsional_damper": _damper(ForceEntry.rotation, "damping"),
    "friction": build_friction,
    "actuator": _actuator,
    "element": build_element,
    "torsional_element": build_torsional_element,
    "bushing": build_bushing,
    "point_gravity": build_point_gravity,
    "stop": build_stop,
    "point_plane": build_point_plane,
    "sphere_plane": build_sphere_plane,
    "sphere_sphere": build_sphere_sphere,
    "muscle": build_muscle,
}
