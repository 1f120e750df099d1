"""A thousand double pendulums: simulate_many beside heyoka's batches, a loop over solve_ivp and hand-written lanes."""

from __future__ import annotations

import ctypes
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from .measure import interleaved, seconds_of
from .models import EXAMPLES
from .report import Limit, Report, Table

TITLE = "many runs at once"
COUNT, END, RTOL, ATOL = 1000, 10.0, 1e-10, 1e-12
THREADS = 2
PARAMETERS = np.array([1.0, 1.0, 1.0, 1.0, 9.81])  # m1, m2, l1, l2, g of the example


def starts(count: int) -> np.ndarray:
    """Angles from the vertical and their rates, (count, 4)."""
    rows = np.zeros((count, 4))
    rows[:, :2] = np.random.default_rng(3).uniform(-1, 1, (count, 2))
    return rows


def limit_library(folder: Path) -> ctypes.CDLL:
    """The hand-written loop, compiled."""
    from scipy.integrate._ivp import dop853_coefficients as dop

    def table(name: str, values: np.ndarray) -> str:
        if values.ndim == 1:
            return f"static const double {name}[{len(values)}] = {{ {', '.join(map(repr, values.tolist()))} }};\n"
        rows = ", ".join("{ " + ", ".join(map(repr, row)) + " }" for row in values.tolist())
        return f"static const double {name}[{values.shape[0]}][{values.shape[1]}] = {{ {rows} }};\n"

    header = table("A", dop.A[:12, :12]) + table("B", dop.B) + table("E3", dop.E3) + table("E5", dop.E5)
    (folder / "pendulum_lanes_tables.h").write_text(header)
    source = Path(__file__).with_name("pendulum_lanes.c")
    flags = ["-O3", "-march=native", "-ffast-math", "-shared", "-fPIC", f"-I{folder}"]
    subprocess.run(["gcc", *flags, str(source), "-o", str(folder / "limit.so"), "-lm"], check=True)
    library = ctypes.CDLL(str(folder / "limit.so"))
    library.run_many.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p,
                                 ctypes.c_double, ctypes.c_double]  # fmt: skip
    library.run_many.restype = ctypes.c_long
    return library


def by_hand(library: ctypes.CDLL, x: np.ndarray, threads: int) -> np.ndarray:
    """Blocks of trajectories, shared out as threads get to them."""
    rows = x.copy()
    blocks = [(k, min(k + 40, len(x))) for k in range(0, len(x), 40)]

    def work(block: tuple[int, int]) -> None:
        library.run_many(*block, END, rows.ctypes.data, PARAMETERS.ctypes.data, RTOL, ATOL)

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, blocks))
    return rows


def heyoka_batches(x: np.ndarray, threads: int, tol: float = RTOL, size: int = 0) -> Callable[[], np.ndarray]:
    """heyoka's batch integrators, one in each thread; the time it takes to compile them does not count."""
    import heyoka as hk

    a, b, w1, w2 = hk.make_vars("a", "b", "w1", "w2")
    m1, m2, l1, l2, g = PARAMETERS
    m = m1 + m2
    s, c = hk.sin(a - b), hk.cos(a - b)
    b1, b2 = -m2 * l2 * w2 * w2 * s - m * g * hk.sin(a), l1 * w1 * w1 * s - g * hk.sin(b)
    a1 = (b1 - m2 * c * b2) / (l1 * (m - m2 * c * c))
    system = [(a, w1), (b, w2), (w1, a1), (w2, (b2 - l1 * c * a1) / l2)]
    size = size or hk.recommended_simd_size()
    first = np.ascontiguousarray(x[:size].T)
    integrators = [hk.taylor_adaptive_batch(system, first, tol=tol) for _ in range(threads)]

    def run() -> np.ndarray:
        rows = np.empty_like(x)

        def work(k: int) -> None:
            mine = integrators[k]
            for j in range(k * size, len(x), threads * size):
                mine.set_time(0.0)
                mine.state[:] = x[j : j + size].T
                mine.propagate_until(END)
                rows[j : j + size] = mine.state.T

        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, range(threads)))
        return rows

    return run


def largest_error(rows: np.ndarray, exact: np.ndarray) -> float:
    """Median over the runs of the largest error at the end."""
    return float(np.median(np.abs(rows - exact).max(axis=1)))


def heyoka_as_accurate(x: np.ndarray, exact: np.ndarray, wanted: float) -> tuple[float, Callable[[], np.ndarray]]:
    """The loosest tolerance, four to a decade, at which heyoka errs no more than that, and its batches there."""
    for tol in (10.0 ** (-k / 4) for k in range(28, 57)):
        batches = heyoka_batches(x, THREADS, tol)
        if largest_error(batches(), exact) <= wanted:
            break
    return tol, batches


