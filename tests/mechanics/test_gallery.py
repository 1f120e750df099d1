"""Machines of the gallery beside closed forms, published equations and circles that are cut by hand."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import models
import numpy as np
import pytest
import scipy.integrate
import sympy as sp
from scipy.optimize import brentq
from sweeps import part_of

import eomgen as eg


# -- Craft -------------------------------------------------------------------------------------------------------------
@cache
def compiled(name: str) -> tuple[Any, dict[str, float]]:
    mod = eg.load(models.EXAMPLES / f"{name}.yaml").compile(target="numpy")
    return mod, dict(zip(mod.p_names, mod.p.tolist(), strict=True))


def turn(axis: int, angle: Any) -> np.ndarray:
    """Rotation about x (0), y (1) or z (2)."""
    c, s = np.cos(angle), np.sin(angle)
    rows = np.eye(3, dtype=np.asarray(angle).dtype if np.iscomplexobj(angle) else float)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    rows[j, j], rows[j, k], rows[k, j], rows[k, k] = c, -s, s, c
    return rows


def test_furutas_pendulum_accelerates_as_published() -> None:
    """Cazzolato and Prime, On the dynamics of the Furuta pendulum, 2011, equations 33 and 34."""
    mod, p = compiled("furuta_pendulum")
    m, L, l, b1, b2 = p["m_2"], p["L_1"], p["l_2"], p["b_1"], p["b_2"]
    J0 = p["J_1"] + p["m_1"] * p["l_1"] ** 2 + m * L**2
    J2 = p["J_2"] + m * l**2
    random = np.random.default_rng(3)
    for _ in range(5):
        x = random.uniform(-3, 3, 4)
        _, q, v, w = x
        tau = random.uniform(-1, 1)
        matrix = [[J0 + J2 * np.sin(q) ** 2, m * L * l * np.cos(q)], [m * L * l * np.cos(q), J2]]
        force = [
            tau - b1 * v + m * L * l * np.sin(q) * w**2 - v * w * np.sin(2 * q) * J2,
            -b2 * w + 0.5 * v**2 * np.sin(2 * q) * J2 - p["g"] * m * l * np.sin(q),
        ]
        assert mod.rhs(0.0, x, u=[tau])[2:] == pytest.approx(np.linalg.solve(matrix, force), rel=1e-11, abs=1e-11)


def test_a_quadrotor_and_its_load_accelerate_as_published() -> None:
    """Sreenath, Lee and Kumar (CDC 2013): with q from the quadrotor to the load and F = f R e3,

    (m_Q + m_L) (a_L + g e3) = (q . F - m_Q l q' . q') q, and I w' + w x I w = M.
    """
    mod, p = compiled("quadrotor_load")
    m, ml, l, g = p["m"], p["m_l"], p["l"], p["g"]
    e3, eps = np.array([0.0, 0.0, 1.0]), 1e-30
    inertia = np.diag([p["I"], p["I"], p["I_z"]])

    def attitude(a: np.ndarray) -> np.ndarray:
        return turn(0, a[0]) @ turn(1, a[1]) @ turn(2, a[2])

    def down(a: np.ndarray) -> np.ndarray:
        return attitude(a) @ turn(0, a[3]) @ turn(1, a[4]) @ -e3

    def spin(a: np.ndarray, v: np.ndarray) -> np.ndarray:
        rates = attitude(a).T @ (attitude(a + 1j * eps * v).imag / eps)  # R^T R'
        return np.array([rates[2, 1], rates[0, 2], rates[1, 0]])

    random = np.random.default_rng(5)
    for _ in range(4):
        x = random.uniform(-0.5, 0.5, 16)
        place, a, v = x[:3], x[3:8], x[8:]
        roll, pitch, yaw, sx, sy = a
        q, rate = down(a), down(a + 1j * eps * v[3:]).imag / eps
        lift = (m + ml) * (g + 4 * p["omega"] ** 2 * (p["goal_z"] - place[2]) - 4 * p["omega"] * v[2])
        F = lift / (np.cos(roll) * np.cos(pitch)) * attitude(a) @ e3
        load = ((q @ F - m * l * rate @ rate) * q) / (m + ml) - g * e3
        tension = -ml * (load + g * e3) @ q
        expected = (F + tension * q) / m - g * e3
        found = mod.rhs(0.0, x)[8:]
        assert found[:3] == pytest.approx(expected, rel=1e-10, abs=1e-10)
        w, k = p["omega"], p["omega_a"]
        asked_roll = -(w**2 * (p["goal_y"] - place[1]) - 2 * w * v[1]) / g + p["k_s"] * (sx + roll)
        asked_pitch = (w**2 * (p["goal_x"] - place[0]) - 2 * w * v[0]) / g + p["k_s"] * (sy + pitch)
        moment = inertia @ [
            k**2 * (asked_roll - roll) - 2 * k * v[3],
            k**2 * (asked_pitch - pitch) - 2 * k * v[4],
            -(k**2) / 25 * yaw - k * 2 / 5 * v[5],
        ]
        body = spin(a, v[3:])
        h = 1e-6
        ahead, behind = (spin(a + s * h * v[3:], v[3:] + s * h * found[3:]) for s in (1, -1))
        assert inertia @ (ahead - behind) / (2 * h) + np.cross(body, inertia @ body) == pytest.approx(
            moment, rel=1e-6, abs=1e-8
        )


# -- Engines -----------------------------------------------------------------------------------------------------------
def gas(p: dict[str, float], after: sp.Expr) -> sp.Expr:
    """Force on a piston at the crank's angle after the dead centre at which it fires."""
    r, l, e = p["r"], p["l"], p["ratio"]
    volume = 2 * r / (e - 1) + r + l - r * sp.cos(after) - sp.sqrt(l**2 - (r * sp.sin(after)) ** 2)
    largest = 2 * r / (e - 1) + 2 * r
    shut = (1 + sp.tanh(p["sharp"] * sp.cos(after / 2))) / 2
    burnt = (1 + sp.tanh(p["sharp"] * sp.sin((after - p["delay"]) / 2))) / 2
    pressure = p["p_0"] * (largest / volume) ** p["kappa"] * (1 + (p["rise"] - 1) * burnt)
    return shut * (pressure - p["p_0"]) * sp.pi * p["bore"] ** 2 / 4


