"""Projected states of a run -> named columns, tables, plots, energy balance."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeAlias, TypedDict, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..base.files import as_path
from ..errors import bad_data, cannot, ill_shaped, off_range
from .argument_checks import find_lacking, plain_name, read_numbers, require, unknown
from .columns import Named, Residuals

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ..show.page import InlinePage
    from ..show.writers import InlineFilm
    from .bound_model import BoundModel
    from .change_points import ChangePoint
    from .protocols import Source

# -- keywords of animations --------------------------------------------------------------------------------------------


class FilmOptions(TypedDict, total=False):
    """How an animation looks."""

    fps: float
    names: bool | None
    axes: bool
    trace: str | Sequence[str]
    dpi: float


class AnimationOptions(FilmOptions, total=False):
    """And what of a run it shows."""

    model: BoundModel | None
    speed: float | None
    plot: str | Sequence[str]
    forces: bool | str | Sequence[str]


# -- trajectories ------------------------------------------------------------------------------------------------------


class Trajectory:
    """The result of a simulation.

    ``traj["theta"]`` is a column (n_t,): coordinates, velocities (``theta_dot``), accelerations (``theta_ddot``),
    coordinates of cut joints (angles without jumps) and their rates, outputs, inputs, ``T``, ``V`` and ``energy`` (the
    model's own quantities of these names come first; see ``energies``).
    SI units and radians.  What was not integrated is evaluated when first asked for.

    Attributes
    ----------
    t : (n_t,) array
        Times (s).
    x : (n_x, n_t) array
        States, projected onto the constraints.
    names : tuple of str
        All columns.
    units : dict of str to str
    residuals : Residuals
        How well the loops were kept, raw and projected.
    t_events : list of (k,) arrays
        Times of each event, also by name: ``t_events["floor"]``, ``"floor" in t_events``, ``t_events.items()``.
    x_events : list of (n_x, k) arrays
        Projected states at the events, before a reset.
    nfev, njev, nlu, status : int
        Calls of the right-hand side and the Jacobian, factorisations, SciPy's status (1: a terminal event).
    message : str
    metadata : dict
        ``name`` and ``model_method``, ``parameters``, ``inputs`` as they were given, ``method``, ``rtol``, ``atol`` and
        all ``options``, ``span``, and ``origin``: ``model_digest`` (SHA-256 of the model), ``target`` and ``versions``
        of eomgen, Python, NumPy and the compiler.  Runs that are the same have the same metadata.
    """

    BESIDES: ClassVar[tuple[str, ...]] = ()  #: attributes that a class of runs has besides

    def __init__(
        self,
        t: Array,
        x: Array,
        columns: Source,
        header: dict[str, Any] | Callable[[], dict[str, Any]],
        t_events: Sequence[Array] = (),
        x_events: Sequence[Array] = (),
        sample: Callable[[Array], Trajectory] | None = None,
        described: Callable[[], dict[str, Any]] = dict,
        again: Callable[[], Trajectory] | None = None,
    ) -> None:
        self.t, self.x, self.names = t, x, columns.names
        self.columns = columns  #: where the columns come from: the module's calls, or the arrays of a file
        self._shared_header, self._described = header, described
        self._times, self._states, self._sample, self._again = t_events, x_events, sample, again

    @classmethod
    def of(cls, parts: tuple[Any, ...], *besides: Any) -> Self:
        """Make a run from the parts of a Trajectory and what its class has besides."""
        run = cls(*parts)
        vars(run).update(zip(cls.BESIDES, besides, strict=True))
        return run

    _header = cached_property[dict[str, Any]](
        lambda self: self._shared_header() if callable(self._shared_header) else self._shared_header
    )
    units = cached_property[dict[str, str]](lambda self: self._header.get("units", {}))
    t_events = cached_property[Named](lambda self: Named.of(self._times, self._header | self._described()))
    x_events = cached_property[Named](lambda self: Named.of(self._states, self._header | self._described()))
    nfev = cached_property[int](lambda self: int(self._header.get("nfev", 0)))
    njev = cached_property[int](lambda self: int(self._header.get("njev", 0)))
    nlu = cached_property[int](lambda self: int(self._header.get("nlu", 0)))
    status = cached_property[int](lambda self: int(self._header.get("status", 0)))
    message = cached_property[str](lambda self: str(self._header.get("message", "")))
    residuals = cached_property[Residuals](lambda self: Residuals.of(self._header["residuals"]))
    metadata = cached_property[dict[str, Any]](
        lambda self: {**self._described(), **self._header, "residuals": self.residuals._asdict()}
    )

    @property
    def name(self) -> str:
        """Name of the model."""
        return str(self.metadata["name"])

    @property
    def q(self) -> Array:
        """Coordinates of the tree (n_q, n_t)."""
        return self.x[: len(self.metadata["q_names"])]

    @property
    def v(self) -> Array:
        """Velocities of the tree (n_v, n_t)."""
        return self.x[len(self.metadata["q_names"]) : len(self.x) - len(self.metadata.get("s_names", ()))]

    @property
    def s(self) -> Array:
        """First-order states (n_s, n_t)."""
        return self.x[len(self.x) - len(self.metadata.get("s_names", ())) :]

    @property
    def x_names(self) -> tuple[str, ...]:
        """Names of the rows of x."""
        return tuple(self.metadata["x_names"])

    if not TYPE_CHECKING:  # type checkers know all attributes

        def __getattr__(self, name: str) -> Any:
            return find_lacking(self, f"a {type(self).__name__}", name)

    def __getitem__(self, name: str) -> Array:
        if name == "t":
            return self.t
        if name not in self.names:
            name = plain_name(name, self.metadata.get("instances", {}))  # leg1.hip, of an instance of a component
        if name not in self.names:
            raise unknown("column", name, ("t", *self.names))
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return name == "t" or name in self.names

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        span = f"t = {self.t[0]:.6g} .. {self.t[-1]:.6g} s, " if len(self.t) else ""
        return f"<Trajectory of {self.name}: {len(self.t)} points, {span}{self.metadata.get('method')}>"

    def _repr_html_(self) -> str:
        from .drawing import trajectory_html

        return trajectory_html(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles (and copies) hold every column, evaluated, and no dense output; the module is not needed to read."""
        from .storage import Stored

        columns = Stored(self.names, self.to_numpy(), self.energies if self.has_energies else None)
        parts = self.t, self.x, columns, self.metadata, self.t_events, self.x_events
        return type(self).of, (parts, *(getattr(self, name) for name in self.BESIDES))

    @property
    def has_dense_output(self) -> bool:
        """Whether :meth:`at` costs no second run."""
        return self._sample is not None

    def at(self, t: ArrayLike) -> Trajectory:
        """Evaluate the trajectory at other times, from the dense output of the run.

        Where ``simulate`` did not keep that, the first call makes the same run again.

        Parameters
        ----------
        t : float or (k,) array
            Within the run (s).

        Returns
        -------
        Trajectory

        Raises
        ------
        UsageError
            A time lies outside the run, or it kept no dense output and cannot be made again: it has controllers, it
            was read from a file or copied, or it comes of another call than ``simulate``; or the run made again is
            another one.
        """
        if self._sample is None and (self._again is None or not len(self.t)):
            raise cannot(
                "this trajectory has no solution between its times, and cannot be made again, for it was read from a "
                "file or copied, has controllers=, or is not of simulate; give simulate dense_output=True, or t_eval="
            )
        times = np.atleast_1d(read_numbers("t", t))
        low, high = sorted(self.metadata["span"])
        if times.ndim != 1 or not ((times >= low) & (times <= high)).all():
            raise off_range(f"times must lie within the run, {low:.6g} .. {high:.6g} s")
        if self._sample is None:
            run: Any = self._again()  # type: ignore[misc]
            if not np.array_equal(run.x, self.x):
                raise cannot("inputs or events of this run give other values now; give dense_output=True")
            self._sample = run._sample
        return self._sample(times)

    def to_numpy(self, *names: str) -> Array:
        """Columns by name as rows of one array (len(names), n_t); all of them by default."""
        chosen = names or self.names
        return np.array([self[name] for name in chosen]).reshape(len(chosen), len(self.t))

    def to_pandas(self, *names: str) -> pandas.DataFrame:
        """Columns by name, all by default, as a table indexed by time.

        Raises
        ------
        MissingDependencyError
            pandas is not installed.
        """
        made = require("pandas", "pandas", "to_pandas").DataFrame
        frame: pandas.DataFrame = made({name: self[name] for name in names or self.names}, self.t).rename_axis("t")
        frame.attrs = {"model": self.name, "units": dict(self.units)}
        return frame

    def to_xarray(self) -> xarray.Dataset:
        """All columns over the dimension ``t``, with their units, and the times and states of events.

        Raises
        ------
        MissingDependencyError
            xarray is not installed.
        """
        from .storage import dataset

        return dataset(self)

    @property
    def has_energies(self) -> bool:
        """Whether the energy of the model is known; given equations of motion can lack it."""
        return self.columns.has_energies

    @property
    def energies(self) -> Array:
        """Kinetic, potential and total energy (J), (3, n_t).

        Raises
        ------
        UsageError
            The equations of motion were given without kinetic energy.
        """
        return self.columns.energies

    @property
    def change_points(self) -> list[ChangePoint]:
        """Times at which the mechanism has more degrees of freedom than elsewhere, so that its motion can branch.

        Each has a ``time``, the ``degrees_of_freedom`` there and the ``coordinates``.  The run itself goes straight on.

        Raises
        ------
        UsageError
            The trajectory was read from a file, without the model.
        """
        columns: Any = self.columns
        if not hasattr(type(columns), "change_points"):
            raise cannot("change points need the model: use the trajectory of simulate, not one read from a file")
        result: list[ChangePoint] = columns.change_points
        return result

    @property
    def energy_drift(self) -> float:
        """``max |E - E(0)| / max T``, the measure of an energy that should be kept."""
        T, _, energy = self.energies
        change, motion = float(np.abs(energy - energy[0]).max()), float(np.abs(T).max())
        return change / motion if motion else (0.0 if change == 0.0 else float("inf"))

    def save(self, path: str | Path) -> Path:
        """Write all columns to a file that :func:`load_trajectory` reads without the model.

        Parameters
        ----------
        path : str or Path
            Ends in ``.npz`` (added if there is no ending).  Other programs read ``.csv``, a plain table, ``.nc``,
            which is :meth:`to_xarray` as netCDF, and ``.parquet``, which is :meth:`to_pandas` as Parquet.

        Returns
        -------
        Path
            The file written.
        """
        from .storage import save

        return save(self, path)

    def poses(self, model: BoundModel | None = None) -> Array:
        """Body frames in ground axes over the run.

        Parameters
        ----------
        model : Module, optional
            Of a trajectory that was read from a file: the module it was made with.

        Returns
        -------
        (n_bodies, 4, 4, n_t) array
            In the order of the module's ``body_names``.
        """
        from .drawing import poses

        return poses(self, model)

    def position(self, name: str, model: BoundModel | None = None) -> Array:
        """Position (3, n_t) of a named marker (``"rod.tip"``) or of the origin of a body, in ground axes (m).

        Raises
        ------
        UsageError
            There is no such marker or body, or the trajectory was read from a file and no ``model`` is given.
        """
        from .drawing import position

        return position(self, name, model)

    @overload
    def animate(self, file: str | Path, **options: Unpack[AnimationOptions]) -> Path: ...
    @overload
    def animate(self, *, format: Literal["gif", "mp4"], **options: Unpack[AnimationOptions]) -> InlineFilm: ...
    @overload
    def animate(
        self, file: None = None, *, format: Literal["html"] | None = None, **options: Unpack[AnimationOptions]
    ) -> InlinePage: ...
    def animate(self, file: str | Path | None = None, *, model: BoundModel | None = None, **options: Any) -> Any:
        """Show the motion of the mechanism as an animation.

        Parameters
        ----------
        file : str or Path, optional
            ``.gif`` and ``.mp4`` are pictures by matplotlib; ``.html`` is one page with a time slider that can be
            turned and zoomed and needs no network; a name without an ending is a folder for PNG frames.
            Without a file a page comes back that a notebook shows, or what ``format`` says.
        format : {'gif', 'mp4', 'html'}, optional
            Of an animation without a file: a GIF or a film that a notebook shows; its ``data`` are the bytes.
        model : Module, optional
            Of a trajectory that was read from a file: the module it was made with.
        fps : float
            Frames in a second, 25 by default.
        speed : float
            Seconds of the run in one second of the animation; by default 1 where that lasts 3 to 12 s.
        trace : str or sequence of str
            Markers (``"rod.tip"``) or bodies whose paths are drawn.
        plot : str or sequence of str
            Columns to draw over time under the mechanism, with a line where it is.
        forces : bool, str or sequence of str
            Arrows of all forces, or of those named: of joints on their successors, of springs and dampers on bodies.
        names, axes : bool
            As for ``module.draw``.
        dpi : float
            Dots in an inch, 80 by default (.gif, .mp4).

        Returns
        -------
        Path of the file, or the page, whose text ``str`` gives, or the film, whose bytes ``bytes`` gives

        Raises
        ------
        MissingDependencyError
            matplotlib or ffmpeg is not installed.
        UsageError
            Another ending, an unknown name, or too many frames.
        """
        from .drawing import animate

        return animate(self, file, model, options)

    @overload
    def plot(self, name: str, /, *, kind: Literal["time", "spectrum"] = "time", ax: Axes | None = None) -> Axes: ...
    @overload
    def plot(
        self, *names: str | Sequence[str], x: str | None = None, y: Any = None, kind: str = "time", ax: Axes
    ) -> Axes: ...
    @overload
    def plot(
        self, *names: str | Sequence[str], x: str | None = None, y: Any = None, kind: str = "time", ax: None = None
    ) -> Axes | NDArray[Any]: ...
    def plot(
        self, *names: str | Sequence[str], x: str | None = None, y: Any = None, kind: str = "time", ax: Any = None
    ) -> Any:
        """Plot columns over time, or against each other; columns of one unit share a panel.

        Parameters
        ----------
        *names : str
            Columns; all coordinates by default.
        x : str
        y : str or sequence of str
            A column to draw others against: ``plot(x="tip_x", y="tip_y")`` is the path of a point.
        kind : {'time', 'phase', 'energy', 'residuals', 'spectrum'}
            ``phase``: rates over coordinates; ``energy``: kinetic, potential, total and its change; ``residuals`` of
            the constraints; ``spectrum``: amplitudes over frequency.
        ax : matplotlib Axes, optional
            Where to draw; by default a new figure.

        Returns
        -------
        Axes, or an array of Axes for several panels

        Raises
        ------
        MissingDependencyError
            matplotlib is not installed.
        UsageError
            An unknown column or kind, or a run of which this cannot be drawn.
        """
        from .plotting import plot

        return plot(self, names, ax, x, y, kind)


def load_trajectory(path: str | Path) -> Trajectory:
    """Read a trajectory that :meth:`Trajectory.save` wrote to an .npz file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Trajectory
        With all columns and ``metadata``; without dense output.

    Raises
    ------
    UsageError
        The file is not a trajectory saved by eomgen.
    FileNotFoundError
    """
    from .storage import BROKEN, FORMAT, RUNS, Stored, read_arrays

    source = as_path("path", path)
    if not source.suffix and not source.exists():
        source = source.with_suffix(".npz")
    try:
        arrays = read_arrays(source)
        header = json.loads(str(arrays["header"]))
        if header.pop("format") != FORMAT:
            raise ValueError("another format")
        names, x, t = tuple(header.pop("names")), arrays["x"], arrays["t"]
        count = sum(name.startswith("t_events_") for name in arrays)
        t_events, x_events = ([arrays[f"{part}_events_{k}"] for k in range(count)] for part in "tx")
        columns = Stored(names, arrays["columns"], arrays.get("energies"))
    except FileNotFoundError:
        raise
    except BROKEN as error:
        message = f"a {source.suffix} is for other programs; load the .npz of the run"
        message = message if source.suffix in RUNS[1:] else str(error)
        raise bad_data(f"{source} is not a trajectory saved by eomgen: {message}") from None
    return Trajectory(t, x, columns, header, t_events, x_events)


# -- starts of runs ----------------------------------------------------------------------------------------------------


#: An end, or start and end (s); texts are expressions of numbers.
Span: TypeAlias = float | str | Sequence[float | str] | None
#: Named values, a state, or a run, whose last state it is.
Start: TypeAlias = Mapping[str, float | str] | ArrayLike | Trajectory | None


def last_state(raw: Any, names: Sequence[str]) -> Any:
    """The last state (n_x,) of a run; anything else as it is."""
    if not isinstance(raw, Trajectory):
        return raw
    if tuple(raw.x_names) != tuple(names):
        raise ill_shaped(f"initial: the run has states {', '.join(raw.x_names)}; the model has {', '.join(names)}")
    return raw.x[:, -1]
