"""Closed tracks of many links round wheels, and the tracked excavator: derivation, calls, contact, runs, MuJoCo."""

from __future__ import annotations

import math
import subprocess
import tempfile
import warnings
from itertools import pairwise
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

import eomgen as eg
from eomgen import pipeline
from eomgen.base.kernel_table import KERNELS
from eomgen.codegen.c import emit_c
from eomgen.codegen.c_pairs import pair_files
from eomgen.runtime.impacts.moreau import ContactWarning
from eomgen.toolchain.compiler import find_compiler
from eomgen.toolchain.layer import read_header

from .harness import Report, benchmark, cold_cache, in_turns, spent, timed, work
from .kernels import our_flags

Speeds = tuple[list[float], list[float]]
#: Speeds of the sprocket (rad/s) over times (s): a start, and turned round within 0.3 s.
START: Speeds = ([0.0, 1.0], [0.0, 3.0])
REVERSAL: Speeds = ([0.0, 1.0, 2.0, 2.3], [0.0, 3.0, 3.0, -3.0])


def track(links: int) -> eg.Model:
    """A track of so many links, with a roller for six of them, under a frame."""
    from tracked_excavator import Track, undercarriage

    m = eg.Model(f"track_{links}", gravity=(0, -9.81, 0))
    undercarriage(m, Track(links=links, rollers=links // 6), 400.0 * links, {"zz": 20.0 * links**2})
    return m


def excavator() -> eg.Model:
    """The example."""
    from tracked_excavator import build

    return build()


def moving(module: Any) -> np.ndarray:
    """A state near the first in which all moves a little."""
    x = module.x0()
    x[module.n_q :] = 0.01 * np.sin(np.arange(module.n_x - module.n_q))
    return np.asarray(module.project(x))


# -- contact by laws ---------------------------------------------------------------------------------------------------
class Built:
    """A model, derived and compiled with an empty cache, and what that took."""

    def __init__(self, model: eg.Model) -> None:
        start, wall = work(), perf_counter()
        equations = model.derive()
        self.derive = work() - start
        mod = self.module = equations.compile()
        self.seconds, self.wall = work() - start, perf_counter() - wall
        sources = emit_c(pipeline.build(equations, "c"))
        self.text = sum(map(len, sources.values())) / 1e6
        self.pairs = sum(len(text) for name, text in sources.items() if "_pairs_" in name) / 1e6
        x, out = moving(mod), np.empty(mod.n_x)
        calls = {
            "rhs": timed(lambda: mod.rhs(0.0, x, out=out)),
            "project": timed(lambda: mod.project(x)),
            "jacobian": timed(lambda: mod.jacobian(0.0, x)),
        }
        self.us = {name: 1e6 * sample.median for name, sample in in_turns(calls, 7, 0.05).items()}


@benchmark("tracks", "tracks of many links")
def tracks(report: Report, quick: bool) -> None:
    """Closed tracks of 40 to 320 links round wheels, then the excavator and its runs, from an empty cache."""
    with cold_cache():
        rows: list[list[Any]] = []
        for links in (40, 80) if quick else (40, 80, 160, 320):
            built = Built(track(links))
            us = built.us
            rows.append([links, built.module.n_x, built.derive, built.seconds, built.text, built.pairs, us["rhs"],
                         us["project"], us["jacobian"] / 1000])  # fmt: skip
        report.table("closed tracks", ("links", "n_x", "derive s", "with compilation, CPU s", "text MB",
                     "of contacts MB", "rhs us", "project us", "jacobian ms"), rows)  # fmt: skip
        report.result(f"rhs of a track of {rows[-1][0]} links, us", rows[-1][6], {"40 links": rows[0][6]})
        report.most(f"a call of {rows[-1][0]} links over one of 40", rows[-1][6] / rows[0][6], 10.0)
        report.most(f"text of contacts of {rows[-1][0]} links over 40", rows[-1][5] / rows[0][5], 1.05)
        for column, what in ((2, "derive"), (6, "rhs"), (7, "project")):
            growth = max(b[column] / a[column] / (b[0] / a[0]) for a, b in pairwise(rows))
            report.most(f"{what}, growth over that of links", growth, 1.4)
        machine, seconds, found = Built(excavator()), 0.5 if quick else 5.0, []
        for method in ("RK23", "RK45", "DOP853", "Radau"):
            options = {"method": method, "rtol": 1e-4, "atol": 1e-5}
            run, cpu = spent(
                lambda options=options: machine.module.simulate((0, seconds), inputs={"speed": START}, **options),
                process_time,
            )
            found.append([method, seconds / cpu, len(run.t), run.nfev, float(run["x"][-1])])
    title = "excavator, 49 links, from rest to 0.95 m/s"
    report.table(title, ("method", "of real time", "steps", "calls", "way m"), found)
    report.most("excavator, derived and compiled", machine.wall, 30.0, "s")
    report.result(f"{title}, times real time", max(row[1] for row in found))
    report.least("excavator at 1e-4, of real time", max(row[1] for row in found), 0.2)
    mine = f"rhs {machine.us['rhs']:.1f} us, jacobian {machine.us['jacobian'] / 1000:.1f} ms"
    report.note(
        "Derivation and compilation take CPU seconds of this process and the compilers, all functions of a model.",
        f"The excavator: n_x {machine.module.n_x}, {mine}, {machine.seconds:.1f} s of CPU to derive and compile.",
    )


def polygons(corners: int) -> eg.Model:
    """Two polygons with so many corners each."""
    m = eg.Model(f"polygons_{corners}", gravity=(0, -9.81, 0))
    shapes = []
    for k in range(2):
        body = m.body(f"b{k}", mass=1.0, inertia={"zz": 0.02})
        m.planar(f"j{k}", m.ground.at(0, 0.3 * k, 0), body)
        turns = [2.0 * math.pi * i / corners for i in range(corners)]
        points = [(0.2 * math.cos(turn), 0.16 * math.sin(turn)) for turn in turns]
        shapes.append({"shape": "polygon", "on": body, "points": points})
    m.contacts("among", shapes, law={"stiffness": 1e4, "dissipation": 0.3, "friction": 0.4, "smoothing": 1e-2})
    return m


def seconds_to_compile(sources: dict[str, str]) -> float:
    """Seconds of a processor for the files of contacts, with the flags of a module; the least of three."""
    with tempfile.TemporaryDirectory() as folder:
        headers = {name: read_header(name) for name in ("eomgen.h", "eomgen_real.h", "eomgen_pairs.h")}
        for name, text in {**headers, **sources}.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        command = [*find_compiler().command, *our_flags(), "-o", "made.o", "-c"]

        def compile_pairs() -> None:
            for name in (name for name in sources if "_pairs_" in name):
                subprocess.run([*command, name], cwd=folder, check=True, capture_output=True)

        return min(spent(compile_pairs, work)[1] for _ in range(3))


@benchmark("track_contacts", "text and compilation of contacts")
def track_contacts(report: Report, quick: bool) -> None:
    """Of closed tracks of 40 and 320 links, and of polygons of 8 and 32 corners: text, its compilation, a call."""
    links = 80 if quick else 320
    models = {f"track of {count} links": track(count) for count in (40, links)}
    models |= {f"two polygons of {count} corners": polygons(count) for count in (8, 32)}
    rows: list[list[Any]] = []
    for name, model in models.items():
        equations = model.derive()
        contacts = pair_files(pipeline.build(equations, "c", ["rhs", "jacobian", "meeting_time", "near_pairs"]))
        seconds = seconds_to_compile({**emit_c(pipeline.build(equations, "c", ["energy"])), **contacts})
        mod = equations.compile(kernels=[k.name for k in KERNELS if not k.lazy and k.name != "jacobian"])
        x, out = moving(mod), np.empty(mod.n_x)
        call = timed(lambda mod=mod, x=x, out=out: mod.rhs(0.0, x, out=out), process_time)
        best = min(call(20) for _ in range(40))
        rows.append([name, mod.n_x, sum(map(len, contacts.values())), seconds, 1e6 * best])
    few, many, small, large = rows
    report.table("contacts", ("model", "n_x", "text of contacts, characters", "its compilation, CPU s", "rhs, CPU us"),
                 rows)  # fmt: skip
    report.result(f"text of contacts of a track of {links} links, characters", many[2], {"40 links": few[2]})
    report.most(f"text of contacts of {links} links over 40", many[2] / few[2], 1.05)
    report.most(f"compilation of contacts of {links} links over 40", many[3] / few[3], 1.2)
    report.most(f"a call of {links} links over one of 40", many[4] / few[4], 10.0)
    report.most("text of two polygons, 32 corners over 8", large[2] / small[2], 1.05)
    report.note("A track's: links on the ground, on wheels and on a sprocket's teeth; values and derivatives.")


# -- rigid contact -----------------------------------------------------------------------------------------------------
#: Of method moreau: steps (s), tolerance relative to the speeds of contacts, and iterations after the edges.
MOREAU = {"method": "moreau", "step": 1e-3, "contact_tolerance": 1e-3, "contact_iterations": 1}
#: MuJoCo's step where speeds are compared (s): its mean speed after the turn is -1.10, -0.86 and -1.01 m/s at 1, 0.5
#: and 0.25 ms, as its contacts are the stiffer the smaller its steps are.
FINE = 0.25e-3


def by_moreau(module: Any, seconds: float, speeds: Speeds) -> tuple[Any, float]:
    """A run of a drive and its CPU seconds, after a short one that compiles what such runs need."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ContactWarning)  # the residual is in the table
        module.simulate(2e-3, inputs={"speed": speeds}, **MOREAU)
        return spent(lambda: module.simulate(seconds, inputs={"speed": speeds}, **MOREAU), process_time)


def by_mujoco(model: Any, module: Any, seconds: float, speeds: Speeds, step: float) -> tuple[np.ndarray, list[Any]]:
    """Speeds of the chassis at all steps, and CPU seconds, way, most contacts, deepest penetration at the end."""
    import mujoco

    from .models.excavator_mujoco import Scene

    world = mujoco.MjModel.from_xml_string(Scene(model, module, step).text())
    data = mujoco.MjData(world)
    x, rate = int(world.joint("x").qposadr[0]), int(world.joint("x").dofadr[0])
    mujoco.mj_forward(world, data)
    most, rates, start = 0, list[float](), process_time()
    for _ in range(round(seconds / step)):
        data.ctrl[0] = np.interp(data.time, *speeds)
        mujoco.mj_step(world, data)
        most = max(most, data.ncon)
        rates.append(float(data.qvel[rate]))
    cpu = process_time() - start
    return np.array(rates), [cpu, float(data.qpos[x]), most, -float(data.contact.dist.min())]


@benchmark("rigid_tracks", "the tracked excavator with rigid contact, beside MuJoCo")
def rigid_tracks(report: Report, quick: bool) -> None:
    """The same drives on flat ground by both, one after the other."""
    model, seconds = excavator(), 1.0 if quick else 3.0
    module = model.compile()
    run, cpu = by_moreau(module, seconds, START)
    facts, way = run.metadata, float(run["x"][-1])
    rates, (theirs, far, most, deepest) = by_mujoco(model, module, seconds, START, MOREAU["step"])
    missed = facts["missed_steps"] / facts["steps"]
    rows = [
        ["moreau", seconds / cpu, way, float(run["x_dot"][-200:].mean()), facts["contacts"],
         facts["contact_residual"], missed, facts["penetration"]],
        ["MuJoCo", seconds / theirs, far, float(rates[-200:].mean()), most, None, None, deepest],
    ]  # fmt: skip
    report.table("drive on flat ground", ("method", "of real time", "way m", "speed m/s", "contacts", "residual m/s",
                 "steps missed", "penetration m"), rows)  # fmt: skip
    report.result("excavator with rigid contact, times real time", seconds / cpu, {"MuJoCo": seconds / theirs})
    report.least("excavator by moreau at 1e-3, of real time", seconds / cpu, 1.0)
    report.most("part of the steps that miss the tolerance", missed, 0.04)
    report.most("its way beside MuJoCo's", abs(way / far - 1.0), 0.01)
    if not quick:
        run, (other, _) = by_moreau(module, 4.0, REVERSAL)[0], by_mujoco(model, module, 4.0, REVERSAL, FINE)
        t = np.arange(1, len(other) + 1) * FINE
        own, parts = np.interp(t, run.t, run["x_dot"]), []
        for begin, end in pairwise((1.0, 2.0, 2.3, 2.6, 3.0, 4.0)):
            part = (t > begin) & (t <= end)
            found = [float(f(v[part])) for v in (own, other) for f in (np.min, np.max, np.mean)]
            parts.append([f"{begin:g} to {end:g}", *found])
        report.table("turned round from 0.95 m/s within 0.3 s", ("time s", "least m/s", "greatest", "mean",
                     "MuJoCo's least", "greatest", "mean"), parts)  # fmt: skip
        report.most("turned round: mean speeds beside MuJoCo's", max(abs(p[3] - p[6]) for p in parts), 0.1, "m/s")
    report.note(
        f"{seconds:g} s from rest to 0.95 m/s, CPU seconds of one core, steps of 1 ms.",
        "moreau with contact_tolerance=1e-3 and contact_iterations=1: edges of cones one by one, then a Newton step.",
        "MuJoCo: implicitfast, elliptic cones, Newton, time constants of 2 ms; the upper structure is rigid there.",
        "Penetration: the deepest of the run by moreau, its start among it; that at the end in MuJoCo.",
        f"Turned round: MuJoCo's steps are of {1e3 * FINE:g} ms, since its speeds change with them by up to 0.25 m/s.",
    )


#: Part of a long drive at which a speed of the sprocket is reached, and the speed over 3 rad/s.
PLAN = ((0.0, 0.0), (0.02, 1.0), (0.45, 1.0), (0.5, -1.0), (0.9, -1.0), (0.93, 0.0), (1.0, 0.0))
FORWARDS = ((0.0, 0.0), (0.25, 1.0), (0.7, 1.0), (0.9, 0.0), (1.0, 0.0))


def turns_around(pins: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """How often closed lines (k, n, 2) go round points (k, 2)."""
    arms = pins - centre[:, None]
    after = np.roll(arms, -1, axis=1)
    cross = arms[..., 0] * after[..., 1] - arms[..., 1] * after[..., 0]
    return np.asarray(np.arctan2(cross, (arms * after).sum(axis=-1)).sum(axis=1) / (2.0 * np.pi))


@benchmark("long_drive", "the tracked excavator drives for a minute with rigid contact")
def long_drive(report: Report, quick: bool) -> None:
    """Forwards, backwards and to a stop: no link is lost, nothing sinks in, no energy comes from nowhere."""
    module, seconds, plan = excavator().compile(), *((6.0, FORWARDS) if quick else (60.0, PLAN))
    run, cpu = by_moreau(module, seconds, ([part * seconds for part, _ in plan], [3.0 * x for _, x in plan]))
    poses, names = module.poses(np.ascontiguousarray(run.q[:, ::10])), list(module.body_names)
    places = {name: poses[names.index(name), :2, 3].T for name in names}
    links = [name for name in names if name.startswith("link") and name[4:].isdigit()]
    pins = np.stack([places[name] for name in links], axis=1)
    turns = float(min(np.abs(turns_around(pins, places[name])).min() for name in ("sprocket", "idler")))
    axes = poses[names.index("frame"), :2, :2]
    seen = np.einsum("ijk,kni->knj", axes, pins - places["frame"][:, None])
    pitch = float(np.linalg.norm(seen[0, 1] - seen[0, 0]))
    farthest = float(np.linalg.norm(seen[:, :, None] - seen[0][None, None], axis=-1).min(axis=2).max() / pitch)
    power = np.asarray(run["drive"])
    work_done = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(run.t))])
    gained = float((run["energy"] - run["energy"][0] - work_done).max() / run["T"].max())
    facts, way, open_ = run.metadata, float(np.abs(np.diff(run["x"])).sum()), float(run.residuals.raw_position)
    row = [seconds / cpu, way, facts["penetration"], facts["contact_residual"], turns, farthest, open_, gained]
    report.table("a drive", ("of real time", "way m", "penetration m", "residual m/s", "turns", "farthest pitches",
                 "open m", "gained"), [row])  # fmt: skip
    report.result(f"excavator with rigid contact, {seconds:g} s, times real time", seconds / cpu)
    report.least("of real time", seconds / cpu, 1.0)
    report.least("turns of the chain around its wheels", turns, 0.999)
    report.most("farthest pin, in pitches", farthest, 1.0)
    report.most("penetration, in m", facts["penetration"], 0.01)
    report.most("energy that no motor gave, over the kinetic one", gained, 0.01)
    report.note(
        f"{seconds:g} s; steps of 1 ms; CPU time of one core. Penetration: shapes begin 3.6 mm in each other.",
        "Turns: the least number of turns of the line of pins around sprocket and idler. Farthest: distance of a pin",
        "from the nearest place of a pin at the start, seen from the frame. Gained: the most by which energy exceeds",
        "that of the start and the work of the motor.",
    )
