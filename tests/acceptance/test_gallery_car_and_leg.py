"""The half car of the gallery beside its matrices, and the leg beside a published mass matrix and SymPy's muscles."""

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
