"""A list of mappings {shape, on, sizes} -> the shapes, one for each marker."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Any

from ..base.value_rules import BELOW, OUTLINE, RISING, SPROCKET, Flaw, sense_of_outline
from ..contact.fields import PLACES
from ..contact.profiles import half_gap, half_tooth
from ..contact.shapes import ContactShape
from ..contact.states import (
    BED,
    CORNERS,
    COUNTED,
    SHAPE_FIELDS,
    ContactShapes,
    count_of,
)
from ..elements import kinds
from ..expr.core import Expr
from ..expr.texts import printed
from .build_functions import read_table
from .checks import check_keys
from .description import items
from .values import Reader

SEAT_ANGLE = math.radians(130)  #: ISO 606 allows 120 to 140 degrees


def _positive(reader: Reader, path: str, raw: Mapping[str, Any], *keys: str) -> list[Expr]:
    """Sizes that must be greater than 0."""
    sizes = [reader.expression(f"{path}.{key}", raw[key]) for key in keys]
    for key, x in zip(keys, sizes, strict=True):
        reader.requirements.positive(f"{path}.{key}", x)
    return sizes


def outline_sizes(reader: Reader, path: str, raw: Mapping[str, Any], corners: Sequence[Expr]) -> tuple[Expr, ...]:
    """Depth and points, clockwise, of an outline whose corners are known, counterclockwise."""
    points = list(zip(corners[::2], corners[1::2], strict=True))[::-1]
    numbers = _numbers(reader, points)
    if "depth" in raw:
        (depth,) = _positive(reader, path, raw, "depth")
        if all(x.value is not None for x in corners):
            depth = reader.graph.apply("min", depth, half_gap(numbers))
    elif all(x.value is not None for x in corners):
        depth = reader.graph.constant(half_gap(numbers))
    else:
        reader.faults.missing(f"{path}.depth", "points with parameters do not determine it; give a length")
        depth = reader.stand_in
    return (depth, *(x for point in points for x in point))


def sprocket_sizes(reader: Reader, path: str, raw: Mapping[str, Any]) -> tuple[Expr, ...]:
    """Depth, number of teeth, pitch, radii of seats and tips, angle of a seat."""
    teeth = _count(reader, path, "sprocket", raw)
    if teeth is None:
        return ()
    sizes = _positive(reader, path, raw, "pitch", "seat", "tip_radius")
    sizes.append(reader.expression(f"{path}.seat_angle", raw.get("seat_angle", SEAT_ANGLE)))
    if reader.faults.under(path) or reader.requirements.judge(path, SPROCKET, sizes, (teeth,)):
        return ()
    if "depth" in raw:
        (depth,) = _positive(reader, path, raw, "depth")
    else:
        depth = half_tooth(teeth, *sizes)
    return (depth, reader.graph.constant(float(teeth)), *sizes)


EDGES = 0.05  #: radius of the edges of a cuboid unless given, as a part of its least length


def read_shapes(reader: Reader, path: str, value: Any) -> tuple[ContactShape, ...] | None:
    """The shapes of a group; None if anything is wrong with them, which is noted."""
    listed = [value] if isinstance(value, Mapping) else items(value)
    if listed is None:
        reader.wrong(path, value, ContactShapes)
        return None
    if not listed:
        remedy = "give at least one shape, such as {shape: circle, on: wheel, radius: 0.1}"
        reader.fault(path, "has no shapes", remedy, "EG-MISSING")
        return None
    result: list[ContactShape] = []
    for k, raw in enumerate(listed):
        result += _read(reader, f"{path}[{k}]", raw)
    return None if reader.faults.under(path) else tuple(result)


def _read(reader: Reader, path: str, raw: Any) -> list[ContactShape]:
    if not isinstance(raw, Mapping):
        reader.wrong(path, raw, ContactShapes)
        return []
    kind = reader.type_of(path, raw, SHAPE_FIELDS, "shape", "shape")
    if not kind:
        return []
    check_keys(path, raw, SHAPE_FIELDS[kind], reader.faults)
    if reader.faults.under(path):
        return []
    on = raw["on"]
    many = items(on)
    if many is not None and not many:
        reader.fault(f"{path}.on", "names no marker", "give a body or a marker, or a list of them", "EG-MISSING")
    places = [(f"{path}.on", on)] if many is None else [(f"{path}.on[{k}]", one) for k, one in enumerate(many)]
    markers = [reader.marker(place, one) for place, one in places]
    sizes = _sizes(reader, path, kind, raw)
    return [] if sizes is None else [ContactShape(kind, marker, sizes) for marker in markers if marker is not None]


def _sizes(reader: Reader, path: str, kind: str, raw: Mapping[str, Any]) -> tuple[Expr, ...] | None:
    if kind in ("half_plane", "half_space"):
        return ()
    if kind == "box":
        size = _several(reader, f"{path}.size", raw["size"], 2, True)
        if size is None:
            return None
        x, y = 0.5 * size[0], 0.5 * size[1]
        return (-x, -y, x, -y, x, y, -x, y)
    if kind == "polygon":
        return _corners(reader, f"{path}.points", raw["points"])
    if kind in ("outline", "smooth_outline"):
        corners = _corners(reader, f"{path}.points", raw["points"], False)
        return None if corners is None else outline_sizes(reader, path, raw, corners)
    if kind == "sprocket":
        return sprocket_sizes(reader, path, raw)
    if kind in ("profile", "smooth_profile"):
        return _profile(reader, path, raw, 2 if kind == "profile" else 3)
    if kind in ("ellipsoid", "cuboid"):
        key = "semi_axes" if kind == "ellipsoid" else "size"
        lengths = _several(reader, f"{path}.{key}", raw[key], 3, True)
        return None if lengths is None else (*lengths, *(_edge(reader, path, raw, lengths) if kind == "cuboid" else ()))
    if kind == "height_field":
        return _height(reader, path, raw)
    if kind in (BED, "plate"):
        lengths = _positive(reader, path, raw, *(("length",) if kind == BED else ("length", "width")))
        return (*lengths, reader.graph.constant(float(_count(reader, path, kind, raw) or 1)))
    names = ("length", "radius") if "length" in SHAPE_FIELDS[kind] else ("radius", *(["width"] * ("width" in raw)))
    sizes = [reader.expression(f"{path}.{name}", raw.get(name, 0)) for name in names]
    for name, x in zip(names, sizes, strict=True):
        if name in raw:
            reader.requirements.positive(f"{path}.{name}", x, kind == "segment" and name == "radius")
    return tuple(sizes)


def _height(reader: Reader, path: str, raw: Mapping[str, Any]) -> tuple[Expr] | None:
    """The height of a field, as an expression or a table of its own."""
    local = {name: reader.graph.symbol(symbol) for name, symbol in PLACES.items()}
    table = {key: value for key, value in raw.items() if key not in ("shape", "on", "height")}
    if "height" in raw:
        for key in table:
            reader.fault(f"{path}.{key}", "stands beside height", "give height, or x, y and z", "EG-CONFLICT")
        return (reader.expression(f"{path}.height", raw["height"], local=local),)
    if missing := [key for key in ("x", "y", "z") if key not in table]:
        remedy = "give height, an expression of x and y, or the grid lines x and y and the heights z on them"
        reader.fault(f"{path}.{missing[0]}", "is missing, and there is no height", remedy, "EG-MISSING")
        return None
    taken = {f.name for f in (*reader.graph.functions.values(), *(f for f, _ in reader.graph.calls.values()))}
    name = re.sub(r"\W+", "_", path).strip("_")
    while name in taken:
        name += "_"
    function = read_table(reader, name, path, table)
    if function is None:
        return None
    places = [local[axis].id for axis in ("x", "y")]
    return (Expr(reader.graph, reader.graph.call(function, (0, 0), places)),)


def _edge(reader: Reader, path: str, raw: Mapping[str, Any], size: Sequence[Expr]) -> tuple[Expr]:
    """The radius of the edges of a cuboid."""
    least = reduce(lambda a, b: a.graph.apply("min", a, b), size)
    if "edge_radius" not in raw:
        return (EDGES * least,)
    (radius,) = _positive(reader, path, raw, "edge_radius")
    phrases = ("is {:g}", "must be less than half of its least length, {1:g}")
    reader.requirements.judge(f"{path}.edge_radius", BELOW, [radius, 0.5 * least], phrases)
    return (radius,)


def _count(reader: Reader, path: str, kind: str, raw: Mapping[str, Any]) -> int | None:
    """How many parts a shape has; None where that is no such number, which is noted."""
    count, (key, least, most, _) = count_of(kind, raw), COUNTED[kind]
    if count is None:
        remedy = f"give a whole number {f'of {least} or more' if most == math.inf else f'from {least} to {most}'}"
        reader.fault(f"{path}.{key}", f"is {printed(raw[key])}", remedy, "EG-RANGE")
    return count


def _several(reader: Reader, path: str, value: Any, count: int, lengths: bool = False) -> list[Expr] | None:
    """So many expressions, of lengths greater than 0."""
    result = reader.several(path, value, count, kinds.Two if count == 2 else kinds.Vector)
    for k, x in enumerate(result if result and lengths else ()):
        reader.requirements.positive(f"{path}[{k}]", x)
    return result


def _points(reader: Reader, path: str, listed: Sequence[Any]) -> list[tuple[Expr, Expr]] | None:
    """Points [x, y]; None if one is none."""
    result = [_several(reader, f"{path}[{k}]", point, 2) for k, point in enumerate(listed)]
    points = [(point[0], point[1]) for point in result if point is not None]
    return points if len(points) == len(result) else None


def _numbers(reader: Reader, points: Sequence[tuple[Expr, Expr]]) -> list[tuple[float, float]]:
    """Points whose places the declared values tell."""
    known = [(reader.known(x), reader.known(y)) for x, y in points]
    return [(x, y) for x, y in known if x is not None and y is not None]


def _profile(reader: Reader, path: str, raw: Mapping[str, Any], least: int) -> tuple[Expr, ...] | None:
    """Depth and points of a profile, from left to right."""
    listed, place = items(raw["points"]), f"{path}.points"
    if listed is None or len(listed) < least:
        reader.fault(place, "is no profile", f"give {least} or more points [x, y] from left to right", "EG-TYPE")
        return None
    points = _points(reader, place, listed)
    if points is None:
        return None
    for k, ((a, _), (b, _)) in enumerate(itertools.pairwise(points)):
        if reader.requirements.judge(f"{place}[{k + 1}]", RISING, [a, b]):
            return None
    if "depth" in raw:
        (depth,) = _positive(reader, path, raw, "depth")
    else:
        depth = 0.1 * (points[-1][0] - points[0][0])
    return (depth, *(x for point in points for x in point))


def _corners(reader: Reader, path: str, value: Any, convex: bool = True) -> tuple[Expr, ...] | None:
    """Corners of an outline, counterclockwise."""
    listed = items(value)
    if listed is None or not 3 <= len(listed) <= CORNERS:
        reader.fault(path, "is no outline", f"give 3 to {CORNERS} corners [x, y]", "EG-TYPE")
        return None
    points = _points(reader, path, listed)
    if points is None:
        return None
    numbers = _numbers(reader, points)
    sense = sense_of_outline(numbers, convex) if len(numbers) == len(points) else 1
    if isinstance(sense, Flaw):
        reader.fault(path + sense.key, sense.message, sense.remedy, "EG-RANGE")
        return None
    reader.requirements.keep(path, OUTLINE, [x for point in points for x in point], (convex, sense))
    if sense < 0:
        points.reverse()
    return tuple(x for point in points for x in point)
