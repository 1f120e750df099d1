"""One integration of a module: its right-hand side for a solver, its progress, and the words when it fails."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from threading import Timer
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.algebra import Array
from ...base.limits.numbers import TINY
from ...base.limits.runs import (
    ENDLESS,
    ENOUGH,
    FEW,
    GROWN,
    HOPELESS,
    MOST_NUMBERS,
    MOST_STEPS,
    NOTICED,
    SCIPY_ATOL,
    SHORT,
    STEEP,
    STILL,
)
from ...errors import EvaluationError, SimulationError
from ..argument_checks import read_flag
from ..inputs import Forcing
from ..kernels import place

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..protocols import Call

# -- progress ----------------------------------------------------------------------------------------------------------


PATIENCE = 2.0  #: seconds before anything is shown
EVERY = 0.2  #: seconds between updates
STRIDE = 64  #: calls between looks at the clock
WIDTH = 72  #: characters of a line


_terminal: list[Any] = [None, False]  #: stderr at the last run, and whether it is a terminal


class Progress:
    """Shows how far a run has come in simulated time, in ``form``, once it has taken ``patience`` seconds."""

    def __init__(self, start: float, end: float, patience: float = PATIENCE, form: str = "t = {:.4g} s") -> None:
        self.form = form
        self.start, self.length = start, end - start
        self.next = perf_counter() + patience
        self.calls = 0
        self.page: Any = None  #: where a notebook shows it
        self.open = False

    def __call__(self, t: float) -> None:
        """Tell that the integrator is at time t."""
        self.calls += 1
        if self.calls % STRIDE == 0:
            self.look(t)

    def look(self, t: float) -> None:
        """Show the time t if it is long enough since something was shown."""
        now = perf_counter()
        if now < self.next:
            return
        self.next = now + EVERY
        bar = _Bar(min(max((t - self.start) / self.length, 0.0), 1.0) if self.length else 1.0, self.form.format(t))
        if not self.open and in_notebook():
            self.page = sys.modules["IPython"].display.display(bar, display_id=True)
        self.open = True
        if self.page is not None:
            self.page.update(bar)
        else:
            print(f"\r{bar} ", end="", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Clean up."""
        if self.page is not None:
            self.page.update(_Bar(None, ""))
        elif self.open:
            print("\r" + " " * WIDTH + "\r", end="", file=sys.stderr, flush=True)


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """Say on stderr what a call does, once it has taken a while."""
    timer = Timer(PATIENCE, lambda: print(f"eomgen: {what} ...", file=sys.stderr, flush=True))
    timer.daemon = True
    if wanted(None):
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


class _Bar:
    """A bar as terminals and notebooks show it; nothing without a part."""

    def __init__(self, part: float | None, form: str) -> None:
        self.part, self.form = part, form

    def __repr__(self) -> str:
        if self.part is None:
            return ""
        return f"simulating [{'#' * round(24 * self.part):<24}] {100 * self.part:3.0f} %  {self.form}"

    def _repr_html_(self) -> str:
        if self.part is None:
            return ""
        return f"simulating <progress value='{self.part:.4f}' max='1'></progress> {100 * self.part:.0f} % {self.form}"


