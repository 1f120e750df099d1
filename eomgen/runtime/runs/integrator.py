"""Module and tolerances -> an integrator held ready: state at one time -> state at another."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.algebra import Array
from ...errors import EvaluationError, SimulationError, UsageError, cannot, ill_shaped, no_number, off_range
from ..argument_checks import both_names, check_names, read_plain, read_vector, require_steps
from ..inputs import Forcing
from ..kernels import eager
from ..refusals import refuse_moreau, require_support
from .bound_run import Crawling, Run, StallCheck
from .compiled import can_run, stepper_options
from .events import Events
from .integrate import RESET_FAILED, TOO_SMALL, choose_solver
from .run_arguments import check_method, check_tolerances, declare, declared_step
from .simulate import simulate

if TYPE_CHECKING:
    from ..bound_model import BoundModel

OPTIONS = ("method", "rtol", "atol", "max_step", "first_step", "step")


class Integrator:
    """Integrates from one state to another many times; everything that stays the same is checked only once.

    A call costs a microsecond or two besides the steps themselves, and no call depends on those before it.

    Parameters
    ----------
    module : BoundModel
        With parameters and inputs bound.
    method : str
        A method of :func:`~.simulate.simulate`.
    rtol : float
    atol : float or (n_x,) array
    max_step, first_step, step : float, optional
        As for :func:`~.simulate.simulate`.

    Attributes
    ----------
    module : BoundModel
    method : str

    Raises
    ------
    UsageError
        The module's events reset the state, which takes a run that watches them, or its drivers move all of it; values
        that cannot be.
    """

    def __init__(
        self,
        module: BoundModel,
        method: str,
        rtol: float,
        atol: Any,
        max_step: float | None = None,
        first_step: float | None = None,
        step: float | None = None,
    ) -> None:
        if not module.layout.n_dof:
            raise cannot(f"{module.name} has no degree of freedom to integrate; use simulate")
        if Events(module.layout, None).resets:
            raise cannot(f"events of {module.name} reset its state, and an integrator finds no events; simulate it")
        self._given = (module, method, rtol, atol, max_step, first_step, step)
        self.module, self.method = module, method
        self._step = check_method(method, step)
        sizes = {"max_step": max_step, "first_step": first_step} if step is None else {"max_step": self._step}
        self._options: dict[str, Any] = check_tolerances(module.n_x, np.inf, {"rtol": rtol, "atol": atol, **sizes})
        self._evaluations = 0
        self._compiled: Any = None
        if can_run(module, method, Forcing(module.layout, None)):
            settings = stepper_options(module.n_x, np.inf, self._options, checked=True)
            if step is not None:
                settings["first_step"] = self._step
            plan = {"nodes": [1.0], "t_eval": [], "dense": False, "events": None, "watch": None}
            make, nowhere = eager(module.core).integrator, np.zeros(module.n_x)
            self._compiled = make(method, module.kernels.context, 0.0, nowhere, 1.0, plan=plan, **settings)
            self._compiled.make_stall_check = self._stall_check
        else:
            choose_solver(method, "integrator")

    @both_names
    def __call__(
        self, t: float, x: ArrayLike, h: float, p: ArrayLike | None = None, u: ArrayLike | None = None,
        out: Array | None = None,
    ) -> Array:  # fmt: skip
        """The state at t + h of the motion through x at t.

        Parameters
        ----------
        t, h : float
            Time, and how long to go on (s); backwards if negative.
        x : (n_x,) array
            Brought onto the constraints before anything else.
        p, u : (n_p,) and (n_u,) arrays or mappings of names, optional
            Parameters, and inputs held over the whole call; those bound by default.
        out : (n_x,) array, optional
            Takes the result; it may be x.

        Returns
        -------
        (n_x,) array
            On the constraints.
        """
        try:
            if not (isinstance(t, float) and isinstance(h, float) and isfinite(t + h)):
                t, h = read_plain("t", t), read_plain("h", h)
            end = t + h
            if not isfinite(end):
                raise no_number(f"t + h must be finite, not {t} + {h}")
            if end == t and h != 0.0:
                raise off_range(f"h = {h} is too small at t = {t}: t + h equals t in double precision")
            if "max_step" in self._options:
                require_steps("max_step" if self._step is None else "step", self._options["max_step"], t, end)
            read, bound = self.module.kernels.fail.vector, self.module
            p, u = read("p", p, bound.p), read("u", u, bound.u)
            advance = self._plainly if self._compiled is None else self._compiled.advance
            result, trouble = advance(t, x, h, p, u, out, ill_shaped)
        except UsageError as error:
            raise UsageError(f"integrator of {self.module.name}: {error}", code=error.code) from None
        if trouble is not None:
            self._explain(trouble, result, end, p, u)
        return np.asarray(result)

    @property
    def evaluations(self) -> int:
        """Evaluations of the right-hand side in the last call; of its series, for Taylor."""
        return self._evaluations if self._compiled is None else int(self._compiled.evaluations)

    def _stall_check(self, t: float, end: float, x: Array) -> Callable[[float, Array, int], None]:
        """What watches the steps of a long call."""
        run = Run(self.module, Forcing(self.module.layout, None))
        longest = float(self._options.get("max_step", np.inf))
        return StallCheck(t, end, x, self.module.n_q, longest, run.troubled, run.watched(None)).look

    def _explain(
        self, trouble: tuple[int, float, Any, BaseException | None], x: Array, end: float, p: Any, u: Any
    ) -> None:
        """Raise the error for a call that came to x at t and no further."""
        status, t, failure, raised = trouble
        bound = self.module.bind(p, u)
        run = Run(bound, Forcing(bound.layout, None))
        run.last = None if failure is None else ("rhs", *failure)
        if isinstance(raised, Crawling):
            raise run.gave_up(raised, end, self.method, self._options) from None
        if raised is not None:
            raise raised
        off = "The state cannot be brought onto the constraints."
        raise run.ended(t, end, self.method, off if status == RESET_FAILED else TOO_SMALL, x) from run.cause()

    def _plainly(self, t: float, x: Any, h: float, p: Any, u: Any, out: Array | None, _: object) -> tuple[Array, None]:
        """The same by SciPy, for a module without compiled steppers."""
        layout = self.module.layout
        state, p, u = _vector("x", x, layout.n_x), _vector("p", p, layout.n_p), _vector("u", u, layout.n_u)
        shape = (layout.n_x,)
        if out is not None and not (
            isinstance(out, np.ndarray) and out.dtype == float and out.shape == shape and out.flags.carray
        ):
            raise ill_shaped(f"out must be a contiguous writeable float64 array of shape {shape}")
        bound = self.module.bind(p, u)
        options = {k: min(v, abs(h)) if k == "first_step" else v for k, v in self._options.items()}
        if h == 0.0:
            state = bound.project(state, t=t)
        else:
            try:
                run = simulate(bound, (t, t + h), state, events=[], t_eval=[t + h], method=self.method, **options)
            except (EvaluationError, ArithmeticError) as error:
                raise SimulationError(f"{self.method} stopped near t = {t:.6g} s of {t + h:.6g} s: {error}") from error
            state, self._evaluations = run.x[:, -1], run.nfev
        if out is None:
            return state, None
        out[...] = state
        return out, None

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy works on memory of its own."""
        return type(self), self._given

    def __repr__(self) -> str:
        return f"<Integrator of {self.module.name}: {self.method}, rtol {self._options['rtol']:g}>"


