"""heyoka's Taylor integrator over the same right-hand side, node by node, as a peer of the steppers."""

from __future__ import annotations

from typing import Any

import numpy as np

from eomgen.expr.core import reachable


def available() -> bool:
    """Whether heyoka can be imported."""
    try:
        import heyoka  # noqa: F401
    except ImportError:
        return False
    return True


def system(program: Any, values: dict[str, float]) -> list[tuple[Any, Any]]:
    """The right-hand side of a program as heyoka's pairs of variables and expressions.

    Parameters
    ----------
    program : Program
        Whose right-hand side is straight-line code.
    values : dict of str to float
        Of its parameters.
    """
    import heyoka as hk

    block = next(b for b in program.blocks if b.name == "rhs")
    names = [*program.coordinates, *program.velocities]
    variables = dict(zip(names, hk.make_vars(*(f"x{k}" for k in range(len(names)))), strict=True))
    operations = {
        "add": lambda a, b: a + b,
        "sub": lambda a, b: a - b,
        "mul": lambda a, b: a * b,
        "div": lambda a, b: a / b,
        "neg": lambda a: -a,
        "sin": hk.sin,
        "cos": hk.cos,
    }
    made: dict[int, Any] = {}
    for i in reachable(program.graph, [y.id for y in block.outputs]):
        kind, *given = program.graph.nodes[i]
        if kind == "const":
            made[i] = hk.expression(float(given[0]))
        elif kind == "sym":
            made[i] = variables.get(given[0]) if given[0] in variables else hk.expression(float(values[given[0]]))
        else:
            made[i] = operations[kind](*(made[k] for k in given))
    return [(variables[name], made[y.id]) for name, y in zip(names, block.outputs, strict=True)]


class Taylor:
    """One system, ready to be integrated again and again."""

    def __init__(self, equations: list[tuple[Any, Any]], tolerance: float) -> None:
        import heyoka as hk

        self.integrator = hk.taylor_adaptive(equations, [0.0] * len(equations), tol=tolerance)

    def __call__(self, x0: np.ndarray, end: float) -> np.ndarray:
        """The state at a time, from x0 at time 0."""
        self.integrator.time = 0.0
        self.integrator.state[:] = x0
        self.integrator.propagate_until(end)
        return np.array(self.integrator.state)


def reference(equations: list[tuple[Any, Any]], x0: np.ndarray, end: float) -> np.ndarray:
    """The state at a time by long doubles, where the machine has them, far below all tolerances asked."""
    import heyoka as hk

    start = [np.longdouble(x) for x in x0]
    integrator = hk.taylor_adaptive(
        equations, start, tol=np.longdouble(1e-19), fp_type=np.longdouble, compact_mode=True
    )
    integrator.propagate_until(np.longdouble(end))
    return np.array(integrator.state, dtype=float)
