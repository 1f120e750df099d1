"""Many runs at once: against SciPy and closed forms, bits however they are shared out, kept in folders, on workers."""

import tracemalloc
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import analysed
import distributed
import models
import numpy as np
import pytest
from models import IN_C
from refusals import refused, refuses
from scipy.integrate import solve_ivp

import eomgen as eg
from eomgen.base import value_rules

TIGHT = {"rtol": 1e-10, "atol": 1e-12}


@cache
def compiled(name: str, target: str = "cython", lanes: int | None = None) -> Any:
    if lanes is None:
        return analysed.compiled(name, target)
    return models.build(name).compile(target=target, optimize=0, lanes=lanes)


@pytest.fixture
def pendulum() -> Any:
    """A double pendulum: a tree, run in lanes."""
    return compiled("double_pendulum")


@pytest.fixture
def crank() -> Any:
    """A slider-crank: a loop."""
    return compiled("slider_crank")


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
    refuses("EG-TYPE mapping", lambda: pendulum.simulate_many(1, angles(3), reduce=lambda block: block.x))


def assert_as_good(found: Any, run: Any, exact: Any, lanes: int | None, near: float) -> None:
    """A run of an ensemble: near to that of simulate; in lanes, which have other steps, it errs about as much."""
    if lanes == 0:
        np.testing.assert_allclose(found, run, rtol=0, atol=near)
    errors = [float(np.abs(x - exact).max()) for x in (found, run)]
    assert errors[0] < 4.0 * errors[1] + 1e-9 * np.abs(exact).max()


@pytest.mark.parametrize("lanes", [pytest.param(0, marks=pytest.mark.thorough), None])
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
    start, loose = {"theta": 1.2, "theta_dot": 10.0}, {"rtol": 1e-4, "atol": 1e-5}
    turning = crank.simulate_many((1.0, 2.0), start, {"r": lengths}, events={"end": "s_dot"}, keep_events=9, **loose)
    assert turning.t_end.tolist() == [2.0, 1.0, 2.0, 2.0]
    for j in (0, 2, 3):  # states between steps are closed too
        (x,) = turning.events("end")[1][:, :1, j].T
        assert np.abs(crank.bind({"r": lengths[j]}).constraints(x[: crank.n_q], rows="all")).max() < 1e-12


def test_runs_that_fail_are_marked_and_say_why() -> None:
    module = compiled("oscillator")
    # v' = -a s^3 reaches infinity in finite time for a < 0 and swings for a > 0
    ensemble = module.simulate_many(20, {"s": 1.0}, {"a": np.array([1.0, -1.0, 2.0, -3.0])}, max_steps=5000)
    assert ensemble.status.tolist()[0] == ensemble.status.tolist()[2] == 0
    assert [f.run for f in ensemble.failures()] == [1, 3]
    assert all("step size" in f.message for f in ensemble.failures())
    # the time of escape of s' = s^2 / sqrt(2) from rest at s = 1: integral of ds / sqrt((s^4 - 1) / 2)
    assert ensemble.t_end[1] == pytest.approx(1.8540746773013719, abs=1e-6)
    assert ensemble.t_end[3] == pytest.approx(1.8540746773013719 / np.sqrt(3), abs=1e-6)
    short = module.simulate_many(20, {"s": 1.0}, {"a": np.array([1.0, 2.0])}, max_steps=3)
    assert [f.message for f in short.failures()] == ["more than max_steps steps"] * 2
    assert (short.steps == 3).all()


def test_runs_with_parameters_that_the_model_refuses_are_named_and_the_others_go_on(crank: Any) -> None:
    start, grid = {"theta_dot": 10.0}, {"m_s": [-1.0, 0.5, 1.0], "r": [0.1, 0.12]}
    runs = crank.simulate_many(0.1, start, grid=grid, t_eval=[0.05])
    allowed = crank.simulate_many(0.1, start, grid=grid | {"m_s": [0.5, 1.0]}, t_eval=[0.05])
    np.testing.assert_array_equal(runs.samples[:, :, 2:], allowed.samples)
    for k, (failure, r) in enumerate(zip(runs.failures(), (0.1, 0.12), strict=True)):
        assert (failure.run, failure.values) == (k, {"m_s": -1.0, "r": r})
        assert str(failure).startswith(f"run {k} (r = {r}, m_s = -1) did not begin: bodies.slider.mass: is -1")
    for block in (1, 4):
        parts = crank.simulate_many(0.1, start, grid=grid, t_eval=[0.05], block=block)
        np.testing.assert_array_equal(parts.samples, runs.samples)
        assert parts.failures() == runs.failures()
    with pytest.raises(eg.ParameterError, match="bodies.slider.mass: is -1 .* in run 0, .* in all 2 runs"):
        crank.simulate_many(0.1, parameters={"m_s": [-1.0, -2.0]})


