"""Whole runs: simulations, integrators, stiff problems, derivatives of runs, ensembles, equilibria."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib import import_module
from math import sin
from time import process_time
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize
from scipy.integrate import odeint, solve_ivp
from scipy.integrate._ivp import dop853_coefficients as dop

import eomgen as eg
from eomgen.pipeline import build
from eomgen.runtime.kernels import eager

from .harness import Report, Timed, benchmark, in_turns, spent, timed
from .kernels import HERE, compile_text
from .models import chain, chain_with_joints
from .models.statics import FAMILIES
from .peers import Heyoka, heyoka_exact, heyoka_system, installed

State = Callable[[], np.ndarray]


def dop853_loop(n: int, *macros: str) -> ctypes.CDLL:
    """The loops of dop853.c for n states, behind the coefficients of the method, compiled for this processor."""

    def listed(values: Any) -> str:
        return "{" + ", ".join(listed(x) if np.ndim(x) else f"{x:.17g}" for x in values) + "}"

    text = (
        f"enum {{ N = {n} }};\nstatic const double A_[12][12] = {listed(dop.A[:12, :12])}, B_[12] = {listed(dop.B)},\n"
    )
    text += f"    C_[12] = {listed(dop.C[:12])}, E3_[13] = {listed(dop.E3)}, E5_[13] = {listed(dop.E5)};\n"
    text += (HERE / "dop853.c").read_text(encoding="utf-8")
    return compile_text(text, ["-O3", "-march=native", *macros])


# -- one run -----------------------------------------------------------------------------------------------------------
@benchmark("simulate", "simulation")
def simulate(report: Report, quick: bool) -> None:
    """Examples at the tolerances of their files, the double pendulum in turns with SciPy on ours and on SymPy's."""
    from .sympy_peer import pendulum_rhs

    ends = {"slider_crank": 5.0, "andrews_squeezer": 0.03, "double_pendulum": 10.0}
    modules = {name: eg.load_example(name).compile() for name in ends if not (quick and name == "andrews_squeezer")}
    pendulum = modules["double_pendulum"]
    x0, settings = pendulum.x0(), pendulum.metadata["simulation"]
    tolerances = {"method": "DOP853", "rtol": settings["rtol"], "atol": settings["atol"]}
    lambdified = pendulum_rhs(dict(zip(pendulum.p_names, pendulum.p.tolist(), strict=True)))
    peers = {"solve_ivp on mod.rhs": pendulum.rhs, "solve_ivp on SymPy lambdify": lambdified}
    runs = {f"{name}, {ends[name]:g} s": partial(mod.simulate, (0.0, ends[name])) for name, mod in modules.items()}
    runs |= {
        f"double_pendulum, {who}": partial(solve_ivp, rhs, (0.0, 10.0), x0, **tolerances) for who, rhs in peers.items()
    }
    results = {name: run() for name, run in runs.items()}
    samples = in_turns({name: timed(run) for name, run in runs.items()}, 1 if quick else 7)
    base, rows = samples["double_pendulum, 10 s"].best, []
    median = {name: 1e3 * sample.median for name, sample in samples.items()}
    for name, mine in zip(modules, list(median)[: len(modules)], strict=True):
        others = {who: median[f"{name}, {who}"] for who in peers if name == "double_pendulum"}
        report.result(f"simulate {mine}, ms", median[mine], others)
    for name, s in samples.items():
        calls = int(results[name].nfev)
        ratio = s.best / base if "solve_ivp" in name else None
        rows.append(
            [name, 1e3 * s.median, 1e3 * s.best, ratio, len(results[name].t) - 1, calls, 1e6 * s.median / calls]
        )
    ends_ = [solve_ivp(rhs, (0.0, 1.0), x0, **tolerances).y[:, -1] for rhs in peers.values()]
    difference = float(np.abs(ends_[0] - ends_[1]).max())
    report.most("the double pendulum after 1 s, SymPy's and ours, differs by", difference, 1e-8)
    columns = ("simulation", "median ms", "best ms", "over simulate", "steps", "calls of rhs", "us a call")
    report.table("simulation", columns, rows)
    report.note(
        "simulate also projects every stored state onto the loops and evaluates the outputs.",
        "Tolerances and integrator (DOP853) are those of the example's file, for every row.",
    )


#: Error at the end of the run -> how much longer than heyoka ours may take for it.
GOALS: dict[int, dict[float, float]] = {2: {1e-6: 1.0, 1e-9: 1.0, 1e-12: 1.5}, 5: {1e-5: 1.0, 1e-6: 1.0}}
#: Tolerances that are tried, of ours and of heyoka, which compiles for each.
TOLERANCES = {2: [10.0 ** (-k / 4) for k in range(18, 56)], 5: [10.0 ** (-k / 4) for k in range(32, 58)]}
STARTS = 8  #: over which errors and times are averaged: a single one may be lucky at a tolerance
DECADES = 1.5  #: on both sides of an error over which the time as a function of the error is taken for a line
IN_A_ROW = 3  #: runs of which a turn takes the best: the first finds the caches full of what the others have left


