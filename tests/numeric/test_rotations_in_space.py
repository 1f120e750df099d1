"""Steps, differences and velocities of Euler parameters against SciPy's rotations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from eomgen.numeric.space import Space

PLAIN = 2  #: coordinates before the ball


def space() -> Space:
    found = Space.of(PLAIN + 3, [(PLAIN, PLAIN)])
    assert found is not None
    return found


def place(turn: Rotation, size: float = 1.0) -> np.ndarray:
    return np.array([0.3, -1.2, *(size * turn.as_quat(scalar_first=True))])


@pytest.mark.parametrize("angle", [1e-9, 0.3, 2.5])
def test_steps_turn_about_body_axes(angle: float) -> None:
    """Moving with an angular velocity for unit time is a turn by its length, from the right."""
    start = Rotation.from_euler("xyz", [0.4, -0.9, 1.3])
    w = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    q, d = place(start, 1.7), np.array([0.1, 0.2, *w])
    moved = space().move(q, d)
    expected = place(start * Rotation.from_rotvec(w), 1.7)
    expected[:PLAIN] += d[:PLAIN]
    sign = np.sign(moved[PLAIN:] @ expected[PLAIN:])
    np.testing.assert_allclose(moved[PLAIN:] * sign, expected[PLAIN:], atol=1e-14)
    np.testing.assert_allclose(moved[:PLAIN], expected[:PLAIN])
    np.testing.assert_allclose(space().difference(moved, q), d, rtol=1e-7, atol=1e-14)


def test_rates_and_velocities_are_derivatives() -> None:
    start, w = Rotation.from_euler("zyx", [0.7, 0.2, -2.0]), np.array([0.5, -0.3, 0.8])
    q, v = place(start), np.array([0.4, -0.6, *w])

    def at(h: float) -> np.ndarray:
        e = (start * Rotation.from_rotvec(h * w)).as_quat(scalar_first=True)
        return e * np.sign(e @ q[PLAIN:])

    h = 1e-3
    slope = (8.0 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12.0 * h)
    np.testing.assert_allclose(space().rates(q, v)[PLAIN:], slope, atol=1e-11)
    stretched = space().rates(q, v) + np.array([0, 0, *(0.7 * q[PLAIN:])])  # a change of length is no turn
    np.testing.assert_allclose(space().velocities(q, stretched), v, atol=1e-14)
    np.testing.assert_allclose(space().stretch(q, stretched)[PLAIN:], 0.7 * q[PLAIN:], atol=1e-14)
