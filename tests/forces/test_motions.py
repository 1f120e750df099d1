"""Motions with force elements against closed forms: orbits, impacts, rolling, slopes, stick and slip, libration."""

from typing import Any

import models
import numpy as np
import pytest
from force_judges import fine_differences
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import eomgen as eg

TIGHT = {"rtol": 1e-11, "atol": 1e-13}


def planar(m: eg.Model, name: str, **body: Any) -> Any:
    """A body that moves in the x-y plane, coordinates <name>_x, _y, _3."""
    made = m.body(name, **body)
    m.planar(name, m.ground, made)
    return made


def test_a_kepler_orbit() -> None:
    """Against Kepler's equation to 34 digits, mu = 1, a = 1, e = 0.6."""
    given = models.reference("kepler")
    m = eg.Model("kepler")
    m.parameter("mu", 1.0)
    planar(m, "moon", mass=0.3, inertia={"zz": 1})
    m.point_gravity("sun", m.ground, "moon", mu="mu")
    mod = m.compile(target="numpy")
    times = sorted(float(t) for t in given["reference"])
    traj = mod.simulate((0, 10), initial={"moon_x": 0.4, "moon_y_dot": 2.0}, t_eval=times, rtol=1e-13, atol=1e-15)
    names = ("moon_x", "moon_y", "moon_x_dot", "moon_y_dot")
    found = np.array([[traj[name][k] for name in names] for k in range(len(times))])
    expected = np.array([[float(x) for x in given["reference"][f"{t:g}"]] for t in times])
    assert np.abs(found - expected).max() < 1e-10
    T, V = mod.energy(traj.x[:, -1])
    assert pytest.approx(-0.5, abs=1e-11) == (T + V) / 0.3  # -mu / (2 a)


def test_libration_under_the_gravity_gradient() -> None:
    """Pitch on a circular orbit: w = n sqrt(3 (I_roll - I_yaw) / I_pitch), of spacecraft_analytic.json."""
    mu, r, I = 3.986004418e14, 7.0e6, (120.0, 130.0, 40.0)  # roll, pitch, yaw
    n = np.sqrt(mu / r**3)
    m = eg.Model("satellite")
    arm = m.body("arm", mass=0)
    body = m.body("body", mass=1e-3, inertia=(I[2], I[0], I[1]))  # x radial (yaw), y along track, z pitch
    m.revolute("orbit", m.ground, arm)
    m.revolute("pitch", arm.at(r, 0, 0), body)
    m.point_gravity("earth", m.ground, "body", mu=mu, extent="maccullagh")
    mod = m.compile(target="numpy")
    h = 1e-4
    slope = [mod.rhs(0.0, mod.x0(orbit_dot=n, pitch=s))[mod.x_names.index("pitch_dot")] for s in (-h, h)]
    w = np.sqrt(-(slope[1] - slope[0]) / (2 * h))
    assert w == pytest.approx(0.00146472391522629193, rel=1e-7)


def bounce(e: float, v: float, formula: str, exponent: float) -> tuple[float, float]:
    """QuaternionSlot dropped at v onto a floor: velocity after, and the dissipation factor the model used."""
    m = eg.Model("ball")
    body = m.body("ball", mass=0.7)
    m.prismatic("z", m.ground.at(0, 0, 0.1), body, axis="z")
    law = {"exponent": exponent, "restitution": e, "velocity": v, "formula": formula}
    m.sphere_plane("floor", m.ground, body, radius=0.1, stiffness=2e4, **law)
    mod = m.compile(target="numpy")
    x = mod.x0(z=0.02, z_dot=-v)
    traj = mod.simulate((0, 0.6), initial={"z": 0.02, "z_dot": -v}, max_step=1e-3, **TIGHT)
    assert traj["z"].min() < -1e-3
    assert traj["z"][-1] > 0.01
    np.testing.assert_allclose(mod.rhs(0.0, x)[1], 0.0)  # no gravity, no contact
    pressed = mod.rhs(0.0, np.array([-0.01, -v]))[1] / mod.rhs(0.0, np.array([-0.01, 0.0]))[1]
    return float(traj["z_dot"][-1]), (pressed - 1) / v


@pytest.mark.parametrize(("formula", "exponent"), [("hunt_crossley", 1.5), ("lankarani", 1.5), ("flores", 1.2)])
def test_restitution_of_a_ball(formula: str, exponent: float) -> None:
    """m v dv = -k d^n (1 + l d') dd integrates to l v (1 + e) = log[(1 + l v) / (1 - l e v)] for every n and k."""
    asked, v = 0.8, 1.7
    after, l = bounce(asked, v, formula, exponent)
    meant = {
        "hunt_crossley": 3 * (1 - asked) / (2 * v),
        "lankarani": 3 * (1 - asked**2) / (4 * v),
        "flores": 8 * (1 - asked) / (5 * asked * v),
    }
    assert l == pytest.approx(meant[formula], rel=1e-12)

    def balance(e: float) -> float:
        return l * v * (1 + e) - np.log((1 + l * v) / (1 - l * e * v))

    e = brentq(balance, 0.3, 0.999, xtol=1e-14)
    assert after / v == pytest.approx(e, rel=1e-7)
    assert abs(e - asked) < 0.1


