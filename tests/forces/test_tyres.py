"""Tyres: the brush model and the Magic Formula against formulas written anew, power, cornering, standstill."""

import math
from typing import Any

import numpy as np
import pytest
from force_judges import differences
from refusals import refuses
from scipy.integrate import quad
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


def test_peaks_and_slopes_of_the_magic_formula() -> None:
    """At 4 kN the largest forces are D = mu F_z = 1.210 and 0.990 of the load, the slopes K (Pacejka, appendix 3)."""
    mod = corner({"law": "magic_formula", "shifts": False}).compile(target="numpy")
    along = max(at_steady_slip(mod, k, 0.0, 4000.0)[0] for k in np.linspace(0.05, 0.3, 60))
    across = max(at_steady_slip(mod, 0.0, -k, 4000.0)[1] for k in np.linspace(0.05, 0.5, 60))
    assert along == pytest.approx(1.210 * 4000, rel=1e-3)
    assert across == pytest.approx(0.990 * 4000, rel=1e-3)
    assert at_steady_slip(mod, 1e-6, 0.0, 4000.0)[0] / 1e-6 == pytest.approx(21.51 * 4000, rel=1e-4)
    stiffness = 14.95 * 4000 * math.sin(2 * math.atan(1 / 2.130))
    assert -at_steady_slip(mod, 0.0, 1e-6, 4000.0)[1] / 1e-6 == pytest.approx(stiffness, rel=1e-4)


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
