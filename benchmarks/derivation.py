"""From a model to its compiled functions: time to derive and to compile, operations, whole processes."""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any
from unittest.mock import patch

import numpy as np

import eomgen as eg
from eomgen import pipeline
from eomgen.codegen.c import emit_c
from eomgen.codegen.program import BY_MOTIONS, BY_SYSTEM
from eomgen.expr.core import substitute
from eomgen.expr.schedule import count
from eomgen.mechanics import analyse
from eomgen.mechanics.methods import METHODS
from eomgen.mechanics.methods.reduction import transform_velocities

from . import models
from .harness import EXAMPLES, ROOT, Finished, Report, Sample, benchmark, cold_cache, in_fresh_process, run_process
from .models.closed_robots import ROBOTS as CLOSED_ROBOTS
from .models.linkages import closed_chain, four_bars
from .peers import ROBOTS, Robot, installed

FORMS = ("embedding", "lagrange")
PATIENCE = 12.0  #: (s) a peer's derivation that takes longer is measured once


# -- time to derive ----------------------------------------------------------------------------------------------------
@benchmark("derive", "derivation of planar chains and of the Panda arm")
def derive(report: Report, quick: bool) -> None:
    """In fresh processes, eomgen and SymPy in turns."""
    rows: list[list[Any]] = []
    chains = [("3 links", "chain", 3)] if quick else [(f"{n} links", "chain", n) for n in (5, 10, 20)]
    for name, model, size in chains if quick else [*chains, ("Panda", "panda", 0)]:
        sizes, counted = [size] if size else [], 0 < size <= 10
        tasks = {f"eomgen {form}": partial(in_fresh_process, "derive", model, sizes, form) for form in FORMS}
        best = "SymPy, absolute angles" if size else "SymPy"
        tasks[best] = partial(in_fresh_process, "derive_sympy", model, sizes, counted)
        if counted:
            tasks["SymPy, relative angles"] = partial(in_fresh_process, "derive_sympy", model, [size, False], True)
        found: dict[str, list[Any]] = {who: [] for who in tasks}
        for _ in range(1 if quick else 3 if size else 5):
            for who, task in tasks.items():
                if not found[who] or found[who][0]["seconds"] < PATIENCE:
                    found[who].append(task())
        seconds = {who: Sample(tuple(r["seconds"] for r in results)) for who, results in found.items()}
        ours = seconds["eomgen embedding"].median
        for who, sample in seconds.items():
            ratio = sample.median / ours if who.startswith("SymPy") else None
            rows.append([f"{name}, {who}", sample.median, sample.best, ratio, found[who][0]["operations"]])
        report.result(f"{name}, derived by embedding, s", ours, {"SymPy": seconds[best].median})
        for form in FORMS:
            if size == 20:
                ratio = seconds[best].median / seconds[f"eomgen {form}"].median
                report.least(f"SymPy's time over {form}'s, 20 links,", ratio, 100)
            if not size:
                report.most(f"Panda, {form} derives in, best,", seconds[f"eomgen {form}"].best, 0.3, "s")
    for form, parts in (("embedding", ("mass_matrix", "bias")), ("lagrange", ("inverse_dynamics",))):
        counts = models.panda().derive(form).operations
        for part in parts:
            report.most(f"Panda, operations of {part}, {form},", counts[part].total, 2000)
    report.most("SymPy and eomgen differ in accelerations by", largest_difference(3 if quick else 5), 1e-11)
    report.table("derivation", ("model", "median s", "best s", "over embedding", "operations of M and bias"), rows)
    report.note(
        "Ours: Model through the public interface to derived equations, in the angles between neighbours.",
        "SymPy: frames and points to mass_matrix and forcing, in absolute angles, its best case, and in ours.",
        "Chains: every parameter is a symbol; Panda: a number. Fresh processes, imports left out.",
        "Operations: ours as derived (multiplications, additions, divisions); SymPy's after cse, to 10 links.",
    )


