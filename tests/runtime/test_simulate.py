"""simulate: methods, events, dense output, inputs, failures; residuals and energy."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import DOP853, RK45, solve_ivp

from eomgen.api.module import Module
from eomgen.errors import EvaluationError, SimulationError, SingularMassMatrixError, UsageError
from eomgen.runtime import NumpyCore

REFERENCES = Path(__file__).parents[1] / "reference"
METHODS = ["RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"]


def test_the_published_motion_with_redundant_rows_too(crank):
    """Reference: planar_slider_crank_dynamics.json (multiplier form in 30 digits against a closed form)."""
    data = json.loads((REFERENCES / "planar_slider_crank_dynamics.json").read_text())["reference"]["omega10"]["values"]
    times = [0.1, 0.5, 1.0]
    for copies in (1, 2):
        traj = crank(copies).simulate((0, 1), {"theta": 0.0, "theta_dot": 10.0}, t_eval=times, rtol=1e-10, atol=1e-12)
        for j, row in enumerate(data.values()):
            for ours, theirs in {"theta": "theta", "beta": "beta", "s": "x", "s_dot": "xdot"}.items():
                assert traj[ours][j] == pytest.approx(float(row[theirs]), abs=2e-9)
        assert traj.residuals.raw_position < 1e-9
        assert traj.residuals.position < 1e-13
        assert traj.residuals.velocity < 1e-12
        assert 0 < traj.residuals.correction_velocity < 1e-8
        assert traj.energy_drift < 1e-10


@pytest.fixture(scope="module")
def exact_ends():
    """Ends of the run of test_every_method_of_scipy at tight tolerances, found once."""
    return {}


@pytest.mark.parametrize("method", METHODS)
def test_every_method_of_scipy(crank, method, exact_ends):
    tight = {"rtol": 1e-4, "atol": 1e-6} if method == "RK23" else {"rtol": 1e-6, "atol": 1e-8}
    m = crank()
    traj = m.simulate((0, 0.3), {"theta": 0.0, "theta_dot": 10.0}, method=method, **tight)
    if not exact_ends:
        exact = m.simulate((0, 0.3), {"theta": 0.0, "theta_dot": 10.0}, rtol=1e-11, atol=1e-12)
        exact_ends["x"] = exact.x[:, -1]
    assert traj.t[-1] == 0.3
    np.testing.assert_allclose(traj.x[:, -1], exact_ends["x"], atol=100 * tight["rtol"])
    if method in ("Radau", "BDF"):
        assert traj.njev > 0
    assert np.abs(m.constraints(traj.x[:3])).max() < 1e-13


def test_implicit_methods_get_the_exact_jacobian(pendulum):
    calls = []
    block = pendulum.core.blocks["jacobian"]
    blocks = pendulum.core.blocks | {"jacobian": lambda *a: calls.append(a) or block(*a)}
    Module(NumpyCore(pendulum.core.metadata, blocks)).simulate(1.0, method="Radau")
    assert calls


def test_plain_scipy_and_solver_classes(crank):
    m = crank()
    x0 = m.x0(theta=0.3, theta_dot=10.0)
    sol = solve_ivp(m.rhs, (0, 0.2), x0, method="DOP853", rtol=1e-8, atol=1e-10)
    traj = m.simulate((0, 0.2), {"theta": 0.3, "theta_dot": 10.0}, method=DOP853)
    np.testing.assert_array_equal(traj.t, sol.t)
    np.testing.assert_allclose(traj.x, sol.y, atol=1e-8)


def test_minimal_form_agrees_with_the_whole_tree(crank):
    m = crank()
    x_min = m.minimal.x0(theta=0.3, theta_dot=10.0)
    assert m.minimal.x_names == ("theta", "theta_dot")
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12, "t_eval": np.linspace(0, 0.5, 6)}
    small = solve_ivp(m.minimal.rhs, (0, 0.5), x_min, **options)
    whole = solve_ivp(m.rhs, (0, 0.5), m.x0(theta=0.3, theta_dot=10.0), **options)
    expanded = m.minimal.expand(small.y, small.t)
    np.testing.assert_allclose(expanded[:3], whole.y[:3], atol=1e-9)
    np.testing.assert_allclose(expanded[3:], whole.y[3:], atol=1e-9 * np.abs(whole.y).max())
    np.testing.assert_array_equal(m.minimal.reduce(expanded), small.y)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_minimal_form_with_the_slider_never_crosses_a_dead_centre_silently(crank, tolerance):
    """The slider alone cannot tell the two sides of a dead centre apart, so the run must end there, with an error."""
    m = crank(independent=[2], initial={"s": 0.4, "s_dot": 1.0})
    m.minimal.reset(m.assemble(s=0.4))
    x = m.minimal.x0(s=0.4, s_dot=1.0)
    with pytest.raises(EvaluationError):
        solve_ivp(m.minimal.rhs, (0, 2.0), x, method="DOP853", rtol=tolerance, atol=tolerance)


def test_minimal_form_follows_far_targets_and_remembers(crank):
    m = crank()
    m.minimal.reset()
    far = m.minimal.expand(np.array([30.0, 1.0]))
    np.testing.assert_allclose(far[:3], m.kinematics([30.0])[0], atol=1e-12)
    with pytest.raises(UsageError, match="module.bind"):
        m.minimal.rhs(0.0, [0.3, 1.0], p=[1.0])
    with pytest.raises(UsageError, match=r"shape \(2,\)"):
        m.minimal.rhs(0.0, np.zeros(6))


def test_events_carry_scipys_attributes(pendulum):
    def down(t, x):
        return x[0]

    def top(t, x):
        return x[1]

    down.direction = -1
    top.terminal = 3
    traj = pendulum.simulate(20.0, {"theta": 0.5}, events=[down, top])
    assert traj.status == 1
    assert len(traj.t_events[1]) == 3
    assert len(traj.t_events[0]) in (1, 2)
    assert (np.diff(traj.t_events[1]) > 0.9).all()
    np.testing.assert_allclose(traj.x_events[0][0], 0, atol=1e-9)
    assert (traj.x_events[0][1] < 0).all()


def test_events_are_projected_and_counted_across_corners(crank):
    def turn(t, x):
        return x[4]

    turn.terminal = 2
    inputs = {"tau": ([0.0, 0.05, 0.1, 0.2], [0.0, 0.01, -0.01, 0.0])}
    traj = crank().simulate(3.0, {"theta": 0.3, "theta_dot": 10.0}, inputs=inputs, events=turn)
    assert traj.status == 1
    assert len(traj.t_events[0]) == 2
    assert np.abs(crank().constraints(traj.x_events[0][:3])).max() < 1e-13


def test_dense_output(crank):
    m = crank()
    traj = m.simulate(0.4, {"theta": 0.3, "theta_dot": 10.0}, dense_output=True)
    times = np.linspace(0, 0.4, 33)
    there = traj.at(times)
    exact = m.simulate(0.4, {"theta": 0.3, "theta_dot": 10.0}, t_eval=times, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(there["theta"], exact["theta"], atol=1e-7)
    np.testing.assert_allclose(there["s_ddot"], exact["s_ddot"], atol=1e-5)
    assert there.residuals.position < 1e-13
    assert traj.at(0.1)["theta"].shape == (1,)
    with pytest.raises(UsageError, match=r"within the run, 0 .. 0\.4 s"):
        traj.at(0.5)
    plain, kept = (m.simulate(0.1, dense_output=keep) for keep in (False, True))
    np.testing.assert_array_equal(plain.at(0.05).x, kept.at(0.05).x)


def test_inputs_three_ways(pendulum):
    start = {"theta": 0.0, "theta_dot": 0.0}
    options = {"rtol": 1e-10, "atol": 1e-12, "t_eval": np.linspace(0, 2, 9)}
    number = pendulum.simulate(2.0, start, inputs={"tau": 1.5}, **options)
    table = pendulum.simulate(2.0, start, inputs={"tau": ([0.0, 5.0], [1.5, 1.5])}, **options)
    function = pendulum.simulate(2.0, start, inputs={"tau": lambda t, x: 1.5}, **options)
    np.testing.assert_allclose(table.x, number.x, atol=1e-12)
    np.testing.assert_allclose(function.x, number.x, atol=1e-12)
    for traj in (number, table, function):
        np.testing.assert_array_equal(traj["tau"], 1.5)
        np.testing.assert_allclose(traj["theta_ddot"], 0.75 - 9.81 * np.sin(traj["theta"]), atol=1e-12)


def test_a_short_pulse_is_not_stepped_over(pendulum):
    m = pendulum.bind({"g": 0.0})
    pulse = ([1.0, 1.001, 1.002], [0.0, 1000.0, 0.0])  # an impulse of 1 N m s on 2 kg m^2
    traj = m.simulate(3.0, {"theta": 0.0, "theta_dot": 0.0}, inputs={"tau": pulse})
    assert traj["theta_dot"][-1] == pytest.approx(0.5, rel=1e-8)
    assert (np.diff(traj.t) > 0).all()
    back = m.simulate((3.0, 0.0), {"theta": 0.0, "theta_dot": 0.5}, inputs={"tau": pulse}, dense_output=True)
    assert back["theta_dot"][-1] == pytest.approx(0.0, abs=1e-8)
    np.testing.assert_allclose(back.at([2.9, 0.1])["theta_dot"], [0.5, 0.0], atol=1e-8)


def test_feedback_enters_the_jacobian(pendulum):
    """A stiff controller as an input: Radau needs its slope, else it takes tiny steps."""
    gain = 1e5
    inputs = {"tau": lambda t, x: -gain * x[1]}
    traj = pendulum.simulate(5.0, {"theta": 1.0, "theta_dot": 1.0}, inputs=inputs, method="Radau", rtol=1e-6, atol=1e-9)
    assert traj.nfev < 2000
    assert np.abs(traj["theta_dot"][-1]) < 1e-3


def test_wrong_inputs_are_told(pendulum):
    for inputs, words in [
        ({"tua": 1.0}, "did you mean tau"),
        ({"tau": ([0.0, 0.0], [1.0, 2.0])}, "times must increase, not go from 0.0 to 0.0"),
        ({"tau": ([0.0, 1.0], [1.0])}, "same length"),
        ({"tau": "strong"}, "no name in input tau 'strong'"),
        ({"tau": np.zeros((2, 2))}, "number, \\(times, values\\), a Signal, an expression as text or a function"),
        ({"tau": lambda t, x: x}, "one number at each time"),
        (3.0, "mapping"),
    ]:
        with pytest.raises(UsageError, match=words):
            pendulum.simulate(1.0, inputs=inputs)


def test_wrong_options_are_told(pendulum):
    for options, words in [
        ({"method": "RK54"}, "did you mean RK4 or RK45"),
        ({"method": "taylor"}, "did you mean Taylor"),
        ({"method": "moreu", "step": 1e-3}, "did you mean moreau"),
        ({"method": 3}, "OdeSolver"),
        ({"span": (0, 1, 2)}, "span must be"),
        ({"t_eval": [0.5, 0.2]}, "t_eval must be times in order"),
        ({"t_eval": [0.5, 20.0]}, "t_eval must be times in order"),
        ({"initial": np.zeros(3)}, r"shape \(2,\) \[theta, theta_dot\]"),
        ({"initial": {"thetta": 1.0}}, "did you mean theta"),
        ({"parameters": {"q": 1.0}}, "no parameter 'q'"),
        ({"events": 3}, "event must be a name, an expression or a function"),
    ]:
        with pytest.raises(UsageError, match=words):
            pendulum.simulate(**({"span": 1.0} | options))


def test_a_solver_of_another_refuses_its_options_itself(pendulum):
    class Own(RK45):
        pass

    with pytest.raises(ValueError, match="must be positive"):
        pendulum.simulate(1.0, method=Own, max_step=0.0)


@pytest.mark.parametrize("method", METHODS)
def test_tolerances_and_steps_that_cannot_be_are_told_alike_for_every_method(pendulum, method):
    for options, words in [
        ({"rtol": -1}, "rtol must not be negative and must be finite, not -1"),
        ({"atol": -1}, "atol must not be negative and must be finite, not -1"),
        ({"atol": float("nan")}, "atol must not be negative and must be finite, not nan"),
        ({"atol": "small"}, "atol must be a number, not 'small'"),
        ({"atol": [1e-9]}, r"atol must be a number or have shape \(2,\)"),
        ({"max_step": -1}, "max_step must be greater than 0 s, not -1"),
        ({"max_step": "long"}, "max_step must be a number, not 'long'"),
        ({"first_step": 0}, "first_step must be greater than 0 s and finite, not 0"),
        ({"first_step": 2}, "first_step must not exceed the span of 1 s, not 2"),
    ]:
        with pytest.raises(UsageError, match=words):
            pendulum.simulate(1.0, method=method, **options)
    with pytest.raises(UsageError, match="min_step must not be negative"):
        pendulum.simulate(1.0, method="LSODA", min_step=-1)


@pytest.mark.parametrize("method", ["DOP853", "Radau"])
def test_an_rtol_below_rounding_is_raised_without_a_warning(pendulum, method):
    traj = pendulum.simulate(0.05, {"theta": 0.1}, method=method, rtol=1e-20, atol=1e-8)
    assert traj.metadata["rtol"] == 100 * np.finfo(float).eps


def test_a_first_step_longer_than_the_way_to_a_corner(pendulum):
    table = ([0.0, 0.01, 1.0], [0.0, 1.0, 1.0])
    traj = pendulum.simulate(1.0, inputs={"tau": table}, method="Radau", first_step=0.1)
    assert traj.t[-1] == 1.0


@pytest.mark.parametrize("method", ["DOP853", "LSODA"])
def test_functions_of_inputs_that_return_no_number_are_told_by_name_and_time(pendulum, method):
    late = 0.25
    for value, words in [
        (None, "input tau .* returned None at t = 0.[23]"),
        (np.zeros(2), r"input tau .* an array of shape \(2,\) at t = 0.[23]"),
        (1j, "input tau .* returned 1j at t = 0.[23]"),
    ]:
        with pytest.raises(UsageError, match=words):
            pendulum.simulate(1.0, inputs={"tau": lambda t, x, value=value: 0.0 if t < late else value}, method=method)
    for value in (float("nan"), float("inf")):
        with pytest.raises(UsageError, match=f"input tau is {value} at t = 0 s"):
            pendulum.simulate(1.0, inputs={"tau": lambda t, x, value=value: value}, method=method)
        with pytest.raises(SimulationError, match=rf"stopped near .*input tau is {value} at t = 0.2[5-9]"):
            pendulum.simulate(1.0, inputs={"tau": lambda t, x, value=value: 0.0 if t < late else value}, method=method)
    with pytest.raises(ZeroDivisionError) as caught:
        pendulum.simulate(1.0, inputs={"tau": lambda t, x: 1 / 0}, method=method)
    assert caught.value.__notes__ == ["raised by the function of input tau, called as f(0, x)"]


def test_parameters_change_a_run_and_defaults_come_from_the_model(pendulum):
    traj = pendulum.simulate()
    assert traj.t[-1] == 5.0
    assert traj.metadata["rtol"] == 1e-8
    heavy = pendulum.simulate(1.0, parameters={"l": 2.0})
    assert heavy.metadata["parameters"]["l"] == 2.0
    assert not np.isclose(heavy["theta"][-1], pendulum.simulate(1.0)["theta"][-1])


def failing(models, error=None):
    """A pendulum whose right-hand side cannot be evaluated above 1 rad."""
    blocks = models.pendulum_blocks()
    plain = blocks["rhs"]

    def rhs(t, x, u, c):
        return np.where(x[0] > 1.0, np.nan, plain(t, x, u, c))

    return Module(NumpyCore(models.pendulum_metadata(), blocks | {"rhs": rhs}))


@pytest.mark.parametrize("method", METHODS)
def test_a_failure_on_the_way_becomes_a_simulation_error_with_its_cause(models, method):
    m = failing(models)
    with pytest.raises(SimulationError, match=rf"{method} stopped near t = .*theta = 1(\.0|,)") as caught:
        m.simulate(3.0, {"theta": 0.0, "theta_dot": 6.0}, method=method)
    assert isinstance(caught.value.__cause__, EvaluationError)
    assert 0.1 < caught.value.__cause__.time < 0.3


def test_a_passing_failure_only_shortens_the_step(models):
    traj = failing(models).simulate(1.0, {"theta": 0.9, "theta_dot": 0.9}, rtol=1e-3, atol=1e-6, first_step=0.5)
    assert traj.t[-1] == 1.0


def test_a_failure_at_the_start_is_no_simulation_error(models, pendulum):
    with pytest.raises(SingularMassMatrixError):
        pendulum.simulate(1.0, parameters={"m": 0.0})


def test_unbounded_motion_names_a_remedy(models):
    def rhs(t, x, u, c):
        return np.array([x[0] ** 2 * 10, 0 * x[1]])

    m = Module(NumpyCore(models.pendulum_metadata(), models.pendulum_blocks() | {"rhs": rhs}))
    with pytest.raises(SimulationError, match="grows without bound|not finite"):
        m.simulate(3.0, {"theta": 1.0})


def test_an_initial_array_is_projected(crank):
    m = crank()
    x = m.x0(theta=0.3, theta_dot=10.0)
    traj = m.simulate(0.05, x + 1e-4)
    assert np.abs(m.constraints(traj.x[:3, 0])).max() < 1e-13


def test_progress_goes_to_stderr_only_when_asked(pendulum, capsys):
    pendulum.simulate(20.0, {"theta": 2.0}, rtol=1e-11, atol=1e-12, progress=True)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err
    pendulum.simulate(1.0)
    assert capsys.readouterr().err == ""


def test_without_scipy_the_message_says_what_to_install(models):
    code = (
        "import sys; sys.modules['scipy'] = None; sys.modules['scipy.integrate'] = None\n"
        "import importlib.util; from eomgen.api.module import Module\n"
        "from eomgen.runtime import NumpyCore; from eomgen.errors import *\n"
        f"spec = importlib.util.spec_from_file_location('hand', {models.__file__!r})\n"
        "hand = importlib.util.module_from_spec(spec); spec.loader.exec_module(hand)\n"
        "m = Module(NumpyCore(hand.crank_metadata(), hand.crank_blocks())); m.x0(); m.kinematics([1.0])\n"
        "try:\n    m.simulate(1.0)\n"
        "except MissingDependencyError as error:\n    assert 'pip install scipy' in str(error)\n"
        "else:\n    raise SystemExit('no error')\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_unknown_options_are_refused_with_the_nearest(pendulum):
    with pytest.raises(UsageError, match="'rtoll'; did you mean rtol"):
        pendulum.simulate(0.1, rtoll=1e-3)
    with pytest.raises(UsageError, match="'min_step'"):
        pendulum.simulate(0.1, min_step=1e-3)
    assert pendulum.simulate(0.1, method="LSODA", min_step=1e-9).t[-1] == 0.1

    class Mine(DOP853):
        def __init__(self, *args, anything=None, **options):
            assert anything == 3
            super().__init__(*args, **options)

    assert pendulum.simulate(0.1, method=Mine, anything=3).t[-1] == 0.1


class Pushing:
    def push(self, t):
        return t


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda t: t, r"lambda>\(t\) is not; write it with both, as lambda t, x"),
        (Pushing().push, r"push\(t\) is not"),
        (lambda: 1.0, r"\(\) is not"),
        (lambda t, x, gain: gain, r"\(t, x, gain\) is not; bind its other arguments"),
    ],
)
def test_functions_of_other_arguments_are_refused_by_name(crank, function, said):
    m = crank()
    with pytest.raises(UsageError, match=rf"input tau: its function must be callable as f\(t, x\), and .*{said}"):
        m.simulate((0, 0.1), inputs={"tau": function})
    with pytest.raises(UsageError, match=rf"an event must be callable as f\(t, x\), and .*{said}"):
        m.simulate((0, 0.1), events=function)


@pytest.mark.parametrize("function", [lambda t, x: 0.0, lambda *a: 0.0, lambda t, x, gain=1.0: 0.0 * gain, max])
def test_functions_of_time_and_state_are_taken_as_they_are(crank, function):
    if function is max:  # shows no signature
        function = np.frompyfunc(lambda t, x: 0.0, 2, 1)
        with pytest.raises((UsageError, TypeError, ValueError)):
            crank().simulate((0, 0.01), inputs={"tau": function})
        return
    assert crank().simulate((0, 0.01), inputs={"tau": function}).t[-1] == 0.01


def test_runs_from_the_declared_start_do_not_share_it(pendulum):
    """The start is kept between runs; what a run or a user does to a state must not change the next one's."""
    expected = pendulum.x0()
    first = pendulum.simulate((0.0, 0.1))
    first.x[:] = 7.0
    assert np.array_equal(pendulum.simulate((0.0, 0.1)).x[:, 0], expected)
    other = pendulum.bind({name: 2.0 * value for name, value in zip(pendulum.p_names, pendulum.p, strict=True)})
    assert np.array_equal(other.simulate((0.0, 0.1)).x[:, 0], other.x0())


def test_what_a_run_tells_of_itself_is_of_the_time_of_the_run(pendulum):
    """Metadata are put together when asked for: an array of tolerances changed since then must not be told."""
    atol = np.full(pendulum.n_x, 1e-9)
    run = pendulum.simulate((0.0, 0.1), atol=atol)
    atol[:] = 5.0
    assert run.metadata["options"]["atol"] == [1e-9] * pendulum.n_x
    assert list(run.metadata)[:2] == ["name", "q_names"]
    assert run.metadata is run.metadata
