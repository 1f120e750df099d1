"""What runs in a process of its own: ``python -m benchmarks.tasks NAME '[arguments]'`` prints a result as JSON."""

from __future__ import annotations

import json
import sys
from time import perf_counter
from typing import Any

#: Tolerances of the double pendulum's runs, and where they begin.
TIGHT = {"rtol": 1e-11, "atol": 1e-13}
START = [1.5707963267948966, 0.0, 0.0, 0.0]


def derive(model: str, size: list[int], method: str) -> dict[str, Any]:
    """Describe and derive with eomgen; a chain of one link first, so that nothing is imported within."""
    from . import models

    models.chain(1).derive(method)
    start = perf_counter()
    equations = getattr(models, model)(*size).derive(method)
    seconds = perf_counter() - start
    return {"seconds": seconds, "operations": equations.operations["mass_matrix and bias"].total}


def derive_sympy(model: str, size: list[Any], counted: bool) -> dict[str, Any]:
    """The same with SymPy's KanesMethod; its caches are cleared after a chain of one link."""
    from sympy.core.cache import clear_cache

    from . import sympy_peer

    sympy_peer.chain(1)
    clear_cache()
    start = perf_counter()
    kane = getattr(sympy_peer, model)(*size)
    seconds = perf_counter() - start
    return {"seconds": seconds, "operations": kane.operations() if counted else None}


def compile_chain(n: int) -> float:
    """Seconds from a derived chain to its loaded ``rhs``."""
    from .models import chain

    equations = chain(n).derive()
    start = perf_counter()
    equations.compile(kernels=["rhs"])
    return perf_counter() - start


def run_double_pendulum_sympy() -> None:
    """What a SymPy user does instead of ``eomgen run examples/double_pendulum.yaml``."""
    from scipy.integrate import solve_ivp

    from .sympy_peer import pendulum_rhs

    rhs = pendulum_rhs({"m1": 1.0, "m2": 1.0, "l1": 1.0, "l2": 1.0, "g": 9.81})
    solve_ivp(rhs, (0.0, 10.0), START, method="DOP853", **TIGHT)


def run_double_pendulum_pydy(generator: str) -> None:
    """The same through PyDy's code generation and odeint, as its examples do."""
    import numpy as np
    import sympy as sm
    from pydy.codegen.ode_function_generators import generate_ode_function
    from scipy.integrate import odeint

    from .sympy_peer import double_pendulum

    kane = double_pendulum()
    rhs = generate_ode_function(
        kane.forcing, kane.q, kane.u, kane.parameters, mass_matrix=kane.mass_matrix,
        coordinate_derivatives=sm.Matrix(kane.u), generator=generator,
    )  # fmt: skip
    odeint(rhs, START, np.linspace(0, 10, 1001), args=(np.array([1.0, 1.0, 1.0, 1.0, 9.81]),), **TIGHT)


def run_double_pendulum_casadi() -> None:
    """The same in CasADi's virtual machine, the accelerations written by hand (its users have no derivation)."""
    import casadi as ca
    import numpy as np

    x = ca.SX.sym("x", 4)
    bend, whole = x[1], x[2] + x[3]
    s, c, g = ca.sin(bend), ca.cos(bend), 9.81  # unit masses and lengths; the second angle from the first rod
    b1, b2 = s * whole**2 - 2 * g * ca.sin(x[0]), -s * x[2] ** 2 - g * ca.sin(x[0] + bend)
    a1 = (b1 - c * b2) / (2 - c * c)
    ode = ca.vertcat(x[2], x[3], a1, b2 - c * a1 - a1)
    times, options = np.linspace(0, 10, 1001), {"reltol": TIGHT["rtol"], "abstol": TIGHT["atol"]}
    integrator = ca.integrator("I", "cvodes", {"x": x, "ode": ode}, 0, times[1:], options)
    integrator(x0=START)


if __name__ == "__main__":
    print(json.dumps(globals()[sys.argv[1]](*json.loads(sys.argv[2]))))
