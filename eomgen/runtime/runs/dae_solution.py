"""The differential-algebraic form of a model -> a trajectory, by IDA of SUNDIALS (scikit-sundae).

IDA takes the steps of the loop that runs all methods; it starts anew, with consistent values, at the corners of inputs
and after what an event changes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.algebra import Array
from ...base.limits.runs import ATOL, RTOL
from ...errors import SimulationError, at_odds, cannot, no_choice
from ..argument_checks import require, require_steps
from ..dae import DaeForm
from ..inputs import Forcing
from ..refusals import require_support
from ..trajectory import Span, Start
from .bound_run import Crawling, Run
from .events import Events
from .integrate import integrate, require_end
from .recording import record
from .run_arguments import check_step, check_tolerances, find_state, ordered_times, set_up

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..trajectory import Trajectory

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
            As for ``Module.simulate``; a reset or an impact starts IDA anew with consistent values.
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
        module = self._module
        require_support(module.layout, "dae.solve")
        ida = require("sksundae.ida", "scikit-sundae", "dae.solve")
        for name in OWN:
            if name in options:
                raise at_odds(
                    f"dae.solve sets {name} of IDA itself, so it cannot be given; give events= as for simulate"
                )
        if not DaeForm(module).n_y:
            raise cannot(f"{module.name} has no unknowns that IDA could solve for; use simulate")
        bound, forcing, start, end = set_up(module, span, parameters, inputs)
        forcing.begin(start, end)
        tolerances = {"rtol": check_tolerances(module.n_x, np.inf, {"rtol": rtol, "atol": atol})["rtol"], "atol": atol}
        watched = Events(module.layout, events)
        x0 = find_state(bound, initial, start, forcing)
        times = None if t_eval is None else ordered_times(t_eval, start, end, DaeForm(module).n_y)
        if options.get("max_step"):
            require_steps("max_step", check_step("max_step", options["max_step"]), start, end)
        run = Run(bound, forcing)
        make = partial(_Steps, bound, forcing, end, partial(ida.IDA, **tolerances), options)
        nodes = [start, *forcing.corners(start, end), end]
        try:
            solution, _, raised = integrate(
                bound, forcing, nodes, x0, make, times, False, {}, watched, rates=run.watched(None)
            )
            if raised is not None:
                raise raised
        except Crawling as crawl:
            raise run.gave_up(crawl, end, "IDA", dict(tolerances)) from None
        if solution.status < 0:
            raise SimulationError(f"IDA stopped at t = {solution.ends[1]:.6g} s of {end:.6g} s: {solution.message}")
        require_end(solution, end)
        return record(bound, forcing, solution, "IDA", dict(tolerances), watched.names)


class _Steps:
    """Steps of IDA from a state to the next node, with the calls of SciPy's OdeSolver."""

    def __init__(
        self, module: BoundModel, forcing: Forcing, last: float, make: Any, options: Mapping[str, Any], _: Any,
        t: float, x: Array, end: float,
    ) -> None:  # fmt: skip
        form, run = DaeForm(module), Run(module, forcing)
        run.begin(t, last, x, float(options.get("max_step") or np.inf), 0)
        self.t_old, self.t, self.y, self.t_bound, self.status = t, t, x, end, "running"
        self.nfev = self.njev = 0
        n_x = self.n_x = len(x)

        def residual(t: float, y: Array, yp: Array, res: Array) -> None:
            run.look(t, y[:n_x])  # not of steps, but of what they are tried by
            form.residual(t, y, yp, res, forcing(t, y[:n_x]))

        def jacobian(t: float, y: Array, yp: Array, res: Array, cj: float, JJ: Array) -> None:
            form.jacobian(t, y, yp, cj, JJ, forcing(t, y[:n_x]))

        chosen: dict[str, Any] = {"max_num_steps": STEPS, "jacfn": jacobian, **options}
        if len(form.algebraic):
            chosen["algebraic_idx"] = form.algebraic.tolist()
        atol = np.full(form.n_y, float(make.keywords["atol"]))
        atol[form.algebraic] = UNCONTROLLED
        try:
            self.solver = make(residual, atol=atol, **chosen)
        except (TypeError, ValueError) as error:
            raise no_choice(f"IDA refuses an option of dae.solve: {error}") from None
        self.solver.init_step(t, *form.initial(x, t, forcing(t, x)))

    def step(self) -> str | None:
        """Take one; what is wrong where it fails."""
        self.t_old = self.t
        for _ in range(2):  # one call tells again where it was, after times before have been asked for
            found = self.solver.step(self.t_bound, method="onestep", tstop=self.t_bound)
            self.nfev, self.njev = int(found.nfev), int(found.njev)
            if not found.success:
                self.status = "failed"
                return str(found.message)
            if float(found.t) != self.t:
                break
        else:
            raise SimulationError(f"IDA makes no progress at t = {self.t:.6g} s")
        self.t, self.y = float(found.t), np.array(found.y[: self.n_x])
        self.status = "finished" if self.t == self.t_bound else "running"
        return None

    def dense_output(self) -> Callable[[float], Array]:
        """The state at a time of the last step."""
        return lambda t: self.y if t == self.t else np.array(self.solver.step(t, method="normal").y[: self.n_x])