def best_of(action: Callable[[], Any]) -> Timed:
    """The shortest of several runs (s)."""
    return lambda calls: min(spent(action)[1] for _ in range(IN_A_ROW))


def by_hand(module: Any, x0: np.ndarray, end: float, rtol: float, atol: float) -> dict[str, State]:
    """The plain loop of dop853.c over a module's right-hand side, and numbalsoda's if it is installed."""
    loop = dop853_loop(module.n_x)
    core, context, real, pointer = eager(module.core), module.kernels.context, ctypes.c_double, ctypes.c_void_p
    loop.integrate.restype = ctypes.c_long
    loop.integrate.argtypes = [pointer, pointer, pointer, pointer, real, real, pointer, real, real]
    loop.soda_prepare.argtypes = [pointer] * 4
    arrays = context.u, context.c, np.empty(core.sizes["n_work"] + 1)
    given = core.address("rhs"), *(a.ctypes.data for a in arrays)

    def hand(keep: Any = arrays) -> np.ndarray:
        y = x0.copy()
        loop.integrate(*given, 0.0, end, y.ctypes.data, rtol, atol)
        return y

    if not installed("numbalsoda"):
        return {"hand-written C loop": hand}
    soda = import_module("numbalsoda").dop853
    loop.soda_prepare(*given)
    address = ctypes.cast(loop.soda_rhs, pointer).value
    options = {"data": np.zeros(1), "rtol": rtol, "atol": atol, "mxstep": 10**7}
    return {
        "hand-written C loop": hand,
        "numbalsoda DOP853": lambda: np.asarray(soda(address, x0, np.array([0.0, end]), **options)[0][-1]),
    }


@benchmark("integrate", "integration of a double pendulum and of a chain of 5 links")
def integrate(report: Report, quick: bool) -> None:
    """Both for 10 s by every driver, then against heyoka at equal error."""
    end, whole, tight, times = 10.0, (0.0, 10.0), {"rtol": 1e-10, "atol": 1e-12}, np.linspace(0.0, 10.0, 1001)
    rows: list[list[Any]] = []
    races: list[list[Any]] = []
    for n in (2, 5):
        derived = chain(n).derive()
        module, x0 = derived.compile(), np.concatenate([[1.0], np.full(n - 1, 0.3), np.zeros(n)])
        rhs, go = module.rhs, module.integrator(**tight)
        ours = partial(module.simulate, initial=x0, **tight)
        scipys = partial(solve_ivp, rhs, whole, x0, **tight)
        drivers: dict[str, Callable[[], Any]] = by_hand(module, x0, end, **tight) | {
            "integrator": lambda go=go, x0=x0: np.asarray(go(0.0, x0, end)),
            "simulate": lambda f=ours: f(whole).x[:, -1],
            "simulate, one step": lambda f=ours: f((0.0, 1e-4), first_step=1e-4).x[:, -1],
            "simulate, 1,001 points": lambda f=ours: f(whole, t_eval=times).x[:, -1],
            "solve_ivp, our DOP853": lambda f=scipys, m=module: f(method=m.DOP853).y[:, -1],
            "solve_ivp, our DOP853, 1,001 points": lambda f=scipys, m=module: f(method=m.DOP853, t_eval=times).y[:, -1],
            "solve_ivp, SciPy's DOP853": lambda f=scipys: f(method="DOP853").y[:, -1],
            "odeint": lambda f=rhs, x0=x0: odeint(f, x0, [0.0, end], mxstep=10**6, tfirst=True, **tight)[-1],
        }
        finals = {name: driver() for name, driver in drivers.items()}
        samples = in_turns({name: best_of(driver) for name, driver in drivers.items()}, 2 if quick else 15)
        steps, best = len(ours(whole).t) - 1, {name: sample.best for name, sample in samples.items()}
        base, exact = best["hand-written C loop"], finals["hand-written C loop"]
        over = {name: 1e6 * (seconds - base) / steps for name, seconds in best.items()}
        for name, sample in samples.items():
            ends = (
                [over[name], float(np.abs(finals[name] - exact).max())] if name != "simulate, one step" else [None] * 2
            )
            rows.append([f"{n} links, {name}", 1e3 * sample.median, 1e3 * sample.best, sample.best / base, *ends])
        beside = ("hand-written C loop", "numbalsoda DOP853", "solve_ivp, SciPy's DOP853", "odeint")
        others = {who: 1e3 * best[who] for who in beside if who in best}
        report.result(f"{n} links, 10 s at rtol 1e-10, ms", 1e3 * best["simulate"], others)
        report.most(f"{n} links: simulate over a hand-written C loop", best["simulate"] / base, 1.15)
        if (soda := "numbalsoda DOP853") in best:
            for who in ("simulate", "integrator"):
                report.most(f"{n} links: {who} over {soda}", best[who] / best[soda], 1.0)
        name = "solve_ivp, our DOP853"
        report.most(f"{n} links: {name}, above the loop", over[name], 4.0, "us a step")
        report.most(
            f"{n} links: {name}, 1,001 points, above the loop", over[f"{name}, 1,001 points"], 10.0, "us a step"
        )
        report.least(f"{n} links: SciPy's DOP853 over ours", best["solve_ivp, SciPy's DOP853"] / best[name], 12.0)
        if installed("heyoka"):
            values = dict(zip(module.p_names, module.p.tolist(), strict=True))
            races += race(report, module, heyoka_system(build(derived), values), x0, end, 1 if quick else 8)
    columns = ("driver", "median ms", "best ms", "over hand-written", "us a step above it", "difference at the end")
    report.table("10 s at rtol 1e-10, atol 1e-12", columns, rows)
    if races:
        report.table("heyoka over the same right-hand side", ("at equal error", "DOP853 ms", "Taylor ms", "heyoka ms",
                     "Taylor by simulate ms", "DOP853 over heyoka", "Taylor over heyoka",
                     "heyoka compiles s"), races)  # fmt: skip
    report.note(
        "The hand-written loop calls the same compiled right-hand side and stores one state; ratios are of best times.",
        "simulate stores every step, projects the states and makes a trajectory; one step shows the least that costs.",
        f"Each turn takes the best of {IN_A_ROW} runs in a row: the first of them finds cold caches.",
        "At equal error ours are integrators made ready, as heyoka's is; simulate starts from nothing.",
        f"Errors and times at equal error: means of logarithms over {STARTS} starts, one may be lucky at a tolerance;",
        f"times on the line through those of the tolerances, four a decade, whose error is within {DECADES} decades.",
        "heyoka is given our right-hand side as it is, its parameters as numbers; ours are variable.",
        "The reference is heyoka's in long doubles.",
    )


