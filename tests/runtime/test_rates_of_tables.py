"""Tables as inputs beside SciPy's splines, and their rates."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from eomgen import Signal

TIMES, VALUES = [0.0, 0.4, 1.0, 1.7, 2.0], [1.0, -0.5, 0.3, 0.2, 2.0]
INSIDE = np.linspace(0.013, 1.99, 41)  #: none of the times


def test_cubic_tables_and_their_rates_are_those_of_scipy() -> None:
    judge, table = CubicSpline(TIMES, VALUES), Signal(TIMES, VALUES, "cubic")
    first = table.derivative()
    second = first.derivative()
    for order, one in enumerate((table, first, second)):
        np.testing.assert_allclose(one(INSIDE), judge(INSIDE, order), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose([one(t) for t in INSIDE], one(INSIDE), rtol=1e-14, atol=1e-14)
    assert [float(first(t)) for t in (-0.5, 2.5)] == [0.0, 0.0]
    assert [float(table(t)) for t in (-0.5, 2.5)] == [1.0, 2.0]


def test_linear_tables_have_the_slopes_of_their_pieces() -> None:
    table = Signal(TIMES, VALUES)
    slopes = np.diff(VALUES) / np.diff(TIMES)
    np.testing.assert_allclose(table(INSIDE), np.interp(INSIDE, TIMES, VALUES))
    np.testing.assert_allclose(table.derivative()(INSIDE), slopes[np.searchsorted(TIMES, INSIDE) - 1])


@pytest.mark.parametrize("t", [0.0, 0.39, 0.4, 0.999, 1.0, 1.99, 2.0, 3.0])
def test_held_tables_keep_the_last_value(t: float) -> None:
    expected = [value for time, value in zip(TIMES, VALUES, strict=True) if time <= t][-1]
    assert Signal(TIMES, VALUES, "zero-order")(t) == expected
