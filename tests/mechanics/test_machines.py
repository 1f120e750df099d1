"""Machines of the gallery beside closed forms, published equations, circles cut by hand and SymPy's muscles."""

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any

import analysed
import models
import numpy as np
import pytest
import scipy.integrate
import sympy as sp
from sweeps import part_of
from sympy.physics.biomechanics import (
    FiberForceLengthActiveDeGroote2016,
    FiberForceLengthPassiveDeGroote2016,
    FiberForceVelocityDeGroote2016,
)


@cache
def compiled(name: str) -> tuple[Any, dict[str, float]]:
    mod = models.build(name).compile(target="numpy")
    return mod, dict(zip(mod.p_names, mod.p.tolist(), strict=True))


# -- Craft -------------------------------------------------------------------------------------------------------------
def turn(axis: int, angle: Any) -> np.ndarray:
    """Rotation about x (0), y (1) or z (2)."""
    c, s = np.cos(angle), np.sin(angle)
    rows = np.eye(3, dtype=np.asarray(angle).dtype if np.iscomplexobj(angle) else float)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    rows[j, j], rows[j, k], rows[k, j], rows[k, k] = c, -s, s, c
    return rows


def test_furutas_pendulum_accelerates_as_published() -> None:
    """Cazzolato and Prime, On the dynamics of the Furuta pendulum, 2011, equations 33 and 34."""
    mod, p = compiled("furuta_pendulum")
    m, L, l, b1, b2 = p["m_2"], p["L_1"], p["l_2"], p["b_1"], p["b_2"]
    J0 = p["J_1"] + p["m_1"] * p["l_1"] ** 2 + m * L**2
    J2 = p["J_2"] + m * l**2
    random = np.random.default_rng(3)
    for _ in range(5):
        x = random.uniform(-3, 3, 4)
        _, q, v, w = x
        tau = random.uniform(-1, 1)
        matrix = [[J0 + J2 * np.sin(q) ** 2, m * L * l * np.cos(q)], [m * L * l * np.cos(q), J2]]
        force = [
            tau - b1 * v + m * L * l * np.sin(q) * w**2 - v * w * np.sin(2 * q) * J2,
            -b2 * w + 0.5 * v**2 * np.sin(2 * q) * J2 - p["g"] * m * l * np.sin(q),
        ]
        assert mod.rhs(0.0, x, u=[tau])[2:] == pytest.approx(np.linalg.solve(matrix, force), rel=1e-11, abs=1e-11)


def test_a_quadrotor_and_its_load_accelerate_as_published() -> None:
    """Sreenath, Lee and Kumar (CDC 2013): with q from the quadrotor to the load and F = f R e3,

    (m_Q + m_L) (a_L + g e3) = (q . F - m_Q l q' . q') q, and I w' + w x I w = M.
    """
    mod, p = compiled("quadrotor_load")
    m, ml, l, g = p["m"], p["m_l"], p["l"], p["g"]
    e3, eps = np.array([0.0, 0.0, 1.0]), 1e-30
    inertia = np.diag([p["I"], p["I"], p["I_z"]])

    def attitude(a: np.ndarray) -> np.ndarray:
        return turn(0, a[0]) @ turn(1, a[1]) @ turn(2, a[2])

    def down(a: np.ndarray) -> np.ndarray:
        return attitude(a) @ turn(0, a[3]) @ turn(1, a[4]) @ -e3

    def spin(a: np.ndarray, v: np.ndarray) -> np.ndarray:
        rates = attitude(a).T @ (attitude(a + 1j * eps * v).imag / eps)  # R^T R'
        return np.array([rates[2, 1], rates[0, 2], rates[1, 0]])

    random = np.random.default_rng(5)
    for _ in range(4):
        x = random.uniform(-0.5, 0.5, 16)
        place, a, v = x[:3], x[3:8], x[8:]
        roll, pitch, yaw, sx, sy = a
        q, rate = down(a), down(a + 1j * eps * v[3:]).imag / eps
        lift = (m + ml) * (g + 4 * p["omega"] ** 2 * (p["goal_z"] - place[2]) - 4 * p["omega"] * v[2])
        F = lift / (np.cos(roll) * np.cos(pitch)) * attitude(a) @ e3
        load = ((q @ F - m * l * rate @ rate) * q) / (m + ml) - g * e3
        tension = -ml * (load + g * e3) @ q
        expected = (F + tension * q) / m - g * e3
        found = mod.rhs(0.0, x)[8:]
        assert found[:3] == pytest.approx(expected, rel=1e-10, abs=1e-10)
        w, k = p["omega"], p["omega_a"]
        asked_roll = -(w**2 * (p["goal_y"] - place[1]) - 2 * w * v[1]) / g + p["k_s"] * (sx + roll)
        asked_pitch = (w**2 * (p["goal_x"] - place[0]) - 2 * w * v[0]) / g + p["k_s"] * (sy + pitch)
        moment = inertia @ [
            k**2 * (asked_roll - roll) - 2 * k * v[3],
            k**2 * (asked_pitch - pitch) - 2 * k * v[4],
            -(k**2) / 25 * yaw - k * 2 / 5 * v[5],
        ]
        body = spin(a, v[3:])
        h = 1e-6
        ahead, behind = (spin(a + s * h * v[3:], v[3:] + s * h * found[3:]) for s in (1, -1))
        assert inertia @ (ahead - behind) / (2 * h) + np.cross(body, inertia @ body) == pytest.approx(
            moment, rel=1e-6, abs=1e-8
        )