def test_runs_with_parameters_that_are_no_numbers_are_named_and_the_others_go_on(crank: Any) -> None:
    runs = crank.simulate_many(0.1, {"theta_dot": 10.0}, {"m_s": [0.5, np.nan, 1.0, np.inf], "r": 0.12})
    allowed = crank.simulate_many(0.1, {"theta_dot": 10.0}, {"m_s": [0.5, 1.0], "r": 0.12})
    np.testing.assert_array_equal(runs.x[:, ::2], allowed.x)
    assert [str(failure) for failure in runs.failures()] == [
        f"run {k} (m_s = {x}) did not begin: parameter m_s: must be finite; it is {x}"
        for k, x in ((1, "nan"), (3, "inf"))
    ]
    p = np.repeat(crank.p[:, None], 2, axis=1)
    p[0, 1] = np.nan
    assert crank.simulate_many(0.1, parameters=p).ok.tolist() == [True, False]
    for values in (np.nan, [np.nan, -1.0], [np.inf]):
        refuses("EG-NUMBER m_s finite", crank.simulate_many, 0.1, parameters={"m_s": values})
    refuses("EG-NUMBER theta_dot finite", crank.simulate_many, 0.1, {"theta_dot": [1.0, np.nan]})


def test_rules_are_judged_of_those_runs_whose_parameters_are_within_their_ranges(
    crank: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They take 0.3 ms a run; a single set of parameters is told all that is wrong with it."""
    for place in ("mass", "inertia"):
        refuses(f"EG-RANGE bodies.crank.{place}", crank.bind, {"m_c": -1.0})
    monkeypatch.setattr(value_rules, "fault_of_inertia", None)
    runs = crank.simulate_many(0.01, parameters={"m_c": [1.0, -1.0, 0.5, -2.0]})
    assert [(one.run, one.message.count("bodies.crank")) for one in runs.failures()] == [(1, 1), (3, 1)]


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


def test_resets_of_the_model() -> None:
    e = np.array([0.3, 0.5, 0.9])
    ensemble = compiled("hopper").simulate_many(1.2, {"h": 5.0 / 4.0}, {"e": e, "g": 10.0}, **TIGHT)
    first = 0.5  # sqrt(2 h / g), with speed 5 m/s
    second = first + 2 * e * 5.0 / 10.0
    t, _ = ensemble.events("floor")
    np.testing.assert_allclose(t[0], first, rtol=1e-9)
    np.testing.assert_allclose(t[1, :2], second[:2], rtol=1e-9)
    np.testing.assert_allclose(ensemble["h_dot"][2], 0.9 * 5.0 - 10.0 * 0.7, rtol=1e-8)


def test_without_compiled_code(pendulum: Any) -> None:
    times = [0.0, 0.5, 1.0]
    theirs = compiled("double_pendulum", "numpy").simulate_many(1, angles(3), t_eval=times, **TIGHT)
    np.testing.assert_allclose(
        theirs.samples, pendulum.simulate_many(1, angles(3), t_eval=times, **TIGHT).samples, atol=1e-9
    )
    stiff = pendulum.simulate_many(1, angles(2), method="LSODA", **TIGHT)
    np.testing.assert_allclose(stiff.x, pendulum.simulate_many(1, angles(2), **TIGHT).x, rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"initial": {"theta3": 1.0}}, "EG-NAME-UNKNOWN theta1"),
        ({"initial": {"theta1": [1.0, np.nan]}}, "EG-NUMBER initial theta1"),
        ({"initial": np.zeros((3, 5))}, "EG-SHAPE (4,)"),
        ({"initial": {"theta1": [1, 2]}, "parameters": {"g": [1, 2, 3]}}, "EG-SHAPE initial theta1 2"),
        ({"parameters": {"mass": 1.0}}, "EG-NAME-UNKNOWN mass"),
        ({"reduce": "mean"}, "EG-CHOICE reduce"),
        ({"rtool": 1e-3}, "EG-NAME-UNKNOWN 'rtool' rtol"),
        ({"events": {"falls": lambda t, x: x[0]}}, "EG-UNSUPPORTED simulate_many"),
        ({"t_eval": [3.0, 2.0]}, "EG-RANGE t_eval"),
    ],
)
def test_wrong_names(pendulum: Any, options: dict[str, Any], message: str) -> None:
    refuses(message, pendulum.simulate_many, 1, **options)


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
    refuses("EG-UNSUPPORTED samples", lambda: pendulum.simulate_many(1, angles(6)).to_pandas(samples=True))
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
    module = m.compile(**IN_C)
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
    table = ([0.0, 0.4, 2.0], [1.0, -2.0, 3.0])
    tabled = module.simulate_many(2, {"s_dot": [0.0, 1.0]}, inputs={"push": table}, **TIGHT)
    impulse = np.trapezoid(table[1], table[0])
    np.testing.assert_allclose(tabled["s_dot"] - [0.0, 1.0], impulse / 2, rtol=0, atol=1e-9)
    refuses("EG-TYPE simulate_many", module.simulate_many, 2, inputs={"push": lambda t, x: 0.0})
    texts = module.simulate_many(2, {"s": [0.0, 1.0]}, inputs={"push": "10*t + s"}, t_eval=[2.0], **TIGHT)
    np.testing.assert_allclose(texts["force"][0], 20.0 + texts["s"][0], rtol=1e-12)


def test_outputs_of_a_run_that_an_event_ended_are_those_at_the_event() -> None:
    m = eg.Model("falling", gravity=(0, -10, 0))
    m.prismatic("h", m.ground, m.body("a", mass=1.0), axis="y")
    m.output("when", "t")
    module = m.compile(**IN_C)
    floor = {"floor": {"expression": "h", "terminal": 1}}
    ensemble = module.simulate_many(5, {"h": [1.25, 5.0, 1000.0]}, events=floor, **TIGHT)
    np.testing.assert_allclose(ensemble["when"], [0.5, 1.0, 5.0], rtol=1e-9)
    np.testing.assert_allclose(ensemble.to_pandas()["when"], [0.5, 1.0, 5.0], rtol=1e-9)
    assert ensemble.summary()["when"]["least"] == pytest.approx(0.5)
    alone = module.simulate(5, **ensemble.case(0), **TIGHT).t[-1]
    np.testing.assert_allclose(alone, ensemble.t_end[0], rtol=1e-14)  # lanes have bits of their own
    statistics = module.simulate_many(5, {"h": [1.25, 5.0, 1000.0]}, events=floor, reduce="statistics", **TIGHT)
    assert statistics["when"] == pytest.approx((0.5 + 1.0 + 5.0) / 3)


def test_fixed_steps_and_runs_that_fail(pendulum: Any) -> None:
    refuses("EG-MISSING RK4 step=", lambda: pendulum.simulate_many(1, angles(3), method="RK4"))
    made = pendulum.simulate_many(1, angles(3), method="RK4", step=0.01)
    assert (made.steps == 100).all()
    alone = pendulum.simulate(1, **made.case(2), method="RK4", step=0.01)
    np.testing.assert_array_equal(alone.x[:, -1], made.x[:, 2])
    failed = pendulum.simulate_many(1, angles(3), max_steps=2)
    assert np.isnan(failed["theta1"]).all()
    assert np.isfinite(failed.reached).all()


@pytest.mark.parametrize("method", ["DOP853", "RK45"])
def test_a_run_without_lanes_has_the_bits_of_simulate(method: str) -> None:
    pendulum = compiled("double_pendulum", "cython", 0)
    options = {"rtol": 1e-6, "atol": 1e-8, "max_step": 0.2, "method": method}
    ensemble = pendulum.simulate_many((1, -1), angles(13), **options)
    for j in range(13):
        run = pendulum.simulate((1, -1), **ensemble.case(j), **options)
        np.testing.assert_array_equal(run.x[:, -1], ensemble.x[:, j])
        assert len(run.t) - 1 == ensemble.steps[j]
        assert run.nfev == ensemble.evaluations[j]


def test_statistics_do_not_depend_on_threads_and_blocks_nor_ends_on_lanes(pendulum: Any) -> None:
    k, times = 600, np.linspace(0, 2, 3)
    statistics = [
        pendulum.simulate_many(2, angles(k), t_eval=times, reduce="statistics", **options, **TIGHT).reduced
        for options in ({}, {"threads": 1, "block": 256})
    ]
    for name, value in statistics[0].items():
        np.testing.assert_array_equal(value, statistics[1][name])
    one = compiled("double_pendulum", "cython", 0)  # a state at a time with the steps of simulate
    ends = [module.simulate_many(2, angles(k), **TIGHT).x for module in (one, pendulum)]
    np.testing.assert_allclose(*ends, rtol=0, atol=3e-8)


def shares(module: Any, span: Any, columns: dict[str, Any], k: int, parameters: Any = (), **options: Any) -> list[Any]:
    """The same runs on one thread, on several, in blocks, backwards and some of them alone."""

    def some(chosen: Any) -> tuple[dict[str, Any], ...]:
        return tuple(
            {n: x[chosen] if np.ndim(x) else x for n, x in part.items()} for part in (columns, dict(parameters))
        )

    few = slice(k // 3, k // 3 + 3)
    return [
        (module.simulate_many(span, *some(slice(None)), threads=1, **options), slice(None)),
        (module.simulate_many(span, *some(slice(None)), threads=3, **options), slice(None)),
        (module.simulate_many(span, *some(slice(None)), threads=2, block=5, **options), slice(None)),
        (module.simulate_many(span, *some(slice(None)), threads=2, block=1, **options), slice(None)),
        (module.simulate_many(span, *some(slice(None, None, -1)), threads=2, **options), slice(None, None, -1)),
        (module.simulate_many(span, *some(few), **options), few),
    ]


def compare(found: list[Any]) -> None:
    """Compare states, samples and numbers of steps to the last bit."""
    whole = found[0][0]
    assert whole.ok.all()
    for other, chosen in found[1:]:
        np.testing.assert_array_equal(other.x, whole.x[:, chosen])
        np.testing.assert_array_equal(other.steps, whole.steps[chosen])
        np.testing.assert_array_equal(other.rejected, whole.rejected[chosen])
        np.testing.assert_array_equal(other.evaluations, whole.evaluations[chosen])
        if whole.samples is not None:
            np.testing.assert_array_equal(other.samples, whole.samples[..., chosen])


@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau", "Taylor"])
def test_the_bits_of_a_tree(pendulum: Any, method: str) -> None:
    columns = {"theta1": np.linspace(-2.5, 2.5, 37), "bend": 0.3, "bend_dot": np.linspace(2, -2, 37)}
    compare(shares(pendulum, 2, columns, 37, method=method, t_eval=[0.3, 1.1, 2.0], **TIGHT))


def test_the_bits_of_a_loop(crank: Any) -> None:
    columns = {"theta": np.linspace(0.1, 1.2, 14), "theta_dot": np.linspace(5, 12, 14)}
    lengths, masses = {"r": np.linspace(0.09, 0.11, 14)}, {"m_s": np.linspace(1, 2, 14)}
    for chosen, parameters in ((columns, {}), (columns, lengths), ({"theta_dot": 5.0}, lengths), (columns, masses)):
        compare(shares(crank, 0.5, chosen, 14, parameters, t_eval=[0.1, 0.5], **TIGHT))


@pytest.mark.filterwarnings("ignore:theta = ")
def test_loops_of_many_runs_close_as_that_of_one(crank: Any) -> None:
    """Also through a dead centre of what is given, out of reach, and far away."""
    r, theta = np.linspace(0.09, 0.11, 7), np.linspace(-3, 4, 7)
    for initial, parameters in (
        ({}, {"r": r, "l": 0.3 + r}),
        ({"theta": theta, "theta_dot": 1.0}, {"l": 0.3 + r}),
        ({"s": np.linspace(0.2, 0.5, 7), "s_dot": 0.1}, {}),
        ({"theta_dot": theta}, {"r": [*r[:6], 1.0]}),
        ({"B": 0.2}, {"l": 0.3 + r}),
        ({"s": [1e300, -1e18, 1e5, 0.4, 0.41, 0.42, 0.43]}, {}),
        ({"theta": [1e19, 1e4, 1000, 999, 195, 40, 1]}, {}),
    ):
        runs = crank.simulate_many((0, 1e-9), initial or None, parameters, t_eval=[0.0])
        for k in range(7):
            case = runs.case(k)
            if runs.ok[k]:
                alone = crank.x0(case["initial"], p=case["parameters"])
                np.testing.assert_allclose(runs.samples[:, 0, k], alone, rtol=0, atol=1e-12)
            else:
                with pytest.raises(eg.EomgenError) as refused:
                    crank.x0(case["initial"], p=case["parameters"])
                assert str(refused.value) in [one.message for one in runs.failures() if one.run == k]


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_parameters_by_column(target: str) -> None:
    crank = compiled("slider_crank", target)
    x, p = np.repeat(crank.x0()[:, None], 9, axis=1), crank.p[:, None] * np.linspace(0.9, 1.1, 9)
    each = np.array([crank.rhs(0.0, x[:, k], p=p[:, k]) for k in range(9)]).T
    np.testing.assert_allclose(crank.rhs(0.0, x, p=p), each, rtol=1e-13, atol=1e-13)
    refuses("EG-SHAPE p rhs (6, 9)", crank.rhs, 0.0, x[:, 0], p=p)
    for call in (crank.multipliers, crank.reactions):
        alone = np.stack([call(0.0, x[:, k], p=p[:, k]) for k in range(9)], axis=-1)
        np.testing.assert_array_equal(call(0.0, x, p=p), alone)
    refuses("EG-SHAPE p (6,) (6, k) (6, 9)", crank.multipliers, 0.0, x[:, :4], p=p)
    refuses("EG-SHAPE p regressor (6,) (6, 9)", crank.regressor, x[:3], x[3:], x[3:], p=p)
    refuses("EG-SHAPE parameters (6,) (6, 9) simulate_many", crank.bind, p=p)
    many = np.tile(x, 100), np.tile(p, 100)
    tracemalloc.start()
    size = crank.rhs(0.0, many[0], p=many[1]).nbytes
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 2 * size  # no constants of all columns at a time
    p[0, 4] = np.nan
    refuses("EG-NOT-FINITE rhs theta", crank.rhs, 0.0, x, p=p)


def test_a_grid_has_every_combination() -> None:
    crank = compiled("slider_crank", "numpy")
    grid = {"theta": (-0.5, 0.5, 3), "r": [0.09, 0.11], "tau": [0.0, 1.0]}
    runs = crank.simulate_many(0.05, {"theta_dot": 0.2}, grid=grid, rtol=1e-9)
    assert runs.count == 12
    shaped = runs["theta"].reshape(3, 2, 2)
    for i, theta in enumerate((-0.5, 0.0, 0.5)):
        for j, r in enumerate((0.09, 0.11)):
            for k, tau in enumerate((0.0, 1.0)):
                start = {"theta": theta, "theta_dot": 0.2}
                alone = crank.simulate(0.05, start, {"r": r}, {"tau": tau}, rtol=1e-10, atol=1e-12)
                assert shaped[i, j, k] == pytest.approx(alone["theta"][-1], abs=1e-7)


@pytest.mark.parametrize(
    ("grid", "told"),
    [
        ({"thta": [1]}, "EG-NAME-UNKNOWN thta"),
        ({}, "EG-MISSING grid"),
        ([1, 2], "EG-TYPE grid"),
        ({"theta_dot": [1]}, "EG-CONFLICT theta_dot"),
    ],
)
def test_faults_of_grids(crank: Any, grid: object, told: str) -> None:
    refuses(told, crank.simulate_many, 0.1, {"theta_dot": 0.2}, grid=grid)


# -- kept in folders, run on workers of dask.distributed ---------------------------------------------------------------
def test_only_what_is_missing_is_run_again(pendulum: Any, tmp_path: Path) -> None:
    whole = pendulum.simulate_many(1, angles(40))
    folder = tmp_path / "runs"
    pendulum.simulate_many(1, angles(40), store=folder, block=8)
    blocks = sorted(folder.glob("block_*.npz"))
    assert len(blocks) == 5
    for gone in (blocks[1], blocks[4]):  # as where a run was stopped
        gone.unlink()
    kept = {path: path.stat().st_mtime_ns for path in blocks if path.exists()}
    resumed = pendulum.simulate_many(1, angles(40), store=folder, block=8)
    np.testing.assert_array_equal(resumed.x, whole.x)
    np.testing.assert_array_equal(resumed.steps, whole.steps)
    assert sorted(folder.glob("block_*.npz")) == blocks
    assert all(path.stat().st_mtime_ns == written for path, written in kept.items())


def test_a_store_of_another_ensemble_is_refused(pendulum: Any, tmp_path: Path) -> None:
    pendulum.simulate_many(1, angles(4), store=tmp_path / "runs")
    for changed in (
        {"span": 2}, {"initial": angles(4, seed=1)}, {"parameters": {"g": 1.0}}, {"rtol": 1e-3},
    ):  # fmt: skip
        with refused("EG-FILE-DAMAGED ensemble"):
            pendulum.simulate_many(**{"span": 1, "initial": angles(4), **changed}, store=tmp_path / "runs")
    (tmp_path / "mine.txt").write_text("precious")
    refuses("EG-FILE ensemble", lambda: pendulum.simulate_many(1, angles(4), store=tmp_path))
    block = next((tmp_path / "runs").glob("block_*"))
    block.write_bytes(block.read_bytes()[:700])
    refuses("EG-FILE-DAMAGED remove", lambda: pendulum.simulate_many(1, angles(4), store=tmp_path / "runs"))


def test_what_a_killed_call_left_is_no_hindrance(pendulum: Any, tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    part = folder / ".manifest.json.0a1b2c3d"
    part.write_bytes(b"torn")
    whole = pendulum.simulate_many(1, angles(40), store=folder)
    assert not part.exists()
    names = sorted(path.name for path in folder.iterdir())
    assert len(names) > 2, "a kill would lose all of it"
    (folder / f".{names[0]}.0a1b2c3d").write_bytes(b"torn")
    (folder / names[0]).unlink()
    again = pendulum.simulate_many(1, angles(40), store=folder)
    assert sorted(path.name for path in folder.iterdir()) == names
    np.testing.assert_array_equal(again.x, whole.x)


def test_hostile_stores_are_refused(pendulum: Any, tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    pendulum.simulate_many(1, angles(20), store=folder, block=10)
    block, manifest = folder / "block_000000.npz", folder / "manifest.json"
    good, text = block.read_bytes(), manifest.read_text()
    with np.load(block) as data:
        arrays = {name: data[name] for name in data.files}
    changes: tuple[dict[str, Any], ...] = (
        {"runs_t": arrays["runs_t"][:3]}, {"x": arrays["x"][:1]}, {"x": arrays["x"] + 1.0}, {"more": np.zeros(3)},
        {"words": np.array("[1, 2]")}, {"words": np.array("[" * 99999)},
    )  # fmt: skip
    files = [{("old" if name == one else name): x for name, x in arrays.items()} for one in arrays]
    for damaged in (*files, *(arrays | change for change in changes)):
        np.savez(block, **damaged)
        with refused("EG-FILE-DAMAGED block_000000.npz"):
            pendulum.simulate_many(1, angles(20), store=folder)
    block.write_bytes(good)
    for other in ("{}", "[" * 99999, text.replace('"block": 10', '"block": -1')):
        manifest.write_text(other)
        with refused("EG-FILE-DAMAGED ensemble"):
            pendulum.simulate_many(1, angles(20), store=folder)


WARNINGS = pytest.mark.filterwarnings("default")  #: of distributed itself


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@WARNINGS
@pytest.mark.slow
def test_workers_give_the_same_bits(pendulum: Any, client: Any) -> None:
    here = pendulum.simulate_many(2, angles(50), **TIGHT)
    there = pendulum.simulate_many(2, angles(50), cluster=client, block=9, **TIGHT)
    np.testing.assert_array_equal(there.x, here.x)
    np.testing.assert_array_equal(there.evaluations, here.evaluations)


@WARNINGS
@pytest.mark.slow
def test_a_block_whose_task_fails_is_marked_and_the_others_are_kept(pendulum: Any, client: Any, tmp_path: Path) -> None:
    def refuse(block: Any) -> dict[str, Any]:
        if block.x[0].max() > 0.9 and np.isfinite(block.x).all():
            raise ArithmeticError("too high")
        return {"top": block.x[0].max()}

    starts = {"theta1": np.array([0.1, 0.2, 2.0, 0.3]), "theta1_dot": 0.0}
    ensemble = pendulum.simulate_many(1e-3, starts, reduce=refuse, cluster=client, block=1, store=tmp_path / "runs")
    (failure,) = ensemble.failures()
    assert failure.run == 2
    assert "ArithmeticError: too high" in failure.message
    assert len(list((tmp_path / "runs").glob("block_*.npz"))) == 3  # what failed is run again next time
