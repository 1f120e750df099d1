"""Weak, redundant and lost rows: the least solution against one in 50 digits, and noise that is left alone."""

from __future__ import annotations

import re

import mpmath as mp
import numpy as np
import pytest

from eomgen.emit.sources import read_template
from eomgen.limits.constraints import GENTLE, TIKHONOV
from eomgen.limits.in_c import definitions
from eomgen.numeric.gram import least


def rows(weak: float, rng: np.random.Generator) -> np.ndarray:
    """Four rows of six with singular values 1, 0.7, 0.3 and a weak one."""
    U, _ = np.linalg.qr(rng.normal(size=(4, 4)))
    V, _ = np.linalg.qr(rng.normal(size=(6, 4)))
    return np.asarray(U * [1.0, 0.7, 0.3, weak] @ V.T)


@pytest.mark.parametrize("weak", [1e-1, 1e-3, 1e-4, 1e-5, 3e-6])
def test_weak_rows_are_kept_to_rounding(weak: float) -> None:
    mp.mp.dps = 50
    rng = np.random.default_rng(4)
    for order in (1, 2):
        J, y, x0 = rows(weak, rng), rng.normal(size=4), rng.normal(size=6)
        A = mp.matrix(J.tolist())
        rest = mp.matrix(y.tolist()) - A * mp.matrix(x0.tolist())
        expected = x0 + np.array([float(z) for z in A.T * mp.lu_solve(A * A.T, rest)])
        error = np.abs(least(J, y, x0, 1.0, order) - expected).max()
        assert error <= 1e-14 / weak ** (1 + order), order
        assert np.abs(J @ least(J, y, x0, 1.0, order) - y).max() <= 4e-15 / weak**order


def test_redundant_rows_change_nothing() -> None:
    rng = np.random.default_rng(5)
    J, x = rows(1e-3, rng), rng.normal(size=6)
    mixed = np.vstack([J, rng.normal(size=(3, 4)) @ J])
    alone, beside = least(J, J @ x, np.zeros(6), 1.0), least(mixed, mixed @ x, np.zeros(6), 1.0)
    np.testing.assert_allclose(beside, alone, atol=1e-10)


def test_noise_along_lost_rows_is_left_alone() -> None:
    """At s = 1e-7 a rest of 1e-14 V is what rounding makes of rates: dividing it by s would move x by 1e-7."""
    rng = np.random.default_rng(6)
    J = rows(1e-7, rng)
    x = rng.normal(size=6)
    U, _, Vt = np.linalg.svd(J)
    noisy = least(J, J @ x + 1e-14 * U[:, 3], x, 1.0)
    assert np.abs((noisy - x) @ Vt[3]) <= 1e-9
    assert np.abs(least(J, J @ x + 1e-6 * U[:, 3], x, 1.0, 2) - x).max() <= 1e-3  # 1e-15 / s^2 = 0.1 tells nothing


def test_terms_are_the_same_in_c() -> None:
    """Templates name the limits, and get their numbers from where NumPy has them."""
    text = read_template("c/drivers/correct.c")
    found = dict(re.findall(r"#define CONSTRAINTS_(GENTLE|TIKHONOV) (\S+)", definitions(text)))
    assert {name: float(value) for name, value in found.items()} == {"GENTLE": GENTLE, "TIKHONOV": TIKHONOV}