def race(
    report: Report, module: Any, equations: list[tuple[Any, Any]], start: np.ndarray, end: float, repeats: int
) -> list[list[Any]]:
    """The time each takes to an error, on the line of times over errors; the better of ours counts."""
    n, around = len(equations) // 2, np.random.default_rng(1)
    starts = [start, *(start * around.uniform(0.6, 1.2, 2 * n) for _ in range(STARTS - 1))]
    given = [(x0, heyoka_exact(equations, x0, end)) for x0 in starts]
    theirs, seconds = spent(lambda: {tolerance: Heyoka(equations, tolerance) for tolerance in TOLERANCES[n]})

    def integrator(method: str, tolerance: float) -> Callable[[np.ndarray], np.ndarray]:
        go = module.integrator(method=method, rtol=max(tolerance, 3e-14), atol=tolerance / 100)
        return lambda x0: go(0.0, x0, end)

    def simulate(tolerance: float) -> Callable[[np.ndarray], np.ndarray]:
        options = {"rtol": max(tolerance, 3e-14), "atol": tolerance / 100, "method": "Taylor", "t_eval": [end]}
        return lambda x0: np.asarray(module.simulate((0.0, end), x0, **options).x[:, -1])

    ways = {
        "DOP853": partial(integrator, "DOP853"), "Taylor": partial(integrator, "Taylor"),
        "heyoka": lambda tolerance: partial(theirs[tolerance], end=end), "simulate": simulate,
    }  # fmt: skip
    runs = {(who, tolerance): make(tolerance) for who, make in ways.items() for tolerance in TOLERANCES[n]}
    errors = {
        key: np.mean([np.log10(np.abs(run(x0) - exact).max()) for x0, exact in given]) for key, run in runs.items()
    }
    actions = {f"{key} {k}": best_of(partial(run, x0)) for key, run in runs.items() for k, x0 in enumerate(starts)}
    samples = in_turns(actions, repeats)
    times = {key: np.mean([np.log(samples[f"{key} {k}"].best) for k in range(STARTS)]) for key in runs}
    rows: list[list[Any]] = []
    for goal, bound in GOALS[n].items():
        found: dict[str, float] = {}
        for who in ways:
            near = [key for key in runs if key[0] == who and abs(errors[key] - np.log10(goal)) <= DECADES]
            line = np.polyfit([errors[key] for key in near], [times[key] for key in near], 1)
            found[who] = float(np.exp(np.polyval(line, np.log10(goal))))
        ratios = [found[who] / found["heyoka"] for who in ("DOP853", "Taylor")]
        what = f"{n} links, error {goal:g}"
        rows.append([what, *(1e3 * s for s in found.values()), *ratios, seconds / len(theirs)])
        ms = {who: 1e3 * s for who, s in found.items()}
        report.result(f"{what}, ms", min(ms["DOP853"], ms["Taylor"]), {"heyoka": ms["heyoka"]})
        report.most(f"{what}: our best over heyoka", min(ratios), bound)
    return rows