def test_a_ball_at_rest_sinks_in_by_its_weight_and_the_force_starts_without_a_jump() -> None:
    m = eg.Model("rest", gravity=(0, 0, -9.81))
    body = m.body("ball", mass=0.7)
    m.prismatic("z", m.ground.at(0, 0, 0.1), body, axis="z")
    m.sphere_plane("floor", m.ground, body, radius=0.1, stiffness=2e4, dissipation=2.0)
    mod = m.compile(target="numpy")
    depth = (0.7 * 9.81 / 2e4) ** (1 / 1.5)
    assert abs(mod.rhs(0.0, np.array([-depth, 0.0]))[1]) < 1e-12
    near = [mod.rhs(0.0, np.array([s, -1.0]))[1] + 9.81 for s in (-1e-10, 0.0, 1e-10)]
    assert near[1] == near[2] == 0.0
    assert 0 < near[0] < 1e-8
    slopes = [mod.jacobian(0.0, np.array([s, -1.0]))[1, 0] for s in (-1e-14, 0.0, 1e-14)]
    assert np.isfinite(slopes).all()
    assert abs(slopes[0]) < 0.02
    assert slopes[1] == slopes[2] == 0.0
    # pulled out faster than 1 / lambda: no force, never a pull
    assert mod.rhs(0.0, np.array([-depth, 0.6]))[1] == -9.81


def test_a_sliding_ball_ends_up_rolling() -> None:
    """A sphere thrown without spin rolls at v0 / (1 + I / (m r^2)) with the radius of the point of contact: 5/7 v0."""
    mass, r, v0, mu = 1.2, 0.2, 2.0, 0.25
    m = eg.Model("bowling", gravity=(0, -9.81, 0))
    body = planar(m, "ball", mass=mass, inertia={"zz": 0.4 * mass * r**2})
    floor = m.ground.at(0, 0, 0, rpy=(-np.pi / 2, 0, 0))  # its z axis points up, along y
    m.sphere_plane(
        "lane", floor, body, radius=r, stiffness=1e7, dissipation=1.0, friction=mu, smoothing=1e-4
    )  # fmt: skip
    depth = (mass * 9.81 / 1e7) ** (1 / 1.5)
    start = {"ball_y": r - depth, "ball_x_dot": v0}
    slip_ends = 2 * v0 / (7 * mu * 9.81)
    times = [0.5 * slip_ends, 2 * slip_ends]
    solver = {"method": "Radau", "rtol": 1e-8, "atol": 1e-10}
    traj = m.compile(target="numpy").simulate((0, times[1]), initial=start, t_eval=times, **solver)
    assert traj["ball_x_dot"][0] == pytest.approx(v0 - mu * 9.81 * 0.5 * slip_ends, rel=1e-5)
    arm = r - depth / 2
    assert traj["ball_x_dot"][1] == pytest.approx(v0 / (1 + 0.4 * r**2 / arm**2), rel=1e-5)
    assert traj["ball_x_dot"][1] == pytest.approx(5 / 7 * v0, rel=2e-4)
    assert traj["ball_3_dot"][1] == pytest.approx(-traj["ball_x_dot"][1] / arm, rel=1e-3)


def test_joint_friction_slows_down_and_stops() -> None:
    """Coulomb: v falls by coulomb / m a second; Stribeck and viscous against the formula."""
    m = eg.Model("sledge")
    m.prismatic("s", m.ground, m.body("b", mass=2.0), axis="x")
    m.friction("dry", "s", coulomb=3.0, smoothing=1e-3)
    mod = m.compile(target="numpy")
    traj = mod.simulate((0, 2), initial={"s_dot": 1.5}, t_eval=[0.5, 2.0], method="Radau", rtol=1e-10, atol=1e-12)
    assert traj["s_dot"][0] == pytest.approx(1.5 - 1.5 * 0.5, rel=1e-8)
    assert abs(traj["s_dot"][1]) < 1e-9
    assert traj["s"][1] == pytest.approx(1.5**2 / (2 * 1.5), rel=1e-5)

    m = eg.Model("stribeck")
    m.prismatic("s", m.ground, m.body("b", mass=1.0), axis="x")
    m.parameter("F", 3.0), m.parameter("b", 0.7)
    m.friction("dry", "s", viscous="b", coulomb="F", static="1.5*F", stribeck=0.2, smoothing=0.05)
    for method in ("embedding", "lagrange"):
        mod = m.compile(method=method, target="numpy")
        for v in (-1.3, -0.1, 0.0, 0.02, 0.3):
            level = 3.0 + 1.5 * np.exp(-((v / 0.2) ** 2))
            assert mod.rhs(0.0, np.array([0.4, v]))[1] == pytest.approx(-level * np.tanh(v / 0.05) - 0.7 * v, abs=1e-13)
            h = 1e-6
            slope = (mod.rhs(0.0, np.array([0.4, v + h]))[1] - mod.rhs(0.0, np.array([0.4, v - h]))[1]) / (2 * h)
            assert mod.jacobian(0.0, np.array([0.4, v]))[1, 1] == pytest.approx(slope, rel=1e-6)


