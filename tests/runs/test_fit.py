"""Identification: parameters of measured motions beside SciPy's curve_fit; inertial ones beside Pinocchio's."""

from collections.abc import Sequence
from math import pi
from typing import Any

import numpy as np
import pandas as pd
import pinocchio as pin
import pytest
import xarray as xr
from analysed import compiled
from models import IN_C
from random_models import Clothes, Made, random_recipe
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


# -- inertial parameters -----------------------------------------------------------------------------------------------
KERNELS = ["inverse_dynamics", "inertial_terms"]
DOWN = (0.0, 0.0, -9.81)
Rows = Sequence[tuple[float, float, float, bool]]
#: Pinocchio's ten parameters (m, mc, xx, xy, yy, xz, yz, zz) in our order.
THEIRS = [0, 1, 2, 3, 4, 6, 9, 5, 7, 8]
#: Standard DH rows alpha, a, d, and whether the joint slides.  Scheinman's arm (Paul, Robot Manipulators, 1981, table
#: 2.1); PUMA 560 with its offsets (Armstrong, Khatib, Burdick, ICRA 1986).
STANFORD = [(-pi / 2, 0, 0.412, False), (pi / 2, 0, 0.154, False), (0, 0, 0, True), (-pi / 2, 0, 0, False),
            (pi / 2, 0, 0, False), (0, 0, 0.263, False)]  # fmt: skip
SCARA = [(0, 0.3, 0.4, False), (0, 0.25, 0, False), (0, 0, 0, False), (0, 0, 0, True)]
PUMA = [(-pi / 2, 0, 0, False), (0, 0.4318, 0.2435, False), (pi / 2, -0.0203, -0.0934, False),
        (-pi / 2, 0, 0.4331, False), (pi / 2, 0, 0, False), (0, 0, 0, False)]  # fmt: skip


def chain(rows: Rows, gravity: Sequence[float]) -> Any:
    """A serial robot whose links are described in the frames of their joints."""
    m = eg.Model("chain", gravity=tuple(gravity))
    place: Any = m.ground
    random = np.random.default_rng(2)
    for k, (alpha, a, d, slides) in enumerate(rows):
        link = m.body(f"link{k}", 2.0, com=tuple(random.uniform(-0.1, 0.1, 3).tolist()), inertia=(0.3, 0.25, 0.2))
        (m.prismatic if slides else m.revolute)(f"q{k}", place, link, axis="z")
        place = link.at(a, 0, d, rpy=(alpha, 0, 0))
    return m.derive("recursive").compile(target="numpy", kernels=KERNELS)


@pytest.mark.parametrize("gravity", [DOWN, (1.0, 2.0, -9.0)], ids=["along", "across"])
@pytest.mark.parametrize(
    ("rows", "number"), [(STANFORD, 33), (SCARA, 8), (PUMA, 36)], ids=["stanford", "scara", "puma"]
)
def test_columns_and_number_are_those_of_pinocchios_regressor(
    rows: Rows, number: int, gravity: Sequence[float]
) -> None:
    """The number is the rank at 100 random states; 36 of PUMA is published (Mayeda, Yoshida, Osuka, IEEE Trans. RA 6,
    1990); by Khalil's rules a first link that turns about another axis than gravity's has two more (sec. 9.4)."""
    module, arm, joint, place = chain(rows, gravity), pin.Model(), 0, pin.SE3.Identity()
    arm.gravity.linear = np.array(gravity)
    for k, (alpha, a, d, slides) in enumerate(rows):
        joint = arm.addJoint(joint, pin.JointModelPZ() if slides else pin.JointModelRZ(), place, f"q{k}")
        place = pin.SE3(pin.utils.rotate("x", alpha), np.array([a, 0.0, d]))
    data, random = arm.createData(), np.random.default_rng(8)
    blocks = []
    for _ in range(100):
        q, v, a = random.uniform(-2, 2, (3, arm.nv))
        blocks.append(pin.computeJointTorqueRegressor(arm, data, q, v, a))
    Y = module.regressor(q, v, a).reshape(arm.nv, -1, 10)
    expected = blocks[-1].reshape(arm.nv, -1, 10)[:, :, THEIRS]
    assert (np.abs(Y - expected) <= 1e-12 * np.abs(expected).max()).all()
    pi_of = np.array(list(module.standard_parameters().values()))
    assert Y.reshape(arm.nv, -1) @ pi_of == pytest.approx(module.inverse_dynamics(q, v, a), abs=1e-10)
    sizes = np.linalg.svd(np.concatenate(blocks), compute_uv=False)
    rank = int((sizes > 1e-8 * sizes[0]).sum())
    assert sizes[rank] < 1e-13 * sizes[0] < 1e-3 * sizes[0] < sizes[rank - 1]
    assert rank == len(module.base_parameters()) == number + (2 if gravity != DOWN else 0)


