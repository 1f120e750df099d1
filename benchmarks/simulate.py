"""Wall time of simulations: the slider-crank, Andrews' squeezer, and the double pendulum beside SymPy and SciPy."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import eomgen as eg

from .measure import interleaved, seconds_of
from .models import EXAMPLES
from .peers import pendulum_rhs
from .report import Limit, Report, Table

TITLE = "simulation"
ENDS = {"slider_crank": 5.0, "andrews_squeezer": 0.03, "double_pendulum": 10.0}


def run(quick: bool) -> Report:
    """Simulate the examples at the tolerances of their files, in turns with the peer."""
    names = [name for name in ENDS if not (quick and name == "andrews_squeezer")]
    modules = {name: eg.load(EXAMPLES / f"{name}.yaml").compile() for name in names}
    pendulum = modules["double_pendulum"]
    x0, settings = pendulum.x0(), pendulum.metadata["simulation"]
    lambdified = pendulum_rhs(dict(zip(pendulum.p_names, pendulum.p.tolist(), strict=True)))
    results: dict[str, Any] = {}

    def ours(name: str) -> None:
        results[name] = modules[name].simulate((0.0, ENDS[name]))

    def solve(rhs: Any, end: float) -> Any:
        return solve_ivp(rhs, (0.0, end), x0, method="DOP853", rtol=settings["rtol"], atol=settings["atol"])

    def plain(name: str, rhs: Any) -> None:
        results[name] = solve(rhs, ENDS["double_pendulum"])

    actions = {name: lambda name=name: seconds_of(lambda: ours(name)) for name in names}
    peers = {"solve_ivp on mod.rhs": pendulum.rhs, "solve_ivp on SymPy lambdify": lambdified}
    actions |= {name: lambda name=name, f=f: seconds_of(lambda: plain(name, f)) for name, f in peers.items()}
    samples = interleaved(1 if quick else 7, **actions)
    base = samples["double_pendulum"].median
    rows: list[list[Any]] = []
    details: dict[str, Any] = {}
    for name, sample in samples.items():
        steps, calls = len(results[name].t) - 1, int(results[name].nfev)
        ratio = sample.median / base if name in peers else None
        label = f"double_pendulum, {name}" if name in peers else f"{name}, {ENDS[name]:g} s"
        rows.append([label, sample.median * 1e3, sample.best * 1e3, ratio, steps, calls, sample.median / calls * 1e6])
        details[name] = {**sample.as_dict(), "steps": steps, "calls": calls}
    finals = [solve(rhs, 1.0).y[:, -1] for rhs in peers.values()]
    difference = float(np.abs(finals[0] - finals[1]).max())
    columns = ("simulation", "median ms", "best ms", "over simulate", "steps", "calls of rhs", "us a call")
    notes = (
        "simulate also projects every stored state onto the loops and evaluates the outputs.",
        "Tolerances and integrator (DOP853) are those of the example's file, for every row.",
    )
    limit = Limit("the double pendulum after 1 s, SymPy's and ours, differs by", difference, 1e-8)
    return Report((Table("simulation", columns, rows),), (limit,), notes, details)
