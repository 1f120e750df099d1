"""Tyres: bristles followed one by one, power of steady slips, rolling backwards, and the way through a standstill."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import eomgen as eg

R, STIFFNESS, MU, C, HALF = 0.313, 2.0e5, 0.9, 6.0e4, 0.06
RELAXATION = (0.25, 0.4)
BRUSH = {"law": "brush", "slip_stiffness": C, "friction": MU, "half_length": HALF}
MAGIC, SYMMETRIC = {"law": "magic_formula"}, {"law": "magic_formula", "shifts": False}
LAWS = pytest.mark.parametrize("law", [BRUSH, MAGIC, SYMMETRIC], ids=["brush", "magic_formula", "symmetric"])
SPEEDS = ("x_dot", "y_dot", "z_dot", "steer_dot", "spin_dot")


def corner(law: dict[str, Any], camber: float = 0.0, **more: Any) -> Any:
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
    m.tyre("tyre", m.ground, wheel, radius=R, stiffness=STIFFNESS, **{"relaxation": RELAXATION, **law, **more})
    return m.compile(target="numpy")


def state(mod: Any, deflections: tuple[float, float], **values: float) -> np.ndarray:
    x = np.asarray(mod.x0(**values), dtype=float)
    for axis, value in zip("xy", deflections, strict=True):
        x[mod.x_names.index(f"tyre_deflection_{axis}")] = value
    return x


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


def bristles(forward: float, rolling: float, sideways: float, load: float) -> tuple[float, float, float]:
    """F_x, F_y, M_z of a bristle that is carried through the patch: friction bounds it where it stands.

    Its root moves over the patch with the tread, its tip stays on the road while stiffness times deflection is less
    than friction times the parabolic pressure, and else slides there.
    """
    steps = 20000
    c, way = C / (2.0 * HALF**2), math.copysign(1.0, rolling)
    step = 2.0 * HALF / steps
    stay = step / abs(rolling)
    along = across = turning = e = f = 0.0
    drift_e, drift_f = -stay * (forward - rolling), -stay * sideways
    for k in range(steps):
        x, part = way * (HALF - (k + 0.5) * step), 0.5 if k == 0 else 1.0
        e, f = e + part * drift_e, f + part * drift_f
        most = MU * 0.75 * load / HALF * (1.0 - (x / HALF) ** 2) / c
        held = min(1.0, most / max(math.hypot(e, f), 1e-300))
        e, f = e * held, f * held
        along, across, turning = along + e, across + f, turning + x * f
    return step * c * along, step * c * across, step * c * turning


@pytest.mark.parametrize("forward", [12.0, -12.0])
def test_brush_is_a_row_of_bristles(forward: float) -> None:
    """Pure and combined slip, driving and braking, both ways, adhering in part and sliding as a whole."""
    mod = corner(BRUSH)
    for load in (2000.0, 5000.0):
        for kappa, tangent in (
            (0.02, 0.0), (-0.05, 0.0), (0.0, 0.05), (0.0, -0.11), (0.03, -0.04), (-0.05, 0.08), (0.5, 0.2), (-0.4, 0.1),
        ):  # fmt: skip
            slip = math.copysign(kappa, kappa * forward)  # > 0: braking
            x = at_slip(mod, forward, slip, tangent, load)
            along, across, aligning = bristles(forward, forward - slip * abs(forward), tangent * abs(forward), load)
            wanted = [along, across, load, aligning, -along * R]
            np.testing.assert_allclose(-mod.bias(0.0, x)[:5], wanted, rtol=3e-4, atol=2e-4 * load * HALF)


@LAWS
@pytest.mark.parametrize("camber", [0.0, 0.1, -0.06])
def test_no_steady_slip_gains_energy(law: dict[str, Any], camber: float) -> None:
    """Forces times velocities of all coordinates, with a rolling radius below and of the radius without load."""
    random = np.random.default_rng(5)
    for radius in (R, 0.29):
        mod = corner(law, camber, rolling_radius=radius)
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


@LAWS
def test_passive_car_never_gains_energy(law: dict[str, Any]) -> None:
    """Two wheels of different loads whose gear lets them slip against each other."""
    m = eg.Model("car", gravity=(0, 0, 0))
    car = m.body("car", mass=200.0, inertia=(5, 5, 5))
    m.prismatic("x", m.ground, car, axis="x")
    for name, depth, x in (("front", 0.005, 1.0), ("rear", 0.03, -1.0)):
        wheel = m.body(name, mass=20.0, inertia=(0.5, 0.9, 0.5))
        m.revolute(f"spin_{name}", car.at(x, 0, R - depth, rpy=(0.03, 0, 0.01)), wheel, axis="y")
        m.tyre(name, m.ground, wheel, radius=R, stiffness=STIFFNESS, relaxation=RELAXATION, **law)
    m.coupling("gear", equation="spin_rear - 1.03*spin_front")
    mod = m.compile()
    for way in (1, -1):
        traj = mod.simulate((0, 1.5), {"x_dot": 10.0 * way, "spin_front_dot": 10.0 * way / R / 1.015}, method="Radau")
        turns = np.square(traj["spin_front_dot"]) + np.square(traj["spin_rear_dot"])
        kinetic = 0.5 * 240.0 * np.square(traj["x_dot"]) + 0.45 * turns
        settled = traj.t > 0.25  # before, deflections take up the forces at no slip: 0.05 J
        assert kinetic.max() <= kinetic[0] + 0.05
        assert np.diff(kinetic[settled]).max() <= 0.0
        assert kinetic[-1] < 0.999 * kinetic[0]


def grip_energy(load: float, length: float) -> float:
    """Of a tread deflected to full grip: the integral of mu F (1 - (1 - theta u / s)^3) is 9 mu^2 F^2 s / (4 C)."""
    return 9.0 * (MU * load) ** 2 * length / (4.0 * C)


@pytest.mark.parametrize("turn", [0.0, 0.6, 1.5708])
def test_locked_wheel_that_stops_gives_back_its_grip_alone(turn: float) -> None:
    """A block on locked wheels, along, across and between: after its stop it has no more than the tread held."""
    m = eg.Model("locked", gravity=(0, 0, 0))
    body, load = m.body("block", mass=500.0), 0.02 * STIFFNESS
    m.prismatic("x", m.ground.at(0, 0, R - 0.02, rpy=(0, 0, turn)), body.at(0, 0, 0, rpy=(0, 0, turn)), axis="x")
    m.tyre("tyre", m.ground, body, radius=R, stiffness=STIFFNESS, relaxation=(0.3, 0.3), **BRUSH)
    traj = m.compile().simulate(1.0, initial={"x_dot": 3.0}, rtol=1e-9, atol=1e-10)
    speed = traj["x_dot"]
    stop = int(np.argmax(speed < 0.0))
    back = 0.5 * 500.0 * np.max(np.square(speed[stop:]))
    assert 0.6 * grip_energy(load, 0.3) < back <= 1.001 * grip_energy(load, 0.3)


@pytest.mark.parametrize("settling", [0.0, 0.03])
@pytest.mark.parametrize("lengths", [(0.3, 0.3), (0.1, 0.5), (0.4, 0.25)])
def test_brush_is_passive(lengths: tuple[float, float], settling: float) -> None:
    """Of random states that stand or roll: power of the road and what the tyre takes up are no gain together.

    The tread holds s_0 times the integral of the force over the size of the slip, and the carcass F (s - s_0) F / (2 C)
    in each direction; at rest that is a function of the deflections alone, and moving slowly enough, V < reversal /
    100, it still is.
    """
    mod = corner(BRUSH, relaxation=lengths, settling=settling)
    random, load, lost = np.random.default_rng(12), 3000.0, 0
    rows = [mod.x_names.index(f"tyre_deflection_{k}") for k in "xy"]
    speeds = [mod.x_names.index(name) for name in SPEEDS]
    grip, tread = 3.0 * MU * load / C, min(lengths)

    def held(slip: np.ndarray) -> float:
        r = float(np.hypot(*slip)) / grip
        whole = r - (1.0 - (1.0 - min(r, 1.0)) ** 4) / 4.0
        force = MU * load * (1.0 - (1.0 - min(r, 1.0)) ** 3) * slip / np.hypot(*slip)
        return float(tread * MU * load * grip * whole + force @ ((np.array(lengths) - tread) * force) / (2.0 * C))

    slips, states = [], []
    for _ in range(400):
        slip = random.uniform(0, 1.2 * grip) * np.array([math.cos(a := random.uniform(0, 7)), math.sin(a)])
        slips.append(slip)
        states.append(state(
            mod, tuple(slip * lengths), z=R - load / STIFFNESS, x_dot=1e-5 * random.standard_normal(),
            y_dot=1e-4 * random.standard_normal(), spin_dot=1e-4 * random.standard_normal(),
        ))  # fmt: skip
    x = np.array(states).T.copy()
    changes, powers, step = mod.rhs(0.0, x)[rows].T / lengths, (-mod.bias(0.0, x)[:5] * x[speeds]).sum(axis=0), 1e-3
    for slip, change, power in zip(slips, changes, powers, strict=True):
        taken = (held(slip + step * change) - held(slip - step * change)) / (2.0 * step)
        assert power + taken <= 2e-3 * abs(power)
        lost += power + taken < -1e-3 * abs(power)
    assert lost > 50


@pytest.mark.parametrize("lengths", [(0.1, 0.5), (0.5, 0.1), (0.3, 0.3)])
def test_closed_loops_of_a_locked_wheel_gain_no_energy(lengths: tuple[float, float]) -> None:
    """Ellipses of the patch both ways round, below and beyond full grip; the first round is the way into the loop."""
    m = eg.Model("locked", gravity=(0, 0, 0))
    wheel, load = m.body("wheel", mass=1.0, inertia=(1, 1, 1)), 3000.0
    m.translational("j", m.ground.at(0, 0, R - load / STIFFNESS), wheel)
    m.tyre("tyre", m.ground, wheel, radius=R, stiffness=STIFFNESS, **{**BRUSH, "relaxation": lengths})
    mod = m.compile(target="numpy")
    names = list(mod.x_names)
    rows = [names.index(k) for k in ("tyre_deflection_x", "tyre_deflection_y", "j_x_dot", "j_y_dot")]
    grip, turn, number = 3.0 * MU * load / C, 2.0 * np.pi, 60  # one loop in a second
    part, way = np.array([0.45, 0.45, 1.2, 1.2]), np.array([1.0, -1.0, 1.0, -1.0])
    x, reach, work = np.tile(mod.x0()[:, None], 4), grip * np.array(lengths)[:, None] * part, []

    def rates(t: float, z: np.ndarray) -> np.ndarray:
        x[rows[:2]] = z[:2]
        x[rows[2:]] = turn * reach * np.stack([np.full(4, -math.sin(turn * t)), way * math.cos(turn * t + 0.6)])
        found = mod.rhs(0.0, x)
        return np.vstack([found[rows[:2]], (found[rows[2:]] * x[rows[2:]]).sum(axis=0)])

    z, h = np.zeros((3, 4)), 1.0 / number
    for k in range(4 * number):
        a = rates(k * h, z)
        b = rates((k + 0.5) * h, z + 0.5 * h * a)
        c = rates((k + 0.5) * h, z + 0.5 * h * b)
        z = z + h / 6.0 * (a + 2.0 * b + 2.0 * c + rates((k + 1) * h, z + h * c))
        if (k + 1) % number == 0:
            work.append(z[2])
    assert np.diff(work, axis=0).max() < 0.0


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


@pytest.mark.parametrize("law", [BRUSH, SYMMETRIC], ids=["brush", "magic_formula"])
def test_axis_may_point_to_the_right(law: dict[str, Any]) -> None:
    """A tyre without a left and a right side is the same after half a turn about the normal: it rolls backwards."""
    left, right = (corner(law, 0.05, settling=0.02, axis=axis) for axis in ((0, 1, 0), (0, -1, 0)))
    sign = np.array([-1.0 if name.startswith("tyre") else 1.0 for name in left.x_names])
    for x in random_states(left):
        wanted = left.rhs(0.0, x)
        np.testing.assert_allclose(sign * right.rhs(0.0, sign * x), wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())


@LAWS
def test_rolls_backwards_as_its_mirror_image_forwards(law: dict[str, Any]) -> None:
    """Fore and aft exchanged: driving stays driving, the aligning moment turns the wheel into its motion."""
    mod = corner(law, 0.05, settling=0.02)
    mirrored = ("x", "steer", "spin", "x_dot", "steer_dot", "spin_dot", "tyre_deflection_x")
    sign = np.array([-1.0 if name in mirrored else 1.0 for name in mod.x_names])
    for x in random_states(mod):
        wanted = sign * mod.rhs(0.0, x)
        np.testing.assert_allclose(mod.rhs(0.0, sign * x), wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())


def test_aligning_moment_restores_both_ways() -> None:
    mod = corner(BRUSH)
    for forward in (10.0, -10.0):
        for angle in (0.02, -0.05):
            tangent = -math.tan(angle) * math.copysign(1.0, forward)
            x = state(
                mod, (0.0, tangent * RELAXATION[1]), z=R - 0.02, x_dot=forward, steer=angle,
                spin_dot=forward * math.cos(angle) / R,
            )  # fmt: skip
            assert mod.bias(0.0, x)[3] * math.copysign(1.0, angle) > 10.0


@LAWS
def test_forces_pass_smoothly_through_a_standstill(law: dict[str, Any]) -> None:
    mod = corner(law, 0.03, settling=0.02)
    x = state(mod, (0.02, -0.03), z=R - 0.02)
    forward = mod.x_names.index("x_dot")
    sides = []
    for speed in (-1e-8, 1e-8):
        x[forward] = speed
        sides.append(mod.rhs(0.0, x))
    np.testing.assert_allclose(sides[0], sides[1], rtol=1e-6, atol=1e-6)
    x[forward] = 0.02  # its own velocity of reversal is 0.1
    units, step = np.eye(len(x)), 1e-7
    wanted = np.array([(mod.rhs(0.0, x + step * e) - mod.rhs(0.0, x - step * e)) / (2 * step) for e in units]).T
    np.testing.assert_allclose(mod.jacobian(0.0, x), wanted, rtol=1e-6, atol=1e-7 * np.abs(wanted).max())


@pytest.mark.parametrize("law", [BRUSH, SYMMETRIC], ids=["brush", "magic_formula"])
def test_pushed_wheel_turns_back(law: dict[str, Any]) -> None:
    """A force against the motion: V = V_0 - F t / (m + J / R_e^2), through 0 and back to where it was."""
    mass, J, push, inertia = 120.0, 3.0, 300.0, 120.0 + 3.0 / R**2
    m = eg.Model("pushed", gravity=(0, 0, 0))
    hub, wheel = m.body("hub", mass=mass - 20.0), m.body("wheel", mass=20.0, inertia=(2.0, J, 2.0))
    m.prismatic("x", m.ground.at(0, 0, R - 0.03), hub, axis="x")
    m.revolute("spin", hub, wheel, axis="y")
    m.actuator("push", "x", value=-push)
    m.tyre("tyre", m.ground, wheel, radius=R, stiffness=STIFFNESS, relaxation=(0.02, 0.02), settling=0.05, **law)
    end = 2.0 * 1.5 * inertia / push
    traj = m.compile(target="numpy").simulate((0, end), {"x_dot": 1.5, "spin_dot": 1.5 / R}, method="Radau", rtol=1e-8)
    assert traj["x_dot"][-1] == pytest.approx(-1.5, rel=2e-3)
    assert traj["x"][-1] == pytest.approx(0.0, abs=0.01)
    assert traj["spin_dot"][-1] * R == pytest.approx(-1.5, rel=5e-3)
