"""Batches of states through the compiled layer: every column has the bits of a single call, and its own failure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import EvaluationError, UsageError
from eomgen.runtime.late import eager

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def arm() -> Any:
    return eg.load(EXAMPLES / "two_link_manipulator.yaml").compile()


def columns(call: Any, *arrays: np.ndarray, **more: Any) -> np.ndarray:
    """The call for one column after the other."""
    k = arrays[-1].shape[1]
    each = [call(*(np.ascontiguousarray(a[:, j]) for a in arrays), **more) for j in range(k)]
    return np.stack(each, axis=-1)


@pytest.mark.parametrize("k", [1, 2, 3, 4, 7, 8, 9, 16, 33])
def test_columns_have_the_bits_of_single_calls(arm: Any, k: int) -> None:
    rng = np.random.default_rng(k)
    x = rng.uniform(-3.0, 3.0, (4, k))
    u = np.array([0.3, -0.2])
    np.testing.assert_array_equal(arm.rhs(0.0, x, u=u), columns(lambda s: arm.rhs(0.0, s, u=u), x))
    for call, rows in ((arm.mass_matrix, 2), (arm.energy, 4), (arm.poses, 2)):
        np.testing.assert_array_equal(call(x[:rows]), columns(call, x[:rows]))
    for timed in (arm.bias, arm.outputs, arm.jacobian):
        np.testing.assert_array_equal(timed(0.5, x), columns(lambda s, f=timed: f(0.5, s), x))
    q, v, a = x[:2], x[2:], rng.uniform(-3.0, 3.0, (2, k))
    np.testing.assert_array_equal(arm.inverse_dynamics(q, v, a), columns(arm.inverse_dynamics, q, v, a))


def test_times_and_inputs_of_every_column() -> None:
    model = eg.Model("driven")
    model.input("force")
    model.prismatic("s", model.ground, model.body("block", mass=2.0), axis="x")
    model.actuator("drive", "s", "force*sin(3*t)*s")
    module = model.compile()
    rng = np.random.default_rng(1)
    x, t, u = rng.normal(size=(2, 13)), rng.uniform(0.0, 5.0, 13), rng.normal(size=(1, 13))
    expected = np.stack([module.rhs(t[j], x[:, j].copy(), u=u[:, j]) for j in range(13)], axis=1)
    np.testing.assert_array_equal(module.rhs(t, x, u=u), expected)
    np.testing.assert_allclose(expected[1], u[0] * np.sin(3 * t) * x[0] / 2.0, rtol=1e-14)
    np.testing.assert_array_equal(module.rhs(t, x)[1], np.zeros(13))


def test_the_result_of_a_column_does_not_depend_on_its_place(arm: Any) -> None:
    x = np.random.default_rng(2).uniform(-3.0, 3.0, (4, 29))
    full = arm.rhs(0.0, x)
    for places in (slice(None, None, -1), slice(1, None), slice(0, None, 3), [5], [3, 3, 3]):
        np.testing.assert_array_equal(arm.rhs(0.0, x[:, places]), full[:, places])
    wide = np.empty((8, 58))
    wide[::2, ::2] = x
    out = np.full((4, 29), np.nan)
    assert arm.rhs(0.0, wide[::2, ::2], out=out) is out
    np.testing.assert_array_equal(out, full)
    np.testing.assert_array_equal(arm.rhs(0.0, np.asfortranarray(x)), full)
    assert arm.rhs(0.0, x[:, :0]).shape == (4, 0)


def test_a_column_that_fails_is_named_and_leaves_the_others(arm: Any) -> None:
    x = np.random.default_rng(3).uniform(-3.0, 3.0, (4, 11))
    x[2, 6] = np.nan
    with pytest.raises(EvaluationError, match="th2_dot = nan"):
        arm.rhs(0.0, x)
    tolerant = arm.kernels.timed("rhs", nan=True)
    found = tolerant(0.0, x)
    np.testing.assert_array_equal(np.isnan(found).any(axis=0), np.arange(11) == 6)
    fine = np.arange(11) != 6
    np.testing.assert_array_equal(found[:, fine], arm.rhs(0.0, x[:, fine]))
    np.testing.assert_array_equal(tolerant.failure[2], x[:, 6])


def test_the_width_of_lanes_is_an_option(arm: Any) -> None:
    x = np.random.default_rng(4).uniform(-3.0, 3.0, (4, 21))
    expected = arm.rhs(0.0, x)
    for lanes in (0, 2):
        module = eg.load(EXAMPLES / "two_link_manipulator.yaml").compile(lanes=lanes)
        assert eager(module.core).lane_width == max(1, lanes)
        np.testing.assert_array_equal(module.rhs(0.0, x), expected)
    with pytest.raises(UsageError, match="lanes must be None, 0, 2, 4 or 8, not 3"):
        eg.load(EXAMPLES / "two_link_manipulator.yaml").compile(lanes=3)


def test_tables_and_choices_of_every_column() -> None:
    model = eg.Model("bumper")
    points = np.linspace(-0.1, 0.1, 21)
    force = model.table("force", points, 4000 * points + 3e5 * points**3)
    model.prismatic("s", model.ground, model.body("buffer", mass=2.0), axis="x")
    s = model.coordinate("s")
    model.actuator("spring", "s", -force(s))
    model.output("limited", "max(min(abs(s), 0.05), 0.01) + sign(s)*exp(s)")
    module = model.compile()
    x = np.random.default_rng(5).uniform(-0.15, 0.15, (2, 37))
    np.testing.assert_array_equal(module.rhs(0.0, x), columns(lambda y: module.rhs(0.0, y), x))
    np.testing.assert_array_equal(module.outputs(0.0, x), columns(lambda y: module.outputs(0.0, y), x))
    limited = np.clip(np.abs(x[0]), 0.01, 0.05) + np.sign(x[0]) * np.exp(x[0])
    np.testing.assert_allclose(module.outputs(0.0, x)[0], limited, rtol=1e-14)
