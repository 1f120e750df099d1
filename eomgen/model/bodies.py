"""Bodies: mass, centre of mass and inertia, given in any of the ways there are, of solids, meshes and points -> Body.

Ways that exclude each other are reported as faults; what is given adds up: the body's own mass, its solids, its points.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.files import beside
from ..base.limits.numbers import COMPUTED, TENSOR, TENSOR_TERMS
from ..base.value_rules import BODIES, EXCESS, NOT_NEGATIVE, SWITCH, inertia_scales, judge_bodies, longest_within
from ..elements import kinds
from ..elements.frames import GROUND, TURNS, Frame, rpy_rotation, turn_matrix
from ..elements.kinds import DISPLAY, MARKER, POINT, Vector
from ..elements.solids import SOLIDS, MassProperties, combine, measure_mesh, point
from ..errors import UsageError
from ..expr import vectors as vec
from ..expr.core import Expr, symbols_of
from ..expr.identity import DRAWS, TRIES, is_rounding, random_point, with_bounds
from ..expr.tensors import add_matrices, rotate_symmetric, shift_tensor
from ..expr.vectors import Mat3, Vec3
from .checks import check_keys
from .description import DescribedEntry, items, place_of
from .fields import BODY, SOLID, SOLID_KEYS, solid_fields
from .mechanism import Body, BodyShape, JointSpec
from .names import nearest
from .requirements import Requirements
from .values import Reader


def check_bodies(
    bodies: Sequence[Body], joints: Sequence[JointSpec], requirements: Requirements
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Note masses and inertias that no body can have, as far as the values of parameters tell.

    Returns the names of bodies with a negative mass or moment that are taken as they are, and notes on them.
    """
    notes: list[str] = []
    negative: dict[str, None] = {}
    faults = requirements.faults
    masses = [requirements.known([body.mass]) for body in bodies]
    tensors = [requirements.known(_entries(body)) for body in bodies]
    numbers = [_numbers_of(body, points) for body, points in zip(bodies, _points(bodies, joints), strict=True)]
    values = [x for groups in numbers for group in groups for x in _known(requirements, group)]
    flaws = judge_bodies(values, [_described(*one, True) for one in zip(bodies, numbers, strict=True)])
    scales = inertia_scales(
        [0.0 if mass is None else mass[0] for mass in masses],
        [np.zeros((3, 3)) if tensor is None else tensor.reshape(3, 3) for tensor in tensors],
        longest_within(_known_points(requirements, points) for points in _points(bodies, joints)),
    )
    for body, mass, tensor, scale in zip(bodies, masses, tensors, scales, strict=True):
        path = f"bodies.{body.name}"
        result: list[tuple[str, str, str]] = []
        remedy = f"give a mass of 0 or more, {SWITCH}"
        if mass is not None and mass[0] < 0:
            how = "" if body.mass.value is not None else " at the declared values"
            result.append((f"{path}.mass", f"is {mass[0]:g}{how}", remedy))
        elif body.check == "error":
            requirements.inside(f"{path}.mass", body.mass, NOT_NEGATIVE, remedy)
        if not faults.under(f"{path}.inertia"):
            if not is_symmetric(body.inertia, None if tensor is None else tensor.tolist(), COMPUTED * scale):
                result.append((f"{path}.inertia", *ASYMMETRIC))
            else:
                result += [(path + ".inertia", *flaw[1:]) for flaw in flaws if flaw.key == f".{body.name}.inertia"]
        for place, message, advice in result:
            if body.check == "error":
                faults.add(place, message, advice, "EG-INERTIA")
            else:
                if advice not in (EXCESS, ASYMMETRIC[1]):
                    negative[body.name] = None
                if body.check == "note":
                    notes.append(f"{place}: {message}; it is used as given")
    if any(symbols_of(_entries(body)) for body in bodies if body.check == "error"):
        alike: dict[Any, tuple[Body, list[Sequence[Expr]]]] = {}  # of bodies that are alike the first stands for all
        for body, groups in zip(bodies, numbers, strict=True):
            alike.setdefault((body.check, *(tuple(x.id for x in group) for group in groups)), (body, groups))
        data = [_described(body, groups, body.check == "error") for body, groups in alike.values()]
        requirements.keep("bodies", BODIES, [x for _, groups in alike.values() for g in groups for x in g], (data,))
    return tuple(negative), tuple(notes)


def _numbers_of(body: Body, points: Sequence[Vec3]) -> list[Sequence[Expr]]:
    """Mass, tensor, axis of the one moment that was given, and points: what judges bodies, in this order."""
    return [[body.mass], _entries(body), () if body.plane is None else body.plane, *points]


