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
