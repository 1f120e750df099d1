"""Trajectories and runs: columns, values, copies, origin; published motions, methods beside SciPy's; runs that stop."""

import copy
import json
import os
import pickle
import platform
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from analysed import compiled
from refusals import refused, refuses
from scipy.integrate import DOP853, RK45, quad, solve_ivp
from sweeps import TARGETS, part_of

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


# -- runs --------------------------------------------------------------------------------------------------------------
METHODS = ["RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"]


@pytest.fixture(scope="module")
def free_crank() -> eg.Module:
    """The rigid slider-crank of Flores, Leine and Glocker: its parameters, motions and accelerations are published."""
    return models.build("free_slider_crank").compile(target="numpy")


@pytest.fixture(scope="module")
def swing() -> eg.Module:
    """A pendulum of 2 kg m^2 with a torque: theta'' = (tau - m g l sin(theta)) / (m l^2)."""
    m = eg.Model("swing", gravity=(0, "-g", 0))
    m.parameter("g", 9.81), m.parameter("m", 2.0), m.parameter("l", 1.0)
    m.revolute("J", m.ground, m.body("bob", mass="m", com=(0, "-l", 0)), coordinate="theta")
    m.torque("motor", "J", m.input("tau"))
    m.initial(theta=0.5)
    return m.compile(target="numpy")


@pytest.mark.parametrize("target", TARGETS)
def test_the_published_motion(free_crank: eg.Module, target: str) -> None:
    """Reference: planar_slider_crank_dynamics.json (multiplier form in 30 digits against a closed form)."""
    data = models.reference("planar_slider_crank_dynamics")["reference"]
    mod = free_crank if target == "numpy" else compiled("free_slider_crank", "cython")
    run = mod.simulate((0, 1), t_eval=[0.1, 0.5, 1.0], rtol=1e-10, atol=1e-12)
    for j, row in enumerate(data["omega10"]["values"].values()):
        for ours, theirs in {"theta": "theta", "beta": "beta", "x": "x", "x_dot": "xdot"}.items():
            assert run[ours][j] == pytest.approx(float(row[theirs]), abs=2e-9)
    assert run.residuals.raw_position < 1e-9
    assert run.residuals.position < 1e-13
    assert run.residuals.velocity < 1e-12
    assert 0 < run.residuals.correction_velocity < 1e-8
    assert run.energy_drift < 1e-10
    fast = mod.rhs(0.0, mod.x0(theta=0.0, theta_dot=150.0))[3:]
    expected = [float(a) for a in data["omega150"]["initial_acc"]]  # of theta, beta = theta + bend, x
    np.testing.assert_allclose([fast[0], fast[0] + fast[1], fast[2]], expected, rtol=1e-12, atol=1e-10)


@pytest.mark.parametrize("target", TARGETS)
def test_every_method_comes_to_the_same(free_crank: eg.Module, target: str) -> None:
    mod = free_crank if target == "numpy" else compiled("free_slider_crank", "cython")
    exact = mod.simulate(0.3, rtol=1e-11, atol=1e-12).x[:, -1]
    for method in METHODS:
        rtol = 1e-4 if method == "RK23" else 1e-6
        run = mod.simulate(0.3, method=method, rtol=rtol, atol=rtol / 100)
        assert run.t[-1] == 0.3
        np.testing.assert_allclose(run.x[:, -1], exact, atol=100 * rtol, err_msg=method)
        assert (run.njev > 0) == (method in ("Radau", "BDF")) or method == "LSODA"
        assert np.abs(mod.constraints(run.x[:3])).max() < 1e-13


