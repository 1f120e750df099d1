"""The differential-algebraic form of a model -> a trajectory, by IDA of SUNDIALS (scikit-sundae).

IDA stops at every event, which its own root finding locates, and at the corners of inputs; it starts anew from there
with consistent values.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.runs import ATOL, RTOL
from ..errors import SimulationError, at_odds, calls_within, cannot, no_choice
from ..runtime.argument_checks import require, require_steps
from ..runtime.dae import DaeForm
from ..runtime.inputs import Forcing
from ..runtime.refusals import refuse_rigid
from ..runtime.trajectory import Span, Start
from .bound_run import Crawling, Run
from .events import GO_ON, UNWATCHED, Events, EventValues, Resets, instant, warn_of_unknown
from .integrate import Solution, require_end
from .recording import record
from .run_arguments import check_step, check_tolerances, find_span, find_state, ordered_times

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.trajectory import Trajectory

UNCONTROLLED = 1e30  #: absolute tolerance of unknowns that the error test leaves out
STEPS = 1_000_000  #: at most, between two times wanted
OWN = ("eventsfn", "num_events", "jacfn", "userdata", "algebraic_idx")  #: options of IDA that are set here


class Dae(DaeForm):
    """The differential-algebraic form F(t, y, y') = 0 of a model, with a solver."""

    def solve(
        self,
        span: Span = None,
        initial: Start = None,
        parameters: Any = None,
        inputs: Mapping[str, Any] | None = None,
        *,
        t_eval: Sequence[float] | Array | None = None,
        events: Any = None,
        rtol: float = RTOL,
        atol: float = ATOL,
        **options: Any,
    ) -> Trajectory:
        """Integrate F = 0 by IDA of SUNDIALS, with the exact Jacobian; needs scikit-sundae.

        Parameters
        ----------
        span, initial, parameters, inputs
            As for ``Module.simulate``; an input is a number, a table or a function of t and x.
        t_eval : times in order, optional
            IDA's own steps by default.
        events : optional
            As for ``Module.simulate``; IDA's root finding locates them, by changes of sign between its steps (give
            ``max_step`` where a value comes to zero and back), a reset or an impact starts it anew with consistent
            values, a terminal event ends the run.
        rtol, atol : float, optional
            Tolerances of coordinates and velocities; multipliers and corrections are not controlled.
        **options
            Further ones of ``sksundae.ida.IDA``, such as ``max_step`` or ``max_order``.

        Returns
        -------
        Trajectory
            Of states, projected as those of ``simulate`` are.

        Raises
        ------
        MissingDependencyError
            scikit-sundae is not installed.
        SimulationError
            IDA could not reach the end.
        ZenoError
            Events that reset the state follow each other ever faster.
        """
        tolerances = {"rtol": rtol, "atol": atol}
        return integrate_dae(self._module, span, initial, parameters, inputs, t_eval, events, tolerances, options)


def integrate_dae(
    module: BoundModel,
    span: Span,
    initial: Start,
    parameters: Any,
    inputs: Mapping[str, Any] | None,
    t_eval: Any,
    events: Any,
    tolerances: Mapping[str, Any],
    options: Mapping[str, Any],
) -> Trajectory:
    """One run; see :meth:`Dae.solve`."""
    refuse_rigid(module.layout, "dae.solve")
    ida = require("sksundae.ida", "scikit-sundae", "dae.solve")
    for name in OWN:
        if name in options:
            raise at_odds(f"dae.solve sets {name} of IDA itself, so it cannot be given; give events= as for simulate")
    if not DaeForm(module).n_y:
        raise cannot(f"{module.name} has no unknowns that IDA could solve for; use simulate")
    forcing = Forcing(module.layout, inputs)
    start, end = find_span(span, float(module.metadata["simulation"]["end"]))
    bound = module.bind(parameters, forcing.constants) if parameters is not None or forcing.constants else module
    forcing.attach(bound)
    forcing.begin(start, end)
    tolerances = {**tolerances, "rtol": check_tolerances(module.n_x, np.inf, tolerances)["rtol"]}
    watched = Events(module.layout, events)
    x0 = find_state(bound, initial, start, forcing)
    times = None if t_eval is None else ordered_times(t_eval, start, end, DaeForm(module).n_y)
    if options.get("max_step"):
        require_steps("max_step", check_step("max_step", options["max_step"]), start, end)
    elif "contact_shapes" in bound.metadata:
        warnings.warn(
            "IDA steps over contacts that are shorter than its steps; give max_step, less than the thickness of the "
            "thinner shape divided by the speed, or use simulate",
            stacklevel=calls_within() + 1,
        )
    run = _DaeRun(bound, forcing, watched, (start, end), times, partial(ida.IDA, **tolerances), options)
    try:
        run.travel(x0)
    except Crawling as crawl:
        raise run.run.gave_up(crawl, end, "IDA", dict(tolerances)) from None
    forcing.enter(start, end)
    warn_of_unknown([event.name for event in run.listed if not event.known])
    solution = run.solution()
    require_end(solution, end)
    return record(bound, forcing, solution, "IDA", dict(tolerances), watched.names)


class _DaeRun:
    """A run on its way, from one start of IDA to the next."""

    def __init__(
        self,
        module: BoundModel,
        forcing: Forcing,
        events: Events,
        span: tuple[float, float],
        times: Array | None,
        make: Any,
        options: Mapping[str, Any],
    ) -> None:
        self.module, self.forcing, self.events, self.span, self.times = module, forcing, events, span, times
        every = [(event, i) for i, event in enumerate(events.listed(module, forcing)) if event.direction != UNWATCHED]
        self.listed, self.index = [event for event, _ in every], [i for _, i in every]
        self.values = EventValues(self.listed)
        self.names = [events.names[i] for i in self.index]
        self.left = [event.terminal for event in self.listed]
        self.stops = [event.action != GO_ON or bool(event.terminal) for event in self.listed]
        rhs = module.kernels.timed("rhs")
        self.resets = Resets(self.listed, lambda t, x: rhs(t, x, u=forcing(t, x)), *span)
        self.make, self.options = make, options
        self.run = Run(module, forcing)
        self.t: list[Array] = []
        self.x: list[Array] = []
        self.t_events: list[list[float]] = [[] for _ in self.listed]
        self.x_events: list[list[Array]] = [[] for _ in self.listed]
        self.counts = {"nfev": 0, "njev": 0}
        self.status, self.message, self.reached = 0, "", span[1]

    def travel(self, x: Array) -> None:
        """Go on until the run ends."""
        t, end = self.span
        corners = self.forcing.corners(t, end)
        t_before, jumped = t, True
        x = self._begin(t, x)
        while not self.status and (t != end or jumped):
            upto = next((corner for corner in corners if (corner - t) * (end - t) > 0.0), end)
            if t == end:  # a reset at the very end
                self._store(np.array([t]), x[:, None], jumped)
                return
            t_before = t
            self.forcing.enter(t, upto)
            t, x, fired = self._part(t, x, upto, jumped)
            jumped = False
            if fired:
                after = self._happen(t, x, fired)
                jumped = after is not None and not np.array_equal(after, x)
                x = x if after is None else after
            elif t == t_before:
                raise SimulationError(f"IDA makes no progress at t = {t:.6g} s")

    def _begin(self, t: float, x: Array) -> Array:
        """The state after events whose value is zero at the start and does not leave it against their direction."""
        fired = []
        for e in np.flatnonzero(self.values(t, x) == 0.0).tolist():
            event = self.listed[e]
            if event.direction * self.resets.side(event, t, x) >= 0.0:
                fired.append(e)
        after = self._happen(t, x, fired) if fired else None
        if self.status:  # the start and the event, as simulate stores them
            times = np.array([t, t]) if self.times is None else self.times[self.times == t]
            self._store(times, np.repeat(x[:, None], len(times), axis=1), True)
        if after is None:
            return x
        if self.times is None or t in self.times:
            self._store(np.array([t]), x[:, None], True)
        return after

    def _part(self, t: float, x: Array, end: float, jumped: bool) -> tuple[float, Array, list[int]]:
        """Integrate to an event, or to the end of this part; the time and state there, and what happened."""
        form, forcing, n_x = DaeForm(self.module), self.forcing, self.module.n_x
        forcing.enter(t, end)
        self.run = Run(self.module, forcing)
        self.run.begin(t, self.span[1], x, float(self.options.get("max_step") or np.inf), 0)
        y, yp = form.initial(x, t, forcing(t, x))
        nodes = np.array([t, end])
        asked = np.empty(0)
        if self.times is not None:
            inside = (self.times - t) * (end - t) > 0.0
            asked = self.times[inside & ((end - self.times) * (end - t) >= 0.0)]
            nodes = np.unique(np.concatenate([nodes, asked]))
            nodes = nodes if end >= t else nodes[::-1]
            if len(nodes) == 2:  # IDA takes two times for the ends of its own steps
                nodes = np.insert(nodes, 1, 0.5 * (t + end))
        solver = self._solver(form)
        found = solver.solve(nodes, y, yp)
        self.counts["nfev"] += int(found.nfev)
        self.counts["njev"] += int(found.njev)
        if not found.success:
            reached = float(found.t[-1]) if len(found.t) else t
            raise SimulationError(f"IDA stopped at t = {reached:.6g} s of {self.span[1]:.6g} s: {found.message}")
        self.message = str(found.message)
        times, states = np.array(found.t, dtype=float), np.array(found.y, dtype=float)[:, :n_x].T.copy()
        at, last, fired = float(times[-1]), states[:, -1], []
        for row, time, state in zip(*self._rows(found), strict=True):
            happened = np.flatnonzero(row).tolist()
            here = np.array(state[:n_x], dtype=float)
            if any(self.stops[e] for e in happened):
                at, last, fired = float(time), here, happened
            else:
                self._note(float(time), here, happened)
        if self.times is not None:
            kept = np.isin(times, asked) | ((times == t) & np.isin(t, self.times))
            self._store(times[kept], states[:, kept], False)
        else:
            self._store(times, states, jumped)
        return at, last, fired

    @staticmethod
    def _rows(found: Any) -> tuple[Any, Any, Any]:
        """Which events happened, when, and the unknowns there."""
        return ((), (), ()) if found.i_events is None else (found.i_events, found.t_events, found.y_events)

    def _solver(self, form: DaeForm) -> Any:
        forcing, n_x, listed = self.forcing, self.module.n_x, self.listed

        def residual(t: float, y: Array, yp: Array, res: Array) -> None:
            self.run.look(t, y[:n_x])  # not of steps, but of what they are tried by
            form.residual(t, y, yp, res, forcing(t, y[:n_x]))

        def jacobian(t: float, y: Array, yp: Array, res: Array, cj: float, JJ: Array) -> None:
            form.jacobian(t, y, yp, cj, JJ, forcing(t, y[:n_x]))

        def values(t: float, y: Array, yp: Array, out: Array) -> None:
            out[:] = self.values(t, np.array(y[:n_x]))

        chosen: dict[str, Any] = {"max_num_steps": STEPS, "jacfn": jacobian, **self.options}
        if len(form.algebraic):
            chosen["algebraic_idx"] = form.algebraic.tolist()
        if listed:
            values.terminal = self.stops  # type: ignore[attr-defined]
            values.direction = [event.direction for event in listed]  # type: ignore[attr-defined]
            chosen |= {"eventsfn": values, "num_events": len(listed)}
        make, atol = self.make, np.full(form.n_y, float(self.make.keywords["atol"]))
        atol[form.algebraic] = UNCONTROLLED
        try:
            return make(residual, atol=atol, **chosen)
        except (TypeError, ValueError) as error:
            raise no_choice(f"IDA refuses an option of dae.solve: {error}") from None

    def _happen(self, t: float, x: Array, fired: list[int]) -> Array | None:
        """The state after events; None where it stays."""
        clocks = {clock["event"] for clock in self.module.metadata.get("clocks", [])}
        if clocks.intersection(
            self.index[e] for e in fired
        ):  # others of this instant, which IDA finds a rounding later
            due = np.flatnonzero(np.abs(self.values(t, x)) <= instant(t)).tolist()
            fired = sorted({*fired, *(e for e in due if self.index[e] in clocks)})
        self._note(t, x, fired)
        for e in fired:
            if self.left[e]:
                self.left[e] -= 1
                if not self.left[e]:
                    self.status, self.message = 1, f"event {self.names[e]} ended the run"
                    self.reached = t
        if self.status:
            return None
        changing = [self.index[e] for e in fired if self.listed[e].action != GO_ON]
        after = self.events.reset(self.module, self.forcing, t, x, changing) if changing else x
        self.resets.note(t, x, after, fired)
        return after if changing else None

    def _note(self, t: float, x: Array, fired: list[int]) -> None:
        for e in fired:
            self.t_events[e].append(t)
            self.x_events[e].append(x)

    def _store(self, t: Array, x: Array, jumped: bool) -> None:
        """Keep the points of a part, without its first where the last one ended there."""
        last = self.t[-1][-1] if self.t and self.t[-1].size else None
        skip = int(not jumped and bool(t.size) and last is not None and t[0] == last)
        self.t.append(t[skip:])
        self.x.append(x[:, skip:])

    def solution(self) -> Solution:
        """All of it."""
        n = self.module.n_x
        t, x = np.concatenate([np.empty(0), *self.t]), np.concatenate([np.empty((n, 0)), *self.x], axis=1)
        t_events, x_events = [np.empty(0)] * len(self.events), [np.empty((n, 0))] * len(self.events)
        for i, times, states in zip(self.index, self.t_events, self.x_events, strict=True):
            t_events[i], x_events[i] = np.array(times), np.array(states).reshape(-1, n).T
        ends = (self.span[0], self.reached)
        return Solution(t, x, t_events, x_events, None, self.status, self.message, self.counts, ends)