def integrator(
    module: BoundModel, /, parameters: Any = None, inputs: Any = None, *, method: str | None = None, **options: Any
) -> Integrator:
    """Make an integrator for many short integrations, as in control, shooting methods, filters and learning.

    Parameters
    ----------
    parameters, inputs : mapping of str to float, or arrays, optional
        As for :meth:`bind`; inputs are held.
    method : str, optional
    **options
        rtol, atol, max_step, first_step, step, as for :meth:`simulate`.

    Returns
    -------
    Integrator
        ``integrator(t, x, h)`` -> the state at t + h; see :class:`~.integrator.Integrator`.
    """
    require_support(module.layout, "integrator")
    check_names("option of integrator", options, OPTIONS)
    declared = declare(module)
    method, step = declared_step(module, method, options.pop("step", None))
    options |= {"method": method, "step": step}
    refuse_moreau(method, "integrator")
    raw = {name: declared[name] for name in ("method", "rtol", "atol")}
    raw.update({name: value for name, value in options.items() if value is not None})
    return Integrator(module.bind(parameters, inputs), **raw)


def _vector(label: str, raw: Any, n: int) -> Any:
    """A new array (n,) of what is given, or None."""
    if raw is None and label != "x":
        return None
    return np.array(read_vector(label, raw, n))
