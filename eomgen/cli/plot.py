"""Stage cli, plot: a run -> a picture: coordinates over time, and the paths of points among the outputs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import MissingDependencyError, UsageError
from ..files.writing import save_figure

if TYPE_CHECKING:
    from ..describe.mechanism import Mechanism
    from ..runtime import Trajectory

BESIDE: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "fontsize": "small", "frameon": False}
BELOW: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.1), "fontsize": "small", "frameon": False}
POINTS = 2000  #: of a smooth curve, from the dense output


def require_plotting(file: Path, option: str = "--plot") -> None:
    """Fail before the work if there is nothing to draw with, or no such kind of picture.

    Raises
    ------
    MissingDependencyError, UsageError
    """
    try:
        from matplotlib.backend_bases import FigureCanvasBase
    except ImportError as error:
        raise MissingDependencyError(f'{option} needs matplotlib: pip install "eomgen[plot]"') from error
    known = sorted(FigureCanvasBase.get_supported_filetypes())
    if file.suffix[1:].lower() not in known:
        raise UsageError(f"{option} {file}: the ending says what kind of picture; there are .{', .'.join(known)}")


def find_paths(mechanism: Mechanism) -> list[tuple[str, str]]:
    """Pairs of outputs that are two coordinates of one marker's position."""
    places: dict[int, tuple[Any, int]] = {
        mechanism.graph.symbol(symbol).id: (quantity.marker, quantity.axis)
        for symbol, quantity in mechanism.quantities.items()
        if quantity.level == 0
    }
    by_marker: dict[Any, dict[int, str]] = {}
    for output in mechanism.outputs:
        if output.expression.id in places:
            marker, axis = places[output.expression.id]
            by_marker.setdefault(marker, {}).setdefault(axis, output.name)
    pairs = [[axes[k] for k in sorted(axes)[:2]] for axes in by_marker.values() if len(axes) > 1]
    return [(first, second) for first, second in pairs]


def plot_run(trajectory: Trajectory, paths: list[tuple[str, str]], title: str, file: Path) -> None:
    """Draw a run and write the picture; the suffix of ``file`` says its format.

    Parameters
    ----------
    trajectory : Trajectory
        With dense output.
    paths : list of (str, str)
        Pairs of columns to draw against each other.
    title : str
    file : Path
        Its folder is made if need be.
    """
    from matplotlib.figure import Figure

    smooth = trajectory.at(np.linspace(trajectory.t[0], trajectory.t[-1], POINTS))
    names = [*trajectory.metadata["q_names"], *trajectory.metadata["loop_names"]]
    groups = {label: [n for n in names if (trajectory.units.get(n) == "m") == (label == "m")] for label in ("rad", "m")}
    panels = {label: group for label, group in groups.items() if group}
    figure = Figure(figsize=(7.0 + 4.0 * bool(paths), 1.2 + 2.6 * len(panels)), layout="constrained", dpi=120)
    grid = figure.add_gridspec(len(panels), 2 if paths else 1, width_ratios=[1.6, 1.0] if paths else [1.0])
    axes = None
    for row, (label, group) in enumerate(panels.items()):
        axes = figure.add_subplot(grid[row, 0], sharex=axes)
        for name in group:
            axes.plot(smooth.t, smooth[name], label=name, linewidth=1.2)
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        axes.legend(**BESIDE)
    if axes is not None:
        axes.set_xlabel("t (s)")
    if paths:
        plane = figure.add_subplot(grid[:, 1])
        for first, second in paths:
            plane.plot(smooth[first], smooth[second], label=f"({first}, {second})", linewidth=1.2)
        plane.set_aspect("equal", adjustable="datalim")
        plane.set_title("paths (m)", fontsize="medium")
        plane.grid(alpha=0.3)
        plane.legend(**BELOW)
    figure.suptitle(title)
    save_figure(figure, file)