@benchmark("stiff", "stiff problems")
def stiff(report: Report, quick: bool) -> None:
    """The compiled Radau beside SciPy's Radau with the same Jacobian and odeint, at equal error, in turns."""
    end, peer, rows = 10.0, {"rtol": 1e-8, "atol": 1e-10}, []
    governor = eg.load_example("flyball_governor")
    for name, (model, x0) in {"stiff chain of 5": chain_with_joints(5), "flyball governor": (governor, None)}.items():
        module = model.compile(kernels=None)
        x0 = module.x0() if x0 is None else x0

        def ours(rtol: float, module: Any = module, x0: Any = x0) -> np.ndarray:
            run = module.simulate(end, x0, method="Radau", rtol=rtol, atol=rtol / 100, t_eval=[end])
            return np.asarray(run.x[:, -1])

        exact = ours(1e-12)
        loose = {f"ours, rtol {rtol:g}": partial(ours, rtol) for rtol in (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)}
        lsoda, scipy = "odeint, rtol 1e-08", "solve_ivp Radau, rtol 1e-08"
        solvers: dict[str, State] = loose | {
            lsoda: lambda f=module.rhs, x0=x0: odeint(f, x0, [0.0, end], mxstep=10**7, tfirst=True, **peer)[-1],
            scipy: lambda m=module, x0=x0: solve_ivp(m.rhs, (0.0, end), x0, method="Radau", jac=m.jacobian, **peer).y[
                :, -1
            ],
        }
        errors = {who: float(np.abs(solve() - exact).max()) for who, solve in solvers.items()}
        actions = {who: timed(solve, process_time) for who, solve in solvers.items()}
        slow = {scipy: actions.pop(scipy)}
        samples = in_turns(actions, 1 if quick else 15) | in_turns(slow, 1 if quick else 3)
        rows += [[f"{name}, {who}", 1e3 * s.best, 1e3 * s.median, f"{errors[who]:.1e}"] for who, s in samples.items()]
        best = {who: sample.best for who, sample in samples.items()}
        equal = next(who for who in loose if errors[who] <= errors[lsoda])
        others = {"odeint": 1e3 * best[lsoda], "SciPy's Radau at rtol 1e-8": 1e3 * best[scipy]}
        report.result(f"{name}, 10 s with no larger an error than odeint, ms", 1e3 * best[equal], others)
        report.least(f"{name}: SciPy's Radau with our Jacobian over ours", best[scipy] / best["ours, rtol 1e-08"], 20.0)
        report.most(f"{name}: ours over odeint at no larger error", best[equal] / best[lsoda], 1.0)
    report.table("stiff", ("10 s of", "best ms", "median ms", "error"), rows)
    report.note(
        "Processor time; errors after 10 s. odeint is LSODA on our right-hand side, called through Python.",
        "LSODA called from C took 2.0 ms for the chain at an error of 1e-7 (numbalsoda, same kind of machine).",
        "SciPy's Radau gets our Jacobian and takes the same steps as ours.",
    )


# -- derivatives of a run ----------------------------------------------------------------------------------------------
VALUES = {"m2": 2.0, "m3": 1.2, "I2": 0.05, "I3": 0.03, "d1": 0.15, "d2": 0.08, "f1": 0.4, "f2": 0.2}


def arm() -> eg.Model:
    """Two links that swing with viscous and smoothed dry friction."""
    m = eg.Model("arm", gravity=(0, -9.81, 0))
    for name, value in VALUES.items():
        m.parameter(name, value)
    m.body("upper", mass="m2", com=(0.25, 0, 0), inertia={"zz": "I2"}, markers={"tip": (0.5, 0, 0)})
    m.body("lower", mass="m3", com=(0.2, 0, 0), inertia={"zz": "I3"})
    m.revolute("shoulder", m.ground, "upper", coordinate="a")
    m.revolute("elbow", "upper.tip", "lower", coordinate="b")
    m.friction("in_shoulder", "shoulder", coulomb="f1", viscous="d1", smoothing=0.05)
    m.friction("in_elbow", "elbow", coulomb="f2", viscous="d2", smoothing=0.05)
    m.torque("drive", "shoulder", m.input("tau"))
    return m


