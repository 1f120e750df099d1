"""Single bodies on joints against histories of MSC ADAMS, stored with Project Chrono (data/testing/joints, BSD-3)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from models import reference
from scipy.spatial.transform import Rotation

import eomgen as eg
from eomgen import rotations

KINDS = {"rev": "revolute", "rev_spring": "revolute", "sph": "spherical", "pri": "prismatic", "cyl": "cylindrical"}
END = 2.0


def placed(body: Any, rotation: Rotation, position: Any) -> Any:
    """A marker from a rotation and a position in the body."""
    rpy = rotations.euler_angles_from_matrix("zyx", rotation.as_matrix())[::-1]
    return body.at(*map(float, position), rpy=tuple(map(float, rpy)))


def pendulum(name: str, inertia: list[float]) -> tuple[eg.Model, Any]:
    """A model with one body of 1 kg whose frame is in its centre of mass, and outputs of that."""
    m = eg.Model(name, gravity=(0, 0, -9.80665))
    body = m.body("body", mass=1, inertia=tuple(inertia))
    origin = body.at(0, 0, 0)
    for k, axis in enumerate("xyz"):
        m.output(axis, origin.position[k])
        m.output(f"v{axis}", origin.velocity[k])
        m.output(f"a{axis}", origin.acceleration[k])
    return m, body


def compared(m: eg.Model, rows: list[dict[str, Any]], position: float, velocity: float) -> None:
    """The motion from rest equals the rows, within the given differences."""
    rows = [row for row in rows if row["t"] <= END]
    module = m.compile(target="numpy")
    times = np.array([row["t"] for row in rows])
    trajectory = module.simulate((0, END), t_eval=times, rtol=1e-9, atol=1e-10)
    for name, allowed in (("pos", position), ("vel", velocity)):
        expected = np.array([row[name] for row in rows])
        found = np.stack([trajectory[("" if name == "pos" else "v") + axis] for axis in "xyz"], axis=1)
        assert np.abs(found - expected).max() <= allowed
    R = np.array([module.poses(trajectory.x[: module.n_q, k])[0][:3, :3] for k in range(len(times))])
    theirs = Rotation.from_quat([row["quat"] for row in rows], scalar_first=True).as_matrix()
    assert np.abs(R - theirs).max() <= max(position, 1e-5)


@pytest.mark.parametrize("case", reference("adams_single_body_joints")["cases"])
def test_lower_pairs(case: str) -> None:
    given = reference("adams_single_body_joints")["cases"][case]
    geometry = given["geometry"]
    m, body = pendulum(case, geometry["inertia_cm_frame"])
    ground = Rotation.from_matrix(geometry["ground_joint_frame_columns_xyz"])
    frame = Rotation.from_matrix(geometry["cm_frame0"])
    joint = Rotation.from_matrix(geometry["body_joint_frame0"])
    arm = frame.inv().apply(np.subtract(geometry["body_point0_global"], geometry["cm0"]))
    base, end = placed(m.ground, ground, geometry["ground_point"]), placed(body, frame.inv() * joint, arm)
    m.joint(KINDS[geometry["joint_type"]], "j", base, end)
    if geometry["joint_type"] == "rev_spring":
        m.torsional_spring("k", joint="j", stiffness=200)
        m.torsional_damper("d", joint="j", damping=10)
    check = given["check"]
    compared(m, given["rows"], 2 * check["pos"] + 1e-6, 2 * check["vel"] + 1e-6)


def turn(marker: dict[str, Any]) -> Rotation:
    """Body-fixed 3-1-3 angles in degrees."""
    return Rotation.from_euler("ZXZ", marker["reuler"], degrees=True)


@pytest.mark.parametrize("case", reference("adams_universal_and_distance")["cases"])
def test_universal_joint_and_massless_rod(case: str) -> None:
    """ADAMS's Hooke joint takes marker I on the ground; its own error in these cases is about 1e-3."""
    given = reference("adams_universal_and_distance")["cases"][case]
    markers = given["markers"]
    m, body = pendulum(case, given["inertia"])
    centre = markers["0201"]
    frame, at = turn(centre), np.array(centre["at"])
    end = placed(body, frame.inv() * turn(markers["0202"]), frame.inv().apply(np.array(markers["0202"]["at"]) - at))
    base = placed(m.ground, turn(markers["0102"]), markers["0102"]["at"])
    if case.startswith("Universal"):
        m.universal("u", base, end)
        plane = case != "Universal_Case03"
        compared(m, given["rows"], 5e-4 if plane else 6e-3, 1e-3 if plane else 2e-2)
    else:
        m.free("f", placed(m.ground, frame, at), body, sequence="yzx")
        m.distance("rod", base, end, length=2)
        compared(m, given["rows"], 2e-5, 2e-4)
