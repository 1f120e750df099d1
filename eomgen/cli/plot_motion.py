"""Stage cli, plot of a kinematic analysis: coordinates over the range, and the curves of points among the outputs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..files.writing import save_figure
from ..texts import visible
from .plot import BELOW, BESIDE

if TYPE_CHECKING:
    from ..analysis.kinematic_motion import KinematicAnalysis


def plot_motion(motion: KinematicAnalysis, paths: list[tuple[str, str]], file: Path) -> None:
    """Draw an analysis and write the picture; the suffix of ``file`` says its format.

    Parameters
    ----------
    motion : KinematicAnalysis
    paths : list of (str, str)
        Pairs of columns to draw against each other: curves of points.
    file : Path
        Its folder is made if need be.
    """
    from matplotlib.figure import Figure

    over = "t" if np.ptp(motion.t) or not motion.led else motion.led[0]
    header = motion.metadata
    names = [n for n in (*header["q_names"], *header["loop_names"]) if n != over]
    panels = {
        label: group
        for label in ("rad", "m")
        if (group := [n for n in names if (motion.units.get(n) == "m") == (label == "m")])
    }
    figure = Figure(figsize=(7.0 + 4.0 * bool(paths), 1.2 + 2.6 * max(1, len(panels))), layout="constrained", dpi=120)
    grid = figure.add_gridspec(max(1, len(panels)), 2 if paths else 1, width_ratios=[1.6, 1.0] if paths else [1.0])
    axes = None
    for row, (label, group) in enumerate(panels.items()):
        axes = figure.add_subplot(grid[row, 0], sharex=axes)
        for name in group:
            axes.plot(motion[over], motion[name], label=name, linewidth=1.2)
        for singular in motion.singular:
            axes.axvline(singular.t if over == "t" else singular.values[over], color="0.6", linestyle=":", linewidth=1)
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        axes.legend(**BESIDE)
    if axes is not None:
        unit = visible(motion.units.get(over, "rad"), lines=False)
        axes.set_xlabel(f"{over} ({unit})", parse_math=False)
    if paths:
        plane = figure.add_subplot(grid[:, 1])
        for first, second in paths:
            plane.plot(motion[first], motion[second], label=f"({first}, {second})", linewidth=1.2)
        plane.set_aspect("equal", adjustable="datalim")
        plane.set_title("curves of points (m)", fontsize="medium")
        plane.grid(alpha=0.3)
        plane.legend(**BELOW)
    figure.suptitle(motion.name)
    save_figure(figure, file)
