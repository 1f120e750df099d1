"""Conservative models keep their energy to 1e-9; with dampers and inputs the power balances.

Judge of the power: wrench times twist in NumPy, with twists from differences of the body poses and wrenches from the
laws of the force elements, never from generalized forces (CONTRACT, "Power balance").
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import judges
import models
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sweeps import part_of

METHODS = ["embedding", "lagrange"]
CONSERVATIVE = {
    "pendulum": {},
    "double_pendulum": {},
    "two_link_manipulator": {},
    "slider_crank": {},
    "four_bar": {},
    "peaucellier": {},
    "chain": {},
    "cart_pendulum": {},
    "spherical_pendulum": {},
    "cam_follower": {},
    "rolling_disc": {},
    "bicycle": {},
    "free_slider_crank": {"theta_dot": 30.0},
    "skewed_four_bar": {},
    "spatial_loop": {"theta_dot": 4.0},
}


@pytest.mark.parametrize(("name", "method"), part_of(product(CONSERVATIVE, METHODS), models.runs_always))
def test_energy_is_kept_over_ten_seconds(module: Callable[..., Any], name: str, method: str) -> None:
    mod = module(name, method)
    run = mod.simulate((0, 10), CONSERVATIVE[name] or None, method="DOP853", rtol=1e-10, atol=1e-12)
    angles = [k for k, kind in enumerate(mod.metadata["coordinate_kinds"]) if kind == "angle"]
    assert np.ptp(run.x[angles], axis=1).max() > 1.0  # it moved: at least one radian
    T, V = mod.energy(run.x)
    energy = T + V
    assert np.abs(energy - energy[0]).max() <= 1e-9 * T.max()
    if mod.n_c:
        assert run.residuals.position < 1e-11


# power balance


def line_power(law: float, a: tuple[np.ndarray, np.ndarray, Any], b: tuple[np.ndarray, np.ndarray, Any]) -> float:
    """Power of a force that pushes two points apart."""
    along = (b[0] - a[0]) / np.linalg.norm(b[0] - a[0])
    return law * float(along @ (b[1] - a[1]))


def line_rate(a: Any, b: Any) -> float:
    return float((b[0] - a[0]) @ (b[1] - a[1]) / np.linalg.norm(b[0] - a[0]))


def slider_crank_power(mod: Any, t: float, x: np.ndarray, u: dict[str, float]) -> float:
    """Of all that is neither gravity nor a spring in powered_slider_crank."""
    B = judges.Bodies(mod, x[: mod.n_q], x[mod.n_q :])
    crank, rod, slider = (mod.body_names.index(name) for name in ("crank", "rod", "slider"))
    spin = {name: B.w[k][2] for name, k in (("crank", crank), ("rod", rod), ("slider", slider))}
    end = B.point(slider, [0, 0, 0])
    anchor = B.point(-1, [0.5, 0.2, 0])
    power = u["tau"] * spin["crank"]
    power += line_power(-2.0 * line_rate(anchor, end), anchor, end)
    power -= 0.01 * (spin["rod"] - spin["crank"]) ** 2
    power -= 0.02 * (spin["slider"] - spin["rod"]) ** 2
    return power + float(np.array([3 * np.sin(5 * t), 1.0, 0.0]) @ end[1])


def arm_power(mod: Any, t: float, x: np.ndarray, u: dict[str, float]) -> float:
    """Of all that is neither gravity nor a spring in powered_arm."""
    B = judges.Bodies(mod, x[: mod.n_q], x[mod.n_q :])
    base, arm, ram, hand = (mod.body_names.index(name) for name in ("base", "arm", "ram", "hand"))
    turn = B.w[base][2]
    hinge = B.R[base] @ models.rotation((0.2, 0.1, 0)) @ [0, -1, 0]
    lift = float(hinge @ (B.w[arm] - B.w[base]))
    slide = B.R[arm][:, 0]  # the axis turns with the arm; the speed along it is that seen from the arm
    seen = B.point(ram, [0, 0, 0])
    there = B.R[arm].T @ (seen[0] - B.r[arm])
    power = u["tau"] * turn + u["F"] * float(slide @ (seen[1] - B.point(arm, there)[1]))
    thrust = B.R[hand] @ models.rotation((0.3, 0, 0.4)) @ [1.0, -0.5, 2 * np.cos(t)]
    power += float(thrust @ B.point(hand, [0.1, 0, 0])[1])
    power += float(B.R[ram] @ [0.1, 0.2, -0.3] @ B.w[ram])
    anchor, tip = B.point(-1, [1, 1, 0]), B.point(hand, [0, 0, 0.1])
    power += line_power(-1.5 * line_rate(anchor, tip), anchor, tip)
    power += line_power(u["P"], B.point(base, [0, 0.2, 0.5]), B.point(hand, [0, 0, 0]))
    return power - 0.3 * lift**2 - 0.2 * turn**2


def squeezer_power(mod: Any, t: float, x: np.ndarray, u: dict[str, float]) -> float:
    """Of the constant torque on Andrews' squeezer."""
    B = judges.Bodies(mod, x[: mod.n_q], x[mod.n_q :])
    return 0.033 * float(B.w[mod.body_names.index("K1")][2])


POWERED = {
    "powered_slider_crank": (slider_crank_power, 1.0),
    "powered_arm": (arm_power, 1.0),
    "andrews_squeezer": (squeezer_power, 0.01),
}


@pytest.mark.parametrize(("name", "method"), part_of(product(POWERED, METHODS), models.runs_always))
def test_energy_changes_by_the_power_at_every_state(module: Callable[..., Any], name: str, method: str) -> None:
    power, _ = POWERED[name]
    mod = module(name, method)
    random = np.random.default_rng(41)
    for x in judges.random_states(mod, 42, 5):
        t, u = float(random.uniform(0, 2)), random.uniform(-3, 3, mod.n_u)
        v, a = np.split(mod.rhs(t, x, u=u), 2)
        still = np.zeros(mod.n_q)
        # each with the step that suits it: velocities enter as squares, so any step is exact
        moving = judges.first(mod.energy, x, np.concatenate([v, still]), size=np.abs(v).max())
        (pushed, _) = judges.first(mod.energy, x, np.concatenate([still, a]), size=np.abs(a).max() / np.abs(v).max())
        expected = power(mod, t, x, dict(zip(mod.u_names, u, strict=True)))
        assert abs(moving.sum() + pushed - expected) <= 1e-10 * max(abs(expected), abs(pushed))


@pytest.mark.parametrize(("name", "method"), part_of(product(POWERED, METHODS), models.runs_always))
def test_work_is_the_change_of_energy_over_a_run(module: Callable[..., Any], name: str, method: str) -> None:
    """The work W' = P(x) is integrated along with the state by plain SciPy."""
    power, end = POWERED[name]
    mod = module(name, method)
    n = mod.n_x

    def inputs(t: float) -> dict[str, float]:
        return {u: 2.0 * np.sin((3 + k) * t + k) for k, u in enumerate(mod.u_names)}

    def fun(t: float, x: np.ndarray) -> np.ndarray:
        u = inputs(t)
        return np.append(mod.rhs(t, x[:n], u=np.array(list(u.values()))), power(mod, t, mod.project(x[:n]), u))

    start = np.append(mod.x0(), 0.0)
    solution = solve_ivp(fun, (0, end), start, method="DOP853", rtol=1e-10, atol=1e-12)
    T, V = mod.energy(mod.project(solution.y[:n]))
    change, work = T + V - T[0] - V[0], solution.y[n]
    assert np.ptp(work) > 0.05 * T.max()
    assert np.abs(change - work).max() <= 1e-9 * T.max()
