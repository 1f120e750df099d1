"""Parameters of measured motions: against SciPy's curve_fit, known values under noise, other units and tables."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from models import IN_C
from refusals import refuses
from scipy.optimize import curve_fit
from scipy.stats import chi2

import eomgen as eg

TIMES = np.linspace(0.0, 2.0, 81)


def arm(**values: Any) -> eg.Model:
    """A two-link arm that swings with viscous and smoothed dry friction; eight parameters that its motion tells."""
    m = eg.Model("arm", gravity=(0, -9.81, 0))
    given = {"m2": 2.0, "m3": 1.2, "I2": 0.05, "I3": 0.03, "d1": 0.15, "d2": 0.08, "f1": 0.4, "f2": 0.2} | values
    for name, value in given.items():
        m.parameter(name, value)
    m.body("upper", mass="m2", com=(0.25, 0, 0), inertia={"zz": "I2"}, markers={"tip": (0.5, 0, 0)})
    m.body("lower", mass="m3", com=(0.2, 0, 0), inertia={"zz": "I3"})
    m.revolute("shoulder", m.ground, "upper", coordinate="a")
    m.revolute("elbow", "upper.tip", "lower", coordinate="b")
    m.friction("in_shoulder", "shoulder", coulomb="f1", viscous="d1", smoothing=0.05)
    m.friction("in_elbow", "elbow", coulomb="f2", viscous="d2", smoothing=0.05)
    m.torque("drive", "shoulder", m.input("tau"))
    return m


START = {"a": 0.6, "b": -0.9}
DRIVE = {"tau": "4*sin(5*t) + 3*sin(2.3*t)"}


@pytest.fixture(scope="module")
def module() -> eg.Module:
    return arm().compile(**IN_C)


def measured(module: eg.Module, seed: int, noise: float = 0.002, **changed: Any) -> dict[str, np.ndarray]:
    """Angles and rates with noise."""
    run = module.simulate(2.0, initial=START, inputs=DRIVE, parameters=changed or None, t_eval=TIMES)
    random = np.random.default_rng(seed)
    spread = {"a": noise, "b": 2 * noise, "a_dot": 5 * noise}
    return {"t": TIMES, **{name: run[name] + random.normal(0.0, s, len(TIMES)) for name, s in spread.items()}}


def test_eight_parameters_of_an_arm_come_back(module: eg.Module) -> None:
    """All eight within three standard errors, six times, and as far as a normal distribution says.

    The squared distances in the metric of each fit's covariance add up to chi-squared with 48 degrees of freedom, so
    that errors and correlations together are neither too small nor too large.
    """
    guess = {name: 1.3 * float(module.p[k]) for k, name in enumerate(module.p_names)}
    assert len(guess) == 8
    distances, squares = [], []
    for seed in range(6):
        fit = module.fit(measured(module, seed), guess, initial=START, inputs=DRIVE, derivatives="differences")
        assert fit.success
        assert not fit.undetermined
        assert not fit.at_bounds
        assert 0.7 < fit.reduced_chi_squared < 1.3
        off = np.array([fit.values[name] - value for name, value in zip(module.p_names, module.p, strict=True)])
        distances.append(np.abs(off / [fit.errors[name] for name in module.p_names]))
        squares.append(off @ np.linalg.solve(fit.covariance, off))
    far = np.array(distances)
    assert far.max() < 3.0
    low, high = chi2.ppf([0.01, 0.99], 8 * 6)
    assert low < sum(squares) < high
    assert 0.45 < (far < 1.0).mean() < 0.87
    assert (far < 2.0).mean() > 0.88
    assert fit.sigma == pytest.approx({"a": 0.002, "b": 0.004, "a_dot": 0.01}, rel=0.3)


def test_estimates_and_covariance_are_those_of_curve_fit(module: eg.Module) -> None:
    """With exact derivatives, against SciPy's curve_fit of the runs."""
    names, data = ("m3", "I2", "d1"), measured(module, 3)
    sigma = {"a": 0.002, "b": 0.004, "a_dot": 0.01}
    fit = module.fit(data, names, initial=START, inputs=DRIVE, sigma=sigma, xtol=1e-12, ftol=1e-12)

    def runs(_: Any, *values: float) -> np.ndarray:
        given = dict(zip(names, values, strict=True))
        run = module.simulate(2.0, initial=START, inputs=DRIVE, parameters=given, t_eval=TIMES, rtol=1e-11, atol=1e-13)
        return np.concatenate([run[name] for name in sigma])

    y, spread = np.concatenate([data[n] for n in sigma]), np.repeat(list(sigma.values()), len(TIMES))
    expected, covariance = curve_fit(
        runs, None, y, [1.2, 0.05, 0.15], spread, absolute_sigma=True, xtol=1e-12, ftol=1e-12, epsfcn=1e-9
    )
    assert list(fit.values.values()) == pytest.approx(expected, rel=1e-5)
    assert fit.covariance == pytest.approx(covariance, rel=1e-3)
    assert fit.correlation == pytest.approx(covariance / np.sqrt(np.outer(*[np.diag(covariance)] * 2)), abs=1e-3)
    assert fit.reduced_chi_squared == pytest.approx(1.0, abs=0.2)
    assert "m3" in str(fit)
    rough = module.fit(data, names, initial=START, inputs=DRIVE, sigma=sigma, derivatives="differences")
    assert rough.covariance == pytest.approx(covariance, rel=1e-2)


