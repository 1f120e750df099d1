"""The tracked excavator with rigid contact at steps of 1 ms, beside the same scene in MuJoCo in one run."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from time import process_time
from typing import Any

import mujoco
import numpy as np

from eomgen.runtime.runs.moreau import ContactWarning

from .report import Limit, Report, Table

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from tracked_excavator import build

from .excavator_mujoco import Scene

TITLE = "the tracked excavator with rigid contact, beside MuJoCo"
STEP = 1e-3  #: (s)
#: MuJoCo's where speeds are compared (s): its mean speed after the turn is -1.10, -0.86 and -1.01 m/s at 1, 0.5 and
#: 0.25 ms, as its contacts are the stiffer the smaller its steps are.
FINE = 0.25e-3
#: Speeds of the sprocket (rad/s) over times (s): of a start, and turned round within 0.3 s.
DRIVE = ([0.0, 1.0], [0.0, 3.0])
REVERSAL = ([0.0, 1.0, 2.0, 2.3], [0.0, 3.0, 3.0, -3.0])
#: Of moreau: tolerance relative to the speeds of contacts, and iterations after the edges.
TOLERANCE, ITERATIONS = 1e-3, 1


def by_moreau(module: Any, seconds: float, speeds: tuple[list[float], list[float]]) -> Any:
    """A run of a drive."""
    options = {"method": "moreau", "step": STEP, "contact_tolerance": TOLERANCE, "contact_iterations": ITERATIONS}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ContactWarning)  # the residual is in the table
        return module.simulate(seconds, inputs={"speed": speeds}, **options)


def by_mujoco(
    model: Any, module: Any, seconds: float, speeds: tuple[list[float], list[float]], step: float = STEP
) -> tuple[float, list[float], list[float], int, float]:
    """CPU seconds, ways and speeds of the chassis at all steps, most contacts, deepest penetration at the end."""
    world = mujoco.MjModel.from_xml_string(Scene(model, module, step).text())
    data = mujoco.MjData(world)
    x, rate = int(world.joint("x").qposadr[0]), int(world.joint("x").dofadr[0])
    mujoco.mj_forward(world, data)
    most, ways, rates = 0, list[float](), list[float]()
    start = process_time()
    for _ in range(round(seconds / step)):
        data.ctrl[0] = np.interp(data.time, *speeds)
        mujoco.mj_step(world, data)
        most = max(most, data.ncon)
        ways.append(float(data.qpos[x]))
        rates.append(float(data.qvel[rate]))
    return process_time() - start, ways, rates, most, -float(data.contact.dist.min())


def ours(module: Any, seconds: float) -> list[Any]:
    """Real-time factor, way, speed, most contacts, largest residual and penetration of method moreau."""
    by_moreau(module, 2 * STEP, DRIVE)  # compiles what such runs need
    start = process_time()
    run = by_moreau(module, seconds, DRIVE)
    spent = process_time() - start
    told = run.metadata
    way, speed = float(run["x"][-1]), float(run["x_dot"][-200:].mean())
    laws = [told["contacts"], told["contact_residual"], told["missed_steps"] / told["steps"], told["penetration"]]
    return ["moreau", seconds / spent, way, speed, *laws]


def theirs(model: Any, module: Any, seconds: float) -> list[Any]:
    """The same of MuJoCo, whose contacts are soft: no residual."""
    spent, ways, speeds, most, deepest = by_mujoco(model, module, seconds, DRIVE)
    return ["MuJoCo", seconds / spent, ways[-1], sum(speeds[-200:]) / 200, most, None, None, deepest]


def turned_round(model: Any, module: Any) -> list[list[Any]]:
    """Least, greatest and mean speed of the chassis by both in parts of a drive that is turned round."""
    seconds = 4.0
    run, (_, _, theirs, _, _) = by_moreau(module, seconds, REVERSAL), by_mujoco(model, module, seconds, REVERSAL, FINE)
    t, rows = np.arange(1, round(seconds / FINE) + 1) * FINE, list[list[Any]]()
    own, other = np.interp(t, run.t, run["x_dot"]), np.array(theirs)
    for begin, end in ((1.0, 2.0), (2.0, 2.3), (2.3, 2.6), (2.6, 3.0), (3.0, 4.0)):
        part = (t > begin) & (t <= end)
        found = [float(f(v[part])) for v in (own, other) for f in (np.min, np.max, np.mean)]
        rows.append([f"{begin:g} to {end:g}", *found])
    return rows


def run(quick: bool) -> Report:
    """Both drives, one after the other."""
    model = build()
    module = model.compile()
    seconds = 1.0 if quick else 3.0
    rows = [ours(module, seconds), theirs(model, module, seconds)]
    head = ("method", "of real time", "way m", "speed m/s", "contacts", "residual m/s", "steps missed", "penetration m")
    limits = (
        Limit("excavator by moreau at 1e-3, of real time", rows[0][1], 1.0, at_least=True),
        Limit("part of the steps that miss the tolerance", rows[0][6], 0.04),
        Limit("its way beside MuJoCo's", abs(rows[0][2] / rows[1][2] - 1.0), 0.01),
    )
    notes = (
        f"{seconds:g} s from rest to 0.95 m/s, CPU seconds of one core, steps of 1 ms.",
        "moreau with contact_tolerance=1e-3 and contact_iterations=1: edges of cones one by one, then a Newton step.",
        "MuJoCo: implicitfast, elliptic cones, Newton, time constants of 2 ms; the upper structure is rigid there.",
        "Penetration: the deepest of the run by moreau, its start among it; that at the end in MuJoCo.",
        f"Turned round: MuJoCo's steps are of {1e3 * FINE:g} ms, since its speeds change with them by up to 0.25 m/s.",
    )
    tables = [Table("drive on flat ground", head, rows)]
    if not quick:
        turned = turned_round(model, module)
        parts = ("time s", "least m/s", "greatest", "mean", "MuJoCo's least", "greatest", "mean")
        tables.append(Table("turned round from 0.95 m/s within 0.3 s", parts, turned))
        worst = float(max(abs(row[3] - row[6]) for row in turned))
        limits = (*limits, Limit("turned round: mean speeds beside MuJoCo's", worst, 0.1, "m/s"))
    return Report(tuple(tables), limits, notes, {"rows": rows})
