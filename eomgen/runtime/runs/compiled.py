"""The module's own steppers: whether a run takes them, its arguments, single steps, classes for SciPy."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.algebra import Array
from ...base.limits.runs import SCIPY_ATOL, SCIPY_RTOL
from ...errors import UnavailableError, cannot, ill_shaped
from ..argument_checks import check_names, fitting, read_plain, read_vector, require
from ..inputs import Forcing
from ..kernels import eager
from ..refusals import require_support
from .events import Events
from .integrate import require_one
from .run_arguments import IMPLICIT, check_tolerances

if TYPE_CHECKING:
    from ..bound_model import BoundModel

OPTIONS = ("rtol", "atol", "max_step", "first_step")


def can_run(module: BoundModel, method: Any, forcing: Forcing) -> bool:
    """Whether a run needs nothing but the module's own steppers."""
    core: Any = module.core
    there = isinstance(method, str) and method in core.methods
    if isinstance(method, str) and method == "Taylor":
        if not there:
            raise cannot(no_series(module))
        if not forcing.stepwise:
            raise cannot(
                "method Taylor takes only inputs that are constant between corners: numbers, and tables with "
                'interpolation "zero-order"; for other inputs use DOP853'
            )
    return there and not forcing.foreign


def no_series(module: BoundModel) -> str:
    """Why a module has no Taylor method."""
    why = module.info.no_series
    return (
        f"{module.name} has no Taylor series: {why}; the method works for open chains of bodies whose equations are "
        "smooth and not too long; use DOP853"
    )


def stepper_options(n: int, span: float, options: Mapping[str, Any], checked: bool = False) -> dict[str, Any]:
    """Tolerances and step limits as steppers of n states take them, or a UsageError for an option that cannot be.

    The span (s) is the longest first step; ``checked`` options have been checked and completed already.
    """
    check_names("option of simulate", options, OPTIONS)
    raw = options if checked else check_tolerances(n, span, {"rtol": SCIPY_RTOL, "atol": SCIPY_ATOL, **options})
    limits = {"max_step": raw.get("max_step", inf), "first_step": raw.get("first_step", 0.0)}
    atol = np.empty(n)
    atol[:] = raw["atol"]
    return {"rtol": require_one(raw["rtol"]), "atol": atol, **limits}


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
    own: Any = getattr(scipy, name, _only_for_modules)
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
            return own(lambda t, x: fun(t, x.copy()), *args, **options)  # a function may change what it is given

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
            settings = stepper_options(self.n, abs(t_bound - t0), options)
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
