"""One call of a right-hand side: from Python and in C, by several targets, of closed loops, of many bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from sys import maxsize
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

import eomgen as eg
from eomgen import pipeline
from eomgen.codegen.c import emit_c
from eomgen.codegen.program import Limits
from eomgen.module import Module
from eomgen.toolchain.build import compile_sources
from eomgen.toolchain.compiler import Options, find_compiler
from eomgen.toolchain.load import load_core

from .harness import Report, Timed, benchmark, cold_cache, in_turns, spent, timed, work
from .kernels import Kernel, loops, of_module
from .models.linkages import (
    TIMES,
    Motion,
    closed_chain,
    coupled_humanoid,
    four_bars,
    n_four_bar,
    sliders,
    tree,
    v_engine,
)


def caller(module: Any, x: np.ndarray) -> Timed:
    """Calls of a right-hand side from Python into the same array."""
    rhs, out = module.rhs, np.empty(module.n_x)
    return timed(lambda: rhs(0.0, x, out=out))


# -- from Python -------------------------------------------------------------------------------------------------------
#: What a call adds to its kernel at most (ns): into an array that is there, and into a new one.
ABOVE = {"out=": 100, "a new array": 180}
SHORT = (0.0, 1e-9)  #: a run that takes one step: all but its start is a few evaluations


def ways_to_call(module: Any, x: np.ndarray) -> dict[str, Timed]:
    """The kernel in C, and loops over calls as users write them, without a function around each."""
    out, p, u = np.empty_like(x), module.p, module.u

    def into(calls: int) -> float:
        start = perf_counter()
        for _ in range(calls):
            module.rhs(0.0, x, out=out)
        return (perf_counter() - start) / calls

    def new(calls: int) -> float:
        start = perf_counter()
        for _ in range(calls):
            module.rhs(0.0, x)
        return (perf_counter() - start) / calls

    def both(calls: int) -> float:
        start = perf_counter()
        for _ in range(calls):
            module.rhs(0.0, x, p=p, u=u, out=out)
        return (perf_counter() - start) / calls

    kernel, start = of_module(module, "rhs", x), timed(lambda: module.simulate(SHORT))
    kernel.tied = False
    return {"kernel": kernel, "out=": into, "a new array": new, "both": both, "start": start}


@benchmark("call", "one call of rhs from Python")
def call(report: Report, quick: bool) -> None:
    """Above the kernel in C, and beside SymPy's lambdify of the same equations, whose result is compared first."""
    from .sympy_peer import pendulum_rhs

    crank, pendulum = (eg.load_example(name).compile() for name in ("slider_crank", "double_pendulum"))
    x_crank, x = crank.x0(), np.array([0.7, -0.4, 1.1, 2.3])
    if pendulum.x_names != ("theta1", "bend", "theta1_dot", "bend_dot"):
        raise RuntimeError(f"the state of the pendulum has another order: {pendulum.x_names}")
    lambdified = pendulum_rhs(dict(zip(pendulum.p_names, pendulum.p.tolist(), strict=True)))
    expected = np.array(lambdified(0.0, x))
    difference = float(np.abs(pendulum.rhs(0.0, x) - expected).max() / np.abs(expected).max())
    report.most("SymPy's accelerations of the pendulum differ by", difference, 1e-12)
    numbers, rhs, rhs_crank, minimal = x.tolist(), pendulum.rhs, crank.rhs, crank.minimal
    x_minimal = minimal.x0()
    samples = in_turns({
        "double pendulum, out=": caller(pendulum, x),
        "double pendulum": timed(lambda: rhs(0.0, x)),
        "double pendulum, SymPy lambdify": timed(lambda: lambdified(0.0, x)),
        "double pendulum, SymPy lambdify on floats": timed(lambda: lambdified(0.0, numbers)),
        "slider-crank, out=": caller(crank, x_crank),
        "slider-crank": timed(lambda: rhs_crank(0.0, x_crank)),
        "slider-crank, minimal": timed(lambda: minimal.rhs(0.0, x_minimal)),
        "an empty lambda": timed(lambda: None),
    }, 2 if quick else 9, 0.005 if quick else 0.1)  # fmt: skip
    base = samples["double pendulum"].median
    rows = [
        [name, 1e9 * s.median, 1e9 * s.best, s.median / base if "SymPy" in name else None]
        for name, s in samples.items()
    ]
    report.table("call", ("what", "median ns", "best ns", "over ours, allocating"), rows)
    sympy = {"SymPy lambdify": 1e9 * samples["double pendulum, SymPy lambdify"].median}
    for name, others in (("double pendulum", sympy), ("slider-crank", {})):
        report.result(f"rhs of the {name} from Python, a new array, ns", 1e9 * samples[name].median, others)
    rows = []
    for name, module, at in (("double pendulum", pendulum, x), ("slider-crank", crank, x_crank)):
        turns = in_turns(ways_to_call(module, at), 5 if quick else 200, 1.3e-3)
        best = {way: 1e9 * sample.best for way, sample in turns.items()}
        above = {way: best[way] - best["kernel"] for way in ABOVE}
        rows.append([name, best["kernel"], *above.values(), best["both"] - best["out="], best["start"] / 1000])
        report.result(f"{name}, into an array, above its kernel in C, ns", above["out="])
        report.result(f"{name}, start of a run, us", rows[-1][-1])
        for way, bound in ABOVE.items():
            report.most(f"{name}, {way}, above the kernel", above[way], bound, "ns")
        report.most(f"{name}, p=, u= and out=, above out= alone", rows[-1][-2], 60, "ns")
        report.most(f"{name}, start of a run", rows[-1][-1], 15, "us")
    columns = ("model", "kernel in C", *ABOVE, "p=, u= above out=", "simulate, one step, us")
    report.table("above the kernel, ns, and the start of a run, us", columns, rows)
    report.note(
        "Each includes the lambda around it (last row). SymPy's: solved symbolically, cse, plain math, numbers for the",
        "parameters, a list as result; ours: parameters variable, a NumPy array as result.",
        "Above the kernel: bests of many short loops over mod.rhs(t, x, ...), loop included, less that of a loop in C.",
        "The start of a run: simulate over 1 ns from the declared initial values, which is one step.",
        "The slider-crank's rhs projects onto the loop; its minimal form solves the loop by Newton from the last call.",
    )