# -- Engines -----------------------------------------------------------------------------------------------------------
def gas(p: dict[str, float], after: sp.Expr) -> sp.Expr:
    """Force on a piston at the crank's angle after the dead centre at which it fires."""
    r, l, e = p["r"], p["l"], p["ratio"]
    volume = 2 * r / (e - 1) + r + l - r * sp.cos(after) - sp.sqrt(l**2 - (r * sp.sin(after)) ** 2)
    largest = 2 * r / (e - 1) + 2 * r
    shut = (1 + sp.tanh(p["sharp"] * sp.cos(after / 2))) / 2
    burnt = (1 + sp.tanh(p["sharp"] * sp.sin((after - p["delay"]) / 2))) / 2
    pressure = p["p_0"] * (largest / volume) ** p["kappa"] * (1 + (p["rise"] - 1) * burnt)
    return shut * (pressure - p["p_0"]) * sp.pi * p["bore"] ** 2 / 4


def acceleration(mod: Any, cylinders: list[tuple[float, float]]) -> Any:
    """theta'' = (Q - V' - I' omega^2 / 2) / I of an engine with cylinders (angle of the axis, angle when it fires)."""
    p = dict(zip(mod.p_names, mod.p, strict=True))
    theta, omega = sp.symbols("theta omega")
    r, l, g, mass = p["r"], p["l"], p["g"], 0.4
    pin = sp.Matrix([r * sp.cos(theta), r * sp.sin(theta)])
    inertia, potential = p["J"] + 6 * (r / 10) ** 2, -6 * g * pin[1] / 10
    force = -p["c"] * omega**2
    for axis, fires in cylinders:
        way = r * sp.cos(theta - axis) + sp.sqrt(l**2 - (r * sp.sin(theta - axis)) ** 2)
        piston = way * sp.Matrix([sp.cos(axis), sp.sin(axis)])
        rod = pin + 0.3 * (piston - pin)
        swing = sp.asin(r / l * sp.sin(theta - axis))
        inertia += mass * (rod.diff(theta).dot(rod.diff(theta)) + way.diff(theta) ** 2)
        inertia += mass * l**2 / 12 * swing.diff(theta) ** 2
        potential += mass * g * (rod[1] + piston[1])
        force -= gas(p, theta - fires) * way.diff(theta)
    found = (force - potential.diff(theta) - inertia.diff(theta) * omega**2 / 2) / inertia
    return sp.lambdify((theta, omega), found, cse=True)


ENGINES = {
    "engine": [(np.pi / 2, np.pi / 2)],
    "v_engine": [(np.pi / 4, np.pi / 4), (3 * np.pi / 4, 3 * np.pi / 4 + 2 * np.pi)],
}


@pytest.mark.parametrize("name", part_of(ENGINES, "engine".__eq__))
def test_an_engine_runs_as_its_one_angle_does(name: str) -> None:
    mod, _ = compiled(name)
    traj = mod.simulate(0.1, rtol=1e-11, atol=1e-13)
    law = acceleration(mod, ENGINES[name])
    start = [traj["theta"][0], traj["theta_dot"][0]]
    by_hand = scipy.integrate.solve_ivp(
        lambda t, y: [y[1], law(*y)], (0, 0.1), start, "DOP853", rtol=1e-11, atol=1e-12, dense_output=True
    )
    expected = by_hand.sol(traj.t)
    assert traj["theta"] == pytest.approx(expected[0], abs=1e-8)
    assert traj["theta_dot"] == pytest.approx(expected[1], abs=1e-6)
    assert traj["theta"][-1] > 2.0 * np.pi


