"""Mass, centre of mass and inertia, in any of the ways to give them -> Body.

Ways that exclude each other are told as faults; what is given adds up: the body's own mass, its solids, its points.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..elements import kinds
from ..graph import vectors as vec
from ..graph.tensors import add_matrices, rotate_symmetric, shift_tensor
from ..graph.vectors import Mat3, Vec3
from ..solids import MassProperties, combine
from .body_parts import read_parts
from .description import DescribedEntry, items
from .fields import BODY
from .mechanism import Body
from .names import nearest
from .physical import ASYMMETRIC, is_symmetric
from .placement import rpy_rotation
from .values import Reader

#: Keys of which a body has one at most.
EXCLUSIVE = (("inertia", "principal"), ("com", "first_moment"))
OWN = ("mass", "com", "first_moment", "inertia", "principal")
POINTS = ("com", "origin")  #: words for the point an inertia is about


def read_body(reader: Reader, entry: DescribedEntry, check: str) -> Body:
    """One body; ``check`` says what becomes of an impossible inertia unless the body says otherwise."""
    path, values = entry.path, {k: v for k, v in entry.values.items() if v is not None}
    graph, faults = reader.graph, reader.faults
    for pair in EXCLUSIVE:
        if all(key in values for key in pair):
            faults.add(f"{path}.{pair[1]}", f"is given beside {pair[0]}", "give one of them", "EG-CONFLICT")
    for key in ("about", "axes"):
        if key in values and not ("inertia" in values or "principal" in values):
            faults.add(f"{path}.{key}", "is given without an inertia", "give inertia or principal too", "EG-MISSING")
    if "check_inertia" in values:
        check = reader.check_word(f"{path}.check_inertia", values["check_inertia"])
    parts = read_parts(reader, path, values)
    own = [key for key in OWN if key in values]
    if "solids" in values and own:
        for key in own:
            remedy = "leave it out, or add points"
            faults.add(f"{path}.{key}", "is given beside solids, which already determine it", remedy, "EG-CONFLICT")
    elif "mass" not in values and (own or not ("solids" in values or "points" in values or faults.under(path))):
        faults.missing(f"{path}.mass", f"give {kinds.Scalar.says}, solids or points")
    if "solids" in values or not own:
        o = vec.zero(graph)
        whole = combine(graph, parts) if parts else MassProperties(graph.zero, o, (o, o, o))
        return Body(entry.name, whole.mass, whole.com, whole.inertia, check=check)
    return _own(reader, entry.name, path, values, parts, check)


def _own(
    reader: Reader, name: str, path: str, values: Mapping[str, Any], points: list[MassProperties], check: str
) -> Body:
    """A body with a mass, a centre of mass and an inertia of its own, and points."""
    graph = reader.graph
    o = vec.zero(graph)
    mass = reader.expression(f"{path}.mass", values["mass"]) if "mass" in values else graph.zero
    tensor, rotation = _tensor(reader, path, values)
    about = values.get("about", "com")
    point = _about(reader, path, about)
    if point is not None and point[1] is not None:
        if "axes" in values:
            message = "is given beside a marker in about, which has axes already"
            reader.faults.add(f"{path}.axes", message, "give about: [x, y, z]", "EG-CONFLICT")
        rotation = point[1]
    plane = _plane(tensor)
    axis = None if plane is None else vec.transpose(rotation)[plane]
    if rotation != reader.identity:  # which mirrors the upper triangle
        if not is_symmetric(tensor):
            reader.faults.add(f"{path}.inertia", *ASYMMETRIC, code="EG-INERTIA")
        tensor = rotate_symmetric(rotation, tensor)
    moment: Vec3 | None = None
    if "first_moment" in values:
        moment = reader.vector(f"{path}.first_moment", values["first_moment"])
        if mass.is_zero and not all(x.is_zero for x in moment):
            reader.faults.add(
                f"{path}.first_moment",
                "a body without mass has no first moment",
                "give the body a mass",
                "EG-NO-INERTIA",
            )
        com = o if mass.is_zero else (moment[0] / mass, moment[1] / mass, moment[2] / mass)
    else:
        com = reader.vector(f"{path}.com", values["com"]) if "com" in values else o
    at_origin: Mat3 | None = tensor if isinstance(about, str) and about == "origin" else None
    about_point = None if point is None else point[0]
    if point is not None:
        negative = shift_tensor(-mass, vec.sub(com, point[0]))
        tensor = add_matrices(tensor, negative)
    for p in points if moment is not None or at_origin is not None else ():
        moment = None if moment is None else vec.add(moment, vec.scale(p.mass, p.com))
        at_origin = None if at_origin is None else add_matrices(at_origin, shift_tensor(p.mass, p.com))
    whole = combine(graph, [MassProperties(mass, com, tensor), *points])
    return Body(
        name, whole.mass, whole.com, whole.inertia, moment, at_origin, check=check, plane=axis, about=about_point
    )


def _tensor(reader: Reader, path: str, values: Mapping[str, Any]) -> tuple[Mat3, Mat3]:
    """The tensor as given, and the turn from its axes to body axes."""
    key = "principal" if "principal" in values and "inertia" not in values else "inertia"
    o = vec.zero(reader.graph)
    tensor: Mat3 = (o, o, o)
    if key in values:
        given = values[key]
        parts = items(given)
        if key == "principal" and (parts is None or any(items(part) is not None for part in parts)):
            reader.wrong(f"{path}.{key}", given, kinds.Vector)
        else:
            tensor = BODY["inertia"].read(reader, f"{path}.{key}", given)
    if "axes" not in values:
        return tensor, reader.identity
    return tensor, rpy_rotation(reader.graph, reader.vector(f"{path}.axes", values["axes"]))


def _about(reader: Reader, path: str, about: Any) -> tuple[Vec3, Mat3 | None] | None:
    """The point an inertia is about, None for the centre of mass; and its axes where it is a marker."""
    place, body = f"{path}.about", path.partition(".")[2]
    if isinstance(about, str):
        if about == "com":
            return None
        if about == "origin":
            return vec.zero(reader.graph), None
        label = about if about.startswith(f"{body}.") else f"{body}.{about}"
        marker = reader.markers.get(label)
        if marker is None:
            own = [key.partition(".")[2] for key in reader.markers if key.startswith(f"{body}.")]
            remedy = nearest(about, [*POINTS, *own], "allowed")
            reader.faults.add(place, f"{body!r} has no marker {about!r}", remedy, "EG-NAME-UNKNOWN")
            return None
        return marker.frame.position, marker.frame.rotation
    if items(about) is None:
        reader.wrong(place, about, kinds.About)
        return None
    return reader.vector(place, about), None


def _plane(tensor: Mat3) -> int | None:
    """The axis of the one moment that was given, None where there are others, or products."""
    given = [i for i in range(3) if not tensor[i][i].is_zero]
    products = any(not tensor[i][j].is_zero for i in range(3) for j in range(3) if i != j)
    return given[0] if len(given) == 1 and not products else None