@benchmark("traced", "one rhs by the targets casadi and jax")
def traced(report: Report, quick: bool) -> None:
    """eomgen's C, the same equations in CasADi and in C by CasADi, and as compiled by JAX; compared before."""
    import casadi as ca
    import jax

    def ready(function: Any, x: np.ndarray) -> None:
        function(x).block_until_ready()

    rows, runs = [], 10_000
    names = ("double_pendulum", "slider_crank", "quadrotor_load", "puma560")
    for name in names[:2] if quick else names:
        equations = eg.load_example(name).derive()
        module, functions, traced = equations.compile(), equations.to_casadi(), equations.to_jax()
        x0, u, p = module.x0(), module.u, module.p
        x = ca.SX.sym("x", module.n_x)
        one = ca.Function("one", [x], [functions.rhs(0.0, x, u, p)], {"cse": True})
        with TemporaryDirectory() as folder:
            generator = ca.CodeGenerator(f"{name}.c")
            generator.add(one)
            options = {"compiler": " ".join(find_compiler().command), "flags": ["-O2"]}
            compiled = ca.external("one", ca.Importer(generator.generate(f"{folder}/"), "shell", options))
        outs, buffers = [np.empty_like(x0) for _ in range(2)], [one.buffer(), compiled.buffer()]
        for (buffer, evaluate), out in zip(buffers, outs, strict=True):
            buffer.set_arg(0, memoryview(x0))
            buffer.set_res(0, memoryview(out))
            evaluate()
        jit = jax.jit(lambda x, f=traced, u=u, p=p: f.rhs(0.0, x, u, p))
        many = jax.jit(jax.vmap(lambda x, f=traced, u=u, p=p: f.rhs(0.0, x, u, p)))
        states, expected = np.tile(x0, (runs, 1)), module.rhs(0.0, x0)
        found = [*outs, np.asarray(jit(x0)), np.asarray(many(states))[-1]]
        error = max(float(np.abs(y - expected).max() / np.abs(expected).max()) for y in found)
        if not error < 1e-10:
            raise RuntimeError(f"{name}: the targets differ by {error:.1e}")
        actions = {
            "eomgen": of_module(module, "rhs", x0), "virtual": timed(buffers[0][1]), "compiled": timed(buffers[1][1]),
            "jit": timed(partial(ready, jit, x0)), "many": timed(partial(ready, many, states)),
        }  # fmt: skip
        samples = in_turns(actions, 3 if quick else 9, 0.01)
        part = {"many": runs}
        ns = [round(1e9 * s.median / part.get(who, 1)) for who, s in samples.items()]
        rows.append([name, *ns, f"{error:.0e}"])
        report.result(f"rhs of {name} in C, ns", ns[0], {"CasADi's C": ns[2], "JAX, vmap": ns[4]})
    ways = ("eomgen, C", "CasADi, its own evaluation", "CasADi, its C", "JAX, one call", "JAX, vmap")
    report.table("ns of one evaluation of rhs", ("model", *ways, "differ by"), rows)
    report.note(
        "Medians; CasADi's functions by buffers, without conversions, about 0.1 us of which is the call.",
        f"JAX on the processor: jit, and vmap of {runs} states, per state.",
    )


