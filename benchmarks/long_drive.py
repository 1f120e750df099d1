"""A minute of driving on chains with rigid contact: forwards, backwards and to a stop, no link lost."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from eomgen.runtime.runs.moreau import ContactWarning

from .report import Limit, Report, Table

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from tracked_excavator import build

TITLE = "the tracked excavator drives for a minute with rigid contact"
STEP, TOLERANCE, ITERATIONS = 1e-3, 1e-3, 1  #: as in rigid_tracks
FULL = 3.0  #: speed of the sprocket (rad/s)
#: Part of the run at which a speed of the sprocket is reached, and the speed over the full one.
SHORT = ((0.0, 0.0), (0.25, 1.0), (0.7, 1.0), (0.9, 0.0), (1.0, 0.0))
PLAN = ((0.0, 0.0), (0.02, 1.0), (0.45, 1.0), (0.5, -1.0), (0.9, -1.0), (0.93, 0.0), (1.0, 0.0))


def drive(module: Any, seconds: float, plan: tuple[tuple[float, float], ...] = PLAN) -> tuple[Any, float]:
    """The run and its CPU seconds."""
    speed = ([part * seconds for part, _ in plan], [FULL * x for _, x in plan])
    options = {"method": "moreau", "step": STEP, "contact_tolerance": TOLERANCE, "contact_iterations": ITERATIONS}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ContactWarning)  # the residual is in the table
        module.simulate(2 * STEP, **options)  # compiles what such runs need
        start = process_time()
        run = module.simulate(seconds, inputs={"speed": speed}, **options)
    return run, process_time() - start


def turns_around(pins: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """How often closed lines (k, n, 2) go round points (k, 2)."""
    arms = pins - centre[:, None]
    after = np.roll(arms, -1, axis=1)
    cross = arms[..., 0] * after[..., 1] - arms[..., 1] * after[..., 0]
    found: np.ndarray = np.arctan2(cross, (arms * after).sum(axis=-1)).sum(axis=1) / (2.0 * np.pi)
    return found


def judge(module: Any, run: Any) -> dict[str, float]:
    """What must hold of a drive.

    ``turns``: the least number of turns of the chain around sprocket and idler; ``farthest``: the largest distance of a
    pin from the nearest of the places where the pins lay at the start, seen from the frame, in pitches of the chain;
    ``open``: how far the chain is open (m); ``gained``: energy that no motor gave, over the largest kinetic one.
    """
    some = slice(None, None, 10)
    poses = module.poses(np.ascontiguousarray(run.q[:, some]))
    names = list(module.body_names)
    frame, places = names.index("frame"), {name: poses[names.index(name), :2, 3].T for name in names}
    links = [name for name in names if name.startswith("link") and name[4:].isdigit()]
    pins = np.stack([places[name] for name in links], axis=1)
    turns = [np.abs(turns_around(pins, places[name])).min() for name in ("sprocket", "idler")]
    turned = poses[frame, :2, :2]
    seen = np.einsum("ijk,kni->knj", turned, pins - places["frame"][:, None])
    pitch = float(np.linalg.norm(seen[0, 1] - seen[0, 0]))
    apart = np.linalg.norm(seen[:, :, None] - seen[0][None, None], axis=-1).min(axis=2)
    power = np.asarray(run["drive"])
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(run.t))])
    beyond = run["energy"] - run["energy"][0] - work
    return {
        "turns": float(min(turns)),
        "farthest": float(apart.max() / pitch),
        "open": float(run.residuals.raw_position),
        "gained": float(beyond.max() / run["T"].max()),
    }


def run(quick: bool) -> Report:
    """The drive and what is judged of it."""
    module = build().compile()
    seconds = 6.0 if quick else 60.0
    trip, spent = drive(module, seconds, SHORT if quick else PLAN)
    found = judge(module, trip)
    told = trip.metadata
    way = float(np.abs(np.diff(trip["x"])).sum())
    row = [seconds / spent, way, told["penetration"], told["contact_residual"], *found.values()]
    head = ("of real time", "way m", "penetration m", "residual m/s", "turns", "farthest pitches", "open m", "gained")
    limits = (
        Limit("of real time", row[0], 1.0, at_least=True),
        Limit("turns of the chain around its wheels", found["turns"], 0.999, at_least=True),
        Limit("farthest pin, in pitches", found["farthest"], 1.0),
        Limit("penetration, in m", told["penetration"], 0.01),
        Limit("energy that no motor gave, over the kinetic one", found["gained"], 0.01),
    )
    notes = (
        f"{seconds:g} s: forwards, {'' if quick else 'backwards, '}and to a stop; steps of 1 ms; CPU time of one core.",
        "Penetration: the deepest of the run, its start among it, where shapes lie 3.6 mm in each other.",
        "Turns: the least number of turns of the line of pins around sprocket and idler.",
        "Farthest: distance of a pin from the nearest place of a pin at the start, seen from the frame.",
        "Gained: the most by which energy exceeds that of the start and the work of the motor.",
    )
    return Report((Table("a drive", head, [row]),), limits, notes, {"row": row})
