"""Trajectories: columns, values at any time, copies, where they come from; modules sent to other processes."""

import copy
import json
import pickle
import platform
import subprocess
import sys
from pathlib import Path

import models
import numpy as np
import pytest
from analysed import compiled
from refusals import refuses
from sweeps import TARGETS

import eomgen as eg


def turn(t: float, x: np.ndarray) -> float:
    return float(x[4])


@pytest.fixture(scope="module")
def crank() -> eg.Module:
    return models.build("slider_crank").compile(target="numpy")


@pytest.fixture(scope="module")
def traj(crank: eg.Module) -> eg.Trajectory:
    return crank.simulate(0.6, {"theta_dot": 20.0}, inputs={"tau": lambda t, x: 0.01 * np.cos(t)}, events=turn)


def test_columns_and_their_meaning(traj: eg.Trajectory) -> None:
    for name in traj.names:
        assert traj[name].shape == traj.t.shape
    np.testing.assert_array_equal(traj["theta"], traj.x[0])
    np.testing.assert_array_equal(traj["s_dot"], traj.x[5])
    np.testing.assert_allclose(traj["C"], -traj["theta"] - traj["B"], atol=1e-13)
    np.testing.assert_allclose(traj["C_ddot"], -traj["theta_ddot"] - traj["B_ddot"], rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(traj["pin_x"], 0.1 * np.cos(traj["theta"]) + 0.35 * np.cos(traj["C"]), atol=1e-13)
    np.testing.assert_allclose(traj["speed"], traj["s_dot"], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(traj["tau"], 0.01 * np.cos(traj.t))
    np.testing.assert_allclose(traj["T"] + traj["V"], traj["energy"])
    power = traj["tau"] * traj["theta_dot"]  # its work is the change of energy, by the trapezoidal rule over the steps
    work = np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(traj.t))
    assert traj["energy"][-1] - traj["energy"][0] == pytest.approx(work, abs=2e-3)
    assert "theta" in traj
    assert "phi" not in traj
    assert list(traj)[:3] == ["theta", "B", "s"]
    assert "0.6 s" in repr(traj)
    refuses("EG-NAME-UNKNOWN 'theta_dott' theta_dot", traj.__getitem__, "theta_dott")
    with pytest.raises(KeyError):
        traj["phi"]


def test_parameters_of_a_cut_ball_do_not_jump() -> None:
    """A door on a hinge and a ball, whose Euler parameters are those of half the angle, over two turns."""
    m = eg.Model("door")
    door = m.body("door", mass=1.0, inertia=(1, 1, 1))
    m.revolute("hinge", m.ground, door, axis="z", coordinate="theta")
    m.spherical("ball", m.ground.at(0, 0, 1), door.at(0, 0, 1), rotation="euler_parameters")
    times = np.linspace(0.0, 4.0, 81)
    run = m.compile(target="numpy").simulate(4.0, initial={"theta_dot": np.pi}, t_eval=times)
    e = run["ball_e0"] + 1j * run["ball_e3"]
    np.testing.assert_allclose(e, e[0] * np.exp(0.5j * np.pi * times), atol=1e-9)


def test_saved_and_loaded_without_the_module(traj: eg.Trajectory, tmp_path: Path) -> None:
    path = traj.save(tmp_path / "run")
    assert path.name == "run.npz"
    again = eg.load_trajectory(tmp_path / "run")
    sent = pickle.loads(pickle.dumps(traj))
    for other in (again, sent):
        assert other.names == traj.names
        for name in ("t", *traj.names):
            np.testing.assert_array_equal(other[name], traj[name])
        np.testing.assert_array_equal(other.x, traj.x)
        np.testing.assert_array_equal(other.t_events[0], traj.t_events[0])
        np.testing.assert_array_equal(other.x_events[0], traj.x_events[0])
        assert other.residuals == traj.residuals
        assert other.units == traj.units
        assert other.metadata["parameters"] == traj.metadata["parameters"]
        assert other.energy_drift == traj.energy_drift
    assert len(traj.t_events[0]) == 1
    assert again.save(tmp_path / "twice.npz").exists()
    refuses("EG-UNSUPPORTED dense_output=True", again.at, 0.1)
    head, first = traj.save(tmp_path / "run.csv").read_text().splitlines()[:2]
    assert head.startswith("t,theta,B,s,theta_dot")
    assert [float(x) for x in first.split(",")][1] == 0.3
    frame = traj.to_pandas()
    assert list(frame.columns) == list(traj.names)
    assert frame.index.name == "t"
    np.testing.assert_array_equal(frame["s"], traj["s"])
    assert traj.to_numpy("s", "theta").shape == (2, len(traj.t))


def test_outputs_called_like_energies_come_first_and_the_balance_stays_right(tmp_path: Path) -> None:
    runs = []
    for names in (("T", "energy"), ("rate", "angle")):
        m = models.build("slider_crank")
        m.output(names[0], "theta_dot"), m.output(names[1], "theta")
        runs.append(m.compile(target="numpy").simulate(0.2))
    run, plain = runs
    np.testing.assert_array_equal(run["T"], plain["rate"])
    assert run.energy_drift == plain.energy_drift
    np.testing.assert_array_equal(run.energies, plain.energies)
    np.testing.assert_array_equal(run["V"], plain["V"])
    again = eg.load_trajectory(run.save(tmp_path / "run.npz"))
    assert again.energy_drift == plain.energy_drift
    np.testing.assert_array_equal(again["T"], run["T"])


@pytest.mark.parametrize(("method", "target"), [("DOP853", "cython"), ("Radau", "cython"), ("LSODA", "numpy")])
def test_a_run_without_dense_output_is_evaluated_anywhere(method: str, target: str) -> None:
    """It is made again; with a reset, an input that jumps and arguments that the user has changed since."""
    module = compiled("hopper", target).bind({"e": 0.8})
    initial, values = {"h": 1.0}, [0.0, 3.0]
    plain = {"method": method, "inputs": {"u": ([0.0, 1.0], values)}}
    run = module.simulate(1.0, initial, t_eval=[0, 1], **plain)
    full = module.simulate(1.0, initial, dense_output=True, **plain)
    initial["h"], values[1] = 5.0, 0.0
    times = np.linspace(0, 1, 33)
    np.testing.assert_array_equal(run.at(times).x, full.at(times).x)
    np.testing.assert_array_equal(run.at(0.7)["u"], full.at(0.7)["u"])
    refuses("EG-RANGE 0 1", run.at, 1.1)
    refuses("EG-UNSUPPORTED copied", pickle.loads(pickle.dumps(run)).at, 0.5)


class Remembering:
    """An input with memory."""

    def __init__(self):
        self.calls = 0

    def __call__(self, t, x):
        self.calls += 1
        return 1e-9 * self.calls


def test_the_drift_of_the_energy_is_what_drag_takes():
    """E = exp(-2 c t) / 2 of a mass of 1 kg at 1 m/s, in parts of the largest T."""
    run = compiled("oscillator").bind({"c": 0.7}).simulate(2.0, {"s_dot": 1.0}, rtol=1e-10, atol=1e-12)
    assert run.energy_drift == pytest.approx(1.0 - np.exp(-2 * 0.7 * 2.0), rel=1e-8)


@pytest.mark.parametrize("target", TARGETS)
def test_a_run_that_cannot_be_made_again_is_refused(target):
    module, push, runs = compiled("oscillator", target), {"gain": 1.0}, []
    for k in (1.0, 2.0, 3.0):
        runs.append(module.simulate(1.0, inputs={"F": lambda t, x: k}))  # noqa: B023
    runs.append(module.simulate(1.0, inputs={"F": Remembering()}))
    runs.append(module.simulate(1.0, inputs={"F": lambda t, x: push["gain"]}, t_eval=[0.5, 1.0]))
    push["gain"] = 2.0
    for run in (runs[0], runs[1], *runs[3:]):
        for _ in range(2):  # nothing of the other run is kept
            refuses("EG-UNSUPPORTED inputs dense_output=True", run.at, 0.5)
    assert runs[2].at(0.5)["s"] == pytest.approx(0.375, abs=1e-9)


@pytest.mark.parametrize("where", ["events", "inputs"])
def test_what_stops_a_run_made_again_comes_out(where):
    """Ctrl-C and a function that fails, in compiled code and out of it; nothing of the unfinished run is kept."""
    module, stop = compiled("oscillator", "cython"), [None]

    def one(t, x):
        if stop[0] is not None and t > 0.2:
            raise stop[0]
        return 1.0

    run = module.simulate(
        1.0, inputs={"F": one if where == "inputs" else 1.0}, events=one if where == "events" else None
    )
    for raised, seen in ((KeyboardInterrupt(), eg.SimulationInterrupted), (ZeroDivisionError(), ZeroDivisionError)):
        stop[0] = raised
        with pytest.raises(seen):
            run.at(0.5)
    stop[0] = None
    assert not run.has_dense_output
    assert run.at(0.9)["s"] == pytest.approx(0.405, abs=1e-6)
    assert run.has_dense_output


#: What another process does with a pickle: it prints a state's derivative, without SymPy or the model.
READER = """
import pickle, sys
from pathlib import Path
module = pickle.loads(Path(sys.argv[1]).read_bytes())
assert "sympy" not in sys.modules
print([value.hex() for value in module.rhs(0.5, module.x0(theta=0.4)).tolist()])
"""


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_module_goes_to_another_process_with_its_values(tmp_path: Path, target: str) -> None:
    module = compiled("slider_crank", target).bind({"r": 0.12}, {"tau": 0.5})
    file = tmp_path / "module.pickle"
    file.write_bytes(pickle.dumps(module))
    assert file.stat().st_size < 2000
    said = subprocess.run([sys.executable, "-c", READER, str(file)], check=True, capture_output=True, text=True).stdout
    expected = [value.hex() for value in module.rhs(0.5, module.x0(theta=0.4)).tolist()]
    assert said.strip() == str(expected)  # to the last bit
    for again in (pickle.loads(pickle.dumps(module)), copy.deepcopy(module)):
        assert again is not module
        np.testing.assert_array_equal(again.p, module.p)
        np.testing.assert_array_equal(again.rhs(0.5, module.x0()), module.rhs(0.5, module.x0()))


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_run_and_its_file_say_where_they_come_from(target: str, tmp_path: Path) -> None:
    module = compiled("slider_crank", target)
    inputs = {"tau": ([0.0, 1.0], [0.0, 0.1])}
    run, again = (module.simulate(0.2, parameters={"r": 0.11}, inputs=inputs, rtol=1e-6) for _ in range(2))
    facts = eg.load_trajectory(run.save(tmp_path / "a.npz")).metadata
    assert facts == json.loads(json.dumps(run.metadata))
    assert facts["origin"]["model_digest"] == module.metadata["model_digest"]
    assert facts["origin"]["target"] == target
    versions = facts["origin"]["versions"]
    assert (versions["eomgen"], versions["python"]) == (eg.__version__, platform.python_version())
    assert versions["numpy"] == np.__version__
    assert (versions["compiler"] is None) == (target == "numpy")
    assert facts["parameters"]["r"] == 0.11
    assert facts["options"]["rtol"] == 1e-6
    assert facts["inputs"]["tau"] == {
        "interpolation": "linear", "corners": True, "times": [0.0, 1.0], "values": [0.0, 0.1],
    }  # fmt: skip
    assert again.save(tmp_path / "b.npz").read_bytes() == (tmp_path / "a.npz").read_bytes()
    many = module.simulate_many(0.1, {"theta": [0.1, 0.2]}, inputs=inputs)
    with np.load(many.save(tmp_path / "many.npz")) as data:
        header = json.loads(str(data["header"]))
    assert header == json.loads(json.dumps(many.metadata))
    assert header["origin"] == facts["origin"]
    assert header["inputs"] == facts["inputs"]
    assert header["count"] == 2


@pytest.mark.parametrize("times", [[0.0, 1.0, 2.0], [2.0]])
def test_a_cut_joint_counts_its_turns_along_the_run_whatever_is_stored(times: list[float]) -> None:
    m = eg.Model("turning")
    crank, rod, slider = (m.body(name, mass=1, inertia={"zz": 0.1}) for name in ("crank", "rod", "slider"))
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.prismatic("S", m.ground, slider, axis="x", coordinate="s")
    m.revolute("C", slider, rod.at(0.6, 0, 0), coordinate="c")
    m.revolute("P", crank.at(0.2, 0, 0), rod)
    m.independent("theta")
    m.initial(theta=0.3, theta_dot=10)
    m.guess(c=-0.1)
    module = m.compile(target="numpy")
    run = module.simulate(2.0, t_eval=times)
    whole = module.simulate(2.0, dense_output=True)
    assert run["P"][-1] == pytest.approx(whole["P"][-1], abs=1e-7)
    assert whole.at(times)["P"] == pytest.approx(run["P"], abs=1e-7)
    assert run["P"][-1] == pytest.approx(run["c"][-1] - run["theta"][-1], abs=1e-9)  # both ends turn about z
    for to in (20.0, -20.0):
        led = module.kinematic_analysis(theta=[0.3, to])
        assert led["P"] - led["P"][0] == pytest.approx(led["c"] - led["c"][0] - (led["theta"] - 0.3), abs=1e-9)