@pytest.mark.parametrize(
    "case",
    [
        (("revolute", "screw", "spherical"), 4, "euler_angles"),
        (("continuous", "universal", "free"), 4, "euler_parameters"),
        (("prismatic", "constant_velocity", "point_on_curve"), 4, "euler_angles"),
        (("cylindrical", "planar", "weld", "revolute"), 5, "euler_angles"),
        (("surface_slider", "point_on_surface", "spherical", "translational"), 5, "euler_parameters"),
    ],
    ids=lambda c: "-".join(c[0]),
)
def test_number_and_forces_do_not_depend_on_frames(case: Any) -> None:
    group, count, rotation = case
    recipe = random_recipe(5, [*group, *group][:count], rotation)
    module = Made(recipe).compile("recursive", kernels=KERNELS)
    turned = Made(recipe, Clothes(frames=True)).compile(kernels=KERNELS)
    base, other = module.base_parameters(), turned.base_parameters()
    assert len(base) == len(other) == len(module.base_parameters(seed=3)) < len(base.standard)
    random = np.random.default_rng(6)
    q = random.uniform(-1, 1, (module.n_q, 3))
    v, a = random.normal(size=(2, module.n_v, 3))
    torque = turned.inverse_dynamics(q, v, a)
    for one in (base, other):
        forces = np.einsum("ijk,j->ik", one.regressor(q, v, a), np.array(list(one.values.values())))
        assert forces == pytest.approx(torque, rel=0, abs=1e-11 * np.abs(torque).max())
    standard = np.array(list(turned.standard_parameters().values()))
    for k in range(3):  # the regressor knows nothing of the inertia
        Y = turned.regressor(q[:, k], v[:, k], a[:, k])
        assert Y @ standard == pytest.approx(torque[:, k], rel=0, abs=1e-11 * np.abs(torque).max())


def test_loops_keep_their_number_however_they_are_described() -> None:
    """Forces along the free motion are those of the standard parameters."""
    bases = [compiled(name).base_parameters() for name in ("four_bar", "skewed_four_bar")]
    assert len(bases[0]) == len(bases[1])
    for base in bases:
        module = base.module
        x = module.project(module.x0() + 0.2)
        q, v = x[: module.n_q], x[module.n_q :]
        a = module.rhs(0.0, x)[module.n_q :]
        free = np.linalg.svd(module.constraint_jacobian(q, rows="all"))[2][-module.n_dof :]
        reduced = free @ base.regressor(q, v, a) @ np.array(list(base.values.values()))
        torque = module.inverse_dynamics(q, v, a)
        assert reduced == pytest.approx(free @ torque, abs=1e-9 * np.abs(torque).max())
        refuses("EG-UNSUPPORTED constraints", base.fit, q[:, None], v[:, None], a[:, None], a[:, None])


