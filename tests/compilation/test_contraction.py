"""Where a product and a sum are rounded once, and where not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.runtime.late import eager
from eomgen.runtime.pickling import processor_features

#: Whether this processor has fused operations; without them nothing may differ.
FUSES = bool({"FMA3", "ASIMD"} & processor_features())


def double_pendulum(**options: Any) -> Any:
    from pathlib import Path

    return eg.load(Path(__file__).parents[2] / "examples" / "double_pendulum.yaml").compile(**options)


@pytest.fixture(scope="module")
def states() -> np.ndarray:
    return np.random.default_rng(4).uniform(-2, 2, (4, 256))


@pytest.fixture(scope="module")
def plain() -> Any:
    return double_pendulum()


def test_native_contracts(plain: Any, states: np.ndarray) -> None:
    native = double_pendulum(native=True)
    single = np.array([native.rhs(0.0, x) for x in states.T]).T
    expected = np.array([plain.rhs(0.0, x) for x in states.T]).T
    assert ((single != expected).mean() > 0.05) == FUSES
    np.testing.assert_allclose(single, expected, rtol=1e-11, atol=1e-12)


def test_nothing_but_contraction_changes_bits(plain: Any, states: np.ndarray) -> None:
    native = double_pendulum(native=True, extra=["-ffp-contract=off"])
    np.testing.assert_array_equal(native.rhs(0.0, states), plain.rhs(0.0, states))


def test_single_calls_and_batches_do_not_contract(plain: Any, states: np.ndarray) -> None:
    single = np.array([plain.rhs(0.0, x) for x in states.T]).T
    np.testing.assert_array_equal(plain.rhs(0.0, states), single)


def test_ensembles_contract(plain: Any) -> None:
    """With steps of one size, nothing but rounding tells lanes from the plain text of the same method."""
    options = {"rtol": 1e-3, "atol": 1e-3, "max_step": 0.01, "first_step": 0.01, "method": "DOP853"}
    starts = {"theta1": np.linspace(0.1, 1.0, 16)}
    lanes = plain.simulate_many(0.5, starts, **options)
    one = double_pendulum(lanes=0).simulate_many(0.5, starts, **options)
    np.testing.assert_array_equal(lanes.steps, one.steps)
    narrow = eager(plain.core).lane_width < 4 and "FMA3" in processor_features()  # lanes of two fuse nothing on x86-64
    assert (lanes.x != one.x).any() == (FUSES and not narrow)
    np.testing.assert_allclose(lanes.x, one.x, rtol=0, atol=1e-13)
