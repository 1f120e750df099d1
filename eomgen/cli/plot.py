"""A run -> a picture: coordinates over time, and the paths of points among the outputs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np

from ..base.files import save_figure
from ..errors import MissingDependencyError, bad_file, incomplete
from ..expr.notation import Notation
from .options import OPTIONS, Names

if TYPE_CHECKING:
    from ..model.mechanism import Mechanism
    from ..module import Module
    from ..runtime.trajectory import Trajectory


def require_plotting(file: Path, option: str = "--plot") -> None:
    """Fail before the work if there is nothing to draw with, or no such kind of picture."""
    try:
        from matplotlib.backend_bases import FigureCanvasBase
    except ImportError as error:
        raise MissingDependencyError(f"{option} needs matplotlib: pip install matplotlib") from error
    known = sorted(FigureCanvasBase.get_supported_filetypes())
    if file.suffix[1:].lower() not in known:
        raise bad_file(f"{option} {file}: the name of a picture must end in one of .{', .'.join(known)}")


def find_paths(mechanism: Mechanism) -> list[tuple[str, str]]:
    """Pairs of outputs that are two coordinates of one marker's position."""
    places: dict[int, tuple[Any, int]] = {
        mechanism.graph.symbol(symbol).id: ((quantity.marker, quantity.origin, quantity.axes), quantity.axis)
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


@dataclass(frozen=True)
class Picture:
    """What is to be drawn of a run: columns, over what, and of which kind."""

    SECTION: ClassVar = OPTIONS
    columns: Annotated[Names, "NAME: Columns that --plot draws, separated by commas; all coordinates by default."] = ()
    against: Annotated[str | None, "NAME: Column for the horizontal axis, instead of time."] = None
    plot_as: Annotated[
        Literal["time", "phase", "energy", "residuals", "spectrum"],
        "What --plot draws: columns over time, phase portraits, energy, residuals or a spectrum.",
    ] = "time"


def check_picture(file: Path | None, picture: Picture) -> None:
    """Fail before the work if nothing can be drawn, or if it is said what to draw and not where."""
    if file is not None:
        require_plotting(file)
    elif picture != Picture():
        raise incomplete("--columns, --against and --plot-as need --plot FILE; give it too")


def check_columns(module: Module, picture: Picture) -> None:
    """Fail before a run if it will have no column of a name."""
    from ..runtime.argument_checks import check_names
    from ..runtime.columns import column_names

    known = ("t", *column_names(module.layout))
    check_names("column", map(module.layout.plain, filter(None, (*picture.columns, picture.against))), known)


def plot_run(trajectory: Trajectory, paths: list[tuple[str, str]], title: str, file: Path, picture: Picture) -> None:
    """Draw a run or a kinematic analysis and write the picture; the suffix of ``file`` says its format.

    Parameters
    ----------
    trajectory : Trajectory
    paths : list of (str, str)
        Pairs of columns to draw against each other, beside the coordinates over time.
    title : str
    file : Path
        Its folder is made if need be.
    picture : Picture
        What was asked for; without wishes all coordinates and the paths are drawn.
    """
    from matplotlib.figure import Figure

    from ..runtime.plotting import Curves, choose, draw_panel, height, refined, stack

    led = trajectory.metadata.get("led", ())
    own = picture == Picture()
    over = led[0] if own and led and not np.ptp(trajectory.t) else picture.against
    names = picture.columns
    if own:
        names = tuple(n for n in (*trajectory.metadata["q_names"], *trajectory.metadata["loop_names"]) if n != over)
    panels, across = choose(trajectory, names, over, None, picture.plot_as)
    paths = paths if own else []
    size = (8.2 + 4.4 * bool(paths), max(3.2, sum(map(height, panels)) + 0.9))
    figure = Figure(figsize=size, layout="constrained", dpi=120)
    grid = figure.add_gridspec(1, 2 if paths else 1, width_ratios=[1.6, 1.0] if paths else [1.0])
    for ax in stack(figure, grid[0], panels, across):
        for singular in getattr(trajectory, "singular", ()):
            if over is None or over in singular.values:
                ax.axvline(singular.t if over is None else singular.values[over], color="0.6", ls=":", lw=1)
    if paths:
        plane = figure.add_subplot(grid[1])
        _, columns = refined(trajectory, tuple(dict.fromkeys(name for pair in paths for name in pair)))
        printed = Notation.of(trajectory.metadata).mathtext
        curves = [(f"({printed(a)}, {printed(b)})", columns[a], columns[b]) for a, b in paths]
        draw_panel(plane, Curves("", curves, equal=True), below=True)
        plane.set_title("paths (m)", fontsize="medium")
    figure.suptitle(title, parse_math=False)
    save_figure(figure, file)
