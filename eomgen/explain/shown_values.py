"""Stage explain, numbers: SymPy expressions with named parts, at numbers; the state of a module as numbers by name."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import sympy

from ..kinematics.state import acceleration_name


def evaluate(named: Sequence[tuple[Any, Any]], flat: Sequence[Any], values: Mapping[str, float]) -> np.ndarray:
    """Expressions with named parts at numbers, each part of an expression once."""
    known = known_values(named, values)
    return np.array([float(value_of(x, known)) for x in flat])


def known_values(named: Sequence[tuple[Any, Any]], values: Mapping[str, float]) -> dict[Any, Any]:
    """Numbers of symbols, named parts included."""
    known: dict[Any, Any] = {sympy.Symbol(name): float(value) for name, value in values.items()}
    for symbol, expression in named:
        known[symbol] = value_of(expression, known)
    return known


def value_of(expression: Any, known: dict[Any, Any]) -> Any:
    """The value of an expression: sums, products and powers of floats here, all else as SymPy evaluates it."""
    if expression in known:
        return known[expression]
    if not expression.args:
        # true of a Piecewise stays, and an infinity in a branch of one that need not be taken
        value = float(expression) if expression.is_number and expression.is_finite else expression
    else:
        parts = [value_of(part, known) for part in expression.args]
        plain = all(type(part) is float for part in parts)
        if plain and expression.is_Add:
            value = math.fsum(parts)
        elif plain and expression.is_Mul:
            value = math.prod(parts)
        elif plain and expression.is_Pow and (parts[0] > 0 or (parts[0] < 0 and parts[1].is_integer())):
            value = parts[0] ** parts[1]
        else:
            value = expression.func(*(sympy.Float(x) if type(x) is float else x for x in parts))
            value = float(value) if value.is_Number and value.is_finite else value
    known[expression] = value
    return value


def state_values(module: Any, x: np.ndarray, t: float) -> dict[str, float]:
    """Numbers of all symbols at a state: coordinates, velocities, accelerations, parameters, inputs, time."""
    values = dict(zip(module.x_names, map(float, x), strict=True)) | {"t": t}
    rates = module.rhs(t, x)[module.n_q :]
    values |= dict(zip(map(acceleration_name, module.layout.v), map(float, rates), strict=True))
    values |= dict(zip(module.p_names, map(float, module.p), strict=True))
    return values | dict(zip(module.u_names, map(float, module.u), strict=True))


def random_state(module: Any, seed: int, t: float = 0.0, size: float = 0.1) -> np.ndarray:
    """A consistent state near the declared one, moving."""
    random = np.random.default_rng(seed)
    x = np.array(module.x0(t=t))
    places = (
        module.layout.place_scales.q[: module.layout.moving] if not module.layout.metadata["quaternion_slots"] else 1.0
    )
    x[: module.n_q] += size * places * random.uniform(-1, 1, module.n_q)
    x[module.n_q :] += module.layout.scales.q * random.uniform(-1, 1, module.layout.n_v)
    return np.array(module.project(x, t=t))
