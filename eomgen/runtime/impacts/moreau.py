"""A run with rigid contacts by steps of one size -> Trajectory, with mean forces over the steps.

A step takes forces, impacts and friction at once, in C (eomgen/native/contacts).  The scheme is Moreau's midpoint rule
(J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, in Nonsmooth Mechanics and Applications,
1988, 1-82; V. Acary, B. Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008, section 10.1).  With the
position q_m = q + h/2 N v half a step on,

    M (v+ - v) + h b(q_m, (v + v+)/2) = J^T P + C^T L,      C(q+) v+ + C_t = 0,      q+ = q_m + h/2 N v+,

with M, J and C of the middle where nothing else is said, and the laws of rigid contact (eomgen_contacts.h) between
impulses P and velocities J v+. The normal velocity is to be at least -e times the one before where shapes
touch, and -g/h where they are a gap g apart and come to rest on each other (D. E. Stewart, J. C. Trinkle, An implicit
time-stepping scheme for rigid body dynamics with inelastic collisions and Coulomb friction, Int. J. Numer. Methods Eng.
39 (1996), 2673-2691). Where shapes land, an impact without rebound, they go on with a part of the whole impact,
friction and what else acts with it, after which they meet in the middle of the next step, where the rest follows: both
end as the impact at once. What is left of penetrations and of open loops is removed from the positions alone (V. Acary,
Projected event-capturing time-stepping schemes, Comput. Methods Appl. Mech. Eng. 256 (2013), 224-250).

Constraints hold for the velocities at the end of a step and push in the middle, as in SHAKE and its form by velocities
(J. P. Ryckaert, G. Ciccotti, H. J. C. Berendsen, J. Comput. Phys. 23 (1977), 327-341; H. C. Andersen, J. Comput. Phys.
52 (1983), 24-34): but for the closing of loops, of order h^3, a step read backwards is the same step, and loops are of
second order.  C(q+) is not formed: C v+ is aimed at what makes C(q+) v+ + C_t vanish, first at that with which the
constraints hold for the mean of v and v+, and contacts are solved again until they do not feel the difference.

Contacts are those that are near at q_m.  Before and after it bodies move at constant velocities, v and v+, and
``meeting_time`` says how long no two shapes that are apart meet, or go far beside their thickness.  A step whose halves
are longer is done in two.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from ...base.algebra import Array
from ...base.kernel_table import RECORD
from ...base.limits.impacts import HALVINGS, ITERATIONS, SOLVED
from ...base.limits.runs import SAME
from ...base.texts import quote
from ...base.value_rules import as_count
from ...errors import (
    EvaluationError,
    SimulationError,
    UsageError,
    calls_within,
    cannot,
    ill_typed,
    incomplete,
    off_range,
    untrue,
)
from ..argument_checks import check_names, read_number, require_size, require_steps, unknown
from ..inputs import Forcing
from ..kernels import LazyCore, eager
from ..runs.bound_run import watch_run
from ..runs.events import Events, is_inner_run
from ..runs.integrate import Solution, record
from ..runs.run_arguments import check_step, deep_start, find_state, ordered_times, set_up
from ..trajectory import Columns, Span, Start, Trajectory

if TYPE_CHECKING:
    from ..bound_model import BoundModel


# -- the trajectory ----------------------------------------------------------------------------------------------------


MEANS = {"normal": "N", "friction": "N"}  #: columns of each of the contacts between groups, and their units


class RigidRun(Trajectory):
    """A motion with rigid contacts: a :class:`~..trajectory.Trajectory` with the mean forces of steps.

    Columns beside the others are ``normal(track)``, the sum of the normal forces of contacts ``track``, and
    ``friction(track)``, the sum of the sizes of their friction forces (N): means over the step that ends at each time.

    Attributes
    ----------
    contact_forces : ContactForces
        These and, of runs with ``contact_forces=True``, single contacts and forces on bodies.  Pickles have it; of
        saved runs the columns remain.
    """

    BESIDES = ("contact_forces",)
    contact_forces: ContactForces

    @classmethod
    def beside(cls, run: Trajectory, forces: ContactForces) -> RigidRun:
        """The same run with forces."""
        columns = ColumnsWithForces(cast("Columns", run.columns), forces)
        header = run._header | {"units": run.units | columns.units}
        return cls.of((run.t, run.x, columns, header, (), (), run._sample, run._described), forces)


class ColumnsWithForces(Columns):
    """The columns of a run, and behind them those of its contact forces."""

    def __init__(self, others: Columns, forces: ContactForces) -> None:
        super().__init__(others.module, others.t, others.x, others.u, others._steps)
        columns = {f"{what}({name})": (what, name) for name in forces.names for what in MEANS}
        self.forces, self._columns = forces, {name: what for name, what in columns.items() if name not in self.names}
        self.names = (*self.names, *self._columns)
        self.units = {name: MEANS[what] for name, (what, _) in self._columns.items()}

    def __getitem__(self, name: str) -> Array:
        if name not in self._columns:
            return super().__getitem__(name)
        what, contacts = self._columns[name]
        result: Array = getattr(self.forces, what)(contacts)
        return result


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
        result = np.zeros((6, len(kept)))
        for k, rows in enumerate(kept):
            first, second = rows[:, 0].astype(int), rows[:, 1].astype(int)
            force = forces_on_second(rows)
            part = (mine[second] * 1.0 - mine[first] * 1.0)[:, None] * np.concatenate(
                [force, np.cross(rows[:, 8:11], force)], axis=1
            )
            result[:, k] = part.sum(axis=0)
        return result[:, self._steps] if len(kept) else np.zeros((6, len(self.t)))

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
        result = []
        for row, force in zip(rows, forces_on_second(rows), strict=True):
            first, second = int(row[0]), int(row[1])
            (name, one), (_, other) = self._shapes[first], self._shapes[second]
            ends = self._bodies[first], self._bodies[second]
            tangential = float(np.hypot(row[12], row[13]))
            result.append(ContactForce(name, one, other, *ends, row[8:11], row[2:5], force, float(row[11]), tangential))
        return result

    def _single(self) -> Sequence[Array]:
        if self._kept is None:
            raise cannot("single contacts of this run were not kept: simulate with contact_forces=True")
        return self._kept


def forces_on_second(rows: Array) -> Array:
    """Forces (m, 3) on second shapes, of contacts (m, 14) with forces in place of impulses."""
    normal, first = rows[:, 2:5], rows[:, 5:8]
    return np.asarray(rows[:, 11:12] * normal + rows[:, 12:13] * first + rows[:, 13:14] * np.cross(normal, first))


class ForceSums:
    """What is added up of the contacts of each step: by name, numbers and shapes of each contact between groups.

    ``keep`` keeps single contacts as well.
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
            tangential = np.hypot(rows[:, 12], rows[:, 13])
            n = len(self.starts)
            self.sums[:, 0, k] = np.bincount(group, rows[:, 11], n)
            self.sums[:, 1, k] = np.bincount(group, tangential, n)
            self.sums[:, 2, k] = np.bincount(group, rows[:, 11] > 0.0, n)
        if self.kept is not None:
            self.kept.append(rows)