# -- A walker and a wheelset -------------------------------------------------------------------------------------------
def test_a_wheel_without_a_rim_walks_at_the_published_speed() -> None:
    mod = analysed.compiled("rimless_wheel", "cython")
    p = dict(zip(mod.p_names, mod.p, strict=True))
    run = mod.simulate(25.0)
    times = np.sort(np.concatenate([run.t_events[f"step{k}_closes"] for k in range(6)]))
    ends = [np.flatnonzero(np.abs(run.t - time) < 1e-9)[[0, -1]] for time in times]
    before, after = (np.array([run["speed"][pair[k]] for pair in ends]) for k in (0, 1))
    a, turning = np.pi / 6, p["I"] + p["m"] * p["l"] ** 2
    eta = (p["I"] + p["m"] * p["l"] ** 2 * np.cos(2 * a)) / turning
    assert len(times) > 15
    assert after / before == pytest.approx(eta, rel=1e-7)
    gained = 2 * p["m"] * p["g"] * p["l"] * (np.cos(p["slope"] - a) - np.cos(p["slope"] + a)) / turning
    assert after[-1] == pytest.approx(np.sqrt(eta**2 * gained / (1 - eta**2)), rel=1e-6)


# -- Gears and linkages, a car, a leg ----------------------------------------------------------------------------------
def meet(a: np.ndarray, ra: float, b: np.ndarray, rb: float, side: float) -> np.ndarray:
    """The point at distances ra of a and rb of b, to the left (1) or right (-1) of the way from a to b."""
    way = b - a
    length = np.hypot(*way)
    along = (ra**2 - rb**2 + length**2) / (2 * length)
    u = way / length
    return a + along * u + side * np.sqrt(ra**2 - along**2) * np.array([-u[1], u[0]])


def test_a_gear_train_starts_as_a_first_order_lag() -> None:
    """J w' = tau_0 (1 - w/w_0) - m g r / 12, all inertias and the load reduced to the motor by the ratios 3 and 4."""
    mod, p = compiled("gear_train")
    ratio = 60 / 20 * 72 / 18
    inertia = p["J_1"] + p["J_2"] / 9 + (p["J_3"] + p["m"] * p["r"] ** 2) / ratio**2
    last = p["omega_0"] * (1 - p["m"] * p["g"] * p["r"] / ratio / p["tau_0"])
    lag = inertia * p["omega_0"] / p["tau_0"]
    traj = mod.simulate(0.5)
    assert traj["motor_angle_dot"] == pytest.approx(last * (1 - np.exp(-traj.t / lag)), rel=1e-8, abs=1e-9)
    assert traj["height"] == pytest.approx(p["r"] / ratio * traj["motor_angle"], rel=1e-12, abs=1e-14)


def test_the_ram_of_a_shaper_is_where_lever_and_link_hold_it() -> None:
    mod, p = compiled("shaper")
    traj = mod.simulate(1.5)
    pin = p["r"] * np.array([np.cos(traj["theta"]), np.sin(traj["theta"])]) + [[0.0], [p["d"]]]
    end = p["L"] * pin / np.hypot(*pin)
    assert traj["s"] == pytest.approx(end[0] + np.sqrt(p["l"] ** 2 - (p["h"] - end[1]) ** 2), abs=1e-9)


def test_watts_six_bar_is_where_its_circles_meet() -> None:
    mod, p = compiled("watt_six_bar")
    traj = mod.simulate(0.6, t_eval=np.linspace(0.0, 0.6, 31))
    assert np.ptp(traj["theta"]) > 2 * np.pi
    C, F = np.array([0.1, 0.0]), np.array([0.24, 0.0])
    for theta, psi, phi in zip(traj["theta"], traj["psi"], traj["phi"], strict=True):
        A = p["a"] * np.array([np.cos(theta), np.sin(theta)])
        B = meet(A, p["b"], C, p["c"], 1.0)
        arm = np.arctan2(*(B - C)[::-1])
        D = C + p["c"] * np.array([np.cos(arm - p["delta"]), np.sin(arm - p["delta"])])
        E = meet(D, p["d"], F, p["e"], 1.0)
        assert psi == pytest.approx(arm, abs=1e-9)
        assert phi == pytest.approx(np.arctan2(*(E - F)[::-1]), abs=1e-9)


