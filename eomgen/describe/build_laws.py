"""Stage describe, elements of their own law: entries of the forces section -> elements, bushings, gravity, muscles."""

from __future__ import annotations

from typing import Any, cast

from ..forces import Bushing, Element, Force, JointCoordinate, Muscle, Path, PointGravity, TorsionalElement, Turn
from ..forces.bushing import Mat6
from ..frames import Frame, Marker
from ..graph.core import Expr
from ..graph.shown import quoted, shown
from .description import items
from .force_entry import ForceEntry
from .names import nearest


def build_element(e: ForceEntry) -> Force | None:
    """Any law along a joint's coordinate, a line or a path."""
    return _element(e, e.joint_or_line(), Element)


def build_torsional_element(e: ForceEntry) -> Force | None:
    """Any law of an angle."""
    return _element(e, e.rotation(), TorsionalElement)


def _element(e: ForceEntry, path: Path | None, kind: type[Element]) -> Force | None:
    """Its law knows ``length`` or ``angle``, and ``rate``."""
    if "law" not in e.values and "potential" not in e.values:
        e.reader.faults.add(e.entry.path, "has no law", "give law, potential or both")
    word = "angle" if isinstance(path, Turn) or _is_angle(e, path) else "length"
    value, rate = (e.reader.graph.symbol(f"{name}[{e.name}]") for name in (word, "rate"))
    law = e.law("law", {word: value, "rate": rate})
    energy = e.law("potential", {word: value})
    return None if path is None else kind(e.name, path, value, rate, law, energy)


def _is_angle(e: ForceEntry, path: Path | None) -> bool:
    if not isinstance(path, JointCoordinate):
        return False
    home = next(j for j in e.joints if path.name in j.coordinates)
    return home.joint.coordinates[home.coordinates.index(path.name)].kind == "angle"


def build_bushing(e: ForceEntry) -> Force | None:
    """Full stiffness and damping between two markers."""
    pair, stiffness, damping = e.pair(), _matrix6(e, "stiffness"), _matrix6(e, "damping")
    if stiffness is not None:
        for i in range(6):
            for j in range(i):
                difference = stiffness[i][j] - stiffness[j][i]
                if not difference.is_zero and difference.value is not None:
                    e.fault(f"stiffness[{i}][{j}]", "the matrix is not symmetric", "[i][j] and [j][i] must be equal")
                elif not difference.is_zero:
                    e.judge(f"stiffness[{i}][{j}]", difference, lambda x: x == 0, "less [j][i]; they must be equal")
    if pair is None or stiffness is None or damping is None:
        return None
    return Bushing(e.name, *pair, stiffness, damping)


def _matrix6(e: ForceEntry, key: str) -> Mat6 | None:
    """A 6 x 6 matrix, or its diagonal."""
    path, field, zero = f"{e.entry.path}.{key}", e.fields[key], e.reader.graph.zero
    value: Any = e.values.get(key, field.default)
    if value is None:
        return None
    listed = items(value)
    rows = [items(part) for part in listed] if listed is not None and len(listed) == 6 else []
    if rows and all(row is None for row in rows):
        diagonal = [e.reader.expression(f"{path}[{k}]", x, field.level) for k, x in enumerate(listed or ())]
        return cast(Mat6, tuple(tuple(x if i == j else zero for j in range(6)) for i, x in enumerate(diagonal)))
    if rows and all(row is not None and len(row) == 6 for row in rows):
        return cast(
            Mat6,
            tuple(
                tuple(e.reader.expression(f"{path}[{i}][{j}]", x, field.level) for j, x in enumerate(row or ()))
                for i, row in enumerate(rows)
            ),
        )
    e.reader.wrong(path, value, "matrix6")
    return None


def build_point_gravity(e: ForceEntry) -> Force | None:
    """Gravity of a point on a body."""
    reader = e.reader
    center = reader.marker(f"{e.entry.path}.center", e.values["center"]) if "center" in e.values else None
    mu, extent, given = e.positive("mu"), e.choice("extent"), e.values.get("body")
    own = {body.name: k for k, body in enumerate(e.context.bodies)}
    if given is None:
        return None
    if not isinstance(given, str) or given not in own:
        if not reader.faults.under(f"bodies.{given}"):
            e.fault("body", f"no body {quoted(given)}", nearest(shown(given), own, "bodies"))
        return None
    index = own[given]
    body = e.context.bodies[index]
    if center is not None and center.body == index:
        e.fault("center", f"lies on {given!r} itself", "give a marker of ground or of another body")
    marker = Marker(index, Frame(reader.identity, body.com), f"{given} at its centre of mass")
    inertia = body.inertia if extent == "maccullagh" else None
    return None if center is None else PointGravity(e.name, center, marker, mu, body.mass, inertia)


def build_muscle(e: ForceEntry) -> Force | None:
    """A Hill-type muscle along a path."""
    path, activation = e.line(), e.law("activation")
    e.judge("activation", activation, lambda a: 0 <= a <= 1, "an activation is 0 to 1")
    positive: dict[str, Expr] = {k: e.positive(k) for k in ("force_max", "fiber_length", "slack_length")}
    if "velocity_max" in e.values:
        positive["velocity_max"] = e.positive("velocity_max")
    else:  # De Groote and others (2016): ten optimal lengths of the fibres a second
        positive["velocity_max"] = 10.0 * positive["fiber_length"]
    pennation, damping = e.law("pennation"), e.law("damping")
    e.judge("pennation", pennation, lambda x: abs(x) < 1.5707, "must be less than pi/2")
    if path is None:
        return None
    return Muscle(e.name, path, activation, pennation=pennation, damping=damping, **positive)
