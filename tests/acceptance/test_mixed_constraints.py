"""A loop, a gear and rolling without slip in one machine, against multipliers, by every method and target."""

from __future__ import annotations

from typing import Any

import judges
import numpy as np
import pytest
from powered import basis, energy_rate, gamma, in_velocities

import eomgen as eg
from eomgen.equations import METHODS

KERNELS = ["rhs", "mass_matrix", "energy", "poses", "constraints", "constraint_jacobian", "velocity_constraints",
           "project", "embedded_mass_matrix", "scales", "alignment"]  # fmt: skip
WAYS = [(method, target) for method in sorted(METHODS) for target in ("cython", "numpy")]


def shell(rotation: str) -> eg.Model:
    """A ball that rolls on a plane; in it a four-bar whose crank drives a flywheel by a gear."""
    m = eg.Model("shell", gravity=(0.4, -0.3, -9.81))
    ball = m.body("ball", mass=3.0, com=(0.02, 0.01, -0.03), inertia=(0.05, 0.06, 0.07))
    crank = m.body("crank", mass=0.4, com=(0.05, 0, 0), inertia=(1e-4, 4e-4, 5e-4))
    rod = m.body("rod", mass=0.6, com=(0.15, 0.01, 0), inertia=(1e-4, 4e-3, 4e-3))
    rocker = m.body("rocker", mass=0.5, com=(0.12, 0, 0.01), inertia=(1e-4, 3e-3, 3e-3))
    flywheel = m.body("flywheel", mass=0.8, com=(0.01, 0, 0), inertia=(2e-3, 2e-3, 4e-3))
    m.free("f", m.ground, ball, rotation=rotation)
    m.revolute("A", ball.at(-0.1, 0, 0), crank, coordinate="a")
    m.revolute("B", crank.at(0.1, 0, 0), rod)
    m.revolute("D", ball.at(0.2, 0, 0), rocker, coordinate="d")
    m.revolute("C", rod.at(0.3, 0, 0), rocker.at(0.24, 0, 0))
    m.revolute("F", ball.at(0, 0.2, 0.1), flywheel, coordinate="w")
    m.gear("mesh", "a", "w", radii=(0.06, 0.02))
    m.rolling("roll", ball, m.ground, radius=0.5, shape="sphere")
    m.initial(a=0.7, f_z=0.5)
    m.guess(d=1.6, B=-0.2)
    return m


@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
def test_a_loop_a_gear_and_rolling_together(rotation: str) -> None:
    model = shell(rotation)
    report = model.check()
    assert report.degrees_of_freedom == 4  # three of the rolling ball, one of the four-bar with its flywheel
    modules: dict[Any, Any] = {}
    for method, target in WAYS:
        options = {"optimize": 0} if target == "cython" else {}
        modules[method, target] = model.derive(method).compile(target=target, kernels=KERNELS, **options)
    one = modules["embedding", "numpy"]
    n = one.n_q
    assert one.n_dof == 4
    rigid = judges.rigid_bodies(model.mechanism())
    random, start = np.random.default_rng(6), one.x0()
    for _ in range(2):
        rough = start + 0.1 * random.uniform(-1, 1, one.n_x)
        rough[n:] = random.uniform(-2, 2, one.n_v)
        x = one.project(rough)
        assert np.abs(one.constraints(x[:n], rows="all")).max() < 1e-12
        assert np.abs(one.velocity_constraints(x, rows="all")).max() < 1e-11
        q, v = x[:n], x[n:]
        N = basis(one, q)
        q_dot = N @ v
        bodies = judges.Bodies(one, q, q_dot)
        # what rolls does not slip: the ball's lowest point is at rest
        ball = one.body_names.index("ball")
        low = bodies.v[ball] + np.cross(bodies.w[ball], [0, 0, -0.5])
        np.testing.assert_allclose(low, 0.0, atol=1e-10)
        M, h = in_velocities(one, q_dot, N, v, *bodies.newton_euler(rigid))
        C_q = one.constraint_jacobian(q, rows="all")
        a = judges.augmented(M, h, C_q, gamma(one, x, q_dot))
        cond = max(np.linalg.cond(M), np.linalg.cond(one.embedded_mass_matrix(q)))
        for module in modules.values():
            np.testing.assert_allclose(module.project(x), x, rtol=0, atol=1e-11)
            x_dot = module.rhs(0.0, x)
            judges.agree(x_dot[n:], a, 1e-8, cond)
            judges.agree(x_dot[n:], one.rhs(0.0, x)[n:], 1e-11, cond)
            assert module.energy(x)[0] == pytest.approx(0.5 * v @ module.mass_matrix(q) @ v, rel=1e-12)
            change, parts = energy_rate(module, q_dot, x, x_dot[n:])
            assert abs(change) <= 1e-9 * parts  # constraints do no work
