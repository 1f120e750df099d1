"""A mechanism that cannot move: every call and every integrator still answers."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_a_welded_tree_simulates(target: str) -> None:
    m = eg.Model("welded", gravity=(0, -9.81, 0))
    m.weld("A", m.ground.at(1, 2, 0), m.body("b", mass=2))
    m.output("height", "y(b)")
    mod = m.compile(target=target)
    for method in ("DOP853", "RK23", "Radau", "BDF", "LSODA"):
        traj = mod.simulate(0.1, method=method, events=lambda t, x: t - 0.05, dense_output=True)
        assert traj.x.shape == (0, len(traj.t))
        assert traj.x_events[0].shape == (0, 1)
        assert traj.at([0.03, 0.04]).x.shape == (0, 2)
        np.testing.assert_array_equal(traj["height"], 2.0)
        assert traj.energy_drift == 0.0
