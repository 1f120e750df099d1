"""Whole integrations, ours and peers', of a double pendulum and a chain of 5 links, 10 s."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.integrate import odeint, solve_ivp
from scipy.integrate._ivp import dop853_coefficients as dop

from eomgen.pipeline import build
from eomgen.toolchain.compiler import find_compiler

from . import taylor
from .measure import Sample, interleaved, seconds_of
from .models import chain
from .report import Limit, Report, Table

TITLE = "integration"
END, RTOL, ATOL = 10.0, 1e-10, 1e-12
LOOP = Path(__file__).parent / "dop853_loop.c"
#: Error at the end of the run -> how much longer than heyoka ours may take for it.
GOALS: dict[int, dict[float, float]] = {2: {1e-6: 1.0, 1e-9: 1.0, 1e-12: 1.5}, 5: {1e-5: 1.0, 1e-6: 1.0}}
#: Tolerances that are tried, of ours and of heyoka, which compiles for each.
TOLERANCES = {2: [10.0 ** (-k / 4) for k in range(18, 56)], 5: [10.0 ** (-k / 4) for k in range(32, 58)]}
#: Starts over which errors and times are averaged: a single one may be lucky at a tolerance.
STARTS = 8
#: Decades on both sides of an error over which the time as a function of the error is taken for a line.
DECADES = 1.5
#: Runs of which a turn takes the best: the first finds the caches full of what the others have left there.
IN_A_ROW = 3
State = Callable[[], np.ndarray]


def start(n: int) -> np.ndarray:
    """Where the chain is let go."""
    return np.concatenate([[1.0], np.full(n - 1, 0.3), np.zeros(n)])


class HandWritten:
    """The plain loop of dop853_loop.c over a module's right-hand side, compiled for this processor."""

    def __init__(self, module: Any, x0: np.ndarray, folder: str) -> None:
        def listed(values: Any) -> str:
            return "{" + ", ".join(f"{x:.17g}" for x in values) + "}"

        rows = ", ".join(listed(row[:12]) for row in dop.A[:12])
        text = f"enum {{ N = {module.n_x} }};\nstatic const double A_[12][12] = {{{rows}}}, B_[12] = {listed(dop.B)},\n"
        text += f"    C_[12] = {listed(dop.C[:12])}, E3_[13] = {listed(dop.E3)}, E5_[13] = {listed(dop.E5)};\n"
        source, library = Path(folder) / f"loop{module.n_x}.c", Path(folder) / f"loop{module.n_x}.so"
        source.write_text(text + LOOP.read_text(encoding="utf-8"), encoding="utf-8")
        flags = ["-O3", "-march=native", "-shared", "-fPIC"]
        subprocess.run([*find_compiler(None).command, *flags, str(source), "-o", str(library), "-lm"], check=True)
        self.loop = ctypes.CDLL(str(library))
        real, pointer = ctypes.c_double, ctypes.c_void_p
        self.loop.integrate.restype = ctypes.c_long
        self.loop.integrate.argtypes = [pointer, pointer, pointer, pointer, real, real, pointer, real, real]
        self.loop.soda_prepare.argtypes = [pointer] * 4
        context, work = module.kernels.context, np.empty(module.core.sizes["n_work"] + 1)
        self.held = context, work
        arrays = (a.ctypes.data for a in (context.u, context.c, work))
        self.given, self.x0 = (module.core.address("rhs"), *arrays), x0

    def __call__(self) -> np.ndarray:
        """The state at the end."""
        y = self.x0.copy()
        self.loop.integrate(*self.given, 0.0, END, y.ctypes.data, RTOL, ATOL)
        return y

    def numbalsoda(self) -> State | None:
        """numbalsoda's DOP853 over the same function, if it is installed."""
        try:
            from numbalsoda import dop853
        except ImportError:
            return None
        self.loop.soda_prepare(*self.given)
        address = ctypes.cast(self.loop.soda_rhs, ctypes.c_void_p).value
        times, data = np.array([0.0, END]), np.zeros(1)
        return lambda: np.asarray(dop853(address, self.x0, times, data=data, rtol=RTOL, atol=ATOL, mxstep=10**7)[0][-1])