# -- closed loops ------------------------------------------------------------------------------------------------------
FACTOR = 20.0  #: error of four-bars over that of their closed equation, by the same stepper at the same tolerance


@benchmark("loops", "closed loops: one right-hand side, and chains of loops")
def closed_loops(report: Report, quick: bool) -> None:
    """The slider-crank beside its closed form in C, and chains of loops as they grow (IFToMM A02)."""
    crank, states = eg.load_example("slider_crank").compile(), 512
    theta, turning = 2.0 * np.pi / states * np.arange(states), 10.0 * np.cos(0.1 * np.arange(states))
    r, l = (crank.p[crank.p_names.index(name)] for name in "rl")
    phi = np.arcsin(-r * np.sin(theta) / l)
    spin = -r * np.cos(theta) * turning / (l * np.cos(phi))
    # near the loop: one step of Newton brings it there, as in a simulation
    q = [theta, phi - theta + 1e-10 * np.sin(np.arange(states)), r * np.cos(theta) + l * np.cos(phi)]
    v = [turning, spin - turning, -r * np.sin(theta) * turning - l * np.sin(phi) * spin]
    values = dict(zip(crank.p_names, crank.p.tolist(), strict=True))
    values = [values[name] for name in ("r", "l", "m_c", "m_r", "m_s", "g")]
    if crank.v_names[0] != "theta_dot" or crank.u_names != ("tau",):
        raise RuntimeError(f"the state of the slider-crank has another order: {crank.v_names}")

    def contestants(which: slice) -> dict[str, Kernel]:
        few, many = np.transpose([theta, turning])[which], np.transpose([*q, *v])[which]
        closed = Kernel(loops().slider_crank, few, 2, [0.7], values)
        return {"closed form in C": closed, "generated": of_module(crank, "rhs", many, [0.7])}

    each = [[one.result() for one in contestants(slice(k, k + 1)).values()] for k in range(states)]
    difference = max(abs(closed[1] - generated[3]) for closed, generated in each)
    samples = in_turns(contestants(slice(None)), 30 if quick else 3000, 1e-4)
    best = {who: 1e9 * sample.best for who, sample in samples.items()}
    report.result(
        "rhs of the slider-crank in C, ns", best["generated"], {"by hand, two states": best["closed form in C"]}
    )
    report.most("the slider-crank takes, over its closed form,", best["generated"] / best["closed form in C"], 5.0)
    report.most("accelerations of both differ by, relative to 100 rad/s^2,", difference / 100.0, 1e-9)
    rows: list[list[Any]] = []
    for n in (1, 5, 10) if quick else (1, 2, 5, 10, 20, 40):
        equations = n_four_bar(n).derive(independent=["theta0"])
        counts = pipeline.build(equations, "c", ["rhs"]).counts
        operations = sum(counts[block].total for block in ("closing", "dynamics"))
        module = equations.compile()
        module.simulate((0, 0.1))
        run, seconds = spent(lambda module=module: module.simulate((0, 10)))
        us = 1e6 * in_turns({"": caller(module, module.x0())}, 5, 2e-3)[""].best
        angle = Motion(n).at(run.t)
        error = np.abs([run["x"] - np.cos(angle), run["y"] - np.sin(angle)]).max()
        energy = float(np.ptp(np.sum(module.energy(run.x), axis=0)))
        rows.append([n, operations / n, us, seconds, float(error), energy, run.residuals.position])
    columns = ("loops", "operations per loop", "rhs us", "10 s in s", "error m", "energy drift J", "residual")
    report.table("N-four-bar", columns, rows)
    report.result(f"{rows[-1][0]} four-bars, rhs, us", rows[-1][2])
    growth = rows[-1][1] / next(row[1] for row in rows if row[0] == 5)
    report.most(f"operations per loop, {rows[-1][0]} loops over 5,", growth, 1.1)
    report.most("error of the tip after change points,", max(row[4] for row in rows), 1e-3, "m")
    report.note(
        "The closed form has two states and no loop to close: it is written by hand for this linkage alone.",
        "From 9 velocities on, configurations of lost rank are passed in the same code, which takes more operations.",
        "A02 allows errors of 1e-3 (its high precision). OpenSim 3.2 took 0.455 s for N = 2 and 10 s (Intel i5-4570,",
        "rehabenggroup.github.io/MBSbenchmarksInOpenSim): another machine, so a note and no comparison.",
    )


