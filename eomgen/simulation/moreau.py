"""Simulation: a run with rigid contacts by steps of one size -> Trajectory."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..base.limits.contacts import ITERATIONS, SOLVED
from ..base.limits.runs import SAME
from ..base.texts import shown
from ..base.value_rules import as_count
from ..errors import (
    EvaluationError,
    SimulationError,
    calls_within,
    cannot,
    ill_typed,
    incomplete,
    off_range,
    untrue,
)
from ..runtime.given_start import Span, Start
from ..runtime.near_names import check_names
from ..runtime.room import read_number, require_room, require_steps
from ..runtime.signals import Forcing
from .bound_run import watch_run
from .contact_forces import ContactForces, ForceSums
from .events import Events, is_told_by_the_caller
from .integrate import Solution
from .meetings import deep_start
from .recording import record
from .rigid_run import RigidRun
from .rigid_steps import RigidSteps
from .run_arguments import find_span, find_state, ordered_times
from .tolerances import check_step

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

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
    forcing.enter(start, end)
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
