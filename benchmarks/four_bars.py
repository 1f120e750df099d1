"""N four-bars through their change points (IFToMM A02), at tolerances down to 1e-12, beside their closed equation."""

from __future__ import annotations

from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipkm1

from .linkages import n_four_bar
from .report import Limit, Report, Table

TITLE = "N four-bars through their change points at tight tolerances"
METHODS = ("DOP853", "Radau")
TIMES = np.linspace(0.0, 10.0, 201)
#: Error of the mechanism over that of its closed equation, by the same stepper at the same tolerance.
FACTOR = 20.0


class Motion:
    """The closed equation of one variable, [(n + 1)/3 + n] theta'' = -g [(n + 1)/2 + n] cos theta, upright at 1 rad/s.

    Its solution is Jacobi's amplitude: with w^2 = 1 + 4 s and modulus^2 = 4 s / w^2, s being the slope,
    theta = 3 pi/2 - 2 am(w t/2 + K).
    """

    def __init__(self, n: int) -> None:
        self.slope = 9.81 * ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
        square = 1.0 + 4.0 * self.slope
        at = 0.5 * np.sqrt(square) * TIMES + ellipkm1(1.0 / square)
        self.exact = 1.5 * np.pi - 2.0 * ellipj(at, 4.0 * self.slope / square)[3]

    def solve(self, method: str, rtol: float, atol: float) -> np.ndarray:
        """theta at TIMES."""
        pair = {"jac": lambda t, y: [[0.0, 1.0], [self.slope * np.sin(y[0]), 0.0]]} if method == "Radau" else {}
        found = solve_ivp(
            lambda t, y: [y[1], -self.slope * np.cos(y[0])], (0.0, TIMES[-1]), [np.pi / 2, -1.0], method, TIMES,
            rtol=rtol, atol=atol, **pair,
        )  # fmt: skip
        return np.asarray(found.y[0])

    def error(self, theta: np.ndarray) -> float:
        """The largest difference of angles."""
        return float(np.abs(theta - self.exact).max())


class Comparison(NamedTuple):
    """One run of the mechanism beside its closed equation."""

    error: float  #: of all cranks (rad)
    closed: float  #: of the closed equation (rad)
    seconds: float
    evaluations: int
    passes: int  #: change points noted

    @property
    def factor(self) -> float:
        """Error over that of the closed equation."""
        return self.error / self.closed


def compare(module: Any, motion: Motion, n: int, method: str, rtol: float) -> Comparison:
    """Run 10 s of a compiled row of n parallelograms, and its closed equation."""
    tolerances = {"rtol": rtol, "atol": 1e-2 * rtol}
    start = perf_counter()
    run = module.simulate((0.0, 10.0), t_eval=TIMES, method=method, **tolerances)
    seconds = perf_counter() - start
    error = max(motion.error(run[f"theta{k}"]) for k in range(n + 1))
    closed = motion.error(motion.solve(method, **tolerances))
    return Comparison(error, closed, seconds, run.nfev, len(run.change_points))


def run(quick: bool) -> Report:
    """Every size by both methods at five tolerances."""
    sizes, tolerances = ((1, 2), (1e-8, 1e-12)) if quick else ((1, 2, 10, 40), (1e-8, 1e-9, 1e-10, 1e-11, 1e-12))
    rows: list[list[Any]] = []
    found: dict[str, Comparison] = {}
    for n in sizes:
        module, motion = n_four_bar(n).compile(independent=["theta0"]), Motion(n)
        for method in METHODS:
            for rtol in tolerances:
                x = found[f"{n} {method} {rtol:g}"] = compare(module, motion, n, method, rtol)
                rows.append([n, method, f"{rtol:g}", x.error, x.closed, x.factor, x.evaluations, x.seconds, x.passes])
    columns = ("loops", "method", "rtol", "error rad", "closed equation", "factor", "evaluations", "s", "passes")
    limits = (
        Limit("the largest error over that of the closed equation", max(x.factor for x in found.values()), FACTOR),
        Limit("change points noted, at least", min(x.passes for x in found.values()), 10, at_least=True),
        Limit("change points noted, at most", max(x.passes for x in found.values()), 10),
    )
    notes = (
        "10 s in which the mechanism turns about five times and passes its flat position ten times.",
        "The closed equation has one variable and is integrated by SciPy's method of the same name.",
    )
    details = {name: x._asdict() for name, x in found.items()}
    return Report((Table("N-four-bar, 10 s", columns, rows),), limits, notes, details)