def test_what_the_data_do_not_tell_is_named(module: eg.Module) -> None:
    """A stiffness and a spring beside it add up; a parameter that nothing depends on."""
    m = eg.Model("two_springs")
    for name, value in (("k1", 3.0), ("k2", 2.0), ("unused", 1.0), ("w", 1.5)):
        m.parameter(name, value)
    m.prismatic("J", m.ground, m.body("ball", mass="w"), axis="x", coordinate="s")
    m.torque("spring", "J", "-(k1 + k2)*s")
    m.output("idle", "0*unused*s")
    mod = m.compile(target="numpy")
    run = mod.simulate(3.0, initial={"s": 0.5}, t_eval=np.linspace(0, 3, 40))
    data = {"t": run.t, "s": run["s"] + np.random.default_rng(1).normal(0, 1e-3, 40)}
    fit = mod.fit(data, {"k1": 2.0, "k2": 2.5, "unused": 1.0}, initial={"s": 0.5})
    assert fit.values["k1"] + fit.values["k2"] == pytest.approx(5.0, abs=0.05)
    named = [set(direction) for direction in fit.undetermined]
    assert {"unused"} in named or any("unused" in one for one in named)
    assert len(fit.undetermined) == 2
    assert all(np.isinf(fit.errors[name]) for name in ("k1", "k2", "unused"))
    assert "not distinguished" in repr(fit)


def test_units_orders_and_kinds_of_tables_do_not_matter(module: eg.Module) -> None:
    data, names = measured(module, 5), ("m3", "d1", "f2")
    given = {"initial": START, "inputs": DRIVE}
    one = module.fit(data, names, **given)
    table = pd.DataFrame({name: data[name] for name in ("a_dot", "b", "a")}, index=data["t"])
    others = [
        module.fit(table, names[::-1], **given),
        module.fit(table.reset_index(names="t"), names, **given),
        module.fit(table.rename_axis("t").to_xarray(), names, **given),
        module.fit([data], names, initial=[START], inputs=[DRIVE]),
    ]
    gaps = dict(data, a=data["a"].copy())
    gaps["a"][::7] = np.nan
    for other in others:
        for name in names:
            assert other.values[name] == pytest.approx(one.values[name], rel=1e-5)
            assert other.errors[name] == pytest.approx(one.errors[name], rel=1e-3)
    assert module.fit(gaps, names, **given).values["m3"] == pytest.approx(one.values["m3"], abs=one.errors["m3"])