@benchmark("fit", "derivatives of a run by eight parameters")
def fit(report: Report, quick: bool) -> None:
    """Of a two-link arm: exact ones, and differences of runs, in turns."""
    module, start, times, step = arm().compile(), {"a": 0.6, "b": -0.9}, np.linspace(0.0, 2.0, 81), 1e-5
    tolerances = {"rtol": 1e-8, "atol": 1e-10, "method": "DOP853"}
    arguments: dict[str, Any] = {"span": (0.0, 2.0), "initial": start, "t_eval": times, **tolerances}
    arguments |= {"inputs": {"tau": "4*sin(5*t) + 3*sin(2.3*t)"}, "parameters": None}
    names, x0 = tuple(VALUES), module.x0(start)

    def exact(**options: float) -> np.ndarray:
        return np.moveaxis(module.sensitivities(names, **{**arguments, **options}).dx, 1, 2)

    def differences(run: Callable[[dict[str, float]], np.ndarray]) -> np.ndarray:
        columns = []
        for name, value in VALUES.items():
            high, low = (run({name: value * (1 + sign * step)}) for sign in (1, -1))
            columns.append((high - low) / (2 * step * value))
        return np.moveaxis(np.array(columns), 0, 2)

    def compiled(values: dict[str, float]) -> np.ndarray:
        return np.asarray(module.simulate(**{**arguments, "parameters": values}).x)

    def by_scipy(values: dict[str, float]) -> np.ndarray:
        p = np.array([values.get(name, value) for name, value in zip(names, module.p, strict=True)])

        def rhs(t: float, x: np.ndarray) -> np.ndarray:
            return np.asarray(module.rhs(t, x, p=p, u=np.array([4 * sin(5 * t) + 3 * sin(2.3 * t)])))

        return np.asarray(solve_ivp(rhs, (0.0, 2.0), x0, t_eval=times, **tolerances).y)

    ways: dict[str, State] = {
        "along the run": exact,
        "differences of compiled runs": partial(differences, compiled),
        "differences of runs by solve_ivp": partial(differences, by_scipy),
    }  # fmt: skip
    truth = exact(rtol=1e-12, atol=1e-14)
    size = np.abs(truth).max(axis=(0, 1))
    errors = {name: float((np.abs(way() - truth) / size).max()) for name, way in ways.items()}
    samples = in_turns({name: timed(way) for name, way in ways.items()}, 2 if quick else 7)
    first = samples["along the run"].median
    others = {who: 1e3 * sample.median for who, sample in samples.items() if who.startswith("differences")}
    report.result("derivatives of a run by eight parameters, ms", 1e3 * first, others)
    rows = [[name, s.median * 1e3, s.median / first, errors[name]] for name, s in samples.items()]
    report.table("eight parameters", ("way", "ms", "times the first", "differs from the first at rtol 1e-12 by"), rows)
    if not quick:
        report.least("faster than differences of runs by solve_ivp", rows[-1][2], 20.0, "times")
    report.note(
        f"All derivatives of four states at {len(times)} times, by eight parameters; medians, in turns.",
        f"Runs of DOP853, rtol 1e-8; central differences of relative step {step:g}, two runs for each parameter.",
    )


# -- many runs ---------------------------------------------------------------------------------------------------------
PENDULUM = np.array([1.0, 1.0, 1.0, 1.0, 9.81])  #: m1, m2, l1, l2, g of the example
THREADS = 2


def pendulum_lanes(x: np.ndarray, threads: int, end: float, rtol: float, atol: float) -> State:
    """DOP853 by hand for this pendulum alone, four runs with one step size; blocks as threads get to them."""
    library, real, pointer = dop853_loop(4, "-DLANES", "-ffast-math"), ctypes.c_double, ctypes.c_void_p
    library.run_many.argtypes = [ctypes.c_long, ctypes.c_long, real, pointer, pointer, real, real]
    blocks = [(k, min(k + 40, len(x))) for k in range(0, len(x), 40)]

    def run() -> np.ndarray:
        rows = x.copy()
        with ThreadPoolExecutor(threads) as pool:
            list(
                pool.map(
                    lambda b: library.run_many(*b, end, rows.ctypes.data, PENDULUM.ctypes.data, rtol, atol), blocks
                )
            )
        return rows

    return run


def heyoka_batches(x: np.ndarray, end: float, tol: float, size: int = 0) -> State:
    """heyoka's batch integrators, one in each thread; the time it takes to compile them does not count."""
    hk: Any = import_module("heyoka")
    a, b, w1, w2 = hk.make_vars("a", "b", "w1", "w2")
    m1, m2, l1, l2, g = PENDULUM
    m = m1 + m2
    s, c = hk.sin(a - b), hk.cos(a - b)
    b1, b2 = -m2 * l2 * w2 * w2 * s - m * g * hk.sin(a), l1 * w1 * w1 * s - g * hk.sin(b)
    a1 = (b1 - m2 * c * b2) / (l1 * (m - m2 * c * c))
    system = [(a, w1), (b, w2), (w1, a1), (w2, (b2 - l1 * c * a1) / l2)]
    size = size or hk.recommended_simd_size()
    first = np.ascontiguousarray(x[:size].T)
    integrators = [hk.taylor_adaptive_batch(system, first, tol=tol) for _ in range(THREADS)]

    def run() -> np.ndarray:
        rows = np.empty_like(x)

        def share(k: int) -> None:
            mine = integrators[k]
            for j in range(k * size, len(x), THREADS * size):
                mine.set_time(0.0)
                mine.state[:] = x[j : j + size].T
                mine.propagate_until(end)
                rows[j : j + size] = mine.state.T

        with ThreadPoolExecutor(THREADS) as pool:
            list(pool.map(share, range(THREADS)))
        return rows

    return run


