"""Machines of the gallery.

Gears, the shaper and two linkages of the gallery beside closed forms and circles cut by hand.

The half car of the gallery beside its matrices, and the leg beside a published mass matrix and SymPy's muscles.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
import sympy as sp
from sympy.physics.biomechanics import (
    FiberForceLengthActiveDeGroote2016,
    FiberForceLengthPassiveDeGroote2016,
    FiberForceVelocityDeGroote2016,
)

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


@cache
def compiled(name: str) -> tuple[Any, dict[str, float]]:
    mod = eg.load(EXAMPLES / f"{name}.yaml").compile(target="numpy")
    return mod, dict(zip(mod.p_names, mod.p.tolist(), strict=True))


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


def test_a_shaper_returns_quickly() -> None:
    """Norton, Design of Machinery: it turns back where the crank is across the lever, after pi + 2 asin(r/d)."""
    mod, p = compiled("shaper")
    phi = np.arcsin(p["r"] / p["d"])
    q = mod.x0(theta=0.0)[: mod.n_q]
    s, ends = mod.q_names.index("s"), []
    for theta in np.linspace(0.0, -2 * np.pi, 41):
        q, v, _ = mod.kinematics([theta], [-1.0], [0.0], q)
        if abs(np.sin(theta) + np.sin(phi)) > 0.02:
            assert (v[s] > 0) == (np.sin(theta) > -np.sin(phi)), theta
    for theta in (-phi, np.pi + phi):
        q, v, _ = mod.kinematics([theta - 2 * np.pi], [-1.0], [0.0], q)
        assert abs(v[s]) < 1e-12
        ends.append(q[s])
    assert abs(ends[0] - ends[1]) == pytest.approx(2 * p["L"] * p["r"] / p["d"], rel=1e-12)


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


def test_chebyshevs_coupler_is_where_the_table_says() -> None:
    """tests/reference/linkages_straight_line.json, whose crank is 5 where that of the example is 2.5 m."""
    mod, _ = compiled("chebyshev")
    rows = models.reference("linkages_straight_line")["chebyshev"]["rows"]
    q, seen = mod.x0()[: mod.n_q], 0
    for theta, point in sorted((float(key), np.array(row, dtype=float)) for key, row in rows.items()):
        if not 0.7 <= theta <= 1.3:
            continue
        time = np.arccos((1 - theta) / 0.3) / np.pi
        x = mod.simulate(2.0, t_eval=[0.0, time]).x[:, -1]
        q = x[: mod.n_q]
        outputs = dict(zip(mod.y_names, mod.outputs(time, x), strict=True))
        assert q[mod.q_names.index("theta")] == pytest.approx(theta, abs=1e-12)
        assert [outputs["P_x"], outputs["P_y"]] == pytest.approx(0.5 * point, abs=1e-12)
        seen += 1
    assert seen == 5


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
