"""Simulation: one integration of a module: its right-hand side for a solver, and the words when it fails."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.runs import SCIPY_ATOL
from ..errors import EvaluationError, SimulationError
from ..runtime.inputs import Forcing
from .stalling import Crawling

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.protocols import Timed
    from .progress import Progress
    from .stalling import StallCheck

#: States, and the part of a Jacobian's numbers that are not 0, from and up to which SciPy's sparse factors take less
#: time than its dense ones.  Measured on Jacobians of soil under wheels, ms: 0.9 and 0.4 at 192 states, 1.2 and
#: 1.4 at 300, 3.0 and 6.0 at 600, 8.4 and 42 at 1,212.
SPARSE_FROM, SPARSE_PART = 400, 0.05


class Run:
    """The right-hand side and Jacobian of one run, with NaN for recoverable failures."""

    def __init__(self, module: BoundModel, forcing: Forcing) -> None:
        self.module = module
        self.forcing = forcing
        self.tangent: Timed | None = None
        self.last: tuple[str, int, float, Array] | None = None
        self.sparse: bool | None = False  #: whether solvers get sparse Jacobians; None: where the first is worth it

    @cached_property
    def kernel(self) -> Timed:
        """The right-hand side."""
        return self.module.kernels.timed("rhs", nan=True)

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

        def told(t: float, x: Array) -> Array:
            watch(t)
            return call(t, x)

        return told

    def begin(self, start: float, end: float, x: Array, longest: float, kept: int) -> None:
        """Take what the check of steps that lead nowhere begins with."""
        self._first = (start, end, x, self.module.n_q, longest), kept

    @cached_property
    def stall_check(self) -> StallCheck:
        """What ends the run where its steps lead nowhere, made when first looked at."""
        from .stalling import StallCheck

        first, kept = self._first
        return StallCheck(*first, partial(_troubled, self.module), lambda t, x: self.watched(None)(t, x), kept)

    def look(self, t: float, x: Array, steps: int = 1) -> None:
        """Take note of further steps."""
        self.stall_check.look(t, x, steps)

    def remember(self, name: str, kernel: Timed) -> None:
        """Keep a failure as the cause, unless its state came out of an earlier failure as NaN."""
        if kernel.failure is not None and (self.last is None or np.isfinite(kernel.failure[2]).all()):
            self.last = (name, *kernel.failure)
        kernel.failure = None

    def jacobian(self, t: float, x: Array) -> Any:
        """d(x')/dx, inputs that depend on the state included; one of SciPy's sparse matrices where that is chosen."""
        if self.tangent is None:
            self.tangent = self.module.kernels.timed("jacobian", nan=True)
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
        return _troubled(self.module, t, x)

    def gave_up(self, crawl: Crawling, end: float, method: str, options: Mapping[str, Any]) -> SimulationError:
        """The error for a run whose steps led nowhere."""
        if self.troubled(crawl.t, crawl.x):
            return self.ended(crawl.t, end, method, "", crawl.x)
        from .stalling import describe_crawl, steepest

        with np.errstate(all="ignore"):
            steep = steepest(self.watched(None), crawl, self.module.x_names, options.get("atol", SCIPY_ATOL))
        return SimulationError(describe_crawl(crawl, self.module.x_names, end, method, steep))

    def ended(self, t: float, end: float, method: str, words: str, x: Array | None = None) -> SimulationError:
        """The error for a run that stopped at time t, at state x if that is known."""
        cause = self.cause()
        trouble = None if x is None else self.module.kernels.fail.trouble(x, t)
        if trouble is not None:
            return SimulationError(f"{method} stopped near t = {t:.6g} s of {end:.6g} s: {trouble[0]}; {trouble[1]}")
        if self.forcing.lapse is not None and (cause is None or self.forcing.lapse.time == cause.time):
            return SimulationError(f"{method} stopped near t = {t:.6g} s of {end:.6g} s: {self.forcing.lapse}")
        if cause is None:
            return SimulationError(
                f"{method} stopped at t = {t:.6g} s of {end:.6g} s: {words} Try an implicit method (Radau), other "
                "tolerances, or look for a motion that grows without bound."
            )
        when = f"t = {cause.time:.6g} s" if cause.time is not None else f"t = {t:.6g} s"
        return SimulationError(f"{method} stopped near {when} of {end:.6g} s. Last failure: {cause}")


def _troubled(module: BoundModel, t: float, x: Array) -> bool:
    return module.kernels.fail.trouble(x, t) is not None


def watch_run(start: float, end: float, progress: bool | None) -> Progress | None:
    """What shows the progress of a run: if that is asked for, or by default on a terminal."""
    shown, wanted = _progress()
    return shown(start, end, 0.0 if progress else 2.0) if wanted(progress) else None


@cache
def _progress() -> tuple[type[Progress], Callable[[bool | None], bool]]:
    """The class of what shows progress and the function that tells whether to, found once: a run starts with them."""
    from .progress import Progress, wanted

    return Progress, wanted
