"""A grid of values of many runs -> initial values, parameters and inputs, a column for each run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..errors import at_odds, incomplete
from ..runtime.near_names import check_names, require_mapping, without_dots
from ..runtime.room import read_axis, require_room

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

Groups = tuple[Any, Any, Any]


def spread_grid(module: BoundModel, grid: Any, groups: Groups) -> Groups:
    """Initial values, parameters and inputs with the columns of a grid: every combination, the last name fastest.

    Parameters
    ----------
    module : BoundModel
    grid : mapping
        Values by the name of a parameter, an input, a coordinate, a rate or an output: a list, or (low, high, count).
    groups : tuple
        Initial values, parameters and inputs beside the grid, by name.

    Raises
    ------
    UsageError
        A name that is not there, or given twice; a group that is an array.
    """
    require_mapping("grid", grid)
    grid = without_dots(grid, module.layout.instances)
    if not grid:
        raise incomplete("grid has no names; give values by name, such as {'theta': (0, 1, 11)}")
    layout = module.layout
    states = (*layout.x, *layout.loops, *layout.loop_rates, *layout.y)
    check_names("parameter, input, coordinate or rate", grid, (*module.p_names, *module.u_names, *states))
    for what, given in zip(("initial", "parameters", "inputs"), groups, strict=True):
        if given is not None and not isinstance(given, Mapping):
            raise incomplete(f"{what} must be given by name beside a grid")
        if twice := sorted({*grid} & {*without_dots(given or {}, layout.instances)}):
            raise at_odds(f"grid: {', '.join(twice)} is given in {what} too; give it once")
    axes = grid_axes(grid)
    count = math.prod(map(len, axes.values()))
    require_room(f"a grid of {count} runs", float(count) * len(axes), "give fewer values")
    columns = [column.ravel() for column in np.meshgrid(*axes.values(), indexing="ij")]
    initial, parameters, inputs = (dict(given or {}) for given in groups)
    for name, column in zip(grid, columns, strict=True):
        home = parameters if name in module.p_names else inputs if name in module.u_names else initial
        home[name] = column
    return initial, parameters, inputs


def grid_axes(grid: Mapping[str, Any]) -> dict[str, Array]:
    """The values of each name of a grid."""
    return {name: np.asarray(read_axis(f"grid {name}", values)) for name, values in grid.items()}
