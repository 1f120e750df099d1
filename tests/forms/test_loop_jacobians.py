"""Jacobians of loops by articulated bodies, against the NumPy target, which solves a dense system for each column."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from benchmarks.large_loops import closed_chain, four_bars
from eomgen import pipeline

EXAMPLES = Path(__file__).parents[2] / "examples"


def rods(twice: bool = False) -> eg.Model:
    """Two bodies on ball joints in Euler parameters, held together by a rod, or by two in one place."""
    m = eg.Model("rods", gravity=(0.0, 0.0, -9.81))
    a = m.body("a", mass=1.2, com=(0.1, 0.2, -0.5), inertia=(0.2, 0.3, 0.15))
    b = m.body("b", mass=0.8, com=(-0.1, 0.1, -0.4), inertia=(0.1, 0.2, 0.15))
    m.spherical("A", m.ground, a, rotation="euler_parameters")
    m.spherical("B", m.ground.at(1.0, 0.0, 0.0), b, rotation="euler_parameters")
    for name in ("rod", "second") if twice else ("rod",):
        m.distance(name, a.at(0.0, 0.3, -1.0), b.at(0.2, 0.0, -0.9), length=1.1)
    return m


def driven() -> eg.Model:
    """A chain whose last joint is led over time."""
    m = closed_chain(6, False, False)
    m.driver("lead", "j5", "0.3*sin(2*t) + 0.1")
    return m


CASES: dict[str, Callable[[], eg.Model]] = {
    "closed chain": lambda: closed_chain(9, True, False),
    "spatial chain": lambda: closed_chain(9, True, True),
    "four-bars": lambda: four_bars(4),
    "rods": rods,
    "rods held twice": lambda: rods(True),
    "driven chain": driven,
    "slider-crank": lambda: eg.load(EXAMPLES / "slider_crank.yaml"),
}


def on_constraints(module: Any, seed: int, t: float) -> np.ndarray:
    random = np.random.default_rng(seed)
    x = module.x0(t=t) if "driven" in module.name else module.x0()
    x = module.project(x + 0.02 * random.uniform(-1, 1, len(x)), t=t)
    x[module.n_q :] = random.uniform(-1, 1, module.n_v)
    return np.asarray(module.project(x, t=t))


@pytest.mark.parametrize("name", CASES)
def test_jacobians_are_those_of_the_dense_system(name: str) -> None:
    equations = CASES[name]().derive("recursive")
    blocks = pipeline.build(equations, "c", ["rhs", "jacobian"]).block_names
    assert {"loop_slopes", "slopes_by_position", "slopes_by_velocity"} <= blocks
    module = equations.compile(kernels=["rhs", "jacobian"], optimize=0)
    dense = equations.compile(target="numpy")
    for seed in range(3):
        x, t = on_constraints(dense, seed, 0.3), 0.3
        found, expected = module.jacobian(t, x), dense.jacobian(t, x)
        assert np.abs(found - expected).max() <= 1e-10 * np.abs(expected).max()


def test_a_jacobian_does_not_need_the_preferred_coordinates_to_move() -> None:
    """At a dead centre the slider stands still: the columns are taken one by one."""
    equations = eg.load(EXAMPLES / "slider_crank.yaml").derive("recursive", independent=["s"])
    module = equations.compile(optimize=0)
    for angle in (1e-3, 3e-3, 0.02):
        x = module.x0(theta=angle, theta_dot=4.0)
        d = np.eye(module.n_x)
        h = 1e-4
        slopes = [
            (8 * (module.rhs(0.0, x + h * e) - module.rhs(0.0, x - h * e))
             - (module.rhs(0.0, x + 2 * h * e) - module.rhs(0.0, x - 2 * h * e))) / (12 * h)
            for e in d
        ]  # fmt: skip
        found = module.jacobian(0.0, x)
        assert np.abs(found - np.array(slopes).T).max() <= 1e-6 * np.abs(found).max()


@pytest.mark.slow
def test_a_column_takes_work_in_proportion_to_the_chain() -> None:
    counts = [
        pipeline.build(closed_chain(n, True, False).derive(), "c", ["rhs", "jacobian"]).counts for n in (20, 40, 80)
    ]
    for block in ("loop_slopes", "slopes_by_position", "slopes_by_velocity"):
        small, middle, large = (one[block].total for one in counts)
        assert large - middle <= 1.05 * 2 * (middle - small)
