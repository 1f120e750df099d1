"""Stage verification, record_calls: a module -> what its calls give at a few states, for the tests of its package.

The module is that of the NumPy target, which needs no compiler; a package in C is so compared with other code.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.analyses import BUILDS, SPREAD_OF_ROUNDING, ZERO
from ..base.limits.numbers import EPS
from ..errors import EomgenError
from .cases import Case, random_cases

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

RECORDED = "tests/recorded.json"  #: in the folder of a package
SEED = 30
STATES = 2
NUDGES = 4  #: states beside each, by which the effect of rounding is estimated

#: Calls that every package has, and their arguments.
CALLS: dict[str, Callable[[Case], tuple[Any, ...]]] = {
    "rhs": lambda c: (c.t, c.x),
    "jacobian": lambda c: (c.t, c.x),
    "outputs": lambda c: (c.t, c.x),
    "bias": lambda c: (c.t, c.x),
    "mass_matrix": lambda c: (c.q,),
    "inverse_dynamics": lambda c: (c.q, c.v[: len(c.a)], c.a),  # v is followed by states of elements
    "energy": lambda c: (c.x,),
    "poses": lambda c: (c.q,),
    "constraints": lambda c: (c.q,),
    "constraint_jacobian": lambda c: (c.q,),
    "velocity_constraints": lambda c: (c.x,),
    "momentum": lambda c: (c.x,),
    "project": lambda c: (c.x,),
}
TIMED = ("rhs", "jacobian", "outputs", "bias")  #: take t first; the others by name


def record_calls(name: str, module: BoundModel | None) -> str:
    """The text of ``tests/recorded.json``: calls, their arguments, results, and the most by which a result may differ.

    The bound is :data:`~..base.limits.analyses.SPREAD_OF_ROUNDING` times what a change of the state by a few roundings
    changes, :data:`~..base.limits.analyses.BUILDS` of the largest number, and :data:`~..base.limits.analyses.ZERO`.

    Parameters
    ----------
    name : str
        Of the model.
    module : BoundModel or None
        None where nothing can be evaluated without a compiler, because the model calls functions in C.
    """
    found: list[dict[str, Any]] = []
    if module is not None:
        try:
            x = np.asarray(module.x0(), dtype=float)
            start = Case(0, 0.0, x, np.zeros(module.layout.n_v), module.p, module.u, module.n_q)
            found.append({"id": "x0", "call": "x0", "arguments": [], "given": {}, **_judged(x, [])})
            cases = [start, *random_cases(module, STATES - 1, SEED)] if module.n_x else [start]
        except EomgenError:  # no state can be assembled: the package says so when it is called
            cases = []
        for number, case in enumerate(cases):
            tried = [_record(module, call, case, number) for call in CALLS]
            found += [one for one in tried if one is not None]
    return json.dumps({"name": name, "cases": found}, separators=(",", ":"), allow_nan=False) + "\n"


def _record(module: BoundModel, call: str, case: Case, number: int) -> dict[str, Any] | None:
    """One call at one state; None where the model has no such result, or none that is finite."""
    given: dict[str, Any] = {"p": case.p, "u": case.u} | ({} if call in TIMED else {"t": case.t})
    rng = np.random.default_rng(SEED)
    try:
        values = [np.asarray(getattr(module, call)(*CALLS[call](case), **given), dtype=float)]
        for _ in range(NUDGES):
            nudged = Case(0, case.t, _nudge(case.x, rng), _nudge(case.a, rng), case.p, case.u, case.n_q)
            values.append(np.asarray(getattr(module, call)(*CALLS[call](nudged), **given), dtype=float))
    except EomgenError:
        return None
    if not values[0].size or not all(np.isfinite(value).all() for value in values):
        return None
    arguments = [value.tolist() if isinstance(value, np.ndarray) else float(value) for value in CALLS[call](case)]
    plain = {key: np.asarray(value).tolist() for key, value in given.items()}
    named = {"id": f"{call}-{number}", "call": call, "arguments": arguments, "given": plain}
    return named | _judged(values[0], values[1:])


def _nudge(values: Array, rng: np.random.Generator) -> Array:
    """The numbers with errors of a few roundings added, relative to the largest number."""
    return np.asarray(values + 4.0 * EPS * rng.uniform(-1.0, 1.0, values.shape) * np.abs(values).max(initial=0.0))


def _judged(value: Array, beside: list[Array]) -> dict[str, Any]:
    spread = max((float(np.abs(other - value).max()) for other in beside), default=0.0)
    size = float(np.abs(value).max(initial=0.0))
    return {"value": value.tolist(), "bound": SPREAD_OF_ROUNDING * spread + BUILDS * size + ZERO}
