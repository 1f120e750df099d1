"""Tyres: the brush model and the Magic Formula against formulas written anew, power, cornering, standstill."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from judges import differences
from refusals import refused, refuses
from scipy.integrate import quad
from scipy.optimize import brentq
from sweeps import TARGETS, part_of

import eomgen as eg

R, STIFFNESS, MU, C, HALF = 0.313, 2.0e5, 0.9, 6.0e4, 0.06
RELAXATION = (0.25, 0.4)
POINT = {"law": "brush", "slip_stiffness": C, "friction": MU}  # without an aligning moment
BRUSH = {**POINT, "half_length": HALF}
MAGIC, SYMMETRIC = {"law": "magic_formula"}, {"law": "magic_formula", "shifts": False}
COMMON = {"radius": R, "stiffness": STIFFNESS, "relaxation": RELAXATION}
LAWS = pytest.mark.parametrize("law", [BRUSH, MAGIC, SYMMETRIC], ids=["brush", "magic_formula", "symmetric"])
SPEEDS = ("x_dot", "y_dot", "z_dot", "steer_dot", "spin_dot")


def corner(law: dict[str, Any], camber: float = 0.0, **more: Any) -> eg.Model:
    """A wheel on a hub that moves along x, y, z and turns about z through the wheel's centre."""
    m = eg.Model("corner", gravity=(0, 0, 0))
    for name in ("a", "b", "c"):
        m.body(name, mass=0)
    hub = m.body("hub", mass=100.0, inertia=(5.0, 5.0, 5.0))
    wheel = m.body("wheel", mass=20.0, inertia=(0.5, 0.9, 0.5))
    m.prismatic("x", m.ground, "a", axis="x")
    m.prismatic("y", "a", "b", axis="y")
    m.prismatic("z", "b", "c", axis="z")
    m.revolute("steer", "c", hub, axis="z")
    m.revolute("spin", hub.at(0, 0, 0, rpy=(camber, 0, 0)), wheel, axis="y")
    m.tyre("tyre", m.ground, wheel, **{**COMMON, **law, **more})
    return m


def state(mod: Any, deflections: tuple[float, float], **values: float) -> np.ndarray:
    x = np.asarray(mod.x0(**values), dtype=float)
    for axis, value in zip("xy", deflections, strict=True):
        x[mod.x_names.index(f"tyre_deflection_{axis}")] = value
    return x


def at_steady_slip(mod: Any, kappa: float, tangent: float, load: float, camber: float = 0.0) -> np.ndarray:
    """Force on a rolling wheel in ground axes, aligning moment, torque on its spin, at slips with their deflections."""
    held = (-kappa * RELAXATION[0], tangent * RELAXATION[1])
    return -mod.bias(0.0, state(mod, held, z=R * math.cos(camber) - load / STIFFNESS, x_dot=10.0))[:5]


@pytest.mark.quick
@pytest.mark.parametrize("load", [2000.0, 5000.0])
def test_brush_model(load: float) -> None:
    """Pacejka (2006), equations 3.40 to 3.49 in theoretical slips, pure and combined, adhering and sliding."""
    mod = corner(BRUSH).compile(target="numpy")
    met = set()
    for kappa, tangent in ((0.02, 0), (-0.03, 0), (0, 0.05), (0.03, -0.04), (-0.05, 0.08), (-0.6, 0.2), (0, 0.9)):
        sx, sy = kappa / (1 + kappa), tangent / (1 + kappa)
        s, theta = math.hypot(sx, sy), C / (3 * MU * load)
        whole = MU * load * (3 * theta * s - 3 * (theta * s) ** 2 + (theta * s) ** 3) if theta * s < 1 else MU * load
        met.add(theta * s < 1)
        found = at_steady_slip(mod, kappa, tangent, load)
        np.testing.assert_allclose(found[:2], [whole * sx / s, -whole * sy / s], rtol=1e-9, atol=1e-8)
        assert found[2] == pytest.approx(load, rel=1e-12)
        assert found[4] == pytest.approx(-found[0] * R, rel=1e-9)
        if kappa == 0:  # M_z = -t F_y: for small slip t = a / 3, 0 where all slides
            r = min(1.0, theta * abs(tangent))
            trail = HALF * (1 - r) ** 3 / (3 - 3 * r + r * r)
            assert found[3] == pytest.approx(-trail * found[1], rel=1e-6, abs=1e-9)
    assert met == {True, False}
    slope = (at_steady_slip(mod, 1e-7, 0, load)[0], at_steady_slip(mod, 0, 1e-7, load)[1])
    np.testing.assert_allclose(slope, (C * 1e-7, -C * 1e-7), rtol=1e-5)


