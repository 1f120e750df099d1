"""Solids, meshes, point masses -> mass properties; what pictures show of it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ..base.files import beside
from ..base.value_rules import NOT_NEGATIVE
from ..elements import kinds
from ..elements.kinds import DISPLAY, POINT, Vector
from ..errors import UsageError
from ..frames import Frame
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.tensors import rotate_symmetric
from ..solids import SOLIDS, MassProperties, point
from ..solids.mesh import measure_mesh
from .checks import check_keys, unknown_key
from .description import items, place_of
from .fields import BODY, SOLID, SOLID_KEYS, solid_fields
from .mechanism import BodyShape
from .names import nearest
from .placement import TURNS, turn_matrix
from .values import Reader


def read_parts(reader: Reader, path: str, values: Mapping[str, Any]) -> list[MassProperties]:
    """Mass properties of the solids and points of a body; those with faults are left out."""
    parts: list[MassProperties] = []
    for key, read in (("solids", _solid), ("points", _point)):
        if key not in values:
            continue
        listed = items(values[key])
        if listed is None:
            reader.wrong(f"{path}.{key}", values[key], BODY[key])
            continue
        for k, given in enumerate(listed):
            place = f"{path}.{key}[{k}]"
            if not isinstance(given, Mapping):
                reader.wrong(place, given, kinds.Table)
                continue
            part = read(reader, place, given)
            if part is not None:
                parts.append(part)
    return parts


def _point(reader: Reader, path: str, values: Mapping[str, Any]) -> MassProperties | None:
    check_keys(path, values, POINT, reader.faults)
    if "mass" not in values:
        return None
    at = reader.vector(f"{path}.at", values["at"]) if "at" in values else vec.zero(reader.graph)
    return point(reader.graph, reader.expression(f"{path}.mass", values["mass"]), at)


def _solid(reader: Reader, path: str, values: Mapping[str, Any]) -> MassProperties | None:
    faults, graph = reader.faults, reader.graph
    kind = values.get("type")
    if not isinstance(kind, str) or kind not in SOLID:
        if kind is None:
            faults.missing(f"{path}.type", f"give one of {', '.join(SOLID)}")
        else:
            faults.add(f"{path}.type", f"no solid of type {kind!r}", nearest(str(kind), SOLID, "types"), "EG-CHOICE")
        return None
    fields = solid_fields(kind)
    for key in values:
        if key not in fields:
            message = f"a {kind} has no {key!r}" if key in SOLID_KEYS else "unknown key"
            faults.add(f"{path}.{key}", message, unknown_key(key, fields), "EG-NAME-UNKNOWN")
    for key, field in fields.items():
        if field.required and key not in values:
            faults.missing(f"{path}.{key}", f"give {field.says}: {field.doc}")
    density = "line_density" if "line_density" in fields else "density"
    if ("mass" in values) == (density in values):
        wrong = f"both mass and {density} are given" if "mass" in values else f"neither mass nor {density} is given"
        faults.add(path, wrong, "give one of them", "EG-CONFLICT")
    given = {
        key: reader.expression(f"{path}.{key}", values[key]) for key in ("mass", density, "scale") if key in values
    }
    frame = reader.frame(path, values)
    if "axis" in values:
        columns = reader.axis(f"{path}.axis", values["axis"])
        if columns != TURNS["z"]:
            frame = Frame(vec.product(frame.rotation, turn_matrix(graph, columns)), frame.position)
    subtract = reader.flag(f"{path}.subtract", values["subtract"]) if "subtract" in values else False
    own = _mesh(reader, path, values, given.get("scale")) if kind == "mesh" else _shape(reader, path, kind, values)
    if own is None or faults.under(path):
        return None
    mass = given["mass"] if "mass" in given else given[density] * own.mass
    if subtract:
        mass = -mass
    tensor = rotate_symmetric(frame.rotation, own.inertia)
    x, y, z = (vec.scale(mass, row) for row in tensor)
    com = vec.add(frame.position, vec.times(frame.rotation, own.com))
    return MassProperties(mass, com, (x, y, z))


def _shape(reader: Reader, path: str, kind: str, values: Mapping[str, Any]) -> MassProperties | None:
    """What a solid has at density 1, its inertia for each kg, in its own axes."""
    solid, graph = SOLIDS[kind], reader.graph
    lengths: dict[str, tuple[Expr, Expr, Expr]] = {}
    for key, dimension in solid.dimensions.items():
        if key not in values:
            return None
        place = f"{path}.{key}"
        if isinstance(dimension, Vector):
            lengths[key] = reader.vector(place, values[key])
        else:
            lengths[key] = (reader.expression(place, values[key]),) * 3
        for x in dict.fromkeys(lengths[key]):
            told = f"{values[key]!r} is negative".replace("{", "{{").replace("}", "}}")
            reader.requirements.inside(place, x, NOT_NEGATIVE, "a length must be 0 or positive", told)
    if "inner_radius" in lengths and "outer_radius" in lengths:
        inner, outer = (lengths[key][0] for key in ("inner_radius", "outer_radius"))
        message, remedy = "{:g} exceeds the outer radius {:g}", "give a smaller inner radius"
        reader.requirements.in_order(f"{path}.inner_radius", inner, outer, message, remedy)
    made, o = solid(lengths), graph.zero
    a, b, c = made.gyration()
    return MassProperties(made.content(), made.centre(), ((a, o, o), (o, b, o), (o, o, c)))


def _mesh(reader: Reader, path: str, values: Mapping[str, Any], scale: Expr | None) -> MassProperties | None:
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
        found = measure_mesh(_locate(reader, file))
    except UsageError as error:
        needed = "a mesh must be a closed surface of triangles that face outwards"
        reader.faults.add(place, str(error), needed * (error.code == "EG-FILE-DAMAGED"), error.code)
        return None
    one = graph.one if scale is None else scale
    x, y, z = (tuple(graph.constant(v / found.volume) * one * one for v in row) for row in found.inertia)
    centre = vec.scale(one, vec.vector(graph, found.centre))
    return MassProperties(found.volume * one * one * one, centre, (x, y, z))  # type: ignore[arg-type]


def _locate(reader: Reader, file: str) -> str:
    """The path of a file beside the model file, below its folder; from Python any path.

    Raises
    ------
    UsageError
        A model file names a file outside its own folder.
    """
    model = place_of("", reader.faults.lines)[0]
    return beside(model, file) if model else file


#: Sizes of the shapes of ``display``, in the order of a BodyShape's.
SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "capsule": ("radius", "length"), "sphere": ("radius",)}


def read_body_shapes(reader: Reader, path: str, body: int, values: Mapping[str, Any]) -> list[BodyShape]:
    """Shapes of one body, where its description has no faults; ``display`` comes first, as solids are for the mass."""
    displayed = [
        shape
        for k, given in enumerate(items(values.get("display", ())) or ())
        if (shape := _displayed(reader, f"{path}.display[{k}]", body, given)) is not None
    ]
    if displayed:
        return displayed
    return [
        shape
        for k, given in enumerate(items(values.get("solids", ())) or ())
        if not given.get("subtract") and (shape := _solid_shape(reader, f"{path}.solids[{k}]", body, given)) is not None
    ]


def _sizes(reader: Reader, path: str, values: Mapping[str, Any], keys: tuple[str, ...]) -> tuple[Expr, ...]:
    found: list[Expr] = []
    for key in keys:
        if items(values[key]) is not None:
            found += reader.vector(f"{path}.{key}", values[key])
        else:
            found.append(reader.expression(f"{path}.{key}", values[key]))
    return tuple(found)


def _displayed(reader: Reader, path: str, body: int, values: Mapping[str, Any]) -> BodyShape | None:
    kind, frame, color = str(values.get("shape")), reader.frame(path, values), str(values.get("color", ""))
    if kind == "mesh":
        scale = _sizes(reader, path, values, ("scale",)) if "scale" in values else (reader.graph.one,) * 3
        return BodyShape(body, kind, scale, frame, str(values.get("file", "")), color)
    keys = SIZES.get(kind, ())
    if not keys or any(key not in values for key in keys):
        return None
    return BodyShape(body, kind, _sizes(reader, path, values, keys), frame, color=color)


def _solid_shape(reader: Reader, path: str, body: int, values: Mapping[str, Any]) -> BodyShape | None:
    kind, frame = str(values.get("type")), reader.frame(path, values)
    if "axis" in values:
        columns = reader.axis(f"{path}.axis", values["axis"])
        if columns != TURNS["z"]:
            frame = Frame(vec.product(frame.rotation, turn_matrix(reader.graph, columns)), frame.position)
    if kind == "mesh":
        scale = reader.expression(f"{path}.scale", values["scale"]) if "scale" in values else reader.graph.one
        return BodyShape(body, kind, (scale,) * 3, frame, str(values.get("file", "")))
    keys = tuple(key for key in SOLIDS[kind].dimensions if key != "inner_radius")
    return BodyShape(body, kind, _sizes(reader, path, values, keys), frame)


_COLOR = re.compile(r"#[0-9a-fA-F]{6}")


def check_display(reader: Reader, path: str, given: Any) -> None:
    """Note faults of the shapes of a body; the files they name are not looked for."""
    listed = items(given)
    if listed is None:
        reader.wrong(path, given, kinds.Display)
        return
    for k, shape in enumerate(listed):
        place = f"{path}[{k}]"
        if not isinstance(shape, Mapping):
            reader.wrong(place, shape, kinds.Display)
            continue
        check_keys(place, shape, DISPLAY, reader.faults)
        for key, value in shape.items():
            if key not in DISPLAY:
                continue
            found = DISPLAY[key].read(reader, f"{place}.{key}", value)
            if key == "scale" and any(x.is_zero for x in found):
                remedy = "give three numbers other than 0; negative ones mirror"
                message = "a scale of 0 leaves nothing of the mesh"
                reader.faults.add(f"{place}.{key}", message, remedy, "EG-RANGE")
            if key == "color" and not (isinstance(value, str) and _COLOR.fullmatch(value)):
                remedy = 'give six hexadecimal digits: "#1f77b4"'
                reader.faults.add(f"{place}.{key}", f"{value!r} is no color", remedy, "EG-TYPE")