def _described(body: Body, numbers: Sequence[Sequence[Expr]], judged: bool) -> tuple[str, bool, int, bool]:
    """What :func:`~..base.value_rules.judge_bodies` takes beside the numbers."""
    return body.name, body.plane is not None, len(numbers) - 3, judged


def _known(requirements: Requirements, group: Sequence[Expr]) -> list[float]:
    result = requirements.known(group)
    return [math.nan] * len(group) if result is None else result.tolist()


def _entries(body: Body) -> list[Expr]:
    return [entry for row in body.inertia for entry in row]


def _points(bodies: Sequence[Body], joints: Sequence[JointSpec]) -> list[list[Vec3]]:
    """Centre of mass, joints and the point of the inertia of each body; the centre of no mass does not count."""
    points: list[list[Vec3]] = [[] if body.mass.is_zero else [body.com] for body in bodies]
    for masses, body in zip(points, bodies, strict=True):
        masses += [] if body.about is None else [body.about]
    for spec in joints:
        for marker in (spec.predecessor, spec.successor):
            if marker.body != GROUND:
                points[marker.body].append(marker.frame.position)
    return points


def _known_points(requirements: Requirements, points: Sequence[Vec3]) -> list[Array]:
    result = [requirements.known(point) for point in points]
    return [point for point in result if point is not None]


ASYMMETRIC = ("the tensor is not symmetric", "entries [i][j] and [j][i] must be equal")


def is_symmetric(inertia: Mat3, tensor: Sequence[float] | None = None, computed: float = 0.0) -> bool:
    """Whether a tensor equals its mirror image: at its values if they are known, else wherever one looks.

    ``computed`` is what rounding may leave of its entries (kg m^2).
    """
    pairs = [(3 * i + j, 3 * j + i) for i, j in ((0, 1), (0, 2), (1, 2)) if inertia[i][j] != inertia[j][i]]
    if not pairs:
        return True
    if tensor is not None:
        full = np.reshape(tensor, (3, 3))
        atol = max(TENSOR_TERMS * float(np.max(np.abs(full), initial=0.0)), computed)
        return bool(np.allclose(full, full.T, rtol=TENSOR, atol=atol))
    entries, random = [x for row in inertia for x in row], np.random.default_rng(11)
    points = [random_point(entries, random, signs=draw < TRIES) for draw in range(DRAWS)]
    drawn = {name: np.array([point[name] for point in points]) for name in points[0]}
    values, bounds = (np.reshape(x, (len(entries), -1)) for x in with_bounds(entries, drawn))
    size = np.where(np.isfinite(values), np.abs(values), 0.0).sum(axis=0)
    upper, lower = np.transpose(pairs)
    apart = values[upper] - values[lower]
    known = np.isfinite(apart)
    alike = (np.abs(apart) <= TENSOR * size) | is_rounding(apart, bounds[upper] + bounds[lower])
    return bool((known.any(axis=1) & (alike | ~known).all(axis=1)).all())


def read_parts(reader: Reader, name: str, path: str, values: Mapping[str, Any]) -> list[MassProperties]:
    """Mass properties of the solids and points of a body; those with faults are left out."""
    parts: list[MassProperties] = []
    for key in ("solids", "points"):
        if key not in values:
            continue
        listed = items(values[key])
        if listed is None:
            reader.wrong(f"{path}.{key}", values[key], BODY[key])
            continue
        for k, raw in enumerate(listed):
            place = f"{path}.{key}[{k}]"
            if not isinstance(raw, Mapping):
                reader.wrong(place, raw, kinds.Table)
                continue
            part = _solid(reader, name, place, raw) if key == "solids" else _point(reader, place, raw)
            if part is not None:
                parts.append(part)
    return parts


def _point(reader: Reader, path: str, values: Mapping[str, Any]) -> MassProperties | None:
    check_keys(path, values, POINT, reader.faults)
    if "mass" not in values:
        return None
    at = reader.vector(f"{path}.at", values["at"]) if "at" in values else vec.zero(reader.graph)
    return point(reader.graph, reader.expression(f"{path}.mass", values["mass"]), at)


def _solid(reader: Reader, name: str, path: str, values: Mapping[str, Any]) -> MassProperties | None:
    faults, kind = reader.faults, reader.type_of(path, values, SOLID, "solid")
    if not kind:
        return None
    fields = solid_fields(kind)
    check_keys(path, values, fields, faults, f"a {kind}", SOLID_KEYS)
    density = "line_density" if "line_density" in fields else "density"
    if ("mass" in values) == (density in values):
        wrong = f"both mass and {density} are given" if "mass" in values else f"neither mass nor {density} is given"
        faults.add(path, wrong, "give one of them", "EG-CONFLICT")
    raw = {key: reader.expression(f"{path}.{key}", values[key]) for key in ("mass", density, "scale") if key in values}
    frame = _frame(reader, path, values)
    subtract = reader.flag(f"{path}.subtract", values["subtract"]) if "subtract" in values else False
    read = _mesh(reader, path, values, raw.get("scale")) if kind == "mesh" else _shape(reader, path, kind, values)
    if read is None or faults.under(path):
        return None
    solid, sizes = read
    if not subtract:
        shape = BodyShape(reader.bodies[name], kind, sizes, frame, str(values.get("file", "")))
        reader.drawn["solids", name].append(shape)
    mass = raw["mass"] if "mass" in raw else raw[density] * solid.mass
    if subtract:
        mass = -mass
    tensor = rotate_symmetric(frame.rotation, solid.inertia)
    x, y, z = (vec.scale(mass, row) for row in tensor)
    com = vec.add(frame.position, vec.times(frame.rotation, solid.com))
    return MassProperties(mass, com, (x, y, z))