def magic(kappa: float, tan: float, F: float, camber: float, shifts: bool = True) -> tuple[float, float]:
    """Pacejka (2006), 4.E9 to 4.E67, with the coefficients of appendix 3 typed once more."""
    s = 1.0 if shifts else 0.0
    d = F / 4000.0 - 1.0

    def curve(K: float, C: float, D: float, E: float, x: float) -> float:
        B = K / (C * D)
        return D * math.sin(C * math.atan(B * x - min(E, 1.0) * (B * x - math.atan(B * x))))

    Fx = curve(
        F * (21.51 - 0.163 * d) * math.exp(0.245 * d), 1.685, (1.210 - 0.037 * d) * F,
        0.344 + 0.095 * d - 0.020 * d * d, kappa + s * (-0.002 + 0.002 * d),
    )  # fmt: skip
    Bxa = 12.35 * math.cos(math.atan(-10.77 * kappa))
    Fx *= math.cos(1.092 * math.atan(Bxa * (tan + s * 0.007))) / math.cos(1.092 * math.atan(Bxa * s * 0.007))
    y = tan + s * (0.003 - 0.001 * d) + 0.075 * camber
    Dy = F * (-0.990 + 0.145 * d) * (1 + 11.23 * camber**2)
    Ey = (-1.003 - 0.537 * d) * (1 - (-0.083 * s - 4.787 * camber) * math.copysign(1, y))
    Ky = -14.95 * 4000 * math.sin(2 * math.atan(F / (2.130 * 4000))) * (1 + 0.028 * abs(camber))
    Fy = curve(Ky, 1.193, Dy, Ey, y) + F * (s * (0.045 - 0.024 * d) + (-0.532 + 0.039 * d) * camber)
    Byk = 6.461 * math.cos(math.atan(4.196 * (tan + s * 0.015)))
    Fy *= math.cos(1.081 * math.atan(Byk * (kappa + s * 0.009))) / math.cos(1.081 * math.atan(Byk * s * 0.009))
    sway = Dy * (s * (0.053 - 0.073 * d) + 0.517 * camber) * math.cos(math.atan(35.44 * tan))
    return Fx, Fy + sway * math.sin(1.9 * math.atan(-10.71 * kappa))


@pytest.mark.parametrize("shifts", [True, False])
@pytest.mark.parametrize("camber", [0.0, 0.05])
def test_magic_formula(shifts: bool, camber: float) -> None:
    mod = corner({"law": "magic_formula", "shifts": shifts}, camber).compile(target="numpy")
    for load in (2000.0, 4000.0, 6000.0):
        for kappa, tangent in ((0, 0), (0.05, 0), (-0.2, 0), (0, 0.1), (0, -0.03), (0.1, 0.1), (-0.5, -0.3)):
            found = at_steady_slip(mod, kappa, tangent, load, camber)
            np.testing.assert_allclose(found[:2], magic(kappa, tangent, load, camber, shifts), rtol=1e-9, atol=1e-6)


def bicycle(steer: float, law: dict[str, Any]) -> eg.Model:
    """A body on two wheels that moves in a plane at constant load."""
    m = eg.Model("bicycle", gravity=(0, 0, 0))
    body = m.body("body", mass=1200.0, inertia=(300.0, 1500.0, 1800.0))
    m.planar("j", m.ground.at(0, 0, R - 0.03), body)
    for name, x, turn in (("front", 1.2, steer), ("rear", -1.5, 0.0)):
        wheel = m.body(name, mass=1e-3, inertia=(0.5, 0.8, 0.5))
        m.revolute(f"spin_{name}", body.at(x, 0, 0, rpy=(0, 0, turn)), wheel, axis="y")
        m.tyre(f"tyre_{name}", m.ground, wheel, **{**COMMON, **law})
    return m


