"""Closed loops side by side: ensembles and batches in lanes, beside one state after the other."""

from __future__ import annotations

from typing import Any

import numpy as np

import eomgen as eg

from .measure import interleaved, seconds_of
from .models import EXAMPLES
from .report import Limit, Report, Table

TITLE = "closed loops in lanes"
COUNT, END, RTOL, ATOL = 1000, 10.0, 1e-8, 1e-10
LEAST = 3.0  #: times the rate of runs one after the other
MODELS = ("slider_crank", "four_bar", "bricard", "excavator", "stewart_platform")


def runs(name: str, count: int, repeats: int) -> dict[str, Any]:
    """Seconds of an ensemble with and without lanes, in turns, and the largest errors at the end of both."""
    model = eg.load(EXAMPLES / f"{name}.yaml")
    wide, alone = model.compile(), model.compile(lanes=0)
    start = {"theta": 0.3, "theta_dot": np.linspace(5.0, 15.0, count)}
    options: dict[str, Any] = {"rtol": RTOL, "atol": ATOL, "threads": 2}
    found = {key: mod.simulate_many(END, start, **options) for key, mod in (("lanes", wide), ("alone", alone))}
    exact = alone.simulate_many(END, start, **options | {"rtol": 1e-12, "atol": 1e-14}).x
    one = wide.simulate_many(END, start, **options | {"threads": 1})
    times = interleaved(
        repeats,
        lanes=lambda: seconds_of(lambda: wide.simulate_many(END, start, **options)),
        alone=lambda: seconds_of(lambda: alone.simulate_many(END, start, **options)),
    )
    return {
        "seconds": {key: sample.median for key, sample in times.items()},
        "best": {key: sample.best for key, sample in times.items()},
        "errors": {key: float(np.median(np.abs(x.x - exact).max(axis=0))) for key, x in found.items()},
        "same bits": bool((one.x == found["lanes"].x).all()),
        "width": wide.core.core.lane_width,
    }


def batches(name: str, columns: int, repeats: int) -> dict[str, float]:
    """Nanoseconds a state of a batch of right-hand sides with and without lanes."""
    model = eg.load(EXAMPLES / f"{name}.yaml")
    wide, alone = model.compile(), model.compile(lanes=0)
    x = wide.x0()[:, None] + 1e-3 * np.random.default_rng(0).standard_normal((wide.n_x, columns))
    out = np.empty_like(x)
    same = bool((wide.rhs(0.0, x) == alone.rhs(0.0, x)).all())
    times = interleaved(
        repeats,
        lanes=lambda: seconds_of(lambda: wide.rhs(0.0, x, out=out)),
        alone=lambda: seconds_of(lambda: alone.rhs(0.0, x, out=out)),
    )
    return {key: 1e9 * sample.median / columns for key, sample in times.items()} | {"same bits": same}


def run(quick: bool) -> Report:
    """Time both in turns."""
    count, repeats = (40, 1) if quick else (COUNT, 7)
    ensemble = runs("slider_crank", count, repeats)
    rate = {key: count / seconds for key, seconds in ensemble["seconds"].items()}
    ratio = rate["lanes"] / rate["alone"]
    found = {name: batches(name, 64 if quick else 4096, repeats) for name in MODELS}
    tables = (
        Table(
            f"{count} slider-cranks, {END:.0f} s, rtol {RTOL:g}, two threads",
            ("runs", "runs a second", "best", "median error"),
            [
                (label, rate[key], count / ensemble["best"][key], ensemble["errors"][key])
                for key, label in (("lanes", f"{ensemble['width']} side by side"), ("alone", "one after the other"))
            ],
        ),
        Table(
            "right-hand sides of a batch, nanoseconds a state",
            ("model", "lanes", "one after the other", "ratio", "same bits"),
            [(name, x["lanes"], x["alone"], x["alone"] / x["lanes"], x["same bits"]) for name, x in found.items()],
        ),
    )
    limits = (
        Limit("runs in lanes over runs one after the other", ratio, LEAST, at_least=True),
        Limit("runs that differ between one thread and two", float(not ensemble["same bits"]), 0.0),
    )
    notes = (
        "Errors are the largest of a run's states at the end, beside runs at 1e-12.",
        "Both include the initial states, which are assembled together, and the projection of the last states.",
    )
    return Report(tables, limits, notes, {"ensemble": ensemble, "batches": found})
