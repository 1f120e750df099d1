"""What equations show, evaluated through SymPy's lambdify at numbers: the other side of every comparison."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy

from eomgen.kinematics.state import acceleration_name


def number(equations: Any, name: str, values: Mapping[str, float], part: str | None = None) -> Any:
    """The quantity of a name (and part) at numbers: float, array, or a list of arrays for named tuples."""
    named, value = equations.written(name, part)
    flat = list(value) if isinstance(value, sympy.MatrixBase) else [value]
    if isinstance(value, tuple):
        return [evaluate(named, list(one), values).reshape(-1) for one in value]
    found = evaluate(named, flat, values)
    if isinstance(value, sympy.MatrixBase):
        return found.reshape(value.shape)
    return float(found[0])


def evaluate(named: list[tuple[Any, Any]], flat: list[Any], values: Mapping[str, float]) -> np.ndarray:
    """Expressions with named parts at numbers."""
    if not flat:
        return np.zeros(0)
    symbols = [sympy.Symbol(name) for name in values]
    function = sympy.lambdify(symbols, flat, "numpy", cse=lambda given, **_: (named, list(given)))
    with np.errstate(all="ignore"):  # branches of a Piecewise that are not taken are evaluated too
        return np.array(function(*values.values()), dtype=float)


def state_values(module: Any, x: np.ndarray, t: float) -> dict[str, float]:
    """Numbers of all symbols at a state: coordinates, velocities, accelerations, parameters, inputs, time."""
    values = dict(zip(module.x_names, map(float, x), strict=True)) | {"t": t}
    rates = module.rhs(t, x)[module.n_q :]
    values |= dict(zip(map(acceleration_name, module.v_names), map(float, rates), strict=True))
    values |= dict(zip(module.p_names, map(float, module.p), strict=True))
    return values | dict(zip(module.u_names, map(float, module.u), strict=True))


def random_state(module: Any, seed: int, t: float = 0.0, size: float = 0.1) -> np.ndarray:
    """A consistent state near the declared one, moving."""
    random = np.random.default_rng(seed)
    x = np.array(module.x0(t=t))
    places = module.layout.place_scales.q if not module.layout.metadata["quaternion_slots"] else 1.0
    x[: module.n_q] += size * places * random.uniform(-1, 1, module.n_q)
    x[module.n_q :] += module.layout.scales.q * random.uniform(-1, 1, module.n_v)
    return np.array(module.project(x, t=t))
