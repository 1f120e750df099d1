"""Jacobians of robots that float by Euler parameters (n_q = n_v + 1) against differences of their right-hand sides.

Those of more than 24 velocities have drivers with loops: over the tree's factors, or, by ``recursive``, over columns.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from robots.shipped import mjcf_models, urdf_robots
from robots.state import draw_parameters

import eomgen as eg

CASES = [
    ("anymal", "embedding", 18),
    ("anymal", "recursive", 18),
    ("humanoid", "embedding", 27),
    ("humanoid", "lagrange", 27),
    ("humanoid", "recursive", 27),
    ("talos", "embedding", 38),
    ("talos", "recursive", 38),
]


def load(name: str) -> Any:
    if name == "humanoid":
        path, assets = mjcf_models()[name]
        return eg.load(path, assets=str(assets), rotation="euler_parameters")
    return eg.load(urdf_robots()[name][0], floating=True, rotation="euler_parameters", actuate=True)


def draw_state(module: Any, random: np.random.Generator) -> np.ndarray:
    x = random.uniform(-1, 1, module.n_x)
    for k, name in enumerate(module.q_names):
        if name.endswith("_e0"):
            x[k : k + 4] = draw_parameters(random)
    return x


def slopes(module: Any, x: np.ndarray, u: np.ndarray, h: float = 2e-4) -> np.ndarray:
    """Central differences of fourth order."""

    def two_sided(d: np.ndarray) -> np.ndarray:
        return np.asarray(module.rhs(0.0, x + d, u=u) - module.rhs(0.0, x - d, u=u))

    return np.array([(8 * two_sided(h * e) - two_sided(2 * h * e)) / (12 * h) for e in np.eye(module.n_x)]).T


@pytest.mark.slow
@pytest.mark.parametrize(("name", "method", "n_v"), CASES)
def test_jacobian_is_the_slope_of_rhs(name: str, method: str, n_v: int) -> None:
    equations = load(name).derive(method)
    kernels = ["rhs", "jacobian"]
    compiled = equations.compile(kernels=kernels, optimize=0)
    plain = equations.compile(target="numpy", kernels=kernels)
    assert (compiled.n_q, compiled.n_v) == (n_v + 1, n_v)
    random = np.random.default_rng(n_v)
    for _ in range(3):
        x, u = draw_state(compiled, random), random.uniform(-5, 5, compiled.n_u)
        expected = slopes(compiled, x, u)
        size = np.abs(expected).max(axis=1, keepdims=True) + 1e-6 * np.abs(expected).max()
        for module in (compiled, plain):
            assert (np.abs(module.jacobian(0.0, x, u=u) - expected) <= 1e-7 * size).all()
        x_dot = compiled.rhs(0.0, x, u=u)
        np.testing.assert_allclose(plain.rhs(0.0, x, u=u), x_dot, rtol=0, atol=1e-9 * np.abs(x_dot).max())
