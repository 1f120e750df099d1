"""Creep of wheel and rail: the linear wheelset beside textbook matrices, saturation beside published formulas."""

from functools import cache

import numpy as np
import pytest
from force_judges import differences
from refusals import refused, refuses
from scipy.optimize import brentq

import eomgen as eg

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


def test_klingel_wave() -> None:
    """Slow and without springs a wheelset follows a wave of the length 2 pi sqrt(r b / cone) (Klingel 1883)."""
    mod = wheelset().compile(target="numpy")
    V = 0.5
    values = np.linalg.eigvals(reduced(mod, V, {**P, "ky": 0.0, "kpsi": 0.0, "f23": 0.0, "f33": 0.0}))
    slow = values[np.abs(values.imag) > 1e-6]
    length = 2 * np.pi * np.sqrt(P["r"] * P["b"] / P["cone"])
    assert 2 * np.pi * V / np.abs(slow.imag).max() == pytest.approx(length, rel=1e-5)


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


@pytest.mark.parametrize(
    ("law", "told"),
    [("linear", "rolling"), ("polach", "rolling Painleve's")],
)
def test_rest_is_detected_by_the_speed_of_rolling(law: str, told: str) -> None:
    """Creepages are divided by the speed of the axle along the track; the ends of a spring have no part in it."""
    mod = wheelset(law).compile(target="numpy").bind(p={"V": 0.0})
    with refused(f"EG-NOT-FINITE left right {told}") as error:
        mod.rhs(0.0, np.zeros(mod.n_x))
    assert "cylinder" not in str(error.value)
