"""Calls of derivatives: jacobian by x, u and p, of inverse dynamics, cells of soil."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from analysed import compiled
from refusals import refuses
from sweeps import TARGETS

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


def arm(turned: float = 0.0) -> eg.Model:
    """A ball joint in Euler parameters and a hinge with a motor; `turned` turns the frame of the first body."""
    m = eg.Model("ball_and_hinge", gravity=(0, 0, -9.81))
    length = m.parameter("l", 0.5)
    m.input("tau", 0.3)
    c, s = np.cos(turned), np.sin(turned)
    inertia = {"xx": 0.02, "yy": 0.03, "zz": 0.015}
    if turned:
        inertia = {"xx": 0.02 * c * c + 0.03 * s * s, "yy": 0.02 * s * s + 0.03 * c * c, "zz": 0.015}
        inertia["xy"] = (0.03 - 0.02) * s * c
    upper = m.body("upper", mass=1.5, com=(0, 0, "-l/2"), inertia=inertia)
    lower = m.body("lower", mass=0.8, com=(0.1, 0, -0.2), inertia={"xx": 0.01, "yy": 0.01, "zz": 0.002})
    frame = {"rpy": (0, 0, -turned)} if turned else {}
    m.spherical("ball", m.ground, upper.marker("top", at=(0, 0, 0), **frame), rotation="euler_parameters")
    hinge = m.revolute("hinge", upper.marker("end", at=(0, 0, -length), **frame), lower, axis="y", coordinate="b")
    m.actuator("motor", joint=hinge, value="tau*cos(b)")
    m.joint_damper("friction", joint=hinge, damping=0.1)
    return m


def state(module: Any, seed: int = 0, columns: tuple[int, ...] = ()) -> tuple[np.ndarray, ...]:
    random = np.random.default_rng(seed)
    q, v, a = (random.uniform(-1, 1, (n, *columns)) for n in (module.n_q, module.n_v, module.n_v))
    return q, v, a


def slope(f: Any, h: float = 1e-3) -> np.ndarray:
    """f'(0) by central differences, extrapolated twice."""
    d = [(f(k * h) - f(-k * h)) / (2 * k * h) for k in (1, 2, 4)]
    first = [(4 * d[0] - d[1]) / 3, (4 * d[1] - d[2]) / 3]
    return np.asarray((16 * first[0] - first[1]) / 15)


@pytest.mark.parametrize("target", TARGETS)
def test_derivatives_are_slopes_of_the_calls(target: str) -> None:
    module = arm().compile(target=target)
    q, v, a = state(module)
    found = module.inverse_dynamics_derivatives(q, v, a)
    assert found.dtau_dq.shape == (4, 5)
    np.testing.assert_allclose(found.dtau_da, module.mass_matrix(q), atol=1e-14)
    for mine, place in zip(found, range(3), strict=True):
        for k, column in enumerate(mine.T):

            def along(e: float, place: int = place, k: int = k) -> np.ndarray:
                moved = [q.copy(), v.copy(), a.copy()]
                moved[place][k] += e
                return np.asarray(module.inverse_dynamics(*moved))

            np.testing.assert_allclose(column, slope(along), atol=1e-9)


@pytest.mark.parametrize("target", TARGETS)
def test_jacobian_differentiates_by_what_is_named(target: str) -> None:
    module = compiled("slider_crank", target)
    x = module.x0()
    np.testing.assert_array_equal(module.jacobian(0.0, x, wrt="x"), module.jacobian(0.0, x))
    np.testing.assert_array_equal(module.jacobian(0.0, x, wrt="u"), module.input_jacobian(0.0, x))
    by_p = module.jacobian(0.0, x, wrt="p")
    np.testing.assert_array_equal(by_p, module.parameter_jacobian(0.0, x))
    assert by_p.shape == (module.n_x, module.n_p)
    out = np.empty((module.n_x, module.n_u))
    assert module.jacobian(0.0, x, out=out, wrt="u") is out
    refuses("EG-SHAPE x q", module.jacobian, 0.0, x, wrt="q")


@pytest.mark.parametrize("name", [pytest.param("puma560", marks=pytest.mark.thorough), "slider_crank"])
def test_states_side_by_side_have_the_bits_of_one_alone(name: str) -> None:
    """Eleven columns: lanes of the processor, and a rest that does not fill them."""
    module = compiled(name, "cython")
    random = np.random.default_rng(5)
    x = module.project(module.x0()[:, None] + 0.1 * random.uniform(-1, 1, (module.n_x, 11)))
    q, v, a = x[: module.n_q], x[module.n_q :], random.uniform(-1, 1, (module.n_v, 11))
    first = module.inverse_dynamics_derivatives(q, v, a)
    for k in range(11):
        for mine, theirs in zip(first, module.inverse_dynamics_derivatives(q[:, k], v[:, k], a[:, k]), strict=True):
            np.testing.assert_array_equal(mine[..., k], theirs)


def strip(cells: int) -> eg.Model:
    """Two wheels, each by itself, on a strip of soil with cells of 3 cm."""
    m = eg.Model("strip", gravity=(0, -9.81, 0))
    for k in (0, 1):
        m.body(f"wheel{k}", mass=100.0, inertia={"zz": 10.0})
        m.planar(f"j{k}", m.ground, f"wheel{k}")
        m.initial(**{f"j{k}_y": 0.49, f"j{k}_x": 0.9 - 0.5 * k, f"j{k}_x_dot": 1.0, f"j{k}_3_dot": -2.2})
    wheels = [{"shape": "circle", "on": f"wheel{k}", "radius": 0.5, "width": 0.3} for k in (0, 1)]
    bed = {"shape": "bed", "on": m.ground, "length": 0.03 * cells, "cells": cells}
    m.contacts("sand", wheels, bed, {"soil": "dry_sand", "dissipation": 1.0})
    return m


@pytest.fixture(scope="module")
def soil() -> tuple[eg.Module, np.ndarray]:
    """The strip and a state in which the wheels stand in ruts."""
    mod = strip(60).compile()
    return mod, mod.simulate((0, 0.11), method="DOP853", rtol=1e-9).x[:, -1]


def test_columns_of_cells_by_differences(soil: Any) -> None:
    """Where differences of both sides agree: elsewhere a law turns, as that of the size of a shear that is 0."""
    mod, x = soil
    J, here, smooth, touched = mod.jacobian(0.0, x), mod.rhs(0.0, x), 0, 0
    for k in range(12, mod.n_x):
        e = np.zeros(len(x))
        e[k] = 1e-7
        ahead, back = ((mod.rhs(0.0, x + s * e) - here) / (s * e[k]) for s in (1.0, -1.0))
        size = np.abs(ahead).max()
        if np.abs(ahead - back).max() > 1e-3 * size:
            continue
        smooth += 1
        touched += np.count_nonzero(ahead[6:12]) > 0
        np.testing.assert_allclose(J[:, k], (ahead + back) / 2.0, atol=2e-5 * size + 1e-6)
    assert smooth > 150
    assert touched > 30
