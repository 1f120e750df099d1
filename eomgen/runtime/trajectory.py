"""States over time -> projected states, residuals, named columns worked out when they are read, tables, plots."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Any,
    ClassVar,
    Literal,
    NamedTuple,
    Self,
    SupportsIndex,
    TypeAlias,
    TypedDict,
    Unpack,
    overload,
)

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array, Indices
from ..base.files import as_path
from ..base.scales import largest
from ..errors import bad_data, cannot, ill_shaped, off_range, too_large
from .argument_checks import find_lacking, plain_name, read_numbers, require, unknown
from .inputs import Forcing
from .layout import Layout

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

# -- parts of a result -------------------------------------------------------------------------------------------------


class Named(list[Array]):
    """What belongs to each event, by its place or its name.

    It is a list, so that a loop over it meets the arrays; ``in``, ``keys()``, ``items()`` and ``get`` go by name.
    """

    def __init__(
        self, values: Sequence[Array], names: Sequence[str], instances: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(values)
        self.names, self.instances = tuple(names), instances or {}

    @classmethod
    def of(cls, values: Sequence[Array], header: Mapping[str, Any]) -> Named:
        """What belongs to the events of a run, by the names in its header; without names they are counted."""
        names = header.get("event_names") or [f"event_{k}" for k in range(len(values))]
        return cls(values, names, header.get("instances", {}))

    @overload
    def __getitem__(self, key: str | SupportsIndex) -> Array: ...
    @overload
    def __getitem__(self, key: slice) -> list[Array]: ...
    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            name = plain_name(key, self.instances)
            if name not in self.names:
                raise unknown("event", key, self.names)
            key = self.names.index(name)
        return super().__getitem__(key)

    def __contains__(self, name: object) -> bool:
        """Whether an event has this name; an array is in it if it is one of those here."""
        if isinstance(name, str):
            return plain_name(name, self.instances) in self.names
        return any(name is values for values in self)

    def keys(self) -> tuple[str, ...]:
        """Names of the events."""
        return self.names

    def values(self) -> list[Array]:
        """What belongs to each event."""
        return list(self)

    def items(self) -> list[tuple[str, Array]]:
        """Names, and what belongs to them."""
        return list(zip(self.names, self, strict=True))

    def get(self, name: str, default: Any = None) -> Any:
        """What belongs to the event of a name, ``default`` if there is none."""
        return self[name] if name in self else default  # noqa: SIM401  (this is that method)

    def __reduce__(self) -> tuple[Any, ...]:
        return Named, (list(self), self.names, self.instances)


class Residuals(NamedTuple):
    """Largest violation of the constraints over a run, all rows, redundant ones included."""

    raw_position: float = 0.0  #: of the integrator's states (m, rad)
    raw_velocity: float = 0.0  #: (m/s, rad/s)
    position: float = 0.0  #: of the stored, projected states
    velocity: float = 0.0
    correction_position: float = 0.0  #: largest change of a coordinate by the projection
    correction_velocity: float = 0.0  #: largest change of a velocity

    @classmethod
    def of(cls, raw: Residuals | Mapping[str, float] | Callable[[], Residuals]) -> Residuals:
        """Residuals as a run has them: themselves, by name, or a function that evaluates them."""
        if isinstance(raw, Residuals):
            return raw
        return raw() if callable(raw) else cls(**raw)


# -- columns -----------------------------------------------------------------------------------------------------------


FEW = 10_000  #: numbers at most of the raw states that are kept with a run, until its residuals are requested
NO_RESIDUALS = Residuals()


class Columns:
    """Everything that can be read from the states of a run, evaluated when first requested.

    The module has parameters and constant inputs bound; x (n_x, n_t) is projected, and u (n_u, n_t) may be a function
    that gives it when it is first needed.  ``steps()`` gives t, x and u of the integrator's steps, where other times
    are stored.
    """

    def __init__(
        self,
        module: BoundModel,
        t: Array,
        x: Array,
        u: Array | Callable[[], Array],
        steps: Callable[[], tuple[Array, Array, Array]] | None = None,
    ) -> None:
        self.module, self.t, self.x, self._u, self._steps = module, t, x, u, steps
        self._known: dict[str, Array] = {}
        # the first group wins: an output may repeat the coordinate of its own name, and the model may use T for its own
        self.names = column_names(module.layout)

    @cached_property
    def u(self) -> Array:
        """Inputs (n_u, n_t)."""
        return self._u() if callable(self._u) else self._u

    @cached_property
    def _groups(self) -> list[tuple[tuple[str, ...], Callable[[], Array]]]:
        layout = self.module.layout
        loops = layout.loops + layout.loop_rates + layout.loop_accelerations
        return [
            (layout.x, lambda: self.x),
            (layout.a, lambda: self.slopes[layout.n_q :]),
            (layout.parameter_rates, self._parameter_rates),
            (loops, self._loops),
            (layout.y, self._outputs),
            (layout.u, lambda: self.u),
            (("T", "V", "energy") if layout.energy_known else (), lambda: self.energies),
        ]

    def __getitem__(self, name: str) -> Array:
        if name not in self._known:
            names, evaluate = next(group for group in self._groups if name in group[0])
            for key, row in zip(names, evaluate(), strict=True):
                self._known.setdefault(key, row)
        return self._known[name]

    def _varying(self) -> Array | None:
        return self.u if self.u.size else None

    @cached_property
    def slopes(self) -> Array:
        """x' (n_x, n_t)."""
        return self.module.rhs(self.t, self.x, u=self._varying())

    def _parameter_rates(self) -> Array:
        layout = self.module.layout
        return self.slopes[[layout.q.index(name[:-4]) for name in layout.parameter_rates]]

    def _outputs(self) -> Array:
        return self.module.outputs(self.t, self.x, u=self._varying())

    def _loops(self) -> Array:
        layout = self.module.layout
        if not layout.n_loop_coordinates:
            return np.empty((0, len(self.t)))
        a = np.array([self[name] for name in layout.a])
        q, v = self.x[: layout.n_q], self.x[layout.n_q :]
        y = self.module.kernels.loop_coordinates(q, v, a, u=self._varying(), t=self.t)
        angles = layout.loop_angles
        y[0, angles] = self._unwrapped(y[0, angles], angles)
        parameters = [k for k, kind in enumerate(layout.loop_kinds) if kind == "parameter"]
        for k in range(0, len(parameters), 4):  # e and -e are one rotation: the nearer one goes on
            four = parameters[k : k + 4]
            e = y[0, four]
            turns = np.where((e[:, 1:] * e[:, :-1]).sum(axis=0) < 0.0, -1.0, 1.0)
            y[:, four] *= np.concatenate([[1.0], np.cumprod(turns)])
        return y.reshape(3 * layout.n_loop_coordinates, -1)

    def _unwrapped(self, result: Array, angles: Array) -> Array:
        """Angles of cut joints (k, n_t), whose turns count along the steps of the run, whatever times are stored."""
        passed = self._passed() if len(angles) else None
        if passed is None:
            return np.unwrap(result, axis=-1)
        t, x, u, order = passed
        n = self.module.layout.n_q
        kernel = self.module.kernels.loop_coordinates
        between = kernel(x[:n], x[n:], np.zeros_like(x[n:]), u=u if u.size else None, t=t)[0, angles]
        turned = np.empty((len(angles), len(order)))
        turned[:, order] = np.unwrap(np.concatenate([between, result], axis=-1)[:, order], axis=-1)
        return turned[:, len(t) :]

    def _passed(self) -> tuple[Array, Array, Array, Indices] | None:
        """t, x and u that the run passed besides those stored, and the order of both together; None if not kept."""
        t, x, u = (self.t[:0],) * 3 if self._steps is None else self._steps()
        forward = 1.0 if len(t) and t[-1] >= t[0] else -1.0
        order = np.argsort(forward * np.concatenate([t, self.t]), kind="stable")
        return (t, x, u, order) if len(t) else None

    @property
    def has_energies(self) -> bool:
        """Whether the model knows its energy."""
        return self.module.layout.energy_known

    @cached_property
    def energies(self) -> Array:
        """Kinetic, potential and total energy (3, n_t), whatever the model calls T and V."""
        T, V = self.module.energy(self.x, u=self._varying(), t=self.t)
        return np.array([T, V, T + V])

    @cached_property
    def change_points(self) -> list[ChangePoint]:
        """Where the mobility changes on the way."""
        from .change_points import find_change_points

        t, x, u = (self.t, self.x, self.u) if self._steps is None else self._steps()
        if self._steps is not None and not len(t):
            raise too_large(
                "the run took too many steps to keep all of them besides t_eval; for its change points run it without "
                "t_eval, or in parts"
            )
        return find_change_points(self.module, t, x, u)


