"""Jacobians and implicit runs of states that hardly know each other: cells of soil, balls that touch few others."""

from __future__ import annotations

from time import process_time
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg


def strip(cells: int) -> eg.Model:
    """Two wheels, each by itself, on a strip of soil with cells of 3 cm."""
    m = eg.Model("strip", gravity=(0, -9.81, 0))
    for k in (0, 1):
        m.body(f"wheel{k}", mass=100.0, inertia={"zz": 10.0})
        m.planar(f"j{k}", m.ground, f"wheel{k}")
        m.initial(**{f"j{k}_y": 0.49, f"j{k}_x": 0.9 - 0.5 * k, f"j{k}_x_dot": 1.0, f"j{k}_3_dot": -2.2})
    wheels = [{"shape": "circle", "on": f"wheel{k}", "radius": 0.5, "width": 0.3} for k in (0, 1)]
    bed = {"shape": "bed", "on": m.ground, "length": 0.03 * cells, "cells": cells}
    m.contacts("sand", wheels, bed, {"soil": "dry_sand", "dissipation": 1.0})
    return m


@pytest.fixture(scope="module")
def soil() -> tuple[eg.Module, np.ndarray]:
    """The strip and a state in which the wheels stand in ruts."""
    mod = strip(60).compile()
    return mod, mod.simulate((0, 0.11), method="DOP853", rtol=1e-9).x[:, -1]


def test_columns_of_cells_by_differences(soil: Any) -> None:
    """Where differences of both sides agree: elsewhere a law turns, as that of the size of a shear that is 0."""
    mod, x = soil
    J, here, smooth, touched = mod.jacobian(0.0, x), mod.rhs(0.0, x), 0, 0
    for k in range(12, mod.n_x):
        e = np.zeros(len(x))
        e[k] = 1e-7
        ahead, back = ((mod.rhs(0.0, x + s * e) - here) / (s * e[k]) for s in (1.0, -1.0))
        size = np.abs(ahead).max()
        if np.abs(ahead - back).max() > 1e-3 * size:
            continue
        smooth += 1
        touched += np.count_nonzero(ahead[6:12]) > 0
        np.testing.assert_allclose(J[:, k], (ahead + back) / 2.0, atol=2e-5 * size + 1e-6)
    assert smooth > 150
    assert touched > 30


def test_a_column_costs_no_call_of_its_own(soil: Any) -> None:
    """192 columns took as long as 400 calls of the right-hand side."""
    mod, x = soil

    def least(call: Any, times: int) -> float:
        best = np.inf
        for _ in range(7):
            start = process_time()
            for _ in range(times):
                call(0.0, x)
            best = min(best, (process_time() - start) / times)
        return best

    assert least(mod.jacobian, 20) < 120.0 * least(mod.rhs, 200)


def test_soil_beside_differences_and_dense_factors(soil: Any) -> None:
    mod, x = soil
    traj = mod.simulate((0, 0.1), x, method="Radau", rtol=1e-7, atol=1e-9)
    judge = solve_ivp(lambda t, y: mod.rhs(t, y), (0, 0.1), x, method="BDF", rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(traj.x[:12, -1], judge.y[:12, -1], rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(traj.x[12:, -1], judge.y[12:, -1], atol=1e-5)


def balls(count: int) -> eg.Model:
    """Discs that roll over a floor, some of them into each other."""
    m = eg.Model("balls", gravity=(0, -9.81, 0))
    for k in range(count):
        m.body(f"b{k}", mass=1.0, inertia={"zz": 0.004})
        m.planar(f"p{k}", m.ground, f"b{k}")
        m.initial(**{f"p{k}_x": 0.23 * k, f"p{k}_y": 0.101, f"p{k}_x_dot": 0.6 * (-1) ** k})
    shapes = [{"shape": "circle", "on": f"b{k}", "radius": 0.1} for k in range(count)]
    law = {"stiffness": 1e5, "dissipation": 0.5, "friction": 0.3, "smoothing": 0.01}
    m.contacts("floor", shapes, {"shape": "half_plane", "on": m.ground}, law)
    m.contacts("among", shapes, law=law)
    return m


@pytest.fixture(scope="module")
def rolling() -> eg.Module:
    return balls(14).compile()


def test_balls_beside_differences_and_dense_factors(rolling: Any) -> None:
    x = rolling.x0()
    traj = rolling.simulate((0, 0.15), method="Radau", rtol=1e-8, atol=1e-10)
    judge = solve_ivp(lambda t, y: rolling.rhs(t, y), (0, 0.15), x, method="Radau", rtol=1e-8, atol=1e-10)
    assert np.abs(judge.y[:, -1] - x).max() > 0.05
    np.testing.assert_allclose(traj.x[:, -1], judge.y[:, -1], atol=1e-5)
    assert len(traj.t) == pytest.approx(len(judge.t), rel=0.05)
