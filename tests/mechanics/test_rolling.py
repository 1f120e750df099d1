"""Wheels, balls, blades and convex bodies that roll: closed forms, a published disc and a published rattleback."""

import math
from typing import Any

import models
import numpy as np
import pytest
from judges import Bodies, agree, augmented, described, loop_terms, random_states
from models import reference
from refusals import refuses

import eomgen as eg

# -- Discs, balls and blades -------------------------------------------------------------------------------------------
DISC = models.reference("rolling_disc")
TURN = (-np.pi / 2, 0, 0)  # brings z to y


def disc(target: str = "numpy", method: str = "embedding", rotation: str | None = None) -> Any:
    """The thin uniform disc of the reference: Rz(psi) Rx(theta) Ry(phi), axle y, centre at height r cos(theta)."""
    p = DISC["parameters_SI"]
    mass, r, g = p["m"], p["r"], p["g"]
    m = eg.Model("disc", gravity=(0, 0, -g))
    wheel = m.body("wheel", mass=mass, inertia=(mass * r**2 / 4, mass * r**2 / 2, mass * r**2 / 4))
    if rotation is None:
        m.free("f", m.ground, wheel, sequence="zxy", coordinates=["X", "Y", "Z", "psi", "theta", "phi"])
        m.independent("psi", "theta", "phi")
    else:
        m.joint("free", "f", m.ground, wheel, rotation=rotation)
    m.rolling("roll", wheel.at(0, 0, 0, rpy=TURN), m.ground, radius=r)
    return m.compile(method, target=target)


def disc_state(mod: Any, theta: float, rates: tuple[float, float, float]) -> np.ndarray:
    psi_dot, theta_dot, phi_dot = rates
    return mod.x0(psi=0.0, theta=theta, phi=0.0, psi_dot=psi_dot, theta_dot=theta_dot, phi_dot=phi_dot, X=0.0, Y=0.0)


@pytest.mark.parametrize(("target", "method"), [("numpy", "embedding"), ("numpy", "lagrange")])
def test_the_published_disc(target: str, method: str) -> None:
    """Velocities of the centre and all accelerations at the state of the reference."""
    mod = disc(target, method)
    assert mod.n_dof == 3
    given = DISC["initial_state"]
    x = disc_state(mod, given[3], tuple(given[7:]))
    assert x[mod.x_names.index("Z")] == pytest.approx(0.5 * np.cos(given[3]), rel=1e-13)
    for name, value in zip(("X_dot", "Y_dot"), given[5:7], strict=True):
        assert x[mod.x_names.index(name)] == pytest.approx(value, rel=1e-9)
    rate = mod.rhs(0.0, x)
    for name, value in zip(("X", "Y", "psi", "theta", "phi"), DISC["initial_acc"], strict=True):
        assert rate[mod.n_q + mod.v_names.index(f"{name}_dot")] == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize("sample", DISC["steady_samples"].items(), ids=lambda s: s[0])
def test_steady_circles(sample: tuple[str, dict[str, float]]) -> None:
    """At the spin of the reference the lean stays, and the centre goes round a circle."""
    words, found = sample
    theta, psi_dot = (float(w.split("=")[1]) for w in words.split(","))
    mod = disc()
    x = disc_state(mod, theta, (psi_dot, 0.0, found["phid"]))
    rate = mod.rhs(0.0, x)
    assert np.abs(rate[mod.n_q + 3 :]).max() < 1e-12 * found["phid"] ** 2
    run = mod.simulate((0, 2), initial=dict(zip(mod.x_names, x.tolist(), strict=True)), rtol=1e-10, atol=1e-12)
    speed = np.hypot(x[mod.x_names.index("X_dot")], x[mod.x_names.index("Y_dot")])
    radius = speed / abs(psi_dot)
    side = np.array([-x[mod.x_names.index("Y_dot")], x[mod.x_names.index("X_dot")]]) / psi_dot
    assert np.linalg.norm(side) == pytest.approx(radius)
    away = np.hypot(run["X"] - side[0], run["Y"] - side[1])
    np.testing.assert_allclose(run["theta"], theta, atol=1e-7)
    np.testing.assert_allclose(away, radius, rtol=1e-6)


