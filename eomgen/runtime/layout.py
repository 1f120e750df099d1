"""The metadata of a model (model.json) -> names, sizes, shapes of its kernels, allowed parameters."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from copy import copy
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.kernel_table import NAMED, Sizes
from ..base.operations import play_arrays
from ..base.scales import Scales, Space
from ..base.texts import acceleration_name
from ..base.value_rules import POINTS, RULES, Allowed, Flaw, judge_range, surely_right
from ..errors import ParameterError, Problem, bad_data, calls_within, cannot, ill_shaped
from .argument_checks import check_names, plain_name, read_number, read_numbers, without_dots

# -- model.json --------------------------------------------------------------------------------------------------------


ABI = 1  #: version of the generated functions' signatures and of the metadata that describe them
ALWAYS = ("events", "resets")  #: entries that every model has, also where they are empty


class ModelInfo:
    """What a module knows of its model without any expression: the schema of model.json, both ways.

    Entries with a default are left out of the file where they have it.  A tape is as :mod:`.inputs` has it, a place one
    in q, v, x, u or p; numbers of bodies count from 0, and -1 is ground.
    """

    name: str
    doc: str
    method: str
    q_names: Sequence[str]
    v_names: Sequence[str]
    x_names: Sequence[str]
    u_names: Sequence[str]
    p_names: Sequence[str]
    y_names: Sequence[str]
    body_names: Sequence[str]
    joint_names: Sequence[str]
    loop_joint_names: Sequence[str]
    loop_names: Sequence[str]
    loop_kinds: Sequence[str]
    coordinate_kinds: Sequence[str]
    velocity_kinds: Sequence[str]
    quaternion_slots: Sequence[Sequence[int]]  #: first place in q and in v of each rotation by Euler parameters
    euler_angles: Sequence[Sequence[Any]]  #: joint, place of its middle angle, 'cos' or 'sin': 0 where singular
    rolling_discs: Sequence[Sequence[Any]]  #: constraint, body and axle of the wheel, body and normal of the plane
    constraint_labels: Sequence[str]
    constraint_kinds: Sequence[str]
    constraint_scales: Sequence[str | float]
    alignment_labels: Sequence[str]
    fragile_forces: Sequence[str]  #: whose loads may be no numbers
    p_values: Sequence[float | None]
    u_values: Sequence[float | None]
    units: Mapping[str, str]
    docs: Mapping[str, str]
    independent: Sequence[int]
    independent_rows: Sequence[int]
    redundant_rows: Sequence[int]
    q_reference: Sequence[float]
    initial: Mapping[str, float]
    guess: Mapping[str, float]
    length_scale: float
    limits: Mapping[str, Mapping[str, float]]
    system: Mapping[str, Any] | None  #: where the entries of the linear system of the method stand, if it solves one
    baumgarte: Sequence[float] | None
    dry_friction: Mapping[str, float]
    wrenches: Mapping[str, Any] | None
    start_parameters: Sequence[int]  #: on which assembled states depend, but for values of outputs and markers
    picture: Any
    simulation: Mapping[str, Any]
    sizes: Sizes  #: each an entry of its own
    output_accelerations: bool
    kernels: Mapping[str, Sequence[int]]  #: shapes by name
    sparsity: Mapping[str, Sequence[int]]  #: places, row by row, of entries of derivatives that do not vanish
    operations: Mapping[str, Mapping[str, Any]]  #: counts per block; hoisted work under ``precompute``
    abi: int = 0
    target: str = ""
    model_digest: str | None = None
    eomgen: str | None = None  #: the version that made it
    states: Sequence[str] = ()  #: of first order, the last of the velocities
    velocity_outputs: Sequence[str] = ()
    ranges: Sequence[Sequence[Any]] = ()  #: of single parameters: place in p, path, then as Allowed takes them
    rules: Sequence[Sequence[Any]] = ()  #: path, rule, its data, places in p, tape of the numbers judged
    coordinate_of: Sequence[int] | None = None  #: of each velocity of given equations, or -1
    independent_places: Sequence[str] = ()
    energy_known: bool = True
    row_groups: Sequence[int] = ()
    row_velocities: Sequence[Sequence[int]] | None = None  #: on which each constraint row depends
    not_finite_where: Mapping[str, str] = {}  #: force -> where its law has no number
    reaction_laws: Sequence[str] = ()  #: elements whose forces depend on reactions of joints
    switched: Mapping[str, str] = {}  #: constraint that closes and opens -> its state
    rows_to_hold: Sequence[Sequence[str]] = ()  #: label, state and kind of each of their equations
    latex: Mapping[str, str] = {}
    instances: Mapping[str, str] = {}  #: of components: name -> prefix of their names
    initial_outputs: Mapping[str, float] = {}
    start_fixed: Mapping[str, Sequence[int]] = {}  #: initial values that no tape can play
    start_terms: Mapping[str, Sequence[Any]] = {}  #: section -> names and tape
    start_slopes: Sequence[Any] = ((), ((), (), ()))  #: name and place in p of each derivative; tape
    limits_told: bool = True
    events: Sequence[Mapping[str, Any]] = ()
    resets: Sequence[Sequence[int]] = ()  #: event, and place in x of what it gives a value
    clocks: Sequence[Mapping[str, Any]] = ()
    translations: Sequence[Sequence[Any]] = ()  #: joint, the next one towards the ground, body, velocities
    signals: Mapping[str, Any] = {}  #: input over time -> tape
    signal_slopes: Mapping[str, Any] = {}
    input_rates: Mapping[str, Sequence[Sequence[Any]]] = {}
    constraint_inputs: Sequence[str] = ()
    contact_shapes: Sequence[Sequence[str]] = ()
    rigid_contacts: Mapping[str, Any] = {}
    rigid_by_motion: Mapping[str, Sequence[str]] = {}
    rigid_only: Sequence[str] = ()
    no_inertia: str = ""  #: why the model is for kinematics only
    indefinite: bool = False
    smooth: bool = False  #: no operation of its right-hand side, but of parameters alone, may jump or bend
    lanes: Sequence[str] = ()
    series: bool = False
    no_series: str = "its module was compiled without one, as with target='numpy'"
    start: Sequence[float] = ()  #: x at the start, of a package
    provenance: Mapping[str, Any] = {}
    printed: Mapping[str, Mapping[str, str]] = {}  #: of a package: form -> name -> how it is printed
    precision: str = ""
    files: Sequence[str] = ()

    def __init__(self, **entries: Any) -> None:
        names = type(self).__annotations__
        if odd := (names.keys() - vars(type(self)).keys() - entries.keys()) | (entries.keys() - names.keys()):
            raise bad_data(f"the model's metadata lacks entries, or has others: {', '.join(sorted(odd))}")
        vars(self).update({name: {} for name, value in vars(type(self)).items() if value == {}} | entries)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{name} of a model's metadata cannot be set: it is what model.json holds")

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> ModelInfo:
        """Read what model.json holds."""
        if data.get("abi") != ABI:
            raise bad_data(f"the model's metadata has layout {data.get('abi')}, and this version reads only {ABI}")
        try:
            sizes = Sizes(**{name: data[name] for name in Sizes._fields if name in data})
        except TypeError as error:
            raise bad_data(f"the model's metadata lacks entries: {error}") from None
        return cls(**{name: data[name] for name in cls.__annotations__ if name in data}, sizes=sizes)

    def to_dict(self) -> dict[str, Any]:
        """What model.json holds."""
        result: dict[str, Any] = {}
        for name in type(self).__annotations__:
            value, default = getattr(self, name), getattr(type(self), name, None)
            if name == "sizes":
                result |= value._asdict()
            elif not hasattr(type(self), name) or name in ALWAYS or (value != default and (value or default)):
                result[name] = value
        return result


# -- allowed parameters ------------------------------------------------------------------------------------------------


def refused_runs(info: ModelInfo, p: Array) -> dict[int, list[Problem]]:
    """The runs whose parameters, of (n_p, k), the model itself could not declare, and what is wrong with these.

    Values that are not finite are told by whatever computes with them, and rules without finite numbers judge nothing.
    Of many runs, one with a parameter out of its range is not judged by rules, which take long.
    """
    result: dict[int, list[Problem]] = {}

    def note(run: int, path: str, flaws: Sequence[Flaw], used: Sequence[int]) -> None:
        raw = ", ".join(f"{info.p_names[k]} = {p[k, run]:.6g}" for k in used[:6]) + ", ..." * (len(used) > 6)
        for flaw in flaws:
            one = Problem(path + flaw.key, f"{flaw.message} with {raw}", flaw.remedy, code="EG-RANGE")
            if one not in (problems := result.setdefault(run, [])):
                problems.append(one)

    for k, path, *data in info.ranges:
        for run in np.flatnonzero(~Allowed(*data[:4]).has(p[k]) & np.isfinite(p[k])).tolist():
            note(run, path, judge_range(p[k, run : run + 1], *data), [k])
    left = np.array([k for k in range(p.shape[1]) if k not in result or p.shape[1] == 1], dtype=int)
    for path, rule, data, used, tape in info.rules:
        for k, values in _to_look_at(rule, data, tape, p[:, left]):
            note(int(left[k]), path, RULES[rule](values, *data), used)
    return result


def _to_look_at(rule: str, data: Sequence[Any], tape: Any, p: Array) -> Iterator[tuple[int, Array]]:
    """The numbers of each run that may break a rule."""
    if rule in POINTS:
        points = POINTS[rule]()
        for k in range(p.shape[1]):
            yield k, _rows(play_arrays(tape, p[:, k], points), points.shape[1])
        return
    values = _rows(play_arrays(tape, p, np.empty((0, 1))), p.shape[1])
    open_ = np.isfinite(values).all(axis=0)
    if not open_.all():
        values = np.where(open_, values, 0.0)
    for k in np.flatnonzero(open_ & ~surely_right(rule, values, data)).tolist():
        yield k, values[:, k]


def _rows(result: Sequence[Any], count: int) -> Array:
    return np.array([np.broadcast_to(np.asarray(x, dtype=float), (count,)) for x in result])


def bounds_of(info: ModelInfo) -> dict[str, tuple[float, float]]:
    """The least and the greatest value of each parameter that is a number of an element by itself, as far as told."""
    result: dict[str, tuple[float, float]] = {}
    for k, _, low, high, *_ in info.ranges:
        least, most = result.get(info.p_names[k], (-np.inf, np.inf))
        least = least if low is None else max(least, low)
        result[info.p_names[k]] = (least, most if high is None else min(most, high))
    return result


# -- the layout --------------------------------------------------------------------------------------------------------


class Layout:
    """What a model calls its numbers, and in which order they lie.

    Parameters
    ----------
    metadata : str or mapping
        The JSON text of model.json, or what it holds.
    """

    #: where initial values follow from parameters: those bound later (n_p,), and which of these values are no numbers
    #: there and stay as declared, by section and name
    rebound: tuple[Array, dict[str, str]] | None = None

    def __init__(self, metadata: str | Mapping[str, Any]) -> None:
        #: what model.json holds, as public calls show it
        self.metadata: dict[str, Any] = json.loads(metadata) if isinstance(metadata, str) else dict(metadata)
        self.info = info = ModelInfo.of(self.metadata)
        self.sizes = sizes = info.sizes
        self.name = info.name
        self.q, self.v, self.x = tuple(info.q_names), tuple(info.v_names), tuple(info.x_names)
        self.u, self.p, self.y = tuple(info.u_names), tuple(info.p_names), tuple(info.y_names)
        self.bodies, self.loops = tuple(info.body_names), tuple(info.loop_names)
        self.a = tuple(acceleration_name(name) for name in self.v)
        self.loop_rates = tuple(f"{name}_dot" for name in self.loops)
        self.loop_accelerations = tuple(f"{name}_ddot" for name in self.loops)
        self.constraint_labels, self.fragile_forces = tuple(info.constraint_labels), tuple(info.fragile_forces)
        self.reaction_laws, self.states = tuple(info.reaction_laws), tuple(info.states)
        self.n_q, self.n_v, self.n_x, self.n_u, self.n_p, self.n_y, self.n_c, self.n_h, self.n_dof = sizes[:9]
        self.n_bodies, self.n_loop_coordinates, self.n_events = sizes.n_bodies, sizes.n_loop_coordinates, sizes.n_events
        self.n_held, self.n_states = sizes.n_held, sizes.n_states
        self.quaternion_slots = tuple((int(i), int(j)) for i, j in info.quaternion_slots)
        self.moving = self.n_v - self.n_states  #: velocities of the mechanism
        self.space = Space.of(self.n_v, self.quaternion_slots, self.n_states)
        self.velocity_labels = tuple(n[:-4] if n.endswith("_dot") and n[:-4] in self.q else n for n in self.v)
        #: rates of Euler parameters, which are in q' but not in v
        self.parameter_rates = tuple(f"{name}_dot" for i, _ in self.quaternion_slots for name in self.q[i : i + 4])
        raw = info.coordinate_of  # given equations name their velocities as they like
        if raw is not None:
            self.velocity_labels = tuple(n if k < 0 else self.q[k] for n, k in zip(self.v, raw, strict=True))
            self.parameter_rates = tuple(f"{name}_dot" for name in self.q if f"{name}_dot" not in self.v)
        #: whether q' = N(q, t) v + b(q, t) is given, beyond q' = v
        self.general_rates = raw is not None and list(raw) != list(range(self.n_q))
        self.energy_known = info.energy_known
        #: what has rates among the inputs: name -> (rate, how many times it is derived), in order.  It is an input
        #: itself, or stands in the equations by its rates only.
        self.input_rates: dict[str, list[tuple[str, int]]] = {
            name: [(str(rate), int(times)) for rate, times in rates] for name, rates in info.input_rates.items()
        }
        #: places in u of the inputs on which constraints depend
        self.constraint_inputs = [self.u.index(name) for name in info.constraint_inputs]
        self.signals = info.signals  #: declared for inputs that are not bound: name -> tape
        self.start_parameters = list(info.start_parameters)
        self.independent = np.array(info.independent, dtype=np.intp)
        self.rows = np.array(info.independent_rows, dtype=np.intp)
        self.rank = self.n_v - self.n_dof
        self.projects = info.baumgarte is None  #: whether rhs takes the projected state
        self.coordinate_kinds, self.velocity_kinds = tuple(info.coordinate_kinds), tuple(info.velocity_kinds)
        self.velocity_lengths = np.array([kind == "length" for kind in self.velocity_kinds], dtype=bool)
        self.length = float(info.length_scale or 1.0)
        rows = info.constraint_scales or info.constraint_kinds
        self.scales = Scales.of_kinds(self.velocity_kinds, rows, self.length, self.space)._replace(
            groups=np.array(info.row_groups, dtype=np.intp) if info.row_groups else None,
            known=_table(info.row_velocities, self.n_v) if info.row_velocities is not None else None,
        )
        self.row_lengths = np.array([kind == "length" for kind in info.constraint_kinds], dtype=bool)
        self.independent_moving = self.independent[self.independent < self.moving]  #: of the mechanism
        #: coordinates of the independent velocities, where each is the rate of one
        self.independent_q = self.scales.coordinates(self.independent)
        #: the scales of coordinates and holonomic rows, where they are not those of the velocities
        self.place_scales = (
            Scales.of_kinds(self.coordinate_kinds, rows[: self.n_h], self.length) if self.general_rates else self.scales
        )
        self.units, self.instances, self.loop_kinds = info.units, info.instances, tuple(info.loop_kinds)
        self.loop_angles = np.array([kind == "angle" for kind in self.loop_kinds], dtype=bool)
        self.loop_lengths = np.array([kind == "length" for kind in self.loop_kinds], dtype=bool)
        self.loop_scales = np.where(self.loop_lengths, self.length, 1.0)
        self.initial, self.initial_outputs, self.guess = map(dict, (info.initial, info.initial_outputs, info.guess))
        self.limits, self.switches = info.limits, info.switched
        self.q_reference = np.array(info.q_reference, dtype=float)
        self._allowed = b""  #: the last parameters that were allowed

    def sized(self, sizes: Array) -> Layout:
        """The same with typical sizes of velocities and constraint rows (n_v + n_c,) at parameters of other values.

        The length scale stays as declared where no velocity is one of length and no row is a gap; gaps that have sizes
        of their own change it in proportion.
        """
        s_q, s_c = sizes[: self.n_v], sizes[self.n_v :]
        if np.array_equal(s_q, self.scales.q) and np.array_equal(s_c, self.scales.c):
            return self
        result = copy(self)
        default = self.row_lengths & (self.scales.c == self.length)  # other rows have sizes of their own
        lengths = [*s_q[self.velocity_lengths], *s_c[default]]
        result.length = float(lengths[0]) if lengths else self.length
        if not lengths and self.scales.groups is not None and (self.scales.groups > 0).any():
            gap = int(np.argmax(self.scales.groups > 0))  # of a large loop, which grows with its links
            result.length = float(self.length * s_c[gap] / self.scales.c[gap])
        result.scales = self.scales._replace(q=s_q, c=s_c)
        result.place_scales = result.scales
        if self.general_rates:
            result.place_scales = Scales.of_kinds(self.coordinate_kinds, s_c[: self.n_h].tolist(), result.length)
        result.loop_scales = np.where(self.loop_lengths, result.length, 1.0)
        return result

    def without_signals(self, u: object) -> Layout:
        """The same where inputs that are bound, those of a mapping or all of an array, have no declared signals."""
        if u is None or not self.signals:
            return self
        bound = set(without_dots(u, self.instances) if isinstance(u, Mapping) else self.u)
        bound |= {rate for name in bound for rate, _ in self.input_rates.get(name, ())}
        result = copy(self)
        result.signals = {name: tape for name, tape in self.signals.items() if name not in bound}
        return result

    def require_minimal_form(self) -> None:
        """Refuse a model whose positions do not follow from as many coordinates as there are degrees of freedom."""
        turning = [self.v[i] for i in self.independent_moving if self.velocity_labels[i] == self.v[i]]
        if self.general_rates:
            reason = "the rates of its coordinates are given as functions of velocities"
        elif self.n_h < self.n_c:
            reason = "nonholonomic constraints restrict velocities but not positions"
        elif turning:
            reason = f"the independent {', '.join(turning)} are not rates of coordinates (rotation: euler_parameters)"
        else:
            return
        remedy = "work with the full state x = [q; v]: rhs, x0, simulate"
        if turning and not self.general_rates:
            remedy += "; or choose other independent coordinates, or rotation: euler_angles"
        raise cannot(f"model {self.name!r} has no minimal form: {reason}; {remedy}")

    def inputs(self, kernel: str) -> int:
        """Length of the vector x a kernel takes."""
        return NAMED[kernel].length(self.sizes)

    def shape(self, kernel: str) -> tuple[int, ...]:
        """Shape of a kernel's result for one state."""
        return NAMED[kernel].shape(self.sizes)

    def unit(self, name: str) -> str:
        """Unit of a quantity, derived for rates and accelerations; empty when unknown."""
        if name in self.units:
            return self.units[name]
        if name in ("T", "V", "energy") and name not in self.x + self.loops + self.y + self.u:
            return "J"
        for suffix, per in (("_ddot", "s^2"), ("_dot", "s")):
            base = name.removesuffix(suffix)
            if base != name and base in self.units:
                return f"{self.units[base]}/{per}"
        return "s" if name == "t" else ""

    @cached_property
    def names(self) -> frozenset[str]:
        """All names of numbers, bodies and joints."""
        rates = (*self.loop_rates, *self.a, *self.loop_accelerations, *self.parameter_rates, *self.velocity_labels)
        elements = (*self.bodies, *self.info.joint_names)
        return frozenset((*self.x, *self.loops, *self.u, *self.p, *self.y, *rates, *elements))

    def plain(self, name: Any) -> Any:
        """A name as the model has it: ``leg1_hip`` for ``leg1.hip`` of an instance of a component."""
        return plain_name(name, self.instances)

    def values(self, what: str, names: Sequence[str], raw: object, current: Array) -> Array:
        """A full vector from a mapping of names (the others keep their current values) or from an array."""
        if raw is None:
            return current
        if isinstance(raw, Mapping):
            raw = without_dots(raw, self.instances)
            check_names(what, raw, names)
            result = np.array(current, dtype=float)
            for name, value in raw.items():
                result[names.index(name)] = read_number(f"{what} {name}", value)
        else:
            result = read_numbers(f"the {what}s", raw)
        if result.shape != (len(names),):
            many = "; simulate_many and calls of states take a column of them for each" * (result.ndim == 2)
            wanted = f"({len(names)},) ({', '.join(names)})"
            raise ill_shaped(f"the {what}s must have shape {wanted}, not {result.shape}{many}")
        if what == "parameter":
            self.require_allowed(result)
        return result

    def require_allowed(self, p: Array) -> None:
        """Refuse parameters (n_p,) that elements do not allow; the same again at no cost."""
        raw = p.tobytes()
        if raw != self._allowed:
            if problems := refused_runs(self.info, p[:, None]).get(0):
                raise ParameterError(problems)
            self._allowed = raw