def largest_difference(n: int) -> float:
    """Angular accelerations at one state, ours against SymPy's: largest difference over the largest of them.

    Both start from the same absolute angles and rates, and are compared in absolute accelerations.
    """
    import sympy as sm

    from eomgen.expr.evaluate import evaluate

    from . import sympy_peer

    angle, rate = np.linspace(0.3, 1.9, n), np.linspace(-1.2, 2.0, n)
    values = models.chain_values(n)
    kane = sympy_peer.chain(n)
    function = sm.lambdify([kane.q, kane.u, kane.parameters], [kane.mass_matrix, kane.forcing], cse=True)
    mass, forcing = function(angle, rate, [values[p.name] for p in kane.parameters])
    theirs = np.linalg.solve(mass, np.ravel(forcing))

    # parts.tree is what eqs.mass_matrix is raised from; evaluating the graph spares a detour through SymPy
    tree = models.chain(n).derive().tree
    relative = {f"q{k + 1}": x for k, x in enumerate(np.diff(angle, prepend=0.0))}
    relative |= {f"q{k + 1}_dot": x for k, x in enumerate(np.diff(rate, prepend=0.0))}
    flat = evaluate([x for row in tree.mass_matrix for x in row] + list(tree.bias), values | relative)
    ours = np.cumsum(np.linalg.solve(np.reshape(flat[: n * n], (n, n)), -np.array(flat[n * n :])))
    return float(np.abs(ours - theirs).max() / np.abs(theirs).max())