def planar_arm(**further: Any) -> eg.Model:
    """Two links, l = 0.5, with friction in both joints."""
    m = eg.Model("arm", gravity=(0, -9.81, 0))
    for name, value in {"d": 0.15, "f": 0.2, "J": 0.01, "g": 9.81, "w": 1.2, "length": 0.5}.items():
        m.parameter(name, value)
    m.body("upper", 2.0, com=(0.25, 0.01, 0), inertia={"zz": 0.05}, markers={"tip": ("length", 0, 0)})
    m.body("lower", "w", com=(0.2, 0, 0), inertia={"zz": 0.03})
    m.revolute("shoulder", m.ground, "upper", coordinate="a", **further)
    m.revolute("elbow", "upper.tip", "lower", coordinate="b")
    m.friction("in_shoulder", "shoulder", viscous="d")
    m.friction("in_elbow", "elbow", coulomb="f", smoothing=0.05)
    m.torque("squared", "elbow", "-0.01*d**2*b_dot")
    return m


def test_planar_arm_has_its_textbook_combinations() -> None:
    """I1 + m2 l1^2, m1 c1 + m2 l1, I2, m2 c2 (Siciliano et al., Robotics, 2009, sec. 7.3.2)."""
    base = planar_arm().compile(target="numpy").base_parameters()
    assert base.texts == {
        "Izz(upper)": "Izz(upper) + 0.25 m(lower)",
        "mx(upper)": "mx(upper) + 0.5 m(lower)",
        "my(upper)": "my(upper)",
        "Izz(lower)": "Izz(lower)",
        "mx(lower)": "mx(lower)",
        "my(lower)": "my(lower)",
    }
    assert base.values["Izz(upper)"] == pytest.approx(0.05 + 2.0 * (0.25**2 + 0.01**2) + 1.2 * 0.25, rel=1e-14)
    assert base.values_of({"m(lower)": 2.0})["mx(upper)"] == pytest.approx(0.5 + 1.0)
    assert "m(upper)" in base.without_effect
    assert "of 20 standard ones" in repr(base)
    assert base.combination.shape == (len(base), 20)
    longer = planar_arm().compile(target="numpy").base_parameters(p={"length": 1.0})
    assert longer.texts["mx(upper)"] == "mx(upper) + m(lower)"