@pytest.mark.parametrize("law", [POINT, pytest.param(SYMMETRIC, marks=pytest.mark.thorough)], ids=["brush", "magic"])
def test_steady_cornering_is_that_of_the_linear_bicycle(law: dict[str, Any]) -> None:
    """r = V delta / (L + K V^2), K = (m / L) (b / C_f - a / C_r), for small angles."""
    steer, V = 1e-4, 20.0  # small: the brush weakens by r = C alpha / (3 mu F_z)
    mod = bicycle(steer, law).compile(target="numpy")
    start = {"j_x_dot": V, "spin_front_dot": V / R, "spin_rear_dot": V / R}
    traj = mod.simulate(3.0, initial=start)
    load = 0.03 * STIFFNESS
    C_f = C_r = C
    if law is not POINT:
        C_f = C_r = 14.95 * 4000 * math.sin(2 * math.atan(load / (2.130 * 4000)))
    a, b, mass = 1.2, 1.5, 1200.0
    K = mass / (a + b) * (b / C_f - a / C_r)
    speed = math.hypot(traj["j_x_dot"][-1], traj["j_y_dot"][-1])
    assert traj["j_3_dot"][-1] == pytest.approx(speed * steer / (a + b + K * speed**2), rel=2e-3)
    assert traj["tyre_front_deflection_y"][-1] / RELAXATION[1] == pytest.approx(
        -mass * b / (a + b) * speed * traj["j_3_dot"][-1] / C_f, rel=5e-3
    )


def test_locked_wheel_stops_on_its_way() -> None:
    """V^2 / 2 falls with the way by F / m, F of the brush at kappa = -(1 - exp(-x / s)): far on by mu g per metre."""
    m = eg.Model("locked", gravity=(0, 0, 0))
    body = m.body("block", mass=500.0)
    m.prismatic("x", m.ground.at(0, 0, R - 0.02), body, axis="x")
    m.tyre("tyre", m.ground, body, **COMMON, **BRUSH)
    mod = m.compile(target="numpy")
    load = 0.02 * STIFFNESS
    traj = mod.simulate(1.0, initial={"x_dot": 10.0}, rtol=1e-10, atol=1e-12)

    def friction(x: float) -> float:
        kappa = 1 - math.exp(-x / RELAXATION[0])
        r = C * kappa / (1 - kappa) / (3 * MU * load)
        return MU * load * (1 - (1 - min(r, 1.0)) ** 3)

    way = traj["x"][-1]
    lost = quad(friction, 0, 0.1, limit=200)[0] + quad(friction, 0.1, way, limit=200)[0]
    assert 0.5 * 500.0 * (100.0 - traj["x_dot"][-1] ** 2) == pytest.approx(lost, rel=1e-6)
    assert traj["x_dot"][-1] == pytest.approx(10.0 - MU * load / 500.0, rel=0.02)


@pytest.mark.parametrize(
    ("law", "lengths"), [(BRUSH, (0.4, 0.4)), ({"law": "magic_formula"}, RELAXATION)], ids=["brush", "magic_formula"]
)
def test_relaxation_of_a_step_in_the_slip_angle(law: dict[str, Any], lengths: tuple[float, float]) -> None:
    """A slip builds up as 1 - exp(-x / s) of the way x."""
    mod = corner(law, relaxation=lengths).compile(target="numpy")
    names = list(mod.x_names)
    x = mod.x0(z=R - 0.02, x_dot=10.0, y_dot=0.1, spin_dot=10.0 / R)
    u, v = (names.index(f"tyre_deflection_{k}") for k in "xy")
    for way in (0.0, 0.1, 1.0):
        x[v] = lengths[1] * 0.01 * (1 - math.exp(-way / lengths[1]))
        rates = mod.rhs(0.0, x)
        assert rates[v] == pytest.approx(0.1 * math.exp(-way / lengths[1]), rel=1e-9)
        assert rates[u] == pytest.approx(0.0, abs=1e-12)
    x[names.index("z")] = 1.0  # in the air
    assert mod.rhs(0.0, x)[v] == pytest.approx(-20.0 / lengths[1] * x[v], rel=1e-12)
    if law is BRUSH:
        assert np.abs(mod.bias(0.0, x)).max() < 1e-9


