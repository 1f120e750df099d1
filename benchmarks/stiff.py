"""Stiff problems: the compiled Radau beside SciPy's Radau with the same Jacobian and odeint, at equal error."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any

import numpy as np
from scipy.integrate import odeint, solve_ivp

import eomgen as eg

from .measure import Sample, interleaved
from .models import EXAMPLES, chain_with_joints
from .report import Limit, Report, Table

TITLE = "stiff problems"
END = 10.0
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
PEER = 1e-8  #: rtol of the peers; atol is a hundredth of rtol everywhere


def run(quick: bool) -> Report:
    """Each problem for 10 s by every solver, in turns."""
    problems = {"stiff chain of 5": chain_with_joints(5), "flyball governor": _governor()}
    rows: list[list[Any]] = []
    limits: list[Limit] = []
    details: dict[str, Any] = {}
    for name, (model, x0) in problems.items():
        module = model.compile(kernels=None)
        x0 = module.x0() if x0 is None else x0
        exact = module.simulate(END, x0, method="Radau", rtol=1e-12, atol=1e-14, t_eval=[END]).x[:, -1]
        solvers = _solvers(module, x0)
        errors = {label: float(np.abs(solve() - exact).max()) for label, solve in solvers.items()}
        actions = {
            label: (lambda solve=solve: cpu_seconds(solve)) for label, solve in solvers.items() if label != "scipy"
        }
        samples = interleaved(1 if quick else 15, **actions)
        samples |= interleaved(1 if quick else 3, scipy=lambda solve=solvers["scipy"]: cpu_seconds(solve))
        equal = next(label for label in solvers if label.startswith("ours") and errors[label] <= errors["odeint"])
        rows += [
            [f"{name}, {LABELS.get(label, label)}", 1e3 * s.best, 1e3 * s.median, f"{errors[label]:.1e}"]
            for label, s in samples.items()
        ]
        same = samples[f"ours, rtol {PEER:g}"]
        limits += _limits(name, samples[equal], samples["odeint"], same, samples["scipy"])
        details[name] = {label: {**s.as_dict(), "error": errors[label]} for label, s in samples.items()}
    notes = (
        "Processor time; errors after 10 s. odeint is LSODA on our right-hand side, called through Python.",
        "LSODA called from C took 2.0 ms for the chain at an error of 1e-7 (numbalsoda, same kind of machine).",
        "SciPy's Radau gets our Jacobian and takes the same steps as ours.",
    )
    columns = ("10 s of", "best ms", "median ms", "error")
    return Report((Table("stiff", columns, rows),), tuple(limits), notes, details)


LABELS = {"odeint": "odeint, rtol 1e-08", "scipy": "solve_ivp Radau, rtol 1e-08"}


def cpu_seconds(action: Callable[[], object]) -> float:
    """Processor time of one call: some take half a second, in which others get their turns."""
    start = process_time()
    action()
    return process_time() - start


def _governor() -> tuple[Any, Any]:
    return eg.load(EXAMPLES / "flyball_governor.yaml"), None


def _solvers(module: Any, x0: np.ndarray) -> dict[str, Callable[[], np.ndarray]]:
    """By label what integrates and gives the last state, loosest tolerance of ours first."""

    def ours(rtol: float) -> np.ndarray:
        run = module.simulate(END, x0, method="Radau", rtol=rtol, atol=rtol / 100, t_eval=[END])
        return np.asarray(run.x[:, -1])

    def by_odeint() -> np.ndarray:
        options = {"rtol": PEER, "atol": PEER / 100, "mxstep": 10**7, "tfirst": True}
        return np.asarray(odeint(module.rhs, x0, [0.0, END], **options)[-1])

    def by_scipy() -> np.ndarray:
        options = {"rtol": PEER, "atol": PEER / 100, "jac": module.jacobian}
        return np.asarray(solve_ivp(module.rhs, (0.0, END), x0, method="Radau", **options).y[:, -1])

    solvers: dict[str, Callable[[], np.ndarray]] = {
        f"ours, rtol {rtol:g}": (lambda rtol=rtol: ours(rtol)) for rtol in TOLERANCES
    }
    return {**solvers, "odeint": by_odeint, "scipy": by_scipy}


def _limits(name: str, equal: Sample, peer: Sample, same: Sample, scipy: Sample) -> list[Limit]:
    return [
        Limit(f"{name}: SciPy's Radau with our Jacobian over ours", scipy.best / same.best, 20.0, at_least=True),
        Limit(f"{name}: ours over odeint at no larger error", equal.best / peer.best, 1.0),
    ]
