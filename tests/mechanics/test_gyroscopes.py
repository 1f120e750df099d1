"""Gyroscopes, a gyrostat and a reaction wheel against closed forms: heavy_top.json and spacecraft_analytic.json."""

from typing import Any

import numpy as np
import pytest
import rotations
from models import reference
from sweeps import METHODS

import eomgen as eg

TOP = reference("heavy_top")
CRAFT = reference("spacecraft_analytic")


def gyroscope(mount: str, numbers: dict[str, Any], g: float = 9.81) -> eg.Model:
    """A heavy rotor with its centre of mass out of the fixed point: in two gimbals without mass, or on a ball joint."""
    A, C, mass, length = (float(numbers[key]) for key in ("A", "C", "m", "l"))
    m = eg.Model("gyroscope", gravity=(0, 0, -g))
    rotor = m.body("rotor", mass=mass, com=(0, 0, length), inertia=(A - mass * length**2, A - mass * length**2, C))
    tip = rotor.at(0, 0, 1)
    for level in ("position", "velocity", "acceleration"):
        for k, axis in enumerate("xyz"):
            m.output(f"{level}_{axis}", getattr(tip, level)[k])
    if mount == "ball":
        m.spherical("s", m.ground, rotor, rotation="euler_parameters")
        return m
    outer, inner = m.body("outer", mass=0), m.body("inner", mass=0)
    m.revolute("precession", m.ground, outer)
    m.revolute("nutation", outer, inner, axis="x")
    m.revolute("spin", inner, rotor)
    return m


def start(mount: str, theta: float, precession: float, spin: float) -> dict[str, float]:
    if mount == "gimbals":
        return {"nutation": theta, "precession_dot": precession, "spin_dot": spin}
    w = (0.0, precession * np.sin(theta), spin + precession * np.cos(theta))
    rates = {f"s_w{axis}": value for axis, value in zip("xyz", w, strict=True)}
    return {"s_e0": np.cos(theta / 2), "s_e1": np.sin(theta / 2)} | rates


def axle(module: Any, x: np.ndarray) -> np.ndarray:
    """The rotor's axis in ground axes."""
    return np.asarray(module.poses(x[: module.n_q])[module.body_names.index("rotor"), :3, 2])


P = TOP["parameters_SI"] | {"A": TOP["parameters_SI"]["A_about_fixed_point"]}
CASES = [(mount, method) for mount in ("gimbals", "ball") for method in sorted(METHODS)]


@pytest.mark.parametrize(("mount", "method"), CASES)
def test_a_gyroscope_precesses_steadily(mount: str, method: str) -> None:
    """A W^2 cos(theta) - C w3 W + m g l = 0 (Goldstein, sec. 5.7); with its axle level, W = m g l / (C w3)."""
    module = gyroscope(mount, P).compile(method=method, target="numpy")
    for name, rates in TOP["steady_precession"].items():
        theta, w3 = np.radians(float(name[5:7])), float(name.split("_w3_")[1])
        for W in map(float, rates):
            x = module.x0(start(mount, theta, W, w3 - W * np.cos(theta)))
            place, velocity, acceleration = module.outputs(0.0, x).reshape(3, 3)
            np.testing.assert_allclose(place, axle(module, x), rtol=0, atol=1e-14)
            np.testing.assert_allclose(velocity, W * np.cross([0, 0, 1], place), rtol=0, atol=1e-12 * w3)
            np.testing.assert_allclose(acceleration, W * np.cross([0, 0, 1], velocity), rtol=0, atol=1e-12 * w3**2)


@pytest.mark.parametrize("mount", ["gimbals", "ball"])
def test_nutation_of_a_gyroscope_let_go(mount: str) -> None:
    """Released with its axle at rest: lowest point, period and precession of a nutation, by elliptic integrals."""
    case = TOP["cusp_case"]
    module = gyroscope(mount, case, TOP["parameters_SI"]["g"]).compile(target="numpy")
    period, theta = float(case["nutation_period"]), np.radians(case["theta0_deg"])
    begin, times = start(mount, theta, 0.0, float(case["spin0"])), period * np.array([0, 0.5, 1, 2, 3])
    traj = module.simulate((0, 3 * period), begin, t_eval=times, rtol=1e-12, atol=1e-13)
    axes = np.array([axle(module, x) for x in traj.x.T])
    lean = np.arccos(axes[:, 2])
    np.testing.assert_allclose(lean[[0, 2, 3, 4]], theta, atol=1e-9)
    assert lean[1] == pytest.approx(float(case["theta_max"]), abs=1e-9)
    turned = np.unwrap(np.arctan2(axes[:, 1], axes[:, 0]))
    advance = float(case["precession_advance_per_nutation"])
    np.testing.assert_allclose(turned[2:] - turned[0], advance * np.arange(1, 4), atol=1e-9)


