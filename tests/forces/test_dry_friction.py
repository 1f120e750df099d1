"""Laws of dry friction: published formulas, angles of slip, creep, stick-slip and bristles under changing loads."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from judges import differences
from refusals import refuses
from scipy.integrate import solve_ivp
from sweeps import TARGETS, part_of

import eomgen as eg

G = 9.81
MU, STATIC = 0.3, 0.4
COULOMB = {"friction": MU, "static_friction": STATIC, "stribeck": 0.05, "smoothing": 1e-5}
BROWN = {"friction_law": "brown_mcphee", "friction": MU, "static_friction": STATIC, "transition": 1e-4}
BRISTLES = {
    "friction_law": "lugre", "friction": MU, "static_friction": STATIC, "stribeck": 0.01,
    "bristle_stiffness": 1e5, "bristle_damping": 300.0,
}  # fmt: skip
GROUND = {"stiffness": 1e6, "exponent": 1, "dissipation": 2.0}


def brown_mcphee(v: Any, dynamic: float, static: float, transition: float) -> Any:
    """Brown and McPhee (2016), equation 5."""
    x = v / transition
    return dynamic * np.tanh(4 * x) + (static - dynamic) * x / (0.25 * x**2 + 0.75) ** 2


def block(law: dict[str, Any], bulk: bool = False) -> eg.Model:
    """A point on a slope that falls along x."""
    m = eg.Model("slope", gravity=(f"{G}*sin(angle)", 0, f"-{G}*cos(angle)"))
    m.parameter("angle", 0.0)
    m.body("cart", mass=0)
    body = m.body("block", mass=2.0, inertia=(0.01, 0.01, 0.01))
    m.prismatic("x", m.ground, "cart", axis="x")
    m.prismatic("z", "cart", body, axis="z")
    if bulk:
        corner = {"shape": "sphere", "on": body.at(0, 0, 0.1), "radius": 0.1}
        m.contacts("touch", corner, {"shape": "half_space", "on": m.ground}, {**GROUND, **law})
    else:
        m.point_plane("touch", m.ground, body, **GROUND, **law)
    return m


SINK = 2.0 * G / 1e6


@cache
def compiled(law: str) -> eg.Module:
    """A block under each law."""
    return block({"coulomb": COULOMB, "brown_mcphee": BROWN, "lugre": BRISTLES}[law]).compile(target="numpy")


@pytest.mark.parametrize("bulk", [False, True])
def test_friction_of_brown_and_mcphee_in_contacts(bulk: bool) -> None:
    mod = block({**BROWN, "viscous_friction": 0.02}, bulk).compile(target="numpy")
    v = np.concatenate([[0.0], np.geomspace(1e-12, 10, 200), -np.geomspace(1e-12, 10, 50)])
    x = np.array([0 * v, 0 * v - SINK, v, 0 * v])
    wanted = -G * (brown_mcphee(v, MU, STATIC, 1e-4) + 0.02 * v)
    np.testing.assert_allclose(mod.rhs(0.0, np.ascontiguousarray(x))[2], wanted, rtol=1e-11)
    assert np.abs(wanted).max() > STATIC * G
    slopes = [mod.jacobian(0.0, column)[2, 2] for column in x[:, :40].T.copy()]
    per_v = 4 * MU / 1e-4 + (STATIC - MU) / 1e-4 / 0.5625 + 0.02
    assert slopes[0] == pytest.approx(-G * per_v, rel=1e-12)
    np.testing.assert_allclose(slopes[:5], slopes[0], rtol=1e-9)


def test_friction_of_brown_and_mcphee_in_a_joint() -> None:
    """Its largest value is the static friction, at the transition velocity, but for 1 - tanh 4."""
    m = eg.Model("joint")
    body = m.body("b", mass=3)
    m.prismatic("s", m.ground, body, axis="x")
    m.friction("rub", "s", coulomb=10, static="F", transition=0.02, viscous=5, friction_law="brown_mcphee")
    m.parameter("F", 14)
    mod = m.compile(target="numpy")
    v = np.linspace(-0.1, 0.1, 41)
    found = -3 * mod.rhs(0.0, np.array([0 * v, v]))[1]
    np.testing.assert_allclose(found, brown_mcphee(v, 10, 14, 0.02) + 5 * v, rtol=1e-12, atol=1e-12)
    late = -3 * mod.rhs(0.0, np.array([0 * v, v]), p={"F": 20})[1]
    np.testing.assert_allclose(late, brown_mcphee(v, 10, 20, 0.02) + 5 * v, rtol=1e-12, atol=1e-12)
    fine = brown_mcphee(np.linspace(0, 0.1, 10001), 10, 14, 0.02)
    assert fine.max() == pytest.approx(14, rel=10 * (1 - np.tanh(4)) / 14 * 1.1)


@pytest.mark.parametrize("law", ["coulomb", "brown_mcphee", "lugre"])
def test_angle_of_slip(law: str) -> None:
    """A block rests at 1e-3 rad below arctan(mu_s) and runs away at 1e-3 rad above it.

    Bristles begin bent as they are below: a load that comes at once would swing beyond the limit.
    """
    limit = np.arctan(STATIC)
    for side in (-1, 1):
        start = {"z": -SINK * np.cos(limit)}
        if law == "lugre":
            start["touch_bristle_x"] = np.tan(limit - 1e-3) / 1e5 * np.sqrt(1e5 * 2.0 * G * np.cos(limit))
        bound = compiled(law).bind(p={"angle": limit + side * 1e-3})
        traj = bound.simulate(3.0, initial=start, method="Radau", rtol=1e-8, atol=1e-12)
        if side > 0:
            assert traj["x_dot"][-1] > 0.5
        else:
            assert abs(traj["x_dot"][-1]) < 2e-4


def test_creep_on_a_slope() -> None:
    """Smoothed laws creep at the velocity where friction carries the weight, in 100 s; bristles hold the block."""
    angle = np.arctan(0.25)
    times = np.array([0.0, 1.0, 101.0])
    moved = {}
    for name in ("coulomb", "brown_mcphee", "lugre"):
        mod = compiled(name).bind(p={"angle": angle})
        start = {"z": -SINK * np.cos(angle)}
        traj = mod.simulate(101.0, initial=start, method="Radau", rtol=1e-9, atol=1e-13, t_eval=times)
        moved[name] = traj["x"][2] - traj["x"][1]
        if name == "lugre":
            bent = 0.25 / 1e5 * np.sqrt(1e5 * 2.0 * G * np.cos(angle))
            assert traj["touch_bristle_x"][2] == pytest.approx(bent, rel=1e-6)
    level = STATIC  # of the law of Stribeck, far below its velocity
    assert moved["coulomb"] == pytest.approx(100 * 1e-5 * 0.25 / np.sqrt(level**2 - 0.25**2), rel=1e-4)
    near = np.linspace(1e-6, 5e-5, 200_001)
    creep = near[np.argmin(np.abs(brown_mcphee(near, MU, STATIC, 1e-4) - 0.25))]
    assert moved["brown_mcphee"] == pytest.approx(100 * creep, rel=1e-4)
    assert abs(moved["lugre"]) < 1e-6


def test_stick_slip_on_a_joint() -> None:
    """A mass drawn by a spring (Canudas de Wit and others, 1995, section III), against SciPy's integrator."""
    k, pull, mass = 2.0, 0.1, 1.0
    s0, s1, s2, low, high, vs = 1e5, np.sqrt(1e5), 0.4, 1.0, 1.5, 0.001
    m = eg.Model("stick_slip")
    body = m.body("b", mass=mass)
    m.prismatic("s", m.ground, body, axis="x")
    m.friction(
        "rub", "s", coulomb=low, static=high, stribeck=vs, viscous=s2, friction_law="lugre",
        bristle_stiffness=s0, bristle_damping=s1,
    )  # fmt: skip
    m.actuator("rope", "s", value=f"{k}*({pull}*t - s)")
    mod = m.compile(target="numpy")
    assert mod.x_names == ("s", "s_dot", "rub_bristle")

    def by_hand(t: float, x: np.ndarray) -> list[float]:
        y, v, z = x
        g = low + (high - low) * np.exp(-((v / vs) ** 2))
        dz = v - s0 * abs(v) / g * z
        return [v, (k * (pull * t - y) - s0 * z - s1 * dz - s2 * v) / mass, dz]

    times = np.linspace(0, 60, 601)
    judge = solve_ivp(by_hand, (0, 60), np.zeros(3), method="LSODA", rtol=1e-9, atol=1e-12, t_eval=times).y
    traj = mod.simulate(60.0, method="Radau", rtol=1e-9, atol=1e-12, t_eval=times)
    assert np.ptp(np.diff(judge[0])) > 0.03  # it sticks and slips
    assert np.abs(traj["s"] - judge[0]).max() < 2e-5
    assert np.abs(traj["rub_bristle"] - judge[2]).max() < 1e-7
    rng = np.random.default_rng(2)
    for x in rng.standard_normal((20, 3)) * [1, 1e-2, 1e-5]:
        np.testing.assert_allclose(mod.rhs(0.3, x), by_hand(0.3, x), rtol=1e-12)


