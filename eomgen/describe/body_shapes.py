"""Stage describe, shapes of bodies: entries of ``display`` and of ``solids`` -> what pictures show of a body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..frames import Frame
from ..graph import vectors as vec
from ..graph.core import Expr
from ..solids import SOLIDS
from .description import items
from .mechanism import BodyShape
from .placement import TURNS, turn_matrix
from .values import Reader

#: Sizes of the shapes of ``display``, in the order of a BodyShape's.
SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "capsule": ("radius", "length"), "sphere": ("radius",)}


def read_shapes(reader: Reader, path: str, body: int, values: Mapping[str, Any]) -> list[BodyShape]:
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
        if not given.get("subtract") and (shape := _solid(reader, f"{path}.solids[{k}]", body, given)) is not None
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


def _solid(reader: Reader, path: str, body: int, values: Mapping[str, Any]) -> BodyShape | None:
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