def _table(rows: Sequence[Sequence[int]], n: int) -> Any:
    """Which of n columns each row names (m, n)."""
    result = np.zeros((len(rows), n), dtype=bool)
    for row, columns in zip(result, rows, strict=True):
        row[list(columns)] = True
    return result


# -- initial values that follow from parameters ------------------------------------------------------------------------


NO_STATE = np.empty((0, 1))  #: initial values depend on parameters only
_SILENT: ContextVar[bool] = ContextVar("silent", default=False)


def at_parameters(layout: Layout, p: Array) -> Layout:
    """The same with initial values and guesses at parameters (n_p,) of other values.

    A value that is no number there stays as declared, with the other Euler parameters of its rotation, to tell the
    branch; :attr:`Layout.rebound` names it, and a start that is made of it is refused.
    """
    changed, undefined = copy(layout), dict[str, str]()
    changed.rebound = p, undefined
    rotations = [layout.q[i : i + 4] for i, _ in layout.quaternion_slots]
    for section, (names, tape) in layout.info.start_terms.items():
        values = dict(zip(names, map(float, play_arrays(tape, p, NO_STATE)), strict=True))
        for name in [name for name, value in values.items() if not np.isfinite(value)]:
            for other in next((four for four in rotations if name in four), (name,)):
                if values.pop(other, None) is not None:
                    undefined.setdefault(other, f"{section.partition('_')[0]}.{name}")
        setattr(changed, section, getattr(layout, section) | values)
    return changed


