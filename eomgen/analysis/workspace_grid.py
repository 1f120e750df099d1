"""Analysis: what a user asks of a workspace -> a checked grid of led values, names of results and limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.texts import shown
from ..base.value_rules import read_count
from ..errors import ill_chosen, ill_placed, ill_typed, incomplete, no_choice, off_range, too_large
from ..runtime.near_names import read_names, unknown
from ..runtime.room import read_axis, read_numbers

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.layout import Layout

MOST_AXES = 3
Index = tuple[int, ...]


class Limit(NamedTuple):
    """The range a coordinate may have."""

    name: str
    lower: float
    upper: float


class Grid(NamedTuple):
    """Values of the led coordinates, one axis for each."""

    names: tuple[str, ...]  #: t among them for time
    axes: tuple[Array, ...]
    of: tuple[str, ...]  #: outputs and coordinates to give over it
    limits: tuple[Limit, ...]

    @property
    def shape(self) -> Index:
        """Points of each axis."""
        return tuple(len(axis) for axis in self.axes)

    def at(self, index: Index) -> Array:
        """Values (n_axes,) at a point."""
        return np.array([axis[k] for axis, k in zip(self.axes, index, strict=True)])

    def neighbours(self, index: Index) -> list[tuple[int, Index]]:
        """Axis and index of the points beside one."""
        found = []
        for k, n in enumerate(self.shape):
            for step in (-1, 1):
                if 0 <= index[k] + step < n:
                    found.append((k, (*index[:k], index[k] + step, *index[k + 1 :])))
        return found


def read_grid(
    module: BoundModel, over: Mapping[str, Any], of: str | Sequence[str], limits: bool | Mapping[str, Any], points: int
) -> Grid:
    """Check names, values, limits and the number of points.

    Raises
    ------
    UsageError
    """
    layout, points = module.layout, read_count("points", points)
    if not isinstance(over, Mapping) or not over:
        raise ill_typed(
            f"over must be a mapping of coordinates to values, such as {{'theta': (0, 6.28, 73)}}, not {shown(over)}"
        )
    coordinates = (*layout.q, *layout.loops)
    for name in over:
        if name not in (*coordinates, "t"):
            raise unknown("coordinate to vary", name, (*coordinates, "t"))
        if _kind(layout, name) == "parameter":
            raise ill_placed(f"{name} is an Euler parameter, which a grid cannot vary; use rotation: euler_angles")
    if len(over) > MOST_AXES:
        raise off_range(f"a grid must have 1 to {MOST_AXES} coordinates, not {len(over)}: {', '.join(over)}")
    led = [name for name in over if name != "t"]
    if len(led) > layout.n_dof:
        left = f"vary at most {layout.n_dof}" if layout.n_dof else "the drivers move all bodies: vary t"
        raise ill_chosen(f"{', '.join(led)} cannot all be varied: {layout.n_dof} degrees of freedom; {left}")
    axes = tuple(read_axis(f"over {name}", given) for name, given in over.items())
    size = int(np.prod([len(axis) for axis in axes], dtype=object))
    if size > points:
        shape = " x ".join(str(len(axis)) for axis in axes)
        raise too_large(f"{shape} = {size} grid points, more than points={points}; take fewer values or raise points")
    wanted = read_names("of", of)
    known = dict.fromkeys((*layout.y, *coordinates))
    for name in wanted:
        if name not in known:
            raise unknown("output or coordinate", name, known)
    if not wanted or len(set(wanted)) < len(wanted):
        raise ill_typed(f"of must name outputs or coordinates, and each only once, not {shown(of)}")
    return Grid(tuple(over), axes, wanted, _limits(module, limits))


def _kind(layout: Layout, name: str) -> str:
    kinds = dict(zip((*layout.q, *layout.loops), (*layout.coordinate_kinds, *layout.loop_kinds), strict=True))
    return kinds.get(name, "time")


def _bound(name: str, given: Any) -> float:
    """One limit, which may be infinite."""
    found = read_numbers(f"limits {name}", given)
    if found.ndim:
        raise ill_typed(f"limits {name}: give (lower, upper), not {shown(given)} for one of them")
    return float(found)


def _limits(module: BoundModel, given: bool | Mapping[str, Any]) -> tuple[Limit, ...]:
    """Declared limits, or those given."""
    coordinates = (*module.layout.q, *module.layout.loops)
    if not isinstance(given, Mapping):
        if not isinstance(given, (bool, np.bool_)):
            raise no_choice(f"limits must be True, False or a mapping {{name: (lower, upper)}}, not {shown(given)}")
        declared = module.layout.limits if given else {}
        pairs = {name: (kept.get("lower"), kept.get("upper")) for name, kept in declared.items()}
        if given and not any(x is not None for pair in pairs.values() for x in pair):
            raise incomplete("limits=True, but no joint of the model has lower or upper limits; give limits={name: ..}")
        pairs = {name: pair for name, pair in pairs.items() if name in coordinates}
    else:
        pairs = {}
        for name, pair in given.items():
            if name not in coordinates:
                raise unknown("coordinate to limit", name, coordinates)
            if not isinstance(pair, Sequence) or isinstance(pair, str) or len(pair) != 2:
                raise ill_typed(f"limits {name}: give (lower, upper), None for none, not {pair!r}")
            pairs[name] = (pair[0], pair[1])
    found = []
    for name, (low, high) in pairs.items():
        lower = -np.inf if low is None else _bound(name, low)
        upper = np.inf if high is None else _bound(name, high)
        if not lower <= upper:
            raise off_range(f"limits {name}: lower {lower:g} is above upper {upper:g}")
        if lower > -np.inf or upper < np.inf:
            found.append(Limit(name, lower, upper))
    return tuple(found)
