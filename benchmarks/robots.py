"""Robots beside Pinocchio, MuJoCo and CasADi: numbers, right-hand sides, kernels, derivatives, lanes, closed loops."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import eomgen as eg
from eomgen import pipeline
from eomgen.codegen.c import emit_c
from eomgen.expr.schedule import count
from eomgen.toolchain.build import compile_sources
from eomgen.toolchain.compiler import Options

from .derivation import newton_step
from .harness import Report, Sample, Timed, benchmark, cold_cache, in_turns, spent, timed, work
from .kernels import Kernel, lanes_of, of_casadi, of_module, our_flags
from .models import spatial_chain
from .models.closed_robots import ROBOTS as CLOSED_ROBOTS
from .models.linkages import closed_chain, four_bars
from .peers import ROBOTS, InOurOrder, Robot, installed, mujoco_kernel, pinocchio_timed


def nanoseconds(samples: Mapping[str, Sample]) -> dict[str, float]:
    """The least of each; Pinocchio's less a call from Python of a model without joints."""
    best = {who: 1e9 * sample.best for who, sample in samples.items()}
    if "a call" in best:
        best["Pinocchio"] -= best.pop("a call")
    return best


# -- numbers -----------------------------------------------------------------------------------------------------------
METHODS = {"embedding": "mass_matrix and bias", "recursive": "accelerations"}  #: and what is counted of each


@benchmark("robots", "robots from URDF and MJCF against Pinocchio and MuJoCo")
def robots(report: Report, quick: bool) -> None:
    """Every robot of PyPI packages by both forms of a right-hand side, as the tests judge it."""
    import mujoco_judge
    import pinocchio_judge
    from robot_comparison import Compiled, largest_differences
    from shipped_robots import mjcf_models, urdf_robots

    states, worst = 3 if quick else 20, 0.0
    urdf, mjcf = list(urdf_robots().items()), list(mjcf_models().items())
    if not quick:
        report.least("URDF robots", len(urdf), 25)
        report.least("MJCF models", len(mjcf), 5)
    for title, files, judging in (
        ("URDF robots against Pinocchio", urdf[:2] if quick else urdf, pinocchio_judge),
        ("MJCF models against MuJoCo", mjcf[:1] if quick else mjcf, mujoco_judge),
    ):
        rows: list[list[Any]] = []
        largest = 0.0
        for name, (path, how) in files:
            if judging is pinocchio_judge:
                model = eg.load(path, floating=how, actuate=True, rotation="euler_parameters")
                judge = judging.Judge(path, how, model)
            else:
                model = eg.load(path, assets=str(how), rotation="euler_parameters")
                judge = judging.Judge(path, model)
            row: list[Any] = [name + "*" * (how is True)]
            gaps = []
            for method, counted in METHODS.items():
                equations, derive = spent(lambda model=model, method=method: model.derive(method))
                compiled, seconds = spent(lambda equations=equations: Compiled(equations))
                module = compiled.module
                drawn = judge.states(module, states, seed=1)
                gaps += largest_differences(model, compiled, drawn).values()
                gaps += largest_differences(model, Compiled(equations, "numpy"), drawn).values()
                x, out = 0.1 * np.ones(module.n_x), np.empty(module.n_x)
                rhs = timed(lambda rhs=module.rhs, x=x, out=out: rhs(0.0, x, out=out))
                ns = 1e9 * in_turns({"": rhs}, 7, 1e-3)[""].best
                row += [equations.operations[counted].total, derive, seconds, ns]
            aba = judge.call_time() if hasattr(judge, "call_time") else None
            rows.append([row[0], module.n_v, f"{max(gaps):.0e}", *row[1:], aba])
            largest = max(largest, *gaps)
        worst = max(worst, largest)
        report.result(f"{len(files)} {title}, largest relative difference", largest)
        each = ("operations", "derive s", "compile s", "rhs ns")
        columns = ("robot", "n", "difference", *(f"{method}: {what}" for method in METHODS for what in each), "aba ns")
        report.table(title, columns, rows)
    report.most("largest relative difference from the judges", worst, 1e-9)
    report.note(
        "Difference: largest relative one of M, bias, inverse and forward dynamics, frames and centre of mass over",
        f"{states} random states, by both methods, in C and by target numpy.  * floats.  Inertias are numbers.",
        "Operations: of mass matrix and bias (embedding), of the accelerations (recursive). Six kernels are compiled.",
        "rhs: forward dynamics, a call from Python into a given array; aba: Pinocchio's, a call from Python.",
    )