# -- steps -------------------------------------------------------------------------------------------------------------


TOO_LONG, TOO_MANY, NO_LAW = 1, 5, 6  #: what became of a step: eomgen/native/contacts/eomgen_contacts.h
#: Kernels that a step calls; the last one where there is one.
SOURCES = (
    *("mass_matrix", "near_pairs", "motion_axes", "bias_apart"),
    *("constraint_jacobian", "velocity_constraints", "constraints", "meeting_time"),
)


class RigidSteps:
    """The steps of one run.

    Attributes
    ----------
    stepper : RigidStepper
        Tells how well contacts were solved.
    taken : int
        Steps, those among them that others were divided into.
    acting : list of (m, 14) arrays
        Contacts of steps since the list was emptied: both shapes, normal (3), first direction across it (3), point (3),
        impulses along the normal and across it (3), which act on the second shape.
    """

    def __init__(self, module: BoundModel, forcing: Forcing, tolerance: float, iterations: int) -> None:
        known = module.info.rigid_contacts
        self.module, self.taken = module, 0
        self.lists: list[tuple[str, int, int]] = [tuple(row) for row in known["lists"]]
        self.acting: list[Array] = []
        layout = module.layout
        moved = np.zeros((len(known["moved_by"]), layout.n_v))
        for shape, last in enumerate(known["moved_by"]):
            while last >= 0:
                moved[shape, last] = 1.0
                last = known["parents"][last]
        space = layout.space
        plain = (
            [(k, k) for k in range(layout.n_q)] if space is None else [*zip(space.plain_q, space.plain_v, strict=True)]
        )
        tables = {
            "rows": layout.rows,
            "plain": np.ravel(plain),
            "balls": np.ravel([] if space is None else space.quaternion_slots),
            "lists": np.ravel([(numbers, count) for _, numbers, count in self.lists]),
            "moved": moved,
        }
        facts = {
            "n_rows": layout.n_c,
            "n_c": len(layout.rows),
            "n_h": int(np.count_nonzero(layout.rows < layout.n_h)),
            "n_witnesses": sum(numbers for _, numbers, _ in self.lists),
        }
        sources, n_work = self._sources()
        signals, outside = ([], forcing) if forcing.foreign else (forcing.encode(), None)
        within = forcing.within or (-np.inf, np.inf)
        core: Any = eager(module.core)
        self.stepper = core.rigid_stepper(
            module.kernels.context, sources, n_work, facts, tables, tolerance, iterations, signals, outside, within
        )

    def _sources(self) -> tuple[dict[str, Any], int]:
        """Addresses and constants of the kernels, and the most numbers that one works on."""
        kernels, layout = self.module.kernels, self.module.layout
        bound, sources, n_work = kernels.context, {}, 0
        for name in SOURCES:
            core: Any = kernels.core
            if name not in core.names:
                if name != "meeting_time" and 0 not in layout.shape(name):
                    raise kernels.missing(name)
                continue
            core = core.having(name) if isinstance(core, LazyCore) and name not in core.core.names else eager(core)
            context = bound if core is eager(self.module.core) else core.context(bound.p, bound.u, UsageError)
            sources[name], n_work = (core.address(name), context.c), max(n_work, core.sizes["n_work"])
        return sources, n_work

    def step(self, t: float, x: Array, h: float, halvings: int = HALVINGS) -> None:
        """The state x (n_x,) a time h later, in place.

        Raises
        ------
        EvaluationError, UsageError, SimulationError
            A kernel fails, more pairs are near than there is room for, coefficients are out of range, or shapes pass
            each other in steps that are much shorter.
        """
        status = self.stepper.step(t, h, x, x)
        if status == 0:
            self.taken += 1
            self.acting.append(self.stepper.contacts_of_step())
        elif status != TOO_LONG:
            raise self._error(status, t + 0.5 * h, x)
        elif halvings:
            self.step(t, x, 0.5 * h, halvings - 1)
            self.step(t + 0.5 * h, x, 0.5 * h, halvings - 1)
        else:
            raise SimulationError(
                f"moreau stopped at t = {t:.6g} s: shapes move so fast that they may pass through each other even in "
                f"steps of {h:.3g} s; take a smaller step, and see whether the velocities are meant"
            )

    def _error(self, status: int, t: float, x: Array) -> Exception:
        """What is wrong in a step with the middle t."""
        k, near, friction, restitution = self.stepper.refused
        name, numbers, _ = self.lists[k]
        if status == TOO_MANY:
            return SimulationError(
                f"contacts {name!r}: {near} pairs of shapes are near each other at t = {t:.6g} s, and there is "
                f"room for {(numbers - 1) // RECORD}; leave out shapes that overlap others of their body, or put "
                "shapes that never meet into contacts of their own",
                code="EG-TOO-LARGE",
            )
        if status == NO_LAW:
            return off_range(
                f"contacts {name!r}: friction is {friction:.6g} and restitution {restitution:.6g}; friction is "
                "0 or greater, restitution from 0 to 1"
            )
        fail, n_q = self.module.kernels.fail, self.module.n_q
        if self.stepper.failure is None:  # an inertia has no factor
            return fail.exception("mass_matrix", 2, t, x[:n_q])
        failed, status, when, where, u = self.stepper.failure
        return fail.exception(failed, status, when, where[: self.module.layout.inputs(failed)], None, u)


