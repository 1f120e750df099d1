"""A four-bar that nearly becomes a parallelogram swings round within a hair of its change point; every form follows.

Rods of 1 m on a ground of 1 m less a gap.  Judged by a solution with multipliers in 50 digits, written here, at the
position and velocity nearest to those given.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq
from sweeps import part_of

import eomgen as eg

mp.mp.dps = 50
NAMES = ("theta", "bend", "psi")
PROJECTING = ("embedding", "lagrange", "recursive", "gibbs_appell", "hamilton")


@cache
def compiled(method: str, target: str) -> Any:
    m = eg.Model("nearly_a_parallelogram", gravity=(0, 0, 0))
    m.parameter("gap", 1e-3)
    a, b, c = (m.body(n, mass=1, com=(0.5, 0, 0), inertia={"zz": 1 / 12}) for n in "abc")
    m.revolute("A", m.ground, a, coordinate="theta")
    m.revolute("B", a.at(1, 0, 0), b, coordinate="bend")
    m.revolute("D", m.ground.at("1 - gap", 0, 0), c, coordinate="psi")
    m.revolute("C", b.at(1, 0, 0), c.at(1, 0, 0))
    m.guess(theta=1.0, bend=-1, psi=1)
    return m.compile(method, target=target, independent=["theta"])


def closure(q: Any, gap: Any) -> tuple[Any, Any]:
    """C and C_q."""
    a, b, c = q[0], q[0] + q[1], q[2]
    C = mp.matrix([mp.cos(a) + mp.cos(b) - mp.cos(c) - 1 + gap, mp.sin(a) + mp.sin(b) - mp.sin(c)])
    J = mp.matrix([[-mp.sin(a) - mp.sin(b), -mp.sin(b), mp.sin(c)], [mp.cos(a) + mp.cos(b), mp.cos(b), -mp.cos(c)]])
    return C, J


def least(J: Any, e: Any) -> Any:
    return J.T * mp.lu_solve(J * J.T, e)


def exact(x: Any, gap: float) -> tuple[Any, Any, Any]:
    """q, v and v' of the state nearest to x, in 50 digits; coordinates in the order of NAMES."""
    e = mp.mpf(gap)
    q, v = mp.matrix(list(x[:3])), mp.matrix(list(x[3:]))
    for _ in range(40):
        C, J = closure(q, e)
        step = least(J, C)
        q -= step
        if mp.norm(step) < mp.mpf(10) ** -45:
            break
    J = closure(q, e)[1]
    v -= least(J, J * v)
    a, b, c = q[0], q[0] + q[1], q[2]
    da, db, dc = v[0], v[0] + v[1], v[2]
    gamma = [f * (mp.cos(a) * da**2 + mp.cos(b) * db**2 - mp.cos(c) * dc**2) for f in (-1,)]
    gamma.append(-mp.sin(a) * da**2 - mp.sin(b) * db**2 + mp.sin(c) * dc**2)
    third, cos, sin = mp.mpf(1 / 12) + mp.mpf(1) / 4, mp.cos(q[1]), mp.sin(q[1])
    K = mp.zeros(5)
    K[:3, :3] = mp.matrix([[2 * third + 1 + cos, third + cos / 2, 0], [third + cos / 2, third, 0], [0, 0, third]])
    K[3:, :3], K[:3, 3:] = J, J.T
    force = [sin / 2 * (db**2 - da**2), -sin / 2 * da**2, 0]
    return q, v, mp.lu_solve(K, mp.matrix([*force, *(-g for g in gamma)]))[:3]


@cache
def near(gap: float, share: float) -> tuple[np.ndarray, float]:
    """A state about sqrt(gap) from flat, moving, and its smallest singular value relative to the largest."""
    theta = 0.9 * share * np.sqrt(gap)

    def open_by(psi: float) -> float:
        return float((np.cos(theta) - 1 + gap - np.cos(psi)) ** 2 + (np.sin(theta) - np.sin(psi)) ** 2 - 1)

    grid = np.linspace(-10 * theta, 10 * theta, 401)
    at = next(k for k in range(400) if open_by(grid[k]) * open_by(grid[k + 1]) < 0)
    psi = brentq(open_by, grid[at], grid[at + 1], xtol=1e-16)
    bend = np.arctan2(np.sin(psi) - np.sin(theta), 1 - gap + np.cos(psi) - np.cos(theta)) - theta
    q = np.array([theta, bend, psi])
    J = np.array(closure(mp.matrix(list(q)), mp.mpf(gap))[1].tolist(), dtype=float)
    _, sizes, Vt = np.linalg.svd(J)
    q, v, _ = exact(np.concatenate([q, Vt[2] / np.abs(Vt[2]).max()]), gap)
    return np.array([float(z) for z in (*q, *v)]), float(sizes[1] / sizes[0])


