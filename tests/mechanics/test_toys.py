"""Toys of the literature.

The woodpecker toy (Glocker 1995; Leine, Glocker and van Campen 2001 and 2003): its limit cycle by rigid contact.

A sleeve with clearance slides down a pole; a bird on a spring swings beside it.  The lower and the upper corner of the
sleeve jam on the pole in turn, and the beak strikes it.  Numbers, the small-angle model and the state on the limit
cycle are those of R. I. Leine, C. Glocker, D. H. van Campen, Nonlinear dynamics of the woodpecker toy,
DETC2001/VIB-21608.

The tippe top: an eccentric sphere that slides on a plane turns over, or not, as published criteria say.

With alpha = a / R (eccentricity), gamma = I_1 / I_3 and friction that grows with the sliding velocity, the inverted
spin is the only stable one if 1 - alpha < gamma < 1 + alpha and Jellett's constant exceeds
sqrt(m g R^3 I_3 alpha) (1 + alpha)^2 / sqrt(1 + alpha - gamma) (S. Rauch-Wojciechowski, M. Skoldstam, T. Glad,
Mathematical analysis of the tippe top, Regul. Chaotic Dyn. 10 (2005), 333-362; the three groups of tops also in
T. Ueda, K. Sasaki, S. Watanabe, SIAM J. Appl. Dyn. Syst. 4 (2005), 1159-1194).
"""

import json
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from models import IN_C
from scipy.integrate import solve_ivp

import eomgen as eg

R_0, R_M, H_M, L_M, L_G, H_S, L_S = 0.0025, 0.0031, 0.0058, 0.010, 0.015, 0.02, 0.0201
M_M, M_S, J_M, J_S, C_PHI, G = 0.0003, 0.0045, 5e-9, 7e-7, 0.0056, 9.81
MU, E_BEAK = 0.3, 0.5
START = np.array([0.0, -0.1036, -0.2788, -0.3411, 0.0, -7.4583])  #: y, phi_M, phi_S and rates, published

#: Gaps at phi = 0 and their slopes by [y, phi_M, phi_S], sliding velocities likewise: beak, lower and upper corner.
GAPS = np.array([L_M + L_G - L_S - R_0, R_M - R_0, R_M - R_0])
NORMALS = np.array([[0, 0, -H_S], [0, H_M, 0], [0, -H_M, 0]])
SLIDES = np.array([[1, L_M, L_G - L_S], [1, R_M, 0], [1, R_M, 0]])
SMALL = 0.001  #: radius of what stands for a corner (m)
REFERENCE = json.loads((Path(__file__).parents[1] / "reference" / "woodpecker_baumann_nuetzi.json").read_text("utf-8"))
PUBLISHED = REFERENCE["published"]


def woodpecker() -> Any:
    """The small-angle model of the paper as sliders: each corner moves across and along the pole as it says."""
    m = eg.Model("woodpecker", gravity=(0, -G, 0))
    sleeve = m.body("sleeve", mass=M_M)
    m.prismatic("S", m.ground, sleeve, axis="y", coordinate="y")
    for name, J in (("M", J_M), ("B", J_S)):
        disc = m.body(f"disc_{name}", mass=0, inertia={"zz": J})
        m.revolute(f"turn_{name}", m.ground, disc, coordinate=f"phi_{name}")
    m.prismatic("bird", m.ground, m.body("mass", mass=M_S), axis="y", coordinate="y_S")
    m.coupling("centre", {"y_S": 1, "y": -1, "phi_M": -L_M, "phi_B": -L_G})
    m.torque("spring_M", "turn_M", f"{C_PHI}*(phi_B - phi_M)")
    m.torque("spring_B", "turn_B", f"{C_PHI}*(phi_M - phi_B)")
    coordinates = ("y", "phi_M", "phi_B")
    for k, (gap, normal, slide) in enumerate(zip(GAPS, NORMALS, SLIDES, strict=True)):
        across, along = m.body(f"across{k}", mass=0), m.body(f"along{k}", mass=0)
        m.prismatic(f"a{k}", m.ground, across, axis="x", coordinate=f"x{k}")
        m.prismatic(f"b{k}", across, along, axis="y", coordinate=f"y{k}")
        for name, row, offset in ((f"x{k}", normal, float(gap) + SMALL), (f"y{k}", slide, 0.0)):
            factors = {c: -float(f) for c, f in zip(coordinates, row, strict=True) if f}
            m.coupling(f"tie_{name}", {name: 1, **factors}, offset=offset)
        m.contacts(
            f"touch{k}",
            {"shape": "circle", "radius": SMALL, "on": along},
            {"shape": "half_plane", "on": m.ground.at(0, 0, 0, rpy=(0, 0, -np.pi / 2))},
            {"normal_law": "rigid", "friction": MU, "restitution": E_BEAK if k == 0 else 0.0},
        )
    m.independent(*coordinates)
    return m.compile(**IN_C)


