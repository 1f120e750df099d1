"""Right-hand sides of robots in C beside CasADi, MuJoCo and Pinocchio: operations, nanoseconds a call, compiling."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import perf_counter
from typing import Any

import numpy as np

from eomgen import pipeline
from eomgen.codegen.c import emit_c
from eomgen.toolchain.build import compile_sources
from eomgen.toolchain.compiler import Options, compile_flags, find_compiler

from .latency import cold_cache
from .measure import Sample
from .models import spatial_chain
from .report import Limit, Report, Table
from .robot_calls import (
    HERE,
    ROBOTS,
    Contestant,
    Robot,
    as_mjcf,
    build,
    compile_loop,
    in_turns,
    load_pinocchio,
    mujoco_library,
    of_casadi,
    of_eomgen,
    pinocchio_calls,
    state,
)

TITLE = "right-hand sides of robots in C, one call"
#: What peers take at least of our time; CasADi's text is compiled by the same compiler with the same flags.
FASTER = {"CasADi": 1.25, "MuJoCo": 3.0, "Pinocchio": 5.0}
#: What CasADi's cse leaves of the same arms (docs/operations.md).
OPERATIONS = {"Panda": 1661, "UR5": 908, "Talos": 8616}
TALOS_SECONDS = 1.2


def flag_sets() -> dict[str, list[str]]:
    """Our default flags, and those for this processor; none has fast-math."""
    compiler = find_compiler()
    return {
        "default": compile_flags(Options(), compiler, 0),
        "-O2": compile_flags(Options(optimize=2), compiler, 0),
        "native": compile_flags(Options(native=True), compiler, 0),
    }


def contest(robot: Robot, folder: Path, quick: bool) -> dict[str, Any]:
    """One robot: counts, and nanoseconds of all contestants in turns."""
    model = load_pinocchio(robot)
    q, v, tau = state(model)
    equations, program = build(robot)
    _, symbolic = build(robot, symbolic=True)
    counts = {
        "eomgen": program.counts["rhs"].total,
        "eomgen, symbols": symbolic.counts["rhs"].total,
        "once per parameter set": symbolic.counts["precompute"].total,
    }
    x, u = _ours(equations, robot, model, q, v, tau)
    sizes = program.sizes.n_q, program.sizes.n_v
    actions, differences = {}, {}
    compiling: dict[str, float] = {}
    theirs = np.concatenate([q, v])
    texts = _casadi(model)
    for text in texts:
        counts[f"CasADi, {text.method}"] = text.operations
    best = min(texts, key=lambda text: text.operations, default=None)
    reference = _accelerations(model, q, v, tau)
    own, places = _joints(equations, model)
    for label, flags in flag_sets().items():
        if quick and label != "default":
            continue
        for who, one in (("eomgen", program), ("eomgen, symbols", symbolic)):
            library, compiling[f"{who}, {label}"] = compile_loop(
                folder, f"{robot.name}{len(actions)}", of_eomgen(one), flags
            )
            runner = Contestant(library, *sizes, x, u)
            runner.library.prepare()
            actions[f"{who}, {label}"] = runner.measure
            joints = runner.result()[sizes[0] :][own]
            differences[f"{who}, {label}"] = float(np.abs(joints - reference[places]).max())
        for text in [best] if best and quick else texts:
            library, seconds = compile_loop(folder, f"{robot.name}{len(actions)}", of_casadi(text.source), flags)
            runner = Contestant(library, *sizes, theirs, tau)
            actions[f"CasADi, {text.method}, {label}"] = runner.measure
            compiling[f"CasADi, {text.method}, {label}"] = seconds
            found = runner.result()[sizes[0] :]
            differences[f"CasADi, {text.method}, {label}"] = float(np.abs(found - reference).max())
    with suppress(ImportError):
        extra, adapter = mujoco_library()
        adapter_text = {"adapter.c": (HERE / adapter).read_text(encoding="utf-8")}
        library, _ = compile_loop(folder, f"{robot.name} MuJoCo", adapter_text, ["-O2", "-fPIC"], extra)
        path = folder / f"{robot.name}.xml"
        path.write_text(as_mjcf(model), encoding="utf-8")
        at = theirs.copy()
        if robot.floating:
            at[3:7] = np.roll(at[3:7], 1)
        runner = Contestant(library, *sizes, at, tau)
        if runner.library.prepare(str(path).encode()):
            raise RuntimeError(f"MuJoCo refuses {path}")
        actions["MuJoCo"] = runner.measure
        if not robot.floating:  # the velocity of its base is along other axes
            differences["MuJoCo"] = float(np.abs(runner.result()[sizes[0] :] - reference).max())
    calls = pinocchio_calls(model)
    actions |= {"Pinocchio, from Python": calls["aba"], "Pinocchio, overhead of Python": calls["overhead"]}
    samples = in_turns(actions, 5 if quick else 150, 0.0005 if quick else 0.002)
    return {"operations": counts, "ns": samples, "differences": differences, "compile": compiling}


def _casadi(model: Any) -> list[Any]:
    try:
        from .casadi_recursions import write_robot
    except ImportError:
        return []
    return write_robot(model)


def _accelerations(model: Any, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
    import pinocchio as pin

    return np.array(pin.aba(model, model.createData(), q, v, tau - model.damping * v))


def _ours(
    equations: Any, robot: Robot, model: Any, q: np.ndarray, v: np.ndarray, tau: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """x = [q; v] and u in our order; the base's velocity is along ground axes here, its own axes in Pinocchio."""
    import pinocchio as pin

    at = {name: k for k, name in enumerate(model.names)}
    kinematics = equations.kinematics
    positions = {name: q[model.joints[at[name]].idx_q] for name in model.names if name in kinematics.names}
    rates = {f"{name}_dot": v[model.joints[at[name]].idx_v] for name in model.names if name in kinematics.names}
    if robot.floating:
        R = pin.Quaternion(*q[[6, 3, 4, 5]]).toRotationMatrix()
        positions |= dict(zip(("base_x", "base_y", "base_z"), q[:3], strict=True))
        positions |= dict(zip(("base_e0", "base_e1", "base_e2", "base_e3"), q[[6, 3, 4, 5]], strict=True))
        rates |= dict(zip(("base_x_dot", "base_y_dot", "base_z_dot"), R @ v[:3], strict=True))
        rates |= dict(zip(("base_wx", "base_wy", "base_wz"), v[3:6], strict=True))
    x = [*(positions[name] for name in kinematics.names), *(rates[name] for name in kinematics.velocity_names)]
    torques = {f"tau_{name}": tau[model.joints[at[name]].idx_v] for name in model.names if name in kinematics.names}
    return np.array(x), np.array([torques[name] for name in kinematics.input_names])