def test_plain_scipy_and_solver_classes(free_crank: eg.Module) -> None:
    x0 = free_crank.x0()
    sol = solve_ivp(free_crank.rhs, (0, 0.2), x0, method="DOP853", rtol=1e-8, atol=1e-10)
    run = free_crank.simulate((0, 0.2), method=DOP853)
    np.testing.assert_array_equal(run.t, sol.t)
    np.testing.assert_allclose(run.x, sol.y, atol=1e-8)
    assert type(free_crank.DOP853(free_crank.rhs, 0.0, x0, 1.0)) is free_crank.bind({"g": 9.0}).DOP853
    for method in ("DOP853", "RK45", "RK23", "Radau"):
        ours = solve_ivp(free_crank.rhs, (0.0, 0.5), x0, method=getattr(free_crank, method), rtol=1e-6)
        slope = {"jac": free_crank.jacobian} if method == "Radau" else {}
        theirs = solve_ivp(free_crank.rhs, (0.0, 0.5), x0, method=method, rtol=1e-6, **slope)
        np.testing.assert_allclose(ours.t, theirs.t, rtol=1e-4 if method == "Radau" else 1e-6, err_msg=method)
        np.testing.assert_allclose(ours.y, theirs.y, atol=1e-6)


@pytest.mark.parametrize("target", TARGETS)
def test_values_between_the_steps(free_crank: eg.Module, target: str) -> None:
    mod = free_crank if target == "numpy" else compiled("free_slider_crank", "cython")
    run, times = mod.simulate(0.4, dense_output=True), np.linspace(0, 0.4, 33)
    exact, there = mod.simulate(0.4, t_eval=times, rtol=1e-12, atol=1e-13), run.at(times)
    np.testing.assert_allclose(there["theta"], exact["theta"], atol=1e-7)
    np.testing.assert_allclose(there["x_ddot"], exact["x_ddot"], atol=1e-4)
    assert there.residuals.position < 1e-13
    assert run.at(0.1)["theta"].shape == (1,)
    refuses("EG-RANGE 0 0.4", run.at, 0.5)
    plain, kept = (mod.simulate(0.1, dense_output=keep) for keep in (False, True))
    np.testing.assert_array_equal(plain.at(0.05).x, kept.at(0.05).x)


def test_events_are_projected_and_counted_across_corners() -> None:
    driven = models.build("slider_crank").compile(target="numpy")

    def turn(t: float, x: np.ndarray) -> float:
        return float(x[4])

    turn.terminal = 2  # type: ignore[attr-defined]
    inputs = {"tau": ([0.0, 0.05, 0.1, 0.2], [0.0, 0.01, -0.01, 0.0])}
    run = driven.simulate(3.0, inputs=inputs, events=turn)
    assert (run.status, len(run.t_events[0])) == (1, 2)
    assert np.abs(driven.constraints(run.x_events[0][:3])).max() < 1e-13


#: Options of a run of 1 s and what is said of them; those of every method first.
TOLERANCES: list[tuple[dict[str, Any], str]] = [
    ({"rtol": -1}, "EG-RANGE rtol -1"),
    ({"atol": float("nan")}, "EG-RANGE atol"),
    ({"atol": "small"}, "EG-NUMBER small"),
    ({"atol": [1e-9]}, "EG-SHAPE (2,)"),
    ({"max_step": -1}, "EG-RANGE max_step 0 -1"),
    ({"max_step": "long"}, "EG-NUMBER long max_step"),
    ({"first_step": 0}, "EG-RANGE first_step 0"),
    ({"first_step": 2}, "EG-RANGE first_step 1 2"),
]
OPTIONS: list[tuple[dict[str, Any], str]] = [
    ({"method": "RK54"}, "EG-NAME-UNKNOWN RK45?"),
    ({"method": "taylor"}, "EG-NAME-UNKNOWN Taylor"),
    ({"method": 3}, "EG-CHOICE OdeSolver"),
    ({"method": "RK4"}, "EG-MISSING RK4 step="),
    ({"method": "RK4", "step": "fine"}, "EG-NUMBER fine"),
    ({"method": "RK4", "step": -0.1}, "EG-RANGE step -0.1"),
    ({"method": "LSODA", "min_step": -1}, "EG-RANGE min_step"),
    ({"min_step": 1e-3}, "EG-NAME-UNKNOWN min_step"),
    ({"rtoll": 1e-3}, "EG-NAME-UNKNOWN rtoll"),
    ({"span": (0, 1, 2)}, "EG-TYPE span"),
    ({"span": ("now", "then")}, "EG-NUMBER span"),
    ({"t_eval": [0.5, 0.2]}, "EG-RANGE t_eval"),
    ({"t_eval": [0.5, 20.0]}, "EG-RANGE t_eval"),
    ({"t_eval": [0, "end"]}, "EG-NUMBER end t_eval"),
    ({"initial": np.zeros(3)}, "EG-SHAPE (2,) theta_dot"),
    ({"initial": {"thetta": 1.0}}, "EG-NAME-UNKNOWN theta"),
    ({"parameters": {"q": 1.0}}, "EG-NAME-UNKNOWN q"),
    ({"events": 3}, "EG-TYPE expression"),
    ({"events": {"low": {"expression": "theta", "terminal": "once"}}}, "EG-RANGE once"),
    ({"dense_output": 1}, "EG-TYPE dense_output"),
]


