"""A run -> a picture: coordinates over time, and the paths of points among the outputs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np

from ..base.files import save_figure
from ..errors import MissingDependencyError, bad_file, incomplete
from ..expr.notation import Notation
from ..model.quantities import Measure
from .options import OPTIONS, Names, require_folder

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
    places: dict[int, tuple[Any, str]] = {
        mechanism.graph.symbol(symbol).id: ((quantity.marker, quantity.origin, quantity.axes), quantity.part)
        for symbol, quantity in mechanism.quantities.items()
        if quantity.measure is Measure.POSITION
    }
    by_marker: dict[Any, dict[str, str]] = {}
    for output in mechanism.outputs:
        if output.expression.id in places:
            marker, axis = places[output.expression.id]
            by_marker.setdefault(marker, {}).setdefault(axis, output.name)
    pairs = [[axes[k] for k in sorted(axes)[:2]] for axes in by_marker.values() if len(axes) > 1]
    return [(first, second) for first, second in pairs]


@dataclass(frozen=True)
class Output:
    """What is written of a run or of a kinematic analysis: all columns, and a picture of some."""

    SECTION: ClassVar = OPTIONS
    out: Annotated[Path | None, "FILE: Write all columns to FILE.npz, .csv, .nc or .parquet."] = None
    plot: Annotated[Path | None, "FILE: Draw them, e.g. to FILE.png."] = None
    columns: Annotated[Names, "NAME: Columns that --plot draws, separated by commas; all coordinates by default."] = ()
    against: Annotated[str | None, "NAME: Column for the horizontal axis, instead of time."] = None
    plot_as: Annotated[
        Literal["time", "phase", "energy", "residuals", "spectrum"],
        "What --plot draws: columns over time, phase portraits, energy, residuals or a spectrum.",
    ] = "time"

    @property
    def plain(self) -> bool:
        """Whether the picture is of all coordinates and of the paths of points."""
        return (self.columns, self.against, self.plot_as) == ((), None, "time")

    def check(self) -> None:
        """Fail before the work if a file cannot be written, or if it is said what to draw and not where."""
        if self.out is not None:
            from ..runtime.storage import RUNS  # which takes as long to import as all verbs

            if self.out.suffix not in RUNS:
                raise bad_file(f"--out {self.out}: a run is written as {' or '.join(RUNS)}")
        if self.plot is not None:
            require_plotting(self.plot)
        elif not self.plain:
            raise incomplete("--columns, --against and --plot-as need --plot FILE; give it too")
        require_folder("--out", self.out)
        require_folder("--plot", self.plot)

    def check_columns(self, module: Module) -> None:
        """Fail before a run if it will have no column of a name."""
        from ..runtime.argument_checks import check_names
        from ..runtime.trajectory import column_names

        known = ("t", *column_names(module.layout))
        check_names("column", map(module.layout.plain, filter(None, (*self.columns, self.against))), known)

    def write(self, mechanism: Mechanism, trajectory: Trajectory) -> list[Path]:
        """The files written."""
        if self.out is not None:
            trajectory.save(self.out)
        if self.plot is not None:
            plot_run(trajectory, find_paths(mechanism), self.plot, self)
        return [file for file in (self.out, self.plot) if file is not None]


def plot_run(trajectory: Trajectory, paths: list[tuple[str, str]], file: Path, wanted: Output) -> None:
    """Draw a run or a kinematic analysis, with pairs of columns against each other beside the coordinates over time."""
    from matplotlib.figure import Figure

    from ..runtime.plotting import Curves, choose, draw_panel, height, refined, stack

    driven = trajectory.metadata.get("led", ())
    default = wanted.plain
    over = driven[0] if default and driven and not np.ptp(trajectory.t) else wanted.against
    names = wanted.columns
    if default:
        names = tuple(n for n in (*trajectory.metadata["q_names"], *trajectory.metadata["loop_names"]) if n != over)
    panels, abscissa = choose(trajectory, names, over, None, wanted.plot_as)
    paths = paths if default else []
    size = (8.2 + 4.4 * bool(paths), max(3.2, sum(map(height, panels)) + 0.9))
    figure = Figure(figsize=size, layout="constrained", dpi=120)
    grid = figure.add_gridspec(1, 2 if paths else 1, width_ratios=[1.6, 1.0] if paths else [1.0])
    for ax in stack(figure, grid[0], panels, abscissa):
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
    figure.suptitle(trajectory.name, parse_math=False)
    save_figure(figure, file)
