"""Trajectory: columns, tables, files, plots."""

import json
import pickle

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import UsageError
from eomgen.runtime import load_trajectory


@pytest.fixture
def traj(crank):
    def turn(t, x):
        return x[4]

    inputs = {"tau": lambda t, x: 0.01 * np.cos(t)}
    return crank().simulate(0.6, {"theta": 0.3, "theta_dot": 20.0}, inputs=inputs, events=turn)


def test_columns_and_their_meaning(traj):
    n = len(traj.t)
    for name in traj.names:
        assert traj[name].shape == (n,)
    np.testing.assert_array_equal(traj["theta"], traj.x[0])
    np.testing.assert_array_equal(traj["s_dot"], traj.x[5])
    np.testing.assert_allclose(traj["psi"], -traj["beta"], atol=1e-14)
    np.testing.assert_allclose(traj["psi_ddot"], -traj["beta_ddot"], atol=1e-9)
    np.testing.assert_allclose(traj["slider_acceleration"], traj["s_ddot"], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(traj["pin_x"], 0.153 * np.cos(traj["theta"]), atol=1e-14)
    np.testing.assert_allclose(traj["tau"], 0.01 * np.cos(traj.t))
    np.testing.assert_allclose(traj["T"] + traj["V"], traj["energy"])
    # work of the input equals the change of energy (trapezoidal rule over the steps)
    power = traj["tau"] * traj["theta_dot"]
    work = np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(traj.t))
    assert traj["energy"][-1] - traj["energy"][0] == pytest.approx(work, abs=2e-3)
    assert "theta" in traj
    assert "phi" not in traj
    assert list(traj)[:3] == ["theta", "beta", "s"]
    assert "0.6 s" in repr(traj)


def test_unknown_columns_suggest(traj):
    with pytest.raises(UsageError, match="did you mean theta_dot"):
        traj["theta_dott"]
    with pytest.raises(KeyError):
        traj["phi"]


def test_loop_angles_do_not_jump(crank, models):
    blocks = models.crank_blocks()

    def wrapped(t, x, u, c):
        return np.array([np.arctan2(np.sin(x[0]), np.cos(x[0])), x[3], x[6]])

    from eomgen.api.module import Module
    from eomgen.runtime import NumpyCore

    m = Module(NumpyCore(models.crank_metadata(), blocks | {"loop_coordinates": wrapped}))
    traj = m.simulate(0.6, {"theta": 0.3, "theta_dot": 40.0})
    assert traj["psi"][-1] > 7
    np.testing.assert_allclose(traj["psi"], traj["theta"], atol=1e-12)


def test_save_and_load_without_the_module(traj, tmp_path):
    path = traj.save(tmp_path / "run")
    assert path.name == "run.npz"
    again = load_trajectory(tmp_path / "run")
    assert again.names == traj.names
    for name in ("t", *traj.names):
        np.testing.assert_array_equal(again[name], traj[name])
    np.testing.assert_array_equal(again.x, traj.x)
    np.testing.assert_array_equal(again.t_events[0], traj.t_events[0])
    np.testing.assert_array_equal(again.x_events[0], traj.x_events[0])
    assert again.residuals == traj.residuals
    assert again.units == traj.units
    assert again.metadata["parameters"] == traj.metadata["parameters"]
    assert again.energy_drift == traj.energy_drift
    assert again.save(tmp_path / "twice.npz").exists()
    with pytest.raises(UsageError, match="dense_output"):
        again.at(0.1)


def test_files_that_are_none(tmp_path, traj):
    (tmp_path / "x.npz").write_bytes(b"nothing")
    with pytest.raises(UsageError, match="not a trajectory"):
        load_trajectory(tmp_path / "x.npz")
    np.savez(tmp_path / "y.npz", header=np.array(json.dumps({"format": "other"})))
    with pytest.raises(UsageError, match="not a trajectory .* no seal, which is another format"):
        load_trajectory(tmp_path / "y.npz")
    with pytest.raises(FileNotFoundError):
        load_trajectory(tmp_path / "none.npz")
    with pytest.raises(UsageError, match=r"\.npz or \.csv"):
        traj.save(tmp_path / "run.xls")


def test_csv(traj, tmp_path):
    path = traj.save(tmp_path / "run.csv")
    head, first = path.read_text().splitlines()[:2]
    assert head.startswith("t,theta,beta,s,theta_dot")
    assert [float(x) for x in first.split(",")][1] == 0.3


def test_tables(traj):
    frame = traj.to_pandas()
    assert list(frame.columns) == list(traj.names)
    assert frame.index.name == "t"
    np.testing.assert_array_equal(frame["s"], traj["s"])
    assert traj.to_numpy("s", "theta").shape == (2, len(traj.t))
    assert list(traj.to_pandas("s").columns) == ["s"]


