"""``input_jacobian`` and ``parameter_jacobian`` are derivatives of the complete ``rhs``, its projection included.

Judge: central differences of ``rhs`` at fixed x, by which the state comes to lie off the moved constraints.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import judges
import numpy as np
import pytest
from sweeps import part_of

import eomgen as eg
from eomgen import pipeline

NAMES = ["slider_crank", "powered_slider_crank", "offset_slider_crank", "three_cranks", "rolling_disc", "cam_follower",
         "rssr", "double_pendulum", "quarter_car"]  # fmt: skip

#: In C a tree, a loop, one with redundant rows, rolling and Euler parameters; the others by ``make thorough``.
IN_C = ("double_pendulum", "slider_crank", "three_cranks", "rolling_disc", "rssr")


def differences(f: Callable[[np.ndarray], np.ndarray], values: np.ndarray) -> np.ndarray:
    """Derivative of f (n,) at values (k,), tenth order; (n, k)."""
    columns = []
    for k, value in enumerate(values):
        size = abs(value) or 1.0

        def along(steps: np.ndarray, k: int = k) -> np.ndarray:
            unit = np.eye(len(values))[k]
            return np.stack([f(values + step * unit) for step in steps[0] - values[k]], axis=-1)

        columns.append(judges.first(along, values[[k]], np.array([size]), h=1e-3, size=1.0) / size)
    return np.array(columns).T if len(values) else np.zeros((len(f(values)), 0))


@pytest.mark.parametrize(
    ("name", "target"),
    part_of(
        [(name, target) for name in NAMES for target in ("numpy", "cython")],
        lambda case: case[1] == "numpy" or case[0] in IN_C,
    ),
)
def test_derivatives_of_the_right_hand_side(compiled: Callable[..., Any], name: str, target: str) -> None:
    mod = compiled(name, target)
    start = mod.x0()
    states = [start, mod.project(start + 0.02 * np.random.default_rng(4).uniform(-1, 1, mod.n_x))]
    for x in states:
        for found, values, key in (
            (mod.parameter_jacobian(0.3, x), mod.p, "p"),
            (mod.input_jacobian(0.3, x), mod.u, "u"),
        ):
            assert found.shape == (mod.n_x, len(values))

            def rhs(changed: np.ndarray, x: np.ndarray = x, key: str = key) -> np.ndarray:
                return mod.rhs(0.3, x, **{key: changed})

            expected = differences(rhs, values)
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * np.abs(expected).max(initial=1.0))


def test_parameters_move_the_constraints_and_the_state_with_them(compiled: Callable[..., Any]) -> None:
    """q' is not v where a length changes: the projected velocity does."""
    mod = compiled("slider_crank")
    x = mod.x0()
    by_length = mod.parameter_jacobian(0.0, x)[:, mod.p_names.index("l")]
    assert np.abs(by_length[: mod.n_q]).max() > 1.0
    by_mass = mod.parameter_jacobian(0.0, x)[:, mod.p_names.index("m_s")]
    assert np.abs(by_mass[: mod.n_q]).max() == 0.0


def test_targets_agree(compiled: Callable[..., Any]) -> None:
    for name in ("slider_crank", "rolling_disc", "rssr", "double_pendulum"):
        one, other = compiled(name, "numpy"), compiled(name, "cython")
        x = one.x0()
        motion = (x[: one.n_q], x[one.n_q :], np.linspace(-1.0, 1.0, one.n_v))
        pairs = [(one.parameter_jacobian(0.1, x), other.parameter_jacobian(0.1, x))]
        pairs.append((one.input_jacobian(0.1, x), other.input_jacobian(0.1, x)))
        pairs += [tuple(m.kernels.state("assembly_jacobian")(x, t=0.1) for m in (one, other))]
        pairs += [tuple(m.kernels.motion("output_derivatives")(*motion, t=0.1) for m in (one, other))]
        for a, b in pairs:
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-11 * max(1.0, np.abs(a).max(initial=0.0)))


def test_batches_and_models_without_inputs(compiled: Callable[..., Any]) -> None:
    for target in ("numpy", "cython"):
        mod = compiled("double_pendulum", target)
        x = np.array([[0.1, 0.4], [0.2, -0.3], [1.0, 0.0], [0.0, 2.0]])
        batch = mod.parameter_jacobian(0.0, x)
        assert batch.shape == (4, mod.n_p, 2)
        for k in range(2):
            np.testing.assert_allclose(batch[..., k], mod.parameter_jacobian(0.0, x[:, k].copy()), rtol=1e-12)
        assert mod.input_jacobian(0.0, x).shape == (4, 0, 2)
        with pytest.raises(eg.UsageError):
            mod.input_jacobian(0.0, x[:2])


@pytest.mark.slow
def test_a_large_tree_whose_accelerations_need_no_mass_matrix() -> None:
    m = eg.Model("long_chain", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    l, mass = m.parameter("l", 0.3), m.parameter("mass", 0.4)
    previous = m.ground
    for k in range(48):
        link = m.body(f"link{k}", mass=mass, com=(0, -l / 2, 0), inertia={"zz": mass * l**2 / 12})
        m.revolute(f"q{k}", previous, link)
        previous = link.at(0, -l, 0)
    m.torque("motor", "q0", m.input("tau", 0.5))
    equations = m.derive("recursive")
    assert "parameter_acceleration" in pipeline.build(equations, "numpy", ["parameter_jacobian"]).block_names
    mod = equations.compile(target="numpy")
    x = np.random.default_rng(6).uniform(-0.5, 0.5, mod.n_x)
    expected = differences(lambda p: mod.rhs(0.0, x, p=p), mod.p)
    np.testing.assert_allclose(mod.parameter_jacobian(0.0, x), expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    expected = differences(lambda u: mod.rhs(0.0, x, u=u), mod.u)
    np.testing.assert_allclose(mod.input_jacobian(0.0, x), expected, rtol=0, atol=1e-6 * np.abs(expected).max())