def test_a_bushing_sets_the_frequencies() -> None:
    """Six frequencies of a body on a bushing at its centre of mass: sqrt(k / m) and sqrt(k / I)."""
    m = eg.Model("engine")
    body = m.body("engine", mass=4.0, inertia=(0.5, 0.8, 1.1))
    m.free("j", m.ground, body)
    k = [900.0, 1600.0, 2500.0, 30.0, 40.0, 50.0]
    m.bushing("mount", m.ground, body, stiffness=k)
    mod = m.compile(target="numpy")
    slopes = mod.jacobian(0.0, np.zeros(12))[6:, :6]
    found = np.sort(np.sqrt(np.linalg.eigvals(-slopes).real))
    expected = np.sort(np.sqrt(np.array(k) / [4, 4, 4, 0.5, 0.8, 1.1]))
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("method", ["embedding", "lagrange", "newton_euler"])
def test_a_bushing_keeps_its_digits_near_half_a_turn(method: str) -> None:
    """A body turned about a fixed axis n by phi: V = 2 sin(phi / 2)^2 n K n, so the torque is -n K n sin(phi)."""
    axis, K, inertia = np.array([1.0, -2.0, 3.0]) / np.sqrt(14), np.array([2.0, 3.0, 5.0]), 0.7
    m = eg.Model("mount")
    m.body("block", mass=0, inertia=[inertia] * 3)
    m.revolute("pin", m.ground, "block", axis=axis.tolist(), coordinate="phi")
    turned = [{"body": body, "rpy": [0.3, 0.2, 0.1]} for body in ("ground", "block")]
    m.bushing("mount", *turned, stiffness=[1.0, 1.0, 1.0, *K])
    mod = m.compile(target="numpy", method=method)
    along = Rotation.from_euler("ZYX", [0.1, 0.2, 0.3]).as_matrix().T @ axis
    k = float(along @ (K * along))
    for left in (1.0, 1e-1, 1e-2, 1e-3, 1e-5):
        for sign in (1.0, -1.0):
            phi = sign * (np.pi - left)
            error = mod.rhs(0.0, np.array([phi, 0.0]))[1] * inertia / k + np.sin(phi)
            # what is differentiated by the angle loses as 1 / e0
            assert abs(error) < (1e-14 / left if method == "lagrange" else 1e-15)


def test_a_nonlinear_pendulum_drive_on_an_angle() -> None:
    """torsional_element between markers and on the joint do the same; only the potential counts as energy."""
    results = []
    for on in ("joint", "markers"):
        m = eg.Model("drive")
        m.parameter("k", 2.0)
        disc = m.body("disc", mass=1, inertia={"zz": 0.4})
        m.revolute("phi", m.ground, disc)
        where = ("phi",) if on == "joint" else (m.ground, disc)
        m.torsional_element("motor", *where, potential="k*angle**4/4", law="-0.3*rate*abs(rate)")
        mod = m.compile(target="numpy")
        results.append(mod.rhs(0.0, np.array([1.2, -2.0]))[1])
        assert mod.energy(np.array([1.2, -2.0]))[1] == pytest.approx(2.0 * 1.2**4 / 4)
    np.testing.assert_allclose(results, (-2 * 1.2**3 + 0.3 * 4.0) / 0.4, rtol=1e-13)


