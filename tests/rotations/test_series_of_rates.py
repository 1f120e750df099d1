"""Rates of rotation vectors near no rotation, where series stand for quotients 0/0, to the last digits (mpmath)."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

from eomgen.rotations.rates import rate_matrix, velocity_matrix

AXIS = np.array([2.0, -1.0, 2.0]) / 3.0


@pytest.mark.parametrize("angle", [1e-8, 0.03, 0.0999, 0.1001, 1.7])
@pytest.mark.parametrize("axes", ["body", "ground"])
def test_rates_of_rotation_vectors(angle: float, axes: str) -> None:
    """I -+ (1 - cos a) / a^2 [v] + (a - sin a) / a^3 [v]^2 and its inverse (Shuster, 1993, eq. 278)."""
    v = angle * AXIS
    with mp.workdps(50):
        a = mp.sqrt(sum(mp.mpf(float(x)) ** 2 for x in v))
        x, y, z = (mp.mpf(float(c)) for c in v)
        tilde = mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        sign = -1 if axes == "body" else 1
        exact = mp.eye(3) + sign * (1 - mp.cos(a)) / a**2 * tilde + (a - mp.sin(a)) / a**3 * (tilde * tilde)
        inverse = exact**-1
        pairs = [
            (velocity_matrix("rotation_vector", v, axes), exact),
            (rate_matrix("rotation_vector", v, axes), inverse),
        ]
        for found, expected in pairs:
            gap = max(abs(mp.mpf(float(found[i, j])) - expected[i, j]) for i in range(3) for j in range(3))
            assert gap <= (4e-16 if angle < 0.1 else 4e-15 / angle)  # quotients lose what cancels in them
