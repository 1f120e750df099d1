"""The module's own steppers outside of runs: classes for SciPy, single steps, an integrator from state to state."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.algebra import Array
from ...base.limits.runs import SCIPY_ATOL, SCIPY_RTOL
from ...errors import (
    EvaluationError,
    SimulationError,
    UnavailableError,
    UsageError,
    cannot,
    ill_shaped,
    no_number,
    off_range,
)
from ..argument_checks import both_names, check_names, fitting, read_plain, read_vector, require, require_steps
from ..inputs import Forcing
from ..kernels import eager
from ..refusals import refuse_moreau, require_support
from .bound_run import Crawling, Run, StallCheck
from .events import Events
from .integrate import RESET_FAILED, TOO_SMALL, choose_solver
from .run_arguments import (
    IMPLICIT,
    STEPS,
    can_run,
    check_method,
    check_tolerances,
    declare,
    declared_step,
    no_series,
    stepper_options,
)
from .simulate import simulate

if TYPE_CHECKING:
    from ..bound_model import BoundModel

OPTIONS = ("method", "rtol", "atol", "max_step", "first_step", "step")


# -- an integrator -----------------------------------------------------------------------------------------------------


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
        self._arguments = (module, method, rtol, atol, max_step, first_step, step)
        self.module, self.method = module, method
        self._step = check_method(method, step)
        sizes = {"max_step": max_step, "first_step": first_step} if step is None else {"max_step": self._step}
        self._options: dict[str, Any] = check_tolerances(module.n_x, np.inf, {"rtol": rtol, "atol": atol, **sizes})
        self._evaluations = 0
        self._compiled: Any = None
        if can_run(module, method, Forcing(module.layout, None)):
            settings = stepper_options(module.n_x, self._options)
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
        return type(self), self._arguments

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


# -- classes of solvers ------------------------------------------------------------------------------------------------


def find_solver(module: BoundModel, name: str) -> Any:
    """The stepper of a module by name."""
    require_support(module.layout, "methods of SciPy", f"method {name}")
    core: Any = eager(module.core)
    if name in core.methods:
        return solver_class(core, name)
    if name == "Taylor":
        raise UnavailableError(no_series(module))
    return getattr(require("scipy.integrate", "scipy", f"method {name}"), name)


@cache
def solver_class(core: Any, name: str) -> Any:
    """The OdeSolver subclass of a method: ``solve_ivp(module.rhs, span, x0, method=module.DOP853)``.

    It takes the same steps as SciPy's own to rounding.  Given any other function than the module's ``rhs``, or another
    Jacobian than the module's, it is SciPy's own; SciPy has no Taylor.  A failed evaluation shortens the step.
    """
    scipy = require("scipy.integrate", "scipy", f"method {name}")
    kind: Any = getattr(scipy, name, _only_for_modules)
    kernel = core.kernel

    class Solver(scipy.OdeSolver):  # type: ignore[name-defined, misc]
        """A compiled stepper."""

        def __new__(cls, fun: Any, *args: Any, **options: Any) -> Any:
            jac = options.get("jac")
            known = jac is None or (isinstance(jac, kernel) and jac.name == "jacobian" and jac.context is fun.context)
            mine = isinstance(fun, kernel) and fun.name == "rhs" and fun.context.model is core
            if mine and known and options.get("jac_sparsity") is None:
                return super().__new__(cls)
            if callable(jac):
                options["jac"] = lambda t, x: jac(t, x.copy())
            return kind(lambda t, x: fun(t, x.copy()), *args, **options)  # a function may change what it is given

        def __init__(
            self,
            fun: Any,
            t0: float,
            y0: Array,
            t_bound: float,
            max_step: float = np.inf,
            rtol: float = SCIPY_RTOL,
            atol: Any = SCIPY_ATOL,
            vectorized: bool = False,
            first_step: float | None = None,
            **extraneous: Any,
        ) -> None:
            super().__init__(fun, t0, y0, t_bound, vectorized)
            for key in IMPLICIT if name == "Radau" else ():  # the model's own Jacobian, or none
                extraneous.pop(key, None)
            options = {"rtol": rtol, "atol": atol, "max_step": max_step, "first_step": first_step, **extraneous}
            check_names("option of simulate", options, STEPS)
            settings = stepper_options(self.n, check_tolerances(self.n, abs(t_bound - t0), options))
            self._stepper = core.stepper(name, fun.context, t0, np.asarray(y0, dtype=float), t_bound, **settings)

        nfev = _count("evaluations", "Evaluations of the right-hand side so far.")
        njev = _count("differentiations", "Evaluations of the Jacobian so far.")
        nlu = _count("factorizations", "Matrices factored so far.")

        def _step_impl(self) -> tuple[bool, str | None]:
            stepper = self._stepper
            if not stepper.step():
                return False, self.TOO_SMALL_STEP
            self.t, self.y = stepper.t, stepper.state()
            return True, None

        def _dense_output_impl(self) -> Any:
            return self._stepper.interpolant()  # callable like a DenseOutput, with t_old, t, t_min, t_max

    Solver.__name__ = Solver.__qualname__ = name
    return Solver


def _count(name: str, what: str) -> property:
    """A count of a stepper; OdeSolver sets it to 0 before there is one."""

    def count(self: Any) -> int:
        stepper = self.__dict__.get("_stepper")
        return 0 if stepper is None else int(getattr(stepper, name))

    return property(count, lambda self, value: None, None, what)


def _only_for_modules(fun: Any, *args: Any, **options: Any) -> Any:
    """In place of a class that SciPy does not have."""
    raise cannot("method Taylor can integrate only the rhs of its module, with constant inputs")


def step(
    module: BoundModel, /, t: float, x: ArrayLike, h: float, u: ArrayLike | None = None, out: Array | None = None
) -> Array:
    """Take one Runge-Kutta step (order 4) of size h, for real time: every step takes the same work.

    Parameters
    ----------
    t, h : float
        Time and size of the step (s).
    x : (n_x,) array
    u : (n_u,) array or mapping of names, optional
        Inputs, held over the step; those bound by default.
    out : (n_x,) array, optional
        Takes the result; it may be x.

    Returns
    -------
    (n_x,) array
        The state at t + h; loops drift at the order of the step, see :meth:`project`.

    Raises
    ------
    UsageError
        Wrong shapes or values, or events of the model reset its state, which a step does not watch.
    EvaluationError
        An evaluation of the equations failed.
    """
    require_support(module.layout, "step")
    if module.layout.n_events and Events(module.layout, None).resets:
        raise cannot(
            f"events of {module.name} reset its state, and a single step finds no events; simulate over (t, t + h)"
        )
    core: Any = eager(module.core)
    u = module.kernels.fail.vector("u", u, module.u)
    status, result = core.march(module.kernels.context, t, h, x, u, out, ill_shaped)
    if status == 0:
        return np.asarray(result)
    # once more in Python to tell which of the four evaluations failed
    t, h, start = read_plain("t", t), read_plain("h", h), read_vector("x", x, module.n_x)
    if out is not None:
        fitting(out, start.shape)
    k = [module.rhs(t, start, u=u)]
    with np.errstate(all="ignore"):  # what overflows is told by the next evaluation
        for part in (0.5, 0.5, 1.0):
            k.append(module.rhs(t + part * h, start + part * h * k[-1], u=u))
        after = start + h / 6.0 * (k[0] + 2.0 * (k[1] + k[2]) + k[3])
    if out is None:
        return np.asarray(after)
    out[...] = after
    return out
