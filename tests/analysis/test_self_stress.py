"""Self-stresses by the cut joints alone are the null space of the balance of all bodies, by its singular values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import judges
import numpy as np
import pytest

from eomgen.analysis.constrained import prepare
from eomgen.analysis.joint_wrenches import GROUND, joint_table, place
from eomgen.analysis.self_stress import bases, element_wrenches, self_stresses


def cross(x: np.ndarray) -> np.ndarray:
    """The matrix of a cross product."""
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


@pytest.mark.parametrize(
    "name", ["slider_crank", "rssr", "spatial_loop", "planetary_gear", "cam_follower", "rolling_disc"]
)
def test_the_null_space_of_the_balance(name: str, compiled: Callable[..., Any]) -> None:
    """Projectors of both agree, and so their numbers of self-stresses do."""
    module = compiled(name)
    states = prepare(module, 0.0, np.array(judges.random_states(module, 4, 3, position=0.05)).T)
    table, geometry, length = joint_table(module), place(states), 0.3
    joints = bases(table, geometry, length)
    elements = element_wrenches(states, table, geometry)
    N = self_stresses(table, geometry, joints, elements, length)
    per = np.array([1.0, 1.0, 1.0, 1.0 / length, 1.0 / length, 1.0 / length])
    for k in range(3):
        columns = []
        for joint, B in enumerate(joints):
            block = np.zeros((len(geometry.origins), 6, B.shape[2]))
            for body, sign in zip(table["ends"][joint], (-1.0, 1.0), strict=True):
                if body != GROUND:
                    lever = cross(geometry.points[joint, :, k] - geometry.origins[body, :, k])
                    moved = np.block([[np.eye(3), np.zeros((3, 3))], [lever, np.eye(3)]])
                    block[body] += sign * per[:, None] * (moved @ (B[k] / per[:, None]))
            columns.append(block.reshape(6 * len(block), B.shape[2]))
        columns += [-(per * element[:, :, k]).reshape(-1, 1) for element in elements]
        A = np.concatenate(columns, axis=1)
        _, sizes, Vt = np.linalg.svd(A)
        rank = int((sizes > 1e-7 * sizes.max(initial=0.0)).sum())
        exact = Vt[rank:].T @ Vt[rank:]
        assert np.linalg.matrix_rank(N[k]) == len(Vt) - rank
        np.testing.assert_allclose(N[k].T @ N[k], exact, atol=1e-8)