def test_energy_and_slip_of_a_disc_that_wobbles() -> None:
    mod = disc()
    given = DISC["initial_state"]
    x = disc_state(mod, given[3], tuple(given[7:]))
    run = mod.simulate((0, 4), initial=dict(zip(mod.x_names, x.tolist(), strict=True)), rtol=1e-11, atol=1e-13)
    assert np.ptp(run["theta"]) > 0.1
    energy = run["energy"]
    assert np.abs(energy - energy[0]).max() < 1e-8 * energy[0]
    for state in run.x.T[:: len(run.t) // 5]:
        bodies = Bodies(mod, state[:6], state[6:])
        axle = bodies.R[0][:, 1]
        down = axle[2] * axle - [0, 0, 1]
        rim = bodies.v[0] + np.cross(bodies.w[0], 0.5 * down / np.linalg.norm(down))
        assert np.abs(rim).max() < 1e-9
        assert np.linalg.norm(bodies.v[0]) > 0.1
    np.testing.assert_allclose(run["Z"], 0.5 * np.cos(run["theta"]), atol=1e-13)


def test_upright_rolling_is_stable_above_the_critical_spin() -> None:
    """Eigenvalues of the exact Jacobian of straight rolling (critical spin sqrt(g / 3r))."""
    mod = disc()
    critical = DISC["critical_upright_spin_rad_s"]
    growth = []
    for factor in (0.99, 1.01):
        x = disc_state(mod, 0.0, (0.0, 0.0, factor * critical))
        growth.append(float(np.linalg.eigvals(mod.jacobian(0.0, x)).real.max()))
    assert growth[0] > 0.3
    assert abs(growth[1]) < 1e-6


def ball(**keys: Any) -> eg.Model:
    """A solid ball on a plane that is tilted by alpha about y, so that it rolls down along x of the plane."""
    m = eg.Model("ball", gravity=(0, 0, "-g"))
    m.parameter("g", 9.81)
    r, mass, alpha = m.parameter("r", 0.2), m.parameter("mass", 1.5), m.parameter("alpha", 0.4)
    sphere = m.body("sphere", mass=mass, inertia=[2 * mass * r**2 / 5] * 3)
    m.joint("free", "f", m.ground, sphere, rotation="euler_parameters")
    m.rolling("roll", sphere, m.ground.at(0.1, 0, -0.3, rpy=(0, alpha, 0)), radius=r, shape="sphere", **keys)
    return m


@pytest.mark.parametrize("method", ["embedding", "lagrange"])
def test_a_ball_rolls_down_an_incline(method: str) -> None:
    """a = 5/7 g sin(alpha) along the slope, whatever it spins about the normal; 1/2 a t^2 after t."""
    mod = ball().compile(method, target="numpy")
    assert mod.n_dof == 3
    a = 5 / 7 * 9.81 * np.sin(0.4)
    down = np.array([np.cos(0.4), 0, -np.sin(0.4)])
    x = mod.x0()
    rate = mod.rhs(0.0, x)
    at = mod.n_q + mod.v_names.index("f_x_dot")
    np.testing.assert_allclose(rate[at : at + 3], a * down, atol=1e-12)
    run = mod.simulate((0, 1.5), rtol=1e-10, atol=1e-12)
    path = np.stack([run[f"f_{k}"] - run[f"f_{k}"][0] for k in "xyz"])
    np.testing.assert_allclose(path, np.outer(down, a * run.t**2 / 2), atol=1e-8)
    assert path[0, -1] > 2


def test_a_ball_on_a_turntable_goes_round_two_sevenths_as_fast() -> None:
    """A solid ball that rolls on a turntable moves on a circle at 2/7 of its rate (Weltner, Am. J. Phys. 47, 1979)."""
    m = eg.Model("turntable", gravity=(0, 0, -9.81))
    table, sphere = (
        m.body("table", mass=1, inertia=(1, 1, 1)),
        m.body("sphere", mass=0.3, inertia=[0.4 * 0.3 * 0.01] * 3),
    )
    m.revolute("shaft", m.ground, table, coordinate="turn")
    m.joint("free", "f", m.ground, sphere, rotation="euler_parameters")
    m.rolling("roll", sphere, table, radius=0.1, shape="sphere")
    m.coupling("drive", equation="turn - 4*t")
    mod = m.compile(target="numpy")
    assert mod.n_dof == 3
    x = mod.x0(f_x=0.5, f_y=0.1, f_x_dot=0.3, f_y_dot=-0.2)
    rate, at = mod.rhs(0.0, x), mod.n_q + mod.v_names.index("f_x_dot")
    v = x[at : at + 2]
    np.testing.assert_allclose(rate[at : at + 2], 8 / 7 * np.array([-v[1], v[0]]), atol=1e-12)
    run = mod.simulate((0, 2 * np.pi / (8 / 7)), initial=dict(zip(mod.x_names, x.tolist(), strict=True)), rtol=1e-10)
    assert run["f_x"][-1] == pytest.approx(0.5, abs=1e-7)
    assert run["f_y"][-1] == pytest.approx(0.1, abs=1e-7)
    assert np.ptp(run["f_x"]) == pytest.approx(2 * np.hypot(0.3, 0.2) / (8 / 7), rel=1e-3)


def sleigh() -> eg.Model:
    m = eg.Model("sleigh")
    a, mass, J = m.parameter("a", 0.3), m.parameter("mass", 2.0), m.parameter("J", 0.1)
    runner = m.body("runner", mass=mass, com=(a, 0, 0), inertia={"zz": J})
    m.planar("move", m.ground, runner, coordinates=["x", "y", "psi"])
    m.knife_edge("blade", runner)
    return m


def test_chaplygins_sleigh() -> None:
    """v' = a w^2, w' = -m a v w / (J + m a^2), v along the blade (Neimark and Fufaev, ch. II)."""
    mod = sleigh().compile(target="numpy")
    assert mod.n_dof == 2
    a, mass, J = 0.3, 2.0, 0.1
    psi, v, w = 0.7, 1.2, -0.9
    x = mod.x0(psi=psi, x_dot=v * np.cos(psi), psi_dot=w)
    names = mod.v_names
    speeds = {n: x[mod.n_q + names.index(n)] for n in names}
    assert speeds["y_dot"] == pytest.approx(v * np.sin(psi), rel=1e-13)
    rate = dict(zip(names, mod.rhs(0.0, x)[mod.n_q :].tolist(), strict=True))
    along = rate["x_dot"] * np.cos(psi) + rate["y_dot"] * np.sin(psi)
    assert along == pytest.approx(a * w**2, rel=1e-12)
    assert rate["psi_dot"] == pytest.approx(-mass * a * v * w / (J + mass * a**2), rel=1e-12)
    run = mod.simulate((0, 6), initial=dict(zip(mod.x_names, x.tolist(), strict=True)), rtol=1e-10, atol=1e-12)
    slip = -run["x_dot"] * np.sin(run["psi"]) + run["y_dot"] * np.cos(run["psi"])
    assert np.abs(slip).max() < 1e-12
    assert abs(run["psi_dot"][-1]) < 1e-3  # it ends straight, the mass in front
    speed = run["x_dot"][-1] * np.cos(run["psi"][-1]) + run["y_dot"][-1] * np.sin(run["psi"][-1])
    assert speed == pytest.approx(np.sqrt(v**2 + (J + mass * a**2) / mass * w**2), rel=1e-5)


def rounded_wheel() -> eg.Model:
    m = eg.Model("ring", gravity=(0, 0, -9.81))
    wheel = m.body("wheel", mass=1, inertia=(0.05, 0.05, 0.09))
    m.free("f", m.ground, wheel, sequence="zxz", coordinates=["x", "y", "z", "yaw", "lean", "spin"])
    m.rolling("roll", wheel, m.ground, radius=0.3, tube=0.05)
    m.initial(lean=1.2, yaw_dot=0.3, spin_dot=6.0, x=0, y=0, yaw=0, spin=0, lean_dot=0)
    return m


@pytest.mark.parametrize("make", [rounded_wheel, sleigh, lambda: ball(no_spin=True)])
def test_against_multipliers_and_between_methods(make: Any) -> None:
    model = make()
    one, two = (model.compile(method, target="numpy") for method in ("embedding", "lagrange"))
    rigid = described(model)
    if "f_e0" in one.q_names:  # its velocities are no rates of coordinates: the judge differentiates along those only
        x = one.project(np.concatenate([one.x0()[: one.n_q], [0.4, 0.1, -0.2, 1.0, 2.0, -1.0]]))
        agree(two.rhs(0.0, x), one.rhs(0.0, x), 1e-12)
        return
    n = one.n_q
    for x in random_states(one, 3, 3):
        q, v = x[:n], x[n:]
        M, h = Bodies(one, q, v).newton_euler(rigid)
        C_q, gamma = loop_terms(one, q, v)
        expected = augmented(M, h, C_q, gamma)
        for mod in (one, two):
            agree(mod.rhs(0.0, x)[n:], expected, 1e-8)
        agree(two.rhs(0.0, x)[n:], one.rhs(0.0, x)[n:], 1e-11)


def test_a_rounded_wheel_keeps_its_energy() -> None:
    mod = rounded_wheel().compile(target="numpy")
    assert mod.n_dof == 3
    run = mod.simulate((0, 3), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(run["z"], 0.25 * np.sin(run["lean"]) + 0.05, atol=1e-12)
    for state in run.x.T[:: len(run.t) // 5]:  # the lowest point of its tube rests
        bodies = Bodies(mod, state[:6], state[6:])
        axle = bodies.R[0][:, 2]
        down = axle[2] * axle - [0, 0, 1]
        lowest = 0.25 * down / np.linalg.norm(down) - [0, 0, 0.05]
        assert np.abs(bodies.v[0] + np.cross(bodies.w[0], lowest)).max() < 1e-9
    energy = run["energy"]
    assert np.abs(energy - energy[0]).max() < 1e-8 * energy[0]
    assert np.hypot(run["x"], run["y"]).max() > 1


# -- Convex bodies -----------------------------------------------------------------------------------------------------
MASS, INERTIA = 1.3, (0.004, 0.005, 0.007)


def rattleback(flip: bool = True) -> eg.Model:
    """As in the reference: z points down, the plane's normal up."""
    p = reference("rattleback_kane_levinson")["parameters_SI"]
    m = eg.Model("stone", gravity=(0, 0, 9.81))
    stone = m.body(
        "stone", mass=p["M"], com=(0, 0, p["h"]), inertia={"xx": p["A"], "yy": p["B"], "zz": p["C"], "xy": p["D"]}
    )
    m.free("fly", m.ground, stone, sequence="zxy", coordinates=("X", "Y", "Z", "psi", "alpha", "beta"))
    plane = m.ground.at(0, 0, 0, rpy=(math.pi, 0, 0))
    m.rolling("roll", stone, plane, shape="ellipsoid", semi_axes=(p["a"], p["b"], p["c"]))
    for axis in "xyz":
        m.output(f"w{axis}", f"w{axis}_body(stone)")
        m.output(f"a{axis}", f"w{axis}_body_dot(stone)")
    m.independent("psi", "alpha", "beta")
    return m


@pytest.mark.parametrize("method", ["embedding", "augmented", "recursive", "lagrange"])
def test_accelerations_of_kane_and_levinson(method: str) -> None:
    case = reference("rattleback_kane_levinson")["acceleration_test"]
    m = rattleback()
    x, y, z = case["omega"]
    m.initial(alpha=case["alpha"], beta=case["beta"], X=0, Y=0, psi=0.7, wx=x, wy=y, wz=z)
    mod = m.compile(method=method, target="numpy")
    found = mod.outputs(0.0, mod.x0())
    np.testing.assert_allclose(found[::2], case["omega"], atol=1e-12)
    np.testing.assert_allclose(found[1::2], case["omega_dot"], rtol=1e-10)


@pytest.mark.parametrize(
    ("keys", "demand"),
    [
        ({"shape": "ellipsoid"}, "EG-MISSING constraints.roll.semi_axes"),
        ({"shape": "ellipsoid", "semi_axes": (1, 0, 1)}, "EG-RANGE constraints.roll.semi_axes[1] 0"),
        ({"shape": "sphere", "radius": 1, "support": "nx"}, "EG-CONFLICT constraints.roll.support"),
        ({"shape": "convex", "support": "-0.1"}, "EG-RANGE constraints.roll.support curvature"),
        ({"shape": "convex", "support": "0.1*nx"}, "EG-RANGE constraints.roll.support corner"),
        ({"shape": "convex", "support": "log(-1 - nx**2)"}, "EG-RANGE constraints.roll.support number"),
    ],
)
def test_what_is_wrong_is_reported(keys: dict[str, Any], demand: str) -> None:
    m = eg.Model("wrong")
    body = m.body("body", mass=1, inertia=INERTIA)
    m.free("fly", m.ground, body)
    m.rolling("roll", body, **keys)
    refuses(demand, m.check)


# -- Shapes ------------------------------------------------------------------------------------------------------------
G = 9.81
X = {"f_e0": 0.9, "f_e1": 0.2, "f_e2": -0.3, "f_e3": np.sqrt(1 - 0.94), "f_x": 0.3, "f_y": -0.1}
SPIN = {"f_wx": 0.7, "f_wy": -1.1, "f_wz": 2.0}


def stone(com: tuple[float, float, float] = (0.0, 0.0, 0.01), at: float = 0.0, **shape: object) -> eg.Model:
    m = eg.Model("stone", gravity=(0.4, 0, -G))
    body = m.body("stone", mass=1.3, com=com, inertia=(2e-3, 3e-3, 4e-3))
    m.free("f", m.ground, body, rotation="euler_parameters")
    m.rolling("roll", body.at(0, 0, at), **shape)
    m.guess(f_z=0.2)
    return m


def surface(a: float, b: float, c: float) -> np.ndarray:
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 1500), np.linspace(0, np.pi, 800))
    return np.stack([a * np.cos(u) * np.sin(v), b * np.sin(u) * np.sin(v), c * np.cos(v)]).reshape(3, -1)


@pytest.mark.parametrize("support", ["ellipsoid", "sqrt((0.2*nx)**2 + (0.12*ny)**2 + (0.07*nz)**2)"])
def test_the_lowest_point_lies_on_the_plane_and_rests(support: str) -> None:
    """Of all points of the surface the lowest has height 0 and no velocity."""
    more = {"semi_axes": (0.2, 0.12, 0.07)} if support == "ellipsoid" else {"support": support}
    mod = stone(shape="ellipsoid" if support == "ellipsoid" else "convex", **more).compile(target="numpy")
    x = mod.x0(**X, **SPIN)
    pose = mod.poses(x[: mod.n_q])[0]
    points = pose[:3, :3] @ surface(0.2, 0.12, 0.07) + pose[:3, 3:]
    lowest = points[:, points[2].argmin()]
    assert lowest[2] == pytest.approx(0.0, abs=2e-6)
    v = dict(zip(mod.x_names, x, strict=True))
    turn = pose[:3, :3] @ [v["f_wx"], v["f_wy"], v["f_wz"]]
    speed = np.array([v["f_x_dot"], v["f_y_dot"], v["f_z_dot"]]) + np.cross(turn, lowest - pose[:3, 3])
    assert np.abs(speed).max() < 5e-3  # the nearest point of the grid
    run = mod.simulate(1.0, {**X, **SPIN}, rtol=1e-10, atol=1e-12)
    T, V = mod.energy(run.x)
    assert np.abs(T + V - T[0] - V[0]).max() < 1e-7 * T.max()