# -- the run -----------------------------------------------------------------------------------------------------------


NAME = "moreau"
OPTIONS = ("contact_tolerance", "contact_iterations", "contact_forces")


class ContactWarning(UserWarning):
    """A run by the method moreau has steps in which the laws of contact are not met as exactly as requested."""


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
    """The motion of a mechanism whose contacts between groups are rigid."""
    _require_it(module, method)
    raw = {key: value for key, value in options.items() if value is not None and value is not False}
    check_names("option of method moreau", raw, OPTIONS, ("method", "step", "t_eval", "progress"))
    if step is None:
        raise incomplete("method moreau needs step=, the size of its steps (s), for example step=1e-3")
    h = check_step("step", step)
    tolerance = read_number("contact_tolerance", raw.get("contact_tolerance", SOLVED))
    if not tolerance > 0.0:
        raise off_range(f"contact_tolerance must be greater than 0, not {tolerance:.6g}")
    iterations = as_count(raw.get("contact_iterations", ITERATIONS))
    if iterations is None or iterations < 1:
        raise off_range(f"contact_iterations must be a whole number from 1, not {raw['contact_iterations']}")
    keep = raw.get("contact_forces", False)
    if keep is not True and keep is not False:
        raise ill_typed(f"contact_forces must be True or False, not {quote(keep)}")
    bound, forcing, start, end = set_up(module, span, parameters, inputs)
    if end < start:
        raise cannot("method moreau runs forwards only: impacts cannot be undone")
    require_steps("step", h, start, end)
    _require_no_others(module, events)
    forcing.begin(start, end)
    stored = None if t_eval is None else ordered_times(t_eval, start, end, module.n_x)
    require_size("a run", (end - start) / h * (1 + module.n_x), "give a longer step, or run in parts")
    x = np.array(find_state(bound, initial, start, forcing))
    steps = RigidSteps(bound, forcing, tolerance, iterations)
    result = deep_start(bound, start, x, forcing(start, x) if forcing else None)
    if result is not None:
        raise untrue(
            f"{module.name} starts with shapes inside each other; {result}. Rigid shapes cannot: change the initial "
            "values, or put only shapes into groups that are apart"
        )
    watch = watch_run(start, end, progress)
    count = max(int(np.ceil((end - start) / h - SAME)), 0)
    times = np.minimum(start + h * np.arange(count + 1), end)
    times[-1] = end
    states = np.empty((module.n_x, count + 1))
    states[:, 0] = x
    sums = ForceSums(steps.lists, count, keep)
    try:
        for k in range(count):
            t = float(times[k])
            try:
                steps.step(t, x, float(times[k + 1]) - t)
            except EvaluationError as error:
                raise SimulationError(f"moreau stopped at t = {t:.6g} s of {end:.6g} s: {error}") from error
            if not np.isfinite(x).all():
                raise SimulationError(
                    f"moreau stopped at t = {t:.6g} s of {end:.6g} s: the state is not finite. Velocity-dependent and "
                    "stiff forces are taken explicitly: try a smaller step",
                    code="EG-NOT-FINITE",
                )
            states[:, k + 1] = x
            sums.add(k, steps.acting, float(times[k + 1]) - t)
            if watch is not None:
                watch(t)
    finally:
        if watch is not None:
            watch.close()
    met = steps.stepper.figures
    if met["missed_steps"] and not is_inner_run():
        warnings.warn(
            f"{met['missed_steps']} of {steps.taken} steps leave a residual of the contact laws of up to "
            f"{met['contact_residual']:.3g} m/s, more than contact_tolerance = {tolerance:.3g} of their velocities, "
            f"after contact_iterations = {iterations}: allow more iterations, or a larger tolerance",
            ContactWarning,
            stacklevel=calls_within() + 1,
        )
    counts: dict[str, Any] = {"nfev": 2 * steps.taken, "steps": steps.taken, **met}
    ends = (start, end)
    stored_times, states_between = (times, states) if stored is None else (stored, _between(times, states, stored))
    dense = partial(_between, times, states)
    solution = Solution(stored_times, states_between, [], [], dense, 0, "The end of the span is reached.", counts, ends)
    settings = {"step": h, "contact_tolerance": tolerance, "contact_iterations": iterations, "contact_forces": keep}
    run = record(bound, forcing, solution, NAME, settings)
    info = module.info
    forces = ContactForces(info.rigid_contacts, info.contact_shapes, stored_times, times[1:], sums.sums, sums.kept)
    return RigidRun.beside(run, forces)