def acceleration(mod: Any, cylinders: list[tuple[float, float]]) -> Any:
    """theta'' = (Q - V' - I' omega^2 / 2) / I of an engine with cylinders (angle of the axis, angle when it fires)."""
    p = dict(zip(mod.p_names, mod.p, strict=True))
    theta, omega = sp.symbols("theta omega")
    r, l, g, mass = p["r"], p["l"], p["g"], 0.4
    pin = sp.Matrix([r * sp.cos(theta), r * sp.sin(theta)])
    inertia, potential = p["J"] + 6 * (r / 10) ** 2, -6 * g * pin[1] / 10
    force = -p["c"] * omega**2
    for axis, fires in cylinders:
        way = r * sp.cos(theta - axis) + sp.sqrt(l**2 - (r * sp.sin(theta - axis)) ** 2)
        piston = way * sp.Matrix([sp.cos(axis), sp.sin(axis)])
        rod = pin + 0.3 * (piston - pin)
        swing = sp.asin(r / l * sp.sin(theta - axis))
        inertia += mass * (rod.diff(theta).dot(rod.diff(theta)) + way.diff(theta) ** 2)
        inertia += mass * l**2 / 12 * swing.diff(theta) ** 2
        potential += mass * g * (rod[1] + piston[1])
        force -= gas(p, theta - fires) * way.diff(theta)
    found = (force - potential.diff(theta) - inertia.diff(theta) * omega**2 / 2) / inertia
    return sp.lambdify((theta, omega), found, cse=True)


ENGINES = {
    "engine": [(np.pi / 2, np.pi / 2)],
    "v_engine": [(np.pi / 4, np.pi / 4), (3 * np.pi / 4, 3 * np.pi / 4 + 2 * np.pi)],
}


@cache
def engine(name: str) -> Any:
    return eg.load(models.EXAMPLES / f"{name}.yaml").compile(optimize=0)


@pytest.mark.parametrize("name", part_of(ENGINES, "engine".__eq__))
def test_an_engine_runs_as_its_one_angle_does(name: str) -> None:
    mod = engine(name)
    traj = mod.simulate(0.1, rtol=1e-11, atol=1e-13)
    law = acceleration(mod, ENGINES[name])
    start = [traj["theta"][0], traj["theta_dot"][0]]
    by_hand = scipy.integrate.solve_ivp(
        lambda t, y: [y[1], law(*y)], (0, 0.1), start, "DOP853", rtol=1e-11, atol=1e-12, dense_output=True
    )
    expected = by_hand.sol(traj.t)
    assert traj["theta"] == pytest.approx(expected[0], abs=1e-8)
    assert traj["theta_dot"] == pytest.approx(expected[1], abs=1e-6)
    assert traj["theta"][-1] > 2.0 * np.pi


# -- A walker and a wheelset -------------------------------------------------------------------------------------------
def test_a_wheel_without_a_rim_walks_at_the_published_speed() -> None:
    mod = eg.load(models.EXAMPLES / "rimless_wheel.yaml").compile(optimize=0)
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
    mod = eg.load(models.EXAMPLES / "wheelset.yaml").compile(optimize=0)
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


#: What the description of an example says of its motion -> whether a run does so.
CLAIMS: list[tuple[str, str, Callable[[Any], bool]]] = [
    ("cart_pendulum", "falls over", lambda run: run["phi"].max() > np.pi / 2),
    ("four_bar", "coasting", lambda run: run["theta_dot"].min() > 0),
    ("gear_train", "lifts a load", lambda run: run["height"][-1] > 0.1),
    ("kapitza_pendulum", "upside down, held there", lambda run: np.abs(run["theta"] - np.pi).max() < 0.3),
    ("pendulum", "released from the horizontal", lambda run: abs(run["y"][0]) < 1e-12),
    ("planetary_gear", "load that sinks", lambda run: run["height"][-1] < -0.1),
    ("slider_crank", "that swings", lambda run: np.ptp(run["theta"]) < np.pi + 1),
    ("spherical_pendulum", "swinging round", lambda run: run["phi"][-1] > 2 * np.pi),
    ("watt_six_bar", "output swings less", lambda run: np.ptp(run["swing_out"]) < np.ptp(run["swing_in"])),
]


@pytest.mark.parametrize(("name", "text", "does"), CLAIMS, ids=[name for name, _, _ in CLAIMS])
def test_examples_move_as_they_are_described(name: str, text: str, does: Callable[[Any], bool]) -> None:
    module = models.build(name).compile(target="numpy")
    assert text in module.doc
    assert does(module.simulate())
