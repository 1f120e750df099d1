"""Many runs at once against SciPy's solve_ivp, one at a time, and against themselves however they are shared out."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from children import child
from scipy.integrate import solve_ivp

import eomgen as eg

from .conftest import compiled

TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def angles(k: int, seed: int = 0) -> dict[str, Any]:
    draw = np.random.default_rng(seed)
    return {"theta1": draw.uniform(-1, 1, k), "bend": draw.uniform(-1, 1, k), "bend_dot": 0.1}


def test_every_run_is_that_of_scipy(pendulum: Any) -> None:
    k, times = 11, np.linspace(0, 3, 7)
    masses = np.linspace(0.5, 2.0, k)
    ensemble = pendulum.simulate_many((0, 3), angles(k), {"m2": masses, "g": 9.0}, t_eval=times, **TIGHT)
    assert ensemble.ok.all()
    assert ensemble.samples.shape == (pendulum.n_x, 7, k)
    for j in range(k):
        start = {name: float(np.broadcast_to(x, k)[j]) for name, x in angles(k).items()}
        bound = pendulum.bind({"m2": masses[j], "g": 9.0})
        judge = solve_ivp(bound.rhs, (0, 3), bound.x0(start), method="DOP853", t_eval=times, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(ensemble.samples[:, :, j], judge.y, rtol=0, atol=1e-7)
        np.testing.assert_allclose(ensemble["theta2"][:, j], judge.y[0] + judge.y[1], rtol=0, atol=1e-7)
    np.testing.assert_array_equal(ensemble.x, ensemble.samples[:, -1])


def test_statistics_are_those_of_numpy(pendulum: Any) -> None:
    times = np.linspace(0, 1, 4)
    kept = pendulum.simulate_many(1, angles(700), t_eval=times)
    made = pendulum.simulate_many(1, angles(700), t_eval=times, reduce="statistics")
    everything = np.stack([kept[name] for name in made.names])
    assert (made.reduced["count"] == 700).all()
    np.testing.assert_allclose(made.reduced["mean"], everything.mean(axis=-1), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(made.reduced["variance"], everything.var(axis=-1, ddof=1), rtol=1e-11, atol=1e-15)
    np.testing.assert_array_equal(made.reduced["least"], everything.min(axis=-1))
    np.testing.assert_array_equal(made.reduced["greatest"], everything.max(axis=-1))
    assert made.x is None
    np.testing.assert_array_equal(made["x"], made.reduced["mean"][made.names.index("x")])


def test_what_a_function_keeps_of_each_block(pendulum: Any) -> None:
    made = pendulum.simulate_many(1, angles(600), reduce=lambda block: {"top": block.x[0].max()}, block=256)
    kept = pendulum.simulate_many(1, angles(600))
    assert max(made.reduced["top"]) == kept["theta1"].max()
    assert len(made.reduced["top"]) == 3
    with pytest.raises(eg.UsageError, match="mapping of names"):
        pendulum.simulate_many(1, angles(3), reduce=lambda block: block.x)


def assert_as_good(found: Any, run: Any, exact: Any, lanes: int | None, near: float) -> None:
    """A run of an ensemble: near to that of simulate; in lanes, which have other steps, it errs about as much."""
    if lanes == 0:
        np.testing.assert_allclose(found, run, rtol=0, atol=near)
    errors = [float(np.abs(x - exact).max()) for x in (found, run)]
    assert errors[0] < 4.0 * errors[1] + 1e-9 * np.abs(exact).max()


@pytest.mark.parametrize("lanes", [0, 2, None])
def test_a_loop_is_kept_closed_and_a_run_that_cannot_begin_holds_up_none(lanes: int | None) -> None:
    crank = compiled("slider_crank", "cython", lanes)
    lengths = np.array([0.1, 0.5, 0.2, 0.12])  # the second is longer than the rod
    times = [0.0, 1.0, 2.0]
    ensemble = crank.simulate_many(2, {"theta": 1.2, "theta_dot": 10.0}, {"r": lengths}, t_eval=times, **TIGHT)
    (failure,) = ensemble.failures()
    assert failure.run == 1
    assert "cannot close" in failure.message
    assert np.isnan(ensemble.samples[:, :, 1]).all()
    for j in (0, 2, 3):
        bound = crank.bind({"r": lengths[j]})
        assert np.abs(bound.constraints(ensemble.x[: crank.n_q, j], rows="all")).max() < 1e-12
        run = bound.simulate(2, {"theta": 1.2, "theta_dot": 10.0}, t_eval=times, **TIGHT)
        exact = bound.simulate(2, {"theta": 1.2, "theta_dot": 10.0}, t_eval=times, rtol=1e-13, atol=1e-15)
        assert_as_good(ensemble.samples[:, :, j], run.x, exact.x, lanes, 1e-11)


def test_runs_that_fail_are_marked_and_say_why() -> None:
    q = eg.Model("runaway")
    q.parameter("k", 1.0)
    body = q.body("a", mass=1.0)
    q.prismatic("s", q.ground, body, axis="x")
    q.torque("pull", "s", "k*s**3")
    module = q.compile()
    # v' = k s^3 reaches infinity in finite time for k > 0 and swings for k < 0
    ensemble = module.simulate_many(20, {"s": 1.0}, {"k": np.array([-1.0, 1.0, -2.0, 3.0])}, max_steps=5000)
    assert ensemble.status.tolist()[0] == ensemble.status.tolist()[2] == 0
    assert [f.run for f in ensemble.failures()] == [1, 3]
    assert all("step size" in f.message for f in ensemble.failures())
    # the time of escape of s' = s^2 / sqrt(2) from rest at s = 1: integral of ds / sqrt((s^4 - 1) / 2)
    assert ensemble.t_end[1] == pytest.approx(1.8540746773013719, abs=1e-6)
    assert ensemble.t_end[3] == pytest.approx(1.8540746773013719 / np.sqrt(3), abs=1e-6)
    short = module.simulate_many(20, {"s": 1.0}, {"k": np.array([-1.0, -2.0])}, max_steps=3)
    assert [f.message for f in short.failures()] == ["more than max_steps steps"] * 2
    assert (short.steps == 3).all()


@pytest.mark.parametrize("lanes", [0, 2, None])
def test_tables_as_inputs(lanes: int | None) -> None:
    crank = compiled("slider_crank", "cython", lanes)
    table = (np.array([0.0, 0.3, 1.0]), np.array([0.0, 5.0, -5.0]))
    starts = np.linspace(5, 10, 5)
    fine = {"rtol": 1e-13, "atol": 1e-15}

    def last(start: float, tau: Any, options: Any) -> Any:
        run = crank.simulate(1, {"theta": 0.3, "theta_dot": start}, inputs={"tau": tau}, **options)
        return run.x[:, -1]

    ensemble = crank.simulate_many(1, {"theta": 0.3, "theta_dot": starts}, inputs={"tau": table}, **TIGHT)
    for j, start in enumerate(starts):
        found = (last(start, table, options) for options in (TIGHT, fine))
        assert_as_good(ensemble.x[:, j], *found, lanes, 1e-12)
    each = crank.simulate_many(1, {"theta": 0.3, "theta_dot": 5.0}, inputs={"tau": [0.0, 1.0]}, **TIGHT)
    assert_as_good(each.x[:, 1], *(last(5.0, 1.0, options) for options in (TIGHT, fine)), lanes, 1e-12)


@pytest.mark.parametrize("interpolation", ["zero-order", "linear", "cubic"])
def test_every_run_sees_the_same_signal(pendulum: Any, interpolation: str) -> None:
    m = eg.Model("pushed")
    push = m.input("push")
    m.prismatic("s", m.ground, m.body("a", mass=2.0), axis="x")
    m.torque("drive", "s", push)
    module = m.compile()
    times, values = np.array([0.0, 0.4, 1.0, 1.3, 2.0]), np.array([1.0, -2.0, 3.0, 0.5, 0.0])
    signal = eg.Signal(times, values, interpolation)
    starts = np.linspace(-1, 1, 9)
    ensemble = module.simulate_many(2, {"s_dot": starts}, inputs={"push": signal}, t_eval=[0.5, 2.0], **TIGHT)
    for j, start in enumerate(starts):
        run = module.simulate(2, {"s_dot": start}, inputs={"push": signal}, t_eval=[0.5, 2.0], **TIGHT)
        np.testing.assert_allclose(ensemble.samples[:, :, j], run.x, rtol=0, atol=1e-9)
    if interpolation == "zero-order":  # impulse of the steps
        impulse = 1.0 * 0.4 - 2.0 * 0.6 + 3.0 * 0.3 + 0.5 * 0.7
        np.testing.assert_allclose(ensemble["s_dot"][-1] - starts, impulse / 2.0, rtol=0, atol=1e-12)
    texts = module.simulate_many(2, {"s_dot": starts}, inputs={"push": "3*sin(2*t)"}, **TIGHT)
    np.testing.assert_allclose(texts["s_dot"] - starts, 1.5 * (1 - np.cos(4.0)) / 2.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("lanes", [0, None])
def test_events_of_every_run(lanes: int | None) -> None:
    """To the bits of simulate one after the other, within the tolerance side by side."""
    pendulum = compiled("double_pendulum", "cython", lanes)
    near = 0.0 if lanes == 0 else 1e-10
    starts = {"theta1": np.linspace(0.2, 1.2, 7), "bend": 0.1}
    watched = {"low": "theta1", "fast": {"expression": "theta1_dot - 2", "terminal": 2, "direction": 1}}
    ensemble = pendulum.simulate_many(4, starts, events=watched, keep_events=40, **TIGHT)
    t, x = ensemble.events("low")
    assert ensemble.event_names == ("low", "fast")
    for j in range(7):
        run = pendulum.simulate(4, {"theta1": starts["theta1"][j], "bend": 0.1}, events=watched, **TIGHT)
        k = len(run.t_events["low"])
        np.testing.assert_allclose(t[:k, j], run.t_events["low"], rtol=0, atol=near)
        np.testing.assert_allclose(x[:, :k, j], run.x_events["low"], rtol=0, atol=10 * near)
        assert np.isnan(t[k:, j]).all()
        assert ensemble.event_counts[j] == k + len(run.t_events["fast"])
        assert abs(ensemble.t_end[j] - run.t[-1]) <= near
        assert ensemble.status[j] == run.status
    assert 1 in ensemble.status
    assert ensemble.ok.all()
    alone = pendulum.simulate_many(4, starts, events=watched, keep_events=2, reduce="events", **TIGHT)
    np.testing.assert_array_equal(alone.event_counts, ensemble.event_counts)
    assert alone.x is None
    with pytest.raises(eg.UsageError, match="event falls of simulate_many is a function"):
        pendulum.simulate_many(4, starts, events={"falls": lambda t, x: x[0]})


def test_resets_of_the_model() -> None:
    m = eg.Model("bouncing", gravity=(0, -10.0, 0))
    m.parameter("e", 0.5)
    m.prismatic("y", m.ground, m.body("ball", mass=1.0), axis="y")
    m.event("floor", "y", direction=-1, reset={"y_dot": "-e*y_dot"})
    module = m.compile()
    e = np.array([0.3, 0.5, 0.9])
    ensemble = module.simulate_many(1.2, {"y": 5.0 / 4.0}, {"e": e}, **TIGHT)
    first = 0.5  # sqrt(2 h / g), with speed 5 m/s
    second = first + 2 * e * 5.0 / 10.0
    t, _ = ensemble.events("floor")
    np.testing.assert_allclose(t[0], first, rtol=1e-9)
    np.testing.assert_allclose(t[1, :2], second[:2], rtol=1e-9)
    np.testing.assert_allclose(ensemble["y_dot"][2], 0.9 * 5.0 - 10.0 * 0.7, rtol=1e-8)


def test_without_compiled_code(pendulum: Any, pendulum_in_numpy: Any) -> None:
    times = [0.0, 0.5, 1.0]
    theirs = pendulum_in_numpy.simulate_many(1, angles(3), t_eval=times, **TIGHT)
    np.testing.assert_allclose(
        theirs.samples, pendulum.simulate_many(1, angles(3), t_eval=times, **TIGHT).samples, atol=1e-9
    )
    stiff = pendulum.simulate_many(1, angles(2), method="LSODA", **TIGHT)
    np.testing.assert_allclose(stiff.x, pendulum.simulate_many(1, angles(2), **TIGHT).x, rtol=0, atol=1e-7)


def test_no_runs_and_one_run(pendulum: Any) -> None:
    assert pendulum.simulate_many(1, np.empty((4, 0))).x.shape == (4, 0)
    assert pendulum.simulate_many(1).count == 1
    alike = pendulum.simulate_many(1, {"theta1": 0.4}, count=5)
    assert (alike.x == alike.x[:, :1]).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"initial": {"theta3": 1.0}}, "did you mean theta2 or theta1"),
        ({"initial": {"theta1": [1.0, np.nan]}}, r"initial theta1 must be finite; entry \[1\] is nan"),
        ({"initial": np.zeros((3, 5))}, r"initial must have shape \(4,\) or \(4, k\)"),
        ({"initial": {"theta1": [1, 2]}, "parameters": {"g": [1, 2, 3]}}, "initial theta1: 2"),
        ({"parameters": {"g": [1, 2], "m1": [1, 2, 3]}}, "parameter g: 2, parameter m1: 3"),
        ({"parameters": {"mass": 1.0}}, "no parameter 'mass'"),
        ({"initial": {"theta1": "a"}}, "initial theta1 must hold real numbers"),
        ({"reduce": "mean"}, "reduce must be"),
        ({"threads": 0}, "threads must be a whole number of at least 1"),
        ({"rtool": 1e-3}, "did you mean rtol"),
        ({"cluster": -1}, "cluster must be True"),
        ({"method": len}, "name of a method"),
        ({"t_eval": [3.0, 2.0]}, "t_eval must be times in order"),
    ],
)
def test_wrong_words(pendulum: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(eg.UsageError, match=message):
        pendulum.simulate_many(1, **options)


def test_functions_of_time_are_refused(crank: Any) -> None:
    with pytest.raises(eg.UsageError, match="input tau of simulate_many must be a number"):
        crank.simulate_many(1, inputs={"tau": lambda t, x: 0.0})


def test_an_interrupt_is_honoured_soon(tmp_path: Path) -> None:
    code = (
        "import signal, sys; sys.path.insert(0, sys.argv[1])\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)  # jobs in the background ignore it\n"
        "from ensembles.conftest import compiled; from ensembles.test_simulate_many import TIGHT, angles\n"
        "mod = compiled('double_pendulum', 'cython'); print('ready', flush=True)\n"
        "mod.simulate_many(1e4, angles(4000), **TIGHT)"
    )
    command = [sys.executable, "-c", code, str(Path(__file__).parents[1])]
    with child(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"ready\n"
        time.sleep(1.0)
        start = time.perf_counter()
        process.send_signal(signal.SIGINT)
        errors = process.communicate(timeout=30)[1]
    assert time.perf_counter() - start < 5.0  # the machine may be busy
    assert process.returncode != 0
    assert b"KeyboardInterrupt" in errors


def test_what_an_ensemble_offers(pendulum: Any, tmp_path: Path) -> None:
    times = np.linspace(0, 1, 5)
    ensemble = pendulum.simulate_many(1, angles(6), {"g": np.linspace(1, 9, 6)}, t_eval=times)
    table = ensemble.to_pandas()
    np.testing.assert_array_equal(table["g"], np.linspace(1, 9, 6))
    np.testing.assert_array_equal(table["theta1"], ensemble.x[0])
    starts = {name: column.tolist() for name, column in table.items() if name.startswith("initial_")}
    assert starts == {f"initial_{name}": angles(6)[name].tolist() for name in ("theta1", "bend")}
    rows = ensemble.to_pandas(samples=True)
    assert len(rows) == 6 * 5
    np.testing.assert_array_equal(rows[rows["run"] == 4]["t"], times)
    np.testing.assert_array_equal(rows[rows["run"] == 4]["bend"], ensemble.samples[1, :, 4])
    np.testing.assert_array_equal(rows[rows["t"] == 0.0]["initial_theta1"], rows[rows["t"] == 0.0]["theta1"])
    with pytest.raises(eg.UsageError, match="kept no samples"):
        pendulum.simulate_many(1, angles(6)).to_pandas(samples=True)
    np.testing.assert_allclose(ensemble.trajectory(3).x[:, -1], ensemble.x[:, 3], rtol=0, atol=1e-7)
    with np.load(ensemble.save(tmp_path / "runs")) as data:
        np.testing.assert_array_equal(data["samples"], ensemble.samples)
    axes = ensemble.plot("theta2")
    assert len(axes.lines) == 6
    assert axes.get_ylabel() == r"$\theta_{2}$ (rad)"
    assert ensemble.plot("bend").get_ylabel() == "bend (rad)"
    with pytest.raises(KeyError, match="theta2"):
        ensemble["theta3"]
    assert "6 runs" in repr(ensemble)


def test_inputs_given_win_over_declared_signals_and_reach_the_outputs() -> None:
    m = eg.Model("driven")
    m.prismatic("s", m.ground, m.body("a", mass=2.0), axis="x")
    m.torque("drive", "s", m.input("push", signal="5*sin(3*t)"))
    m.input("other")
    m.output("force", "push")
    module = m.compile()
    declared = module.simulate_many(2, {"s_dot": [0.0, 1.0]}, t_eval=[1.0, 2.0], **TIGHT)
    np.testing.assert_allclose(declared["s_dot"][-1] - [0.0, 1.0], 5 / 3 * (1 - np.cos(6.0)) / 2, rtol=0, atol=1e-9)
    np.testing.assert_allclose(declared["force"], 5 * np.sin([[3.0, 3.0], [6.0, 6.0]]), rtol=1e-12)
    again = module.simulate(2, **declared.case(1), **TIGHT)
    np.testing.assert_allclose(again["s_dot"][-1], declared["s_dot"][-1, 1], rtol=0, atol=1e-9)
    constant = module.simulate_many(2, inputs={"push": [1.0, 3.0]}, **TIGHT)
    np.testing.assert_allclose(constant["s_dot"], [1.0, 3.0], rtol=1e-9)
    np.testing.assert_array_equal(constant["force"], [1.0, 3.0])
    again = module.simulate(2, **constant.case(1), **TIGHT)
    np.testing.assert_allclose(again["s_dot"][-1], constant["s_dot"][1], rtol=1e-12)
    texts = module.simulate_many(2, {"s": [0.0, 1.0]}, inputs={"push": "10*t + s"}, t_eval=[2.0], **TIGHT)
    np.testing.assert_allclose(texts["force"][0], 20.0 + texts["s"][0], rtol=1e-12)


def test_outputs_of_a_run_that_an_event_ended_are_those_at_the_event(pendulum: Any) -> None:
    m = eg.Model("falling", gravity=(0, -10, 0))
    m.prismatic("h", m.ground, m.body("a", mass=1.0), axis="y")
    m.output("when", "t")
    module = m.compile()
    floor = {"floor": {"expression": "h", "terminal": 1}}
    ensemble = module.simulate_many(5, {"h": [1.25, 5.0, 1000.0]}, events=floor, **TIGHT)
    np.testing.assert_allclose(ensemble["when"], [0.5, 1.0, 5.0], rtol=1e-9)
    np.testing.assert_allclose(ensemble.to_pandas()["when"], [0.5, 1.0, 5.0], rtol=1e-9)
    assert ensemble.summary()["when"]["least"] == pytest.approx(0.5)
    alone = module.simulate(5, **ensemble.case(0), **TIGHT).t[-1]
    np.testing.assert_allclose(alone, ensemble.t_end[0], rtol=1e-14)  # lanes have bits of their own
    statistics = module.simulate_many(5, {"h": [1.25, 5.0, 1000.0]}, events=floor, reduce="statistics", **TIGHT)
    assert statistics["when"] == pytest.approx((0.5 + 1.0 + 5.0) / 3)
    for other in ("LSODA", "RK45"):
        some = module.simulate_many(5, {"h": [1.25, 1000.0]}, events=floor, t_eval=[0.1, 4.0], method=other, **TIGHT)
        np.testing.assert_allclose(some.t_end, [0.5, 5.0], rtol=1e-6)
        np.testing.assert_allclose(some.samples[0], [[1.2, 999.95], [np.nan, 920.0]], rtol=1e-6)


def test_an_output_that_cannot_be_evaluated_is_nan_in_its_run_alone() -> None:
    m = eg.Model("rooted")
    m.prismatic("s", m.ground, m.body("a", mass=1.0), axis="x")
    m.output("root", "sqrt(s)")
    module = m.compile()
    starts = {"s": [4.0, -1.0, 9.0]}
    np.testing.assert_array_equal(module.simulate_many(1, starts)["root"], [2.0, np.nan, 3.0])
    made = module.simulate_many(1, starts, reduce="statistics")
    row = {name: k for k, name in enumerate(made.names)}
    assert made.reduced["count"][:, 0].tolist() == [3, 3, 2]
    assert made.reduced["mean"][row["root"], 0] == 2.5
    assert made.reduced["mean"][row["s"], 0] == 4.0


def test_fixed_steps_and_runs_that_fail(pendulum: Any) -> None:
    with pytest.raises(eg.UsageError, match="method RK4 needs step="):
        pendulum.simulate_many(1, angles(3), method="RK4")
    made = pendulum.simulate_many(1, angles(3), method="RK4", step=0.01)
    assert (made.steps == 100).all()
    alone = pendulum.simulate(1, **made.case(2), method="RK4", step=0.01)
    np.testing.assert_array_equal(alone.x[:, -1], made.x[:, 2])
    failed = pendulum.simulate_many(1, angles(3), max_steps=2)
    assert np.isnan(failed["theta1"]).all()
    assert np.isfinite(failed.reached).all()


def test_any_name_serves_a_reduction_of_ones_own(pendulum: Any, tmp_path: Path) -> None:
    def keep(block: Any) -> dict[str, Any]:
        return {"mean": block.x.mean(), "x": block.x[0], "file": 1.0, "runs_t": block.t}

    made = pendulum.simulate_many(1, angles(5), reduce=keep, store=tmp_path / "runs")
    assert set(made.reduced) == {"mean", "x", "file", "runs_t"}
    assert made.x is None
    with pytest.raises(eg.UsageError, match="kept only the results of its reduction"):
        made["theta1"]
    with pytest.raises(eg.UsageError, match="belongs to another ensemble: reduce differ"):
        pendulum.simulate_many(1, angles(5), reduce=lambda block: {"x": block.x[1]}, store=tmp_path / "runs")


def test_what_a_thread_raises_comes_out() -> None:
    from eomgen.ensembles.block import work

    class Broken:
        done = 0

        def work(self) -> None:
            raise MemoryError("no room")

        def stop(self) -> None:
            self.done = 1

    with pytest.raises(MemoryError, match="no room"):
        work(Broken(), 2, None)


def test_statistics_have_the_same_bits_in_any_blocks(pendulum: Any) -> None:
    made = [pendulum.simulate_many(1, angles(600), reduce="statistics", block=n).reduced for n in (1, 100, 300, 4096)]
    for other in made[1:]:
        for name, value in other.items():
            np.testing.assert_array_equal(value, made[0][name])