def test_bristles_between_surfaces() -> None:
    """Rates and forces of single contacts against vectors in NumPy, for any turn of the first marker.

    The states are sqrt(s0 N) times the deflections z of the published law.
    """
    rng = np.random.default_rng(8)
    law = {**BRISTLES, "viscous_friction": 0.05, "stiffness": 1e4, "exponent": 1}
    for turn in ((0, 0, 0), (0.3, -0.5, 1.1)):
        m = eg.Model("two", gravity=(0, 0, 0))
        body = m.body("b", mass=1.0, inertia=(0.1, 0.1, 0.1))
        m.translational("j", m.ground, body)
        base = m.ground.at(0, 0, 0, rpy=turn)
        m.sphere_plane("floor", base, body, radius=0.1, **law)
        m.sphere_sphere("ball", base, body, radii=(0.05, 0.1), **law)
        mod = m.compile(target="numpy")
        c, s = np.cos(turn), np.sin(turn)
        Rx = np.array([[1, 0, 0], [0, c[0], -s[0]], [0, s[0], c[0]]])
        Ry = np.array([[c[1], 0, s[1]], [0, 1, 0], [-s[1], 0, c[1]]])
        Rz = np.array([[c[2], -s[2], 0], [s[2], c[2], 0], [0, 0, 1]])
        R = Rz @ Ry @ Rx
        touched = 0
        for _ in range(40):
            p = rng.uniform(-0.12, 0.12, 3)
            v = 0.02 * rng.standard_normal(3)
            z = 1e-6 * rng.standard_normal(5)
            force, rates, states = np.zeros(3), [], []
            for n, depth, own in (
                (R[:, 2], 0.1 - R[:, 2] @ p, [*z[:2], 0.0]),
                (p / np.linalg.norm(p), 0.15 - np.linalg.norm(p), z[2:]),
            ):
                slide = v - n * (n @ v)
                speed = np.linalg.norm(slide)
                g = MU + (STATIC - MU) * np.exp(-((speed / 0.01) ** 2))
                local = R.T @ slide
                dz = local - 1e5 * speed / g * np.array(own) if depth > 0 else -1e5 / 300 * np.array(own)
                bristle = R @ (1e5 * np.array(own) + 300 * dz)
                push = 1e4 * max(depth, 0.0)
                root = np.sqrt(1e5 * push) if depth > 0 else 1.0
                states += list(root * np.array(own)[: 2 if len(rates) == 0 else 3])
                dz = root * dz
                force += push * n - push * (bristle - n * (n @ bristle) + 0.05 * slide)
                rates += list(dz[: 2 if len(rates) == 0 else 3])
                touched += depth > 0
            found = mod.rhs(0.0, np.concatenate([p, v, states]))
            np.testing.assert_allclose(found[3:6], force, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(found[6:], rates, rtol=1e-9, atol=1e-12)
        assert touched > 20


def test_derivatives_of_laws() -> None:
    for law in (BROWN, BRISTLES):
        mod = block(law).compile(target="numpy")
        n = mod.n_x
        x = np.array([0.1, -2 * SINK, 3e-5, -1e-4, 2e-6, 1e-6][:n])
        step = 1e-6 * np.array([1, SINK, 1e-4, 1e-3, 1e-6, 1e-6][:n])
        found = mod.jacobian(0.0, x)
        np.testing.assert_allclose(found, differences(mod, x, step), rtol=1e-5, atol=1e-7 * np.abs(found).max())
        assert np.isfinite(mod.jacobian(0.0, np.zeros(n))).all()
        assert np.isfinite(mod.rhs(0.0, np.zeros(n))).all()


@pytest.mark.parametrize(
    ("law", "told"),
    [
        ({**COULOMB, "friction_law": "dahl"}, "EG-CHOICE friction_law: dahl"),
        ({"friction_law": "lugre"}, "EG-MISSING friction:"),
        ({**BROWN, "smoothing": 1}, "EG-CONFLICT smoothing: coulomb brown_mcphee"),
        ({**BROWN, "static_friction": 0.1}, "EG-RANGE static_friction: 0.1 0.3"),
        ({**COULOMB, "static_friction": 0.1, "stribeck": 0.1}, "EG-RANGE static_friction:"),
        ({"friction_law": "brown_mcphee", "friction": 1}, "EG-MISSING transition:"),
        ({**BRISTLES, "smoothing": 1}, "EG-CONFLICT smoothing: coulomb lugre"),
        ({**BRISTLES, "friction": -0.1}, "EG-RANGE friction: 0"),
        ({"friction_law": "lugre", "friction": 0.1}, "EG-MISSING bristle_stiffness:"),
    ],
)
def test_what_is_wrong_with_a_law_of_friction_is_reported(law: dict[str, Any], told: str) -> None:
    refuses(told, block(law).derive)


LOW, HIGH, STRIBECK = 0.3, 0.45, 0.02
S0, S1, S2 = 2e3, 40.0, 0.05
LAW = {
    "stiffness": 1e4, "exponent": 1, "friction_law": "lugre", "friction": LOW, "static_friction": HIGH,
    "stribeck": STRIBECK, "bristle_stiffness": S0, "bristle_damping": S1, "viscous_friction": S2,
}  # fmt: skip
PLAIN = {key: value for key, value in LAW.items() if key not in ("static_friction", "stribeck", "viscous_friction")}


def level(speed: Any) -> Any:
    return LOW + (HIGH - LOW) * np.exp(-((speed / STRIBECK) ** 2))


def slider(law: dict[str, Any], drive: str = "0", push: str = "0") -> eg.Model:
    """A point on a plane; forces along both and down are texts."""
    m = eg.Model("slider", gravity=(0, 0, 0))
    body = m.body("b", mass=1.0, inertia=(0.1, 0.1, 0.1))
    m.translational("j", m.ground, body)
    m.force("drive", body, (drive, 0, push))
    m.point_plane("touch", m.ground, body, **law)
    return m


@pytest.mark.parametrize("target", TARGETS)
def test_power_is_that_of_the_energy_of_the_bristles_and_of_losses(target: str) -> None:
    """F v >= d(e^2 / 2)/dt at random loads, speeds and states, also beyond what the load can hold."""
    mod = slider(LAW).compile(target=target, **({} if target == "numpy" else {"optimize": 0}))
    random, count = np.random.default_rng(3), 4000
    depth = 10 ** random.uniform(-6, -2, count)
    x = np.zeros((8, count))
    x[2] = -depth
    x[3:6] = 10 ** random.uniform(-5, 1, count) * random.standard_normal((3, count))
    x[5] = 0.0
    most = HIGH * np.sqrt(1e4 * depth / S0)
    x[6:] = most * 10 ** random.uniform(-2, 1.5, count) * random.standard_normal((2, count))
    rates = mod.rhs(0.0, x)
    power = -(rates[3] * x[3] + rates[4] * x[4])  # of friction on the body of 1 kg
    stored = (x[6:] * rates[6:]).sum(axis=0)
    size = np.abs(power) + np.abs(x[6:] * rates[6:]).sum(axis=0)
    least = ((power - stored) / size).min()
    beyond = (np.hypot(*x[6:]) > most).sum()
    assert least > -1e-12
    assert 1000 < beyond < 3000
    speed = np.hypot(x[3], x[4])
    bound = HIGH + (S1 * (1 + HIGH / LOW) + S2) * speed
    assert (np.hypot(*rates[3:5]) <= 1e4 * depth * bound * (1 + 1e-12)).all()


def test_the_law_at_a_constant_load_is_the_published_one() -> None:
    """f = s0 z + s1 z' + s2 v, z' = v - s0 |v| / c(v) z, with e = sqrt(s0 N) z, wherever that is passive."""
    mod = slider(LAW).compile(target="numpy")
    random = np.random.default_rng(5)
    for _ in range(200):
        push, speed = 10 ** random.uniform(-2, 3), 10 ** random.uniform(-5, 0)
        turn = random.uniform(0, 2 * np.pi, 2)
        v = speed * np.array([np.cos(turn[0]), np.sin(turn[0])])
        z = random.uniform(0, 1) * HIGH / S0 * np.array([np.cos(turn[1]), np.sin(turn[1])])
        change = v - S0 * speed / level(speed) * z
        if (push * (S0 * z + S1 * change + S2 * v) @ v) < push * S0 * z @ change:
            continue  # it gives energy
        x = mod.x0(j_z=-push / 1e4, j_x_dot=v[0], j_y_dot=v[1])
        x[6:] = np.sqrt(S0 * push) * z
        rates = mod.rhs(0.0, x)
        np.testing.assert_allclose(rates[6:], np.sqrt(S0 * push) * change, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(rates[3:5], -push * (S0 * z + S1 * change + S2 * v), rtol=1e-10, atol=1e-12)
        x[3:5] *= 1e-9
        stiff = mod.jacobian(0.0, x)[3:5, 6:] @ np.full(2, np.sqrt(S0 * push))
        np.testing.assert_allclose(stiff, -push * S0, rtol=1e-5)  # a spring of s0 N before it slides


GROUNDS: dict[str, dict[str, Any]] = {
    "half_plane": {"shape": "half_plane"},
    "profile": {"shape": "profile", "points": [[-1, 0], [0, 0], [0.3, 0], [2, 0]]},
}


@pytest.mark.parametrize("ground", part_of(GROUNDS, "half_plane".__eq__))
def test_a_bounce_takes_friction_times_the_impulse_of_the_normal_force(ground: str) -> None:
    """A sliding body lands and lifts off; Coulomb's law, and N (s0 z + s1 z') (Canudas de Wit, Tsiotras), by hand."""
    m = eg.Model("bounce", gravity=(0, 0, 0))
    body = m.body("b", mass=2.0)
    m.prismatic("x", m.ground, between := m.body("between", mass=0), axis="x")
    m.prismatic("y", between, body, axis="y")
    law = {**PLAIN, "stiffness": 1e6, "exponent": 1.5, "bristle_stiffness": 1e5, "bristle_damping": 300.0}
    circle = {"shape": "circle", "on": body, "radius": 0.05}
    m.contacts("touch", circle, {**GROUNDS[ground], "on": m.ground}, {**law, "lateral": False})
    mod = m.compile(target="numpy")
    start = {"y": 0.051, "x_dot": 1.5, "y_dot": -0.3}
    traj = mod.simulate(0.06, initial=start, method="Radau", rtol=1e-8, atol=1e-11)

    def by_hand(t: float, x: np.ndarray) -> list[float]:
        y, v, w, z = x
        push, change = 1e6 * max(0.05 - y, 0.0) ** 1.5, v - 1e5 * abs(v) / LOW * z
        return [w, -push * (1e5 * z + 300.0 * change) / 2.0, push / 2.0, change]

    judge = solve_ivp(by_hand, (0, 0.06), [0.051, 1.5, -0.3, 0.0], method="Radau", rtol=1e-8, atol=1e-11).y[:, -1]
    lost = LOW * (traj["y_dot"][-1] + 0.3)
    assert traj["y_dot"][-1] == pytest.approx(0.3, rel=1e-6)
    assert 1.5 - judge[1] == pytest.approx(lost, rel=1e-3)
    assert 1.5 - traj["x_dot"][-1] == pytest.approx(lost, rel=0.01)


def test_what_a_smaller_load_holds() -> None:
    """After the load has fallen friction is at most that of the load, and the bristles keep their energy."""
    mod = slider(PLAIN).compile(target="numpy")
    e = 0.9 * LOW * np.sqrt(100 / S0)
    for push in (100.0, 50.0, 1.0, 1e-6):
        x = mod.x0(j_z=-push / 1e4)
        x[6] = e
        rates = mod.rhs(0.0, x)
        assert -rates[3] == pytest.approx(min(np.sqrt(S0 * push) * e, LOW * push), rel=1e-9)
        assert rates[6] == 0.0
    x = mod.x0(j_z=1e-6)
    x[6] = e
    rates = mod.rhs(0.0, x)
    assert rates[3] == 0.0
    assert rates[6] == pytest.approx(-S0 / S1 * e)
