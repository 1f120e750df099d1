"""Nanoseconds of one rhs call from Python, beside SymPy's lambdify of the same equations."""

from __future__ import annotations

from typing import Any

import numpy as np

import eomgen as eg

from .measure import interleaved, seconds_per_call
from .models import EXAMPLES
from .peers import pendulum_rhs
from .report import Limit, Report, Table

TITLE = "one call of rhs from Python"


def run(quick: bool) -> Report:
    """Time calls in turns; the pendulum's result is compared with SymPy's first."""
    budget, repeats = (0.02, 2) if quick else (0.2, 9)
    crank = eg.load(EXAMPLES / "slider_crank.yaml").compile()
    pendulum = eg.load(EXAMPLES / "double_pendulum.yaml").compile()
    x_crank, x = crank.x0(), np.array([0.7, -0.4, 1.1, 2.3])
    if pendulum.x_names != ("theta1", "bend", "theta1_dot", "bend_dot"):
        raise RuntimeError(f"the state of the pendulum has another order: {pendulum.x_names}")
    lambdified = pendulum_rhs(dict(zip(pendulum.p_names, pendulum.p.tolist(), strict=True)))
    expected = np.array(lambdified(0.0, x))
    difference = float(np.abs(pendulum.rhs(0.0, x) - expected).max() / np.abs(expected).max())
    out_crank, out, numbers = np.empty_like(x_crank), np.empty_like(x), x.tolist()
    rhs, rhs_crank = pendulum.rhs, crank.rhs
    calls = {
        "double pendulum, out=": lambda: rhs(0.0, x, out=out),
        "double pendulum": lambda: rhs(0.0, x),
        "double pendulum, SymPy lambdify": lambda: lambdified(0.0, x),
        "double pendulum, SymPy lambdify on floats": lambda: lambdified(0.0, numbers),
        "slider-crank, out=": lambda: rhs_crank(0.0, x_crank, out=out_crank),
        "slider-crank": lambda: rhs_crank(0.0, x_crank),
        "slider-crank, minimal": lambda: minimal(0.0, x_minimal),
        "an empty lambda": lambda: None,
    }
    reduced = crank.minimal
    minimal, x_minimal = reduced.rhs, reduced.x0()
    actions = {name: lambda call=call: seconds_per_call(call, budget) for name, call in calls.items()}
    samples = interleaved(repeats, **actions)
    base = samples["double pendulum"].median
    rows: list[list[Any]] = []
    for name, sample in samples.items():
        ratio = sample.median / base if "SymPy" in name else None
        rows.append([name, sample.median * 1e9, sample.best * 1e9, ratio])
    notes = (
        "Each includes the lambda around it (last row). SymPy's: solved symbolically, cse, plain math, numbers for the",
        "parameters, a list as result; ours: parameters variable, a NumPy array as result.",
        "The slider-crank's rhs projects onto the loop; its minimal form solves the loop by Newton from the last call.",
    )
    details = {name: sample.as_dict() for name, sample in samples.items()}
    limit = Limit("SymPy's accelerations of the pendulum differ by", difference, 1e-12)
    table = Table("call", ("what", "median ns", "best ns", "over ours, allocating"), rows)
    return Report((table,), (limit,), notes, details)
