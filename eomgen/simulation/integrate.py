"""Simulation: right-hand side, solver, corners of the inputs -> times, states and events, through SciPy.

Steps one of SciPy's solvers from corner to corner of tabulated inputs, so that none is stepped over, and from reset to
reset; what happens after a step is what the compiled loop does (steppers/loop.c).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..errors import SimulationError, no_choice
from ..runtime.near_names import require, unknown
from .event_crossings import Crossings, Step
from .events import RunEvent

if TYPE_CHECKING:
    from .stalling import StallCheck

KEPT = 10**7  #: numbers at most of the steps that are kept besides what t_eval asks for
METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")
NAMES = (*METHODS, "Taylor", "RK4", "moreau", "kinematic")  #: all that simulate knows


class Solution(NamedTuple):
    """What an integration came to."""

    t: Array  #: (n_t,)
    x: Array  #: (n_x, n_t)
    t_events: list[Array]
    x_events: list[Array]  #: (n_x, k) for each event
    dense: Callable[[Array], Array] | None
    status: int  #: SciPy's: 0 end reached, 1 terminal event, -1 failed
    message: str
    counts: dict[str, int]
    ends: tuple[float, float]  #: first and last time reached
    steps: tuple[Array, Array] | None = None  #: (k,), (n_x, k) of every step, where others are stored; k = 0: too many
    finite: bool = False  #: whether the states are known to be finite


class Interrupted(KeyboardInterrupt):
    """An interrupt inside an integration, with what there was.

    Parameters
    ----------
    solution : Solution
        The steps up to there.
    """

    def __init__(self, solution: Solution) -> None:
        super().__init__()
        self.solution = solution


class Joined:
    """Dense output of a run: that of each step, up to where the next one goes on."""

    def __init__(self, pieces: Sequence[tuple[float, Callable[[Array], Array]]], forward: bool) -> None:
        self.ends = np.array([end for end, _ in pieces])
        self.parts = [part for _, part in pieces]
        self.sign = 1.0 if forward else -1.0

    def __call__(self, t: Array) -> Array:
        """States (n_x, k) at times (k,)."""
        at = np.asarray(t, dtype=float)
        which = np.minimum(np.searchsorted(self.sign * self.ends, self.sign * at), len(self.parts) - 1)
        order = np.argsort(which, kind="stable")
        result: Array | None = None
        for places in np.split(order, np.flatnonzero(np.diff(which[order])) + 1):
            block = np.asarray(self.parts[int(which[places[0]])](at[places]))
            result = np.empty((block.shape[0], len(at))) if result is None else result
            result[:, places] = block
        return np.empty((0, 0)) if result is None else result


def choose_solver(method: Any) -> Any:
    """SciPy's class for a name, or the OdeSolver subclass itself."""
    scipy = require("scipy.integrate", "scipy", "simulate")
    if isinstance(method, str):
        if method not in METHODS:
            raise unknown("method", method, NAMES)
        return getattr(scipy, method)
    if isinstance(method, type) and issubclass(method, scipy.OdeSolver):
        return method
    raise no_choice(f"method must be one of {', '.join(METHODS)}, or a subclass of OdeSolver, not {method!r}")


def check_options(solver: Any, options: Collection[str], own: Collection[str]) -> None:
    """Refuse options that one of SciPy's own methods would only warn about.

    Parameters
    ----------
    solver : OdeSolver subclass
        One that is not SciPy's may take anything.
    options : names
    own : names
        Options of ``simulate`` itself, to suggest.

    Raises
    ------
    UsageError
    """
    from inspect import signature

    if not solver.__module__.startswith("scipy."):
        return
    taken = [*signature(solver.__init__).parameters]
    allowed = [name for name in taken if name not in ("self", "fun", "t0", "y0", "t_bound", "extraneous")]
    for name in options:
        if name not in allowed:
            raise unknown(f"option of simulate with {solver.__name__}", name, [*own, *allowed])


def takes_jacobian(solver: Any) -> bool:
    """Whether a solver class has an argument ``jac``."""
    from inspect import signature

    return "jac" in signature(solver.__init__).parameters


