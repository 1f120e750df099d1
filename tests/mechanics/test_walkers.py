"""Walkers of the literature: the simplest walker and the compass gait."""

from typing import Any

import models
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg

# -- The simplest walker -----------------------------------------------------------------------------------------------
SIMPLEST = models.reference("simplest_walker")
GAMMA = SIMPLEST["parameters_SI"]["gamma"]
TIGHT = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15}
MIDDLE = 1.0  #: runs start in the swing: right after heel strike the event's value is 0, which would count
#: The paper's equations, solved for the accelerations.  At midstance both feet pass the ground: the value falls, which
#: is ignored; at heel strike it rises.
MODEL = """
name: walker
parameters: {gamma: 0.009}
equations:
  coordinates: [theta, phi]
  mass_matrix: [[1, 0], [0, 1]]
  forcing:
    - sin(theta - gamma)
    - sin(theta - gamma) + (theta_dot**2 - cos(theta - gamma))*sin(phi)
events:
  heel_strike:
    expression: phi - 2*theta
    direction: 1
    reset:
      theta: -theta
      phi: -2*theta
      theta_dot: cos(2*theta)*theta_dot
      phi_dot: cos(2*theta)*(1 - cos(2*theta))*theta_dot
"""


@pytest.fixture(scope="module")
def walker(tmp_path_factory: pytest.TempPathFactory) -> Any:
    file = tmp_path_factory.mktemp("walker") / "walker.yaml"
    file.write_text(MODEL, encoding="utf-8")
    return eg.load(file).compile(target="numpy")


def rates(t: float, x: np.ndarray, gamma: float) -> list[float]:
    theta, phi, w, s = x
    return [w, s, np.sin(theta - gamma), np.sin(theta - gamma) + (w * w - np.cos(theta - gamma)) * np.sin(phi)]


def touches(t: float, x: np.ndarray, gamma: float) -> float:
    return float(x[1] - 2 * x[0])


touches.terminal, touches.direction = True, 1  # type: ignore[attr-defined]


def after_strike(z: np.ndarray) -> np.ndarray:
    """The state right after heel strike, from theta and theta_dot then."""
    theta, w = z
    return np.array([theta, 2 * theta, w, w * (1 - np.cos(2 * theta))])


def in_mid_swing(z: np.ndarray, gamma: float = GAMMA) -> np.ndarray:
    return np.asarray(solve_ivp(rates, (0, MIDDLE), after_strike(z), args=(gamma,), **TIGHT).y[:, -1])


def stride(z: np.ndarray, gamma: float = GAMMA) -> tuple[np.ndarray, float]:
    """theta and theta_dot one step later, and the time it takes."""
    run = solve_ivp(rates, (MIDDLE, 10), in_mid_swing(z, gamma), args=(gamma,), events=touches, **TIGHT)
    theta, _, w, _ = run.y[:, -1]
    return np.array([-theta, np.cos(2 * theta) * w]), float(run.t[-1])


def slope(of: Any, z: np.ndarray, h: float = 1e-5) -> np.ndarray:
    """Central differences of fourth order."""
    columns = [(8 * (of(z + d) - of(z - d)) - of(z + 2 * d) + of(z - 2 * d)) / (12 * h) for d in h * np.eye(len(z))]
    return np.column_stack(columns)


def steady_gait(z: np.ndarray, gamma: float = GAMMA) -> np.ndarray:
    """The gait near z, by Newton's iteration."""
    for _ in range(4):
        z = z - np.linalg.solve(slope(lambda y: stride(y, gamma)[0], z) - np.eye(2), stride(z, gamma)[0] - z)
    return z


def eigenvalues(A: np.ndarray) -> np.ndarray:
    return np.array(sorted(np.linalg.eigvals(A), key=lambda x: (-abs(x), -x.imag)))


@pytest.mark.parametrize("gait", ["long", "short"])
def test_floquet_multipliers(walker: Any, gait: str) -> None:
    """Those of one period of the motion: 1 along it, 0 because the strike sets phi by theta, and two of the stride."""
    published = SIMPLEST[gait]
    z = np.array([published["theta"], published["theta_dot"]])
    z = steady_gait(z)
    np.testing.assert_allclose(z, [published["theta"], published["theta_dot"]], atol=1e-9)
    period, start = stride(z)[1], in_mid_swing(z)
    s = walker.sensitivities(
        walker.x_names, period, dict(zip(walker.x_names, start, strict=True)), rtol=1e-12, atol=1e-14
    )
    np.testing.assert_allclose(s.trajectory.x[:, -1], start, atol=1e-9)
    assert [event.name for event in s.events] == ["heel_strike"]
    found = eigenvalues(s.dx[:, :, -1])
    exact = eigenvalues(slope(lambda z: stride(z)[0], z))
    expected = np.array(sorted([1.0, *exact, 0.0], key=lambda x: (-abs(x), -x.imag)))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)
    if gait == "short":
        np.testing.assert_allclose(exact, published["eigenvalues"], atol=5e-3)


