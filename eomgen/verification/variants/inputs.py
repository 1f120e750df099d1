"""Stage verification, inputs: one course over time as table, function, text of the model, and as a parameter.

The course of each input is a straight line, of which a table is exact; a parameter stands for a constant input.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...describe.rewritten_texts import number_of
from ...describe.visit import copied
from ...limits.verification import ATOL, RTOL, RUNS
from ...simulation.simulate import simulate
from ..finding import Finding
from .compare import compare_module
from .probe_states import OBSERVED, Original, compiled
from .variant import Variant

if TYPE_CHECKING:
    from ...describe.builder import Builder

#: Tolerances of the runs, and what two runs with them may differ by, relative to the size of the state.
SLOPE = 0.3


class LineOverTime(NamedTuple):
    """A straight line over time: a Python function of time and state that knows its rates."""

    start: float
    slope: float

    def __call__(self, t: float, x: Any) -> float:
        """The value at time t (s)."""
        return self.start + self.slope * t

    def derivative(self) -> LineOverTime:
        """Its rate, as a function too."""
        return LineOverTime(self.slope, 0.0)


def input_findings(check: str, model: Builder, original: Original, random: Any) -> Finding:
    """All ways to give the inputs of a model."""
    entries = original.description.sections["inputs"]
    if not entries:
        return Finding.skipped(check, "the model has no inputs")
    if any("signal" in entry.values for entry in entries):
        return Finding.skipped(check, "the inputs have signals of their own")
    still = _as_parameters(check, original)
    if not still.ok or original.module.metadata.get("rigid_only"):  # no integrator runs these
        return still
    end, how = duration(original), options_of(original.module)
    start = {e.name: number_of(e.values.get("value", 0.0), {}) for e in entries}
    slope = {name: SLOPE * (abs(value) + 1.0) for name, value in start.items()}
    x, times = original.states[:, 0], np.linspace(0.0, end, 5)

    course = {name: LineOverTime(start[name], slope[name]) for name in start}
    table = {name: (times, start[name] + slope[name] * times) for name in start}
    runs = {
        "function": simulate(original.module, (0.0, end), x, inputs=course, t_eval=times, **how),
        "table": simulate(original.module, (0.0, end), x, inputs=table, t_eval=times, **how),
    }
    made = copied(original.description)
    for entry in made.sections["inputs"]:
        entry.values["signal"] = f"{start[entry.name]!r} + {slope[entry.name]!r}*t"
    runs["text"] = simulate(compiled(made), (0.0, end), x, t_eval=times, **how)
    worst, where = (0.0, "") if still.left_out else (still.worst * RUNS / still.limit, still.where)
    for way in ("table", "text"):
        size = np.abs(runs["function"].x).max(axis=1, initial=1.0)
        same = runs[way].x.shape == runs["function"].x.shape
        error = float((np.abs(runs[way].x - runs["function"].x).max(axis=1) / size).max()) if same else np.inf
        if not error <= worst:
            worst, where = (error if np.isfinite(error) else np.inf), f"as {way}, up to t = {end:.3g} s"
    return Finding(check, worst, RUNS, where, 4)


def _as_parameters(check: str, original: Original) -> Finding:
    """Inputs as parameters of the same values."""
    made = copied(original.description)
    for entry in made.sections["inputs"]:
        value = number_of(entry.values.get("value", 0.0), {})
        made.add("parameters", entry.name, {"value": value})
    made.sections["inputs"] = []
    return compare_module(check, original, Variant(made), compiled(made, kernels=OBSERVED))


def options_of(module: Any) -> dict[str, Any]:
    """Options of these runs: tight tolerances; an integrator where the model itself runs by the method moreau."""
    declared = module.metadata.get("simulation", {}).get("method")
    return {"rtol": RTOL, "atol": ATOL, **({"method": "DOP853"} if declared == "moreau" else {})}


def duration(original: Original) -> float:
    """A time in which the motion of the first state goes on a little: a fifth of a radian or of the size."""
    n = original.module.n_q
    rates = original.module.rhs(0.0, original.states[:, 0])
    fast = max(float(np.abs(rates[:n]).max(initial=0.0)), float(np.abs(rates[n:]).max(initial=0.0)) ** 0.5, 1.0)
    return float(0.2 / fast)