def test_settling_damps_a_standing_wheel_and_no_steady_slip() -> None:
    """m s^2 + (C tau / s_y) s + C / s_y = 0 sideways at rest; tan alpha = V_sy / |V_x| while it rolls."""
    tau = 0.04
    mod = corner(BRUSH, settling=tau).compile(target="numpy")
    names = list(mod.x_names)
    x = mod.x0(z=R - 0.02)
    rows = [names.index(name) for name in ("y_dot", "tyre_deflection_y")]
    found = np.linalg.eigvals(mod.jacobian(0.0, x)[np.ix_(rows, rows)])
    wanted = np.roots([120.0, C * tau / RELAXATION[1], C / RELAXATION[1]])
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(wanted), rtol=1e-9)
    x = mod.x0(z=R - 0.02, x_dot=10.0, y_dot=0.1, spin_dot=10.0 / R)
    slip = tau / (1 + 10.0 * tau / RELAXATION[1]) * 0.1 / RELAXATION[1]
    x[rows[1]] = RELAXATION[1] * (0.01 - slip)
    assert mod.rhs(0.0, x)[rows[1]] == pytest.approx(0.0, abs=1e-12)
    r = C * 0.01 / (3 * MU * 0.02 * STIFFNESS)
    assert mod.bias(0.0, x)[1] == pytest.approx(MU * 0.02 * STIFFNESS * (1 - (1 - r) ** 3), rel=1e-9)


@pytest.mark.parametrize("law", [BRUSH, MAGIC])
@pytest.mark.parametrize("target", TARGETS)
def test_exact_derivatives(target: str, law: dict[str, Any]) -> None:
    mod = corner(law, camber=0.03, damping=300.0, settling=0.03).compile(target=target)
    x = mod.x0(z=R - 0.02, x_dot=10.0, y_dot=0.4, z_dot=-0.1, spin_dot=9.5 / R)
    x[10:] = [0.01, 0.02]
    wanted = differences(mod, x)
    np.testing.assert_allclose(mod.jacobian(0.0, x), wanted, rtol=1e-6, atol=1e-8 * np.abs(wanted).max())


@pytest.mark.parametrize(
    ("law", "told"),
    [
        ({"law": "fiala"}, "EG-CHOICE law: brush"),
        ({"law": "brush", "friction": 0.9}, "EG-MISSING slip_stiffness:"),
        ({**BRUSH, "relaxation": (0.2, 0)}, "EG-RANGE relaxation[1]: 0"),
        ({**BRUSH, "shifts": False}, "EG-CONFLICT shifts: magic_formula"),
        ({"law": "magic_formula", "half_length": 0.1}, "EG-CONFLICT half_length:"),
    ],
)
def test_what_is_wrong_is_reported(law: dict[str, Any], told: str) -> None:
    refuses(told, corner(law).derive)


def at_slip(mod: Any, forward: float, kappa: float, tangent: float, load: float, **at: float) -> np.ndarray:
    """The state of a steady slip kappa = V_sx / |V_x|, tan alpha = V_sy / |V_x|, up to where a brush slides at grip."""
    camber, radius, grip = at.get("camber", 0.0), at.get("rolling", R), at.get("grip", math.inf)
    speed, way = abs(forward), math.copysign(1.0, forward)
    size = math.hypot(kappa, tangent)
    reached = max(size / grip + way * kappa, 0.5 * size / grip)  # 1 / c: c size = grip min(2, 1 - w c kappa)
    part = 1.0 / reached if reached > 1.0 else 1.0
    held = [s * part * slip for s, slip in zip(RELAXATION, (kappa, tangent), strict=True)]
    return state(
        mod, (held[0], held[1]), z=R * math.cos(camber) - load / STIFFNESS, x_dot=forward, y_dot=tangent * speed,
        spin_dot=(forward - kappa * speed) / radius,
    )  # fmt: skip


@LAWS
@pytest.mark.parametrize("camber", [0.0, 0.1, -0.06])
def test_no_steady_slip_gains_energy(law: dict[str, Any], camber: float) -> None:
    """Forces times velocities of all coordinates, with a rolling radius below and of the radius without load."""
    random = np.random.default_rng(5)
    for radius in (R, 0.29):
        mod = corner(law, camber, rolling_radius=radius).compile(target="numpy")
        rates = [mod.x_names.index(f"tyre_deflection_{k}") for k in "xy"]
        speeds = [mod.x_names.index(name) for name in SPEEDS]
        states, loads = [], []
        for _ in range(150):
            load, forward = random.uniform(800.0, 7000.0), random.choice([-1, 1]) * random.uniform(2.0, 40.0)
            kappa, tangent = random.choice([-1, 1], 2) * 10.0 ** random.uniform(-4.0, -0.1, 2)
            grip = (1 + 1e-9) * 3.0 * MU * load / C if law is BRUSH else math.inf
            states.append(at_slip(mod, forward, kappa, tangent, load, camber=camber, rolling=radius, grip=grip))
            loads.append(load * abs(forward))
        x, size = np.array(states).T.copy(), np.array(loads)
        np.testing.assert_allclose(mod.rhs(0.0, x)[rates], 0.0, atol=1e-9)  # steady
        power = (-mod.bias(0.0, x)[:5] * x[speeds]).sum(axis=0)
        assert (power <= 1e-9 * size).all()
        assert (power < -1e-6 * size).sum() > 100