class Comparison(NamedTuple):
    """One run of four-bars beside their closed equation."""

    error: float  #: of all cranks (rad)
    closed: float  #: of the closed equation (rad)
    seconds: float
    evaluations: int
    passes: int  #: change points noted

    @property
    def factor(self) -> float:
        """Error over that of the closed equation."""
        return self.error / self.closed


def compare(module: Any, motion: Motion, n: int, method: str, rtol: float) -> Comparison:
    """Run 10 s of a compiled row of n parallelograms, and its closed equation."""
    tolerances = {"rtol": rtol, "atol": 1e-2 * rtol}
    run, seconds = spent(lambda: module.simulate((0.0, 10.0), t_eval=TIMES, method=method, **tolerances))
    error = max(motion.error(run[f"theta{k}"]) for k in range(n + 1))
    closed = motion.error(motion.solve(method, **tolerances))
    return Comparison(error, closed, seconds, run.nfev, len(run.change_points))


@benchmark("four_bars", "N four-bars through their change points at tight tolerances")
def through_change_points(report: Report, quick: bool) -> None:
    """Every size (IFToMM A02) by both methods at five tolerances, beside the closed equation."""
    rows, found = [], []
    for n in (1, 2) if quick else (1, 2, 10, 40):
        module, motion = n_four_bar(n).compile(independent=["theta0"]), Motion(n)
        for method in ("DOP853", "Radau"):
            tolerances = (1e-8, 1e-12) if quick else (1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
            runs = [compare(module, motion, n, method, rtol) for rtol in tolerances]
            ends = [x for one in (runs[0], runs[-1]) for x in (one.error, one.evaluations, one.seconds)]
            rows.append([n, method, *ends, max(x.factor for x in runs)])
            found += runs
    at = (f"{what}, rtol {rtol}" for rtol in ("1e-8", "1e-12") for what in ("error rad", "evaluations", "s"))
    report.table("N-four-bar, 10 s", ("loops", "method", *at, "largest factor"), rows)
    report.result("largest error of four-bars over that of their closed equation", max(x.factor for x in found))
    report.most("the largest error over that of the closed equation", max(x.factor for x in found), FACTOR)
    report.least("change points noted, at least", min(x.passes for x in found), 10)
    report.most("change points noted, at most", max(x.passes for x in found), 10)
    report.note(
        "It passes its flat position ten times. Factor: error over that of the closed equation by SciPy's method."
    )


class Built:
    """A mechanism, derived and compiled, and the CPU seconds of this process and the compilers for that."""

    def __init__(self, make: Callable[[], eg.Model], times: int = 1, off: float = 0.0) -> None:
        self.derive = float("inf")
        for _ in range(times):
            model = make()
            self.equations, seconds = spent(model.derive, work)
            self.derive = min(self.derive, seconds)
        self.text = sum(map(len, emit_c(pipeline.build(self.equations, "c")).values()))
        module, self.compile = spent(self.equations.compile, work)
        x = module.x0()
        beside = x.copy()
        beside[: module.n_q] += off * np.random.default_rng(0).normal(size=module.n_q)
        self.call, self.step = caller(module, x), caller(module, beside)


def microseconds(first: Built, second: Built) -> tuple[float, float, float]:
    """Of one right-hand side each, medians of turns, and the second over the first."""
    found = in_turns({"first": first.call, "second": second.call}, 9, 0.01)
    a, b = (1e6 * sample.median for sample in found.values())
    return a, b, b / a


@benchmark("large_loops", "closed loops of any size beside open trees")
def large_loops(report: Report, quick: bool) -> None:
    """Derivation, compilation, text and calls from an empty cache: closed chains beside open ones, rows of loops."""
    with cold_cache():
        rows: list[list[Any]] = []
        for spatial in (False, True):
            for n in (10, 20) if quick else (10, 20, 50, 100, 200, 400):
                free, closed = (Built(lambda n=n, x=x, s=spatial: closed_chain(n, x, s)) for x in (False, True))
                us = microseconds(free, closed)
                what = "spatial" if spatial else "planar"
                rows.append(
                    [what, n, closed.equations.method, *us, closed.text / n / 1000, closed.derive, closed.compile]
                )
                report.most(f"{what} chain of {n}, closed over open,", us[2], 4.0)
                if n >= 400:
                    report.result(f"rhs of a closed {what} chain of {n}, us", us[1], {"open chain": us[0]})
                if n == 100 and not spatial:
                    report.most("closed planar chain of 100,", us[1], 60.0, "us")
        report.table("chains", ("chain", "links", "method", "open us", "closed us", "ratio", "text a link kB",
                     "derive s", "compile s"), rows)  # fmt: skip
        bars = {n: Built(lambda n=n: four_bars(n), 3, 1e-9) for n in ((5, 10) if quick else (20, 40, 80, 160, 320))}
        calls = {f"{n}": one.call for n, one in bars.items()} | {f"{n} step": one.step for n, one in bars.items()}
        found = in_turns(calls, 25, 0.01)
        rows = [
            [n, one.equations.method, one.derive, one.compile, one.text / n / 1000,
             *(1e6 * s.median / n for s in (found[f"{n}"], found[f"{n} step"]))]
            for n, one in bars.items()
        ]  # fmt: skip
        for column, what, sizes in ((2, "derive", 1), (3, "compile", 1), (5, "call", 0), (6, "a step", 0)):
            growth = max(b[column] / a[column] / (b[0] / a[0]) ** sizes for a, b in pairwise(rows))
            report.most(f"four-bars: {what}, growth over that of their number,", growth, 1.3)
        report.result(f"rhs of {rows[-1][0]} four-bars, us a loop", rows[-1][5])
        report.most(f"{rows[-1][0]} four-bars derive in", rows[-1][2], 5.0, "s")
        report.table("N four-bars in a row", ("N", "method", "derive s", "compile s", "text a loop kB", "us a loop",
                     "with a step"), rows)  # fmt: skip
        rows = []
        for what, make, bound in (
            ("humanoid with a coupling, over without", coupled_humanoid, 1.6),
            ("V6 engine, turned over straight", lambda turned: v_engine(3 * turned), 1.2),
            ("40 sliders with a gear, over without", lambda geared: sliders(40, geared), None),
        )[2 if quick else 0 :]:
            us = microseconds(*(Built(lambda x=x, make=make: make(x)) for x in (False, True)))
            rows.append([what, *us])
            if bound is None:
                report.most("40 sliders with a gear", us[1], 1.0, "us")
            else:
                report.most(f"{what},", us[2], bound)
        report.table("side by side", ("what", "first us", "second us", "ratio"), rows)
    report.note(
        "Every parameter is a number. Calls where loops are closed make no step onto them; with a step: 1e-9 off.",
        "Derivation and compilation take CPU seconds of this process and the compilers, from an empty cache;",
        "derivation of four-bars the least of three, their calls medians of 25 turns of all.",
    )


# -- many bodies -------------------------------------------------------------------------------------------------------
#: Bodies up to which straight-line text is compiled: at 400 it takes gcc 14 s and at 800 46 s.
STRAIGHT = 400
#: Bodies up to which there is a model in Pinocchio, whose data of 800 bodies do not fit into 16 GB.
PEER = 400


def aba_of(names: tuple[str, ...], branches: int, q: np.ndarray, v: np.ndarray) -> tuple[Timed, np.ndarray]:
    """Pinocchio's ABA of the same chain or tree at a state of ours, and its accelerations in our order."""
    import pinocchio as pin

    model, n = pin.Model(), len(names)
    model.gravity.linear = np.array([0.0, -9.81, 0.0])
    body = pin.Inertia(1.0, np.array([0.05, 0.0, 0.0]), np.diag([1e-3, 1.2e-3, 1.5e-3]))
    left = [(0, 0)]
    while left:  # bodies must come depth first
        i, parent = left.pop()
        at = pin.SE3(np.eye(3), np.array([0.1 if i else 0.0, 0.0, 0.0]))
        joint = model.addJoint(parent, pin.JointModelRY() if i % 3 == 1 else pin.JointModelRZ(), at, f"j{i}")
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
        left += [(k, joint) for k in range(branches * i + 1, min(branches * i + branches + 1, n))]
    data, places = model.createData(), [model.joints[model.getJointId(name)].idx_v for name in names]
    a, b, nothing = np.zeros((3, n))
    a[places], b[places] = q, v
    return timed(lambda: pin.aba(model, data, a, b, nothing)), pin.aba(model, data, a, b, nothing)[places]


@benchmark("big_trees", "open chains and trees of many bodies")
def big_trees(report: Report, quick: bool) -> None:
    """Up to 1,600 bodies: derived, compiled, called, beside straight-line text and Pinocchio."""
    rows: list[list[Any]] = []
    chains = [("spatial chain", lambda n: closed_chain(n, False, True), n, 1)
             for n in ((16, 50) if quick else (16, 50, 100, 200, 400, 800, 1600))]  # fmt: skip
    with cold_cache():
        tree(2).derive().compile(kernels=["rhs"])  # compiles what all models share
        for what, make, n, branches in [*chains, ("ternary tree", tree, 40 if quick else 400, 3)]:
            model = make(n)
            equations, derive = spent(lambda model=model: model.derive("recursive"))
            module, seconds = spent(lambda equations=equations: equations.compile(kernels=["rhs"]))
            program = pipeline.build(equations, "cython", ["rhs"])
            sources = emit_c(replace(program, limits=replace(program.limits, rolled=maxsize)))
            x, differ = np.random.default_rng(1).uniform(-1.0, 1.0, 2 * n), None
            calls = {"loops": caller(module, x)}
            if n <= STRAIGHT:
                built = compile_sources("model", sources, equations.name, Options())
                calls["straight"] = caller(Module(load_core(built)), x)
            if n <= PEER:
                calls["peer"], theirs = aba_of(equations.kinematics.names, branches, *np.split(x, 2))
                differ = float(np.abs(module.rhs(0.0, x)[n:] - theirs).max() / np.abs(theirs).max())
            us = {name: 1e6 * sample.median for name, sample in in_turns(calls, 21, 0.01).items()}
            texts = (sum(map(len, text.values())) / 1000 for text in (emit_c(program), sources))
            rows.append([what, n, derive, seconds, *texts, us["loops"], us.get("straight"), us.get("peer"),
                         1000 * us["loops"] / n, None if differ is None else f"{differ:.0e}"])  # fmt: skip
            if n in (400, 1600):
                report.result(f"rhs of a {what} of {n}, us", us["loops"], {"Pinocchio": us.get("peer")})
            if n <= PEER:
                bound = 2.0 if n <= 200 or branches > 1 else 1.0
                report.least(f"{what} of {n}, Pinocchio's ABA over ours,", us["peer"] / us["loops"], bound)
            if n >= 800:
                report.most(f"{what} of {n}", us["loops"] / n, 0.2, "us a body")
            if n == 1600:
                report.most(f"{what} of {n}, rhs compiled in", seconds, 10.0, "s")
    report.table("right-hand side", ("tree", "bodies", "derive s", "compile s", "text kB", "straight kB", "rhs us",
                 "straight us", "Pinocchio us", "ns a body", "difference"), rows)  # fmt: skip
    report.note(
        f"rhs alone, by `recursive`; parameters are numbers. Functions of more than {Limits().rolled:,} operations are",
        "loops over alike bodies; 'straight' is the same without loops. 'compile' is from derived equations to a",
        "loaded module, gcc included. 'difference' is that of the accelerations from Pinocchio's, relative to the",
        "largest. Pinocchio holds cubic tables, so that there is none of 800 bodies.",
    )
