"""The satellite, the quadrotor, Furuta's pendulum and the PUMA robot of the gallery beside published equations."""

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


def test_a_quadrotor_comes_to_its_goal() -> None:
    mod, p = compiled("quadrotor_load")
    traj = mod.simulate(10.0)
    goal = np.array([[p["goal_x"], p["goal_y"], p["goal_z"]]]).T
    away = np.linalg.norm(np.array([traj["x"], traj["y"], traj["z"]]) - goal, axis=0)
    assert away[0] > 3.3
    assert away[-1] < 0.05


def test_a_wheel_turns_a_satellite_from_rest() -> None:
    """(I + J) w = -J Omega, as in tests/reference/spacecraft_analytic.json; the panels are out and at rest."""
    given = models.reference("spacecraft_analytic")["reaction_wheel"]
    Ib, Jw, Omega = (float(given[key]) for key in ("Ib", "Jw", "from_rest_wheel_relative_speed"))
    assert -Jw * Omega / (Ib + Jw) == pytest.approx(float(given["body_rate"]), rel=1e-14)
    mod, p = compiled("satellite")
    traj = mod.simulate(38.0, initial={"left": 0.0, "right": 0.0}, parameters={"tau_x": 0.0, "tau_y": 0.0})
    panel = p["m_p"] * (p["l"] ** 2 + p["w"] ** 2) / 12 + p["m_p"] * (0.5 + p["w"] / 2) ** 2
    wheels = 2 * p["J"] / 2 + 2 * 4 * 0.25**2  # of the other two, 4 kg at 0.25 m
    total = 4 * 3 + 2 * p["m_p"] + 200
    off = 4 * np.array([0.25, 0.25]) / total  # centre of mass off the axis
    inertia = p["I"] + 2 * panel + wheels - total * off @ off
    expected = -p["J"] * traj["spin_z_dot"] / (inertia + p["J"])
    assert traj["flight_wz"][-1] == pytest.approx(expected[-1], rel=1e-6)  # the axis nods by the offset wheels
    assert expected[-1] > 0.1


def test_a_satellite_keeps_no_momentum() -> None:
    """Angular momentum from the poses alone: their differences over 0.2 ms in place of velocities."""
    mod, p = compiled("satellite")
    names = ("hull", "left_panel", "right_panel", "wheel_x", "wheel_y", "wheel_z")
    mass = np.array([200, p["m_p"], p["m_p"], 4, 4, 4])
    w, l, J = p["w"], p["l"], p["J"]
    panel = p["m_p"] / 12 * np.array([w**2, l**2, l**2 + w**2])
    inertia = np.array([[p["I"]] * 3, panel, panel, *[[J / 2, J / 2, J]] * 3])
    center = np.zeros((6, 3))
    center[1, 1], center[2, 1] = w / 2, -w / 2
    order, h = [mod.body_names.index(name) for name in names], 1e-4
    for time in (1.5, 14.0, 23.0, 34.5):
        x = mod.simulate(time + h, t_eval=[0.0, time - h, time, time + h], rtol=1e-12, atol=1e-13).x[:, 1:]
        before, now, after = (mod.poses(state[: mod.n_q])[order] for state in x.T)
        places = [T[:, :3, 3] + np.einsum("bij,bj->bi", T[:, :3, :3], center) for T in (before, now, after)]
        speed = (places[2] - places[0]) / (2 * h)
        H, largest = np.zeros(3), 0.0
        for k in range(6):
            R, change = now[k, :3, :3], (after[k, :3, :3] - before[k, :3, :3]) / (2 * h)
            S = change @ R.T
            spin = 0.5 * np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]])
            own = R @ np.diag(inertia[k]) @ R.T @ spin
            H += own + mass[k] * np.cross(places[1][k], speed[k])
            largest = max(largest, float(np.linalg.norm(own)))
        assert largest > 0.5
        assert np.abs(mass @ speed).max() < 1e-5
        assert np.abs(H).max() < 1e-5 * largest


def test_the_robot_has_the_published_torques() -> None:
    """Toolbox values of tests/reference/puma560.json; motors and gears are in the file, friction is added here."""
    case = models.reference("puma560")
    given, published = case["parameters_SI"], case["published"]
    mod, _ = compiled("puma560")
    free = mod.bind(p={"k": 0.0, "c": 0.0, "k_w": 0.0, "c_w": 0.0})
    q, gear = np.array([0, np.pi / 4, np.pi, 0, np.pi / 4, 0]), np.abs(given["G"])
    for key, rate, acceleration in (
        ("rne_qn_0_0", 0, 0),
        ("rne_qn_0_1", 0, 1),
        ("rne_qn_1_1", 1, 1),
        ("rne_qn_1_0", 1, 0),
    ):
        v, a = np.full(6, float(rate)), np.full(6, float(acceleration))
        friction = gear * (np.array(given["B"]) * gear * v + np.array([high for high, _ in given["Tc_plus_minus"]]) * v)
        torque = free.inverse_dynamics(q, v, a) + friction
        np.testing.assert_allclose(torque, published[key], rtol=2e-5, atol=1e-4)
    np.testing.assert_allclose(free.mass_matrix(q), published["inertia_qn"], atol=6e-5)
