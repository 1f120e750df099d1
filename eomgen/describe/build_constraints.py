"""Stage describe, constraints: entries of the constraints section -> constraint elements."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..constraints import Constraint, KnifeEdge, RollingDisc, RollingSphere
from ..frames import Marker
from ..graph.shown import quoted, shown
from .build_cam_points import Contacts
from .build_cams import cam, cam_contact
from .build_couplings import belt, coupling, gear, planetary, rack
from .build_drivers import driver
from .build_joints import Declared
from .checks import check_keys, check_names
from .constraint_element import Element, Surroundings
from .description import Entry
from .fields_constraints import CONSTRAINT, ONE_OF_CONSTRAINT, constraint_fields
from .mechanism import JointSpec
from .names import nearest
from .placement import TURNS
from .reading import Reader


def build_constraints(
    reader: Reader,
    entries: list[Entry],
    declared: Sequence[Declared],
    joints: Sequence[JointSpec],
    contacts: Contacts,
    bodies: int,
) -> tuple[Constraint, ...]:
    """Constraint elements of all entries without faults; the faults are noted.

    ``contacts`` takes in the bodies and joints of contact points, whose indices start at ``bodies``.
    """
    around = Surroundings(reader, declared, joints, contacts, bodies)
    made = [_build(Element(around, entry)) for entry in check_names(entries, "constraint", reader.faults)]
    return tuple(constraint for constraint in made if constraint is not None)


def _build(e: Element) -> Constraint | None:
    faults, path = e.faults, e.path
    if faults.under(path):
        return None
    given = e.values.get("type")
    if not isinstance(given, str) or given not in CONSTRAINT:
        message = "is missing" if given is None else f"no constraint of type {quoted(given)}"
        faults.add(f"{path}.type", message, nearest(shown(given), CONSTRAINT, "types"))
        return None
    e.fields = constraint_fields(given)
    check_keys(path, e.values, e.fields, faults)
    choices = ONE_OF_CONSTRAINT.get(given, ())
    present = [key for key in choices if key in e.values]
    if choices and len(present) != 1:
        message = f"both {' and '.join(present)} are given" if present else f"{' or '.join(choices)} is missing"
        faults.add(path, message, f"give one of {', '.join(choices)}")
    if faults.under(path):
        return None
    result = BUILDERS[given](e)
    return None if faults.under(path) else result


def _rolling(e: Element) -> Constraint | None:
    shape = e.choice("shape")
    wheel, plane = e.marker("wheel"), e.marker("plane")
    radius = e.positive("radius")
    if shape == "sphere":
        e.refuse("tube", "a sphere has no edge")
    else:
        e.refuse("no_spin", "only a sphere turns about the normal without slip along the plane")
    if not _on_two_bodies(e, wheel, plane, "plane") or wheel is None or plane is None:
        return None
    if shape == "sphere":
        return RollingSphere(e.name, wheel, plane, radius, e.flag("no_spin"))
    return RollingDisc(e.name, wheel, plane, radius, e.law("tube"))


def _knife_edge(e: Element) -> Constraint | None:
    marker, on = e.marker("marker"), e.marker("on")
    columns = e.reader.axis(f"{e.path}.axis", e.values["axis"]) if "axis" in e.values else TURNS["y"]
    if not _on_two_bodies(e, marker, on, "on") or marker is None or on is None:
        return None
    x, y, z = (e.reader.graph.constant(value) for value in columns[2])
    return KnifeEdge(e.name, marker, (x, y, z), on)


def _on_two_bodies(e: Element, a: Marker | None, b: Marker | None, key: str) -> bool:
    if a is not None and b is not None and a.body == b.body:
        e.faults.add(f"{e.path}.{key}", f"{a.label} and {b.label} are on the same body", "choose another body")
        return False
    return True


#: How each type of :data:`~eomgen.describe.fields_constraints.CONSTRAINT` is made.
BUILDERS: Mapping[str, Callable[[Element], Any]] = {
    "coupling": coupling,
    "gear": gear,
    "planetary": planetary,
    "rack": rack,
    "belt": belt,
    "cam": cam,
    "cam_contact": cam_contact,
    "rolling": _rolling,
    "knife_edge": _knife_edge,
    "driver": driver,
}