def test_wrong_options_are_reported(swing: eg.Module) -> None:
    for options, words in [
        *OPTIONS,
        *(({"method": m, **given}, words) for m in METHODS for given, words in TOLERANCES),
    ]:
        for _ in range(2):  # what was found for a run before is no excuse
            refuses(words, swing.simulate, **({"span": 1.0} | options))

    class Mine(DOP853):
        def __init__(self, *args: Any, anything: Any = None, **options: Any) -> None:
            assert anything == 3
            super().__init__(*args, **options)

    assert swing.simulate(0.1, method=Mine, anything=3).t[-1] == 0.1
    with pytest.raises(ValueError, match="must be positive"):  # said by SciPy itself
        swing.simulate(1.0, method=type("Own", (RK45,), {}), max_step=0.0)


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
def test_an_rtol_below_rounding_is_raised_without_a_warning(swing: eg.Module, method: str) -> None:
    run = swing.simulate(0.05, {"theta": 0.1}, method=method, rtol=1e-20, atol=1e-8)
    assert run.metadata["rtol"] == 100 * np.finfo(float).eps


@pytest.fixture(scope="module", params=TARGETS)
def rooted(request: pytest.FixtureRequest) -> eg.Module:
    """A force that is no number for x above 1 m."""
    m = eg.Model("rooted")
    m.prismatic("J", m.ground, m.body("cart", mass=1), axis="x", coordinate="x")
    m.torque("pull", "J", "-sqrt(1 - x) - 8*x")
    return m.compile(target=request.param)


@pytest.mark.parametrize("method", METHODS)
def test_a_failure_on_the_way_becomes_a_simulation_error_with_its_cause(rooted: eg.Module, method: str) -> None:
    with refused(f"EG-STALLED {method} near") as caught:
        rooted.simulate(3.0, {"x": 0.0, "x_dot": 6.0}, method=method)
    assert isinstance(caught.value.__cause__, eg.EvaluationError)
    assert 0.1 < caught.value.__cause__.time < 0.3


def test_a_passing_failure_only_shortens_the_step(rooted: eg.Module) -> None:
    run = rooted.simulate(3.0, {"x": 0.9, "x_dot": 0.9}, rtol=1e-3, atol=1e-6, first_step=2.5)
    assert run.t[-1] == 3.0
    assert np.diff(run.t)[0] < 1.0


def test_a_failure_at_the_start_is_no_simulation_error(swing: eg.Module, rooted: eg.Module) -> None:
    refuses("EG-SINGULAR theta", swing.simulate, 1.0, parameters={"m": 0.0})
    with pytest.raises(eg.NonFiniteError):
        rooted.simulate(1.0, {"x": 2.0})