def in_notebook() -> bool:
    """Whether this runs in the kernel of a notebook."""
    module = sys.modules.get("IPython")
    if module is None:
        return False
    shell = getattr(module, "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


def wanted(progress: bool | None) -> bool:
    """Whether to watch a run: as asked, or when stderr is a terminal or this is a notebook."""
    if progress is not None:
        return read_flag("progress", progress)
    if _terminal[0] is not sys.stderr:  # to ask takes as long as the start of a short run
        _terminal[:] = sys.stderr, sys.stderr.isatty()
    return _terminal[1] or in_notebook()


# -- steps that lead nowhere -------------------------------------------------------------------------------------------

# Next to a singular position, or where a force jumps, an integrator may go on for days in steps just above rounding.


WINDOW = 200  #: steps judged together
MANY = 100_000  #: steps left that a run may take at any stall_check
IN_PLACE = 1_000_000  #: steps left that it may take where nothing of it gets on, held between two sides of a jump
HALVED = 10  #: times that an interval is halved in which a rate jumps: a change that is not one shrinks to 1/1024
LEAST = 10.0  #: spacings of numbers at a time that a step has at least, in all methods of SciPy but LSODA
HINDERED = 0.1  #: part of what its rate says up to which a state that moves is held
REMEDY = (
    "look for a force that jumps (smooth it), a singular position, or very fast motions in a long run (try an "
    "implicit method, Radau)"
)


class StallCheck:
    """Watches how a run advances.

    A run crawls if its mean step would take more than ``MANY`` further steps and is less than ``SHORT`` of its span,
    while either the state stands still or it is at a known singularity: a short impact moves the state.  So it does if
    it would take more than ``IN_PLACE`` and is held where a rate jumps, as in sliding modes, and none of its states
    goes as its rate says; where others do, as they may end the sliding, it may take ``MOST_STEPS``.

    Of what follows the first state x (n_x,) in those looked at, as derivatives by parameters, nothing is judged; steps
    that the user's max_step keeps short are not a crawl.  ``troubled(t, x)`` says whether a state is at a known
    singularity, ``kept`` how many numbers the run keeps of each step.
    """

    def __init__(
        self, start: float, end: float, x: Array, n_q: int, max_step: float, troubled: Callable[[float, Array], bool],
        rhs: Callable[[float, Array], Array], kept: int = 0,
    ) -> None:  # fmt: skip
        self.start, self.taken, self.kept = start, 0, kept
        self.end, self.parts = end, (slice(n_q), slice(n_q, None))
        self.limit, self.shortest = SHORT * abs(end - start), 0.1 * max_step
        self.troubled, self.rhs = troubled, rhs
        self.steps = self.slow = 0
        self.t, self.x, self.most = start, x, GROWN * max(1.0, np.abs(x).max(initial=0.0))
        self.largest: Array | None = None  #: magnitude of each state at the windows before

    def look(self, t: float, x: Array, steps: int = 1) -> None:
        """Take note of so many further steps, the last of which came to x at t."""
        self.steps += steps
        self.taken += steps
        self._require_end(t)
        if self.steps < WINDOW:
            return
        x = x[: len(self.x)]
        step, moved = abs(t - self.t) / self.steps, np.abs(x - self.x)
        largest = np.abs(self.x) if self.largest is None else self.largest
        time = abs(t - self.t)
        self.t, self.x, self.steps = t, np.array(x), 0
        if self.end < self.start and np.abs(x).max(initial=0.0) > self.most:
            raise SimulationError(
                f"the motion grows without bound backwards in time, to {np.abs(x).max():.3g} at t = {t:.6g} s of "
                f"{self.end:.6g} s, as damped motions do; run forwards from an earlier start"
            )
        self.largest = np.fmax(largest, np.abs(self.x))
        if step > self.shortest or abs(self.end - t) < MANY * step:
            return
        still = np.concatenate([moved[part] <= STILL * self.largest[part].max(initial=0.0) for part in self.parts])
        crawl = Crawling(t, self.x, step)
        lost = step <= LEAST * np.spacing(abs(t))  # SciPy's LSODA goes on where the time does not
        if lost or (step <= self.limit and (still.all() or self.troubled(t, self.x))):
            raise crawl
        if abs(self.end - t) > IN_PLACE * step:
            self.slow += 1  # sliding is looked for in the 1st, 2nd, 4th, 8th ...: it takes 12 n_x + 1 evaluations
            if abs(self.end - t) > MOST_STEPS * step:
                moved[still] = 0.0
            if self.slow & (self.slow - 1) == 0 and slides(self.rhs, crawl, moved, time):
                raise crawl

    def _require_end(self, t: float) -> None:
        """Refuse to go on for ever, or to fill the memory."""
        if self.taken * self.kept > MOST_NUMBERS:
            raise SimulationError(
                f"the run has taken {self.taken} steps up to t = {t:.6g} s of {self.end:.6g} s, and more cannot be "
                "kept; give a shorter span, or in Python the times to store, t_eval",
                code="EG-TOO-LARGE",
            )
        wanted, gone = abs(self.end - t) * self.taken, abs(t - self.start)
        if (self.taken > ENOUGH and wanted > ENDLESS * gone) or (self.taken > FEW and wanted > HOPELESS * gone):
            more = abs(self.end - t) / max(abs(t - self.start), TINY) * self.taken
            raise SimulationError(
                f"the run has taken {self.taken} steps up to t = {t:.6g} s and needs {more:.1e} more to reach "
                f"t = {self.end:.6g} s, which would take too long; give a shorter span, or looser tolerances",
                code="EG-ENDLESS",
            )


def slides(rhs: Callable[[float, Array], Array], crawl: Crawling, moved: Array, time: float) -> bool:
    """Whether a run is held where a rate f(t, x) jumps, so that none of its states goes as its rate says.

    ``moved`` (n_x,) is what the states have changed in a ``time`` (s).
    """
    t, x = crawl.t, crawl.x
    with np.errstate(all="ignore"):
        f = np.array(rhs(t, x))
        rates, jumped = np.abs(f), False
        for j, size in enumerate(np.fmax(10.0 * crawl.step * np.abs(f), NOTICED * np.abs(x))):
            low, high = x.copy(), x.copy()
            low[j], high[j] = x[j] - size, x[j] + size
            below, above = np.array(rhs(t, low)), np.array(rhs(t, high))
            change = np.abs(above - below)
            if not np.isfinite(change).all():
                continue
            rates = np.fmax(rates, np.fmax(np.abs(below), np.abs(above)))
            i = int(np.argmax(change - NOTICED * rates))
            for _ in range(HALVED):
                middle = low + 0.5 * (high - low)
                between = np.array(rhs(t, middle))
                if abs(above[i] - between[i]) > abs(between[i] - below[i]):
                    low, below = middle, between
                else:
                    high, above = middle, between
            jumped = jumped or bool(abs(above[i] - below[i]) > 0.5 * change[i] > NOTICED * rates[i])
    return jumped and bool((moved <= HINDERED * time * rates).all())


def steepest(rhs: Callable[[float, Array], Array], crawl: Crawling, names: tuple[str, ...], atol: Any) -> str:
    """Which rate f(t, x) is steepest in which state where a run crawls, in words; empty if none is steep for the steps.

    The changes tried are no less than the absolute tolerance, nor than the motion of ten steps.
    """
    t, x = crawl.t, crawl.x
    result, form = 0.0, ""
    sizes = np.fmax(np.broadcast_to(atol, x.shape), 10.0 * crawl.step * np.abs(np.array(rhs(t, x))))
    sizes = np.fmax(sizes, NOTICED * np.abs(x))
    for j, size in enumerate(sizes):
        low, high = x.copy(), x.copy()
        low[j] -= size
        high[j] += size
        change = np.abs(np.array(rhs(t, high)) - np.array(rhs(t, low)))
        if not np.isfinite(change).all():
            continue
        slope = change / (2 * size)
        i = int(slope.argmax())
        if slope[i] * crawl.step > max(result * crawl.step, STEEP):
            result = slope[i]
            form = f"the rate of {names[i]} changes by {change[i]:.3g} where {names[j]} changes by {2 * size:.1g}"
    return form


# -- the end of such a run ---------------------------------------------------------------------------------------------


class Crawling(Exception):
    """Raised inside an integration whose steps, of a mean length (s), lead nowhere."""

    def __init__(self, t: float, x: Array, step: float) -> None:
        super().__init__(t, x, step)
        self.t, self.x, self.step = t, x, step


# -- the run -----------------------------------------------------------------------------------------------------------


#: States, and the part of a Jacobian's numbers that are not 0, from and up to which SciPy's sparse factors take less
#: time than its dense ones.  Measured on Jacobians of soil under wheels, ms: 0.9 and 0.4 at 192 states, 1.2 and
#: 1.4 at 300, 3.0 and 6.0 at 600, 8.4 and 42 at 1,212.
SPARSE_FROM, SPARSE_PART = 400, 0.05


class Run:
    """The right-hand side and Jacobian of one run, with NaN for recoverable failures."""

    def __init__(self, module: BoundModel, forcing: Forcing) -> None:
        self.module = module
        self.forcing = forcing
        self.tangent: Call | None = None
        self.last: tuple[str, int, float, Array] | None = None
        self.sparse: bool | None = False  #: whether solvers get sparse Jacobians; None: where the first is worth it

    @cached_property
    def kernel(self) -> Call:
        """The right-hand side."""
        return self.module.kernels.kernel("rhs", nan=True)

    def watched(self, watch: Progress | None) -> Callable[[float, Array], Array]:
        """f(t, x) for the solver."""
        kernel, forcing, varies = self.kernel, self.forcing, bool(self.forcing)

        def call(t: float, x: Array) -> Array:
            result = kernel(t, x, u=forcing(t, x) if varies else None)
            if kernel.failure is not None:
                self.remember("rhs", kernel)
            return result

        if watch is None:
            return call

        def reported(t: float, x: Array) -> Array:
            watch(t)
            return call(t, x)

        return reported

    def begin(self, start: float, end: float, x: Array, longest: float, kept: int) -> None:
        """Take what the check of steps that lead nowhere begins with."""
        self._first = (start, end, x, self.module.n_q, longest), kept

    @cached_property
    def stall_check(self) -> StallCheck:
        """What ends the run where its steps lead nowhere, made when first looked at."""

        first, kept = self._first
        return StallCheck(*first, self.troubled, lambda t, x: self.watched(None)(t, x), kept)

    def look(self, t: float, x: Array, steps: int = 1) -> None:
        """Take note of further steps."""
        self.stall_check.look(t, x, steps)

    def remember(self, name: str, kernel: Call) -> None:
        """Keep a failure as the cause, unless its state came out of an earlier failure as NaN."""
        if kernel.failure is not None and (self.last is None or np.isfinite(kernel.failure[2]).all()):
            self.last = (name, *kernel.failure)
        kernel.failure = None

    def jacobian(self, t: float, x: Array) -> Any:
        """d(x')/dx, inputs that depend on the state included; one of SciPy's sparse matrices where that is chosen."""
        if self.tangent is None:
            self.tangent = self.module.kernels.kernel("jacobian", nan=True)
        J = self.tangent(t, x, u=self.forcing(t, x)) if self.forcing else self.tangent(t, x)
        self.remember("jacobian", self.tangent)
        extra = self.forcing.jacobian(t, np.asarray(x), self.kernel)
        J = J if extra is None else J + extra
        if self.sparse is None:
            self.sparse = len(J) >= SPARSE_FROM and bool(np.count_nonzero(J) <= SPARSE_PART * J.size)
        if not self.sparse:
            return J
        from scipy.sparse import csc_matrix

        return csc_matrix(J)

    def cause(self) -> EvaluationError | None:
        """The last failure of a kernel as an exception."""
        if self.last is None:
            return None
        name, status, t, x = self.last
        u = self.forcing(t, x) if self.forcing else None
        if name == "rhs":  # compiled steps do not say which call it was
            name = "jacobian" if np.isfinite(self.kernel(t, x, u=u)).all() else name
            self.kernel.failure = None
        return self.module.kernels.fail.exception(name, status, t, x, None, u)

    def troubled(self, t: float, x: Array) -> bool:
        """Whether a state is at a singularity that can be named."""
        return self.module.kernels.fail.trouble(x, t) is not None

    def gave_up(self, crawl: Crawling, end: float, method: str, options: Mapping[str, Any]) -> SimulationError:
        """The error for a run whose steps led nowhere."""
        if self.troubled(crawl.t, crawl.x):
            return self.ended(crawl.t, end, method, "", crawl.x)
        names = self.module.x_names
        with np.errstate(all="ignore"):
            steep = steepest(self.watched(None), crawl, names, options.get("atol", SCIPY_ATOL))
        return SimulationError(
            f"{method} stopped at t = {crawl.t:.9g} s of {end:.6g} s{place(names, crawl.x)}: with steps "
            f"of {crawl.step:.1e} s on average it makes no progress{steep and ': '}{steep}; {REMEDY}"
        )

    def ended(self, t: float, end: float, method: str, form: str, x: Array | None = None) -> SimulationError:
        """The error for a run that stopped at time t, at state x if that is known."""
        cause = self.cause()
        trouble = None if x is None else self.module.kernels.fail.trouble(x, t)
        if trouble is not None:
            return SimulationError(f"{method} stopped near t = {t:.6g} s of {end:.6g} s: {trouble[0]}; {trouble[1]}")
        if self.forcing.lapse is not None and (cause is None or self.forcing.lapse.time == cause.time):
            return SimulationError(f"{method} stopped near t = {t:.6g} s of {end:.6g} s: {self.forcing.lapse}")
        if cause is None:
            return SimulationError(
                f"{method} stopped at t = {t:.6g} s of {end:.6g} s: {form} Try Radau, other "
                "tolerances, or look for a motion that grows without bound."
            )
        when = f"t = {cause.time:.6g} s" if cause.time is not None else f"t = {t:.6g} s"
        return SimulationError(f"{method} stopped near {when} of {end:.6g} s. Last failure: {cause}")


def watch_run(start: float, end: float, progress: bool | None) -> Progress | None:
    """What shows the progress of a run: if that is requested, or by default on a terminal."""
    return Progress(start, end, 0.0 if progress else PATIENCE) if wanted(progress) else None