def integrate(
    rhs: Callable[[float, Array], Array],
    nodes: Sequence[float],
    x0: Array,
    solver: Any,
    t_eval: Array | None,
    events: Sequence[RunEvent],
    dense: bool,
    options: dict[str, Any],
    stall_check: StallCheck | None,
    reset: Callable[[float, Array, list[int]], Array] | None = None,
    enter: Callable[[float, float], None] | None = None,
) -> Solution:
    """Integrate over the parts between `nodes` (start, corners, end), and from each event that resets the state.

    Raises
    ------
    Crawling
        The steps lead nowhere, as `stall_check` finds.
    ZenoError
        Resets follow each other ever faster, or lead nowhere.
    Interrupted
        Ctrl-C.
    """
    journey = _Journey(rhs, nodes, x0, solver, t_eval, events, dense, options, stall_check)
    try:
        journey.travel(reset, enter)
    except KeyboardInterrupt as interrupt:
        journey.status, journey.message = -1, MESSAGES[-1]
        raise Interrupted(journey.solution()) from interrupt
    finally:
        if enter is not None:
            enter(nodes[0], nodes[-1])  # who asks for inputs from here on asks for those of the whole run
    return journey.solution()


MESSAGES = {
    0: "The solver successfully reached the end of the integration interval.",
    1: "A termination event occurred.",
    -1: "The run was interrupted.",
}