def motion() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two sums of sines with their exact derivatives."""
    t = np.linspace(0, 10, 600)
    parts = [((1.0, 2.0, 0.0), (0.5, 3.3, 1.0)), ((1.0, 2.7, 1.6), (0.6, 4.1, 0.0))]
    q, v, a = (
        np.array([sum(s * w**n * np.sin(w * t + f + n * pi / 2) for s, w, f in row) for row in parts]) for n in range(3)
    )
    return q, v, a


def test_base_parameters_and_friction_come_back() -> None:
    """Exactly from exact forces; within their errors from noisy ones, as often as a normal distribution says."""
    module = planar_arm().compile(target="numpy")
    base, (q, v, a) = module.base_parameters(), motion()
    tau = module.inverse_dynamics(q, v, a)
    truth = base.values | {"f": 0.2}
    exact = base.fit(q, v, a, tau, also=["f"])
    assert list(exact.values.values()) == pytest.approx(list(truth.values()), abs=1e-12)
    assert exact.condition < 10.0
    random, distances = np.random.default_rng(1), []
    for _ in range(8):
        noisy = tau + random.normal(size=tau.shape) * np.array([[0.1], [0.02]])
        noisy[0, ::50] = np.nan
        found = base.fit(q, v, a, noisy, also=["f"])
        distances += [(found.values[n] - x) / found.errors[n] for n, x in truth.items()]
        assert found.sigma == pytest.approx({"a_dot": 0.1, "b_dot": 0.02}, rel=0.15)
    far = np.abs(distances)
    assert far.max() < 3.8
    assert 0.5 < (far < 1.0).mean() < 0.85
    assert (far < 2.0).mean() > 0.9
    assert "+-" in repr(found)
    assert found.relative_errors["Izz(upper)"] < 0.02
    given = base.fit(q, v, a, noisy, also=["f"], sigma=[0.1, 0.02])
    W = np.concatenate([np.vstack([base.regressor(q, v, a)[i], np.zeros((1, 600))]).T / s for i, s in
                        enumerate((0.1, 0.02))])  # fmt: skip
    W[600:, -1] = np.tanh(v[1] / 0.05) / 0.02  # the law of friction, smoothed
    y = np.concatenate([(noisy[0] - 0.15 * v[0]) / 0.1, (noisy[1] - 0.01 * 0.15**2 * -v[1] * -1.0) / 0.02])
    there = np.isfinite(y)
    expected, *_ = np.linalg.lstsq(W[there], y[there], rcond=None)
    assert list(given.values.values()) == pytest.approx(expected, rel=1e-8, abs=1e-9)
    assert given.covariance == pytest.approx(np.linalg.inv(W[there].T @ W[there]), rel=1e-6, abs=1e-14)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"also": ["nothing"]}, "EG-NAME-UNKNOWN nothing"),
        ({"also": ["d"]}, "EG-UNSUPPORTED d"),
        ({"also": ["w"]}, "EG-UNSUPPORTED already"),
        ({"tau": np.zeros((2, 3))}, "EG-SHAPE tau 2"),
        ({"tau": np.full((2, 600), np.nan)}, "EG-SHAPE tau 0 6"),
        ({"sigma": [1.0, -1.0]}, "EG-RANGE sigma"),
    ],
)
def test_bad_fits_say_what_is_wrong(change: dict[str, Any], words: str) -> None:
    module = planar_arm().compile(target="numpy")
    q, v, a = motion()
    tau = change.pop("tau", None)
    tau = module.inverse_dynamics(q, v, a) if tau is None else tau
    refuses(words, lambda: module.base_parameters().fit(q, v, a, tau, **change))


def test_what_is_not_inertial_remains() -> None:
    module = planar_arm(armature="J").compile(target="numpy", kernels=KERNELS)
    q, v, a = np.array([[0.3, 1.0], [-0.8, 0.2]]), np.array([[1.0, -2.0], [0.5, 1.5]]), np.array([[3.0, 0], [0, -4]])
    rubbing = 0.2 * np.tanh(v[1] / 0.05) + 0.01 * 0.15**2 * v[1]
    found = module.inertial_remainder(q, v, a)
    assert found == pytest.approx(np.array([0.01 * a[0] + 0.15 * v[0], rubbing]), abs=1e-13)
    other = {"w": 3.0, "J": 0.1, "d": 0.15}
    assert module.standard_parameters(other)["mx(lower)"] == pytest.approx(0.6, rel=1e-15)
    assert module.standard_parameters()["Ixy(upper)"] == pytest.approx(-2.0 * 0.25 * 0.01)
    assert module.inertial_remainder(q, v, a, p=other)[0] == pytest.approx(0.1 * a[0] + 0.15 * v[0], abs=1e-13)
    one, out = module.regressor(q[:, 1], v[:, 1], a[:, 1]), np.empty((2, 20, 2))
    assert module.regressor(q, v, a, out=out) is out
    assert one == pytest.approx(out[:, :, 1], abs=1e-14)


def test_wrong_calls_say_what_is_wrong() -> None:
    module = planar_arm().compile(target="numpy")
    refuses("EG-SHAPE (2,)", module.regressor, [0.1], [0.1, 0.2], [0.1, 0.2])
    refuses("EG-SHAPE states", module.regressor, np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 4)))
    bare = eg.Model.from_equations("bare", ["x"], mass_matrix=[["1"]], forcing=["-x"]).compile(target="numpy")
    refuses("EG-UNSUPPORTED bodies", bare.regressor, [0.1], [0.1], [0.1])
    refuses("EG-RANGE least 0 1 -1", module.base_parameters, least=-1)