def _frame(reader: Reader, path: str, values: Mapping[str, Any]) -> Frame:
    """Where a solid is in its body, its z axis laid along ``axis``."""
    frame = reader.frame(path, values)
    columns = reader.axis(f"{path}.axis", values["axis"]) if "axis" in values else TURNS["z"]
    return frame if columns == TURNS["z"] else frame.turned(turn_matrix(reader.graph, columns))


def _shape(
    reader: Reader, path: str, kind: str, values: Mapping[str, Any]
) -> tuple[MassProperties, tuple[Expr, ...]] | None:
    """What a solid has at density 1, its inertia for each kg, in its own axes; and its sizes."""
    solid, graph = SOLIDS[kind], reader.graph
    lengths: dict[str, Any] = {}
    for key, dimension in solid.dimensions.items():
        if key not in values:
            return None
        place = f"{path}.{key}"
        lengths[key] = value = dimension.read(reader, place, values[key])
        for x in dict.fromkeys(value if isinstance(dimension, Vector) else [value]):
            advice = f"{values[key]!r} is negative".replace("{", "{{").replace("}", "}}")
            reader.requirements.inside(place, x, NOT_NEGATIVE, "a length must be 0 or positive", advice)
    if "inner_radius" in lengths:
        inner, outer = lengths["inner_radius"], lengths["outer_radius"]
        message, remedy = "{:g} exceeds the outer radius {:g}", "give a smaller inner radius"
        reader.requirements.in_order(f"{path}.inner_radius", inner, outer, message, remedy)
    made, o = solid(**lengths), graph.zero
    a, b, c = map(graph.lift, made.gyration())
    sizes = _in_a_row(x for key, x in lengths.items() if key != "inner_radius")
    unit = MassProperties(made.content(), (o, o, graph.lift(made.centre())), ((a, o, o), (o, b, o), (o, o, c)))
    return unit, sizes


def _in_a_row(values: Iterable[Any]) -> tuple[Expr, ...]:
    """Sizes that are numbers, or three of them, one after the other."""
    return tuple(x for value in values for x in (value if isinstance(value, tuple) else (value,)))


def _mesh(
    reader: Reader, path: str, values: Mapping[str, Any], scale: Expr | None
) -> tuple[MassProperties, tuple[Expr, ...]] | None:
    """The same of the solid that a mesh bounds."""
    if values.get("file") is None:
        return None
    place = f"{path}.file"
    file = reader.file(place, values["file"])
    if file is None:
        return None
    graph = reader.graph
    if scale is not None:
        size, need = f"{path}.scale", reader.requirements
        remedy = "give a scale greater than 0; mirror the file itself"
        mirrored, nothing = "{:g} is negative, which would mirror the mesh", "0 leaves nothing of the mesh"
        if need.inside(size, scale, NOT_NEGATIVE, remedy, mirrored) or need.not_zero(size, scale, remedy, nothing):
            return None
    try:
        result = measure_mesh(_locate(reader, file))
    except UsageError as error:
        needed = "a mesh must be a closed surface of triangles that face outwards"
        reader.fault(place, str(error), needed * (error.code == "EG-FILE-DAMAGED"), error.code)
        return None
    one = graph.one if scale is None else scale
    x, y, z = (tuple(graph.constant(v / result.volume) * one * one for v in row) for row in result.inertia)
    centre = vec.scale(one, vec.vector(graph, result.centre))
    return MassProperties(result.volume * one * one * one, centre, (x, y, z)), (one,) * 3  # type: ignore[arg-type]


def _locate(reader: Reader, file: str) -> str:
    """The path of a file beside the model file, below its folder, or UsageError; from Python any path."""
    model = place_of("", reader.faults.lines)[0]
    return beside(model, file) if model else file


#: Sizes of the shapes of ``display``, in the order of a BodyShape's.
SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "capsule": ("radius", "length"), "sphere": ("radius",)}
SIZES["mesh"] = ("scale",)
_COLOR = re.compile(r"#[0-9a-fA-F]{6}")