def _joints(equations: Any, model: Any) -> tuple[list[int], list[int]]:
    """Where the velocities of joints are in our order, and in Pinocchio's; without the base."""
    names = equations.kinematics.velocity_names
    found = [(k, name.removesuffix("_dot")) for k, name in enumerate(names) if not name.startswith("base_")]
    at = {name: model.joints[k].idx_v for k, name in enumerate(model.names)}
    return [k for k, _ in found], [at[name] for _, name in found]


def compile_time(program: Any, repeats: int, lanes: int | None = 0) -> dict[str, Sample]:
    """Seconds from C text to a C library, files side by side, empty cache: passed, and of the compiler's processors."""
    sources = dict(emit_c(program))
    wall, cpu = [], []
    for _ in range(repeats):
        with cold_cache() as environment, _variables(environment):
            before, start = getrusage(RUSAGE_CHILDREN), perf_counter()
            compile_sources("library", sources, program.name, Options(lanes=lanes))
            wall.append(perf_counter() - start)
            after = getrusage(RUSAGE_CHILDREN)
            cpu.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return {"wall": Sample(tuple(wall)), "cpu": Sample(tuple(cpu))}


def compile_all(quick: bool) -> list[tuple[str, int, dict[str, Sample]]]:
    """Talos, then chains in space by articulated bodies as they grow: what, operations, seconds."""
    repeats = 1 if quick else 5
    talos = build(next(robot for robot in ROBOTS if robot.name == "Talos"))[1]
    operations = talos.counts["rhs"].total
    found = [
        ("Talos", operations, compile_time(talos, repeats)),
        ("Talos, with lanes", operations, compile_time(talos, repeats, None)),
    ]
    for n in (20, 40) if quick else (85, 170, 340):
        chain = pipeline.build(spatial_chain(n).derive("recursive"), "c", kernels=["rhs"])
        found.append((f"chain of {n}", chain.counts["rhs"].total, compile_time(chain, min(repeats, 3))))
    return found


class _variables:
    """Environment variables for a while."""

    def __init__(self, values: dict[str, str]) -> None:
        import os

        self.values, self.environment = values, os.environ
        self.before = {name: os.environ.get(name) for name in values}

    def __enter__(self) -> None:
        self.environment.update(self.values)

    def __exit__(self, *error: object) -> None:
        for name, value in self.before.items():
            if value is None:
                self.environment.pop(name, None)
            else:
                self.environment[name] = value