@benchmark("robot_kernels", "mass matrix and inverse dynamics of robots")
def robot_kernels(report: Report, quick: bool) -> None:
    """What ``auto`` took beside each of our methods and beside Pinocchio, for all of example-robot-data."""
    import pinocchio as pin
    from shipped_robots import URDF

    kernels, methods = ("mass_matrix", "inverse_dynamics"), ("auto", "embedding", "recursive")
    rounds, burst = (3, 2e-4) if quick else (60, 1e-3)
    rows: dict[str, list[list[Any]]] = {kernel: [] for kernel in kernels}
    worst, least = dict.fromkeys(kernels, 0.0), dict.fromkeys(kernels, np.inf)
    for name, (file, floating) in [*URDF.items()][1:3] if quick else URDF.items():
        robot, modules, counts = Robot(name, file, floating), {}, {}
        for method in methods:
            equations = robot.model().derive(method)
            modules[method], tree = equations.compile(kernels=list(kernels)), equations.tree
            mass = [x for i, row in enumerate(tree.mass_matrix) for x in row[: i + 1]]
            counts[method] = [count(mass).total, count(list(tree.inverse_dynamics)).total]
        theirs, module = robot.pinocchio(), modules["auto"]
        v, a = 0.3 * np.ones(module.n_v), 0.2 * np.ones(module.n_v)
        q = 0.1 * np.ones(module.n_q)
        for k, kernel in enumerate(kernels):
            x = q if kernel == "mass_matrix" else np.concatenate([q, v, a])
            actions: dict[str, Timed] = {who: of_module(module, kernel, x) for who, module in modules.items()}
            times = nanoseconds(
                in_turns(actions | pinocchio_timed(theirs, pin.neutral(theirs), v, a, kernel), rounds, burst)
            )
            others = [who for who in methods[1:] if counts[who][k] != counts["auto"][k]]  # else it is the same code
            beside = max(times["auto"] / times[who] for who in [*others, "auto"])
            peer = times["Pinocchio"] / times["auto"]
            worst[kernel], least[kernel] = max(worst[kernel], beside), min(least[kernel], peer)
            each = [x for who in methods for x in (counts[who][k], times[who])]
            if name in ("panda", "talos"):
                report.result(f"{name}, {kernel}, ns", times["auto"], {"Pinocchio": times["Pinocchio"]})
            rows[kernel].append([name + "*" * floating, module.n_v, *each, times["Pinocchio"], beside, peer])
    columns = ("robot", "n", *(x for who in methods for x in (f"{who}, operations", "ns")), "Pinocchio, ns")
    for kernel in kernels:
        report.table(f"{kernel}, ns", (*columns, "auto over best", "Pinocchio over auto"), rows[kernel])
        if not quick:
            report.most(f"{kernel}, auto over the best of our methods", worst[kernel], 1.05)
            report.least(f"{kernel}, Pinocchio over auto", least[kernel], 1.0)
    report.note(
        "Least of many bursts in turns: ours in a loop in C; crba and rnea of Pinocchio's wheel from Python, less",
        "the same call of a model without joints.  * floats.  Inertias are numbers; default flags.",
        "Of as many operations as auto's is the same code; over best: over the others.  The lower triangle is counted.",
    )


# -- right-hand sides --------------------------------------------------------------------------------------------------
#: Options of compilation; none has fast-math. CasADi's text is compiled by the same compiler with the same flags.
FLAGS: dict[str, dict[str, Any]] = {"default": {}, "-O2": {"optimize": 2}, "native": {"native": True}}
#: What CasADi's cse leaves of the same arms (docs/operations.md).
OPERATIONS = {"Panda": 1661, "UR5": 908, "Talos": 8616}


def compile_time(program: Any, repeats: int, lanes: int | None = 0) -> list[Any]:
    """Operations; seconds from C text to a C library, files side by side, empty cache, of a clock and of processors."""
    sources, operations = dict(emit_c(program)), program.counts["rhs"].total
    wall, cpu = [], []
    for _ in range(repeats):
        with cold_cache():
            before = work()
            _, seconds = spent(lambda: compile_sources("library", sources, program.name, Options(lanes=lanes)))
            wall.append(seconds)
            cpu.append(work() - before)
    middle = Sample(tuple(wall)).median
    return [operations, min(wall), middle, min(cpu), 1e6 * min(cpu) / operations]