@pytest.mark.parametrize("turn", part_of([0.0, 0.6, 1.5708], (0.6).__eq__))
def test_locked_wheel_that_stops_gives_back_its_grip_alone(turn: float) -> None:
    """A block on locked wheels, along, across and between: after its stop it has no more than the tread held."""
    m = eg.Model("locked", gravity=(0, 0, 0))
    body, load = m.body("block", mass=500.0), 0.02 * STIFFNESS
    m.prismatic("x", m.ground.at(0, 0, R - 0.02, rpy=(0, 0, turn)), body.at(0, 0, 0, rpy=(0, 0, turn)), axis="x")
    m.tyre("tyre", m.ground, body, radius=R, stiffness=STIFFNESS, relaxation=(0.3, 0.3), **BRUSH)
    traj = m.compile(optimize=0).simulate(1.0, initial={"x_dot": 3.0}, rtol=1e-9, atol=1e-10)
    speed = traj["x_dot"]
    stop = int(np.argmax(speed < 0.0))
    back = 0.5 * 500.0 * np.max(np.square(speed[stop:]))
    held = 9.0 * (MU * load) ** 2 * 0.3 / (4.0 * C)  # the integral of mu F (1 - (1 - theta u / s)^3) up to full grip
    assert 0.6 * held < back <= 1.001 * held


def test_a_road_that_rocks_about_the_patch_does_not_slip() -> None:
    """The place of the road that the wheel touches stands still, so that nothing is deflected sideways."""
    m = eg.Model("rocking", gravity=(0, 0, 0))
    road, wheel = m.body("road", mass=1.0, inertia=(1, 1, 1)), m.body("wheel", mass=20.0, inertia=(0.5, 0.9, 0.5))
    m.revolute("rock", m.ground, road, axis="x")
    m.revolute("spin", m.ground.at(0, 0, R - 0.02), wheel, axis="y")
    m.tyre("tyre", road, wheel, radius=R, stiffness=STIFFNESS, relaxation=(0.3, 0.3), **BRUSH)
    mod = m.compile(target="numpy")
    rates = dict(zip(mod.x_names, mod.rhs(0.0, mod.x0(rock_dot=2.0)), strict=True))
    assert rates["tyre_deflection_y"] == pytest.approx(0.0, abs=1e-12)


def random_states(mod: Any, number: int = 12) -> list[np.ndarray]:
    """Some at and near the reversal of the motion."""
    random = np.random.default_rng(3)
    found = []
    for k in range(number):
        forward = (0.0, 0.04, -0.03, 9.0, -7.0, 0.3)[k % 6]
        x = state(
            mod, tuple(random.uniform(-0.03, 0.03, 2)), z=R - random.uniform(0.005, 0.03), x_dot=forward,
            y_dot=random.uniform(-0.3, 0.3), steer=random.uniform(-0.2, 0.2), spin=random.uniform(-3, 3),
            spin_dot=forward / R + random.uniform(-2, 2),
        )  # fmt: skip
        found.append(x)
    return found


@LAWS
def test_rolls_backwards_as_its_mirror_image_forwards(law: dict[str, Any]) -> None:
    """Fore and aft exchanged: driving stays driving, the aligning moment turns the wheel into its motion."""
    mod = corner(law, 0.05, settling=0.02).compile(target="numpy")
    mirrored = ("x", "steer", "spin", "x_dot", "steer_dot", "spin_dot", "tyre_deflection_x")
    sign = np.array([-1.0 if name in mirrored else 1.0 for name in mod.x_names])
    for x in random_states(mod):
        wanted = sign * mod.rhs(0.0, x)
        np.testing.assert_allclose(mod.rhs(0.0, sign * x), wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())


