"""Identities that every joint type obeys, and the number of its coordinates and degrees of freedom."""

from __future__ import annotations

import numpy as np
import pytest
from joint_numbers import Numbers
from scipy.spatial.transform import Rotation

from eomgen.joints import JOINTS

#: Degrees of freedom a joint allows: Shabana, Computational Dynamics, sec. 3.2 and 7.7; ADAMS for the primitives.
ALLOWED = {
    "revolute": 1,
    "continuous": 1,
    "prismatic": 1,
    "screw": 1,
    "cylindrical": 2,
    "universal": 2,
    "constant_velocity": 2,
    "spherical": 3,
    "planar": 3,
    "translational": 3,
    "curve_slider": 1,
    "surface_slider": 2,
    "point_on_curve": 4,
    "point_on_surface": 5,
    "free": 6,
    "weld": 0,
    "distance": 5,
    "revolute_spherical": 4,
    "inline": 4,
    "inplane": 5,
    "parallel": 4,
    "perpendicular": 5,
    "orientation": 3,
}
MOVING = [name for name, joint in JOINTS.items() if joint.role != "loop"]
CLOSING = [name for name, joint in JOINTS.items() if joint.role != "tree"]
BOTH = [name for name in MOVING if name in CLOSING]


def states(kind: str, count: int = 8) -> list[np.ndarray]:
    """Coordinates where middle Euler angles stay inside their range."""
    random = np.random.default_rng(len(kind))
    return list(random.uniform(-1.4, 1.4, (count, len(JOINTS[kind].coordinates))))


@pytest.mark.parametrize("kind", JOINTS)
def test_degrees_of_freedom(kind: str) -> None:
    joint = Numbers(kind).joint
    assert joint.allows == ALLOWED[kind]
    if joint.role != "loop":
        assert len(joint.coordinates) == ALLOWED[kind]
    else:
        assert joint.coordinates == ()


@pytest.mark.parametrize("kind", MOVING)
def test_subspace_is_the_derivative_of_the_pose(kind: str) -> None:
    joint, h = Numbers(kind), 1e-3
    for q in states(kind):
        R, _ = joint.pose(q)
        assert np.abs(R @ R.T - np.eye(3)).max() < 1e-14
        assert np.linalg.det(R) == pytest.approx(1.0)
        columns = joint.columns(q)
        assert np.linalg.matrix_rank(columns) == len(q)
        for k, e in enumerate(np.eye(len(q))):
            sides = {i: joint.pose(q + i * h * e) for i in (-2, -1, 1, 2)}
            slope = [(8 * (sides[1][j] - sides[-1][j]) - (sides[2][j] - sides[-2][j])) / (12 * h) for j in (0, 1)]
            spin = R.T @ slope[0]
            expected = [spin[2, 1], spin[0, 2], spin[1, 0], *(R.T @ slope[1])]
            assert np.abs(columns[:, k] - expected).max() < 1e-10


@pytest.mark.parametrize("kind", BOTH)
def test_closure_holds_on_the_pose_and_measure_inverts_it(kind: str) -> None:
    joint = Numbers(kind)
    for q in states(kind):
        R, r = joint.pose(q)
        assert np.abs(joint.relative(R, r, "closure")).max(initial=0.0) < 1e-14
        assert np.abs(joint.relative(R, r, "measure") - q).max(initial=0.0) < 1e-13
        assert (joint.relative(R, r, "aligned") > 0).all()