def test_plots_carry_units(traj):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    ax = traj.plot("s")
    assert ax.get_ylabel() == "$s$ (m)"
    assert ax.get_xlabel() == "$t$ (s)"
    panels = traj.plot()
    assert [panel.get_ylabel() for panel in panels] == ["rad", "$s$ (m)"]
    _, own = plt.subplots()
    assert traj.plot("theta", "beta", ax=own) is own
    assert own.get_ylabel() == "rad"
    assert len(own.lines) == 2
    with pytest.raises(UsageError, match="did you mean theta"):
        traj.plot("thetta")
    plt.close("all")


def test_outputs_called_like_energies_come_first_and_the_balance_stays_right(crank, tmp_path):
    plain = crank().simulate(0.2, {"theta": 0.3, "theta_dot": 10.0})
    traj = crank(y_names=["T", "energy"]).simulate(0.2, {"theta": 0.3, "theta_dot": 10.0})
    np.testing.assert_array_equal(traj["T"], plain[plain.metadata["y_names"][0]])
    assert traj.energy_drift == plain.energy_drift
    np.testing.assert_array_equal(traj.energies, plain.energies)
    np.testing.assert_array_equal(traj["V"], plain["V"])
    again = load_trajectory(traj.save(tmp_path / "run.npz"))
    assert again.energy_drift == plain.energy_drift
    np.testing.assert_array_equal(again["T"], traj["T"])
    assert "T" not in traj.units


@pytest.fixture
def slider():
    def make(target):
        m = eg.Model("pushed")
        m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="y", coordinate="h")
        m.torque("push", "J", m.input("u"))
        return m.compile(target=target)

    return make


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("method", ["DOP853", "Radau", "LSODA"])
def test_a_run_without_dense_output_is_evaluated_anywhere(method: str, target: str) -> None:
    """It is made again; with a reset, an input that jumps and arguments that the user has changed since."""
    m = eg.Model("ball", gravity=(0, -9.81, 0))
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="y", coordinate="h")
    m.torque("push", "J", m.input("u"))
    m.event("floor", "h", direction=-1, reset={"h_dot": "-0.8*h_dot"})
    module = m.compile(target=target)
    initial, values = {"h": 1.0}, [0.0, 3.0]
    plain = {"method": method, "inputs": {"u": ([0.0, 1.0], values)}}
    run = module.simulate(1.0, initial, t_eval=[0, 1], **plain)
    full = module.simulate(1.0, initial, dense_output=True, **plain)
    initial["h"], values[1] = 5.0, 0.0
    times = np.linspace(0, 1, 33)
    np.testing.assert_array_equal(run.at(times).x, full.at(times).x)
    np.testing.assert_array_equal(run.at(0.7)["u"], full.at(0.7)["u"])
    with pytest.raises(eg.UsageError, match=r"0 \.\. 1 s"):
        run.at(1.1)
    with pytest.raises(eg.UsageError, match="cannot be made again"):
        pickle.loads(pickle.dumps(run)).at(0.5)


class Remembering:
    """An input with memory."""

    def __init__(self):
        self.calls = 0

    def __call__(self, t, x):
        self.calls += 1
        return 1e-3 * self.calls


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_a_run_that_cannot_be_made_again_is_refused(slider, target):
    module, push, runs = slider(target), {"gain": 1.0}, []
    for k in (1.0, 2.0, 3.0):
        runs.append(module.simulate(1.0, inputs={"u": lambda t, x: k}))  # noqa: B023
    runs.append(module.simulate(1.0, inputs={"u": Remembering()}))
    runs.append(module.simulate(1.0, inputs={"u": lambda t, x: push["gain"]}, t_eval=[0.5, 1.0]))
    push["gain"] = 2.0
    for run in (runs[0], runs[1], *runs[3:]):
        for _ in range(2):  # nothing of the other run is kept
            with pytest.raises(UsageError, match="give other values now"):
                run.at(0.5)
    assert runs[2].at(0.5)["h"] == pytest.approx(0.375, abs=1e-9)


@pytest.mark.parametrize("where", ["events", "inputs"])
def test_what_stops_a_run_made_again_comes_out(slider, where):
    """Ctrl-C and a function that fails, in compiled code and out of it; nothing of the unfinished run is kept."""
    module, stop = slider("cython"), [None]

    def one(t, x):
        if stop[0] is not None and t > 0.2:
            raise stop[0]
        return 1.0

    run = module.simulate(
        1.0, inputs={"u": one if where == "inputs" else 1.0}, events=one if where == "events" else None
    )
    for raised, seen in ((KeyboardInterrupt(), eg.SimulationInterrupted), (ZeroDivisionError(), ZeroDivisionError)):
        stop[0] = raised
        with pytest.raises(seen):
            run.at(0.5)
    stop[0] = None
    assert not run.has_dense_output
    assert run.at(0.9)["h"] == pytest.approx(0.405, abs=1e-6)
    assert run.has_dense_output


def test_a_run_made_again_keeps_to_the_limits(slider, monkeypatch):
    """A run may keep its steps, but not their polynomials, which take eight times as much."""
    run = slider("cython").simulate(1.0, max_step=2e-4)
    monkeypatch.setattr("eomgen.runtime.room.MOST_NUMBERS", 10**5)
    with pytest.raises(UsageError, match="would keep"):
        run.at(0.5)