def warn_of_fixed(layout: Layout, p: Array, names: Iterable[str]) -> None:
    """Warn of initial values among these that call tables, if parameters (n_p,), or (n_p, k) of runs, are others."""
    fixed, declared = layout.info.start_fixed, layout.info.p_values
    for name in () if _SILENT.get() else names:
        places = fixed.get(name, ())
        if any((p[k] != declared[k]).any() for k in places):
            warnings.warn(
                f"the initial value of {name} calls a table or a function of the model, so it stays at the declared "
                f"parameters and does not follow {', '.join(layout.p[k] for k in places)}; give {name} for the run",
                stacklevel=calls_within() + 1,
            )


@contextmanager
def within(flag: ContextVar[bool]) -> Iterator[None]:
    """A context, in this thread, in which a flag is set."""
    token = flag.set(True)
    try:
        yield
    finally:
        flag.reset(token)


#: Within it :func:`warn_of_fixed` is silent: starts of many runs, of which the call that runs them warned once.
silent = partial(within, _SILENT)


def values_at(layout: Layout, p: Array) -> dict[str, Any]:
    """Initial values that follow from parameters, (n_p,) or (n_p, k) of k runs, each a number or an array (k,)."""
    names, tape = layout.info.start_terms.get("initial", ((), ((), (), ())))
    return dict(zip(names, play_arrays(tape, p, NO_STATE), strict=True))


def start_slopes(layout: Layout, p: Array) -> dict[str, Array]:
    """Derivatives (n_p,) of the initial values that follow from parameters, by name, at parameters (n_p,)."""
    places, tape = layout.info.start_slopes
    result: dict[str, Array] = {}
    for (name, k), slope in zip(places, play_arrays(tape, p, NO_STATE), strict=True):
        result.setdefault(name, np.zeros(len(p)))[k] = slope
    return result