def test_progress_goes_to_stderr_only_when_requested(swing: eg.Module, capsys: pytest.CaptureFixture[str]) -> None:
    swing.simulate(20.0, {"theta": 2.0}, rtol=1e-11, atol=1e-12, progress=True)
    shown = capsys.readouterr()
    assert (shown.out, bool(shown.err)) == ("", True)
    swing.simulate(1.0)
    assert capsys.readouterr().err == ""


def test_without_scipy_the_message_says_what_to_install() -> None:
    code = (
        "import sys; sys.modules['scipy'] = None; sys.modules['scipy.integrate'] = None\n"
        "import eomgen as eg\n"
        "m = eg.load_example('slider_crank').compile(target='numpy'); m.x0(); m.kinematics([1.0])\n"
        "m.simulate(0.1)\n"
        "try:\n    m.simulate(1.0, method='LSODA')\n"
        "except eg.MissingDependencyError as error:\n    assert 'pip install scipy' in str(error)\n"
        "else:\n    raise SystemExit('no error')\n"
        "try:\n    m.sensitivities(['r'], 0.1)\n"
        "except eg.MissingDependencyError as error:\n    assert 'sensitivities needs scipy' in str(error)\n"
        "else:\n    raise SystemExit('no error')\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# -- runs do not share what they were given --------------------------------------------------------------------------
@pytest.fixture(scope="module")
def module() -> eg.Module:
    return compiled("slider_crank", "cython")


@pytest.mark.parametrize("options", [{}, {"method": "RK45"}, {"rtol": 1e-5}, {"atol": 1e-6, "method": "Radau"}])
def test_runs_are_the_same_however_their_arguments_are_given(module: eg.Module, options: dict[str, Any]) -> None:
    """Events of none, a limit that limits nothing, a module bound anew: what is found once is what each would find."""
    first = module.bind({}).simulate(0.3, **options)
    module.simulate(0.3, **options)
    ways: list[dict[str, Any]] = [{}, {"events": []}, {"max_step": np.inf}, {"inputs": {}}, {"parameters": {}}]
    for way in ways:
        run = module.simulate(0.3, **options, **way)
        assert np.array_equal(run.t, first.t)
        assert np.array_equal(run.x, first.x)
        assert run.residuals == first.residuals
        for key in ("method", "rtol", "atol", "span", "nfev", "status", "parameters", "inputs"):
            assert run.metadata[key] == first.metadata[key], key


def test_runs_with_parameters_are_those_of_the_bound_module_and_leave_others(module: eg.Module) -> None:
    first, changed = module.simulate(0.2), {"r": 0.11}
    one, other = module.simulate(0.2, parameters=changed), module.bind(changed).simulate(0.2)
    assert np.array_equal(one.x, other.x)
    assert not np.array_equal(one.x[:, -1], first.x[:, -1])
    assert one.metadata["parameters"]["r"] == 0.11
    again = module.simulate(0.2)
    assert np.array_equal(again.x, first.x)
    assert again.metadata == first.metadata


def test_what_is_changed_afterwards_changes_nothing(module: eg.Module) -> None:
    given = np.full(module.n_x, 1e-7)
    run = module.simulate(0.3, atol=given)
    given[:] = 1.0
    assert np.array_equal(run.x, module.simulate(0.3, atol=1e-7).x)
    assert run.metadata["atol"] == [1e-7] * module.n_x
    spoilt = module.simulate(0.3)
    expected, position = spoilt.x.copy(), np.abs(module.constraints(spoilt.q, t=spoilt.t, rows="all")).max()
    spoilt.x[:], spoilt.t[:] = 7.0, 0.0
    assert np.array_equal(module.simulate(0.3).x, expected)
    assert spoilt.residuals.position == position  # of the run's own states, though asked for late


# -- runs that stop ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("rotation", ["euler_angles", pytest.param("euler_parameters", marks=pytest.mark.thorough)])
def test_a_disc_that_falls_flat_ends_its_run(rotation: str) -> None:
    """A thin disc that leans 0.2 rad at rest rolls about no axle: (m r^2/4 + m r^2) lean'' = m g r sin(lean)."""
    rate = lambda lean: np.sqrt(2 * 9.81 / 1.25 * (np.cos(0.2) - np.cos(lean)))  # noqa: E731
    # lean = 0.2 + s^2 takes the root out of the start
    falling = quad(lambda s: 2 * s / rate(0.2 + s * s), 0, np.sqrt(np.pi / 2 - 0.2))[0]
    m = eg.Model("disc", gravity=(0, 0, -9.81))
    m.rolling("r", disc := m.body("d", mass=1, inertia=(0.25, 0.25, 0.5)), radius=1)
    m.free("f", m.ground, disc, rotation=rotation)
    angle = np.pi / 2 - 0.2
    half = {"f_e0": np.cos(angle / 2), "f_e1": np.sin(angle / 2)}
    m.initial(**half if rotation == "euler_parameters" else {"f_1": angle})
    module = m.compile(target="numpy")
    with refused("EG-STALLED 50 'r': disc", eg.SimulationError) as caught:
        module.simulate(50)
    assert f"t = {falling:.5g}" in str(caught.value)


@cache
def sliding(target: str) -> Any:
    """A body of 1 kg with dry friction on a spring, by default none."""
    m = eg.Model("sliding")
    m.parameter("friction", 10.0), m.parameter("k", 0.0)
    m.prismatic("s", m.ground, body := m.body("b", mass=1), axis="x")
    m.force("law", body, ("-k*s - friction*sign(s_dot)", 0, 0))
    return m.compile(target=target)


@pytest.mark.parametrize(("method", "target"), [("DOP853", "cython"), ("RK45", "numpy"), ("LSODA", "cython")])
def test_a_friction_that_jumps_is_named(method: str, target: str) -> None:
    """A body of 1 kg at 1 m/s against 10 N stops after 0.1 s; from there the sign of its speed jumps."""
    with pytest.raises(eg.SimulationError) as caught:
        sliding(target).simulate(5, {"s_dot": 1.0}, method=method)
    words = str(caught.value)
    assert words.startswith(f"{method} stopped at t = 0.10000")
    assert ", s_dot = " in words
    assert "the rate of s_dot changes by 20 where s_dot changes by" in words
    assert "jumps (smooth it)" in words


@pytest.mark.parametrize(
    ("method", "target"),
    part_of(
        product(["DOP853", "RK45", "Radau", "BDF", "LSODA", "IDA", "sensitivities", "integrator"], ["cython", "numpy"]),
        lambda case: case in (("DOP853", "cython"), ("LSODA", "numpy"), ("integrator", "cython"), ("Radau", "cython")),
    ),
)
def test_a_sliding_mode_over_a_short_span_is_reported_in_seconds(method: str, target: str) -> None:
    """A spring that holds 1 N against 2 N of dry friction at rest: some 5e7 steps in 0.02 s."""
    module, start = sliding(target).bind({"friction": 2.0, "k": 3.0}), {"s": 1 / 3}
    asked: dict[str, Any] = {"t_eval": [0, 0.02]}
    begun = time.process_time()
    with refused("EG-STALLED 0.02", eg.SimulationError):
        if method == "IDA":
            module.dae.solve(0.02, start, **asked)
        elif method == "sensitivities":
            module.sensitivities(["s"], 0.02, start, **asked)
        elif method == "integrator":
            module.integrator()(0.0, module.x0(s_dot=1e-9, **start), 0.02)
        else:
            module.simulate(0.02, start | {"s_dot": 1e-9}, method=method, **asked)
    assert time.process_time() - begun < 30  # some 3 s


@pytest.mark.parametrize("method", ["DOP853", "LSODA"])
def test_a_run_into_a_pole_ends(method: str) -> None:
    """x'' = 1/(1 - t), whose velocity -ln(1 - t) has no end."""
    m = eg.Model("pole")
    m.prismatic("J", m.ground, m.body("b", mass=1), axis="x", coordinate="x")
    m.torque("push", "J", "1/(1 - t)")
    module, begun = m.compile(target="numpy"), time.process_time()
    refuses(f"EG-STALLED {method} 1 2", module.simulate, 2.0, method=method)
    assert time.process_time() - begun < 10  # some 0.5 s


def test_a_damped_run_backwards_ends() -> None:
    """The dampers of the governor make a motion grow tenfold every 0.3 ms backwards."""
    module, begun = eg.load_example("flyball_governor").compile(target="numpy"), time.process_time()
    refuses("EG-STALLED backwards -1", module.simulate, -1.0)
    assert time.process_time() - begun < 10  # some 1 s


def test_a_floor_without_rebound_is_no_accumulation() -> None:
    """A ball that falls 1 m stays on the floor from its first impact on, at sqrt(2/g)."""
    m = eg.Model("ball", gravity=(0, 0, -9.81))
    m.prismatic("z", m.ground, m.body("ball", mass=1), axis="z", coordinate="h")
    m.event("floor", "h", restitution=0)
    with refused(f"EG-ZENO floor {np.sqrt(2 / 9.81):.6g}") as caught:
        m.compile(target="numpy").simulate(2.0, {"h": 1.0})
    assert "Zeno" not in str(caught.value)


@pytest.mark.parametrize("method", ["DOP853", "RK45"])
def test_no_absolute_tolerance_of_a_state_that_is_0(method: str) -> None:
    """x'' = -x from x = 1 at rest, where every error is infinite in parts of the velocity; the run is x = cos(t)."""
    m = eg.Model("swinging")
    m.prismatic("J", m.ground, m.body("b", mass=1), axis="x", coordinate="x")
    m.torque("spring", "J", "-x")
    m.initial(x=1.0)
    run = m.compile(target="numpy").simulate(1.0, method=method, rtol=1e-8, atol=0)
    assert run["x"][-1] == pytest.approx(np.cos(1.0), abs=1e-7)


def four_bar() -> eg.Model:
    m = eg.Model("four_bar")
    for name, value in (("w", 4.0), ("k", 1.0)):
        m.parameter(name, value)
    m.input("tau")
    a, b, c = (m.body(name, mass="sqrt(w)", inertia={"zz": "0.001*sqrt(w)"}) for name in ("crank", "coupler", "rocker"))
    models.join_four_bar(m, (a, b, c), (0.04, 0.12, 0.08, 0.1), "theta bend psi")
    m.torque("motor", "A", "tau")
    m.torque("law", "D", "-sqrt(k + psi)")
    m.guess(theta=1.0, bend=-0.7, psi=1.1)
    m.initial(theta=1.0)
    return m


@pytest.fixture(
    scope="module",
    params=[("auto", "numpy"), pytest.param(("augmented", "cython"), marks=pytest.mark.thorough)],
    ids=str,
)
def linkage(request: Any) -> Any:
    method, target = request.param
    return four_bar().compile(method=method, target=target)


CAUSES = [
    # parameters, added to x, inputs, error, what it tells
    ({"k": -9.0}, 0.0, [0.0], eg.NonFiniteError, "EG-NOT-FINITE loads law"),
    ({"w": 0.0}, 0.0, [0.0], eg.SingularMassMatrixError, "EG-SINGULAR theta inertia"),
    ({}, 1e200, [0.0], eg.NonFiniteError, "EG-NOT-FINITE squares theta_dot, bend_dot, psi_dot overflow"),
    ({}, 0.0, [np.nan], eg.NonFiniteError, "EG-NOT-FINITE input tau"),
    ({}, np.nan, [0.0], eg.NonFiniteError, "EG-NOT-FINITE theta = nan state"),
]


@pytest.mark.parametrize(("p", "added", "u", "error", "demand"), CAUSES, ids=str)
def test_the_cause_is_named(linkage: Any, p: Any, added: float, u: Any, error: type[Exception], demand: str) -> None:
    x = linkage.x0() + np.array([added] * linkage.n_x)
    if added == 1e200:
        x = np.where(np.arange(linkage.n_x) < 3, linkage.x0(), x)
    with refused(demand, error):
        linkage.bind(p=p).rhs(0.0, x, u=u)


@pytest.fixture(autouse=True)
def interrupts() -> Iterator[None]:
    """A process started in the background may ignore Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupt(call: Callable[[], Any], bound: float) -> Any:
    """The KeyboardInterrupt that ends a call, which may take so many seconds of the processor after Ctrl-C."""
    begun: list[float] = []

    def press() -> None:
        begun.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(0.2, press).start()
    with pytest.raises(KeyboardInterrupt) as stopped:
        call()
    assert time.process_time() - begun[0] < bound
    return stopped


def test_an_interrupt_keeps_what_there_was() -> None:
    mod = compiled("double_pendulum", "cython")
    mod.simulate((0, 1e-3))
    stopped = interrupt(lambda: mod.simulate((0, 1e5), rtol=1e-12, atol=1e-12), 0.1)
    assert isinstance(stopped.value, eg.SimulationInterrupted)
    part = stopped.value.trajectory
    assert 0.0 < part.t[-1] < 1e5
    assert len(part.t) > 50
    assert f"t = {part.t[-1]:.6g}" in str(stopped.value)
    few = part.t[:40]
    again = mod.simulate((0, few[-1]), rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(again.t[:39], few[:39])
    np.testing.assert_array_equal(again.x[:, :39], part.x[:, :39])


def test_an_interrupt_ends_an_ensemble() -> None:
    mod, starts = compiled("double_pendulum", "cython"), {"theta1": np.linspace(-1, 1, 4000)}
    interrupt(lambda: mod.simulate_many(1e4, starts, rtol=1e-10, atol=1e-12), 5.0)


def test_what_the_watch_or_a_handler_raises_comes_out() -> None:
    mod = compiled("double_pendulum", "cython")

    def alarm(number: int, frame: Any) -> None:
        raise TimeoutError("too long")

    before = signal.signal(signal.SIGALRM, alarm)
    try:
        with pytest.raises(TimeoutError, match="too long"):
            signal.setitimer(signal.ITIMER_REAL, 0.1)
            mod.simulate((0, 1e5), rtol=1e-12, atol=1e-12, t_eval=[1e5])
    finally:
        signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="module", params=["cython", "numpy"])
def swinging(request: pytest.FixtureRequest) -> Any:
    return compiled("pendulum", request.param)


@pytest.mark.parametrize(("method", "times"), [("BDF", None), ("LSODA", np.linspace(0, 2, 9)), ("RK45", None)])
def test_an_interrupt_keeps_the_run_of_any_method(swinging: Any, method: str, times: Any) -> None:
    def press(t: float, x: np.ndarray) -> float:
        if t > 1.2:
            raise KeyboardInterrupt
        return 1.0

    with pytest.raises(eg.SimulationInterrupted) as stopped:
        swinging.simulate((0, 2), events=press, method=method, t_eval=times)
    part = stopped.value.trajectory
    assert (stopped.value.code, "t = 1." in str(stopped.value)) == ("EG-INTERRUPTED", True)
    whole = swinging.simulate((0, 2), method=method, dense_output=True)
    assert 0.9 < part.t[-1] <= 1.5
    assert (np.diff(part.t) > 0).all()
    np.testing.assert_allclose(part.x, whole.at(part.t).x, atol=1e-6)