def by_hand(end: float, h: float) -> Any:
    """Moreau's midpoint scheme with the paper's matrices, contacts by projected Gauss-Seidel sweeps: (n, 7) t, q, u."""
    arms = np.array([1.0, L_M, L_G])  # of the bird's mass
    M = np.diag([M_M, J_M, J_S]) + M_S * np.outer(arms, arms)
    inverse, q, u, found = np.linalg.inv(M), START[:3].copy(), START[3:].copy(), []
    for k in range(round(end / h)):
        middle = q + 0.5 * h * u
        pull = C_PHI * (middle[1] - middle[2])
        force = np.array([-(M_S + M_M) * G, -pull - M_S * G * L_M, pull - M_S * G * L_G])
        free = u + h * inverse @ force
        closed = np.flatnonzero(GAPS + NORMALS @ middle <= 0.0)
        n = len(closed)
        W = np.vstack([NORMALS[closed], SLIDES[closed]])
        A, c, P = W @ inverse @ W.T, W @ free, np.zeros(2 * n)
        c[:n] += np.where(closed == 0, E_BEAK, 0.0) * (W[:n] @ u)
        for _ in range(3000):
            last = P.copy()
            for i in range(n):
                P[i] = max(0.0, P[i] - (c[i] + A[i] @ P) / A[i, i])
                j = n + i
                P[j] = np.clip(P[j] - (c[j] + A[j] @ P) / A[j, j], -MU * P[i], MU * P[i])
            if np.abs(P - last).max(initial=0.0) <= 1e-13 * np.abs(P).max(initial=0.0):
                break
        u = free + inverse @ (W.T @ P)
        q = middle + 0.5 * h * u
        found.append([(k + 1) * h, *q, *u])
    return np.array(found)


def periods(t: Any, swing: Any) -> Any:
    """Times between passages of the bird's angle through 0, upwards."""
    k = np.flatnonzero((swing[:-1] < 0) & (swing[1:] >= 0))
    return np.diff(t[k] - swing[k] * (t[k + 1] - t[k]) / (swing[k + 1] - swing[k]))


@pytest.fixture(scope="module")
def run() -> Any:
    start = dict(zip(("y", "phi_M", "phi_B", "y_dot", "phi_M_dot", "phi_B_dot"), START, strict=True))
    return woodpecker().simulate(0.46, start, method="moreau", step=1e-4)


def test_the_published_period(run: Any) -> None:
    """0.1452 s in the paper, by events and Poisson's law; 0.1457 s here, 0.1462 s in the notebook with this step."""
    found = periods(run.t, run["phi_B"]).mean()
    assert found == pytest.approx(PUBLISHED["period_s"], rel=6e-3)
    other = periods(np.array(REFERENCE["t"]), np.array(REFERENCE["phi_S"])).mean()
    assert found == pytest.approx(other, rel=5e-3)


def test_the_published_frequency_and_equilibrium() -> None:
    """The spring's stiffness, which the paper does not print, fits its eigenfrequency and its equilibrium."""
    mod = woodpecker()
    at = {"phi_M": PUBLISHED["equilibrium_phi_M"], "phi_B": PUBLISHED["equilibrium_phi_S"]}
    x = mod.x0(**at)
    names, h = list(mod.x_names), 1e-6
    places = [names.index(name) for name in ("y", "phi_M", "phi_B")]
    rates = [names.index(f"{name}_dot") for name in ("y", "phi_M", "phi_B")]

    def accelerations(state: Any) -> Any:
        return np.array(mod.rhs(0.0, state))[rates]

    slope = np.empty((3, 3))
    for k, place in enumerate(places):
        step = np.zeros_like(x)
        step[place] = h
        ahead, behind = (mod.project(x + sign * step) for sign in (1, -1))
        slope[:, k] = (accelerations(ahead) - accelerations(behind)) / (ahead[place] - behind[place])
    frequency = np.sqrt(np.abs(np.linalg.eigvals(slope)).max()) / (2 * np.pi)
    assert frequency == pytest.approx(PUBLISHED["eigenfrequency_Hz"], abs=0.01)
    hanging = at["phi_M"] - M_S * G * L_G / C_PHI
    assert hanging == pytest.approx(PUBLISHED["equilibrium_phi_S"], abs=1e-4)


def test_the_motion_of_another_implementation(run: Any) -> None:
    """Three periods of a notebook of others: the scheme by hand gives each sample, a run the same motion to 6 %."""
    t = np.array(REFERENCE["t"])
    for name, key, size in (("y", "y", 0.02), ("phi_M", "phi_M", 0.1034), ("phi_B", "phi_S", 0.5)):
        off = np.abs(np.interp(t, run.t, run[name]) - np.array(REFERENCE[key])) / size
        assert np.sqrt(np.mean(off**2)) < 0.06, name
    hand = by_hand(0.43, 1e-4)
    for column, key, most in ((1, "y", 1e-7), (2, "phi_M", 1e-5), (3, "phi_S", 1e-5)):
        assert np.abs(np.interp(t[1:], hand[:, 0], hand[:, column]) - np.array(REFERENCE[key])[1:]).max() < most


