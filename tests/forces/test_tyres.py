"""Tyres: the brush model and the Magic Formula against formulas written anew, cornering, locked wheels, states."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import eomgen as eg
from eomgen.errors import ModelError

R, STIFFNESS, MU, C = 0.313, 2.0e5, 0.9, 6.0e4
RELAXATION = (0.25, 0.4)
BRUSH = {"law": "brush", "slip_stiffness": C, "friction": MU, "half_length": 0.06}
POINT = {"law": "brush", "slip_stiffness": C, "friction": MU}  # without an aligning moment
COMMON = {"radius": R, "stiffness": STIFFNESS, "relaxation": RELAXATION}


def corner(law: dict[str, Any], camber: float = 0.0, turn: float = 0.0) -> eg.Model:
    """A wheel on a hub that moves along x, y, z; the road may be turned about z and has no other effect."""
    m = eg.Model("corner", gravity=(0, 0, 0))
    for name in ("a", "b"):
        m.body(name, mass=0)
    hub = m.body("hub", mass=100.0, inertia=(5.0, 5.0, 5.0))
    wheel = m.body("wheel", mass=20.0, inertia=(0.5, 0.9, 0.5))
    m.prismatic("x", m.ground, "a", axis="x")
    m.prismatic("y", "a", "b", axis="y")
    m.prismatic("z", "b", hub, axis="z")
    m.revolute("spin", hub.at(0, 0, 0, rpy=(camber, 0, 0)), wheel, axis="y")
    m.tyre("tyre", m.ground.at(0, 0, 0, rpy=(0, 0, turn)), wheel, **{**COMMON, **law})
    return m


def forces(mod: Any, kappa: float, tangent: float, load: float, camber: float = 0.0) -> np.ndarray:
    """Force on a rolling wheel in ground axes at slips with deflections that belong to them, and torque on its spin."""
    x = mod.x0(z=R * math.cos(camber) - load / STIFFNESS, x_dot=10.0)
    x[mod.x_names.index("tyre_deflection_x")] = -kappa * RELAXATION[0]
    x[mod.x_names.index("tyre_deflection_y")] = tangent * RELAXATION[1]
    return -mod.bias(0.0, x)[:4]


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
        found = forces(mod, kappa, tangent, load)
        np.testing.assert_allclose(found[:2], [whole * sx / s, -whole * sy / s], rtol=1e-9, atol=1e-8)
        assert found[2] == pytest.approx(load, rel=1e-12)
        assert found[3] == pytest.approx(-found[0] * R, rel=1e-9)
    assert met == {True, False}
    slope = (forces(mod, 1e-7, 0, load)[0], forces(mod, 0, 1e-7, load)[1])
    np.testing.assert_allclose(slope, (C * 1e-7, -C * 1e-7), rtol=1e-5)


def test_aligning_moment_of_the_brush() -> None:
    """M_z = -t F_y, t = a (1 - r)^3 / (3 - 3 r + r^2); for small slip a / 3, 0 where all slides."""
    m = eg.Model("steer", gravity=(0, 0, 0))
    slide = m.body("slide", mass=1.0)
    hub = m.body("hub", mass=1.0, inertia=(1.0, 1.0, 1.0))
    m.prismatic("x", m.ground, slide, axis="x")
    m.revolute("steer", slide.at(0, 0, R - 0.02), hub, axis="z")
    m.tyre("tyre", m.ground, hub, **COMMON, **BRUSH)
    mod = m.compile(target="numpy")
    load = 0.02 * STIFFNESS
    for tangent in (1e-6, 0.05, -0.1, 0.5):
        x = mod.x0(x_dot=10.0)
        x[mod.x_names.index("tyre_deflection_y")] = tangent * RELAXATION[1]
        r = min(1.0, C * abs(tangent) / (3 * MU * load))
        side = -math.copysign(MU * load * (1 - (1 - r) ** 3), tangent)
        trail = 0.06 * (1 - r) ** 3 / (3 - 3 * r + r * r)
        assert -mod.bias(0.0, x)[1] == pytest.approx(-trail * side, rel=1e-6, abs=1e-12)


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
            found = forces(mod, kappa, tangent, load, camber)
            np.testing.assert_allclose(found[:2], magic(kappa, tangent, load, camber, shifts), rtol=1e-9, atol=1e-6)


def test_peaks_and_slopes_of_the_magic_formula() -> None:
    """At 4 kN the largest forces are D = mu F_z = 1.210 and 0.990 of the load, the slopes K (Pacejka, appendix 3)."""
    mod = corner({"law": "magic_formula", "shifts": False}).compile(target="numpy")
    along = max(forces(mod, k, 0.0, 4000.0)[0] for k in np.linspace(0.05, 0.3, 60))
    across = max(forces(mod, 0.0, -k, 4000.0)[1] for k in np.linspace(0.05, 0.5, 60))
    assert along == pytest.approx(1.210 * 4000, rel=1e-3)
    assert across == pytest.approx(0.990 * 4000, rel=1e-3)
    assert forces(mod, 1e-6, 0.0, 4000.0)[0] / 1e-6 == pytest.approx(21.51 * 4000, rel=1e-4)
    stiffness = 14.95 * 4000 * math.sin(2 * math.atan(1 / 2.130))
    assert -forces(mod, 0.0, 1e-6, 4000.0)[1] / 1e-6 == pytest.approx(stiffness, rel=1e-4)


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


@pytest.mark.parametrize("law", [POINT, {"law": "magic_formula", "shifts": False}], ids=["brush", "magic_formula"])
def test_steady_cornering_is_that_of_the_linear_bicycle(law: dict[str, Any]) -> None:
    """r = V delta / (L + K V^2), K = (m / L) (b / C_f - a / C_r), for small angles."""
    steer, V = 1e-4, 20.0  # small: the brush weakens by r = C alpha / (3 mu F_z)
    mod = bicycle(steer, law).compile()
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
    mod = m.compile()
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
    m = corner({**law, "relaxation": lengths})
    mod = m.compile(target="numpy")
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


def test_tread_and_carcass_of_two_relaxation_lengths() -> None:
    """The tread's s_0 slip and the carcass's (s - s_0) F / C grow together by the slip velocity; s_0 is the shorter."""
    load = 0.02 * STIFFNESS
    for lengths in (RELAXATION, RELAXATION[::-1]):
        mod = corner({**POINT, "relaxation": lengths}).compile(target="numpy")
        tread, rows = min(lengths), [mod.x_names.index(f"tyre_deflection_{k}") for k in "xy"]
        grip = 3.0 * MU * load / C

        def held(slips: np.ndarray, tread: float = tread, grip: float = grip, s: Any = lengths) -> np.ndarray:
            r = min(1.0, float(np.hypot(*slips)) / grip)
            force = MU * load * (1 - (1 - r) ** 3) * slips / np.hypot(*slips)
            return tread * slips + (np.array(s) - tread) * force / C

        for slips in ((0.01, 0.02), (-0.05, 0.1), (0.1, -0.03), (0.0, 0.12), (0.3, 0.2)):
            slip, V = np.array(slips), np.array([-0.004, 0.003]) * np.sign(slips)  # at rest, and back from sliding
            x = mod.x0(z=R - load / STIFFNESS, y_dot=V[1], spin_dot=-V[0] / R)
            x[rows] = slip * lengths
            change, step = mod.rhs(0.0, x)[rows] / lengths, 1e-7
            if np.hypot(*slip) > grip and slip @ V > 0:
                continue
            taken = (held(slip + step * change) - held(slip - step * change)) / (2 * step)
            np.testing.assert_allclose(taken, V, rtol=1e-6, atol=1e-9)


def test_settling_damps_a_standing_wheel_and_no_steady_slip() -> None:
    """m s^2 + (C tau / s_y) s + C / s_y = 0 sideways at rest; tan alpha = V_sy / |V_x| while it rolls."""
    tau = 0.04
    mod = corner({**BRUSH, "settling": tau}).compile(target="numpy")
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


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("law", [BRUSH, {"law": "magic_formula"}], ids=["brush", "magic_formula"])
def test_exact_derivatives(target: str, law: dict[str, Any]) -> None:
    mod = corner({**law, "damping": 300.0, "settling": 0.03}, camber=0.03).compile(target=target)
    x = mod.x0(z=R - 0.02, x_dot=10.0, y_dot=0.4, z_dot=-0.1, spin_dot=9.5 / R)
    x[8:] = [0.01, 0.02]
    units, step = np.eye(len(x)), 1e-7
    wanted = np.array([(mod.rhs(0.0, x + step * e) - mod.rhs(0.0, x - step * e)) / (2 * step) for e in units]).T
    np.testing.assert_allclose(mod.jacobian(0.0, x), wanted, rtol=1e-6, atol=1e-8 * np.abs(wanted).max())


def test_turned_road_energy_and_verify() -> None:
    """The road's x axis has no meaning; the load has a potential."""
    values = []
    for turn in (0.0, 1.1):
        mod = corner(BRUSH, 0.02, turn).compile(target="numpy")
        x = mod.x0(z=R - 0.02, x_dot=10.0, y_dot=0.4, spin_dot=9.5 / R)
        x[8:] = [0.01, 0.02]
        values.append(mod.rhs(0.0, x))
    np.testing.assert_allclose(values[1], values[0], rtol=1e-11, atol=1e-11)
    depth = R * math.cos(0.02) - (R - 0.02)
    assert mod.energy(x)[1] == pytest.approx(0.5 * STIFFNESS * depth**2, rel=1e-12)
    assert mod.verify().ok
    assert corner({"law": "magic_formula"}).compile(target="numpy").verify().ok


@pytest.mark.parametrize(
    ("law", "place", "told"),
    [
        ({"law": "fiala"}, "law", "brush"),
        ({"law": "brush", "friction": 0.9}, "slip_stiffness", "is missing"),
        ({**BRUSH, "friction": -1}, "friction", "is -1"),
        ({**BRUSH, "relaxation": (0.2, 0)}, "relaxation[1]", "is 0"),
        ({**BRUSH, "damping": -5}, "damping", "is -5"),
        ({**BRUSH, "settling": -1}, "settling", "is -1"),
        ({**BRUSH, "reversal": 0}, "reversal", "is 0"),
        ({**BRUSH, "shifts": False}, "shifts", "belongs to law: magic_formula"),
        ({"law": "magic_formula", "half_length": 0.1}, "half_length", "belongs to law: brush"),
    ],
)
def test_what_is_wrong_is_told(law: dict[str, Any], place: str, told: str) -> None:
    with pytest.raises(ModelError) as error:
        corner(law).mechanism()
    found = {p.path: f"{p.message}; {p.remedy}" for p in error.value.problems}
    assert told in found.get(f"forces.tyre.{place}", f"nothing there: {found}"), found
