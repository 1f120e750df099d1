"""Random trees once more in Pinocchio, whose joints of several degrees are built of single ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from random_models import PITCH

#: Type of joint -> Pinocchio's joints, one after the other.
STEPS = {
    "revolute": "RZ",
    "continuous": "RZ",
    "screw": "HZ",
    "universal": "RX RY",
    "prismatic": "PZ",
    "cylindrical": "PZ RZ",
    "planar": "PX PY RZ",
    "spherical": "RX RY RZ",
    "free": "PX PY PZ RX RY RZ",
    "weld": "",
}


def pinocchio_model(made: Any, bodies: list[int]) -> tuple[pin.Model, dict[int, int]]:
    """The same tree in Pinocchio, its bodies in the given order (depth first, as it demands), and their frames."""
    model = pin.Model()
    model.gravity.linear = made.gravity
    holders: dict[int, tuple[int, pin.SE3]] = {}
    frames: dict[int, int] = {}
    for k in bodies:
        joint, base = holders[made.parents[k]] if made.parents[k] >= 0 else (0, pin.SE3.Identity())
        at = base * pin.SE3(made.outer[k].rotation, made.outer[k].position)
        for s, step in enumerate(STEPS[made.kinds[k]].split()):
            pitch = (PITCH / (2 * np.pi),) if step == "HZ" else ()
            joint = model.addJoint(joint, getattr(pin, f"JointModel{step}")(*pitch), at, f"j{k}_{s}")
            at = pin.SE3.Identity()
        body = at * pin.SE3(made.inner[k].rotation, made.inner[k].position).inverse()
        model.appendBodyToJoint(joint, pin.Inertia(made.masses[k], made.centers[k], made.inertias[k]), body)
        holders[k] = joint, body
        frames[k] = model.addFrame(pin.Frame(f"b{k}", joint, body, pin.FrameType.OP_FRAME))
    return model, frames