@benchmark("rhs", "right-hand sides of robots in C, one call")
def right_hand_sides(report: Report, quick: bool) -> None:
    """Operations, nanoseconds a call and compiling, beside CasADi, MuJoCo and Pinocchio."""
    rows: list[list[Any]] = []
    labels = ["default"] if quick else list(FLAGS)
    for robot in ROBOTS[1:2] if quick else ROBOTS:
        model, texts = robot.pinocchio(), []
        if installed("casadi"):
            from .casadi_peer import write_robot

            texts = write_robot(model)
        actions: dict[str, Timed] = {}
        counts: dict[str, int | None] = {f"CasADi, {text.method}": text.operations for text in texts}
        differences = []
        for who, symbolic in (("eomgen", False), ("eomgen, symbols", True)):
            equations = robot.model(symbolic=symbolic).derive()
            program = pipeline.build(equations, "c", ["rhs"])
            counts[who] = program.counts["rhs"].total
            if symbolic:
                counts["once per parameter set"] = program.counts["precompute"].total
            for label in labels:
                module = equations.compile(kernels=["rhs"], lanes=0, **FLAGS[label])
                at = InOurOrder(module, model)
                kernel = actions[f"{who}, {label}"] = of_module(module, "rhs", at.x, at.u)
                differences.append(at.difference(kernel.result()))
        x, tau, size = np.concatenate([at.q, at.v]), at.tau, np.abs(at.reference).max()
        for text in texts:
            for label in labels:
                flags = our_flags(**FLAGS[label])
                kernel = actions[f"CasADi, {text.method}, {label}"] = of_casadi(text.source, x, len(x), tau, flags)
                differences.append(np.abs(kernel.result()[model.nq :] - at.reference).max() / size)
        if installed("mujoco"):
            kernel = actions["MuJoCo, default"] = mujoco_kernel(model, x, tau)
            if not robot.floating:  # the velocity of its base is along other axes
                differences.append(np.abs(kernel.result()[model.nq :] - at.reference).max() / size)
        calls = pinocchio_timed(model, at.q, at.v, tau, "rhs")
        actions |= {
            "Pinocchio, from Python, default": calls["Pinocchio"],
            "overhead of Python, default": calls["a call"],
        }
        samples = in_turns(actions, 5 if quick else 150, 5e-4 if quick else 2e-3)
        best = {who: 1e9 * sample.best for who, sample in samples.items()}
        for who in dict.fromkeys([*(who.rsplit(", ", 1)[0] for who in best), "once per parameter set"]):
            rows.append([robot.name, who, counts.get(who), *(best.get(f"{who}, {label}") for label in labels)])
        _judge(report, robot.name, best, counts, quick)
        report.most(f"{robot.name}: largest relative difference of accelerations", float(max(differences)), 1e-8)
    report.table("one call, best ns", ("robot", "who", "operations", *labels), rows)
    talos = pipeline.build(next(robot for robot in ROBOTS if robot.name == "Talos").model().derive(), "c", ["rhs"])
    repeats = 1 if quick else 5
    rows = [["Talos", *compile_time(talos, repeats)], ["Talos, with lanes", *compile_time(talos, repeats, None)]]
    for n in (20, 40) if quick else (85, 170, 340):
        chain = pipeline.build(spatial_chain(n).derive("recursive"), "c", ["rhs"])
        rows.append([f"chain of {n}", *compile_time(chain, min(repeats, 3))])
    report.table("compiling", ("what", "operations", "best s", "median s", "processor s", "us an operation"), rows)
    if not quick:
        report.most("Talos compiles in, best,", rows[0][2], 1.2, "s")
        report.most("compiler's time an operation, chain of 340 over 85", rows[-1][-1] / rows[-3][-1], 1.25)
    report.note(
        "Operations: multiplications, additions, divisions; CasADi's are all its instructions but inputs and outputs.",
        "ns a call in C, all contestants in turns in one process, by flags: of a compiled model, with -O2, and native,",
        "which is -march=native and contraction. No fast-math anywhere.",
        "'symbols': masses, centres and inertias are parameters at run time; what depends on them alone is hoisted.",
        "MuJoCo: mj_forward without contacts, of its wheel. Pinocchio: ABA of its wheel from Python; the overhead is a",
        "call on a model without joints; its headers compiled for this processor are faster.",
        "Compiling: C library, files side by side, empty cache; chains in space by articulated bodies, all symbols;",
        "no lanes but where said: they are compiled when they are first needed;",
        "processor s: of all compiler processes together, which other work on the machine lengthens less.",
    )


