"""Results for other libraries: xarray Datasets, netCDF, Parquet, python-control."""

from __future__ import annotations

import json
from pathlib import Path

import control
import models
import numpy as np
import pandas as pd
import pytest
import xarray as xr

import eomgen as eg
from eomgen.errors import UsageError


@pytest.fixture(scope="module")
def ball() -> eg.Module:
    """A ball on a slide that bounces, with names that the tables would like to have themselves."""
    m = eg.Model("ball")
    m.parameter("k", 4.0, unit="N/m", doc="stiffness of the slide")
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="x", coordinate="s")
    m.torque("motor", "J", "-k*s + 0.3*sin(3*t)")
    m.torque("push", "J", m.input("f"))
    m.event("state", "s + 0.5", direction=-1, reset={"s_dot": "-0.8*s_dot"})
    m.event("top", "s_dot", direction=-1)
    m.output("run", "2*s", unit="mm", doc="twice the way")
    m.output("status", "s_dot")
    return m.compile(target="numpy")


def test_a_run_is_a_dataset(ball: eg.Module) -> None:
    traj = ball.simulate(6.0, initial={"s": 1.0})
    made = traj.to_xarray()
    assert dict(made.sizes)["t"] == len(traj.t)
    assert made.attrs["model"] == "ball"
    assert json.loads(made.attrs["metadata"])["method"] == traj.metadata["method"]
    for name in traj.names:
        assert np.array_equal(made[name], traj[name])
        assert made[name].dims == ("t",)
        assert made[name].attrs["units"] == traj.units.get(name, "")
    assert made["run"].attrs == {"units": "mm", "long_name": "twice the way"}
    assert len(traj.t_events["state"]) >= 2
    for name in ("state", "top"):
        assert np.array_equal(made[f"t_events_{name}"], traj.t_events[name])
        states = made[f"x_events_{name}"]
        assert np.array_equal(states.sel(state="s_dot"), traj.x_events[name][1])


def test_files_are_read_by_their_libraries(ball: eg.Module, tmp_path: Path) -> None:
    traj = ball.simulate(3.0, initial={"s": 1.0})
    assert traj.save(tmp_path / "run.nc") == tmp_path / "run.nc"
    with xr.open_dataset(tmp_path / "run.nc") as read:
        assert read.load().identical(traj.to_xarray()) or read.equals(traj.to_xarray())
        assert read["s_ddot"].attrs["units"] == "m/s^2"
        assert json.loads(read.attrs["metadata"]) == traj.metadata
    traj.save(tmp_path / "run.parquet")
    table = pd.read_parquet(tmp_path / "run.parquet")
    pd.testing.assert_frame_equal(table, traj.to_pandas())
    assert table.attrs["units"]["run"] == "mm"
    assert json.loads(table.attrs["metadata"]) == traj.metadata
    for name in ("run.nc", "run.parquet"):
        with pytest.raises(UsageError, match="is for other programs; load the .npz of the run"):
            eg.load_trajectory(tmp_path / name)
    with pytest.raises(UsageError, match=r"\.npz or \.csv or \.nc or \.parquet, not '\.xls'"):
        traj.save(tmp_path / "run.xls")


def test_runs_with_two_states_at_a_time_and_motions_of_drivers(tmp_path: Path) -> None:
    m = eg.Model("stone")
    m.gravity = (0, 0, -9.81)
    m.prismatic("J", m.ground, m.body("stone", mass=1.0), axis="z", coordinate="h")
    m.output("gap", "h")
    run = m.compile(target="numpy").simulate_impacts(1.5, {"gap": 0.7}, {"h": 1.0})
    made = run.to_xarray()
    assert made["h_dot"].size == run.t.size > np.unique(run.t).size
    run.save(tmp_path / "run.nc")
    with xr.open_dataset(tmp_path / "run.nc") as read:
        assert np.array_equal(read["h_dot"], run["h_dot"])
    m = models.build("slider_crank")
    m.driver("turning", "A", "0.3 + 2*t")
    m.independent = []
    motion = m.compile(target="numpy").kinematic_analysis(np.linspace(0.0, 1.0, 7))
    made = motion.to_xarray()
    assert np.allclose(made["theta"], 0.3 + 2.0 * made["t"], rtol=1e-14)
    assert np.array_equal(made["pin_x"], motion["pin_x"])