def bearing_everything() -> eg.Model:
    """The slider-crank with one element of every kind, on tree and cut joints alike."""
    m = models.build("slider_crank")
    slider, crank, rod = "slider", "crank", "rod.tip"
    drum = {"around": m.ground.at(0.2, -0.3, 0), "radius": 0.05, "sense": "positive"}
    m.element("oil", m.ground.at(0.6, 0.1, 0), slider, law="-3*rate*abs(rate) + tau/length", via=[drum])
    m.element("stiff", "s", potential="50*length**4", law="-rate**3")
    m.torsional_element("drive", "theta", law="-0.01*rate*abs(rate)", potential="0.1*cos(angle)")
    m.bushing(
        "mount", m.ground.at(0.3, 0, 0), slider, stiffness=[20, 30, 40, 1, 2, 3], damping=[1, 1, 1, 0.1, 0.1, 0.1]
    )
    m.point_gravity("moon", m.ground.at(0.1, 0.8, 0.2), "rod", mu=2.0, extent="maccullagh")
    m.friction("rub", "s", viscous=0.2, coulomb=1.5, static=2.0, stribeck=0.3, smoothing=0.1)
    m.friction("pin", "B", coulomb=0.05, smoothing=0.5)
    m.stop("ends", "s", lower=0.3, upper=0.42, stiffness=4e3, dissipation=0.8)
    floor = m.ground.at(0, -0.05, 0, rpy=(-np.pi / 2, 0, 0))
    rubbing = {"stiffness": 3e3, "dissipation": 0.5, "friction": 0.3, "smoothing": 0.1}
    m.sphere_plane("floor", floor, rod, radius=0.08, **rubbing)
    m.point_plane("edge", floor, rod, **rubbing)
    m.sphere_sphere("bump", crank, rod, radii=(0.2, 0.15), **rubbing)
    m.muscle(
        "pull",
        m.ground.at(-0.1, 0.3, 0),
        rod,
        activation="0.5*exp(-t)",
        force_max=30,
        fiber_length=0.2,
        slack_length=0.3,
    )
    return m


def test_all_elements_on_a_closed_loop() -> None:
    """Methods and energies agree, and the Jacobian is that of the right-hand side, loop included."""
    m = bearing_everything()
    modules = [m.compile(method=method, target="numpy") for method in ("embedding", "lagrange")]
    for theta in np.linspace(0.1, 6.2, 7):
        x = modules[0].x0(theta=theta, theta_dot=3.0)
        a, b = (mod.rhs(0.2, x) for mod in modules)
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(a).max())
        np.testing.assert_allclose(modules[0].energy(x), modules[1].energy(x), rtol=1e-12)
        for mod in modules:
            slopes = fine_differences(mod, x, 2e-5, 0.2)
            assert np.abs(mod.jacobian(0.2, x) - slopes).max() <= 1e-6 * np.abs(slopes).max()


def test_power_of_what_loses_is_the_rate_of_the_kinetic_energy() -> None:
    m = eg.Model("losses", gravity=(0, 0, 0))
    body = m.body("b", mass=1.0)
    m.prismatic("z", m.ground, body, axis="z")
    made = [
        m.bushing("mount", m.ground, body, stiffness=[1, 1, 50, 1, 1, 1], damping=[0, 0, 0.8, 0, 0, 0]),
        m.stop("ends", "z", lower=-0.2, upper=0.3, stiffness=1e3, exponent=2, dissipation=0.4),
        m.friction("rub", "z", coulomb=0.5, smoothing=0.2),
    ]
    m.output("power", " + ".join(f"power({one.name})" for one in made))
    mod = m.compile(target="numpy")
    run = mod.simulate((0, 1), initial={"z_dot": 3.0}, t_eval=np.linspace(0, 1, 20001), **TIGHT)
    T, V = mod.energy(run.x)
    assert np.trapezoid(run["power"], run.t) == pytest.approx(T[-1] - T[0], rel=1e-6)
    assert (T + V)[-1] < (T + V)[0] - 1.0


def test_elements_with_a_potential_keep_the_energy() -> None:
    """A run through stops, contacts, bushing, laws and gravity of a point, all without losses."""
    m = models.build("slider_crank")
    drum = {"around": m.ground.at(0.2, -0.3, 0), "radius": 0.05, "sense": "positive"}
    m.element("hard", m.ground.at(0.6, 0.1, 0), "slider", potential="20*(length - 0.4)**4", via=[drum])
    m.bushing("mount", m.ground.at(0.3, 0, 0), "slider", stiffness=[20, 30, 40, 1, 2, 3])
    m.point_gravity("moon", m.ground.at(0.1, 0.8, 0.2), "rod", mu=2.0, extent="maccullagh")
    m.stop("ends", "s", lower=0.28, upper=0.42, stiffness=4e3, exponent=2.5)
    m.sphere_sphere("bump", m.ground.at(0, 0.2, 0), "rod.tip", radii=(0.15, 0.18), stiffness=2e3, exponent=2.5)
    mod = m.compile(target="numpy")
    traj = mod.simulate((0, 2), initial={"theta": 0.3, "theta_dot": 8.0}, rtol=1e-11, atol=1e-13)
    T, V = mod.energy(traj.x)
    assert np.ptp(traj["s"]) > 0.12
    assert (traj["s"] < 0.28).any()
    assert (traj["s"] > 0.42).any()
    assert np.abs(T + V - T[0] - V[0]).max() < 1e-8 * T.max()
