"""Functions that JAX has traced and differentiated, evaluated operation by operation.

XLA compiles a closed loop for ten seconds and more; the operations that JAX records are evaluated here at once, by
NumPy where it has the same one, and by JAX itself where not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from scipy.linalg import solve_triangular

UFUNCS = {
    "add": np.add, "add_any": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "neg": np.negative,
    "abs": np.abs, "sin": np.sin, "cos": np.cos, "tan": np.tan, "exp": np.exp, "log": np.log, "sqrt": np.sqrt,
    "tanh": np.tanh, "sinh": np.sinh, "cosh": np.cosh, "atan2": np.arctan2, "max": np.maximum, "min": np.minimum,
    "sign": np.sign, "floor": np.floor, "pow": np.power, "lt": np.less, "le": np.less_equal, "gt": np.greater,
    "ge": np.greater_equal, "eq": np.equal, "ne": np.not_equal, "and": np.logical_and, "or": np.logical_or,
    "not": np.logical_not,
}  # fmt: skip


def _solve(a: Any, b: Any, *, left_side: bool, lower: bool, transpose_a: bool, unit_diagonal: bool, **_: Any) -> Any:
    a = a.T if transpose_a else a
    lower = lower != transpose_a
    if left_side:
        return solve_triangular(a, b, lower=lower, unit_diagonal=unit_diagonal)
    return solve_triangular(a.T, b.T, lower=not lower, unit_diagonal=unit_diagonal).T


def _broadcast(x: Any, *sizes: Any, shape: Any, broadcast_dimensions: Any, **_: Any) -> Any:
    within = [1] * len(shape)
    for k, at in enumerate(broadcast_dimensions):
        within[at] = x.shape[k]
    return np.broadcast_to(x.reshape(within), shape)


def _product(a: Any, b: Any, *, dimension_numbers: Any, **_: Any) -> Any:
    (left, right), _ = dimension_numbers
    return np.tensordot(a, b, (left, right))


def _slice(x: Any, *, start_indices: Any, limit_indices: Any, strides: Any) -> Any:
    return x[tuple(slice(*part) for part in zip(start_indices, limit_indices, strides or [1] * x.ndim, strict=True))]


SHAPED: dict[str, Callable[..., Any]] = {
    "broadcast_in_dim": _broadcast,
    "concatenate": lambda *parts, dimension: np.concatenate(parts, dimension),
    "convert_element_type": lambda x, new_dtype, **_: x.astype(new_dtype),
    "dot_general": _product,
    "integer_pow": lambda x, y: x**y,
    "reduce_max": lambda x, axes, **_: x.max(tuple(axes)),
    "reduce_sum": lambda x, axes, **_: x.sum(tuple(axes)),
    "reshape": lambda x, new_sizes, **_: x.reshape(new_sizes),
    "select_n": lambda where, *cases: np.where(where, cases[1], cases[0]),
    "slice": _slice,
    "squeeze": lambda x, dimensions: np.squeeze(x, tuple(dimensions)),
    "stack": lambda *parts, axis, **_: np.stack(parts, axis),
    "stop_gradient": lambda x: x,
    "transpose": lambda x, permutation: x.transpose(permutation),
    "triangular_solve": _solve,
}


def is_plain(name: str, given: list[Any], params: dict[str, Any]) -> bool:
    """Whether the operation is the one above: no batches of products, two cases, a triangle."""
    if name == "dot_general":
        return not any(map(len, params["dimension_numbers"][1]))
    if name == "triangular_solve":
        return all(x.ndim == 2 for x in given)
    return name != "select_n" or len(given) == 3


def play(jaxpr: Any, constants: Any, given: Any) -> list[Any]:
    """The results of a traced function."""
    values: dict[Any, Any] = dict(zip((*jaxpr.constvars, *jaxpr.invars), (*constants, *given), strict=True))

    def read(place: Any) -> Any:
        return np.asarray(place.val if hasattr(place, "val") else values[place])

    for equation in jaxpr.eqns:
        name, params = equation.primitive.name, equation.params
        taken = [read(place) for place in equation.invars]
        if name in UFUNCS:
            found = [UFUNCS[name](*taken)]
        elif name in SHAPED and is_plain(name, taken, params):
            found = [SHAPED[name](*taken, **params)]
        elif name in ("jit", "pjit"):
            found = play(params["jaxpr"].jaxpr, params["jaxpr"].consts, taken)
        elif name == "custom_jvp_call":
            found = play(params["call_jaxpr"].jaxpr, params["call_jaxpr"].consts, taken)
        elif name == "scan" and params["num_carry"] + params["num_consts"] == len(taken):
            fixed, state = taken[: params["num_consts"]], taken[params["num_consts"] :]
            for _ in range(params["length"]):
                state = play(params["jaxpr"].jaxpr, params["jaxpr"].consts, [*fixed, *state])
            found = state
        else:
            found = equation.primitive.bind(*taken, **params)
            found = found if equation.primitive.multiple_results else [found]
        values.update(zip(equation.outvars, found, strict=True))
    return [read(place) for place in jaxpr.outvars]


def evaluate(function: Callable[..., Any], *given: Any) -> list[Any]:
    """The results of a function of arrays whose result is a flat list of arrays."""
    traced = jax.make_jaxpr(function)(*given)
    return play(traced.jaxpr, traced.consts, given)
