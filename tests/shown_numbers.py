"""What equations show, evaluated through SymPy at numbers: the other side of every comparison with a module."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import sympy

#: The methods of derivation.
METHODS = (
    *("embedding", "lagrange", "recursive", "augmented", "newton_euler", "amalgamated", "gibbs_appell", "hamilton"),
)


def evaluate(named: Sequence[tuple[Any, Any]], flat: Sequence[Any], values: Mapping[str, float]) -> np.ndarray:
    """Expressions with named parts at numbers, each part of an expression once."""
    known: dict[Any, Any] = {sympy.Symbol(name): float(value) for name, value in values.items()}
    for symbol, expression in named:
        known[symbol] = value_of(expression, known)
    return np.array([float(value_of(x, known)) for x in flat])


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


def acceleration(velocity: str) -> str:
    """The name of the rate of a velocity."""
    return f"{velocity[:-4]}_ddot" if velocity.endswith("_dot") else f"{velocity}_dot"


def state_values(module: Any, x: np.ndarray, t: float = 0.0) -> dict[str, float]:
    """Numbers of all symbols at a state: coordinates, velocities, accelerations, parameters, inputs, time."""
    values = dict(zip(module.x_names, map(float, x), strict=True)) | {"t": t}
    rates = module.rhs(t, x)[module.n_q :]
    values |= {acceleration(name): float(a) for name, a in zip(module.v_names, rates, strict=False)}
    values |= dict(zip(module.p_names, map(float, module.p), strict=True))
    return values | dict(zip(module.u_names, map(float, module.u), strict=True))


def random_state(module: Any, seed: int, t: float = 0.0, size: float = 0.1) -> np.ndarray:
    """A consistent state near the declared one, moving."""
    random, n, length = np.random.default_rng(seed), module.n_q, module.metadata["length_scale"]
    x = np.array(module.x0(t=t))
    places, rates = module.metadata["coordinate_kinds"], module.metadata["velocity_kinds"]
    sizes = {"length": length, "state": 0.0}
    step = 1.0 if module.metadata["quaternion_slots"] else np.array([sizes.get(kind, 1.0) for kind in places])
    x[:n] += size * step * random.uniform(-1, 1, n)
    x[n:] += np.array([sizes.get(kind, 1.0) for kind in rates]) * random.uniform(-1, 1, len(x) - n)
    return np.array(module.project(x, t=t))


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