def drivers(module: Any, x0: np.ndarray, hand: HandWritten) -> dict[str, State]:
    """Label -> one whole integration at RTOL and ATOL."""
    rhs, tight = module.rhs, {"rtol": RTOL, "atol": ATOL}
    times = np.linspace(0.0, END, 1001)

    def plain(method: Any, t_eval: Any = None) -> np.ndarray:
        return np.asarray(solve_ivp(rhs, (0.0, END), x0, method=method, t_eval=t_eval, **tight).y[:, -1])

    go = module.integrator(**tight)
    found: dict[str, State] = {
        "hand-written C loop": hand,
        "integrator": lambda: np.asarray(go(0.0, x0, END)),
        "simulate": lambda: module.simulate((0.0, END), x0, **tight).x[:, -1],
        "simulate, one step": lambda: module.simulate((0.0, 1e-4), x0, first_step=1e-4, **tight).x[:, -1],
        "simulate, 1,001 points": lambda: module.simulate((0.0, END), x0, t_eval=times, **tight).x[:, -1],
        "solve_ivp, our DOP853": partial(plain, module.DOP853),
        "solve_ivp, our DOP853, 1,001 points": partial(plain, module.DOP853, times),
        "solve_ivp, SciPy's DOP853": partial(plain, "DOP853"),
        "odeint": lambda: np.asarray(odeint(rhs, x0, [0.0, END], rtol=RTOL, atol=ATOL, mxstep=10**6, tfirst=True)[-1]),
    }
    soda = hand.numbalsoda()
    return found if soda is None else found | {"numbalsoda DOP853": soda}


def best_of(action: Callable[[], Any], repeats: int) -> float:
    """The shortest of several runs (s)."""
    return min(seconds_of(action) for _ in range(repeats))


def starts(n: int) -> list[np.ndarray]:
    """Where the chain is let go in a race: as above, and near it."""
    around = np.random.default_rng(1)
    return [start(n), *(start(n) * around.uniform(0.6, 1.2, 2 * n) for _ in range(STARTS - 1))]


def race(
    module: Any, equations: list[tuple[Any, Any]], goals: dict[float, float], repeats: int
) -> tuple[list[list[Any]], list[Limit]]:
    """The time each takes to an error, on the line of times over errors; the better of ours counts."""
    n = len(equations) // 2
    given = [(x0, taylor.reference(equations, x0, END)) for x0 in starts(n)]
    begun = perf_counter()
    theirs = {tolerance: taylor.Taylor(equations, tolerance) for tolerance in TOLERANCES[n]}
    compile_seconds = (perf_counter() - begun) / len(theirs)

    def held(method: str, tolerance: float) -> Callable[[np.ndarray], np.ndarray]:
        go = module.integrator(method=method, rtol=max(tolerance, 3e-14), atol=tolerance / 100)
        return lambda x0: go(0.0, x0, END)

    def simulate(tolerance: float) -> Callable[[np.ndarray], np.ndarray]:
        options = {"rtol": max(tolerance, 3e-14), "atol": tolerance / 100, "method": "Taylor", "t_eval": [END]}
        return lambda x0: np.asarray(module.simulate((0.0, END), x0, **options).x[:, -1])

    runs = {
        **{("DOP853", tolerance): held("DOP853", tolerance) for tolerance in TOLERANCES[n]},
        **{("Taylor", tolerance): held("Taylor", tolerance) for tolerance in TOLERANCES[n]},
        **{("heyoka", tolerance): partial(theirs[tolerance], end=END) for tolerance in TOLERANCES[n]},
        **{("simulate", tolerance): simulate(tolerance) for tolerance in TOLERANCES[n]},
    }
    errors = {
        key: np.mean([np.log10(np.abs(run(x0) - exact).max()) for x0, exact in given]) for key, run in runs.items()
    }
    times = {key: np.full(len(given), np.inf) for key in runs}
    for _ in range(repeats):  # in turns, so that all meet the same disturbances
        for key, run in runs.items():
            for k, (x0, _) in enumerate(given):
                times[key][k] = min(times[key][k], best_of(partial(run, x0), IN_A_ROW))
    rows: list[list[Any]] = []
    limits: list[Limit] = []
    for goal, bound in goals.items():
        seconds: dict[str, float] = {}
        for name in ("DOP853", "Taylor", "heyoka", "simulate"):
            near = [key for key in runs if key[0] == name and abs(errors[key] - np.log10(goal)) <= DECADES]
            line = np.polyfit([errors[key] for key in near], [np.log(times[key]).mean() for key in near], 1)
            seconds[name] = float(np.exp(np.polyval(line, np.log10(goal))))
        ratios = {name: seconds[name] / seconds["heyoka"] for name in ("DOP853", "Taylor")}
        rows.append(
            [f"{n} links, error {goal:g}", *(1e3 * s for s in seconds.values()), *ratios.values(), compile_seconds]
        )
        limits.append(Limit(f"{n} links, error {goal:g}: our best over heyoka", min(ratios.values()), bound))
    return rows, limits


