"""A module -> random states on its constraints, and what its calls give there."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.kernel_table import TIMED
from ..base.limits.numbers import EPS
from ..errors import EomgenError
from .limits import BUILDS, CLOSED, SPREAD_OF_ROUNDING, WELL_CONDITIONED, ZERO

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

# -- random states -----------------------------------------------------------------------------------------------------

# The states lie at or near the branch of the declared initial position; parameters differ from the declared ones by a
# few per cent, as far as loops still close and keep their freedoms.


SPREAD = 0.03  #: relative spread of parameters
ANGLE, LENGTH = 0.4, 0.2  #: spread of coordinates: rad, and parts of the model's length
STATE_SPREAD = 0.3  #: spread of first-order states: parts of their initial values, or 0.3 about 0
SPEED = 1.0  #: spread of velocities: rad/s, and lengths of the model per second
LATEST = 0.5  #: latest time (s)
HALVINGS = 8  #: of the way from the reference position, until it closes


class SystemState(NamedTuple):
    """One state with everything that kernels take."""

    number: int
    t: float
    x: Array
    a: Array  #: any accelerations, not those of the motion
    p: Array
    u: Array
    n_q: int

    @property
    def q(self) -> Array:
        return self.x[: self.n_q]

    @property
    def v(self) -> Array:
        return self.x[self.n_q :]

    @property
    def values(self) -> dict[str, Any]:
        """Parameters and inputs, as calls take them."""
        return {"p": self.p, "u": self.u}

    @property
    def timed(self) -> dict[str, Any]:
        """And the time."""
        return self.values | {"t": self.t}


def random_states(module: BoundModel, count: int, seed: int = 0, at_values: bool = False) -> list[SystemState]:
    """States that move, on the constraints.

    Parameters
    ----------
    at_values : bool
        Whether parameters and inputs have the values of the module, not others near them.

    Raises
    ------
    AssemblyError
        The loops do not close at the declared values either.
    """
    rng = np.random.default_rng(seed)
    geometric = None if at_values else _geometric(module, rng)
    return [draw(module, rng, geometric, k) for k in range(count)]


def draw(module: BoundModel, rng: np.random.Generator, geometric: Array | None, number: int) -> SystemState:
    """One state; parameters that keep the loops closed are tried first, then those that do not touch them."""
    t = float(rng.uniform(0.0, LATEST))
    spread = 1.0 + SPREAD * rng.standard_normal(module.n_p).clip(-2.0, 2.0)
    u = module.u + 0.5 * rng.standard_normal(module.n_u) * (1.0 + np.abs(module.u))
    tried = [(module.p, module.u)]
    if geometric is not None:
        kept = np.where(geometric, module.p, module.p * spread)
        tried = [(module.p * spread, u), (kept, u), (kept, module.u), *tried]
    for p, inputs in tried:
        for _ in range(3):
            x = _state(module, rng, t, p, inputs)
            if x is not None:
                a = rng.standard_normal(module.layout.n_v) * _sizes(module, module.layout.velocity_kinds)
                return SystemState(number, t, x, a, p, inputs, module.n_q)
    x = module.x0(t=0.0)
    a = rng.standard_normal(module.layout.n_v) * _sizes(module, module.layout.velocity_kinds)
    return SystemState(number, 0.0, module.project(x, t=0.0), a, module.p, module.u, module.n_q)


def _sizes(module: BoundModel, kinds: tuple[str, ...]) -> Array:
    length = float(module.info.length_scale or 1.0)
    return np.array([length if kind == "length" else 1.0 for kind in kinds])


def _geometric(module: BoundModel, rng: np.random.Generator) -> Array:
    """Which parameters the holonomic constraints depend on."""
    here = np.zeros(module.n_p, dtype=bool)
    if not module.n_rows:
        return here
    q = module.layout.q_reference + 0.1 * rng.standard_normal(module.n_q)
    x = np.concatenate([q, rng.standard_normal(module.layout.n_v)])

    def rows(p: Array) -> Array:
        return np.concatenate(
            [module.constraints(q, p=p, t=0.1, rows="all"), module.velocity_constraints(x, p=p, t=0.1, rows="all")]
        )

    before = rows(module.p)
    for k in range(module.n_p):
        p = module.p
        p[k] = p[k] * 1.01 + (0.01 if p[k] == 0.0 else 0.0)
        here[k] = bool((rows(p) != before).any())
    return here


def _state(module: BoundModel, rng: np.random.Generator, t: float, p: Array, u: Array) -> Array | None:
    layout = module.layout
    q_kinds = layout.coordinate_kinds
    shift = rng.standard_normal(module.n_q) * np.array([LENGTH if kind == "length" else ANGLE for kind in q_kinds])
    shift *= _sizes(module, q_kinds)
    v = SPEED * rng.standard_normal(module.layout.n_v) * _sizes(module, layout.velocity_kinds)
    try:
        start = module.x0(t=t, p=p, u=u)
    except EomgenError:
        return None
    reference, s = start[: module.n_q], start[module.n_x - module.n_s :]
    v[module.n_v :] = s + STATE_SPREAD * rng.standard_normal(module.n_s) * np.where(s == 0.0, 1.0, np.abs(s))
    for k in range(HALVINGS):
        try:
            x = module.project(np.concatenate([reference + shift * 0.5**k, v]), t=t, p=p, u=u)
            massless = bool(module.info.no_inertia)
            if _closed(module, x, t, p, u) and (massless or np.isfinite(module.rhs(t, x, p=p, u=u)).all()):
                return x
        except EomgenError:
            continue
    return None


def _closed(module: BoundModel, x: Array, t: float, p: Array, u: Array) -> bool:
    """Whether all rows hold, redundant ones too, no axis is flipped, and the rank is that of the reference."""
    q, layout = x[: module.n_q], module.layout
    if not module.n_rows:
        return True
    scales = layout.scales
    residual = np.abs(scales.residual(module.constraints(q, p=p, u=u, t=t, rows="all")))
    rate = np.abs(module.velocity_constraints(x, p=p, u=u, t=t, rows="all"))
    if residual.max(initial=0.0) > CLOSED or rate.max(initial=0.0) > CLOSED * (1.0 + np.abs(x).max()):
        return False
    if layout.sizes.n_alignments and not (module.kernels.alignment(q, p=p, u=u, t=t) > 0.0).all():
        return False
    J = scales.jacobian(module.kernels.constraint_jacobian(q, p=p, u=u, t=t))
    values = algebra.singular_values(J)
    rank = module.layout.n_v - module.layout.n_dof
    return bool(values[rank - 1] > WELL_CONDITIONED * values[0]) if rank and rank <= len(values) else True


# -- recorded calls ----------------------------------------------------------------------------------------------------

# The module is that of the NumPy target, which needs no compiler; a package in C is so compared with other code.


RECORDED = "tests/recorded.json"  #: in the folder of a package
SEED = 30
STATES = 2
NUDGES = 4  #: states beside each, by which the effect of rounding is estimated

#: Calls that every package has, and their arguments.
CALLS: dict[str, Callable[[SystemState], tuple[Any, ...]]] = {
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


def called(module: BoundModel, call: str, case: SystemState) -> Array:
    """What a call of a module gives at a state; of one that is not in the table at its position."""
    arguments = CALLS[call](case) if call in CALLS else (case.q,)
    raw = case.values if call in TIMED else case.timed
    return np.asarray(getattr(module, call)(*arguments, **raw), dtype=float)


def record_calls(name: str, module: BoundModel | None) -> str:
    """The text of ``tests/recorded.json``: calls, their arguments, results, and the most by which a result may differ.

    The bound is :data:`~.limits.SPREAD_OF_ROUNDING` times what a change of the state by a few roundings
    changes, :data:`~.limits.BUILDS` of the largest number, and :data:`~.limits.ZERO`.

    Parameters
    ----------
    name : str
        Of the model.
    module : BoundModel or None
        None where nothing can be evaluated without a compiler, because the model calls functions in C.
    """
    result: list[dict[str, Any]] = []
    if module is not None:
        try:
            x = np.asarray(module.x0(), dtype=float)
            start = SystemState(0, 0.0, x, np.zeros(module.layout.n_v), module.p, module.u, module.n_q)
            result.append({"id": "x0", "call": "x0", "arguments": [], "given": {}, **_judged(x, [])})
            states_compared = [start, *random_states(module, STATES - 1, SEED)] if module.n_x else [start]
        except EomgenError:  # no state can be assembled: the package says so when it is called
            states_compared = []
        for number, case in enumerate(states_compared):
            tried = [_record(module, call, case, number) for call in CALLS]
            result += [one for one in tried if one is not None]
    return json.dumps({"name": name, "cases": result}, separators=(",", ":"), allow_nan=False) + "\n"


def _record(module: BoundModel, call: str, case: SystemState, number: int) -> dict[str, Any] | None:
    """One call at one state; None where the model has no such result, or none that is finite."""
    raw = case.values if call in TIMED else case.timed
    rng = np.random.default_rng(SEED)
    try:
        values = [called(module, call, case)]
        for _ in range(NUDGES):
            nudged = SystemState(0, case.t, _nudge(case.x, rng), _nudge(case.a, rng), case.p, case.u, case.n_q)
            values.append(called(module, call, nudged))
    except EomgenError:
        return None
    if not values[0].size or not all(np.isfinite(value).all() for value in values):
        return None
    arguments = [value.tolist() if isinstance(value, np.ndarray) else float(value) for value in CALLS[call](case)]
    plain = {key: np.asarray(value).tolist() for key, value in raw.items()}
    named = {"id": f"{call}-{number}", "call": call, "arguments": arguments, "given": plain}
    return named | _judged(values[0], values[1:])


def _nudge(values: Array, rng: np.random.Generator) -> Array:
    """The numbers with errors of a few roundings added, relative to the largest number."""
    return np.asarray(values + 4.0 * EPS * rng.uniform(-1.0, 1.0, values.shape) * np.abs(values).max(initial=0.0))


def _judged(value: Array, beside: list[Array]) -> dict[str, Any]:
    spread = max((float(np.abs(other - value).max()) for other in beside), default=0.0)
    size = float(np.abs(value).max(initial=0.0))
    return {"value": value.tolist(), "bound": SPREAD_OF_ROUNDING * spread + BUILDS * size + ZERO}
