"""Linear systems of the forms with reactions as unknowns: sizes, reactions against free bodies, redundancy, verbs."""

from __future__ import annotations

from typing import Any

import judges
import models
import numpy as np
import pytest

import eomgen as eg
from eomgen.graph.evaluate import compile_evaluator
from eomgen.numeric.system import Pattern

FREE = ["newton_euler", "amalgamated"]


def solution(equations: Any, mod: Any, x: np.ndarray) -> np.ndarray:
    """The unknowns z at a state, by NumPy's least squares on the system's own entries."""
    k, system = equations.kinematics, equations.tree.system
    names = (*k.names, *k.velocity_names, *k.input_names, *k.parameter_names, "t")
    numbers = compile_evaluator([*system.entries, *system.right], names)([*x, *mod.u, *mod.p, 0.0])
    numbers = np.array(numbers, dtype=float)
    K = np.zeros((len(system.unknowns),) * 2)
    for (i, j), entry in zip(system.places, numbers, strict=False):
        K[i, j] = entry
    return np.linalg.lstsq(K, numbers[len(system.places) :], rcond=1e-11)[0]


@pytest.mark.parametrize("method", FREE)
def test_the_bearing_of_a_pendulum_carries_what_newton_says(method: str) -> None:
    m = eg.Model("pendulum", gravity=(0, -9.81, 0))
    rod = m.body("rod", mass=2.0, com=(0.6, 0, 0), inertia=(0.11, 0.2, 0.3))
    m.revolute("A", m.ground, rod, coordinate="theta")
    theta, rate = 0.7, 1.9
    alpha = -2.0 * 9.81 * 0.6 * np.cos(theta) / (0.3 + 2.0 * 0.6**2)
    equations = m.derive(method)
    z = solution(equations, equations.compile(target="numpy"), np.array([theta, rate]))
    along, across = -0.6 * rate**2 + 9.81 * np.sin(theta), 0.6 * alpha + 9.81 * np.cos(theta)
    wrench = z[-6:]  # moment about the bearing, then force, in axes of the rod
    np.testing.assert_allclose(wrench, [0, 0, 0, 2 * along, 2 * across, 0], atol=1e-12)
    np.testing.assert_allclose(z[:6], [0, 0, alpha, 9.81 * np.sin(theta), 9.81 * np.cos(theta), 0], atol=1e-12)


@pytest.mark.parametrize("method", FREE)
def test_the_ground_carries_the_change_of_momentum(method: str) -> None:
    """A slider-crank, a joint between two moving bodies cut: reactions at the ground give the sum of m (a_c - g)."""
    equations = models.build("offset_slider_crank").derive(method)
    mod = equations.compile(target="numpy")
    links = equations.kinematics.links
    width = 12 if method == "newton_euler" else 13
    for x in judges.random_states(mod, 3, 2):
        z = solution(equations, mod, x)
        pose = mod.poses(x[: mod.n_q])
        total = np.zeros(3)
        for k, link in enumerate(links):
            if link.parent < 0:
                axes = np.array([[e.value for e in row] for row in link.frame.rotation], dtype=float)
                total += pose[link.body][:3, :3] @ axes @ z[width * k + width - 3 : width * k + width]

        def momentum(states: np.ndarray) -> np.ndarray:
            return np.stack([mod.momentum(s)[:3] for s in states.T], axis=1)

        rate = judges.first(momentum, x, mod.rhs(0.0, x), h=1e-2)
        weight = np.array([0.0, 9.81 * 2.3, 0.0])
        np.testing.assert_allclose(total, rate + weight, rtol=1e-8, atol=1e-8)


def test_sizes_are_those_of_the_table() -> None:
    """Bodies b, freedoms of the tree d, equations of cut joints and couplings k, velocities n, rows m."""
    for name, b, d, k, n, m in (
        ("slider_crank", 3, 3, 5, 3, 2),
        ("rolling_disc", 1, 6, 3, 6, 3),
        ("chain", 3, 3, 0, 3, 0),
    ):
        sizes = {method: models.build(name).derive(method).system_size for method in ("augmented", *FREE)}
        assert sizes["newton_euler"][0] == 12 * b + k
        assert sizes["amalgamated"][0] == 12 * b + d + k
        assert sizes["augmented"] is None if m == 0 else sizes["augmented"][0] == n + m


def test_redundant_equations_get_the_least_reactions() -> None:
    """Two equal supports of one weight: each carries half, and rounding in a spare row does no harm."""
    described = {
        "size": 4,
        "rows": [0, 0, 0, 1, 2, 3],
        "columns": [0, 1, 2, 0, 0, 0],
        "relaxed": [[1, 1], [2, 2], [3, 3]],
    }
    K = np.array([2.0, 1.0, 1.0, 1.0, 1.0, 1e-17])
    z = Pattern(described).balance(K, np.ones(8)).solve(np.array([6.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(z, [0.0, 3.0, 3.0, 0.0], atol=1e-12)