@LAWS
def test_forces_pass_smoothly_through_a_standstill(law: dict[str, Any]) -> None:
    mod = corner(law, 0.03, settling=0.02).compile(target="numpy")
    x = state(mod, (0.02, -0.03), z=R - 0.02)
    forward = mod.x_names.index("x_dot")
    sides = []
    for speed in (-1e-8, 1e-8):
        x[forward] = speed
        sides.append(mod.rhs(0.0, x))
    np.testing.assert_allclose(sides[0], sides[1], rtol=1e-6, atol=1e-6)
    x[forward] = 0.02  # its own velocity of reversal is 0.1
    wanted = differences(mod, x)
    np.testing.assert_allclose(mod.jacobian(0.0, x), wanted, rtol=1e-6, atol=1e-7 * np.abs(wanted).max())


def test_a_road_that_pitches_slips_as_a_wheel_that_is_carried_round_it() -> None:
    """Only the motion of the wheel against the road counts."""
    law = {"radius": 0.3, "stiffness": 2e5, "relaxation": (0.3, 0.3), "law": "brush"}
    rates = []
    for rocked in ("road", "arm"):
        m = eg.Model("pitching", gravity=(0, 0, 0))
        body = m.body(rocked, mass=1, inertia=(1, 1, 1))
        m.revolute("rock", m.ground, body, axis="y")
        road, base = (body, m.ground) if rocked == "road" else (m.ground, body)
        m.revolute("spin", base.at(0, 0, 0.28), m.body("wheel", mass=20, inertia=(0.5, 0.9, 0.5)), axis="y")
        m.tyre("tyre", road, "wheel", slip_stiffness=6e4, friction=0.9, **law)
        mod = m.compile(target="numpy")
        rate = mod.rhs(0.0, mod.x0(rock_dot=2.0 if rocked == "road" else -2.0))
        rates.append(rate[mod.x_names.index("tyre_deflection_x")])
    assert rates[0] == pytest.approx(rates[1], rel=1e-12)


# -- creep of wheel and rail -------------------------------------------------------------------------------------------
G = 9.81
#: Of a wheelset: mass, yaw inertia, half the gauge, rolling radius, conicity, creep coefficients, suspension.
P = {"m": 1250.0, "I": 700.0, "b": 0.75, "r": 0.45, "cone": 0.1, "f11": 6.6e6, "f22": 6.0e6, "f23": 1.0e4, "f33": 50.0}


P |= {"ky": 2.5e5, "kpsi": 1.5e6}


def wheelset(law: str = "linear") -> eg.Model:
    """It runs along the track at the speed V; y is its lateral place, psi its yaw, phi its rolling."""
    m = eg.Model("wheelset", gravity=(0, 0, -G))
    for name, value in {**P, "V": 20.0, "mu": 0.3}.items():
        m.parameter(name, value)
    frames = [m.body(name, mass=0) for name in ("along", "across", "yawing")]
    axle = m.body("axle", mass="m", inertia=("I", 80.0, "I"))
    run = m.prismatic("x", m.ground, frames[0], axis="x")
    m.driver("forward", "x", "V*t")
    m.prismatic("y", frames[0], frames[1], axis="y")
    m.revolute("psi", frames[1], frames[2])
    m.revolute("phi", frames[2], axle, axis="y")
    m.joint_spring("side", "y", stiffness="ky")
    m.joint_spring("yaw", "psi", stiffness="kpsi")
    more = {} if law == "linear" else {"normal": run.reaction.force[2] / 2, "friction": "mu"}
    for side, sign in (("left", 1), ("right", -1)):
        m.creep(side, m.ground.at(0, 0, "-r"), axle.at(0, "b" if sign > 0 else "-b", 0), radius=f"r + ({sign})*cone*y",
                longitudinal="f11", lateral="f22", lateral_spin="f23", spin="f33", creep_law=law, **more)  # fmt: skip
    m.initial(phi_dot="V/r")
    return m


def matrices(V: float, p: dict[str, float]) -> np.ndarray:
    """x = (y, psi, y', psi'): A. H. Wickens, Fundamentals of Rail Vehicle Dynamics (2003), ch. 3."""
    M = np.diag([p["m"], p["I"]])
    lateral, turning = 2 * p["f22"], 2 * p["f11"] * p["b"]
    D = np.array([[lateral, 2 * p["f23"]], [-2 * p["f23"], turning * p["b"] + 2 * p["f33"]]]) / V
    K = np.array([[p["ky"], -lateral], [turning * p["cone"] / p["r"], p["kpsi"] + 2 * p["f23"]]])
    zero, one = np.zeros((2, 2)), np.eye(2)
    return np.block([[zero, one], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])