def test_many_runs_are_one_dataset(ball: eg.Module) -> None:
    starts, times = np.array([0.1, 0.2, 0.4]), [0.5, 1.0]
    ensemble = ball.simulate_many(1.0, {"s": starts}, {"k": [3.0, 4.0, 5.0]}, t_eval=times)
    made = ensemble.to_xarray()
    # the outputs `run` and `status` keep their names
    assert made["s"].dims == ("run_", "t")
    assert made["run"].attrs["units"] == "mm"
    assert np.array_equal(made["s"], ensemble["s"].T)
    assert np.array_equal(made["initial_s"], starts)
    assert made["k"].attrs == {"units": "N/m", "long_name": "stiffness of the slide"}
    assert np.array_equal(made["status_"], ensemble.status)
    assert np.array_equal(made["t"], times)
    ends = ball.simulate_many(1.0, {"s": starts}).to_xarray()
    assert ends["s"].dims == ("run_",)
    assert np.array_equal(ends["s"], ball.simulate_many(1.0, {"s": starts})["s"])


def test_a_grid_has_its_own_dimensions(ball: eg.Module, tmp_path: Path) -> None:
    """Every place holds the run of its coordinates."""
    grid = {"k": (3.0, 5.0, 3), "s": [0.1, 0.3], "f": [0.0, 1.0]}
    made = ball.simulate_many(1.0, grid=grid, t_eval=[0.4, 1.0]).to_xarray()
    assert made["s"].dims == ("k", "initial_s", "f", "t")
    one = made.sel(k=4.0, initial_s=0.3, f=1.0)
    alone = ball.simulate(1.0, initial={"s": 0.3}, parameters={"k": 4.0}, inputs={"f": 1.0}, t_eval=[0.4, 1.0])
    assert np.allclose(one["s"], alone["s"], rtol=1e-8, atol=1e-10)
    assert np.allclose(one["run"], 2000.0 * alone["s"], rtol=1e-8)
    made.to_netcdf(tmp_path / "grid.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "grid.nc") as read:
        assert read.equals(made)


def test_statistics_are_a_dataset_and_other_reductions_are_refused(ball: eg.Module) -> None:
    starts = np.linspace(0.1, 0.4, 9)
    made = ball.simulate_many(1.0, {"s": starts}, t_eval=[0.5, 1.0], reduce="statistics").to_xarray()
    whole = ball.simulate_many(1.0, {"s": starts}, t_eval=[0.5, 1.0])
    assert np.allclose(made["s"].sel(statistic="mean"), whole["s"].mean(axis=1), rtol=1e-12)
    assert np.allclose(made["s"].sel(statistic="variance"), whole["s"].var(axis=1, ddof=1), rtol=1e-9)
    assert (made["s"].sel(statistic="count") == 9).all()
    with pytest.raises(UsageError, match="kept only the results of its reduction"):
        ball.simulate_many(1.0, {"s": starts}, reduce="events").to_xarray()


def test_runs_of_a_model_without_parameters_and_with_a_column_of_the_dimensions_name(tmp_path: Path) -> None:
    m = eg.Model("bare")
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="x", coordinate="s")
    m.output("statistic", "2*s")
    bare = m.compile(target="numpy")
    starts = {"s": np.linspace(-1.0, 1.0, 5), "s_dot": 0.5}
    runs = bare.simulate_many((0, 1), starts, t_eval=[0.0, 1.0])
    assert np.allclose(runs.to_xarray()["s"][:, 1], starts["s"] + 0.5, atol=1e-8)
    assert runs.save(tmp_path / "bare.npz").exists()
    told = bare.simulate_many((0, 1), starts, t_eval=[0.0, 1.0], reduce="statistics").to_xarray()
    assert np.allclose(told["statistic"].sel(statistic_="mean"), [0.0, 1.0], atol=1e-8)


def test_a_linearization_is_a_system_of_python_control() -> None:
    """Names; poles against eigenvalues; a step response against the run of the nonlinear module."""
    m = models.build("furuta_pendulum")
    mod = m.compile(target="numpy")
    linear = mod.linearize(np.zeros(mod.n_x))
    assert linear.is_equilibrium
    system = linear.ss()
    assert system.state_labels == list(linear.states)
    assert system.input_labels == list(linear.inputs)
    assert system.output_labels == list(linear.outputs)
    assert np.allclose(np.sort_complex(system.poles()), np.sort_complex(linear.eigenvalues), atol=1e-9)
    times = np.linspace(0.0, 0.3, 31)
    small = 1e-5
    response = control.step_response(system, times, input=0, squeeze=False)
    run = mod.simulate(
        0.3, initial=np.zeros(mod.n_x), inputs={mod.u_names[0]: small}, t_eval=times, rtol=1e-11, atol=1e-14
    )
    for k, name in enumerate(linear.states):
        assert np.allclose(response.states[k, 0], (run[name] - run[name][0]) / small, atol=2e-4)
