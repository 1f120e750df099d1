"""Bristles of contacts under changing loads: power beside their energy, the law of constant loads, cycles, rest."""

from __future__ import annotations

from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg

MU, STATIC, STRIBECK = 0.3, 0.45, 0.02
S0, S1, S2 = 2e3, 40.0, 0.05
LAW = {
    "stiffness": 1e4, "exponent": 1, "friction_law": "lugre", "friction": MU, "static_friction": STATIC,
    "stribeck": STRIBECK, "bristle_stiffness": S0, "bristle_damping": S1, "viscous_friction": S2,
}  # fmt: skip
PLAIN = {key: value for key, value in LAW.items() if key not in ("static_friction", "stribeck", "viscous_friction")}


def level(speed: Any) -> Any:
    return MU + (STATIC - MU) * np.exp(-((speed / STRIBECK) ** 2))


def slider(law: dict[str, Any], drive: str = "0", push: str = "0") -> eg.Model:
    """A point on a plane; forces along both and down are texts."""
    m = eg.Model("slider", gravity=(0, 0, 0))
    body = m.body("b", mass=1.0, inertia=(0.1, 0.1, 0.1))
    m.translational("j", m.ground, body)
    m.force("drive", body, (drive, 0, push))
    m.point_plane("touch", m.ground, body, **law)
    return m


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_power_is_that_of_the_energy_of_the_bristles_and_of_losses(target: str) -> None:
    """F v >= d(e^2 / 2)/dt at random loads, speeds and states, also beyond what the load can hold."""
    mod = slider(LAW).compile(target=target)
    random = np.random.default_rng(3)
    count, least, beyond = 4000, np.inf, 0
    depth = 10 ** random.uniform(-6, -2, count)
    x = np.zeros((8, count))
    x[2] = -depth
    x[3:6] = 10 ** random.uniform(-5, 1, count) * random.standard_normal((3, count))
    x[5] = 0.0
    most = STATIC * np.sqrt(1e4 * depth / S0)
    x[6:] = most * 10 ** random.uniform(-2, 1.5, count) * random.standard_normal((2, count))
    rates = mod.rhs(0.0, x)
    power = -(rates[3] * x[3] + rates[4] * x[4])  # of friction on the body of 1 kg
    stored = (x[6:] * rates[6:]).sum(axis=0)
    size = np.abs(power) + np.abs(x[6:] * rates[6:]).sum(axis=0)
    least = ((power - stored) / size).min()
    beyond = (np.hypot(*x[6:]) > most).sum()
    assert least > -1e-12
    assert 1000 < beyond < 3000
    speed = np.hypot(x[3], x[4])
    bound = STATIC + (S1 * (1 + STATIC / MU) + S2) * speed
    assert (np.hypot(*rates[3:5]) <= 1e4 * depth * bound * (1 + 1e-12)).all()


