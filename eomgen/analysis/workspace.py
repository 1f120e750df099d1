"""Analysis: a Module and a grid of coordinates -> Workspace: what outputs can reach, and how well conditioned it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.files import whole_file
from ..base.inline_pictures import picture_html
from ..base.notation import Notation
from ..base.texts import as_html, as_text, number
from ..base.value_rules import read_count
from ..errors import ill_shaped
from ..runtime.given_start import Start
from ..runtime.near_names import require, unknown
from ..runtime.refusals import refuse_states, require_velocities
from ..runtime.room import read_number
from ..runtime.storage import table_path
from .workspace_conditions import ConditionReader, Conditions, WorkspaceSingular, find_conditions
from .workspace_flood import OUT, REACHED, Flood, Stage, flood
from .workspace_grid import Grid, read_grid

if TYPE_CHECKING:
    import pandas

    from ..runtime.bound_model import BoundModel

RESOLUTION = {2: 400, 3: 100}  #: raster cells along each side


class Workspace:
    """The values that outputs reach over a grid of coordinates; ``ws["tip_x"]`` is an array shaped like the grid.

    Arrays have the axes of ``over`` last, in its order, and are NaN where the grid is not reached.  SI units, radians.

    Attributes
    ----------
    over : dict of str to (n_loop_coordinates,) array
        The coordinates of the grid and their values.
    of : tuple of str
        Outputs and coordinates.
    values : (n_of, ...) array
        Of them.
    q : (n_q, ...) array
        Positions, all on the branch of the initial one.
    status : (...) array of str
        ``reached``; ``limits``: beyond limits, or within them and reached only through what is beyond; ``out of
        reach``: the loops do not close, or not on this branch.
    jacobian : (n_of, n_over, ...) array
        dy/dx of ``of`` by ``over``, along the constraints.
    smallest, largest : (...) arrays
        Singular values of the Jacobian.
    manipulability : (...) array
        Their product, sqrt(det J J^T) (T. Yoshikawa, Manipulability of robotic mechanisms, 1985).
    condition : (...) array
        Their quotient, largest over smallest; infinite at a singular point.
    quality : (...) array
        Smallest over largest singular value of the scaled constraint Jacobian with the rows of the led coordinates: 0
        where the grid's coordinates do not determine the motion, 1 for an open chain.
    singular : (...) array of bool
        Grid points at or beside a singular position.
    singularities : list of WorkspaceSingular
        Those positions, named.
    """

    def __init__(self, module: BoundModel, grid: Grid, filled: Flood, known: Conditions) -> None:
        layout = module.layout
        self.name, self.q_names, self.notation = layout.name, layout.q, Notation.of(layout.metadata)
        self.over: dict[str, Array] = dict(zip(grid.names, grid.axes, strict=True))
        self.of, self.shape = grid.of, grid.shape
        self.units = {name: layout.unit(name) for name in ("t", *layout.q, *layout.loops, *layout.y)}
        self.status, self.reached = filled.status, filled.status == REACHED
        here = self.reached
        self.values = np.where(here, np.moveaxis(known.y, -1, 0), np.nan)
        self.q = np.where(here, np.moveaxis(filled.q, -1, 0), np.nan)
        self.jacobian = np.where(here, np.moveaxis(known.J, (-2, -1), (0, 1)), np.nan)
        self.quality = np.where(here, known.quality, np.nan)
        self.singular = known.singular & here
        self.singularities: list[WorkspaceSingular] = [one for one in known.found if here[one.point]]
        self.smallest, self.largest, self.manipulability, self.condition = _measures(self.jacobian)

    @property
    def names(self) -> tuple[str, ...]:
        """Names that ``ws[name]`` accepts."""
        measures = ("smallest", "largest", "manipulability", "condition", "quality", "singular", "status")
        return tuple(dict.fromkeys((*self.over, *self.of, *self.q_names, *measures)))

    def __getitem__(self, name: str) -> Any:
        """An array (*shape,)."""
        if name in self.over:
            k = list(self.over).index(name)
            return np.broadcast_to(
                np.expand_dims(self.over[name], [i for i in range(len(self.shape)) if i != k]), self.shape
            )
        if name in self.of:
            return self.values[self.of.index(name)]
        if name in self.q_names:
            return self.q[self.q_names.index(name)]
        if name not in self.names:
            raise unknown("column", name, self.names)
        return getattr(self, name)

    def area(self, resolution: int = RESOLUTION[2]) -> float:
        """Area that two outputs cover (each part counted once), from the images of the grid's cells on a raster.

        Parameters
        ----------
        resolution : int
            Raster cells along each side.

        Raises
        ------
        UsageError
            There are not two outputs, or fewer coordinates than outputs.
        """
        return self._extent(2, "area", resolution)

    def volume(self, resolution: int = RESOLUTION[3]) -> float:
        """Volume that three outputs cover; see :meth:`area`."""
        return self._extent(3, "volume", resolution)

    def _extent(self, d: int, what: str, resolution: int) -> float:
        from .workspace_extent import covered

        if len(self.of) != d or len(self.over) < d:
            raise ill_shaped(
                f"{what}() needs {d} outputs over {d} or more coordinates, not {len(self.of)} over {len(self.over)}"
            )
        _, width, raster = covered(self.values, read_count("resolution", resolution, 1))
        return float(np.count_nonzero(raster) * np.prod(width))

    def to_pandas(self) -> pandas.DataFrame:
        """One row for each grid point, indexed by the coordinates of the grid.

        Raises
        ------
        MissingDependencyError
            pandas is not installed.
        """
        module = require("pandas", "pandas", "to_pandas")
        index = module.MultiIndex.from_product(self.over.values(), names=list(self.over))
        rest = [name for name in self.names if name not in self.over]
        frame: pandas.DataFrame = module.DataFrame({name: self[name].ravel() for name in rest}, index=index)
        return frame

    def save(self, path: str | Path) -> Path:
        """Write all arrays, shaped like the grid, to ``.npz`` (added if there is no ending), or rows to ``.csv``.

        Returns
        -------
        Path
            The file written.
        """
        target = table_path(path, "a workspace is")
        if target.suffix == ".npz":
            arrays: dict[str, Any] = {f"[{name}]": np.asarray(self[name]) for name in self.names}
            with whole_file(target) as stream:
                np.savez_compressed(stream, over=list(self.over), of=self.of, jacobian=self.jacobian, **arrays)
            return target
        columns = [self[name].ravel() for name in self.names]
        with whole_file(target) as file:
            file.write((",".join(self.names) + "\n").encode())
            for row in zip(*columns, strict=True):
                line = ",".join(f"{x:.17g}" if isinstance(x, float) else str(x) for x in row)
                file.write(f"{line}\n".encode())
        return target

    def plot(self, by: str = "manipulability", ax: Any = None, figure: Any = None) -> Any:
        """Draw the outputs, and beside them the grid, coloured by one of the columns; singular positions are marked.

        Parameters
        ----------
        by : str
            A column of numbers.
        ax : matplotlib Axes, optional
            Where to draw the outputs alone.
        figure : matplotlib Figure, optional
            Where to draw both; by default a new one.

        Returns
        -------
        Axes, or an array of two

        Raises
        ------
        MissingDependencyError
            matplotlib is not installed.
        """
        from .workspace_plot import plot_workspace

        return plot_workspace(self, by, ax, figure)

    @property
    def facts(self) -> list[tuple[str, str]]:
        """Summary of the workspace, as pairs of label and value."""
        counts = {word: int(np.count_nonzero(self.status == word)) for word in (REACHED, "limits", OUT)}
        facts = [("points", ", ".join(f"{n} {word}" for word, n in counts.items() if n))]
        for k, name in enumerate(self.of):
            if self.reached.any():
                low, high = np.nanmin(self.values[k]), np.nanmax(self.values[k])
                facts.append((name, f"{number(low)} .. {number(high)} {self.units.get(name, '')}".rstrip()))
        if len(self.over) >= len(self.of) in RESOLUTION:
            area = len(self.of) == 2
            facts.append(("area" if area else "volume", number(self.area() if area else self.volume(), 4)))
        if np.isfinite(self.manipulability).any():
            facts.append(("manipulability", f"up to {number(np.nanmax(self.manipulability))}"))
        for kind in ("stop", "change point", "outputs"):
            same = [one for one in self.singularities if one.kind == kind]
            if same:
                more = f", and {len(same) - 1} more" if len(same) > 1 else ""
                facts.append((f"singular: {kind}", str(same[0]).removeprefix(f"{kind} at ") + more))
        return facts

    @property
    def title(self) -> str:
        """One line: the outputs and the coordinates of the grid."""
        axes = ", ".join(f"{name} ({len(x)})" for name, x in self.over.items())
        return f"workspace of {self.name}: {', '.join(self.of)} over {axes}"

    def __str__(self) -> str:
        return as_text(self.title, self.facts)

    def _repr_html_(self) -> str:
        return as_html(self.title, self.facts) + picture_html(self._figure)

    def _figure(self) -> Any:
        figure = require("matplotlib.figure", "matplotlib", "a picture").Figure(
            figsize=(9.0, 3.9), layout="constrained"
        )
        self.plot(figure=figure)
        return figure

    def __repr__(self) -> str:
        return f"<Workspace of {self.name}: {np.count_nonzero(self.reached)} of {self.reached.size} points reached>"


def _measures(J: Array) -> tuple[Array, Array, Array, Array]:
    """Smallest and largest singular value, product and quotient, of (n_of, n_over, *shape)."""
    A = np.moveaxis(J, (0, 1), (-2, -1))
    fine = np.isfinite(A).all(axis=(-2, -1))
    found = np.full((4, *A.shape[:-2]), np.nan)
    if fine.any():
        S = algebra.singular_values(A[fine])
        with np.errstate(divide="ignore", invalid="ignore"):
            found[:, fine] = S[:, -1], S[:, 0], S.prod(axis=1), S[:, 0] / S[:, -1]
    smallest, largest, product, quotient = found
    return smallest, largest, product, quotient


def workspace(
    module: BoundModel,
    /,
    over: Mapping[str, Any],
    of: str | Sequence[str],
    initial: Start = None,
    parameters: Any = None,
    inputs: Any = None,
    *,
    t: float = 0.0,
    limits: bool | Mapping[str, tuple[float | None, float | None]] = False,
    points: int = 100_000,
) -> Workspace:
    """Find what outputs can reach over a grid of independent coordinates, and the conditioning there.

    The grid is followed from the initial position, neighbour to neighbour, so that the mechanism stays on its branch.

    Parameters
    ----------
    over : mapping of str to (float, float, int) or (n,) array
        One to three coordinates, of the tree or of cut joints, each with (low, high, count) or rising or falling
        values; ``t`` for drivers.  Coordinates not named, as far as they are free, stand still.
    of : str or sequence of str
        Outputs that are functions of position, such as coordinates of a marker, and coordinates.
    initial : mapping or array, optional
        Position to start from, as for :meth:`kinematic_analysis`.
    parameters, inputs : optional
        As for :meth:`bind`.
    t : float
        Time (s), unless it is varied.
    limits : bool, or mapping of str to (lower, upper)
        Whether to stay within the limits the joints declare, or limits of coordinates; None for none.
    points : int
        Most points a grid may have.

    Returns
    -------
    Workspace
        ``ws["tip_x"]``, ``status``, ``jacobian``, ``manipulability``, ``quality``, ``singularities``, ``area()``.

    Raises
    ------
    PartitionError
        No point of the grid can be reached, or the start is singular.
    AssemblyError
        The initial values do not fit the loops and drivers.
    UsageError
        Unknown names, too many coordinates, too many points, outputs that are not functions of position.
    """
    require_velocities(module.layout)
    refuse_states(module.layout, "workspace")
    if parameters is not None or inputs is not None:
        module = module.bind(parameters, inputs)
    with np.errstate(all="ignore"):
        grid = read_grid(module, over, of, limits, points)
        stage = Stage(module, grid, initial, read_number("t", t))
        reader = ConditionReader(stage)
        reader.require_positions(stage.q, stage.t)
        filled = flood(stage)
        return Workspace(module, grid, filled, find_conditions(stage, reader, filled))
