"""Stage explain, numbers: SymPy expressions with named parts, at numbers; the state of a module as numbers by name."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import sympy

from ..base.limits.numbers import ALIKE, ROUNDED
from ..errors import EomgenError
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


def moving_state(module: Any, velocities: Sequence[str]) -> tuple[np.ndarray, bool]:
    """The declared initial state and False; where it is at rest and can move, its position at velocities 1 and True.

    Parameters
    ----------
    module : BoundModel
    velocities : sequence of str
        Names of the independent velocities.
    """
    x = np.array(module.x0())
    position = x[: module.n_q]
    if not velocities or np.any(x[module.n_q : module.n_q + module.n_v]):
        return x, False
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            moving = np.array(module.x0(dict.fromkeys(velocities, 1.0)))
            rates = module.rhs(0.0, moving)
    except EomgenError:
        return x, False
    same = np.allclose(moving[: module.n_q], position, rtol=0.0, atol=ALIKE) and np.isfinite(rates).all()
    return (moving, True) if same else (x, False)


def told_state(module: Any, x: np.ndarray) -> dict[str, float]:
    """Numbers of all symbols at a state, in which 0 stands for what rounding left of it."""
    values, layout = state_values(module, x, 0.0), module.layout
    places = np.ones(module.n_q) if layout.metadata["quaternion_slots"] else layout.place_scales.q[: module.n_q]
    known = [(module.x_names[: module.n_q], places, 1.0)]
    names, sizes = layout.v[: module.n_v], layout.scales.q[: module.n_v]  # first-order states come after them
    for rates in (names, [acceleration_name(name) for name in names]):
        largest = max((abs(values[n]) / s for n, s in zip(rates, sizes, strict=True)), default=0.0)
        known.append((rates, sizes, largest))
    for group, scales, largest in known:
        values |= {
            name: 0.0
            for name, scale in zip(group, scales, strict=True)
            if abs(values[name]) <= ROUNDED * scale * largest
        }
    return values


def is_rounding(expression: Any, value: float, named: Sequence[tuple[Any, Any]], values: Mapping[str, float]) -> bool:
    """Whether a value near 0 is no more than what rounding of the numbers makes of it."""
    if value == 0.0 or abs(value) > ALIKE:
        return False
    for turn in (0, 1):
        signs = (math.cos(2.4 * k + turn) for k in itertools.count())  # irregular, and the same each time
        moved = {name: x * (1.0 + ROUNDED * sign) for (name, x), sign in zip(values.items(), signs, strict=False)}
        if abs(float(value_of(expression, known_values(named, moved))) - value) >= abs(value):
            return True
    return False


def random_state(module: Any, seed: int, t: float = 0.0, size: float = 0.1) -> np.ndarray:
    """A consistent state near the declared one, moving."""
    random = np.random.default_rng(seed)
    x = np.array(module.x0(t=t))
    places = 1.0 if module.layout.metadata["quaternion_slots"] else module.layout.place_scales.q[: module.n_q]
    x[: module.n_q] += size * places * random.uniform(-1, 1, module.n_q)
    x[module.n_q :] += module.layout.scales.q * random.uniform(-1, 1, module.layout.n_v)
    return np.array(module.project(x, t=t))
