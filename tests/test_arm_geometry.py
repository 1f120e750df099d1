"""The arms that are counted stand where the makers' own descriptions put them, with numbers for their distances."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from shipped_robots import PYBULLET

from benchmarks.models import symbolic_arm
from eomgen.graph import evaluate
from eomgen.kinematics import analyse

REFERENCE = Path(__file__).parent / "reference"
#: Distances (m): the Panda's own table, the URDF of an iiwa as Bullet ships it, summed along each axis.
PANDA = {"d1": 0.333, "d3": 0.316, "a4": 0.0825, "d5": 0.384, "a7": 0.088}
IIWA = {"d1": 0.1575 + 0.2025, "d3": 0.2045 + 0.2155, "d5": 0.1845 + 0.2155, "d7": 0.081}


def frames(name: str, distances: dict[str, float], angles: np.ndarray) -> np.ndarray:
    """Poses (n, 4, 4) of the links at joint angles."""
    kinematics = analyse(symbolic_arm(name).mechanism())
    known = {p.name: 1.0 for p in kinematics.mechanism.parameters} | distances
    known |= dict(zip(kinematics.names, angles.tolist(), strict=True))
    result = np.zeros((len(angles), 4, 4))
    for k in range(len(angles)):
        frame = kinematics.poses.link(k)
        entries = [*(x for row in frame.rotation for x in row), *frame.position]
        numbers = np.array(evaluate(entries, known), dtype=float)
        result[k, :3, :3], result[k, :3, 3], result[k, 3, 3] = numbers[:9].reshape(3, 3), numbers[9:], 1.0
    return result


def placement(rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    """The 4 x 4 matrix of a placement."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation, position
    return result


def test_the_panda_stands_as_its_description_says() -> None:
    angles = np.random.default_rng(1).uniform(-2.0, 2.0, 7)
    joints = json.loads((REFERENCE / "panda_arm.json").read_text(encoding="utf-8"))["joints"]
    here, expected = np.eye(4), []
    for joint, angle in zip(joints, angles, strict=True):
        c, s = np.cos(angle), np.sin(angle)
        assert joint["axis"] == "z"
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        here = here @ placement(np.array(joint["rotation"]), np.array(joint["position"])) @ placement(turn, np.zeros(3))
        expected.append(here)
    assert np.abs(frames("panda", PANDA, angles) - np.array(expected)).max() < 1e-14


@pytest.mark.skipif(PYBULLET is None, reason="pybullet is not there for this Python")
def test_the_iiwa_moves_as_its_description_says() -> None:
    """Link frames are a matter of taste; how each link has moved from the straight arm, in ground axes, is not."""
    import pinocchio

    assert PYBULLET is not None
    angles = np.random.default_rng(2).uniform(-2.0, 2.0, 7)
    model = pinocchio.buildModelFromUrdf(str(PYBULLET / "kuka_iiwa" / "model.urdf"))
    data = model.createData()

    def theirs(q: np.ndarray) -> np.ndarray:
        pinocchio.forwardKinematics(model, data, q)
        return np.array([data.oMi[k].homogeneous for k in range(1, 8)])

    straight = np.zeros(7)
    expected = theirs(angles) @ np.linalg.inv(theirs(straight))
    found = frames("iiwa", IIWA, angles) @ np.linalg.inv(frames("iiwa", IIWA, straight))
    assert np.abs(expected[-1, :3, 3]).max() > 0.1
    assert np.abs(found - expected).max() < 1e-10  # the file writes angles with twelve digits
