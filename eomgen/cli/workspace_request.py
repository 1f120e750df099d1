"""Stage cli, workspace: ``--over`` and ``--of`` of ``eomgen kinematics`` -> a grid; a Workspace -> files and JSON."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.files import save_figure
from ..errors import at_odds, ill_typed, incomplete, no_number
from .screen import finite
from .shared_options import parse_number

if TYPE_CHECKING:
    from ..analysis.workspace import Workspace


def read_grid(over: tuple[str, ...], of: tuple[str, ...], within: bool, ranges: bool) -> dict[str, Any]:
    """``NAME=LOW:HIGH:COUNT`` of each coordinate -> ``over`` of ``Module.workspace``; empty without any.

    Raises
    ------
    UsageError
    """
    if not over:
        if of or within:
            raise incomplete("--of and --within-limits need --over NAME=LOW:HIGH:COUNT; give it too")
        return {}
    if not of:
        raise incomplete("--over needs --of NAME: the outputs or coordinates whose workspace it is")
    if ranges:
        raise at_odds("--over and --range cannot be used together: one is a grid, the other a path")
    return read_axes("--over", over)


def read_axes(option: str, over: tuple[str, ...]) -> dict[str, Any]:
    """``NAME=LOW:HIGH:COUNT`` of an option -> (low, high, count) by name.

    Raises
    ------
    UsageError
    """
    grid: dict[str, Any] = {}
    for words in over:
        name, equals, text = words.partition("=")
        parts = text.split(":")
        if not equals or not name.strip() or len(parts) != 3:
            raise ill_typed(f"{option} {words}: write NAME=LOW:HIGH:COUNT, for example theta=0:2*pi:73")
        try:
            low, high = (parse_number(part) for part in parts[:2])
            count = int(parts[2])
        except ValueError as error:  # a UsageError too
            raise no_number(f"{option} {words}: {error}") from None
        if name.strip() in grid:
            raise at_odds(f"{option} {words}: give each name once")
        grid[name.strip()] = (low, high, count)
    return grid


def write_workspace(space: Workspace, out: Path | None, plot: Path | None) -> list[str]:
    """Write the table and the picture asked for; returns the files."""
    files = []
    if out is not None:
        files.append(str(space.save(out)))
    if plot is not None:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(11.0, 4.8), layout="constrained", dpi=120)
        space.plot(figure=figure)
        save_figure(figure, plot)
        files.append(str(plot))
    return files


def workspace_to_dict(space: Workspace) -> dict[str, Any]:
    """A workspace as plain values."""
    words, counts = np.unique(space.status, return_counts=True)
    extent = {2: "area", 3: "volume"}.get(len(space.of))
    reached = space.reached.any()
    return {
        "shape": list(space.shape),
        "over": list(space.over),
        "of": list(space.of),
        "status": dict(zip(words.tolist(), counts.tolist(), strict=True)),
        "range": {n: [finite(np.nanmin(space[n])), finite(np.nanmax(space[n]))] for n in space.of} if reached else {},
        "extent": getattr(space, extent)() if extent and len(space.over) >= len(space.of) else None,
        "singular": [
            {"kind": one.kind, "values": one.values, "names": list(one.names), "joints": list(one.joints)}
            for one in space.singularities
        ],
    }