def _judge(report: Report, name: str, best: dict[str, float], counts: Mapping[str, int | None], quick: bool) -> None:
    """What peers take at least of our time with the same flags, and operations."""
    own = best["eomgen, default"]
    casadi = [x for who, x in best.items() if who.startswith("CasADi") and who.endswith(", default")]
    others = {"CasADi": min(casadi, default=None), "MuJoCo": best.get("MuJoCo, default")}
    others["Pinocchio from Python"] = best["Pinocchio, from Python, default"]
    report.result(f"rhs of {name} in C, ns", own, others)
    if not quick:
        for label in FLAGS:
            theirs = [x for who, x in best.items() if who.startswith("CasADi") and who.endswith(f", {label}")]
            if theirs:
                report.least(f"{name}, {label}: CasADi's best", min(theirs) / best[f"eomgen, {label}"], 1.25, "x")
        if "MuJoCo, default" in best:
            report.least(f"{name}: MuJoCo", best["MuJoCo, default"] / own, 3.0, "x")
        net = best["Pinocchio, from Python, default"] - best["overhead of Python, default"]
        report.least(f"{name}: Pinocchio without Python", net / own, 5.0, "x")
    theirs = [n for who, n in counts.items() if who.startswith("CasADi") and n is not None]
    theirs += [OPERATIONS[name]] if name in OPERATIONS else []
    if theirs:
        report.most(f"{name}: operations", counts["eomgen"] or 0, min(theirs))


@benchmark("lanes", "right-hand sides of several states at a time, in vector registers")
def lanes(report: Report, quick: bool) -> None:
    """Robots in C, one state at a time and in lanes, beside CasADi's C as its users commonly get it."""
    from .casadi_peer import write_robot

    peer_flags = {"same flags": ["-O2", "-ffp-contract=off", "-fno-math-errno"], "-O3 native": ["-O3", "-march=native"]}
    promised, rows = {"Panda": 0.19, "UR5": 0.19, "Talos": 0.24}, []
    for robot in ROBOTS[1:2] if quick else ROBOTS[:3]:
        model = robot.pinocchio()
        text = min(write_robot(model, common=True), key=lambda text: text.operations)
        equations = robot.model().derive()
        if "rhs" not in pipeline.build(equations, "c", ["rhs"]).block_names:
            equations = robot.model().derive("recursive")  # the chosen form solves in loops, which have no lanes
        operations = pipeline.build(equations, "c", ["rhs"]).counts["rhs"].total
        modules = {width: equations.compile(kernels=["rhs"], lanes=width) for width in (0, 2, 4, 8)}
        at = InOurOrder(modules[0], model)
        plain = of_module(modules[0], "rhs", at.x, at.u)
        actions: dict[str, Timed] = {
            label: of_casadi(text.source, np.concatenate([at.q, at.v]), model.nq + model.nv, at.tau, flags)
            for label, flags in peer_flags.items()
        }
        actions["one"] = plain
        differences = [at.difference(plain.result())]
        for width in (2, 4, 8):
            if (found := lanes_of(modules[width], at.x, at.u)) is not None:
                actions[f"{width}"] = found[0]
                differences.append(at.difference(found[1]))
        ns = nanoseconds(in_turns(actions, 20 if quick else 800, 1e-4))
        widest, fastest = max(who for who in ns if who.isdigit()), min(ns[label] for label in peer_flags)
        rows.append([robot.name, text.operations, *(ns[label] for label in peer_flags), operations, ns["one"],
                     *(ns.get(f"{width}") for width in (2, 4, 8))])  # fmt: skip
        others = {"one at a time": ns["one"], **{f"{width} lanes": ns.get(f"{width}") for width in (2, 4)}}
        others |= {f"CasADi, {label}": ns[label] for label in peer_flags}
        report.result(f"rhs of {robot.name}, {widest} lanes, ns a state", ns[widest], others)
        report.most(f"{robot.name}, largest relative difference from Pinocchio", max(differences), 1e-7)
        if not quick:
            bound = promised[robot.name]
            if "4" in ns:
                ratio = ns["4"] / ns["same flags"]
                report.most(f"{robot.name}, a state of 4 lanes over CasADi, same flags,", ratio, bound)
            report.most(f"{robot.name}, a state of {widest} lanes over CasADi's fastest", ns[widest] / fastest, bound)
    report.table("ns a state", ("robot", "CasADi, operations", "CasADi", "-O3 -march=native", "eomgen, operations",
                 "one at a time", "2 lanes", "4 lanes", "8 lanes"), rows)  # fmt: skip
    report.note(
        "A loop in C around the right-hand side, inputs as they are made; the best of many bursts, taken in turns.",
        "CasADi: the better of articulated bodies and of mass matrix and factor, velocities of origins included, after",
        "its own cse, with -O2; -O3 -march=native lets the compiler fuse products and sums; ours never does.",
    )