@lru_cache(maxsize=64)
def column_names(layout: Layout) -> tuple[str, ...]:
    """All columns, each once."""
    cut = layout.loops + layout.loop_rates + layout.loop_accelerations
    energies = ("T", "V", "energy") if layout.energy_known else ()
    return tuple(dict.fromkeys(layout.x + layout.a + layout.parameter_rates + cut + layout.y + layout.u + energies))


@lru_cache(maxsize=64)
def units_of_layout(layout: Layout) -> dict[str, str]:
    """Units of all columns, by name."""
    return {name: layout.unit(name) for name in ("t", *column_names(layout)) if layout.unit(name)}


def describe(module: BoundModel) -> dict[str, Any]:
    """What the columns of any run of a module are called, where it comes from, and its parameters."""
    known = {**_described(module.layout), "parameters": dict(module._parameters)}
    from .identity import origin

    return known | {"origin": origin(module)}


@lru_cache(maxsize=64)
def _described(layout: Layout) -> dict[str, Any]:
    return {
        "name": layout.name,
        "q_names": list(layout.q),
        "v_names": list(layout.v[: layout.moving]),
        **({"s_names": list(layout.states)} if layout.states else {}),
        "x_names": list(layout.x),
        "loop_names": list(layout.loops),
        "y_names": list(layout.y),
        "u_names": list(layout.u),
        "model_method": layout.info.method,
        "docs": layout.info.docs,
        "latex": layout.info.latex,
        **({"printed": layout.info.printed} if layout.info.printed else {}),
        "instances": layout.info.instances,
    }