def run(quick: bool) -> Report:
    """Time everything in turns; the best of each counts."""
    from scipy.integrate import solve_ivp

    import eomgen as eg

    count = 80 if quick else COUNT
    x = starts(count)
    module = eg.load(EXAMPLES / "double_pendulum.yaml").compile()
    ours = np.array([x[:, 0], x[:, 1] - x[:, 0], x[:, 2], x[:, 3] - x[:, 2]])
    tolerances = {"rtol": RTOL, "atol": ATOL}

    def simulate_many(threads: int, **options: Any) -> np.ndarray:
        last = module.simulate_many(END, ours, threads=threads, **options).x
        return np.array([last[0], last[0] + last[1], last[2], last[2] + last[3]]).T

    def loop() -> None:
        for k in range(0, count, 50):
            solve_ivp(module.rhs, (0, END), ours[:, k], method="DOP853", **tolerances)

    exact = simulate_many(THREADS, rtol=1e-13, atol=1e-14)
    with TemporaryDirectory() as folder:
        library = limit_library(Path(folder))
        mine, hand = f"eomgen, {THREADS} threads", f"4 lanes by hand, {THREADS} threads"
        series = f"eomgen, Taylor, {THREADS} threads"
        actions: dict[str, Callable[[], Any]] = {
            mine: lambda: simulate_many(THREADS, **tolerances),
            series: lambda: simulate_many(THREADS, method="Taylor", **tolerances),
            hand: lambda: by_hand(library, x, THREADS),
            "eomgen, 1 thread": lambda: simulate_many(1, **tolerances),
            "4 lanes by hand, 1 thread": lambda: by_hand(library, x, 1),
            "solve_ivp, every 50th": loop,
        }
        error = largest_error(actions[mine](), exact)
        heyoka, notes = _add_heyoka(actions, x, exact, error)
        errors = {
            name: largest_error(rows, exact) for name, action in actions.items() if (rows := action()) is not None
        }
        spent = dict.fromkeys(actions, np.inf)

        def timed(name: str) -> float:
            start = time.process_time()
            seconds = seconds_of(actions[name])
            spent[name] = min(spent[name], time.process_time() - start)
            return seconds

        samples = interleaved(1 if quick else 15, **{name: lambda name=name: timed(name) for name in actions})
    part = {name: 50 if "50th" in name else 1 for name in actions}
    best = {name: count / sample.best / part[name] for name, sample in samples.items()}
    middle = {name: count / sample.median / part[name] for name, sample in samples.items()}
    rows = [
        [
            *(name, middle[name], best[name], middle[mine] / middle[name], best[mine] / best[name]),
            *(1e6 * spent[name] * part[name] / count, errors.get(name, "")),
        ]
        for name in actions
    ]
    limits = [
        Limit("over a loop of solve_ivp", best[mine] / best["solve_ivp, every 50th"], 600.0, at_least=True),
        Limit("over 4 lanes by hand", best[mine] / best[hand], 0.85, at_least=True),
        Limit(
            "over 4 lanes by hand, one thread",
            best["eomgen, 1 thread"] / best["4 lanes by hand, 1 thread"],
            0.85,
            at_least=True,
        ),
        *(Limit(f"over {name}", max(best[mine], best[series]) / best[name], 1.8, at_least=True) for name in heyoka),
    ]
    return Report(
        tables=(
            Table(
                "runs a second",
                (
                    *("who", "median", "best", "eomgen's median over it", "its best over it"),
                    *("processor's microseconds a run", "median error"),
                ),
                rows,
            ),
        ),
        limits=tuple(limits) if not quick else (),
        notes=(
            f"{count} double pendulums, {END:g} s, rtol {RTOL:g}, atol {ATOL:g}; each run of eomgen has its own steps.",
            "By hand: DOP853 for this pendulum alone, 4 runs with one step size, -O3 -march=native -ffast-math.",
            "Beside heyoka the better of eomgen's methods counts, DOP853 (the first row) or Taylor.",
            f"eomgen runs {module.core.lane_width} side by side.  Errors are the largest of a run's states at the end.",
            *notes,
        ),
        details={"samples": {name: sample.as_dict() for name, sample in samples.items()}, "errors": errors},
    )


def _add_heyoka(
    actions: dict[str, Callable[[], Any]], x: np.ndarray, exact: np.ndarray, error: float
) -> tuple[list[str], list[str]]:
    """heyoka with the lanes it recommends and with 4 at the same tolerance, and where it errs as much as we do."""
    try:
        import heyoka as hk
    except ImportError:
        return [], ["heyoka is not installed: pip install heyoka"]
    width = hk.recommended_simd_size()
    names = {f"heyoka, batches of {size}, {THREADS} threads": size for size in dict.fromkeys((width, 4))}
    for name, size in names.items():
        actions[name] = heyoka_batches(x, THREADS, RTOL, size)
    tol, batches = heyoka_as_accurate(x, exact, error)
    actions["heyoka, as accurate as eomgen"] = batches
    told = f"heyoka's Taylor method errs less at its tolerance; at {tol:.1e} it errs as much as eomgen at {RTOL:g}."
    return [*names, "heyoka, as accurate as eomgen"], [told]