# -- derivatives -------------------------------------------------------------------------------------------------------
#: Kernel -> its name in GRiD's table.
DERIVED = {"inverse_dynamics": "ID", "rhs": "FD"}
DERIVED |= {"inverse_dynamics_derivatives": "ID gradient", "jacobian": "FD gradient"}
#: Microseconds of one call in GRiD's table: Pinocchio's generated code on an Intel Core i7-10700K at 3.8 GHz, and GRiD
#: on an NVIDIA RTX 3080, transfers included (B. Plancher and others, GRiD, ICRA 2022; README of GRiDBenchmarks).
GRID = {
    "iiwa": {"ID": (0.3, 3.0), "FD": (0.9, 7.7), "ID gradient": (1.4, 6.3), "FD gradient": (2.9, 12.9)},
    "hyq": {"ID": (0.3, 3.2), "FD": (1.2, 6.9), "ID gradient": (2.1, 5.8), "FD gradient": (4.3, 11.0)},
    "atlas": {"ID": (1.1, 8.0), "FD": (5.3, 22.4), "ID gradient": (9.8, 19.5), "FD gradient": (20.9, 42.1)},
}
GRID_FOLDER = "EOMGEN_GRID_URDFS"  #: variable: the folder urdfs of github.com/robot-acceleration/GRiDBenchmarks


def pinocchio_difference(
    module: Any, model: Any, names: list[str], kernel: str
) -> tuple[Kernel, dict[str, Timed], float]:
    """A kernel of ours and Pinocchio's, of a robot without base or damping, and by how much their results differ."""
    from .peers import pinocchio_calls

    n, order, pick = module.n_v, np.array([module.q_names.index(name) for name in names]), np.random.default_rng(7)
    q, v, a = 0.3 + pick.uniform(-0.5, 0.5, n), pick.uniform(-1, 1, n), pick.uniform(-1, 1, n)
    inverse = kernel.startswith("inverse")
    ours = of_module(module, kernel, np.concatenate([q, v, a] if inverse else [q, v]))
    given = q[order], v[order], a[order] if inverse else np.zeros(n)
    call, found, here = pinocchio_calls(model, *given)[kernel], ours.result(), np.ix_(order, order)
    theirs = call()
    if kernel in ("inverse_dynamics", "rhs"):
        pairs = [(found[-n:][order], theirs)]
    else:
        block = found.reshape(n, 3 * n) if inverse else found.reshape(2 * n, 2 * n)[n:]
        pairs = [(block[:, :n][here], theirs[0]), (block[:, n : 2 * n][here], theirs[1])]
    gap = max(float(np.abs(one - np.array(other)).max() / np.abs(other).max()) for one, other in pairs)
    return ours, pinocchio_timed(model, *given, kernel), gap


def of_grid(report: Report, quick: bool, rounds: int, burst: float) -> None:
    """GRiD's table again, without the damping of joints, which it leaves out."""
    import pinocchio as pin

    rows: list[list[Any]] = []
    with TemporaryDirectory() as place:
        for robot in [*GRID][:1] if quick else GRID:
            path, given = Path(place, f"{robot}.urdf"), Path(os.environ[GRID_FOLDER], f"{robot}.urdf")
            path.write_text(re.sub(r"<dynamics[^>]*>", "", given.read_text(encoding="utf-8")), encoding="utf-8")
            source = eg.load(path, actuate=True, check_inertia="note")  # Atlas has tensors of no body
            module, model = source.compile(kernels=list(DERIVED)), pin.buildModelFromUrdf(str(path))
            names = [source.renamed.get("joints", {}).get(name, name) for name in list(model.names)[1:]]
            for kernel, what in DERIVED.items():
                ours, theirs, gap = pinocchio_difference(module, model, names, kernel)
                us = {
                    who: x / 1000 for who, x in nanoseconds(in_turns({"eomgen": ours, **theirs}, rounds, burst)).items()
                }
                own, peer, (cpu, gpu) = us["eomgen"], us["Pinocchio"], GRID[robot][what]
                rows.append([robot, what, cpu, gpu, peer, own, peer / own, cpu / own, gpu / own])
                if what == "FD gradient":
                    others = {"Pinocchio": peer, "published: Pinocchio's code": cpu, "GRiD on a GPU": gpu}
                    report.result(f"{robot}, jacobian, us", own, others)
                report.most(f"{robot}, {what}: difference from Pinocchio", gap, 1e-10)
                if not quick:
                    report.least(f"{robot}, {what}: Pinocchio over ours", peer / own, 1.0)
    report.table("GRiD's table, one call, us", ("robot", "what", "published CPU", "published GPU", "Pinocchio here",
                 "eomgen here", "Pinocchio over", "published CPU over", "published GPU over"), rows)  # fmt: skip