@benchmark("ensembles", "many runs at once: double pendulums")
def ensembles(report: Report, quick: bool) -> None:
    """simulate_many beside heyoka's batches, a loop over solve_ivp and lanes by hand, in turns; the best counts."""
    count, end, tight = 80 if quick else 1000, 10.0, {"rtol": 1e-10, "atol": 1e-12}
    x = np.zeros((count, 4))  # angles from the vertical and their rates
    x[:, :2] = np.random.default_rng(3).uniform(-1, 1, (count, 2))
    module = eg.load_example("double_pendulum").compile()
    ours = np.array([x[:, 0], x[:, 1] - x[:, 0], x[:, 2], x[:, 3] - x[:, 2]])

    def many(threads: int, **options: Any) -> np.ndarray:
        last = module.simulate_many(end, ours, threads=threads, **options).x
        return np.array([last[0], last[0] + last[1], last[2], last[2] + last[3]]).T

    def loop() -> None:
        for k in range(0, count, 50):
            solve_ivp(module.rhs, (0, end), ours[:, k], method="DOP853", **tight)

    def error(rows: np.ndarray) -> float:
        return float(np.median(np.abs(rows - exact).max(axis=1)))

    exact = many(THREADS, rtol=1e-13, atol=1e-14)
    mine, series, one = f"eomgen, {THREADS} threads", f"eomgen, Taylor, {THREADS} threads", "eomgen, 1 thread"
    hand, by_one, scipy = f"4 lanes by hand, {THREADS} threads", "4 lanes by hand, 1 thread", "solve_ivp, every 50th"
    actions: dict[str, Callable[[], Any]] = {
        mine: lambda: many(THREADS, **tight),
        series: lambda: many(THREADS, method="Taylor", **tight),
        hand: pendulum_lanes(x, THREADS, end, **tight),
        one: lambda: many(1, **tight),
        by_one: pendulum_lanes(x, 1, end, **tight),
        scipy: loop,
    }
    heyoka: list[str] = []
    if installed("heyoka"):
        for size in dict.fromkeys((import_module("heyoka").recommended_simd_size(), 4)):
            actions[f"heyoka, batches of {size}, {THREADS} threads"] = heyoka_batches(x, end, tight["rtol"], size)
        wanted = error(actions[mine]())
        for tol in (10.0 ** (-k / 4) for k in range(28, 57)):  # the loosest that errs no more
            batches = heyoka_batches(x, end, tol)
            if error(batches()) <= wanted:
                break
        actions["heyoka, as accurate as eomgen"] = batches
        heyoka = [who for who in actions if who.startswith("heyoka")]
        report.note(
            f"heyoka's Taylor method errs less at its tolerance; at {tol:.1e} it errs as much as eomgen at 1e-10."
        )
    errors = {who: error(rows) for who, action in actions.items() if (rows := action()) is not None}
    samples = in_turns({who: timed(action) for who, action in actions.items()}, 1 if quick else 15)
    cpu = in_turns({who: timed(action, process_time) for who, action in actions.items()}, 1 if quick else 3)
    part = {scipy: 50}
    best = {who: count / s.best / part.get(who, 1) for who, s in samples.items()}
    middle = {who: count / s.median / part.get(who, 1) for who, s in samples.items()}
    report.table("runs a second", ("who", "median", "best", "eomgen's median over it", "its best over it",
                 "processor's microseconds a run", "median error"), [
        [who, middle[who], best[who], middle[mine] / middle[who], best[mine] / best[who],
         1e6 * cpu[who].best * part.get(who, 1) / count, errors.get(who)] for who in actions
    ])  # fmt: skip
    others = {"heyoka": max((best[who] for who in heyoka[:-1]), default=None), "solve_ivp": best[scipy]}
    others["DOP853 by hand in 4 lanes"] = best[hand]
    report.result(f"{count} double pendulums, runs a second", max(best[mine], best[series]), others)
    if not quick:
        report.least("over a loop of solve_ivp", best[mine] / best[scipy], 600.0)
        report.least("over 4 lanes by hand", best[mine] / best[hand], 0.85)
        report.least("over 4 lanes by hand, one thread", best[one] / best[by_one], 0.85)
        for who in heyoka:
            report.least(f"over {who}", max(best[mine], best[series]) / best[who], 1.8)
    report.note(
        f"{count} double pendulums, 10 s, rtol 1e-10, atol 1e-12; each run of eomgen has its own steps.",
        "By hand: DOP853 for this pendulum alone, 4 runs with one step size, -O3 -march=native -ffast-math.",
        "Beside heyoka the better of eomgen's methods counts, DOP853 (the first row) or Taylor.",
        f"eomgen runs {module.core.lane_width} side by side.  Errors are the largest of a run's states at the end.",
    )