def disturbed(R: np.ndarray, r: np.ndarray, twist: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pose after a small twist in S axes."""
    return R @ Rotation.from_rotvec(twist[:3]).as_matrix(), r + R @ twist[3:]


def closure_jacobian(joint: Numbers, R: np.ndarray, r: np.ndarray, h: float = 1e-4) -> np.ndarray:
    """Derivative of the closure by twists."""
    columns = []
    for e in np.eye(6):
        f = {i: joint.relative(*disturbed(R, r, i * h * e), "closure") for i in (-2, -1, 1, 2)}
        columns.append((8 * (f[1] - f[-1]) - (f[2] - f[-2])) / (12 * h))
    return np.array(columns).T.reshape(-1, 6)


@pytest.mark.parametrize("kind", BOTH)
def test_closure_forbids_exactly_what_the_joint_does_not_allow(kind: str) -> None:
    joint = Numbers(kind)
    for q in states(kind):
        J = closure_jacobian(joint, *joint.pose(q))
        rank = np.linalg.matrix_rank(J, tol=1e-6) if len(J) else 0
        assert rank == len(J) == 6 - ALLOWED[kind]
        assert np.abs(J @ joint.columns(q)).max(initial=0.0) < 1e-9


@pytest.mark.parametrize(
    ("kind", "rotation", "position"),
    [
        ("distance", None, np.array([0.3, -0.5, np.sqrt(1.3**2 - 0.34)])),
        ("revolute_spherical", None, 1.3 * np.array([0.6, -0.8, 0.0])),
        ("inline", None, np.array([0.0, 0.0, 0.4])),
        ("inplane", None, np.array([0.3, 0.2, 0.0])),
        ("parallel", [0, 0, 0.7], np.array([0.3, 0.2, 0.1])),
        ("perpendicular", [np.pi / 2, 0, 0], np.array([0.3, 0.2, 0.1])),
        ("orientation", [0, 0, 0], np.array([0.3, 0.2, 0.1])),
    ],
)
def test_pure_constraints_hold_and_remove(kind: str, rotation: list[float] | None, position: np.ndarray) -> None:
    joint = Numbers(kind)
    R = Rotation.from_rotvec(rotation if rotation is not None else [0.3, -0.5, 0.9]).as_matrix()
    assert np.abs(joint.relative(R, position, "closure")).max() < 1e-15
    J = closure_jacobian(joint, R, position)
    assert np.linalg.matrix_rank(J, tol=1e-6) == len(J) == 6 - ALLOWED[kind]
    assert (joint.relative(R, position, "aligned") > 0).all()


@pytest.mark.parametrize("kind", ["distance", "revolute_spherical"])
def test_gradient_of_a_rod_is_a_unit_vector(kind: str) -> None:
    J = closure_jacobian(Numbers(kind), np.eye(3), 1.3 * np.array([0.6, -0.8, 0.0]))
    assert J[0] == pytest.approx([0, 0, 0, 0.6, -0.8, 0], abs=1e-10)


def test_screw_advances_by_its_pitch() -> None:
    joint = Numbers("screw")
    R, r = joint.pose([6 * np.pi])
    assert r == pytest.approx([0, 0, 3 * 0.7])
    assert np.abs(R - np.eye(3)).max() < 1e-14
    assert joint.relative(R, r, "measure") == pytest.approx([6 * np.pi])  # full turns are counted


@pytest.mark.parametrize("kind", ["revolute", "cylindrical", "planar", "prismatic", "weld", "screw", "parallel"])
def test_flipped_axes_are_told_apart(kind: str) -> None:
    flipped = Rotation.from_rotvec([np.pi, 0, 0]).as_matrix()
    joint = Numbers(kind)
    assert np.abs(joint.relative(flipped, np.zeros(3), "closure")).max() < 1e-15
    assert joint.relative(flipped, np.zeros(3), "aligned").min() < 0


def test_half_turn_about_the_shaft_is_no_constant_velocity_joint() -> None:
    """R_z(pi) satisfies R_10 = R_01 with e0 = 0, e3 = 1."""
    joint = Numbers("constant_velocity")
    turned = np.diag([-1.0, -1.0, 1.0])
    assert np.abs(joint.relative(turned, np.zeros(3), "closure")).max() == 0
    assert joint.relative(turned, np.zeros(3), "aligned").min() < 0


def test_constant_velocity_turns_about_an_axis_across_the_shaft() -> None:
    for q in states("constant_velocity"):
        quaternion = Rotation.from_matrix(Numbers("constant_velocity").pose(q)[0]).as_quat(scalar_first=True)
        a, b = q / 2
        expected = np.array([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b), 0.0])
        assert quaternion * np.sign(quaternion[0]) == pytest.approx(expected, abs=1e-14)