def project(
    module: BoundModel, t: Array, raw: Array, forcing: Forcing | None = None
) -> tuple[Residuals | Callable[[], Residuals], Array]:
    """Projected states (n_x, k), and how far the raw ones were off, with the inputs of the run as they are then.

    Of a short run the residuals are a function, which evaluates them when they are first requested.
    """
    if not t.size or not (module.n_rows or module.layout.space):
        return NO_RESIDUALS, raw
    constrained = forcing is not None and forcing.constrained
    u = forcing.sample(t, raw) if constrained and forcing is not None else None
    x = module.project(raw, t, None, u)
    if not module.n_rows:
        return NO_RESIDUALS, x
    here = u
    if constrained and forcing is not None and forcing.feedback:
        here = forcing.sample(t, x)
        x = module.project(x, t=t, u=here)
    if raw.size <= FEW and u is None:
        return partial(_residuals, module, t.copy(), raw), x  # the user may change what he is given
    return _residuals(module, t, raw, x, u, here), x


def _residuals(
    module: BoundModel, t: Array, raw: Array, x: Array | None = None, u: Array | None = None, here: Array | None = None
) -> Residuals:
    """How far raw states and projected ones are from the constraints, at the inputs of each."""
    n = module.n_q
    x = module.project(raw, t) if x is None else x
    position, velocity = module.kernels.constraints, module.kernels.velocity_constraints
    correction = np.abs(x - raw)
    for i, _ in module.layout.quaternion_slots:  # their length means nothing
        e = raw[i : i + 4]
        correction[i : i + 4] = np.abs(x[i : i + 4] - e / np.sqrt((e * e).sum(axis=0)))
    return Residuals(
        raw_position=largest(position(raw[:n], t=t, u=u)),
        raw_velocity=largest(velocity(raw, t=t, u=u)),
        position=largest(position(x[:n], t=t, u=here)),
        velocity=largest(velocity(x, t=t, u=here)),
        correction_position=largest(correction[:n]),
        correction_velocity=largest(correction[n:]),
    )


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
    SI units and radians.  What was not integrated is evaluated when first requested.

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