# -- The compass gait --------------------------------------------------------------------------------------------------
SLOPE, G_COMPASS = np.deg2rad(3.0), 9.81
STANCE, SWING, STANCE_RATE, SWING_RATE = 0.2187, -0.3234, -1.0918, -0.3772


@pytest.fixture(scope="module")
def biped() -> Any:
    """In axes along the slope; a foot that comes down in front is held, and the other one let go."""
    m = eg.Model("compass", gravity=(G_COMPASS * np.sin(SLOPE), -G_COMPASS * np.cos(SLOPE), 0))
    carriage, hip = m.body("carriage", mass=0), m.body("hip", mass=10.0)
    m.prismatic("x", m.ground, carriage, axis="x")
    m.prismatic("y", carriage, hip, axis="y")
    for name in "ab":
        leg = m.body(f"leg_{name}", mass=5.0, com=(0, -0.5, 0), inertia={"zz": 0})
        m.revolute(f"turn_{name}", hip, leg, coordinate=name)
        leg.marker("foot", at=(0, -1, 0))
    for name, other in ("ab", "ba"):
        # feet of equal legs touch the ground as they pass each other, which does not count
        ahead = f"x(leg_{name}.foot) - x(leg_{other}.foot)"
        m.hold(
            f"step_{name}", m.ground, f"leg_{name}.foot", axes="xy", closed=name == "a", releases=f"step_{other}",
            closes=f"y(leg_{name}.foot) if {ahead} > 0.3 else 1",
        )  # fmt: skip
    return m.compile(target="numpy")


def start_of(stance: float, swing: float, stance_rate: float, swing_rate: float) -> dict[str, float]:
    a, b = stance + SLOPE, swing + SLOPE
    hip = {"x": -np.sin(a), "y": np.cos(a), "x_dot": -np.cos(a) * stance_rate, "y_dot": -np.sin(a) * stance_rate}
    return {**hip, "a": a, "b": b, "a_dot": stance_rate, "b_dot": swing_rate}


def step_by_hand(state: Any) -> tuple[Any, float]:
    """One step by the equations of the paper, with SciPy: the state after the next heel strike, and the time."""
    from scipy.integrate import solve_ivp

    m_H, m, a, b = 10.0, 5.0, 0.5, 0.5
    l = a + b

    def rates(t: float, x: Any) -> Any:
        ns, s, w_ns, w_s = x
        M = np.array([[m * b**2, -m * l * b * np.cos(s - ns)], [0, (m_H + m) * l**2 + m * a**2]])
        M[1, 0] = M[0, 1]
        c = np.array([m * l * b * np.sin(s - ns) * w_s**2, -m * l * b * np.sin(s - ns) * w_ns**2])
        g = np.array([m * b * G_COMPASS * np.sin(ns), -(m_H * l + m * a + m * l) * G_COMPASS * np.sin(s)])
        return [w_ns, w_s, *np.linalg.solve(M, -c - g)]

    def strike(t: float, x: Any) -> float:
        return float(x[0] + x[1] + 2 * SLOPE) if x[0] > x[1] + 0.3 else 1.0

    strike.terminal, strike.direction = True, -1  # type: ignore[attr-defined]
    run = solve_ivp(rates, (0, 2), state, events=strike, method="DOP853", rtol=1e-11, atol=1e-12)
    ns, s, w_ns, w_s = run.y[:, -1]
    k = np.cos(s - ns)
    before = np.array([[-m * a * b, -m * a * b + (m_H * l**2 + 2 * m * a * l) * k], [0, -m * a * b]])
    after = np.array([[m * b * (b - l * k), m * l * (l - b * k) + m * a**2 + m_H * l**2], [m * b**2, -m * b * l * k]])
    w = np.linalg.solve(after, before @ [w_ns, w_s])
    return np.array([s, ns, *w]), float(run.t[-1])


def test_the_published_limit_cycle(biped: Any) -> None:
    """From the published state it walks on; after each heel strike the same state with the legs exchanged."""
    run = biped.simulate(3.2, start_of(STANCE, SWING, STANCE_RATE, SWING_RATE), rtol=1e-10, atol=1e-12)
    strikes = np.sort(np.concatenate([run.t_events["step_a_closes"], run.t_events["step_b_closes"]]))
    assert len(strikes) == 4
    state, t = np.array([SWING, STANCE, SWING_RATE, STANCE_RATE]), 0.0
    for k, strike in enumerate(strikes):
        state, step = step_by_hand(state)
        t += step
        assert strike == pytest.approx(t, abs=1e-6)
        stance, swing = "ba" if k % 2 == 0 else "ab"
        i = np.flatnonzero(np.abs(run.t - strike) < 1e-9)[-1]
        found = [run[swing][i] - SLOPE, run[stance][i] - SLOPE, run[f"{swing}_dot"][i], run[f"{stance}_dot"][i]]
        np.testing.assert_allclose(found, state, atol=1e-6)
        np.testing.assert_allclose(found, [SWING, STANCE, SWING_RATE, STANCE_RATE], atol=2e-3)  # published
