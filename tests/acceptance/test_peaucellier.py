"""Peaucellier's inversor: Q runs on a straight line, P on a circle.

Source: closed form; rows of tests/reference/linkages_straight_line.json, which depend on r and L^2 - s^2 only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest

GIVEN = models.reference("linkages_straight_line")["peaucellier"]
R = float(GIVEN["r"])
POWER = float(GIVEN["L"]) ** 2 - float(GIVEN["s"]) ** 2


@pytest.mark.parametrize("method", ["embedding", "lagrange"])
def test_Q_stays_on_its_line_over_the_motion(module: Callable[..., Any], method: str) -> None:
    mod = module("peaucellier", method)
    p = dict(zip(mod.p_names, mod.p, strict=True))
    assert p["r"] == R
    assert abs(p["L"] ** 2 - p["s"] ** 2 - POWER) <= 1e-15
    run = mod.simulate()
    assert np.ptp(run["theta"]) > 1.0
    assert np.abs(run["Q_x"] - float(GIVEN["straight_line_x"])).max() <= 1e-10
    expected = POWER / (2 * R) * np.tan(run["theta"] / 2)
    assert np.abs(run["Q_y"] - expected).max() <= 1e-10
    assert np.abs(np.hypot(run["P_x"] - R, run["P_y"]) - R).max() <= 1e-10
    # P and Q lie on one ray from O, inverse to each other
    assert np.abs(run["P_x"] * run["Q_y"] - run["P_y"] * run["Q_x"]).max() <= 1e-10
    assert np.abs(run["P_x"] * run["Q_x"] + run["P_y"] * run["Q_y"] - POWER).max() <= 1e-10
    assert run.residuals.position < 1e-11


def test_points_equal_the_reference(module: Callable[..., Any]) -> None:
    mod = module("peaucellier")
    angles = np.radians([float(key) for key in GIVEN["rows"]])
    q, _, _ = mod.kinematics(angles[None, :])
    poses = mod.poses(q)
    s = dict(zip(mod.p_names, mod.p, strict=True))["s"]
    for body, length, point in (("crank", R, "P"), ("side_qa", s, "Q"), ("side_qb", s, "Q"), ("side_pa", s, "P")):
        pose = poses[mod.body_names.index(body)]
        places = np.einsum("ijk,j->ik", pose[:2], np.array([length, 0, 0, 1]))
        expected = np.array([[float(x) for x in row[point]] for row in GIVEN["rows"].values()]).T
        assert np.abs(places - expected).max() <= 1e-10, body
