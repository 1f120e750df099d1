"""A thousand double pendulums: simulate_many beside heyoka's batches, a loop over solve_ivp and hand-written lanes."""

from __future__ import annotations

import ctypes
import subprocess
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


def heyoka_batches(x: np.ndarray, threads: int) -> Callable[[], np.ndarray]:
    """heyoka's batch integrators, one in each thread; the time it takes to compile them does not count."""
    import heyoka as hk

    a, b, w1, w2 = hk.make_vars("a", "b", "w1", "w2")
    m1, m2, l1, l2, g = PARAMETERS
    m = m1 + m2
    s, c = hk.sin(a - b), hk.cos(a - b)
    b1, b2 = -m2 * l2 * w2 * w2 * s - m * g * hk.sin(a), l1 * w1 * w1 * s - g * hk.sin(b)
    a1 = (b1 - m2 * c * b2) / (l1 * (m - m2 * c * c))
    system = [(a, w1), (b, w2), (w1, a1), (w2, (b2 - l1 * c * a1) / l2)]
    size = hk.recommended_simd_size()
    first = np.ascontiguousarray(x[:size].T)
    integrators = [hk.taylor_adaptive_batch(system, first, tol=RTOL) for _ in range(threads)]

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


def run(quick: bool) -> Report:
    """Time everything in turns; the best of each counts."""
    from scipy.integrate import solve_ivp

    import eomgen as eg

    count = 80 if quick else COUNT
    x = starts(count)
    module = eg.load(EXAMPLES / "double_pendulum.yaml").compile()
    ours = np.array([x[:, 0], x[:, 1] - x[:, 0], x[:, 2], x[:, 3] - x[:, 2]])
    tolerances = {"rtol": RTOL, "atol": ATOL}
    results: dict[str, np.ndarray] = {}

    def simulate_many(threads: int) -> None:
        last = module.simulate_many(END, ours, threads=threads, **tolerances).x
        results["eomgen"] = np.array([last[0], last[0] + last[1], last[2], last[2] + last[3]]).T

    def loop() -> None:
        for k in range(0, count, 50):
            solve_ivp(module.rhs, (0, END), ours[:, k], method="DOP853", **tolerances)

    with TemporaryDirectory() as folder:
        library = limit_library(Path(folder))
        actions: dict[str, Callable[[], Any]] = {
            f"eomgen, {THREADS} threads": lambda: simulate_many(THREADS),
            "eomgen, 1 thread": lambda: simulate_many(1),
            f"4 lanes by hand, {THREADS} threads": lambda: results.update(hand=by_hand(library, x, THREADS)),
            "4 lanes by hand, 1 thread": lambda: by_hand(library, x, 1),
            "solve_ivp, every 50th": loop,
        }
        try:
            batches = heyoka_batches(x, THREADS)
            actions[f"heyoka, batches, {THREADS} threads"] = lambda: results.update(heyoka=batches())
        except ImportError:
            print("heyoka is not installed: pip install heyoka")
        for action in actions.values():
            action()
        samples = interleaved(1 if quick else 15, **{k: lambda a=a: seconds_of(a) for k, a in actions.items()})
    rate = {name: count / sample.best / (50 if "50th" in name else 1) for name, sample in samples.items()}
    middle = {name: count / sample.median / (50 if "50th" in name else 1) for name, sample in samples.items()}
    exact = module.simulate_many(END, ours, rtol=1e-13, atol=1e-14).x
    exact = np.array([exact[0], exact[0] + exact[1], exact[2], exact[2] + exact[3]]).T
    errors = {name: float(np.median(np.abs(rows - exact).max(axis=1))) for name, rows in results.items()}
    mine = rate[f"eomgen, {THREADS} threads"]
    rows = [[name, middle[name], rate[name], mine / rate[name]] for name in actions]
    hand = rate[f"4 lanes by hand, {THREADS} threads"]
    limits = [
        Limit("over a loop of solve_ivp", mine / rate["solve_ivp, every 50th"], 600.0, at_least=True),
        Limit("over 4 lanes by hand", mine / hand, 0.85, at_least=True),
    ]
    if "heyoka" in results:
        limits.append(
            Limit("over heyoka's batches", mine / rate[f"heyoka, batches, {THREADS} threads"], 1.8, at_least=True)
        )
    return Report(
        tables=(
            Table("runs a second", ("who", "median", "best", "eomgen's best over it"), rows),
            Table("error at the end", ("who", "median of the largest"), [[k, v] for k, v in errors.items()]),
        ),
        limits=tuple(limits) if not quick else (),
        notes=(
            f"{count} double pendulums, {END:g} s, rtol {RTOL:g}, atol {ATOL:g}; each run of eomgen has its own steps.",
            "By hand: DOP853 for this pendulum alone, 4 runs with one step size, -O3 -march=native -ffast-math.",
            f"eomgen runs {module.core.lane_width} side by side; heyoka's Taylor method errs less at its tolerance.",
        ),
        details={"samples": {name: sample.as_dict() for name, sample in samples.items()}, "errors": errors},
    )