class _Journey:
    """One run on its way."""

    def __init__(
        self, rhs: Any, nodes: Sequence[float], x0: Array, solver: Any, t_eval: Array | None,
        events: Sequence[RunEvent], dense: bool, options: dict[str, Any], stall_check: StallCheck | None,
    ) -> None:  # fmt: skip
        self.rhs, self.nodes, self.solver, self.t_eval = rhs, nodes, solver, t_eval
        self.options, self.stall_check = options, stall_check
        self.t, self.x, self.forward = nodes[0], np.array(x0), nodes[-1] >= nodes[0]
        self.crossings = Crossings(events, rhs, nodes[0], nodes[-1]) if events else None
        self.pieces: list[tuple[float, Any]] | None = [] if dense else None
        self.walked: list[tuple[float, Array]] = []
        self.asked: list[Array] = []
        self.status, self.message = 0, MESSAGES[0]
        self.counts = {"nfev": 0, "njev": 0, "nlu": 0}
        self.kept = True

    def travel(
        self, reset: Callable[[float, Array, list[int]], Array] | None, enter: Callable[[float, float], None] | None
    ) -> None:
        """Go on to the end, a terminal event or a failure."""
        k, armed = 0, False
        self._keep()
        if self.t_eval is not None and self.t_eval.size and self.t_eval[0] == self.t:
            self.asked.append(self.x)
        while k < len(self.nodes) - 1:
            if enter is not None:
                enter(self.nodes[k], self.nodes[k + 1])
            if self.t == self.nodes[k + 1]:
                k += 1
                continue
            solver = self._start(self.nodes[k + 1])
            if self.crossings is not None and not armed:
                self.crossings.arm(self.t, self.x, self._length(solver))
                armed = True
            stop: tuple[float, bool] | None = None
            try:
                while stop is None and solver.status == "running":
                    message = solver.step()
                    if solver.status == "failed":
                        self.status, self.message = -1, str(message)
                        return
                    stop = self._settle(solver)
                    if stop is None and solver.status == "running" and self.stall_check is not None:
                        self.stall_check.look(self.t, self.x)
            finally:
                self._count(solver)
            if stop is None and self.t != self.nodes[k + 1]:
                return  # the solver ended by itself: require_end tells
            if stop is not None and stop[1]:
                self.status, self.message = 1, MESSAGES[1]
                return
            if stop is not None and self.crossings is not None:
                fired = list(self.crossings.fired)
                self.crossings.arrive(self.t, self.x, float(solver.t - solver.t_old))
                if reset is not None:
                    self.x = np.array(reset(self.t, self.x, fired), dtype=float)
                self._keep()
                self.crossings.depart(self.t, self.x)

    def _start(self, end: float) -> Any:
        options = dict(self.options)
        if options.get("first_step") is not None:
            options["first_step"] = min(options["first_step"], abs(end - self.t))
        if callable(jac := options.get("jac")):
            # both the function and the solver may change the state that they are given
            options["jac"] = lambda t, x: jac(t, x.copy())
        solver = self.solver(self.rhs, self.t, self.x.copy(), end, **options)
        if np.isnan(getattr(solver, "h_abs", 0.0)):  # with atol = 0 and a state of 0; SciPy would divide it for ever
            options["first_step"] = min(abs(end - self.t), options.get("max_step", np.inf))
            solver = self.solver(self.rhs, self.t, self.x.copy(), end, **options)
        return solver

    def _length(self, solver: Any) -> float:
        size = getattr(solver, "h_abs", None)
        return (1.0 if self.forward else -1.0) * float(size) if size else 0.0

    def _count(self, solver: Any) -> None:
        for key in self.counts:
            self.counts[key] += int(getattr(solver, key, 0) or 0)

    def _settle(self, solver: Any) -> tuple[float, bool] | None:
        """What a step brought: events, output."""
        t_old, t, x = float(solver.t_old), float(solver.t), np.array(solver.y)
        cache: list[Any] = []

        def between(at: Any) -> Array:
            if not cache:
                cache.append(solver.dense_output())
            if np.ndim(at) and not type(solver).__module__.startswith("scipy."):  # another's may take one time only
                return np.stack([np.asarray(cache[0](one)) for one in np.asarray(at).tolist()], axis=1)
            return np.asarray(cache[0](at))

        stop = None if self.crossings is None else self.crossings.find(Step(t_old, t, x, between, t - t_old))
        end = t if stop is None else stop[0]
        if self.t_eval is not None:
            sign = 1.0 if self.forward else -1.0
            first = len(self.asked)
            last = first + int(np.searchsorted(sign * self.t_eval[first:], sign * end, side="right"))
            for at in self.t_eval[first:last].tolist():
                self.asked.append(x if at == t and stop is None else between(at))
        if self.pieces is not None:
            between(t)
            self.pieces.append((end, cache[0]))
        self.t, self.x = end, x if stop is None else between(end)
        self._keep()
        return stop

    def _keep(self) -> None:
        """Store a step, or a state after a reset; not more than KEPT numbers besides what is asked for."""
        if self.t_eval is None or (self.kept and (len(self.walked) + 1) * (1 + len(self.x)) <= KEPT):
            self.walked.append((self.t, self.x))
        else:
            self.kept = False
            self.walked.clear()

    def solution(self) -> Solution:
        """All of it so far."""
        n, n_asked = len(self.x), len(self.asked)
        steps = _columns(self.walked, n)
        t, x = steps if self.t_eval is None else (self.t_eval[:n_asked], np.array(self.asked).reshape(n_asked, n).T)
        found = ([], []) if self.crossings is None else self.crossings.results(n)
        return Solution(
            t, x, *found, Joined(self.pieces, self.forward) if self.pieces else None, self.status, self.message,
            self.counts, (self.nodes[0], self.t), None if self.t_eval is None else steps,
        )  # fmt: skip


def require_end(solution: Solution, end: float) -> None:
    """Refuse a run that tells of its end without having come there; no run may end early in silence.

    Raises
    ------
    SimulationError
    """
    if solution.status == 0 and solution.ends[1] != end:
        raise SimulationError(
            f"the integrator reports the end, t = {end:.6g} s, but stopped at t = {solution.ends[1]:.6g} s; this is "
            "a fault of the integrator (of eomgen, unless the method is your own); run in parts, or use another method"
        )


def _columns(walked: Sequence[tuple[float, Array]], n: int) -> tuple[Array, Array]:
    """Times (k,) and states (n, k) of steps."""
    return np.array([t for t, _ in walked]), np.array([x for _, x in walked]).reshape(len(walked), n).T
