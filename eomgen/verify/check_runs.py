"""The generated steppers over single steps and short runs.

The reference is SciPy's DOP853 with tight tolerances on the plain right-hand side (E. Hairer, S. P. Norsett, G. Wanner,
Solving Ordinary Differential Equations I, 2nd ed. 1993, sec. II.3 and II.10): the error of one step of a method of
order p is of order h^(p + 1).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.constraints import ACCEPTED
from ..errors import EomgenError, SimulationError
from ..runtime.argument_checks import require
from ..runtime.runs.events import Events
from ..runtime.runs.integrator import integrator, step
from ..runtime.runs.simulate import simulate
from .checked import CheckedModel
from .finding import RIGID, Comparison, Finding, size_of
from .limits import ABSOLUTE, COLLECTED, COMPARED, LARGE, LOOSE, SLOWEST, TIGHT
from .random_states import SystemState

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

ORDERS = {"RK4": 4, "RK45": 5, "DOP853": 8}
#: By how much an observed order may fall short; over all examples it is 0.31, of DOP853, and 0.01 of others.
SHORT = 0.5
SAME_STEP = 0.1  #: distance of the ends of two steps that are one method's, in their error
TRIED = 3  #: states that single steps are taken from
LONG = 2.0  #: length of a run, in times in which the state changes by its own size
FIRST = 4.0  #: the first step tried, in the same times
MOST = 3000  #: evaluations of a run that is smooth
EVEN = 0.1  #: shortest step of a smooth run beside its longest: shorter ones pass by a singular position
SMALLEST = 14  #: halvings of the step

Reference = Callable[[float], Array]  #: h -> the state a time h later


def check_runs(model: CheckedModel) -> list[Finding]:
    """Orders of the steppers, methods against each other, energy and loops of a short run."""
    why = _inapplicable(model)
    if why:
        return [Finding.skipped("steppers: order of one step", why), Finding.skipped("runs: methods agree", why)]
    kinked = not model.layout.info.smooth
    references = [(case, cache(_reference(model, case))) for case in _run_states(model)[:TRIED]]
    result = [_order(model, method, references) for method in ORDERS if method in _methods(model)]
    end = _far(model, *references[0])
    result += [_agreement(model, *end), _energy(model, end[0])]
    why = "its forces have corners or tables, and no method keeps its order there"
    return [
        f if f.ok or not kinked or f.check.startswith("runs: energy") else Finding.skipped(f.check, why) for f in result
    ]


def _inapplicable(model: CheckedModel) -> str:
    if not model.module.layout.n_dof:
        return "drivers move the whole mechanism, so nothing is integrated"
    if model.layout.info.rigid_only:
        return RIGID
    if Events(model.layout, None).resets:
        return "events reset its state, and an integrator finds no events"
    if not model.layout.projects:
        return "derived with baumgarte="
    return ""


def _methods(model: CheckedModel) -> tuple[str, ...]:
    from ..runtime.kernels import eager

    return (*eager(model.module.core).methods, "RK4")


def _run_states(model: CheckedModel) -> list[SystemState]:
    """The states as runs with held inputs have them: rates of inputs are 0, and the state is on the constraints."""
    rates = [model.layout.u.index(rate) for of in model.layout.input_rates.values() for rate, _ in of]
    if not rates:
        return list(model.states)
    result = []
    for case in model.states:
        u = np.array(case.u)
        u[rates] = 0.0
        result.append(case._replace(u=u, x=model.module.project(case.x, t=case.t, p=case.p, u=u)))
    return result


def _time_scale(model: CheckedModel, case: SystemState) -> float:
    """A time in which the state changes by about its own size (s): 1 / |eigenvalue of largest size|."""
    J = model.slopes(case)
    fastest = float(np.abs(algebra.eigvals(J)).max(initial=0.0)) if np.isfinite(J).all() else 0.0
    speed = model.layout.scales.speed(case.v)
    return 1.0 / max(fastest, speed, SLOWEST)


def _reference(model: CheckedModel, case: SystemState) -> Reference:
    """The state a time after the case, by SciPy; on the constraints.

    Runs of all lengths take the same steps but for their last: what stops one stops all that come that far.
    """
    integrate = require("scipy.integrate", "scipy", "verify")
    bound = model.module.bind(case.p, case.u)
    stopped = np.inf

    def at(h: float) -> Array:
        nonlocal stopped
        if h > stopped:
            raise SimulationError(f"no run of {h:g} s: it stops within {stopped:g} s")
        left, reached = MOST, case.t

        def rhs(t: float, x: Array) -> Array:
            nonlocal left, reached
            left, reached = left - 1, max(reached, t)
            if not left:
                raise SimulationError(f"more than {MOST} evaluations for a run of {h:g} s")
            return bound.rhs(t, x)

        span, tolerances = (case.t, case.t + h), {"rtol": TIGHT, "atol": ABSOLUTE * TIGHT}
        try:
            run = integrate.solve_ivp(rhs, span, case.x, method="DOP853", **tolerances)
        except EomgenError:
            stopped = min(stopped, reached - case.t)
            raise
        steps = np.diff(run.t)[2:-1]
        uneven = np.minimum.accumulate(steps) < EVEN * np.maximum.accumulate(steps)
        if not run.success or uneven.any():
            end = run.t[3 + int(np.argmax(uneven))] if uneven.any() else reached
            stopped = min(stopped, float(end) - case.t)
            raise SimulationError(f"no run of {h:g} s: {run.message}")
        return bound.project(run.y[:, -1], t=case.t + h)

    return at


def _far(model: CheckedModel, case: SystemState, reference: Reference) -> tuple[float, Array]:
    """How long a smooth run from the case can be (s), and where it ends.

    Raises
    ------
    SimulationError
        None is possible.
    """
    h = LONG * _time_scale(model, case)
    for _ in range(SMALLEST):
        try:
            return h, reference(h)
        except EomgenError:
            h *= 0.5
    raise SimulationError(f"no run from state {case.number} succeeds, however short")


def _order(model: CheckedModel, method: str, references: Sequence[tuple[SystemState, Reference]]) -> Finding:
    """Between a step h and h/2 the error falls by 2^(p + 1), until it is lost in rounding.

    The mean over three halvings counts, and the best of three states: a fault of the method shows at each, an error
    that changes its sign at one.  A fast part of the motion can hide the order until rounding hides it: a method that
    falls short is in order where SciPy's step of the same method ends at the same place, far nearer than their error.
    """
    check, order = f"steppers: order of {method}", ORDERS[method]
    result = Comparison(check, f"how much less than {order + 1} the order of one step's error is")
    observed: list[tuple[float, int]] = []
    for case, reference in references:
        bound = model.module.bind(case.p, case.u)
        size = size_of(case.x) + size_of(model.rhs(case)) * _time_scale(model, case)
        lost = 30.0 * TIGHT * size
        errors: list[float] = []
        ends: list[tuple[float, Array]] = []
        h = FIRST * _time_scale(model, case)
        for _ in range(SMALLEST):
            try:
                if method == "RK4":
                    end = bound.project(step(bound, case.t, case.x, h), t=case.t + h)
                else:
                    stepper = integrator(bound, method=method, rtol=LOOSE, atol=LOOSE, first_step=h, max_step=h)
                    end = stepper(case.t, case.x, h)
                errors.append(float(np.abs(end - reference(h)).max()))
            except EomgenError:
                errors.append(np.inf)
                end = np.full(len(case.x), np.nan)
            ends.append((h, end))
            h *= 0.5
            if errors[-1] < lost:
                break
        with np.errstate(divide="ignore"):  # a smaller step that fails is of order minus infinity
            slopes = [np.log2(a / b) for a, b in pairwise(errors) if a < LARGE * size and b > lost]
        if slopes:
            missing = max(0.0, order + 1 - float(np.mean(slopes[-3:])))
            judged = [one for one in zip(ends, errors, strict=True) if one[1] > lost][-3:]
            if missing > SHORT and all(_as_scipy(bound, case, method, *step, error) for step, error in judged):
                missing = 0.0
            observed.append((missing, case.number))
    if not observed:
        return Finding.skipped(check, "the errors of one step are so small that rounding hides them")
    best, number = min(observed)
    result.add(number, [best], SHORT)
    return result.finding()


def _as_scipy(bound: BoundModel, case: SystemState, method: str, h: float, end: Array, error: float) -> bool:
    """Whether one step of a method ends where SciPy's of the same method does, within a part of its error."""
    solver = getattr(require("scipy.integrate", "scipy", "verify"), method, None)
    if solver is None or not np.isfinite(error):
        return False
    try:
        run = solver(bound.rhs, case.t, case.x, case.t + 2.0 * h, first_step=h, max_step=h, rtol=LOOSE, atol=LOOSE)
        run.step()
        result = bound.project(run.y, t=case.t + h)
    except EomgenError:
        return False
    return bool(run.t == case.t + h) and float(np.abs(end - result).max()) < SAME_STEP * error