@benchmark("derivatives", "derivatives of robots beside Pinocchio and CasADi, and of loops")
def derivatives(report: Report, quick: bool) -> None:
    """Robots of example-robot-data, those of GRiD's table if their files are there, and Jacobians of loops."""
    import pinocchio as pin

    from .casadi_peer import write_derivatives

    rounds, burst = (3, 2e-4) if quick else (40, 1e-3)
    kernels = ("inverse_dynamics_derivatives", "jacobian")
    tiago = Robot("tiago", "tiago_description/robots/tiago_no_hand.urdf")
    G1 = Robot("G1", "g1_description/urdf/g1_29dof_rev_1_0.urdf", True)
    every = (ROBOTS[0], ROBOTS[3], tiago, G1, replace(ROBOTS[2], floating=True))
    rows: dict[str, list[list[Any]]] = {kernel: [] for kernel in kernels}
    for robot in every[:1] if quick else every:
        theirs, equations = robot.pinocchio(), robot.model(mimic="independent").derive()
        counts = pipeline.build(equations, "c", list(kernels)).counts
        module = equations.compile(kernels=[*kernels, "rhs", "mass_matrix"])
        texts = write_derivatives(theirs) if robot.name in ("Panda", "ANYmal") else {}  # others compile for minutes
        n_q, n, random = theirs.nq, theirs.nv, np.random.default_rng(0)
        state = np.concatenate([random.uniform(-1, 1, n_q), random.uniform(-1, 1, 2 * n)])
        for kernel in kernels:
            x = state if kernel == kernels[0] else state[: n_q + n]
            ours = of_module(module, kernel, np.resize(x, module.layout.inputs(kernel)))
            actions: dict[str, Timed] = {"eomgen": ours}
            if kernel in texts:
                size = (n if kernel == kernels[0] else n_q + n) * len(x)
                peer = actions["CasADi"] = of_casadi(texts[kernel].source, x, size, np.zeros(n))
                if not robot.floating:  # only there both have the same coordinates
                    gap = np.abs(ours.result() - peer.result()).max() / np.abs(ours.out).max()
                    report.most(f"{robot.name}, {kernel}: difference from CasADi", float(gap), 1e-9)
            still = pin.neutral(theirs), 0.3 * np.ones(n), 0.2 * np.ones(n)
            ns = nanoseconds(in_turns(actions | pinocchio_timed(theirs, *still, kernel), rounds, burst))
            own, casadi = ns["eomgen"], ns.get("CasADi")
            others = {"Pinocchio": ns["Pinocchio"], "CasADi": casadi}
            if robot.name in ("Panda", "ANYmal", "Talos"):
                report.result(f"{robot.name}, {kernel}, ns", own, others)
            rows[kernel].append([
                robot.name + "*" * robot.floating, n, counts[kernel].total if kernel in counts else None, own,
                texts[kernel].operations if kernel in texts else None, casadi, ns["Pinocchio"], ns["Pinocchio"] / own,
                None if casadi is None else casadi / own,
            ])  # fmt: skip
    for kernel in kernels:
        report.table(f"{kernel}, ns", ("robot", "n", "operations", "ns", "CasADi, operations", "CasADi, ns",
                     "Pinocchio, ns", "Pinocchio over ours", "CasADi over ours"), rows[kernel])  # fmt: skip
    if GRID_FOLDER in os.environ:
        of_grid(report, quick, rounds, burst)
    chains = {f"closed chain of {n}": closed_chain(n, True, False) for n in ((20,) if quick else (20, 40, 100))}
    found: list[list[Any]] = []
    for name, model in (chains if quick else chains | {"20 four-bars": four_bars(20)}).items():
        equations = model.derive()
        counts, module = pipeline.build(equations, "c", ["rhs", "jacobian"]).counts, equations.compile()
        actions = {kernel: of_module(module, kernel, module.x0()) for kernel in ("rhs", "jacobian")}
        each = [counts[block].total for block in ("loop_slopes", "slopes_by_position", "slopes_by_velocity")]
        ns = nanoseconds(in_turns(actions, rounds, burst))
        if name.endswith(" 100"):
            report.result(f"{name}, jacobian, ns", ns["jacobian"])
        found.append([name, module.n_v, module.n_dof, *each, *ns.values()])
    report.table("Jacobians of loops: operations of the state once and of a column, ns", ("mechanism", "n", "freedoms",
                 "state", "column of q", "column of v", "rhs, ns", "jacobian, ns"), found)  # fmt: skip
    report.note(
        "Least of many bursts in turns: ours and CasADi's text in a loop in C, same compiler and flags; of Pinocchio",
        "the wheel from Python, less the same call of a model without joints.  * floats.  Jacobians without operations",
        "are solved in loops with the factor of M.  CasADi: Newton-Euler and recursions in link axes, SX, its cse.",
        "GRiD's table (inverse and forward dynamics, ID and FD) is measured where EOMGEN_GRID_URDFS names its files.",
    )