def read_display(reader: Reader, name: str, path: str, raw: Any) -> None:
    """Read the shapes of a body; the files they name are not looked for."""
    listed, one = items(raw), reader.graph.one
    if listed is None:
        reader.wrong(path, raw, kinds.Display)
    for k, shape in enumerate(listed or ()):
        place = f"{path}[{k}]"
        if not isinstance(shape, Mapping):
            reader.wrong(place, shape, kinds.Display)
            continue
        check_keys(place, shape, DISPLAY, reader.faults)
        sizes: dict[str, Any] = {"scale": (one, one, one)}
        for key, value in shape.items():
            if key not in DISPLAY or key in MARKER:
                continue
            sizes[key] = result = DISPLAY[key].read(reader, f"{place}.{key}", value)
            if key == "scale" and any(x.is_zero for x in result):
                remedy = "give three numbers other than 0; negative ones mirror"
                message = "a scale of 0 leaves nothing of the mesh"
                reader.fault(f"{place}.{key}", message, remedy, "EG-RANGE")
            if key == "color" and not (isinstance(value, str) and _COLOR.fullmatch(value)):
                remedy = 'give six hexadecimal digits: "#1f77b4"'
                reader.fault(f"{place}.{key}", f"{value!r} is no color", remedy, "EG-TYPE")
        frame, kind, color = reader.frame(place, shape), str(shape.get("shape")), str(shape.get("color", ""))
        file = str(shape.get("file", "")) if kind == "mesh" else ""
        if (keys := SIZES.get(kind)) and all(key in sizes for key in keys):
            size = _in_a_row(sizes[key] for key in keys)
            reader.drawn["display", name].append(BodyShape(reader.bodies[name], kind, size, frame, file, color))


#: Keys of which a body has one at most.
EXCLUSIVE = (("inertia", "principal"), ("com", "first_moment"))
MASS_KEYS = ("mass", "com", "first_moment", "inertia", "principal")
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
    parts = read_parts(reader, entry.name, path, values)
    keys = [key for key in MASS_KEYS if key in values]
    if "solids" in values and keys:
        for key in keys:
            remedy = "leave it out, or add points"
            faults.add(f"{path}.{key}", "is given beside solids, which already determine it", remedy, "EG-CONFLICT")
    elif "mass" not in values and (keys or not ("solids" in values or "points" in values or faults.under(path))):
        faults.missing(f"{path}.mass", f"give {kinds.Scalar.says}, solids or points")
    if "solids" in values or not keys:
        o = vec.zero(graph)
        whole = combine(graph, parts) if parts else MassProperties(graph.zero, o, (o, o, o))
        return Body(entry.name, whole.mass, whole.com, whole.inertia, check=check)
    return _body_of_mass(reader, entry.name, path, values, parts, check)


def _body_of_mass(
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
            reader.fault(f"{path}.axes", message, "give about: [x, y, z]", "EG-CONFLICT")
        rotation = point[1]
    plane = _plane(tensor)
    axis = None if plane is None else vec.transpose(rotation)[plane]
    if rotation != reader.identity:  # which mirrors the upper triangle
        if not is_symmetric(tensor):
            reader.fault(f"{path}.inertia", *ASYMMETRIC, code="EG-INERTIA")
        tensor = rotate_symmetric(rotation, tensor)
    moment: Vec3 | None = None
    if "first_moment" in values:
        moment = reader.vector(f"{path}.first_moment", values["first_moment"])
        if mass.is_zero and not all(x.is_zero for x in moment):
            message = "a body without mass has no first moment"
            reader.fault(f"{path}.first_moment", message, "give the body a mass", "EG-NO-INERTIA")
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
        raw = values[key]
        parts = items(raw)
        if key == "principal" and (parts is None or any(items(part) is not None for part in parts)):
            reader.wrong(f"{path}.{key}", raw, kinds.Vector)
        else:
            tensor = BODY["inertia"].read(reader, f"{path}.{key}", raw)
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
            markers = [key.partition(".")[2] for key in reader.markers if key.startswith(f"{body}.")]
            remedy = nearest(about, [*POINTS, *markers], "allowed")
            reader.fault(place, f"{body!r} has no marker {about!r}", remedy, "EG-NAME-UNKNOWN")
            return None
        return marker.frame.position, marker.frame.rotation
    if items(about) is None:
        reader.wrong(place, about, kinds.About)
        return None
    return reader.vector(place, about), None


def _plane(tensor: Mat3) -> int | None:
    """The axis of the one moment that was given, None where there are others, or products."""
    raw = [i for i in range(3) if not tensor[i][i].is_zero]
    products = any(not tensor[i][j].is_zero for i in range(3) for j in range(3) if i != j)
    return raw[0] if len(raw) == 1 and not products else None