def _agreement(model: CheckedModel, h: float, expected: Array) -> Finding:
    """DOP853, RK45 and Radau at tight tolerances end where SciPy's DOP853 does."""
    check, case = "runs: methods agree", _run_states(model)[0]
    methods = [m for m in ("DOP853", "RK45", "Radau", "Taylor") if m in _methods(model)] or ["DOP853"]
    bound = model.module.bind(case.p, case.u)
    result = Comparison(check, ", ".join(methods))
    size = size_of(expected)
    for method in methods:
        tolerances = {"rtol": COMPARED, "atol": ABSOLUTE * COMPARED * size}
        end = integrator(bound, method=method, **tolerances)(case.t, case.x, h)
        result.add(
            0, end - expected, COLLECTED * COMPARED * size, size, [f"{method} {name}" for name in model.layout.x]
        )
    result.states_compared = 1
    return result.finding()


def _energy(model: CheckedModel, h: float) -> Finding:
    """Loops stay closed over a run; where nothing but potentials acts, the energy stays what it was."""
    module, case = model.module, _run_states(model)[0]
    result = Comparison("runs: energy and loops")
    bound = module.bind(case.p, case.u)
    rtol, atol = COMPARED, ABSOLUTE * COMPARED
    run = simulate(bound, (case.t, case.t + h), case.x, method="DOP853", rtol=rtol, atol=atol)
    residuals = [size_of(bound.layout.scales.residual(bound.constraints(x[: module.n_q], t=t, rows="all")))
                 for t, x in zip(run.t, run.x.T, strict=True)]  # fmt: skip
    result.add(0, [max(residuals, default=0.0)], [ACCEPTED], 1.0, ["loops"])
    if _conservative(model):
        E = np.array([bound.energy(x, t=t) for t, x in zip(run.t, run.x.T, strict=True)])
        size = float(np.abs(E[:, 0]).max() + np.abs(E[:, 1] - E[0, 1]).max()) or 1.0
        result.add(0, [np.abs(E.sum(axis=1) - E[0].sum()).max()], [1e3 * rtol * size], size, ["energy"])
        result.note = "energy and loops"
    else:
        result.note = "loops; forces, drivers or inputs do work"
    result.states_compared = 1
    return result.finding()


def _conservative(model: CheckedModel) -> bool:
    kinematics, terms = model.kinematics, model.terms
    if model.mechanism.bare or any(f.marker_remainder or f.coordinate_remainder for f in kinematics.forces):
        return False
    moving = [x for x in terms.constraint_rate if not x.is_zero]
    return not moving and terms.t not in _symbols(model) and not set(terms.u) & _symbols(model)


def _symbols(model: CheckedModel) -> set[str]:
    from ..expr.core import symbols_of

    terms = model.terms
    return symbols_of([terms.kinetic, terms.potential, *terms.bias])
