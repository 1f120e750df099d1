"""Stage verification, runs: short trajectories of a model and of its variants, events included."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...describe.description import Description
from ...describe.rewritten_texts import names_of
from ...errors import EomgenError
from ...limits.verification import RUNS
from ...simulation.simulate import simulate
from ..finding import RIGID, Finding
from .compare import FREE_CONSTANT, refused
from .cuts import cut_another
from .inputs import duration, options_of
from .probe_states import Original, compiled
from .variant import NotApplicable, Variant

LONGEST = 1.0  #: of runs with events (s)
TIMES = 6


def run_findings(
    check: str, original: Original, changes: Mapping[str, Callable[[Description, Any], Variant]], random: Any
) -> Finding:
    """Runs of the variants against the original's: outputs at some times, numbers and times of events."""
    if original.module.metadata.get("rigid_only"):
        return Finding.skipped(check, RIGID)
    k = original.states.shape[1] - 1
    end = duration(original)
    if original.description.sections["events"]:
        end = min(LONGEST, float(original.description.values.get("simulation", {}).get("end", LONGEST)))
    first = _run(original.module, original.states[:, k], end)
    worst, where, cases = 0.0, "", 0
    for name, change in {**changes, "another joint cut": cut_another}.items():
        try:
            variant = change(original.description, random)
        except NotApplicable:
            continue
        try:
            module = compiled(variant.description)
            named = variant.state(original.named(k))
            x = np.array([named[key] for key in module.x_names])
            second = _run(module, x, end * variant.scales.time)
        except EomgenError as refusal:
            return refused(check, refusal)
        error, place = _difference(original, variant, first, second)
        cases += 1
        if not error <= worst:
            worst, where = (error if np.isfinite(error) else np.inf), f"{name}: {place}"
    return Finding(check, worst, RUNS, where, cases) if cases else Finding.skipped(check, "no change applies")


def _run(module: Any, x: Any, end: float) -> Any:
    return simulate(module, (0.0, end), x, t_eval=np.linspace(0.0, end, TIMES), **options_of(module))


def _difference(original: Original, variant: Variant, first: Any, second: Any) -> tuple[float, str]:
    """The largest difference of outputs relative to their sizes, and of the times of events relative to the run."""
    worst, where = 0.0, ""
    for entry in original.description.sections["events"]:
        name = entry.name
        own = np.asarray(first.t_events[name])
        other = np.asarray(second.t_events[variant.events.get(name, name)]) / variant.scales.time
        if len(own) != len(other):
            return np.inf, f"{len(other)} events {name} instead of {len(own)}"
        if len(own) and float(np.abs(other - own).max()) / float(first.t[-1]) > worst:
            worst, where = float(np.abs(other - own).max()) / float(first.t[-1]), f"event {name}"
    if first.t.shape != second.t.shape:
        return np.inf, f"ends at t = {second.t[-1] / variant.scales.time:.6g} s instead of {first.t[-1]:.6g} s"
    texts = {e.name: e.values["expression"] for e in original.description.sections["outputs"]}
    largest: dict[str, float] = {}
    for name, sizes in zip(original.module.y_names, original.sizes, strict=True):
        kind = original.kinds[name].rstrip("xyz")
        kind = name if kind.partition(" ")[0] in ("result", "coordinate", "velocity") else kind
        seen = max(float(np.abs(first[name]).max()), float(np.max(sizes)))
        largest[kind] = max(largest.get(kind, 0.0), seen)
    for name in original.module.y_names:
        new = variant.outputs.get(name, name)
        if new not in second:
            continue
        a, b = first[name], second[new]
        if names_of(texts[name]) & set(FREE_CONSTANT):
            a, b = a - a[0], b - b[0]
        kind = original.kinds[name].rstrip("xyz")
        error = float(np.abs(a - b).max()) / largest.get(name, largest.get(kind, 1.0))
        if not error <= worst:
            worst, where = error, name
    return worst, where