def test_a_half_car_has_the_eigenvalues_of_its_matrices() -> None:
    """M z'' + C z' + K z = 0 of bounce, pitch (nose down) and both wheels"""
    mod, p = compiled("half_car")
    a, b = p["a"], p["b"]
    front, rear = np.array([1, -a, -1, 0]), np.array([1, b, 0, -1])  # how far the springs are stretched
    M = np.diag([p["m"], p["I"], p["m_u"], p["m_u"]])
    K = p["k_f"] * np.outer(front, front) + p["k_r"] * np.outer(rear, rear) + np.diag([0, 0, p["k_t"], p["k_t"]])
    C = p["c_f"] * np.outer(front, front) + p["c_r"] * np.outer(rear, rear)
    system = np.block([[np.zeros((4, 4)), np.eye(4)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    assert list(mod.q_names) == ["z", "theta", "z_f", "z_r"]
    level = np.zeros(8)
    flat = mod.bind(p={"h": 0.0})
    assert flat.rhs(0.0, level) == pytest.approx(np.zeros(8), abs=1e-10)  # the springs bear the weight
    found, expected = np.linalg.eigvals(flat.jacobian(0.0, level)), np.linalg.eigvals(system)
    for value in expected:
        assert np.abs(found - value).min() < 1e-9 * abs(value)
    wheels = [np.sqrt((p["k_t"] + k) / p["m_u"]) for k in (p["k_f"], p["k_r"])]  # the chassis stands still
    assert np.sort(np.abs(found))[-4::2] == pytest.approx(np.sort(wheels), rel=0.01)


def test_the_rear_wheel_meets_the_bump_a_wheelbase_later() -> None:
    mod, p = compiled("half_car")
    traj = mod.simulate(3.0, t_eval=np.linspace(0, 3, 3001))
    later = traj.t[np.argmax(traj["z_r"])] - traj.t[np.argmax(traj["z_f"])]
    assert later == pytest.approx((p["a"] + p["b"]) / p["u"], abs=0.01)


def test_a_leg_has_the_mass_matrix_of_the_gait_model() -> None:
    """The right leg's block of tests/reference/gait2d_autolev.json, whose accelerations are those of Autolev's code."""
    case = models.reference("gait2d_autolev")["cases"][0]
    mod, _ = compiled("gait_leg")
    trunk, *leg = case["q"][2:6]
    q = np.array([leg[0] + trunk, leg[1], leg[2]])
    expected = np.array(case["mass_matrix_own"])[3:6, 3:6]
    assert mod.mass_matrix(q) == pytest.approx(expected, rel=1e-12)


#: origin, points between and insertion as (segment, x, y); force, optimal length, slack length; rise, when it is active
MUSCLES = {
    "iliopsoas": ([(0, 0.06, 0.06), (1, 0.03, -0.14)], 1500, 0.1, 0.1, 0.35, 0.6),
    "gluteus": ([(0, -0.1, 0.06), (1, -0.03, -0.14)], 1500, 0.12, 0.1, 0.2, 0.1),
    "hamstrings": ([(0, -0.055, -0.02), (2, -0.03, -0.07)], 2000, 0.14, 0.35, 0.06, 0.45),
    "vasti": ([(1, 0.03, -0.18), (1, 0.045, -0.45), (2, 0.035, -0.07)], 4000, 0.09, 0.26, 0.05, 0.85),
    "gastrocnemius": ([(1, -0.03, -0.41), (3, -0.05, -0.04)], 1600, 0.08, 0.42, 0.05, 0.4),
    "tibialis": ([(2, 0.02, -0.14), (2, 0.04, -0.4), (3, 0.07, -0.03)], 800, 0.08, 0.26, 0.1, 0.8),
}
#: mass, centre of mass, moment of inertia, length
SEGMENTS = [
    (7.5, (0, -0.191), 0.1522, 0.441),
    (3.4875, (0, -0.1917), 0.0624, 0.4428),
    (1.0875, (0.0768, -0.0351), 0.0184, 0),
]


def leg_by_hand() -> Any:
    """(q, v, t) -> accelerations, by Lagrange's equations and virtual work in SymPy."""
    q, v, t = sp.symbols("q:3"), sp.symbols("v:3"), sp.Symbol("t")
    angles = [0, q[0], q[0] + q[1], q[0] + q[1] + q[2]]  # of trunk, thigh, shank and foot
    places = [sp.zeros(2, 1), sp.zeros(2, 1)]  # of the joints towards the trunk
    for k in (1, 2):
        length = SEGMENTS[k - 1][3]
        places.append(places[k] + length * sp.Matrix([sp.sin(angles[k]), -sp.cos(angles[k])]))

    def point(segment: int, x: float, y: float) -> sp.Matrix:
        c, s = sp.cos(angles[segment]), sp.sin(angles[segment])
        return places[segment] + sp.Matrix([c * x - s * y, s * x + c * y])

    T, V = 0, 0
    for k, (mass, com, inertia, _) in enumerate(SEGMENTS):
        center = point(k + 1, *com)
        speed = center.jacobian(q) * sp.Matrix(v)
        spin = sum(v[: k + 1])
        T += mass * speed.dot(speed) / 2 + inertia * spin**2 / 2
        V += mass * 9.81 * center[1]
    M = sp.hessian(T, v)
    momentum = sp.Matrix([T]).jacobian(v)
    force = (sp.Matrix([T - V]).jacobian(q) - (momentum.jacobian(q) * sp.Matrix(v)).T).T
    force -= sp.Matrix([3 * v[0], v[1], v[2] / 2])
    for path, largest, fiber, slack, rise, when in MUSCLES.values():
        ends = [point(*place) for place in path]
        L = sum(sp.sqrt((b - a).dot(b - a)) for a, b in pairwise(ends))
        slope = sp.Matrix([L]).jacobian(q)
        long, fast = (L - slack) / fiber, (slope * sp.Matrix(v))[0] / (10 * fiber)
        activation = 0.01 + rise * ((1 + sp.cos(2 * sp.pi * (t / 1.3 - when))) / 2) ** 4
        fl, fp, fv = (
            curve.with_defaults(x)
            for curve, x in (
                (FiberForceLengthActiveDeGroote2016, long),
                (FiberForceLengthPassiveDeGroote2016, long),
                (FiberForceVelocityDeGroote2016, fast),
            )
        )
        force -= largest * (activation * fl * fv + fp + 0.1 * fast) * slope.T
    return sp.lambdify((q, v, t), (M, force.doit()), cse=True)


def test_a_leg_accelerates_as_sympys_muscles_ask() -> None:
    """Muscles of De Groote and others (2016) from SymPy; inside the limits of the knee."""
    mod, _ = compiled("gait_leg")
    by_hand = leg_by_hand()
    random = np.random.default_rng(2)
    for _ in range(4):
        q, v, t = random.uniform([-0.4, -1.0, -0.3], [0.5, -0.1, 0.3]), random.uniform(-3, 3, 3), random.uniform(0, 1.3)
        M, force = by_hand(q, v, t)
        expected = np.linalg.solve(M, np.ravel(force))
        assert mod.rhs(t, np.concatenate([q, v]))[3:] == pytest.approx(expected, rel=1e-9)


def test_a_leg_steps() -> None:
    """After three steps the motion repeats: hip and knee bend as far each time."""
    traj = compiled("gait_leg")[0].simulate(5.2, t_eval=np.linspace(0, 5.2, 1041))
    third, fourth = (slice(520, 780), slice(781, 1041))
    for name, least in (("hip", 0.7), ("knee", 0.5)):
        assert np.ptp(traj[name][fourth]) > least
        assert np.ptp(traj[name][third]) == pytest.approx(np.ptp(traj[name][fourth]), rel=0.03)


# -- What the descriptions say -----------------------------------------------------------------------------------------
#: What the description of an example says of its motion -> whether a run does so.
CLAIMS: list[tuple[str, str, Callable[[Any], bool]]] = [
    ("cart_pendulum", "falls over", lambda run: run["phi"].max() > np.pi / 2),
    ("four_bar", "coasting", lambda run: run["theta_dot"].min() > 0),
    ("gear_train", "lifts a load", lambda run: run["height"][-1] > 0.1),
    ("kapitza_pendulum", "upside down, held there", lambda run: np.abs(run["theta"] - np.pi).max() < 0.3),
    ("pendulum", "released from the horizontal", lambda run: abs(run["y"][0]) < 1e-12),
    ("planetary_gear", "load that sinks", lambda run: run["height"][-1] < -0.1),
    ("slider_crank", "that swings", lambda run: np.ptp(run["theta"]) < np.pi + 1),
    ("spherical_pendulum", "swinging round", lambda run: run["phi"][-1] > 2 * np.pi),
    ("watt_six_bar", "output swings less", lambda run: np.ptp(run["swing_out"]) < np.ptp(run["swing_in"])),
]


@pytest.mark.parametrize(("name", "text", "does"), CLAIMS, ids=[name for name, _, _ in CLAIMS])
def test_examples_move_as_they_are_described(name: str, text: str, does: Callable[[Any], bool]) -> None:
    module = models.build(name).compile(target="numpy")
    assert text in module.doc
    assert does(module.simulate())