@benchmark("loop_lanes", "closed loops in lanes")
def loop_lanes(report: Report, quick: bool) -> None:
    """Ensembles and batches of closed loops side by side, beside one state after the other, in turns."""
    count, columns, repeats = (40, 64, 1) if quick else (1000, 4096, 7)
    start = {"theta": 0.3, "theta_dot": np.linspace(5.0, 15.0, count)}
    names = ("slider_crank", "four_bar", "bricard", "excavator", "stewart_platform")
    rows = []
    for name in names:
        model = eg.load_example(name)
        modules = {"lanes": model.compile(), "one": model.compile(lanes=0)}
        wide, one = modules.values()
        if name == names[0]:
            options: dict[str, Any] = {"rtol": 1e-8, "atol": 1e-10, "threads": 2}
            runs = {who: partial(m.simulate_many, 10.0, start, **options) for who, m in modules.items()}
            ends = {who: run().x for who, run in runs.items()}
            exact = one.simulate_many(10.0, start, **options | {"rtol": 1e-12, "atol": 1e-14}).x
            same = (wide.simulate_many(10.0, start, **options | {"threads": 1}).x == ends["lanes"]).all()
            errors = {who: float(np.median(np.abs(x - exact).max(axis=0))) for who, x in ends.items()}
            samples = in_turns({who: timed(run) for who, run in runs.items()}, repeats)
            labels = {"lanes": f"{wide.core.core.lane_width} side by side", "one": "one after the other"}
            found = [[labels[who], count / s.median, count / s.best, errors[who]] for who, s in samples.items()]
        x = wide.x0()[:, None] + 1e-3 * np.random.default_rng(0).standard_normal((wide.n_x, columns))
        out, alike = np.empty_like(x), bool((wide.rhs(0.0, x) == one.rhs(0.0, x)).all())
        calls = {who: timed(partial(m.rhs, 0.0, x, out=out)) for who, m in modules.items()}
        a, b = (1e9 * sample.median / columns for sample in in_turns(calls, repeats).values())
        rows.append([name, a, b, b / a, alike])
        report.result(f"rhs of {name} in lanes, ns a state", a, {"one at a time": b})
    title = f"{count} slider-cranks, 10 s, rtol 1e-08, two threads"
    report.table(title, ("runs", "runs a second", "best", "median error"), found)
    report.table("right-hand sides of a batch, nanoseconds a state", ("model", "lanes", "one after the other", "ratio",
                 "same bits"), rows)  # fmt: skip
    report.result(f"{count} slider-cranks, runs a second", found[0][1], {"one after the other": found[1][1]})
    report.least("runs in lanes over runs one after the other", found[0][1] / found[1][1], 3.0)
    report.most("runs that differ between one thread and two", float(not same), 0.0)
    report.note(
        "Errors are the largest of a run's states at the end, beside runs at 1e-12.",
        "Both include the initial states, which are assembled together, and the projection of the last states.",
    )


# -- equilibria --------------------------------------------------------------------------------------------------------
BALANCED = 1e-9  #: what may be left of a balance, relative to the terms of its row
TELLS = 1e-8  #: part of the stiffness that central differences tell from zero
SINGULAR = 1e12  #: condition of the mass matrix above which coordinates are singular
PEERS = ("newton", "hybr", "lm")