@benchmark("growth", "growth of operations with the length of a chain")
def growth(report: Report, quick: bool) -> None:
    """Count at two lengths, one twice the other; energies and inverse dynamics must grow linearly."""
    short = 25 if quick else 100
    rows: list[list[Any]] = []
    for form in FORMS:
        single, double = (models.chain(n).derive(form).tree for n in (short, 2 * short))
        for part, of in (
            ("energies", lambda tree: [tree.kinetic_energy, tree.potential_energy]),
            ("inverse dynamics", lambda tree: tree.inverse_dynamics),
        ):
            a, b = count(of(single)).total, count(of(double)).total
            rows.append([f"{part}, {form}", a, b, b / a, b / (2 * short)])
            if form == "embedding":
                report.result(f"operations of {part} of {2 * short} links", b, {f"{short} links": a})
            report.most(f"growth of {part}, {form}, when links double", b / a, 2.1)

    def seconds_to_emit(n: int) -> float:
        model, start = models.spatial_chain(n), perf_counter()
        emit_c(pipeline.build(model.derive(), "c", ["rhs"]))
        return perf_counter() - start

    times = {n: min(seconds_to_emit(n) for _ in range(3)) for n in (short // 2, short, 2 * short)}
    report.most(f"{short} bodies in space are derived and emitted in, best,", times[short], 2.0, "s")
    report.table("operations", ("operations of", f"{short} links", f"{2 * short} links", "ratio", "per link"), rows)
    report.table("right-hand side in C", ("bodies in space", "best s"), [[n, seconds] for n, seconds in times.items()])
    report.note("Angles between neighbours, every parameter a symbol; work that depends on these only is included.")


@benchmark("compile", "compilation of rhs alone")
def compile_chain(report: Report, quick: bool) -> None:
    """A long chain in fresh processes from an empty cache."""
    links, seconds = 10 if quick else 100, []
    for _ in range(1 if quick else 3):
        with cold_cache():
            seconds.append(in_fresh_process("compile_chain", links))
    report.result(f"rhs of {links} links compiled, s", Sample(tuple(seconds)).median)
    report.most(f"rhs of {links} links compiles from an empty cache in, best,", min(seconds), 10, "s")
    report.note("Default flags; every parameter a symbol; derivation is not part of it. SymPy cannot derive it.")


# -- whole processes ---------------------------------------------------------------------------------------------------
RUN = ("slider_crank", "double_pendulum")
EXPORTED = "import slider_crank; run = slider_crank.simulate(10.0); assert run.t[-1] == 10.0 and len(run) > 100"
OF_EXPORTED, SYMPY = "exported slider_crank, imported and run for 10 s", "SymPy, lambdify, solve_ivp: double_pendulum"
#: Label -> package, task and its arguments; those that are installed run.
PROCESSES = {
    SYMPY: ("sympy", "run_double_pendulum_sympy", "[]"),
    "PyDy, lambdify, odeint: double_pendulum": ("pydy", "run_double_pendulum_pydy", '["lambdify"]'),
    "PyDy, Cython, odeint: double_pendulum": ("pydy", "run_double_pendulum_pydy", '["cython"]'),
    "CasADi, cvodes: double_pendulum by hand": ("casadi", "run_double_pendulum_casadi", "[]"),
}


def _run(model: str, *options: str, **environment: str) -> Finished:
    program = str(Path(sys.executable).with_name("eomgen"))
    return run_process([program, "run", str(EXAMPLES / f"{model}.yaml"), *options], environment)


@benchmark("latency", "latency of a whole process")
def latency(report: Report, quick: bool) -> None:
    """``eomgen run`` of new and known models and an exported module beside SymPy, in turns."""
    found: dict[str, list[Finished]] = {}
    repeats = 1 if quick else 15
    with tempfile.TemporaryDirectory(prefix="eomgen-bench-") as folder:
        program = [str(Path(sys.executable).with_name("eomgen")), "generate", str(EXAMPLES / "slider_crank.yaml")]
        run_process([*program, "--out", folder])
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
        run_process([*pip, "--target", f"{folder}/installed", f"{folder}/slider_crank"])
        for repeat in range(repeats + 1):  # the first round makes bytecode, and is not counted
            took: dict[str, Finished] = {}
            for model in RUN:
                with cold_cache():
                    took[f"eomgen run {model}, new"] = _run(model)
                    took[f"eomgen run {model}, known"] = _run(model)
            took[OF_EXPORTED] = run_process([sys.executable, "-c", EXPORTED], {"PYTHONPATH": f"{folder}/installed"})
            took["import numpy"] = run_process([sys.executable, "-c", "import numpy"])
            for label, (package, task, arguments) in PROCESSES.items():
                if installed(package) and (label == SYMPY or repeat <= 5):
                    took[label] = run_process([sys.executable, "-m", "benchmarks.tasks", task, arguments])
            for who, done in took.items():
                found.setdefault(who, []).extend([done] if repeat else [])
    wall = {who: Sample(tuple(p.wall for p in processes)) for who, processes in found.items()}
    rows: list[list[Any]] = []
    for who, sample in wall.items():
        ratio = wall[SYMPY].median / sample.median if "double_pendulum" in who and who != SYMPY else None
        rows.append([who, sample.median, sample.best, Sample(tuple(p.cpu for p in found[who])).median, ratio])
    report.table("whole process, seconds", ("process", "median", "best", "cpu", "SymPy's over it"), rows)
    for model in RUN:
        for state in ("new", "known"):
            others = list(PROCESSES) if (model, state) == ("double_pendulum", "new") else []
            peers = {who.replace(": double_pendulum", ""): wall[who].median for who in others if who in wall}
            report.result(f"eomgen run {model}, {state}, s", wall[f"eomgen run {model}, {state}"].median, peers)
    report.result(f"{OF_EXPORTED}, s", wall[OF_EXPORTED].median, {"import numpy": wall["import numpy"].median})
    report.most("slider-crank, new, median,", wall["eomgen run slider_crank, new"].median, 1.2, "s")
    report.most("slider-crank, known, median,", wall["eomgen run slider_crank, known"].median, 0.6, "s")
    ratio = wall[OF_EXPORTED].median / wall["import numpy"].median
    report.most("exported slider-crank, 10 s of motion, over a bare import of NumPy,", ratio, 2.5)
    report.note(
        "5 s of the slider-crank (a closed loop), 10 s of the double pendulum; SymPy takes KanesMethod for the latter,",
        "solves and lambdifies it with cse to plain math, and integrates at the same tolerances, as the others do.",
        "new: the cache is empty; known: it holds the model.",
        "cpu: computed by the process and its children, on all cores; hardly depends on what else the machine does.",
    )


# -- operations --------------------------------------------------------------------------------------------------------
PAGE = ROOT / "docs" / "operations.md"
ARMS = {"PUMA 560": "puma560", "Stanford arm": "stanford", "RX-90": "rx90", "Panda": "panda", "iiwa": "iiwa"}
#: Rows of the page -> models of closed_robots.
LOOPS = {
    "ankle with two rods | 12, 6": "ankle with two rods",
    "two legs with such ankles | 24, 12": "two legs with such ankles",
    "hand of three parallel fingers | 9, 6": "hand of three parallel fingers",
    "delta robot, six rods | 21, 18": "delta robot",
    "Stewart platform | 24, 18": "Stewart platform",
}
#: Where eomgen takes regrouped inertia from.
REGROUPING = ("eomgen.mechanics.methods.embedding.regroup", "eomgen.mechanics.methods.recursive.regroup")
#: The beginning of a row, and the first numbers in its other cells.
Rows = Iterator[tuple[str, tuple[int, ...]]]


def newton_step(counts: Any) -> int:
    """Operations of a call of rhs near the constraints, away from change points, with one Newton step."""
    return sum(counts[name].total for name in (BY_MOTIONS if counts.keys() >= set(BY_MOTIONS) else BY_SYSTEM))


def program_of(robot: Robot, **options: Any) -> Any:
    """The program of a robot's right-hand side."""
    return pipeline.build(robot.model(**options).derive(), "c", ["rhs"])


def of_eomgen(robot: Robot, regrouped: bool) -> list[int]:
    """Multiplications, additions and divisions of a robot's right-hand side."""

    def plain(graph: Any, links: Any) -> list[Any]:
        return [link.spatial for link in links]

    if regrouped:
        program = program_of(robot)
    else:
        with patch(REGROUPING[0], plain), patch(REGROUPING[1], plain):
            program = program_of(robot)
    kinds = ("multiplications", "additions", "divisions")
    return [sum(getattr(c, kind) for c in program.counts.values()) for kind in kinds]


def inverse_dynamics(quick: bool) -> Rows:
    """Multiplications and additions, work that depends on parameters only included."""
    for row, name in ARMS.items():
        found = count(METHODS["embedding"](analyse(models.symbolic_arm(name).mechanism())).inverse_dynamics)
        yield row, (found.multiplications, found.additions)


def forward_dynamics(quick: bool) -> Rows:
    """Of arms whose parameters are numbers."""
    for row, name in (("Panda arm", "panda"), ("UR5 arm", "ur5")):
        choice = models.numeric_arm(name, driven=True).derive().choice
        assert choice is not None
        yield row, (choice.operations["embedding"],)


def right_hand_sides(quick: bool) -> Rows:
    """Inertias numbers; symbols, and what is done once for each set of them."""
    for robot in ROBOTS[:2] if quick else ROBOTS:
        numbers, symbols = (program_of(robot, symbolic=symbolic).counts for symbolic in (False, True))
        yield f"{robot.name} (URDF)", (numbers["rhs"].total, symbols["rhs"].total, symbols["precompute"].total)


def equal_terms(quick: bool) -> Rows:
    """Multiplications, additions and divisions, inertia regrouped and not."""
    for robot in ROBOTS[:2] if quick else ROBOTS:
        for word in ("on", "off"):
            yield f"{robot.name} (URDF) | {word}", tuple(of_eomgen(robot, word == "on"))


def loops(quick: bool) -> Rows:
    """A call with one Newton step; the same by the code for states next to change points."""
    for row, name in list(LOOPS.items())[: 3 if quick else None]:
        with tempfile.TemporaryDirectory() as folder:
            (file := Path(folder, "robot.xml")).write_text(CLOSED_ROBOTS[name]().text())
            counts = pipeline.build(eg.load(file).derive(), "c", ["rhs"]).counts
        yield row, (newton_step(counts), sum(counts[block].total for block in BY_SYSTEM))


def jacobians(quick: bool) -> Rows:
    """Of loops: of the state, of a column of q and of a column of v."""
    chains = {f"closed chain of {n}": closed_chain(n, True, False) for n in ((20,) if quick else (20, 100))}
    for row, model in (chains | {"20 four-bars": four_bars(20)}).items():
        counts = pipeline.build(model.derive(), "c", ["jacobian"]).counts
        yield row, tuple(counts[b].total for b in ("loop_slopes", "slopes_by_position", "slopes_by_velocity"))


def humanoids(quick: bool) -> Rows:
    """Mass matrix and bias of thirty joints."""
    yield "humanoid", (models.humanoid().derive("embedding").operations["mass_matrix and bias"].total,)


def bicycle(quick: bool) -> Rows:
    """M and h, and the whole embedded system; every parameter a symbol, and a number."""
    equations = eg.load_example("bicycle").derive("embedding")
    kinematics, tree, graph = equations.kinematics, equations.tree, equations.kinematics.graph
    values = {p.name: p.value for p in kinematics.mechanism.parameters}
    numbers = {graph.symbol(name): graph.constant(value) for name, value in values.items()}
    reduced = transform_velocities(kinematics, equations.mobility, values | {"t": 0.0})
    matrix = reduced.mass_matrix(tree.mass_matrix)
    force = reduced.force(tree.mass_matrix, [-h for h in tree.bias])
    for row, rows, rest in (("M and h", tree.mass_matrix, tree.bias), ("complete", matrix, force)):
        outputs = [*(entry for line in rows for entry in line), *rest]
        yield f"bicycle, {row}", (count(outputs).total, count(substitute(outputs, numbers)).total)


#: Headings of the page -> who counts.
SECTIONS: dict[str, Callable[[bool], Rows]] = {
    "Inverse dynamics of robot arms, parameters as symbols": inverse_dynamics,
    "Forward dynamics, parameters as numbers": forward_dynamics,
    "Right-hand sides of robots": right_hand_sides,
    "On equal terms": equal_terms,
    "Robots with closed loops": loops,
    "Derivatives": jacobians,
    "Mass matrix and bias of a humanoid": humanoids,
    "Mass matrix and bias of a bicycle": bicycle,
}


@benchmark("counts", "operations that the documentation states, and CasADi's of the same robots")
def counts(report: Report, quick: bool) -> None:
    """Nothing takes more operations than docs/operations.md says; CasADi's instructions of its table on equal terms."""
    text = dict(part.split("\n", 1) for part in PAGE.read_text(encoding="utf-8").split("\n## ")[1:])
    rows: list[list[Any]] = []
    for heading, counted in SECTIONS.items():
        for row, found in counted(quick):
            line = text[heading].partition(f"\n| {row} |")[2].partition("\n")[0]
            stated = [int(number.replace(",", "")) for number in re.findall(r"\d[\d,]*", line)][: len(found)]
            for n, bound in zip(found, stated, strict=True):
                report.most(f"{heading}: {row}", n, bound)
                if n < bound:
                    report.note(f"The page states more than is needed: {row}: {bound}, now {n}.")
            rows.append([heading, row.replace(" | ", ", "), *(" / ".join(map(str, x)) for x in (stated, found))])
    report.table("operations", ("table of docs/operations.md", "row", "stated", "counted"), rows)
    if installed("casadi") and installed("pinocchio"):
        report.table("CasADi on equal terms", ("robot", "base parameters", "method", "multiplications", "additions",
                     "divisions", "sum", "over eomgen"), list(_of_casadi(report, quick)))  # fmt: skip
    report.note(
        "Equal terms: multiplications (squares too), additions, subtractions and doublings, divisions and reciprocals;",
        "all else is counted for none. CasADi: the shorter of articulated bodies and composite bodies with L^T D L",
        "(casadi_peer.py), after its cse. Base parameters: inertia that a joint cannot tell from its parent's is moved",
        "there. Pinocchio and MuJoCo loop over joints of any kind: no graph shows their instructions.",
    )


def _of_casadi(report: Report, quick: bool) -> Iterator[list[Any]]:
    """A row for each robot; accelerations of what is counted are compared with Pinocchio's."""
    import pinocchio as pin

    from .casadi_peer import write_robot
    from .peers import state

    for robot in ROBOTS[:2] if quick else ROBOTS:
        model = robot.pinocchio()
        q, v, tau = state(model)
        expected = pin.aba(model, model.createData(), q, v, tau - np.asarray(model.damping) * v)
        for regrouped in (True, False):
            texts = write_robot(model, regrouped=regrouped)
            for text in texts:
                found = np.array(text.function(np.concatenate([q, v]), tau)).ravel()[model.nq :]
                if not np.abs(found - expected).max() < 1e-9 * np.abs(expected).max():
                    raise RuntimeError(f"{robot.name}, {text.method}: other equations are counted")
            best = min(texts, key=lambda text: sum(text.arithmetic()))
            own, theirs = of_eomgen(robot, regrouped), best.arithmetic()
            if regrouped:
                report.result(f"{robot.name}, operations of rhs", sum(own), {"CasADi": sum(theirs)})
            yield [robot.name, "on" if regrouped else "off", best.method, *theirs, sum(theirs), sum(theirs) / sum(own)]
