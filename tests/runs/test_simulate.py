"""Runs: published motions, every method beside SciPy's, options, failures, and that runs leave nothing behind."""

import subprocess
import sys
from typing import Any

import models
import numpy as np
import pytest
from analysed import compiled
from refusals import refused, refuses
from scipy.integrate import DOP853, RK45, solve_ivp
from sweeps import TARGETS

import eomgen as eg

METHODS = ["RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"]


@pytest.fixture(scope="module")
def crank() -> eg.Module:
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
def test_the_published_motion(crank: eg.Module, target: str) -> None:
    """Reference: planar_slider_crank_dynamics.json (multiplier form in 30 digits against a closed form)."""
    data = models.reference("planar_slider_crank_dynamics")["reference"]
    mod = crank if target == "numpy" else compiled("free_slider_crank", "cython")
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
def test_every_method_comes_to_the_same(crank: eg.Module, target: str) -> None:
    mod = crank if target == "numpy" else compiled("free_slider_crank", "cython")
    exact = mod.simulate(0.3, rtol=1e-11, atol=1e-12).x[:, -1]
    for method in METHODS:
        rtol = 1e-4 if method == "RK23" else 1e-6
        run = mod.simulate(0.3, method=method, rtol=rtol, atol=rtol / 100)
        assert run.t[-1] == 0.3
        np.testing.assert_allclose(run.x[:, -1], exact, atol=100 * rtol, err_msg=method)
        assert (run.njev > 0) == (method in ("Radau", "BDF")) or method == "LSODA"
        assert np.abs(mod.constraints(run.x[:3])).max() < 1e-13


def test_plain_scipy_and_solver_classes(crank: eg.Module) -> None:
    x0 = crank.x0()
    sol = solve_ivp(crank.rhs, (0, 0.2), x0, method="DOP853", rtol=1e-8, atol=1e-10)
    run = crank.simulate((0, 0.2), method=DOP853)
    np.testing.assert_array_equal(run.t, sol.t)
    np.testing.assert_allclose(run.x, sol.y, atol=1e-8)
    assert type(crank.DOP853(crank.rhs, 0.0, x0, 1.0)) is crank.bind({"g": 9.0}).DOP853
    for method in ("DOP853", "RK45", "RK23", "Radau"):
        ours = solve_ivp(crank.rhs, (0.0, 0.5), x0, method=getattr(crank, method), rtol=1e-6)
        slope = {"jac": crank.jacobian} if method == "Radau" else {}
        theirs = solve_ivp(crank.rhs, (0.0, 0.5), x0, method=method, rtol=1e-6, **slope)
        np.testing.assert_allclose(ours.t, theirs.t, rtol=1e-4 if method == "Radau" else 1e-6, err_msg=method)
        np.testing.assert_allclose(ours.y, theirs.y, atol=1e-6)


@pytest.mark.parametrize("target", TARGETS)
def test_values_between_the_steps(crank: eg.Module, target: str) -> None:
    mod = crank if target == "numpy" else compiled("free_slider_crank", "cython")
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
