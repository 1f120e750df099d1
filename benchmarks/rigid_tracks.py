"""The tracked excavator with rigid contact at steps of 1 ms, beside the same scene in MuJoCo in one run."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from time import process_time
from typing import Any

import mujoco

from eomgen.simulation.moreau import ContactWarning

from .report import Limit, Report, Table

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from tracked_excavator import build

from .excavator_mujoco import Scene

TITLE = "the tracked excavator with rigid contact, beside MuJoCo"
STEP, FULL = 1e-3, 3.0  #: (s), and speed of the sprocket (rad/s) that is reached after 1 s
#: Of moreau: tolerance relative to the speeds of contacts, and iterations after the edges.
TOLERANCE, ITERATIONS = 1e-3, 1


def ours(module: Any, seconds: float) -> list[Any]:
    """Real-time factor, way, speed, most contacts, largest residual and penetration of method moreau."""
    options = {"method": "moreau", "step": STEP, "contact_tolerance": TOLERANCE, "contact_iterations": ITERATIONS}
    drive = {"speed": ([0.0, 1.0], [0.0, FULL])}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ContactWarning)  # the residual is in the table
        module.simulate(2 * STEP, inputs=drive, **options)  # compiles what such runs need
        start = process_time()
        run = module.simulate(seconds, inputs=drive, **options)
        spent = process_time() - start
    told = run.metadata
    way, speed = float(run["x"][-1]), float(run["x_dot"][-200:].mean())
    laws = [told["contacts"], told["contact_residual"], told["missed_steps"] / told["steps"], told["penetration"]]
    return ["moreau", seconds / spent, way, speed, *laws]


def theirs(model: Any, module: Any, seconds: float) -> list[Any]:
    """The same of MuJoCo, whose contacts are soft: no residual."""
    world = mujoco.MjModel.from_xml_string(Scene(model, module, STEP).text())
    data = mujoco.MjData(world)
    x, rate = int(world.joint("x").qposadr[0]), int(world.joint("x").dofadr[0])
    mujoco.mj_forward(world, data)
    most, speeds = 0, []
    start = process_time()
    for _ in range(round(seconds / STEP)):
        data.ctrl[0] = FULL * min(data.time, 1.0)
        mujoco.mj_step(world, data)
        most = max(most, data.ncon)
        speeds.append(float(data.qvel[rate]))
    spent = process_time() - start
    deepest = -float(data.contact.dist.min())
    return ["MuJoCo", seconds / spent, float(data.qpos[x]), sum(speeds[-200:]) / 200, most, None, None, deepest]


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
    )
    return Report((Table("drive on flat ground", head, rows),), limits, notes, {"rows": rows})
