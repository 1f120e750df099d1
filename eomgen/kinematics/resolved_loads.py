"""Stage kinematics: the entries of loads of force elements, and loads with other entries."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar, cast

from ..forces import CoordinateLoad, MarkerLoad
from ..graph.core import Expr

AnyLoad = TypeVar("AnyLoad", bound=MarkerLoad | CoordinateLoad)


def with_entries(load: AnyLoad, values: Iterator[Expr]) -> AnyLoad:
    """A load with its entries replaced by the next values."""
    made: MarkerLoad | CoordinateLoad
    if isinstance(load, CoordinateLoad):
        made = CoordinateLoad(load.coordinate, next(values))
    else:
        x = [next(values) for _ in range(6)]
        made = MarkerLoad(load.marker, (x[0], x[1], x[2]), (x[3], x[4], x[5]))
    return cast("AnyLoad", made)


def entries_of(load: MarkerLoad | CoordinateLoad) -> list[Expr]:
    """Force and torque of a load on a marker, or the one value of a load along a coordinate."""
    return [*load.force, *load.torque] if isinstance(load, MarkerLoad) else [load.value]
