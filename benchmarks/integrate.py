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

from eomgen.compilation.compiler import find_compiler
from eomgen.pipeline import build

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
TOLERANCES = {2: [10.0 ** (-k / 4) for k in range(16, 62)], 5: [10.0 ** (-k / 2) for k in range(16, 31)]}
#: Tolerances that reach an error, of which the quickest counts: a looser one may take steps of lower order.
TRIED = 6
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

    found: dict[str, State] = {
        "hand-written C loop": hand,
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


def race(
    module: Any, equations: list[tuple[Any, Any]], x0: np.ndarray, goals: dict[float, float], repeats: int
) -> tuple[list[list[Any]], list[Limit]]:
    """At each error the shortest time of each that reaches it, of its loosest tolerances; the better of ours counts."""
    exact, n = taylor.reference(equations, x0, END), len(x0) // 2
    grid = TOLERANCES[n]

    def options(tolerance: float) -> dict[str, float]:
        return {"rtol": max(tolerance, 3e-14), "atol": tolerance / 100}

    def simulate(tolerance: float) -> np.ndarray:
        run = module.simulate((0.0, END), x0, t_eval=[END], method="Taylor", **options(tolerance))
        return np.asarray(run.x[:, -1])

    begun = perf_counter()
    theirs = {tolerance: taylor.Taylor(equations, x0, tolerance) for tolerance in grid}
    compile_seconds = (perf_counter() - begun) / len(theirs)
    ours = {
        name: {tolerance: module.integrator(method=name, **options(tolerance)) for tolerance in grid}
        for name in ("DOP853", "Taylor")
    }
    runs: dict[str, Callable[[float], np.ndarray]] = {
        "DOP853": lambda tolerance: ours["DOP853"][tolerance](0.0, x0, END),
        "Taylor": lambda tolerance: ours["Taylor"][tolerance](0.0, x0, END),
        "heyoka": lambda tolerance: theirs[tolerance](END),
        "simulate": simulate,
    }
    errors = {name: [float(np.abs(run(tol) - exact).max()) for tol in grid] for name, run in runs.items()}
    rows: list[list[Any]] = []
    limits: list[Limit] = []
    for goal, bound in goals.items():
        reaching = {name: [k for k, e in enumerate(found) if e <= goal][:TRIED] for name, found in errors.items()}
        tried = [(name, k) for name, found in reaching.items() for k in found]
        times = dict.fromkeys(tried, np.inf)
        for _ in range(3 * repeats):  # in turns, so that all meet the same disturbances
            for name, k in tried:
                times[name, k] = min(times[name, k], best_of(partial(runs[name], grid[k]), 2))
        chosen = {name: min(found, key=lambda k: times[name, k], default=None) for name, found in reaching.items()}
        seconds = {name: times[name, k] for name, k in chosen.items() if k is not None}
        best = min((seconds[name] for name in ("DOP853", "Taylor") if name in seconds), default=None)
        ratio = best / seconds["heyoka"] if best is not None and "heyoka" in seconds else None
        milliseconds = [seconds[name] * 1e3 if name in seconds else None for name in runs]
        three = [name for name in runs if name != "simulate"]
        reached = [min(errors[name]) if (k := chosen[name]) is None else errors[name][k] for name in three]
        rows.append([f"{n} links, error {goal:g}", *milliseconds, ratio, *reached, compile_seconds])
        limits.append(Limit(f"{n} links, error {goal:g}: over heyoka", ratio or np.inf, bound))
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
                rows, more = race(module, taylor.system(program, values), x0, GOALS[n], 2 if quick else 15)
                races += rows
                limits += more
    columns = ("driver", "median ms", "best ms", "over hand-written", "us a step above it", "difference at the end")
    both = [Table(f"10 s at rtol {RTOL:g}, atol {ATOL:g}", columns, tables)]
    if races:
        columns = (
            "at equal error",
            *("DOP853 ms", "Taylor ms", "heyoka ms", "Taylor by simulate ms"),
            "our best over it",
            *("DOP853's error", "Taylor's", "heyoka's"),
            "heyoka compiles s",
        )
        both.append(Table("heyoka's Taylor method over the same right-hand side", columns, races))
    notes = (
        "The hand-written loop calls the same compiled right-hand side and stores one state; ratios are of best times.",
        "simulate stores every step, projects the states and makes a trajectory; one step shows the least that costs.",
        f"Each turn takes the best of {IN_A_ROW} runs in a row: the first of them finds cold caches.",
        "At equal error ours are integrators held ready, as heyoka's is; simulate starts from nothing.",
        f"At equal error each takes the quickest of the {TRIED} loosest tolerances that reach it.",
        "The reference is heyoka's in long doubles.",
    )
    return Report(tuple(both), tuple(limits), notes, details)


def judge(n: int, samples: dict[str, Sample], steps: int) -> list[Limit]:
    """What was promised of one chain."""
    best = {name: sample.best for name, sample in samples.items()}
    base, name = best["hand-written C loop"], "solve_ivp, our DOP853"
    over = {key: (best[key] - base) / steps * 1e6 for key in (name, f"{name}, 1,001 points")}
    return [
        Limit(f"{n} links: simulate over a hand-written C loop", best["simulate"] / base, 1.15),
        Limit(f"{n} links: {name}, above the loop", over[name], 4.0, "us a step"),
        Limit(f"{n} links: {name}, 1,001 points, above the loop", over[f"{name}, 1,001 points"], 10.0, "us a step"),
        Limit(
            f"{n} links: SciPy's DOP853 over ours", best["solve_ivp, SciPy's DOP853"] / best[name], 12.0, at_least=True
        ),
    ]
