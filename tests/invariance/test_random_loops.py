"""Closed mechanisms and random variants against a reference with multipliers; run_random_loops runs the thousand."""

from __future__ import annotations

import numpy as np
import pytest
from invariance.loop_judge import Body, Joint, judge
from invariance.random_loops import FAMILIES
from invariance.run_random_loops import FIRST, LIMIT, try_one

#: One of each family as it is, and one of each change besides.
NUMBERS = [*range(len(FAMILIES)), *(len(FAMILIES) * k + 2 * k for k in range(1, len(FIRST)))]


@pytest.mark.parametrize("number", NUMBERS)
def test_a_closed_mechanism_and_a_variant(number: int) -> None:
    result = try_one(number)
    assert result.faults == []
    assert max(result.plain, result.variant) <= LIMIT


def test_the_judge_knows_a_compound_pendulum() -> None:
    """theta'' = -m g c cos(theta) / (I + m c^2), and c theta'^2 towards the pivot."""
    mass, c, inertia, theta, rate = 1.3, 0.4, 0.07, 0.3, 2.0
    cos, sin = np.cos(theta), np.sin(theta)
    pose = np.eye(4)
    pose[:2, :2] = [[cos, -sin], [sin, cos]]
    body = Body(mass, np.array([c, 0, 0]), np.diag([0.01, 0.07, inertia]))
    pivot = Joint("revolute", (-1, 0), (np.zeros(3), np.zeros(3)), (np.eye(3), np.eye(3)))
    v, w = rate * c * np.array([[-sin, cos, 0]]), np.array([[0, 0, rate]])
    verdict = judge([body], [pivot, pivot], np.array([0, -9.81, 0]), pose[None], v, w, 0.5)
    alpha = -mass * 9.81 * c * cos / (inertia + mass * c**2)
    expected = [*(c * alpha * np.array([-sin, cos, 0]) - c * rate**2 * np.array([cos, sin, 0])), 0, 0, alpha]
    assert verdict.dof == 1
    np.testing.assert_allclose(verdict.accelerations[0], expected, atol=1e-13)