def _between(times: Array, states: Array, wanted: Array) -> Array:
    """States at other times, linear in between."""
    return np.array([np.interp(wanted, times, row) for row in states])


def _require_no_others(module: BoundModel, events: Any) -> None:
    """Refuse what steps of one size do not see."""
    if events is not None:
        raise cannot("method moreau watches no events; run without events=, or by another method")
    if module.layout.reaction_laws:
        names = ", ".join(module.layout.reaction_laws)
        raise cannot(f"method moreau has no friction by reactions of joints (here {names}); use another method")
    for name, of in module.info.rigid_by_motion.items():
        raise cannot(
            f"friction or restitution of contact {name!r} depends on {', '.join(of)}; by method moreau it may "
            "depend on time, coordinates, parameters and inputs"
        )
    if Events(module.layout, None).resets:
        raise cannot(f"{module.name} has events that reset its state, which method moreau does not watch")
    if ends := [event["name"] for event in module.info.events if event["terminal"]]:
        raise cannot(f"method moreau watches no events, and {', '.join(ends)} ends the run; leave it out here")


def _require_it(module: BoundModel, method: Any) -> None:
    """Refuse another method for a model with rigid contacts."""
    if not isinstance(method, str) or method != NAME:
        names = module.info.rigid_only
        stored_times = "" if method is None else f", not {method if isinstance(method, str) else quote(method)}"
        raise cannot(
            f"contacts {names[0]!r} have the law rigid, which exerts impulses, not forces: run with "
            f"method='moreau' and step={stored_times}, or choose another law"
        )