def test_a_sleeping_top_is_stable_above_the_known_spin() -> None:
    """w3^2 > 4 A m g l / C^2: a lean of a millionth grows or does not, upright, where Euler angles zxz are singular."""
    module = gyroscope("ball", P).compile(target="numpy")
    least, lean = float(TOP["sleeping_top_min_w3"]), 1e-6
    for factor, stable in ((0.99, False), (1.01, True)):
        begin = start("ball", lean, 0.0, factor * least)
        traj = module.simulate(10.0, initial=begin, rtol=1e-12, atol=1e-14)
        most = max(float(np.hypot(*axle(module, x)[:2])) for x in traj.x.T)
        assert most < 20 * lean if stable else most > 1e3 * lean


def spacecraft(transverse: float, axial: float, wheel: float) -> eg.Model:
    """A free body with a wheel along z at its centre of mass; moments of inertia of the whole, and of the wheel."""
    m = eg.Model("craft")
    hull = m.body("hull", mass=50.0, inertia=(transverse - wheel / 2, transverse - wheel / 2, axial - wheel))
    rotor = m.body("wheel", mass=1.0, inertia=(wheel / 2, wheel / 2, wheel))
    m.free("f", m.ground, hull, rotation="euler_parameters")
    m.revolute("spin", hull, rotor)
    return m


@pytest.mark.parametrize("method", ["embedding", "newton_euler"])
@pytest.mark.parametrize("held", [False, True])
def test_an_axisymmetric_gyrostat(held: bool, method: str) -> None:
    """w1 = w10 cos(l t), w2 = -w10 sin(l t), l = ((It - I3) w3 - J Omega) / It; held: at constant relative speed."""
    case = CRAFT["gyrostat_axisymmetric"]
    m = spacecraft(case["It"], case["I3"], case["J"])
    if held:
        m.coupling("drive", equation=f"spin_dot - {case['Omega_rel']}")
    module = m.compile(method=method, target="numpy")
    assert module.n_dof == (6 if held else 7)
    w0 = dict(zip(("f_wx", "f_wy", "f_wz"), map(float, case["omega0"]), strict=True))
    times = [0.0, *map(float, case["omega_t"])]
    begin = w0 | {"spin_dot": case["Omega_rel"]}
    traj = module.simulate((0, max(times)), begin, t_eval=times, rtol=1e-12, atol=1e-13)
    w = np.array([traj[f"f_w{axis}"] for axis in "xyz"])
    for k, expected in enumerate(case["omega_t"].values(), 1):
        np.testing.assert_allclose(w[:, k], [float(x) for x in expected], atol=1e-10)
    H = np.array([case["It"], case["It"], case["I3"]])[:, None] * w + [[0], [0], [case["J"]]] * traj["spin_dot"]
    np.testing.assert_allclose((H * H).sum(axis=0), float(case["H2"]), rtol=1e-11)
    e = np.array([traj[f"f_e{k}"] for k in range(4)])
    ground = np.array([rotations.matrix(e[:, k]) @ H[:, k] for k in range(len(times))])
    np.testing.assert_allclose(ground, np.tile(ground[0], (len(times), 1)), atol=1e-9)


@pytest.mark.parametrize("method", ["embedding", "recursive"])
def test_a_reaction_wheel_turns_its_craft(method: str) -> None:
    """From rest to a relative speed W: the body turns at -J W / (I + J), whatever the motor does."""
    case = CRAFT["reaction_wheel"]
    J, W = float(case["Jw"]), float(case["from_rest_wheel_relative_speed"])
    m = spacecraft(case["Ib"] + J, case["Ib"] + J, J)
    m.torque("motor", "spin", m.input("tau"))
    module = m.compile(method=method, target="numpy")
    run = 4.0
    # tau (1/J + 1/I) is the relative acceleration; a pulse of half a sine has the mean 2/pi
    peak = W / (run * 2 / np.pi * (1 / J + 1 / case["Ib"]))
    tau = {"tau": lambda t, x: peak * np.sin(np.pi * t / run)}
    traj = module.simulate((0, run), inputs=tau, rtol=1e-11, atol=1e-12)
    assert traj["spin_dot"][-1] == pytest.approx(W, rel=1e-9)
    assert traj["f_wz"][-1] == pytest.approx(float(case["body_rate"]), rel=1e-9)