# -- closed loops ------------------------------------------------------------------------------------------------------
#: MuJoCo with as small a residual as its solver reaches: until nothing changes, or so many iterations.
STRICT, ITERATIONS, LINE_SEARCH = "MuJoCo, tolerance 0", 100, 1e-10
#: Of Pinocchio's proximal solver: tolerances, regularization, steps; its residuals come nearest to ours with these.
PROXIMAL = (1e-12, 1e-12, 1e-10, 20)
BESIDE = 1e-9  #: by how much positions are off the loops where ours steps onto them, as in an integrator


class ClosedPinocchio:
    """A robot with connected points in Pinocchio, which judges the accelerations of all."""

    def __init__(self, path: Path) -> None:
        self.pin = pin = import_module("pinocchio")
        self.model, self.loops = pin.buildModelAndLegacyConstraintsFromMJCF(str(path))[:2]
        self.data, self.loop_data = self.model.createData(), pin.StdVec_RigidConstraintData()
        for loop in self.loops:
            self.loop_data.append(loop.createData())
        pin.initConstraintDynamics(self.model, self.data, self.loops, self.loop_data)
        self.names: list[str] = []
        for joint, name in list(zip(self.model.joints, self.model.names, strict=True))[1:]:
            body = name.removeprefix("Composite_").removesuffix("_0")
            self.names += [f"{body}_{k}" for k in range(joint.nv)]
        self.settings, self.torques = pin.ProximalSettings(*PROXIMAL), np.zeros(self.model.nv)

    def accelerations(self, q: np.ndarray, v: np.ndarray) -> Any:
        """Its constrained forward dynamics."""
        return self.pin.constraintDynamics(
            self.model, self.data, q, v, self.torques, self.loops, self.loop_data, self.settings
        )

    def residual(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> float:
        """By how much the connected points accelerate apart, over their accelerations."""
        model, data = self.model, self.model.createData()
        self.pin.forwardKinematics(model, data, q, v, a)

        def point(joint: int, place: Any) -> np.ndarray:
            motion, twist = place.actInv(data.a[joint]), place.actInv(data.v[joint])
            local = motion.linear + np.cross(twist.angular, twist.linear)
            return np.asarray((data.oMi[joint] * place).rotation @ local)

        worst, size = 0.0, 1.0
        for loop in self.loops:
            one = point(loop.joint1_id, loop.joint1_placement)
            other = point(loop.joint2_id, loop.joint2_placement)
            worst, size = max(worst, np.abs(one - other).max()), max(size, np.abs(one).max())
        return float(worst / size)


def closed_robot(
    name: str, path: Path, rounds: int, burst: float
) -> tuple[list[Any], dict[str, float], dict[str, float]]:
    """One robot: sizes and operations; the least nanoseconds of one call, and the residuals, of each contestant."""
    mujoco, pin = import_module("mujoco"), import_module("pinocchio")
    path.write_text(CLOSED_ROBOTS[name]().text(), encoding="utf-8")
    equations = eg.load(path).derive()
    module = equations.compile()
    rates = dict.fromkeys((module.v_names[i] for i in module.layout.independent), 0.4)
    x = module.simulate((0.0, 0.05), rates).x[:, -1]  # a state after some motion
    peer = ClosedPinocchio(path)
    place = [module.q_names.index(name) for name in peer.names]
    q, v = x[: module.n_q][place], x[module.n_q :][place]
    accelerations = {"eomgen": module.rhs(0.0, x)[module.n_q :][place], "Pinocchio": np.array(peer.accelerations(q, v))}
    off = x.copy()
    off[: module.n_q] += BESIDE * np.random.default_rng(1).normal(size=module.n_q)
    actions: dict[str, Timed] = {
        "eomgen": of_module(module, "rhs", x),
        "eomgen, a step": of_module(module, "rhs", off),
        "Pinocchio": timed(lambda: peer.accelerations(q, v)),
        "a call": pinocchio_timed(pin.Model(), *np.zeros((3, 0)), "rhs")["a call"],
    }
    for who in ("MuJoCo", STRICT):
        model = mujoco.MjModel.from_xml_path(str(path))
        if who == STRICT:
            model.opt.tolerance, model.opt.ls_tolerance, model.opt.iterations = 0.0, LINE_SEARCH, ITERATIONS
        data, joints = mujoco.MjData(model), [module.q_names.index(model.joint(k).name) for k in range(model.njnt)]
        data.qpos[:], data.qvel[:] = x[: module.n_q][joints], x[module.n_q :][joints]
        mujoco.mj_forward(model, data)
        found = np.empty(module.n_v)
        found[joints] = data.qacc
        accelerations[who] = found[place]
        actions[who] = timed(partial(mujoco.mj_forward, model, data))
    empty = mujoco.MjModel.from_xml_string("<mujoco/>")
    actions["nothing"] = timed(partial(mujoco.mj_forward, empty, mujoco.MjData(empty)))
    ns = nanoseconds(in_turns(actions, rounds, burst))
    nothing = ns.pop("nothing")
    ns |= {who: ns[who] - nothing for who in ("MuJoCo", STRICT)}
    counts = pipeline.build(equations, "c", ["rhs"]).counts
    sizes = [module.n_v, module.n_rows, module.n_dof, equations.method, newton_step(counts)]
    return sizes, ns, {who: peer.residual(q, v, a) for who, a in accelerations.items()}


@benchmark("robot_loops", "robots with closed loops beside Pinocchio and MuJoCo")
def robot_loops(report: Report, quick: bool) -> None:
    """Accelerations of all robots from one MJCF text, the first alone if it is to be quick."""
    rows: list[list[Any]] = []
    with TemporaryDirectory() as folder:
        for robot in [*CLOSED_ROBOTS][:1] if quick else CLOSED_ROBOTS:
            rounds, burst = (3, 2e-4) if quick else (60, 2e-3)
            sizes, ns, residual = closed_robot(robot, Path(folder, "robot.xml"), rounds, burst)
            ratios = {who: ns[who] / ns["eomgen"] for who in ("Pinocchio", "MuJoCo", STRICT)}
            rows.append([robot, *sizes, *ns.values(), *ratios.values(), *(f"{x:.0e}" for x in residual.values())])
            report.result(f"rhs of {robot}, ns", ns["eomgen"], {who: ns[who] for who in ("Pinocchio", "MuJoCo")})
            report.most(f"{robot}: residual of the accelerations", residual["eomgen"], 1e-10)
            if not quick:
                for who in ("Pinocchio", "MuJoCo"):
                    report.least(f"{robot}, {who} over ours,", ratios[who], 5.0)
    report.table("accelerations", ("robot", "n", "rows", "freedoms", "method", "operations", "eomgen ns",
                 "with a step ns", "Pinocchio ns", "MuJoCo ns", "tolerance 0 ns", "Pinocchio over", "MuJoCo over",
                 "tolerance 0 over", "residual", "Pinocchio's", "MuJoCo's", "tolerance 0"), rows)  # fmt: skip
    report.note(
        "One MJCF text for all: hinges and slides, points connected; a state after 0.05 s of motion from the first.",
        "Ours: rhs in a loop in C; it brings velocities onto the loops, and positions where these are off by more than",
        "rounding: with a step, which the others never make, off by 1e-9. Pinocchio: constraintDynamics of its wheel.",
        "MuJoCo: mj_forward, constraints as stiff as it allows (solimp 0.9999, the largest that it takes), so that its",
        "residual has a floor: a solver that goes on until nothing changes (tolerance 0) takes longer and leaves it.",
        "At a residual near ours, Pinocchio alone is a peer. Both from Python, less a call of an empty model.",
        "Residual: by how much connected points accelerate apart, relative, computed by Pinocchio from each result.",
        "Operations: of a call of rhs away from change points, with one Newton step of the projection.",
    )