def reduced(mod: eg.Module, V: float, p: dict[str, float] = P) -> np.ndarray:
    """d(y', psi', y'', psi'') by (y, psi, y', psi') at straight running, the rolling beside it."""
    mod = mod.bind(p={**p, "V": V})
    x = mod.x0(phi_dot=V / p["r"])
    J = mod.jacobian(0.0, x)
    places = [mod.x_names.index(name) for name in ("y", "psi", "y_dot", "psi_dot")]
    return J[np.ix_(places, places)]


def test_linear_wheelset_and_its_critical_speed() -> None:
    mod = wheelset().compile(target="numpy")
    for V in (5.0, 20.0, 60.0):
        assert reduced(mod, V) == pytest.approx(matrices(V, P), rel=1e-9, abs=1e-6)

    def growth(V: float) -> float:
        return float(np.linalg.eigvals(reduced(mod, V)).real.max())

    found = brentq(growth, 10.0, 200.0, xtol=1e-8)
    truth = brentq(lambda V: np.linalg.eigvals(matrices(V, P)).real.max(), 10.0, 200.0, xtol=1e-8)
    assert found == pytest.approx(truth, rel=1e-6)
    assert growth(0.9 * found) < 0.0 < growth(1.1 * found)


def published(V: float) -> np.ndarray:
    """A wheelset on round rails, as printed: x = (q1, q2, u1, u2), lateral place, yaw and their rates.

    D. Karnopp, Vehicle Dynamics, Stability, and Control (2nd edition, 2013), chapter 10, with the numbers of J. K.
    Moore's laboratory on it (EME 134, University of California, Davis): stable at 20 m/s, hunting at 50 m/s.
    """
    m, d, N, k, f, curved = KARNOPP["m"], KARNOPP["b"], 80e3 / 4, 13e3, 1e6, 0.23 - 0.2
    I, slope, r = m * d**2, 0.23 * (np.pi / 180) / curved, 0.46
    down = [
        [-(2 * k / m + 2 * N / (m * curved)), 2 * f / m, -2 * f / (V * m), 0],
        [-2 * f * slope * d / (r * I), -2 * k * (d / 2) ** 2 / I, 0, -2 * f * d**2 / (V * I)],
    ]
    return np.vstack([np.eye(4)[2:], down])


#: The same in the words of the wheelset above; the rails push it back by 2 N / (R - R').
KARNOPP = {"m": 1000.0, "I": 1000.0 * 0.72**2, "b": 0.72, "r": 0.46, "cone": 0.23 * (np.pi / 180) / 0.03}


KARNOPP |= {
    "f11": 1e6,
    "f22": 1e6,
    "f23": 0.0,
    "f33": 0.0,
    "ky": 2 * 13e3 + 2 * 20e3 / 0.03,
    "kpsi": 2 * 13e3 * 0.36**2,
}


def test_a_published_wheelset_hunts_at_its_critical_speed() -> None:
    mod = wheelset().compile(target="numpy")

    def slopes(V: float) -> np.ndarray:
        return reduced(mod, V, KARNOPP)

    def growth(of, V: float) -> float:
        return float(np.linalg.eigvals(of(V)).real.max())

    for V in (20.0, 50.0):
        assert slopes(V) == pytest.approx(published(V), rel=1e-9, abs=1e-6)
    assert growth(slopes, 20.0) < 0.0 < growth(slopes, 50.0)
    found, truth = (brentq(lambda V, of=of: growth(of, V), 20.0, 50.0, xtol=1e-9) for of in (slopes, published))
    assert found == pytest.approx(truth, rel=1e-6)
    assert found == pytest.approx(48.558436, rel=1e-6)


def vermeulen_johnson(F: float, most: float) -> float:
    return most * (1 - (1 - F / (3 * most)) ** 3) if 3 * most > F else most


def polach(F: float, most: float) -> float:
    e = np.pi * F / (4 * most)
    return 2 * most / np.pi * (e / (1 + e**2) + np.arctan(e))


MASS, ROLLING, STIFF, FRICTION = 400.0, 0.4, 4e6, 0.25