def test_the_law_at_a_constant_load_is_the_published_one() -> None:
    """f = s0 z + s1 z' + s2 v, z' = v - s0 |v| / c(v) z, with e = sqrt(s0 N) z, wherever that is passive."""
    mod = slider(LAW).compile(target="numpy")
    random = np.random.default_rng(5)
    for _ in range(200):
        push, speed = 10 ** random.uniform(-2, 3), 10 ** random.uniform(-5, 0)
        turn = random.uniform(0, 2 * np.pi, 2)
        v = speed * np.array([np.cos(turn[0]), np.sin(turn[0])])
        z = random.uniform(0, 1) * STATIC / S0 * np.array([np.cos(turn[1]), np.sin(turn[1])])
        change = v - S0 * speed / level(speed) * z
        if (push * (S0 * z + S1 * change + S2 * v) @ v) < push * S0 * z @ change:
            continue  # it gives energy
        x = mod.x0(j_z=-push / 1e4, j_x_dot=v[0], j_y_dot=v[1])
        x[6:] = np.sqrt(S0 * push) * z
        rates = mod.rhs(0.0, x)
        np.testing.assert_allclose(rates[6:], np.sqrt(S0 * push) * change, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(rates[3:5], -push * (S0 * z + S1 * change + S2 * v), rtol=1e-10, atol=1e-12)
        x[3:5] *= 1e-9
        stiff = mod.jacobian(0.0, x)[3:5, 6:] @ np.full(2, np.sqrt(S0 * push))
        np.testing.assert_allclose(stiff, -push * S0, rtol=1e-5)  # a spring of s0 N before it slides


def test_a_run_at_a_constant_load_against_scipy() -> None:
    """Sticking, break-away and stick-slip of a mass drawn by a spring, beside the published law written by hand."""
    push = 20.0
    m = slider({**LAW, "dissipation": 1.0}, "50*(0.02*t - j_x)", str(-push))
    mod = m.compile()

    def by_hand(t: float, x: np.ndarray) -> list[float]:
        place, v, z = x
        change = v - S0 * abs(v) / level(v) * z
        return [v, 50 * (0.02 * t - place) - push * (S0 * z + S1 * change + S2 * v), change]

    times = np.linspace(0, 30, 301)
    judge = solve_ivp(by_hand, (0, 30), np.zeros(3), method="LSODA", rtol=1e-10, atol=1e-13, t_eval=times).y
    start = {"j_z": -push / 1e4}
    traj = mod.simulate(30.0, initial=start, method="Radau", rtol=1e-9, atol=1e-12, t_eval=times)
    assert np.abs(traj["j_x"] - judge[0]).max() < 1e-4
    assert np.abs(traj["touch_bristle_x"] - np.sqrt(S0 * push) * judge[2]).max() < 1e-3
    assert np.diff(judge[0]).max() > 100 * np.diff(judge[0])[100:].min()  # it sticks and slips


def cycle(law: dict[str, Any], times: int) -> float:
    """Work that friction takes in cycles: bent at a low load, given back at a high one."""
    mod = slider(law).compile(target="numpy")
    low, high, way = 1.0, 100.0, 1e-5
    legs = [(low, low, way), (low, high, 0.0), (high, high, -way), (high, low, 0.0)] * times
    state, work = np.zeros(2), 0.0
    for begin, end, moved in legs:

        def rates(t: float, y: np.ndarray, a: float = begin, b: float = end, v: float = moved) -> np.ndarray:
            x = np.zeros(8)
            x[2], x[3], x[6:] = -(a + (b - a) * t) / 1e4, v, y[:2]
            found = mod.rhs(0.0, x)
            return np.array([*found[6:], -found[3] * v])

        end_of = solve_ivp(rates, (0, 1), [*state, 0.0], rtol=1e-9, atol=1e-14).y[:, -1]
        state, work = end_of[:2], work + end_of[2]
    return work


def test_cycles_of_the_load_give_no_energy() -> None:
    """The law whose state is the deflection gives s0 (N2 - N1) x^2 / 2 in each of these cycles."""
    soft = {**PLAIN, "bristle_damping": 1e-6}
    wrong = 0.5 * S0 * (100.0 - 1.0) * 1e-5**2
    work = cycle(soft, 4)
    assert work > -1e-3 * wrong
    assert cycle(soft, 1) > -1e-3 * wrong


def test_a_block_drifts_less_than_by_the_published_law_while_its_load_changes() -> None:
    """A third of the load comes and goes 48 times, below the least friction; LuGre is known to drift then."""
    m = slider({**PLAIN, "dissipation": 1.0}, "4", "-20 + 6*sin(10*t)")
    mod = m.compile()
    start = {"j_z": -20 / 1e4, "touch_bristle_x": 4 / np.sqrt(S0 * 20)}
    traj = mod.simulate(30.0, initial=start, method="Radau", rtol=1e-8, atol=1e-11)

    def by_hand(t: float, x: np.ndarray) -> list[float]:
        push, (_, v, z) = 20 - 6 * np.sin(10 * t), x
        change = v - S0 * abs(v) / MU * z
        return [v, 4 - push * (S0 * z + S1 * change), change]

    judge = solve_ivp(by_hand, (0, 30), [0, 0, 4 / 20 / S0], method="LSODA", rtol=1e-9, atol=1e-12).y
    assert judge[0, -1] == pytest.approx(0.0155, rel=0.02)
    assert traj["j_x"][-1] == pytest.approx(0.0096, rel=0.05)


GROUNDS: dict[str, dict[str, Any]] = {
    "half_plane": {"shape": "half_plane"},
    "profile": {"shape": "profile", "points": [[-1, 0], [0, 0], [0.3, 0], [2, 0]]},
}


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("ground", list(GROUNDS))
def test_a_bounce_takes_friction_times_the_impulse_of_the_normal_force(ground: str, target: str) -> None:
    """A sliding body lands and lifts off; Coulomb's law, and N (s0 z + s1 z') (Canudas de Wit, Tsiotras), by hand."""
    m = eg.Model("bounce", gravity=(0, 0, 0))
    body = m.body("b", mass=2.0)
    m.prismatic("x", m.ground, between := m.body("between", mass=0), axis="x")
    m.prismatic("y", between, body, axis="y")
    law = {**PLAIN, "stiffness": 1e6, "exponent": 1.5, "bristle_stiffness": 1e5, "bristle_damping": 300.0}
    circle = {"shape": "circle", "on": body, "radius": 0.05}
    m.contacts("touch", circle, {**GROUNDS[ground], "on": m.ground}, {**law, "lateral": False})
    mod = m.compile(target=target)
    start = {"y": 0.051, "x_dot": 1.5, "y_dot": -0.3}
    traj = mod.simulate(0.06, initial=start, method="Radau", rtol=1e-8, atol=1e-11)

    def by_hand(t: float, x: np.ndarray) -> list[float]:
        y, v, w, z = x
        push, change = 1e6 * max(0.05 - y, 0.0) ** 1.5, v - 1e5 * abs(v) / MU * z
        return [w, -push * (1e5 * z + 300.0 * change) / 2.0, push / 2.0, change]

    judge = solve_ivp(by_hand, (0, 0.06), [0.051, 1.5, -0.3, 0.0], method="Radau", rtol=1e-8, atol=1e-11).y[:, -1]
    lost = MU * (traj["y_dot"][-1] + 0.3)
    assert traj["y_dot"][-1] == pytest.approx(0.3, rel=1e-6)
    assert 1.5 - judge[1] == pytest.approx(lost, rel=1e-3)
    assert 1.5 - traj["x_dot"][-1] == pytest.approx(lost, rel=0.01)


def test_what_a_smaller_load_holds() -> None:
    """After the load has fallen friction is at most that of the load, and the bristles keep their energy."""
    mod = slider(PLAIN).compile(target="numpy")
    e = 0.9 * MU * np.sqrt(100 / S0)
    for push in (100.0, 50.0, 1.0, 1e-6):
        x = mod.x0(j_z=-push / 1e4)
        x[6] = e
        rates = mod.rhs(0.0, x)
        assert -rates[3] == pytest.approx(min(np.sqrt(S0 * push) * e, MU * push), rel=1e-9)
        assert rates[6] == 0.0
    x = mod.x0(j_z=1e-6)
    x[6] = e
    rates = mod.rhs(0.0, x)
    assert rates[3] == 0.0
    assert rates[6] == pytest.approx(-S0 / S1 * e)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_pieces_of_a_profile_share_bristles_without_a_gain(target: str) -> None:
    """A wheel between two sides: the power of both frictions beside the energy of the one state."""
    m, (a,) = scenes.planar("trough", 1, (0, 0, 0))
    valley = {"shape": "profile", "points": [[-1.0, 1.0], [-0.05, 0.0], [0.05, 0.0], [1.0, 0.7]], "on": m.ground}
    law = {**LAW, "lateral": False}
    m.contacts("touch", valley, {"shape": "circle", "on": a, "radius": 0.2}, law)
    mod = m.compile(target=target)
    random, both = np.random.default_rng(8), 0
    mass = mod.mass_matrix(np.array([0.0, 2.0, 0.0]))
    for _ in range(400):
        x = mod.x0(j0_x=random.uniform(-0.02, 0.04), j0_y=random.uniform(0.2, 0.23))
        x[3:6] = 10 ** random.uniform(-4, 1) * random.standard_normal(3)
        still = x.copy()
        still[3:] = 0.0
        elastic = mass @ mod.rhs(0.0, still)[3:6]
        x[6] = 10 ** random.uniform(-3, 0) * random.standard_normal()
        rates = mod.rhs(0.0, x)
        taken = -(mass @ rates[3:6] - elastic) @ x[3:6]
        stored = x[6] * rates[6]
        both += np.abs(elastic).max() > 0
        assert taken - stored >= -1e-9 * (abs(taken) + abs(stored) + np.abs(elastic * x[3:6]).sum())
    assert both > 100


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_derivatives_on_both_sides_of_what_a_load_holds(target: str) -> None:
    mod = slider(LAW).compile(target=target)
    for part in (0.3, 3.0):
        x = mod.x0(j_z=-2e-3, j_x_dot=0.01, j_y_dot=-0.004, j_z_dot=0.02)
        x[6:] = part * STATIC * np.sqrt(20 / S0) * np.array([0.6, -0.8])
        found = mod.jacobian(0.0, x)
        steps = 1e-6 * np.array([1, 1, 1e-3, 1e-2, 1e-2, 1e-2, 1e-2, 1e-2])
        sides = [(mod.rhs(0.0, x + d) - mod.rhs(0.0, x - d)) / (2 * d.sum()) for d in np.diag(steps)]
        np.testing.assert_allclose(found, np.transpose(sides), rtol=1e-5, atol=1e-6 * np.abs(found[3:]).max())
        assert np.isfinite(mod.jacobian(0.0, np.zeros(8))).all()