def run(quick: bool) -> Report:
    """Both chains by every driver, then against heyoka at equal error."""
    tables: list[list[Any]] = []
    races: list[list[Any]] = []
    limits: list[Limit] = []
    details: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for n in (2, 5):
            derived = chain(n).derive()
            module, x0 = derived.compile(), start(n)
            hand = HandWritten(module, x0, folder)
            actions = drivers(module, x0, hand)
            finals = {name: action() for name, action in actions.items()}
            samples = interleaved(
                2 if quick else 15, **{name: partial(best_of, action, IN_A_ROW) for name, action in actions.items()}
            )
            steps = len(module.simulate((0.0, END), x0, rtol=RTOL, atol=ATOL).t) - 1
            base = samples["hand-written C loop"].best
            for name, sample in samples.items():
                over = (sample.best - base) / steps * 1e6
                difference = float(np.abs(finals[name] - finals["hand-written C loop"]).max())
                ends = name != "simulate, one step"
                row = [
                    f"{n} links, {name}",
                    sample.median * 1e3,
                    sample.best * 1e3,
                    sample.best / base,
                    over if ends else None,
                    difference if ends else None,
                ]
                tables.append(row)
            details[f"{n} links"] = {name: sample.as_dict() for name, sample in samples.items()} | {"steps": steps}
            limits += judge(n, samples, steps)
            if taylor.available():
                program = build(derived)
                values = dict(zip(module.p_names, module.p.tolist(), strict=True))
                rows, more = race(module, taylor.system(program, values), GOALS[n], 1 if quick else 8)
                races += rows
                limits += more
    columns = ("driver", "median ms", "best ms", "over hand-written", "us a step above it", "difference at the end")
    both = [Table(f"10 s at rtol {RTOL:g}, atol {ATOL:g}", columns, tables)]
    if races:
        columns = (
            "at equal error",
            *("DOP853 ms", "Taylor ms", "heyoka ms", "Taylor by simulate ms"),
            *("DOP853 over heyoka", "Taylor over heyoka", "heyoka compiles s"),
        )
        both.append(Table("heyoka's Taylor method over the same right-hand side", columns, races))
    notes = (
        "The hand-written loop calls the same compiled right-hand side and stores one state; ratios are of best times.",
        "simulate stores every step, projects the states and makes a trajectory; one step shows the least that costs.",
        f"Each turn takes the best of {IN_A_ROW} runs in a row: the first of them finds cold caches.",
        "At equal error ours are integrators held ready, as heyoka's is; simulate starts from nothing.",
        f"Errors and times at equal error: means of logarithms over {STARTS} starts, one may be lucky at a tolerance;",
        f"times on the line through those of the tolerances, four a decade, whose error is within {DECADES} decades.",
        "heyoka is given our right-hand side as it is, its parameters as numbers; ours are variable.",
        "The reference is heyoka's in long doubles.",
    )
    return Report(tuple(both), tuple(limits), notes, details)


def judge(n: int, samples: dict[str, Sample], steps: int) -> list[Limit]:
    """What was promised of one chain."""
    best = {name: sample.best for name, sample in samples.items()}
    base, name = best["hand-written C loop"], "solve_ivp, our DOP853"
    over = {key: (best[key] - base) / steps * 1e6 for key in (name, f"{name}, 1,001 points")}
    soda = "numbalsoda DOP853"
    beside = [who for who in ("simulate", "integrator") if soda in best]
    return [
        Limit(f"{n} links: simulate over a hand-written C loop", best["simulate"] / base, 1.15),
        *(Limit(f"{n} links: {who} over {soda}", best[who] / best[soda], 1.0) for who in beside),
        Limit(f"{n} links: {name}, above the loop", over[name], 4.0, "us a step"),
        Limit(f"{n} links: {name}, 1,001 points, above the loop", over[f"{name}, 1,001 points"], 10.0, "us a step"),
        Limit(
            f"{n} links: SciPy's DOP853 over ours", best["solve_ivp, SciPy's DOP853"] / best[name], 12.0, at_least=True
        ),
    ]