class Balance:
    """The equations of balance of one module as they stand: no step, scale or projection of ours.

    Unknowns are the coordinates of the tree and a multiplier for each independent constraint row; equations are
    h + C_q^T l = 0, C = 0, and e^T e = 1 for Euler parameters.
    """

    def __init__(self, module: Any) -> None:
        self.module, self.n_q = module, module.n_q
        turned = [k for k, kind in enumerate(module.layout.coordinate_kinds) if kind == "parameter"]
        self.fours = [turned[k : k + 4] for k in range(0, len(turned), 4)]

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """The residual (n,) at z (n,)."""
        q, l = z[: self.n_q], z[self.n_q :]
        force = self.module.bias(0.0, np.concatenate([q, np.zeros(self.module.n_v)]))
        if len(l):
            force = force + self.module.constraint_jacobian(q).T @ l
        lengths = [q[four] @ q[four] - 1.0 for four in self.fours]
        return np.concatenate([force, self.module.constraints(q) if len(l) else np.zeros(0), lengths])

    def start(self, q: np.ndarray) -> np.ndarray:
        """The unknowns at a position, with the multipliers that fit best."""
        rows, force = self.module.constraint_jacobian(q), self.module.bias(0.0, np.append(q, np.zeros(self.module.n_v)))
        return np.append(q, np.linalg.lstsq(rows.T, -force, rcond=None)[0] if len(rows) else np.zeros(0))

    def slopes(self, z: np.ndarray) -> np.ndarray:
        """Its derivative (n, n) by central differences."""
        columns = []
        for k in range(len(z)):
            h = 1e-6 * max(1.0, abs(z[k])) * np.eye(len(z))[k]
            columns.append((self(z + h) - self(z - h)) / (2.0 * h[k]))
        return np.array(columns).T

    def holds(self, z: np.ndarray) -> bool:
        """Whether z solves the equations, relative to what a change of the unknowns by themselves does to each.

        Where Euler angles are singular forces do no work along them, and nothing is known of balance.
        """
        if not np.isfinite(z).all() or np.abs(z[: self.n_q]).max() > 1e6:
            return False
        if np.linalg.cond(self.module.mass_matrix(z[: self.n_q])) > SINGULAR:
            return False
        residual, terms = self(z), np.abs(self.slopes(z)) @ np.maximum(1.0, np.abs(z))
        return bool(np.isfinite(residual).all() and (np.abs(residual) <= BALANCED * terms).all())

    def lowest(self, z: np.ndarray) -> float:
        """Lowest eigenvalue of the stiffness along what the constraints leave free, in units of the highest magnitude.

        The stiffness is symmetric where forces have a potential.
        """
        q, layout = z[: self.n_q], self.module.layout
        along = self.slopes(z)[: self.module.n_v, : self.n_q] @ layout.scales.rates(q, np.eye(self.module.n_v))
        rows = self.module.constraint_jacobian(q)
        free = np.linalg.svd(rows)[2][len(rows) :].T if len(rows) else np.eye(self.module.n_v)
        values = np.linalg.eigvalsh(0.5 * free.T @ (along + along.T) @ free)
        return float(values[0] / np.abs(values).max()) if values.size else 1.0

    def solve(self, z: np.ndarray, method: str) -> np.ndarray:
        """By plain Newton with whole steps, or by ``scipy.optimize.root`` with its own scaling."""
        if method != "newton":
            most = {"maxiter" if method == "lm" else "maxfev": 2000}
            return scipy.optimize.root(self, z, jac=self.slopes, method=method, tol=1e-12, options=most).x
        for _ in range(100):
            step = np.linalg.solve(self.slopes(z), -self(z))
            z = z + step
            if not np.isfinite(z).all() or np.abs(step).max() <= 1e-12 * max(1.0, np.abs(z).max()):
                break
        return z


class Case(NamedTuple):
    """One random mechanism: who found an equilibrium from the same start."""

    peers: list[bool]
    ours: bool
    seconds: float
    agrees: bool  #: the verdict of stability with the sign of the stiffness, where differences tell it


def judge(family: str, number: int) -> Case:
    """One random mechanism of a family."""
    module = FAMILIES[family](np.random.default_rng([number, len(family)])).compile(target="numpy")
    balance, q, peers = Balance(module), module.assemble(), []
    with np.errstate(all="ignore"):
        for method in PEERS:
            try:
                peers.append(balance.holds(balance.solve(balance.start(q), method)))
            except (np.linalg.LinAlgError, eg.EomgenError, ValueError):
                peers.append(False)
    begin, agrees, ours = process_time(), True, False
    try:
        found = module.equilibrium(q)
        z = balance.start(found.q)
        ours, lowest = balance.holds(z) and found.linear.is_equilibrium, balance.lowest(z)
        agrees = abs(lowest) < TELLS or (lowest < 0.0) == (found.stability == "unstable")
    except eg.EquilibriumError:
        pass
    return Case(peers, ours, process_time() - begin, agrees)


@benchmark("equilibria", "random stiff and soft equilibria, by us, by plain Newton and by SciPy's hybr and lm")
def equilibria(report: Report, quick: bool) -> None:
    """Every family, each from one start."""
    judged = {family: [judge(family, k) for k in range(4 if quick else 30)] for family in FAMILIES}
    rows: list[list[Any]] = []
    for family, own in judged.items():
        lost, times = sum(not case.ours and any(case.peers) for case in own), [1e3 * case.seconds for case in own]
        rows.append([family, len(own), *map(sum, zip(*(case.peers for case in own), strict=True)),
                     sum(case.ours for case in own), lost, np.median(times), max(times)])  # fmt: skip
    report.table("equilibria", ("family", "cases", *PEERS, "ours", "lost", "median ms", "longest ms"), rows)
    total, *peers, ours = (sum(row[k] for row in rows) for k in range(1, 6))
    report.result(f"equilibria of {total} mechanisms that are solved", ours, dict(zip(PEERS, peers, strict=True)))
    report.most("lost", sum(row[6] for row in rows), 0)
    wrong = sum(not case.agrees for own in judged.values() for case in own)
    report.most("stability that the stiffness contradicts", wrong, 0)
    report.note(
        "Newton with whole steps, SciPy's hybr and lm solve the bare equations of balance from the same start.",
        f"Found is what leaves {BALANCED:g} of the terms of each equation. Lost: found by one of them and not by us.",
    )
