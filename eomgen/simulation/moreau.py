"""A run with rigid contacts by steps of one size -> Trajectory, with mean forces over the steps."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..base.limits.contacts import ITERATIONS, SOLVED
from ..base.limits.runs import SAME
from ..base.texts import shown
from ..base.value_rules import as_count
from ..errors import EvaluationError, SimulationError, calls_within, cannot, ill_typed, incomplete, off_range, untrue
from ..runtime.argument_checks import check_names, read_number, require_room, require_steps, unknown
from ..runtime.columns import Columns
from ..runtime.inputs import Forcing
from ..runtime.trajectory import Span, Start, Trajectory
from .bound_run import watch_run
from .events import Events, is_told_by_the_caller
from .integrate import Solution
from .meetings import deep_start
from .recording import record
from .rigid_steps import RigidSteps
from .run_arguments import check_step, find_span, find_state, ordered_times

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


# -- the trajectory ----------------------------------------------------------------------------------------------------


MEANS = {"normal": "N", "friction": "N"}  #: columns of each of the contacts between groups, and their units


class RigidRun(Trajectory):
    """A motion with rigid contacts: a :class:`~..runtime.trajectory.Trajectory` with the mean forces of steps.

    Columns beside the others are ``normal(track)``, the sum of the normal forces of contacts ``track``, and
    ``friction(track)``, the sum of the sizes of their friction forces (N): means over the step that ends at each time.

    Attributes
    ----------
    contact_forces : ContactForces
        These and, of runs with ``contact_forces=True``, single contacts and forces on bodies.  Pickles have it; of
        saved runs the columns remain.
    """

    contact_forces: ContactForces

    @classmethod
    def of(cls, parts: tuple[Any, ...], forces: ContactForces) -> RigidRun:
        """Make the run from the parts of a Trajectory and the forces."""
        run = cls(*parts)
        run.contact_forces = forces
        return run

    @classmethod
    def beside(cls, run: Trajectory, forces: ContactForces) -> RigidRun:
        """The same run with forces."""
        columns = ColumnsWithForces(cast("Columns", run.columns), forces)
        header = run._header | {"units": run.units | columns.units}
        return cls.of((run.t, run.x, columns, header, (), (), run._sample, run._described), forces)

    def __reduce__(self) -> tuple[Any, ...]:
        _, parts = super().__reduce__()
        return type(self).of, (parts, self.contact_forces)


class ColumnsWithForces(Columns):
    """The columns of a run, and behind them those of its contact forces."""

    def __init__(self, others: Columns, forces: ContactForces) -> None:
        super().__init__(others.module, others.t, others.x, others.u, others._steps)
        own = {f"{what}({name})": (what, name) for name in forces.names for what in MEANS}
        self.forces, self._own = forces, {name: what for name, what in own.items() if name not in self.names}
        self.names = (*self.names, *self._own)
        self.units = {name: MEANS[what] for name, (what, _) in self._own.items()}

    def __getitem__(self, name: str) -> Array:
        if name not in self._own:
            return super().__getitem__(name)
        what, contacts = self._own[name]
        found: Array = getattr(self.forces, what)(contacts)
        return found


# -- mean forces -------------------------------------------------------------------------------------------------------


class ContactForce(NamedTuple):
    """The mean force of one contact over one step."""

    contacts: str  #: name of the contacts between groups
    first: str  #: the first shape
    second: str  #: the second shape, on which the force acts; the opposite one acts on the first
    first_body: str  #: name of its body, or ground
    second_body: str
    point: Array  #: (3,) where it acts (m), ground axes, in the middle of the step
    normal: Array  #: (3,) from the first shape to the second, ground axes
    force: Array  #: (3,) (N) on the second shape, ground axes
    pressing: float  #: (N) its part along the normal
    friction: float  #: (N) the size of its part across the normal


class ContactForces:
    """Mean forces of rigid contacts over the steps of a run by method moreau: impulses over the size of the step.

    Forces of rigid contacts are impulses at times; their mean over a step is what the scheme knows of them.  Times a
    step, all of them together with the other forces change the momentum of bodies exactly as the run did.

    Attributes
    ----------
    names : tuple of str
        The contacts between groups.
    t : (n_t,) array
        The times at which the run is stored.  Values there are of the step that ends at this time, or has it within; at
        the start of the run, of the first step.
    """

    def __init__(
        self,
        known: Mapping[str, Any],
        shapes: Sequence[Sequence[str]],
        t: Array,
        ends: Array,
        sums: Array,
        kept: Sequence[Array] | None,
    ) -> None:
        self.names = tuple(name for name, *_ in known["lists"])
        self.t, self._ends, self._sums, self._kept = t, ends, sums, kept
        self._shapes, self._bodies = shapes, known["bodies"]
        self._steps = np.clip(np.searchsorted(ends, t), 0, max(len(ends) - 1, 0))

    def _of(self, name: str, row: int) -> Array:
        if name not in self.names:
            raise unknown("contacts", name, self.names)
        return self._sums[self.names.index(name), row, self._steps] if len(self._ends) else np.zeros(len(self.t))

    def normal(self, name: str) -> Array:
        """The sum of normal forces (N) of contacts, (n_t,)."""
        return self._of(name, 0)

    def friction(self, name: str) -> Array:
        """The sum of the sizes of friction forces (N) of contacts, (n_t,)."""
        return self._of(name, 1)

    def count(self, name: str) -> Array:
        """How many contacts press, (n_t,)."""
        return self._of(name, 2)

    def on(self, body: str, contacts: str | None = None) -> Array:
        """Force (N) and moment about the origin of ground (N m) of contacts on a body, ground axes, (6, n_t).

        Parameters
        ----------
        body : str
            Its name, or ``"ground"``.
        contacts : str, optional
            Only those of this name.

        Raises
        ------
        UsageError
            The run was made without ``contact_forces=True``; the body has no shape in contacts.
        """
        kept = self._single()
        if body not in self._bodies:
            raise unknown("body with shapes in contacts", body, sorted(set(self._bodies)))
        if contacts is not None and contacts not in self.names:
            raise unknown("contacts", contacts, self.names)
        mine = np.array([one == body for one in self._bodies])
        if contacts is not None:
            mine &= np.array([name == contacts for name, _ in self._shapes])
        found = np.zeros((6, len(kept)))
        for k, rows in enumerate(kept):
            first, second = rows[:, 0].astype(int), rows[:, 1].astype(int)
            force = forces_on_second(rows)
            part = (mine[second] * 1.0 - mine[first] * 1.0)[:, None] * np.concatenate(
                [force, np.cross(rows[:, 8:11], force)], axis=1
            )
            found[:, k] = part.sum(axis=0)
        return found[:, self._steps] if len(kept) else np.zeros((6, len(self.t)))

    def at(self, t: float) -> list[ContactForce]:
        """All contacts of the step that ends at a time, or has it within.

        Raises
        ------
        UsageError
            The run was made without ``contact_forces=True``; the time is not within the run.
        """
        kept, time = self._single(), read_number("t", t)
        if not len(kept) or not self.t[0] <= time <= self._ends[-1]:
            raise off_range(f"t must be a time of the run, from {self.t[0]:.6g} to {self.t[-1]:.6g} s, not {time:.6g}")
        rows = kept[min(int(np.searchsorted(self._ends, time)), len(kept) - 1)]
        found = []
        for row, force in zip(rows, forces_on_second(rows), strict=True):
            first, second = int(row[0]), int(row[1])
            (name, one), (_, other) = self._shapes[first], self._shapes[second]
            ends = self._bodies[first], self._bodies[second]
            across = float(np.hypot(row[12], row[13]))
            found.append(ContactForce(name, one, other, *ends, row[8:11], row[2:5], force, float(row[11]), across))
        return found

    def _single(self) -> Sequence[Array]:
        if self._kept is None:
            raise cannot("single contacts of this run were not kept: simulate with contact_forces=True")
        return self._kept


def forces_on_second(rows: Array) -> Array:
    """Forces (m, 3) on second shapes, of contacts (m, 14) with forces in place of impulses."""
    normal, first = rows[:, 2:5], rows[:, 5:8]
    return np.asarray(rows[:, 11:12] * normal + rows[:, 12:13] * first + rows[:, 13:14] * np.cross(normal, first))


class ForceSums:
    """What is added up of the contacts of each step.

    Parameters
    ----------
    lists : sequence of (str, int, int)
        Name, numbers and shapes of each contact between groups.
    steps : int
    keep : bool
        Keep single contacts as well.
    """

    def __init__(self, lists: Sequence[tuple[str, int, int]], steps: int, keep: bool) -> None:
        self.starts = np.cumsum([count for *_, count in lists])
        self.sums = np.zeros((len(lists), 3, steps))
        self.kept: list[Array] | None = [] if keep else None

    def add(self, k: int, parts: list[Array], h: float) -> None:
        """The contacts of step k, of its parts where it was divided; the list is emptied."""
        rows = parts[0] if len(parts) == 1 else np.concatenate(parts)
        parts.clear()
        rows[:, 11:] /= h
        if len(rows):
            group = np.searchsorted(self.starts, rows[:, 0], side="right")
            across = np.hypot(rows[:, 12], rows[:, 13])
            n = len(self.starts)
            self.sums[:, 0, k] = np.bincount(group, rows[:, 11], n)
            self.sums[:, 1, k] = np.bincount(group, across, n)
            self.sums[:, 2, k] = np.bincount(group, rows[:, 11] > 0.0, n)
        if self.kept is not None:
            self.kept.append(rows)


# -- the run -----------------------------------------------------------------------------------------------------------


NAME = "moreau"
OWN = ("contact_tolerance", "contact_iterations", "contact_forces")


class ContactWarning(UserWarning):
    """A run by the method moreau has steps in which the laws of contact are not met as well as asked for."""


def step_rigidly(
    module: BoundModel,
    span: Span,
    initial: Start,
    parameters: Any,
    inputs: Mapping[str, Any] | None,
    method: Any,
    step: Any,
    t_eval: ArrayLike | None,
    events: Any,
    progress: bool | None,
    options: Mapping[str, Any],
) -> RigidRun:
    """The motion of a mechanism whose contacts between groups are rigid.

    Raises
    ------
    UsageError
        No contacts, no step, options of other methods, shapes deep in each other at the start.
    SimulationError
        A state is not finite, or more pairs are near than there is room for.
    """
    _require_it(module, method)
    given = {key: value for key, value in options.items() if value is not None and value is not False}
    check_names("option of method moreau", given, OWN, ("method", "step", "t_eval", "progress"))
    if step is None:
        raise incomplete("method moreau needs step=, the size of its steps (s), for example step=1e-3")
    h = check_step("step", step)
    tolerance = read_number("contact_tolerance", given.get("contact_tolerance", SOLVED))
    if not tolerance > 0.0:
        raise off_range(f"contact_tolerance must be greater than 0, not {tolerance:.6g}")
    iterations = as_count(given.get("contact_iterations", ITERATIONS))
    if iterations is None or iterations < 1:
        raise off_range(f"contact_iterations must be a whole number from 1, not {given['contact_iterations']}")
    keep = given.get("contact_forces", False)
    if keep is not True and keep is not False:
        raise ill_typed(f"contact_forces must be True or False, not {shown(keep)}")
    forcing = Forcing(module.layout, inputs)
    start, end = find_span(span, float(module.metadata.get("simulation", {}).get("end") or 10.0))
    if end < start:
        raise cannot("method moreau runs forwards only: impacts cannot be undone")
    require_steps("step", h, start, end)
    _require_no_others(module, events)
    bound = module.bind(parameters, forcing.constants) if parameters is not None or forcing.constants else module
    forcing.attach(bound)
    forcing.begin(start, end)
    stored = None if t_eval is None else ordered_times(t_eval, start, end, module.n_x)
    require_room("a run", (end - start) / h * (1 + module.n_x), "give a longer step, or run in parts")
    x = find_state(bound, initial, start, forcing)
    steps = RigidSteps(bound, forcing, tolerance, iterations)
    found = deep_start(bound, start, x, forcing(start, x) if forcing else None)
    if found is not None:
        raise untrue(
            f"{module.name} starts with shapes inside each other; {found}. Rigid shapes cannot: change the initial "
            "values, or put only shapes into groups that are apart"
        )
    watch = watch_run(start, end, progress)
    count = max(int(np.ceil((end - start) / h - SAME)), 0)
    times = np.minimum(start + h * np.arange(count + 1), end)
    times[-1] = end
    states = np.empty((module.n_x, count + 1))
    states[:, 0] = x
    sums = ForceSums(steps.contacts.lists, count, keep)
    n_q = module.n_q
    q, v = x[:n_q].copy(), x[n_q:].copy()
    try:
        for k in range(count):
            t = float(times[k])
            try:
                q, v = steps.step(t, q, v, float(times[k + 1]) - t)
            except EvaluationError as error:
                raise SimulationError(f"moreau stopped at t = {t:.6g} s of {end:.6g} s: {error}") from error
            if not (np.isfinite(q).all() and np.isfinite(v).all()):
                raise SimulationError(
                    f"moreau stopped at t = {t:.6g} s of {end:.6g} s: the state is not finite. Velocity-dependent and "
                    "stiff forces are taken explicitly: try a smaller step",
                    code="EG-NOT-FINITE",
                )
            states[:n_q, k + 1], states[n_q:, k + 1] = q, v
            sums.add(k, steps.acting, float(times[k + 1]) - t)
            if watch is not None:
                watch(t)
    finally:
        if watch is not None:
            watch.close()
    steps.finish()
    if steps.missed and not is_told_by_the_caller():
        warnings.warn(
            f"{steps.missed} of {steps.taken} steps leave a residual of the contact laws of up to {steps.residual:.3g} "
            f"m/s, more than contact_tolerance = {tolerance:.3g} of their velocities, after contact_iterations = "
            f"{iterations}: allow more iterations, or a larger tolerance",
            ContactWarning,
            stacklevel=calls_within() + 1,
        )
    counts: dict[str, Any] = {"nfev": 2 * steps.taken, "steps": steps.taken}
    counts |= {"contact_iterations": steps.iterations, "contacts": steps.most, "missed_steps": steps.missed}
    counts |= {"contact_residual": steps.residual, "penetration": steps.depth}
    ends = (start, end)
    told, found_states = (times, states) if stored is None else (stored, _between(times, states, stored))
    dense = partial(_between, times, states)
    solution = Solution(told, found_states, [], [], dense, 0, "The end of the span is reached.", counts, ends)
    asked = {"step": h, "contact_tolerance": tolerance, "contact_iterations": iterations, "contact_forces": keep}
    run = record(bound, forcing, solution, NAME, asked)
    about = module.metadata
    forces = ContactForces(about["rigid_contacts"], about["contact_shapes"], told, times[1:], sums.sums, sums.kept)
    return RigidRun.beside(run, forces)


def _between(times: Array, states: Array, wanted: Array) -> Array:
    """States at other times, linear in between."""
    return np.array([np.interp(wanted, times, row) for row in states])


def _require_no_others(module: BoundModel, events: Any) -> None:
    """Refuse what steps of one size do not see.

    Raises
    ------
    UsageError
    """
    if events is not None:
        raise cannot("method moreau watches no events; run without events=, or by another method")
    if module.layout.reaction_laws:
        names = ", ".join(module.layout.reaction_laws)
        raise cannot(f"method moreau has no friction by reactions of joints (here {names}); use another method")
    for name, of in module.metadata.get("rigid_by_motion", {}).items():
        raise cannot(
            f"friction or restitution of contact {name!r} depends on {', '.join(of)}; by method moreau it may "
            "depend on time, coordinates, parameters and inputs"
        )
    if Events(module.layout, None).resets:
        raise cannot(f"{module.name} has events that reset its state, which method moreau does not watch")
    if ends := [event["name"] for event in module.metadata.get("events", []) if event["terminal"]]:
        raise cannot(f"method moreau watches no events, and {', '.join(ends)} ends the run; leave it out here")


def _require_it(module: BoundModel, method: Any) -> None:
    """Refuse another method for a model with rigid contacts.

    Raises
    ------
    UsageError
    """
    if not isinstance(method, str) or method != NAME:
        names = module.metadata["rigid_only"]
        told = "" if method is None else f", not {method if isinstance(method, str) else shown(method)}"
        raise cannot(
            f"contacts {names[0]!r} have normal_law: rigid, which exerts impulses, not forces: run with "
            f"method='moreau' and step={told}, or choose another normal_law"
        )