@cache
def braked(law: str) -> eg.Module:
    """A wheel that rolls on a rail below a frame that slides."""
    m = eg.Model("wheel", gravity=(0, 0, -G))
    frame, wheel = m.body("frame", mass=100.0), m.body("wheel", mass=MASS, inertia=(12.0, 20.0, 12.0))
    slide = m.joint("planar", "j", m.ground, frame)
    m.revolute("phi", frame, wheel, axis="y")
    m.creep("rail", m.ground.at(0, 0, -ROLLING), wheel, radius=ROLLING, longitudinal=STIFF, lateral=0.8 * STIFF,
            creep_law=law, normal="reaction(j).z", friction=FRICTION)  # fmt: skip
    m.output("N", slide.reaction.force[2])
    return m.compile(target="numpy")


@pytest.mark.parametrize("law", [vermeulen_johnson, polach])
@pytest.mark.parametrize("creepage", [1e-7, 1e-4, 3e-4, 2e-3, 0.2])
def test_a_braked_wheel_saturates(law, creepage: float) -> None:
    """By the friction of the weight that the axle carries, with both creepages at once."""
    r, f, V, mu = ROLLING, STIFF, 10.0, FRICTION
    mod = braked(law.__name__)
    x = mod.x0(j_x_dot=V, j_y_dot=0.5 * creepage * V, phi_dot=V * (1 - creepage) / r)
    a = dict(zip(mod.v_names, mod.rhs(0.0, x)[mod.n_q :], strict=True))
    assert mod.outputs(0.0, x)[0] == pytest.approx(500.0 * G, rel=1e-12)
    linear = -f * creepage * np.array([1.0, 0.4])
    size = float(np.hypot(*linear))
    push = linear * law(size, mu * 500.0 * G) / size
    assert [500.0 * a["j_x_dot"], 500.0 * a["j_y_dot"]] == pytest.approx(push, rel=1e-7)
    assert 20.0 * a["phi_dot"] == pytest.approx(-r * push[0], rel=1e-7)
    J = mod.jacobian(0.0, x)
    np.testing.assert_allclose(J, differences(mod, x), rtol=1e-4, atol=1e-4 * np.abs(J).max())


def test_a_track_that_moves_takes_the_opposite() -> None:
    m = eg.Model("roller")
    track, wheel = m.body("track", mass=30.0, inertia=(3.0, 3.0, 3.0)), m.body("wheel", mass=5.0, inertia=(0.2,) * 3)
    m.free("a", m.ground, track)
    m.free("b", m.ground, wheel)
    m.creep("rail", track.at(0.1, 0, 0), wheel.at(0, 0.02, 0), radius=0.3, longitudinal=900.0, lateral=700.0,
            lateral_spin=5.0, spin=2.0, speed=3.0)  # fmt: skip
    for axis in "xyz":
        m.output(f"p{axis}", f"momentum_{axis}")
        m.output(f"L{axis}", f"angular_momentum_{axis}(ground)")
    m.initial(b_z=0.3, b_x_dot=2.0, b_y_dot=0.3, b_1_dot=0.2, b_2_dot=4.0, b_3_dot=-0.5, a_3_dot=0.4)
    mod = m.compile(target="numpy")
    run = mod.simulate(0.3, rtol=1e-10, atol=1e-12)
    y = mod.outputs(run.t, run.x)
    assert np.abs(y - y[:, :1]).max() < 1e-7
    assert np.ptp(run["b_x_dot"]) > 0.05


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"creep_law": "polach"}, "EG-MISSING forces.rail.normal"),
        ({"friction": 0.3}, "EG-CONFLICT forces.rail.friction"),
        ({"longitudinal": -1.0}, "EG-RANGE forces.rail.longitudinal -1 0"),
    ],
)
def test_what_is_wrong_with_creep_is_reported(keys: dict[str, object], told: str) -> None:
    m = eg.Model("wheel")
    wheel = m.body("wheel", mass=1.0, inertia=(1.0, 1.0, 1.0))
    m.free("f", m.ground, wheel)
    m.creep("rail", m.ground, wheel, radius=0.3, **{"longitudinal": 1.0, "lateral": 1.0, **keys})
    refuses(told, m.check)


@pytest.mark.parametrize(("law", "told"), [("linear", "rolling"), ("polach", "rolling Painleve's")])
def test_rest_is_detected_by_the_speed_of_rolling(law: str, told: str) -> None:
    """Creepages are divided by the speed of the axle along the track; the ends of a spring have no part in it."""
    mod = wheelset(law).compile(target="numpy").bind(p={"V": 0.0})
    with refused(f"EG-NOT-FINITE left right {told}") as error:
        mod.rhs(0.0, np.zeros(mod.n_x))
    assert "cylinder" not in str(error.value)