def test_several_experiments_initial_values_and_inputs_together() -> None:
    """Noise-free runs of a pendulum give back its parameter, its start and the constant that drives it."""
    m = eg.Model("pendulum", gravity=(0, -9.81, 0))
    m.parameter("c", 0.2)
    m.body("rod", mass=1.0, com=(0, -0.5, 0), inertia={"zz": 0.02})
    m.revolute("A", m.ground, "rod", coordinate="theta")
    m.joint_damper("d", "A", damping="c")
    m.torque("motor", "A", m.input("tau", 0.5))
    mod, t = m.compile(target="numpy"), np.linspace(0.0, 3.0, 61)
    runs = [mod.simulate(3.0, initial={"theta": 0.7, "theta_dot": v}, t_eval=t) for v in (0.0, 1.5)]
    fit = mod.fit(
        [{"t": t, "theta": run["theta"]} for run in runs],
        {"c": 0.05, "theta": 0.4, "tau": 0.0},
        initial=[{"theta_dot": 0.0}, {"theta_dot": 1.5}],
    )
    assert fit.values == pytest.approx({"c": 0.2, "theta": 0.7, "tau": 0.5}, rel=1e-6)
    assert fit.parameters == {"c": fit.values["c"]}
    assert fit.initial == {"theta": fit.values["theta"]}
    assert len(fit.trajectories) == 2
    at_bound = mod.fit({"t": t, "theta": runs[0]["theta"]}, {"c": 0.4}, initial=START_OF_ONE, bounds={"c": (0.3, 1.0)})
    assert at_bound.at_bounds == ("c",)
    assert np.isnan(at_bound.errors["c"])
    assert "at its bound" in str(at_bound)


START_OF_ONE = {"theta": 0.7, "theta_dot": 0.0}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameters": ["m9"]}, "EG-NAME-UNKNOWN m9"),
        ({"parameters": ["m2", "m2"]}, "EG-MISSING once"),
        ({"data": {"t": TIMES}}, "EG-TYPE columns"),
        ({"data": {"t": TIMES[::-1], "a": TIMES}}, "EG-TYPE increasing"),
        ({"data": {"t": TIMES, "a": TIMES[:-1], "q": TIMES}}, "EG-TYPE q"),
        ({"data": {"t": TIMES, "a": TIMES[:-1]}}, "EG-TYPE shape"),
        ({"data": {"t": TIMES, "a": np.full(81, np.nan)}}, "EG-TYPE finite"),
        ({"data": {"t": TIMES[:2], "a": [1, 2]}, "parameters": ["m2", "m3"]}, "EG-SHAPE data"),
        ({"bounds": {"m2": (3.0, 4.0)}}, "EG-RANGE bounds"),
        ({"sigma": {"a": 1.0, "b": 1.0}}, "EG-MISSING sigma a_dot"),
        ({"derivatives": "numeric"}, "EG-CHOICE differences"),
        ({"inputs": {"tau": 1.0}, "parameters": ["tau"]}, "EG-CONFLICT tau"),
        ({"initial": [0.0, 0.0, 0.0, 0.0], "parameters": ["a"]}, "EG-MISSING name"),
        ({"speed": 1}, "EG-NAME-UNKNOWN speed"),
    ],
)
def test_bad_calls_say_what_is_wrong(module: eg.Module, change: dict[str, Any], message: str) -> None:
    call = {"data": measured(module, 0), "parameters": ["m2"], "initial": START, "inputs": DRIVE} | change
    refuses(message, module.fit, **call)


def test_tables_of_runs_and_units_that_tables_tell(module: eg.Module) -> None:
    """A run, its Dataset, its DataFrame, and one in degrees and milliseconds say the same."""
    run = module.simulate(2.0, initial=START, inputs=DRIVE, t_eval=TIMES)
    given = run.to_xarray()
    degrees = xr.Dataset(
        {name: ("t", np.degrees(run[name]), {"units": unit}) for name, unit in (("a", "deg"), ("b_dot", "deg/s"))},
        {"t": ("t", 1000.0 * TIMES, {"units": "ms"})},
    )
    later = run.to_pandas().set_index(pd.to_timedelta(TIMES, unit="s"))
    headed = {"t [ms]": 1000.0 * TIMES, "a [deg]": np.degrees(run["a"]), "b_dot": run["b_dot"]}
    for data in (run, given, run.to_pandas(), degrees, later, headed):
        fit = module.fit(data, {"m3": 1.5, "d1": 0.1}, initial=START, inputs=DRIVE, derivatives="differences")
        assert list(fit.values.values()) == pytest.approx([1.2, 0.15], rel=1e-6)
    wrong = given[["a"]].assign(a=given["a"].assign_attrs(units="kg"))
    dates = run.to_pandas().set_index(pd.to_datetime(TIMES, unit="s"))
    for data, message in ((wrong, "EG-TYPE kg rad"), (dates, "EG-TYPE t")):
        refuses(message, module.fit, data, ["m3"], initial=START, inputs=DRIVE)
