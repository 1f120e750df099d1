"""Stage describe, SymPy's constraints: which constraints of velocities are derivatives of the others."""

from __future__ import annotations

from collections.abc import Sequence

from ..base.limits.constraints import GIVEN as SMALL
from ..base.limits.numbers import ROUNDED
from ..errors import ExpressionError, ModelError, Problem
from ..graph.core import Expr, Graph
from ..graph.differentiate import jacobian, jvp
from ..graph.evaluate import evaluate
from ..graph.rounding_bounds import with_bounds
from ..graph.substitute import substitute, symbols_of
from .input_names import rate_of
from .sympy_face import lower_sympy, name_of
from .sympy_forms import Forms

TRIES = 5


def independent_rows(forms: Forms, constants: Sequence[str], functions: Sequence[str]) -> tuple[list[int], bool]:
    """Which rows of ``forms.motion`` are not derivatives of the configuration constraints nor follow from others.

    Returns
    -------
    kept : list of int
    independent : bool
        Whether those and the configuration constraints are independent of each other.

    Raises
    ------
    ModelError
        A constraint contradicts the others.
    """
    import numpy as np

    from ..base import algebra

    graph = Graph()
    names = {name_of(x): graph.symbol(name_of(x)) for x in (*forms.q, *forms.v)}

    def resolve(name: str) -> Expr:
        return {**rates, **names}.get(name, graph.symbol(name))

    rates: dict[str, Expr] = {}
    try:
        for symbol, part in forms.intermediates.items():
            names[symbol.name] = lower_sympy(graph, part, resolve)
        slopes = [lower_sympy(graph, rate, resolve) for rate in forms.rates.values()]
        for x, rate in zip(forms.q, slopes, strict=True):
            rates[f"{name_of(x)}_dot"] = rate
        configuration = [lower_sympy(graph, row, resolve) for row in forms.configuration]
        motion = [lower_sympy(graph, row, resolve) for row in forms.motion]
    except ExpressionError:  # the check of the model tells what is wrong
        return list(range(len(forms.motion))), False
    along = {names[name_of(x)]: rate for x, rate in zip(forms.q, slopes, strict=True)}
    along |= {graph.symbol(f): graph.symbol(rate_of(f)) for f in functions} | {graph.symbol("t"): graph.one}
    rows = [*jvp(configuration, along), *motion]
    v = [names[name_of(x)] for x in forms.v]
    entries = jacobian(rows, v)
    constant = substitute(rows, dict.fromkeys(v, graph.zero))
    used = symbols_of([*constant, *entries.values()])
    random = np.random.default_rng(0)
    for _ in range(TRIES):  # a place may lie outside the domain of a root
        values = {name: float(random.uniform(0.3, 1.2)) for name in sorted(used)}
        matrix, rounding = np.zeros((len(rows), len(v))), np.zeros((len(rows), len(v)))
        for place, value, bound in zip(entries, *with_bounds(list(entries.values()), values), strict=True):
            matrix[place], rounding[place] = value, ROUNDED * bound
        right = np.array(evaluate(constant, values), dtype=float)
        if np.isfinite(matrix).all() and np.isfinite(right).all():
            break
    else:
        return list(range(len(motion))), False
    basis = np.empty((0, len(v)))
    fresh: list[bool] = []
    for row, noise in zip(matrix, rounding, strict=True):
        length = np.linalg.norm(row)
        left = row - basis.T @ (basis @ row)
        left -= basis.T @ (basis @ left)
        size = np.linalg.norm(left)
        fresh.append(bool(size > SMALL * length and size > np.linalg.norm(noise)))
        if fresh[-1]:
            basis = np.vstack([basis, left / size])
    h = len(configuration)
    own = [k for k, new in enumerate(fresh) if new]
    for k in [k for k, new in enumerate(fresh) if not new]:
        factors = algebra.lstsq(matrix[own].T, matrix[k], rcond=None)
        if abs(right[k] - factors @ right[own]) > SMALL * max(
            1.0, abs(right[k]), float(np.abs(factors).max(initial=0))
        ):
            which = f"configuration constraint {k + 1}" if k < h else f"velocity constraint {k - h + 1}"
            message = (
                f"{which} contradicts the others: it has the same velocity terms as they have, but other "
                "remaining terms"
            )
            raise ModelError([Problem("equations.constraints", message, f"check the {which}", code="EG-REDUNDANT")])
    return [k for k in range(len(motion)) if fresh[h + k]], all(fresh[:h])