def run(quick: bool) -> Report:
    """Every robot, then compilation."""
    try:
        load_pinocchio(ROBOTS[1])
    except ImportError as error:
        raise SystemExit(f"the rhs benchmark needs the test extra (pip install -e '.[test]'): {error}") from None
    details: dict[str, Any] = {}
    counts: list[list[Any]] = []
    times: list[list[Any]] = []
    limits: list[Limit] = []
    with tempfile.TemporaryDirectory(prefix="eomgen-rhs-") as name:
        for robot in ROBOTS[1:2] if quick else ROBOTS:
            found = contest(robot, Path(name), quick)
            counts += [[robot.name, who, number] for who, number in found["operations"].items()]
            ratios = _judge(robot, found, limits, quick)
            for who, sample in found["ns"].items():
                times.append([robot.name, who, sample.best, sample.median, ratios.get(who)])
            details[robot.name] = found | {"ns": {who: sample.as_dict() for who, sample in found["ns"].items()}}
            worst = max(found["differences"].values())
            limits.append(Limit(f"{robot.name}: largest difference of accelerations", worst, 1e-6))
    compiled = compile_all(quick)
    rows = [
        [what, operations, t["wall"].best, t["wall"].median, t["cpu"].best, 1e6 * t["cpu"].best / operations]
        for what, operations, t in compiled
    ]
    if not quick:
        limits.append(Limit("Talos compiles in, best,", compiled[0][2]["wall"].best, TALOS_SECONDS, "s"))
        growth = rows[-1][-1] / rows[-3][-1]
        limits.append(Limit("compiler's time an operation, chain of 340 over 85", growth, 1.25))
    details["compile"] = {
        what: {"operations": operations} | {key: sample.as_dict() for key, sample in t.items()}
        for what, operations, t in compiled
    }
    notes = [
        "Operations: multiplications, additions, divisions; CasADi's are all its instructions but inputs and outputs.",
        "ns a call in C, all contestants in turns in one process; ratio: best time over that of eomgen, same flags.",
        "default: flags of a compiled model; native: -march=native and contraction. No fast-math anywhere.",
        "'symbols': masses, centres and inertias are parameters at run time; what depends on them alone is hoisted.",
        "MuJoCo: mj_forward without contacts, of its wheel. Pinocchio: ABA of its wheel from Python, less a",
        "call on a model without joints; its headers compiled for this processor are faster (docs/operations.md).",
        "Compiling: C library, files side by side, empty cache; chains in space by articulated bodies, all symbols;",
        "no lanes but where said: they are compiled when they are first needed;",
        "processor s: of all compiler processes together, which other work on the machine lengthens less.",
    ]
    if not _installed("casadi"):
        notes.append("CasADi is not installed (pip install casadi): its rows and limits are missing.")
    tables = (
        Table("operations of a right-hand side", ("robot", "what", "operations"), counts),
        Table("one call", ("robot", "who", "best ns", "median ns", "ratio"), times),
        Table("compiling", ("what", "operations", "best s", "median s", "processor s", "us an operation"), rows),
    )
    return Report(tables, tuple(limits), tuple(notes), details)


def _judge(robot: Robot, found: dict[str, Any], limits: list[Limit], quick: bool) -> dict[str, float]:
    """Best times over ours of the same flags; promises go to ``limits``."""
    samples, operations = found["ns"], found["operations"]
    ratios = {}
    for who, sample in samples.items():
        label = next((label for label in flag_sets() if who.endswith(f", {label}")), "default")
        ours = samples[f"eomgen, {label}"].best
        if not who.startswith("eomgen"):
            ratios[who] = sample.best / ours
    net = samples["Pinocchio, from Python"].best - samples["Pinocchio, overhead of Python"].best
    own = samples["eomgen, default"].best
    if not quick:
        for label in flag_sets():
            against = [r for who, r in ratios.items() if who.startswith("CasADi") and who.endswith(f", {label}")]
            if against:
                limits.append(
                    Limit(f"{robot.name}, {label}: CasADi's best", min(against), FASTER["CasADi"], "x", at_least=True)
                )
        if "MuJoCo" in ratios:
            limits.append(Limit(f"{robot.name}: MuJoCo", ratios["MuJoCo"], FASTER["MuJoCo"], "x", at_least=True))
        limits.append(
            Limit(f"{robot.name}: Pinocchio without Python", net / own, FASTER["Pinocchio"], "x", at_least=True)
        )
    del ratios["Pinocchio, overhead of Python"]
    theirs = [n for who, n in operations.items() if who.startswith("CasADi")]
    bound = min([*theirs, *([OPERATIONS[robot.name]] if robot.name in OPERATIONS else [])], default=None)
    if bound is not None:
        limits.append(Limit(f"{robot.name}: operations", operations["eomgen"], bound))
    return ratios


def _installed(package: str) -> bool:
    from importlib.util import find_spec

    return find_spec(package) is not None
