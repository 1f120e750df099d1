"""Stage describe, closed outlines of contacts: points or sizes of a sprocket -> the sizes of a shape."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..base.value_rules import SPROCKET
from ..forces.contact_outlines import half_gap, half_tooth
from ..forces.contact_states import TEETH, teeth_of_sprocket
from ..graph.core import Expr
from ..graph.shown import shown
from .values import Reader

SEAT_ANGLE = math.radians(130)  #: ISO 606 allows 120 to 140 degrees


def positive(reader: Reader, path: str, x: Expr, or_zero: bool = False) -> None:
    """Require a number greater than 0, or 0 too."""
    reader.requirements.positive(path, x, or_zero)


def outline_sizes(reader: Reader, path: str, given: Mapping[str, Any], corners: Sequence[Expr]) -> tuple[Expr, ...]:
    """Depth and points, clockwise, of an outline whose corners are known, counterclockwise."""
    points = list(zip(corners[::2], corners[1::2], strict=True))[::-1]
    known = [(reader.known(x), reader.known(y)) for x, y in points]
    numbers = [(x, y) for x, y in known if x is not None and y is not None]
    if "depth" in given:
        depth = reader.expression(f"{path}.depth", given["depth"])
        positive(reader, f"{path}.depth", depth)
        if all(x.value is not None for x in corners):
            depth = reader.graph.apply("min", depth, half_gap(numbers))
    elif all(x.value is not None for x in corners):
        depth = reader.graph.constant(half_gap(numbers))
    else:
        reader.faults.missing(f"{path}.depth", "points with parameters do not tell it; give a length")
        depth = reader.stand_in
    return (depth, *(x for point in points for x in point))


def sprocket_sizes(reader: Reader, path: str, given: Mapping[str, Any]) -> tuple[Expr, ...]:
    """Depth, number of teeth, pitch, radii of seats and tips, angle of a seat."""
    teeth = teeth_of_sprocket(given)
    if teeth is None:
        reader.faults.add(
            f"{path}.teeth", f"is {shown(given['teeth'])}", f"give a whole number of {TEETH} or more", "EG-RANGE"
        )
        return ()
    keys = ("pitch", "seat", "tip_radius")
    sizes = [reader.expression(f"{path}.{key}", given[key]) for key in keys]
    for key, x in zip(keys, sizes, strict=True):
        positive(reader, f"{path}.{key}", x)
    sizes.append(reader.expression(f"{path}.seat_angle", given.get("seat_angle", SEAT_ANGLE)))
    if reader.faults.under(path) or reader.requirements.judge(path, SPROCKET, sizes, (teeth,)):
        return ()
    if "depth" in given:
        depth = reader.expression(f"{path}.depth", given["depth"])
        positive(reader, f"{path}.depth", depth)
    else:
        depth = half_tooth(teeth, *sizes)
    return (depth, reader.graph.constant(float(teeth)), *sizes)
