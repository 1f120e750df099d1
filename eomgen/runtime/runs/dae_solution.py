"""A model as differential-algebraic equations F(t, y, y') = 0, and a trajectory of them by IDA of SUNDIALS.

The stabilised form of index 2 (C. W. Gear, B. Leimkuhler, G. K. Gupta, Automatic integration of Euler-Lagrange
equations with constraints, J. Comput. Appl. Math. 12-13 (1985), 77-90): y = [q; v; l; m] with

    q' - N (v - S^2 C_q^T m) = 0        M v' + h + C_q^T l = 0        C = 0        C_q v + C_t = 0

where the corrections m of the holonomic rows are 0 in every solution, and S are the typical sizes of the velocities.

IDA (scikit-sundae) takes the steps of the loop that runs all methods; it starts anew, with consistent values, at the
corners of inputs and after what an event changes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base import algebra
from ...base.algebra import Array
from ...base.limits.runs import ATOL, RTOL
from ...errors import SimulationError, at_odds, cannot, ill_shaped, no_choice
from ..argument_checks import read_numbers, require, require_steps
from ..inputs import Forcing
from ..kernels import into
from ..refusals import require_support
from ..trajectory import Span, Start
from .bound_run import Run
from .events import Events
from .integrate import integrate, record
from .run_arguments import check_step, check_tolerances, find_state, ordered_times, set_up
from .simulate import complete

if TYPE_CHECKING:
    from ..bound_model import BoundModel
    from ..trajectory import Trajectory

UNCONTROLLED = 1e30  #: absolute tolerance of unknowns that the error test leaves out
STEPS = 1_000_000  #: at most, between two times wanted
RESERVED = ("eventsfn", "num_events", "jacfn", "userdata", "algebraic_idx")  #: options of IDA that are set here


class Dae:
    """The differential-algebraic form F(t, y, y') = 0 of a model, with a solver; of redundant constraints the
    independent rows alone.

    Attributes
    ----------
    y_names : tuple of str
        Of y = [q; v; l; m]: coordinates, velocities, multipliers ``lambda_<row>``, corrections ``mu_<row>``.
    n_y : int
    algebraic : (k,) array of int
        Entries of y whose rates are not in F: multipliers and corrections.
    """

    def __init__(self, module: BoundModel) -> None:
        layout = module.layout
        rows, holonomic = layout.rows, layout.rows[layout.rows < layout.n_h]
        first, n_c, n_h = layout.n_x, layout.n_c, layout.n_h
        states = np.arange(first)
        self._module, self._layout = module, layout
        self._unknowns = np.concatenate([states, first + rows, first + n_c + holonomic])
        self._equations = np.concatenate([states, first + holonomic, first + n_h + rows])
        self._n_full = first + n_c + n_h
        labels = layout.constraint_labels
        self.y_names = (
            *layout.x,
            *(f"lambda_{labels[i]}" for i in rows),
            *(f"mu_{labels[i]}" for i in holonomic),
        )
        self.n_y = len(self.y_names)
        self.algebraic = np.arange(first, self.n_y)
        self._residual = module.kernels.dae_residual
        self._jacobian = module.kernels.dae_jacobian

    def __repr__(self) -> str:
        return f"<differential-algebraic form of {self._module.name}: {self.n_y} equations>"

    def _full(self, y: ArrayLike, yp: ArrayLike, *more: float) -> Array:
        """[y; y'] of all rows, the redundant ones 0."""
        result = np.zeros(2 * self._n_full + len(more))
        for start, part, label in ((0, y, "y"), (self._n_full, yp, "yp")):
            raw = read_numbers(label, part)
            if raw.shape != (self.n_y,):
                raise ill_shaped(f"{label} must have shape ({self.n_y},), not {raw.shape}")
            result[start + self._unknowns] = raw
        result[2 * self._n_full :] = more
        return result

    def residual(
        self, t: float, y: ArrayLike, yp: ArrayLike, res: Array | None = None, u: ArrayLike | None = None
    ) -> Array:
        """F(t, y, y') (n_y,), written into ``res`` if it is given; u (n_u,) as bound by default."""
        return into(res, self._residual(t, self._full(y, yp), u=u)[self._equations])

    def jacobian(
        self,
        t: float,
        y: ArrayLike,
        yp: ArrayLike,
        cj: float = 0.0,
        out: Array | None = None,
        u: ArrayLike | None = None,
    ) -> Array:
        """dF/dy + cj dF/dy' (n_y, n_y), exact, written into ``out`` if it is given."""
        every = self._jacobian(t, self._full(y, yp, cj), u=u)
        return into(out, every[np.ix_(self._equations, self._unknowns)])

    def initial(self, x: ArrayLike | None = None, t: float = 0.0, u: ArrayLike | None = None) -> tuple[Array, Array]:
        """Consistent y and y' (n_y,) of a state x, the declared initial one by default; x is projected first.

        Rates of multipliers and corrections, which F does not hold, are 0.
        """
        module, layout = self._module, self._layout
        x = module.x0(t=t, u=u) if x is None else module.project(x, t=t, u=u)
        rates = module.rhs(t, x, u=u)
        y, yp = np.zeros(self.n_y), np.zeros(self.n_y)
        y[: layout.n_x], yp[: layout.n_x] = x, rates
        if len(layout.rows):
            q, v, a = x[: layout.n_q], x[layout.n_q :], rates[layout.n_q :]
            J = layout.scales.jacobian(module.kernels.constraint_jacobian(q, t=t, u=u))[layout.rows]
            force = layout.scales.q * module.kernels.inverse_dynamics(q, v, a, t=t, u=u)
            l = algebra.lstsq(J.T, -force, rcond=None)
            y[layout.n_x : layout.n_x + len(l)] = l / layout.scales.c[layout.rows]
        return y, yp

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
        for name in RESERVED:
            if name in options:
                raise at_odds(
                    f"dae.solve sets {name} of IDA itself, so it cannot be given; give events= as for simulate"
                )
        if not self.n_y:
            raise cannot(f"{module.name} has no unknowns that IDA could solve for; use simulate")
        bound, forcing, start, end = set_up(module, span, parameters, inputs)
        forcing.begin(start, end)
        tolerances: dict[str, Any] = {
            "rtol": check_tolerances(module.n_x, np.inf, {"rtol": rtol, "atol": atol})["rtol"],
            "atol": atol,
        }
        watched = Events(module.layout, events)
        x0 = find_state(bound, initial, start, forcing)
        times = None if t_eval is None else ordered_times(t_eval, start, end, self.n_y)
        if options.get("max_step"):
            require_steps("max_step", check_step("max_step", options["max_step"]), start, end)
        run = Run(bound, forcing)
        make = partial(_Steps, bound, forcing, end, partial(ida.IDA, **tolerances), options)
        nodes = [start, *forcing.corners(start, end), end]
        steps = partial(integrate, bound, forcing, nodes, x0, make, times, False, {}, watched, rates=run.watched(None))
        solution = complete(run, steps, (start, end), "IDA", tolerances, watched)
        return record(bound, forcing, solution, "IDA", tolerances, watched.names)


class _Steps:
    """Steps of IDA from a state to the next node, with the calls of SciPy's OdeSolver."""

    def __init__(
        self, module: BoundModel, forcing: Forcing, last: float, make: Any, options: Mapping[str, Any], _: Any,
        t: float, x: Array, end: float,
    ) -> None:  # fmt: skip
        form, run = Dae(module), Run(module, forcing)
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
        for _ in range(2):  # one call tells again where it was, after times before have been requested
            result = self.solver.step(self.t_bound, method="onestep", tstop=self.t_bound)
            self.nfev, self.njev = int(result.nfev), int(result.njev)
            if not result.success:
                self.status = "failed"
                return str(result.message)
            if float(result.t) != self.t:
                break
        else:
            raise SimulationError(f"IDA makes no progress at t = {self.t:.6g} s")
        self.t, self.y = float(result.t), np.array(result.y[: self.n_x])
        self.status = "finished" if self.t == self.t_bound else "running"
        return None

    def dense_output(self) -> Callable[[float], Array]:
        """The state at a time of the last step."""
        return lambda t: self.y if t == self.t else np.array(self.solver.step(t, method="normal").y[: self.n_x])
