"""Long chains of ball joints: drivers with loops over the tree, Jacobians direction by direction."""

from __future__ import annotations

import numpy as np
import pytest
import rotations

import eomgen as eg


def chain(count: int, closed: bool) -> eg.Model:
    m = eg.Model("beads", gravity=(0, 0, -9.81))
    last = m.ground
    for k in range(count):
        rod = m.body(f"rod{k}", mass=0.5 + 0.1 * k, com=(0.2, 0.01, 0), inertia=(1e-2, 2e-2, 3e-2))
        m.spherical(f"s{k}", last, rod, rotation="euler_parameters")
        last = rod.at(0.4, 0, 0)
    m.output("up", rod.at(0.2, 0, 0).acceleration[2])
    if closed:
        m.spherical("end", last, m.ground.at(0.9, 0.2, 0.1), rotation="euler_parameters")
        m.guess(**{name: x for k in range(count) for name, x in zip(
            (f"s{k}_e0", f"s{k}_e3"), (np.cos(0.3 - 0.2 * k), np.sin(0.3 - 0.2 * k)), strict=True)})  # fmt: skip
    return m


@pytest.mark.slow
@pytest.mark.parametrize(("count", "closed"), [(9, False), (4, True)])
def test_long_chains(count: int, closed: bool) -> None:
    modules = [chain(count, closed).compile(target=target) for target in ("cython", "numpy")]
    assert modules[0].n_v > 24 or closed
    rough = np.random.default_rng(3).uniform(-0.3, 0.3, modules[0].n_x)
    rough[: modules[0].n_q] += modules[0].x0()[: modules[0].n_q]
    x = modules[0].project(rough)
    np.testing.assert_allclose(modules[1].project(rough), x, atol=1e-11)
    results = [(module.rhs(0.0, x), module.jacobian(0.0, x), module.outputs(0.0, x)) for module in modules]
    for one, other in zip(*results, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(one).max())
    module = modules[0]
    q, v = x[: module.n_q], x[module.n_q :]
    np.testing.assert_allclose(
        results[0][0][: module.n_q], rotations.coordinate_rates(module.metadata, q, v), atol=1e-11
    )
    h = 1e-6
    slopes = [(module.rhs(0.0, x + h * e) - module.rhs(0.0, x - h * e)) / (2 * h) for e in np.eye(module.n_x)]
    np.testing.assert_allclose(results[0][1], np.array(slopes).T, atol=1e-6 * np.abs(results[0][1]).max())
    if not closed:
        tree = chain(count, closed).compile(method="lagrange", target="numpy", kernels=["rhs"])
        np.testing.assert_allclose(tree.rhs(0.0, x), results[0][0], atol=1e-8 * np.abs(results[0][0]).max())
