"""Gears, the shaper and two linkages of the gallery beside closed forms and circles cut by hand."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


@cache
def compiled(name: str) -> tuple[Any, dict[str, float]]:
    mod = eg.load(EXAMPLES / f"{name}.yaml").compile(target="numpy")
    return mod, dict(zip(mod.p_names, mod.p.tolist(), strict=True))


def meet(a: np.ndarray, ra: float, b: np.ndarray, rb: float, side: float) -> np.ndarray:
    """The point at distances ra of a and rb of b, to the left (1) or right (-1) of the way from a to b."""
    way = b - a
    length = np.hypot(*way)
    along = (ra**2 - rb**2 + length**2) / (2 * length)
    u = way / length
    return a + along * u + side * np.sqrt(ra**2 - along**2) * np.array([-u[1], u[0]])


def test_a_gear_train_starts_as_a_first_order_lag() -> None:
    """J w' = tau_0 (1 - w/w_0) - m g r / 12, all inertias and the load reduced to the motor by the ratios 3 and 4."""
    mod, p = compiled("gear_train")
    ratio = 60 / 20 * 72 / 18
    inertia = p["J_1"] + p["J_2"] / 9 + (p["J_3"] + p["m"] * p["r"] ** 2) / ratio**2
    last = p["omega_0"] * (1 - p["m"] * p["g"] * p["r"] / ratio / p["tau_0"])
    lag = inertia * p["omega_0"] / p["tau_0"]
    traj = mod.simulate(0.5)
    assert traj["motor_angle_dot"] == pytest.approx(last * (1 - np.exp(-traj.t / lag)), rel=1e-8, abs=1e-9)
    assert traj["height"] == pytest.approx(p["r"] / ratio * traj["motor_angle"], rel=1e-12, abs=1e-14)


def test_the_ram_of_a_shaper_is_where_lever_and_link_hold_it() -> None:
    mod, p = compiled("shaper")
    traj = mod.simulate(1.5)
    pin = p["r"] * np.array([np.cos(traj["theta"]), np.sin(traj["theta"])]) + [[0.0], [p["d"]]]
    end = p["L"] * pin / np.hypot(*pin)
    assert traj["s"] == pytest.approx(end[0] + np.sqrt(p["l"] ** 2 - (p["h"] - end[1]) ** 2), abs=1e-9)


def test_a_shaper_returns_quickly() -> None:
    """Norton, Design of Machinery: it turns back where the crank is across the lever, after pi + 2 asin(r/d)."""
    mod, p = compiled("shaper")
    phi = np.arcsin(p["r"] / p["d"])
    q = mod.x0(theta=0.0)[: mod.n_q]
    s, ends = mod.q_names.index("s"), []
    for theta in np.linspace(0.0, -2 * np.pi, 41):
        q, v, _ = mod.kinematics([theta], [-1.0], [0.0], q)
        if abs(np.sin(theta) + np.sin(phi)) > 0.02:
            assert (v[s] > 0) == (np.sin(theta) > -np.sin(phi)), theta
    for theta in (-phi, np.pi + phi):
        q, v, _ = mod.kinematics([theta - 2 * np.pi], [-1.0], [0.0], q)
        assert abs(v[s]) < 1e-12
        ends.append(q[s])
    assert abs(ends[0] - ends[1]) == pytest.approx(2 * p["L"] * p["r"] / p["d"], rel=1e-12)


def test_watts_six_bar_is_where_its_circles_meet() -> None:
    mod, p = compiled("watt_six_bar")
    traj = mod.simulate(0.6, t_eval=np.linspace(0.0, 0.6, 31))
    assert np.ptp(traj["theta"]) > 2 * np.pi
    C, F = np.array([0.1, 0.0]), np.array([0.24, 0.0])
    for theta, psi, phi in zip(traj["theta"], traj["psi"], traj["phi"], strict=True):
        A = p["a"] * np.array([np.cos(theta), np.sin(theta)])
        B = meet(A, p["b"], C, p["c"], 1.0)
        arm = np.arctan2(*(B - C)[::-1])
        D = C + p["c"] * np.array([np.cos(arm - p["delta"]), np.sin(arm - p["delta"])])
        E = meet(D, p["d"], F, p["e"], 1.0)
        assert psi == pytest.approx(arm, abs=1e-9)
        assert phi == pytest.approx(np.arctan2(*(E - F)[::-1]), abs=1e-9)


def test_chebyshevs_coupler_is_where_the_table_says() -> None:
    """tests/reference/linkages_straight_line.json, whose crank is 5 where that of the example is 2.5 m."""
    mod, _ = compiled("chebyshev")
    rows = models.reference("linkages_straight_line")["chebyshev"]["rows"]
    q, seen = mod.x0()[: mod.n_q], 0
    for theta, point in sorted((float(key), np.array(row, dtype=float)) for key, row in rows.items()):
        if not 0.7 <= theta <= 1.3:
            continue
        time = np.arccos((1 - theta) / 0.3) / np.pi
        x = mod.simulate(2.0, t_eval=[0.0, time]).x[:, -1]
        q = x[: mod.n_q]
        outputs = dict(zip(mod.y_names, mod.outputs(time, x), strict=True))
        assert q[mod.q_names.index("theta")] == pytest.approx(theta, abs=1e-12)
        assert [outputs["P_x"], outputs["P_y"]] == pytest.approx(0.5 * point, abs=1e-12)
        seen += 1
    assert seen == 5
