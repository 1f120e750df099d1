"""Functional mock-up units of models with contacts between groups, by FMPy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu

import eomgen as eg
from eomgen.fmu import write_fmu
from eomgen.pipeline import derive


def test_co_simulation_passes_over_no_contact(tmp_path: Path) -> None:
    """A ball comes back from a thin wall, though the master's step is longer than the contact."""
    m = eg.Model("thin", gravity=(0, 0, 0))
    ball = m.body("ball", mass=1.0, inertia={"zz": 0.004})
    m.planar("j", m.ground, ball)
    wall = {"shape": "segment", "on": m.ground.at(2, 0, 0, rpy=(0, 0, np.pi / 2)), "length": 3.0}
    m.contacts("wall", {"shape": "circle", "on": ball, "radius": 0.05}, wall, {"stiffness": 1e6})
    m.initial(j_x_dot=20.0)
    path = write_fmu(derive(m, "auto"), tmp_path / "thin.fmu")
    names = ["j_x", "j_x_dot"]
    run = simulate_fmu(str(path), fmi_type="CoSimulation", stop_time=0.3, output_interval=0.15, output=names)
    assert run["j_x_dot"][-1] == pytest.approx(-20.0, rel=1e-5)
    assert np.max(run["j_x"]) < 2.0


def test_states_of_pairs_are_states_of_a_unit(tmp_path: Path) -> None:
    """A sled on sand as a unit for co-simulation goes as the module does, its sinkage and shear among the variables."""
    m = eg.Model("sled", gravity=(0, -9.81, 0))
    body = m.body("sole", mass=400.0, inertia={"zz": 30.0})
    m.planar("j", m.ground, body)
    shape = {"shape": "plate", "on": body, "length": 1.0, "width": 0.3}
    law = {"soil": "dry_sand", "dissipation": 1.0, "lateral": False}
    m.contacts("sand", shape, {"shape": "half_plane", "on": m.ground}, law)
    m.initial(j_x_dot=1.0, j_y=-0.001)
    path = write_fmu(derive(m, "auto"), tmp_path / "sled.fmu")
    names = ["j_x", "sand_shear_1", "sand_sinkage_2"]
    run = simulate_fmu(str(path), fmi_type="CoSimulation", stop_time=0.2, output_interval=0.01, output=names)
    traj = m.compile().simulate(0.2)
    for name in names:
        assert run[name][-1] == pytest.approx(traj[name][-1], rel=1e-4)
    assert traj["sand_sinkage_2"][-1] > 1e-3
