"""The wheel without a rim beside McGeer's closed forms, and the wheelset beside the matrices of its textbook."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_a_wheel_without_a_rim_walks_at_the_published_speed() -> None:
    mod = eg.load(EXAMPLES / "rimless_wheel.yaml").compile()
    p = dict(zip(mod.p_names, mod.p, strict=True))
    run = mod.simulate(25.0)
    times = np.sort(np.concatenate([run.t_events[f"step{k}_closes"] for k in range(6)]))
    ends = [np.flatnonzero(np.abs(run.t - time) < 1e-9)[[0, -1]] for time in times]
    before, after = (np.array([run["speed"][pair[k]] for pair in ends]) for k in (0, 1))
    a, turning = np.pi / 6, p["I"] + p["m"] * p["l"] ** 2
    eta = (p["I"] + p["m"] * p["l"] ** 2 * np.cos(2 * a)) / turning
    assert len(times) > 15
    assert after / before == pytest.approx(eta, rel=1e-7)
    gained = 2 * p["m"] * p["g"] * p["l"] * (np.cos(p["slope"] - a) - np.cos(p["slope"] + a)) / turning
    assert after[-1] == pytest.approx(np.sqrt(eta**2 * gained / (1 - eta**2)), rel=1e-6)


def critical(p: dict[str, float]) -> float:
    """The speed at which M z'' + D/V z' + K z = 0 of the lateral place and the yaw loses its stability."""

    def growth(V: float) -> float:
        M = np.diag([p["m"], p["I"]])
        D = np.diag([2 * p["f22"], 2 * p["f11"] * p["b"] ** 2]) / V
        K = np.array([[p["k_y"], -2 * p["f22"]], [2 * p["f11"] * p["b"] * p["cone"] / p["r"], p["k_psi"]]])
        zero, one = np.zeros((2, 2)), np.eye(2)
        A = np.block([[zero, one], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
        return float(np.linalg.eigvals(A).real.max())

    return float(brentq(growth, 10.0, 200.0))


def test_a_wheelset_hunts_above_its_critical_speed() -> None:
    mod = eg.load(EXAMPLES / "wheelset.yaml").compile()
    p = dict(zip(mod.p_names, mod.p, strict=True))
    limit = critical(p)

    def swing(V: float, start: float) -> tuple[float, float]:
        run = mod.simulate(
            8.0, {"y": start, "phi_dot": V / p["r"]}, parameters={"V": V}, t_eval=np.linspace(0, 8, 4001)
        )
        early, late = run.t < 2.0, run.t > 6.0
        return float(np.ptp(run["y"][early])), float(np.ptp(run["y"][late]))

    early, late = swing(0.93 * limit, 1e-4)
    assert late < 0.5 * early
    early, late = swing(1.07 * limit, 1e-4)
    assert late > 2.0 * early
    early, late = swing(1.07 * limit, 0.02)  # it stays on the rails by the limit of friction
    assert late < 0.2
    loads = mod.outputs(0.0, mod.x0())
    assert loads[mod.y_names.index("wheel_load")] == pytest.approx((p["m"] * p["g"] + p["load"]) / 2, rel=1e-12)