def test_the_published_state_is_on_the_limit_cycle(run: Any) -> None:
    """From the published state all but the height comes back after a period; contacts are obeyed all along."""
    T = float(periods(run.t, run["phi_B"]).mean())
    for k in (1, 2, 3):
        i = int(np.argmin(np.abs(run.t - k * T)))
        near = slice(i - 8, i + 9)
        state = np.array([run[name][near] for name in ("phi_M", "phi_B", "y_dot", "phi_B_dot")])
        size = np.array([0.1, 0.3, 0.35, 7.5])
        off = np.abs(state - START[[1, 2, 3, 5], None]) / size[:, None]
        assert off.max(axis=0).min() < 0.02
    gaps = GAPS[:, None] + NORMALS @ np.array([run["y"], run["phi_M"], run["phi_B"]])
    assert gaps.min() > -2e-4 * H_S
    assert (np.abs(run["phi_M"]) < 1.02 * (R_M - R_0) / H_M).all()


M, R, ALPHA, G = 0.015, 0.015, 0.1, 9.81
I_3 = 0.4 * M * R * R
TILT, STIFFNESS = 0.1, 2000.0


@pytest.fixture(scope="module")
def top() -> Any:
    m = eg.Model("tippe_top", gravity=(0, 0, -G))
    I_1 = I_3 * m.parameter("gamma", 1.0)
    body = m.body("top", mass=M, com=(0, 0, -ALPHA * R), inertia={"xx": I_1, "yy": I_1, "zz": I_3})
    m.free("fly", m.ground, body, rotation="euler_parameters")
    law = {"normal_law": "linear", "stiffness": STIFFNESS, "damping": 1.0, "friction": 0.3, "smoothing": 0.1}
    m.sphere_plane("floor", m.ground, body, radius=R, **law)
    return m.compile(target="numpy")


def threshold(gamma: float) -> float:
    """The published least Jellett constant of an inversion."""
    return float(np.sqrt(M * G * R**3 * I_3 * ALPHA) * (1 + ALPHA) ** 2 / np.sqrt(1 + ALPHA - gamma))


def spun(mod: Any, gamma: float, jellett: float, end: float) -> tuple[Any, Any, Any]:
    """A run from a small tilt, spun about the vertical: it, the cosine of the tilt, L . (R z - a e_3) over time."""
    inertia = np.array([gamma, gamma, 1.0]) * I_3
    up = np.array([0.0, np.sin(TILT), np.cos(TILT)])  # in body axes
    spin = jellett / (R * up @ (inertia * up) - ALPHA * R * inertia[2] * up[2])
    start = {"fly_z": R - M * G / STIFFNESS, "fly_e0": np.cos(0.5 * TILT), "fly_e1": np.sin(0.5 * TILT)}
    start |= {"fly_e2": 0.0, "fly_e3": 0.0, **dict(zip(mod.v_names[3:], spin * up, strict=True))}
    run = mod.simulate(end, start, {"gamma": gamma}, rtol=1e-8, atol=1e-10)
    E = mod.poses(run.q)[0, :3, :3]
    L = np.einsum("ijk,jk->ik", E, inertia[:, None] * run.v[3:6])
    return run, E[2, 2], L[2] * R - ALPHA * R * np.einsum("ik,ik->k", L, E[:, 2])


@pytest.mark.parametrize(
    ("gamma", "times", "turns"), [(1.0, 2.0, True), (1.0, 0.8, False), (0.95, 1.5, True), (0.8, 3.0, False)]
)
def test_which_tops_turn_over(top: Any, gamma: float, times: float, turns: bool) -> None:
    """By the spin as a multiple of the published threshold; a top with gamma < 1 - alpha does so at no spin."""
    wanted = times * threshold(gamma)
    run, tilt, jellett = spun(top, gamma, wanted, 8.0)
    np.testing.assert_allclose(jellett, wanted, rtol=2e-3)  # the contact yields a little
    energy = run["energy"]
    assert energy[-1] < energy[0]
    if turns:
        assert tilt[-1] < -0.99
        assert run["fly_z"][-1] == pytest.approx(R - M * G / STIFFNESS, rel=1e-3)
        # it spins on about the vertical, with the same Jellett constant, the other way round in its own axes
        assert run[top.v_names[5]][-1] == pytest.approx(-wanted / (I_3 * R * (1 + ALPHA)), rel=0.02)
    else:
        assert tilt[-1] > -0.9


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
    begin = dict(zip(walker.x_names, start, strict=True))
    s = walker.sensitivities(walker.x_names, period, begin, rtol=1e-12, atol=1e-14)
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