@cache
def acceleration(gap: float, share: float) -> np.ndarray:
    """Of that state, in 50 digits."""
    return np.array([float(z) for z in exact(near(gap, share)[0], gap)[2]])


@cache
def slopes(gap: float, share: float) -> np.ndarray:
    """Of the velocities and accelerations there, by differences in 50 digits."""
    h = mp.mpf(10) ** -20
    columns = []
    for k in range(6):
        unit = [h if j == k else mp.mpf(0) for j in range(6)]
        x = near(gap, share)[0]
        up, down = (exact([mp.mpf(z) + s * d for z, d in zip(x, unit, strict=True)], gap) for s in (1, -1))
        rates = ([*found[1], *found[2]] for found in (up, down))
        columns.append([float((a - b) / (2 * h)) for a, b in zip(*rates, strict=True)])
    return np.array(columns).T


STATES = [(gap, share) for gap in (1e-2, 1e-5, 1e-6, 1e-7, 3e-8, 1e-9) for share in (1.0, 3.0)]


def order(mod: Any) -> list[int]:
    return [mod.q_names.index(name) for name in NAMES]


IN_C = ("embedding", "recursive")  #: of the others NumPy's functions always run, those in C by make thorough
FORMS = [(method, target) for method in PROJECTING for target in ("numpy", "cython")]


@pytest.mark.parametrize(("method", "target"), part_of(FORMS, lambda x: x[1] == "numpy" or x[0] in IN_C))
def test_accelerations_equal_those_in_fifty_digits(method: str, target: str) -> None:
    mod = compiled(method, target)
    for gap, share in STATES:
        x, weak = near(gap, share)
        expected = acceleration(gap, share)
        given = np.empty(6)
        given[order(mod)], given[[3 + k for k in order(mod)]] = x[:3], x[3:]
        found = mod.bind({"gap": gap}).rhs(0.0, given)[3:][order(mod)]
        assert np.abs(found - expected).max() <= 1e-15 / weak**2 * np.abs(expected).max(), (gap, share)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_projected_states_are_on_the_constraints_to_rounding(target: str) -> None:
    mod, rng = compiled("embedding", target), np.random.default_rng(1)
    for gap, share in STATES[:-2]:
        x, weak = near(gap, share)
        moved = x + 1e-4 * weak * rng.normal(size=6)
        given = np.empty(6)
        given[order(mod)], given[[3 + k for k in order(mod)]] = moved[:3], moved[3:]
        found = mod.bind({"gap": gap}).project(given)
        q = mp.matrix(list(found[order(mod)]))
        C, J = closure(q, mp.mpf(gap))
        rate = J * mp.matrix(list(found[[3 + k for k in order(mod)]]))
        assert max(map(abs, C)) <= 4e-15, (gap, share)
        assert max(map(abs, rate)) <= 1e-14 + 1e-15 / weak, (gap, share)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_the_jacobian_is_the_derivative_of_the_projected_motion(target: str) -> None:
    mod = compiled("embedding", target)
    for gap, share in STATES[:6]:
        x, weak = near(gap, share)
        at = [*order(mod), *(3 + k for k in order(mod))]
        given = np.empty(6)
        given[at] = x
        expected = slopes(gap, share)
        found = mod.bind({"gap": gap}).jacobian(0.0, given)[np.ix_(at, at)]
        assert np.abs(found - expected).max() <= 1e-14 / weak**2 * np.abs(expected).max(), (gap, share)


@pytest.mark.parametrize("gap", [1e-6, 1e-7, 1e-8])
def test_energy_is_kept_right_past_the_change_point(gap: float) -> None:
    mod = compiled("embedding", "cython").bind({"gap": gap})
    run = mod.simulate(1.0, {"theta": 0.3, "theta_dot": -1.0}, rtol=1e-10, atol=1e-12)
    assert run.energy_drift <= 2e-8
    assert np.sign(run["theta"][0] - 0.29) != np.sign(run["theta"][-1] - 0.29)
