"""One slider-crank in units of length from 1e-6 to 1e7 of a metre, and the same made small: every form, both targets.

Judged by free bodies with multipliers in the plane, written here with NumPy in metres: angular accelerations do not
depend on the unit, linear ones are proportional to it.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.numeric.system import Pattern

FORMS = ("embedding", "lagrange", "recursive", "gibbs_appell", "hamilton", "augmented", "newton_euler", "amalgamated")
UNITS = (1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6, 1e7)
SMALL = (1e-2, 1e-3, 1e-4, 1e-5)
R, L, THETA, RATE = 0.1, 0.35, 0.3, 10.0


@cache
def compiled(form: str, target: str) -> Any:
    m = eg.Model("slider_crank", gravity=(0, "-g*U", 0))
    U = m.parameter("U", 1.0)
    m.parameter("g", 9.81)
    masses = [m.parameter(name, value) for name, value in (("m_a", 1.0), ("m_b", 0.8), ("m_s", 0.5))]
    crank = m.body("a", mass=masses[0], com=(0.05 * U, 0, 0), inertia={"zz": masses[0] * 1e-3 * U**2})
    rod = m.body("b", mass=masses[1], com=(0.175 * U, 0, 0), inertia={"zz": masses[1] * 1e-2 * U**2})
    slider = m.body("s", mass=masses[2])
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(R * U, 0, 0), rod, coordinate="bend")
    m.revolute("C", rod.at(L * U, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.independent("theta")
    m.guess(theta=THETA)
    return m.compile(form, target=target, **({"optimize": 0} if target == "cython" else {}))


def expected(g: float) -> np.ndarray:
    """theta'', bend'' and s'' in metres, by three free bodies with (x, y, angle) each and five joint equations."""
    a = THETA
    b = -np.arcsin(R * np.sin(a) / L)
    da = RATE
    db = -R * np.cos(a) * da / (L * np.cos(b))
    M = np.diag([1.0, 1.0, 1e-3, 0.8, 0.8, 8e-3, 0.5, 0.5])
    force = np.array([0, -g, 0, 0, -0.8 * g, 0, 0, -0.5 * g])

    def arm(length: float, angle: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
        e = np.array([np.cos(angle), np.sin(angle)])
        return length * np.array([-e[1], e[0]]), -length * rate**2 * e  # by the angle's acceleration, and the rest

    rows, rest = np.zeros((7, 8)), np.zeros(7)
    back, centre = arm(-0.05, a, da), arm(0.05, a, da)
    rows[:2, :2], rows[:2, 2], rest[:2] = np.eye(2), back[0], back[1]  # crank on ground
    first, second = centre, arm(-0.175, b, db)
    rows[2:4, :2], rows[2:4, 3:5] = np.eye(2), -np.eye(2)
    rows[2:4, 2], rows[2:4, 5], rest[2:4] = first[0], -second[0], first[1] - second[1]
    tip = arm(0.175, b, db)
    rows[4:6, 3:5], rows[4:6, 6:], rows[4:6, 5], rest[4:6] = np.eye(2), -np.eye(2), tip[0], tip[1]
    rows[6, 7] = 1.0
    K = np.block([[M, rows.T], [rows, np.zeros((7, 7))]])
    x = np.linalg.solve(K, np.concatenate([force, -rest]))
    return np.array([x[2], x[5] - x[2], x[6]])


def accelerations(mod: Any, parameters: dict[str, float]) -> np.ndarray:
    """At the closed position and its rates by trigonometry."""
    U, b = parameters["U"], -np.arcsin(R * np.sin(THETA) / L)
    db = -R * np.cos(THETA) * RATE / (L * np.cos(b))
    state = {
        "theta": (THETA, RATE),
        "bend": (b - THETA, db - RATE),
        "s": (
            U * (R * np.cos(THETA) + L * np.cos(b)),
            -U * (R * np.sin(THETA) * RATE + L * np.sin(b) * db),
        ),
    }
    assert set(mod.q_names) == set(state)
    x = np.array([state[name][k] for k in (0, 1) for name in mod.q_names])
    found = dict(zip(mod.q_names, mod.bind(parameters).rhs(0.0, x)[mod.n_q :], strict=True))
    return np.array([found["theta"], found["bend"], found["s"] / U])


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("form", FORMS)
def test_the_unit_of_length_does_not_matter(form: str, target: str) -> None:
    for U in UNITS:
        np.testing.assert_allclose(accelerations(compiled(form, target), {"U": U}), expected(9.81), rtol=1e-12)


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("form", FORMS)
def test_a_mechanism_can_be_as_small_as_it_likes(form: str, target: str) -> None:
    """Lengths times U and masses times U^3, gravity as it is: g / U in the unit of the mechanism."""
    for U in SMALL:
        values = {"U": U, "m_a": U**3, "m_b": 0.8 * U**3, "m_s": 0.5 * U**3, "g": 9.81 / U}
        np.testing.assert_allclose(accelerations(compiled(form, target), values), expected(9.81 / U), rtol=1e-12)


def test_a_system_that_rounding_leaves_unsolved_says_so() -> None:
    """A second constraint of 1e-8 beside a first of 1 asks for an acceleration of 1e8; K as given has no redundancy."""
    K = np.zeros((4, 4))
    K[:2, :2], K[2, 0], K[3, 1] = np.eye(2), 1.0, 1e-8
    K = np.maximum(K, K.T)
    rows, columns = np.nonzero(K)
    described = {"size": 4, "rows": rows.tolist(), "columns": columns.tolist(), "relaxed": [[2, 2], [3, 3]]}
    system = Pattern(described).balance(K[rows, columns], np.ones(8))
    with pytest.raises(eg.UnsolvedError, match="rounding"):
        system.solve(np.array([0.0, 0.0, 1.0, 1.0]))
    np.testing.assert_allclose(system.solve(np.array([1.0, 0.0, 2.0, 0.0]))[:2], [2.0, 0.0], atol=1e-14)


def test_many_right_sides_are_solved_at_once() -> None:
    rng = np.random.default_rng(3)
    C = rng.normal(size=(2, 5))
    K = np.block([[np.diag(10.0 ** np.arange(-6, 4, 2)), C.T], [C, np.zeros((2, 2))]])
    rows, columns = np.nonzero(K)
    described = {"size": 7, "rows": rows.tolist(), "columns": columns.tolist(), "relaxed": [[5, 5], [6, 6]]}
    right = rng.normal(size=(7, 4))
    found = Pattern(described).balance(K[rows, columns], np.ones(14)).solve(right)
    np.testing.assert_allclose(K @ found, right, atol=1e-9 * np.abs(right).max())
