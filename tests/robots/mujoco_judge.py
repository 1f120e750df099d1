"""MuJoCo as a judge of MJCF models: what it says of random states, in the coordinates of our model.

MuJoCo turns free and ball joints by quaternions, with the angular velocity in body axes as their rate; ours turn by
Euler angles x-y'-z''.  With v = J v_ours and v' = J v'_ours + J' v_ours its equations become ours.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from robots.pinocchio_judge import State


def rates(angles: np.ndarray) -> np.ndarray:
    """E with omega (body axes) = E angles' for R = Rx Ry Rz; angles may be complex."""
    _, b, c = angles
    return np.array(
        [[np.cos(b) * np.cos(c), np.sin(c), 0], [-np.cos(b) * np.sin(c), np.cos(c), 0], [np.sin(b), 0, 1]],
        dtype=angles.dtype,
    )


def quaternion(angles: np.ndarray) -> np.ndarray:
    """Of R = Rx Ry Rz, scalar part first."""
    q = np.array([1.0, 0, 0, 0])
    for axis, angle in zip(np.eye(3), angles, strict=True):
        turn, result = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, axis, angle)
        mujoco.mju_mulQuat(result, q, turn)
        q = result
    return q


class Judge:
    """A model in MuJoCo, beside ours of the same file."""

    def __init__(self, path: Path, model: Any) -> None:
        mujoco.set_mju_user_warning(lambda text: None)  # no log file in the current folder
        self.mj = mujoco.MjModel.from_xml_path(str(path))
        self.mj.opt.density = self.mj.opt.viscosity = 0.0  # the medium is left out of ours, which a note says
        self.mj.actuator_ctrllimited[:] = 0  # limits are data in ours
        self.mj.actuator_forcelimited[:] = 0
        self.mj.jnt_actfrclimited[:] = 0
        self.data = mujoco.MjData(self.mj)
        self.model = model
        joints, inputs = model.renamed.get("joints", {}), model.renamed.get("inputs", {})
        self.joints: list[tuple[int, list[str]]] = []
        for j in range(self.mj.njnt):
            name = self.mj.joint(j).name or f"joint{j}"
            name = joints.get(name, name)
            suffixes = {0: "xyz123", 1: "123"}.get(int(self.mj.jnt_type[j]), "")
            self.joints.append((j, [f"{name}_{s}" for s in suffixes] or [name]))
        actuators = [self.mj.actuator(k).name or f"actuator{k}" for k in range(self.mj.nu)]
        self.inputs = {inputs.get(name, name): k for k, name in enumerate(actuators)}

    def states(self, names: tuple[str, ...], count: int, seed: int) -> list[State]:
        """Random states, each with values of our inputs."""
        assert sorted(names) == sorted(name for _, group in self.joints for name in group)
        random = np.random.default_rng(seed)
        return [self._state(names, random) for _ in range(count)]

    def _state(self, names: tuple[str, ...], random: np.random.Generator) -> State:
        mj, data = self.mj, self.data
        n = len(names)
        q, v, a = random.uniform(-1, 1, (3, n)) * np.array([[1.0], [3.0], [5.0]])
        J, drift = np.zeros((mj.nv, n)), np.zeros(mj.nv)
        for j, group in self.joints:
            at = [names.index(name) for name in group]
            start, dof = mj.jnt_qposadr[j], mj.jnt_dofadr[j]
            if len(group) == 6:
                data.qpos[start : start + 3] = q[at[:3]]
                J[dof : dof + 3, at[:3]] = np.eye(3)
                start, dof, at = start + 3, dof + 3, at[3:]
            if len(at) == 3:
                angles = q[at]
                data.qpos[start : start + 4] = quaternion(angles)
                J[dof : dof + 3, at] = rates(angles)
                slope = rates(angles + 1e-30j * v[at]).imag / 1e-30
                drift[dof : dof + 3] = slope @ v[at]
            else:
                data.qpos[start] = q[at[0]]
                J[dof, at[0]] = 1.0
        data.qvel[:] = J @ v
        data.ctrl[:] = 0.0
        mujoco.mj_forward(mj, data)
        M = np.zeros((mj.nv, mj.nv))
        for column, unit in zip(M, np.eye(mj.nv), strict=True):  # M is symmetric
            mujoco.mj_mulM(mj, data, column, unit)
        rest = J.T @ data.qfrc_actuator
        h = data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator
        mass, bias = J.T @ M @ J, J.T @ (h + M @ drift)
        poses = {mj.body(k).name or f"body{k}": np.eye(4) for k in range(mj.nbody)}
        for k, pose in enumerate(poses.values()):
            pose[:3, :3], pose[:3, 3] = data.xmat[k].reshape(3, 3), data.xpos[k]
        moving = mj.body_weldid > 0
        com = (mj.body_mass[moving] @ data.xipos[moving]) / mj.body_mass[moving].sum()
        u = {entry.name: float(random.uniform(-1, 1)) for entry in self.model.description.sections["inputs"]}
        for name, value in u.items():
            data.ctrl[self.inputs[name]] = value
        mujoco.mj_forward(mj, data)
        tau = J.T @ data.qfrc_actuator - rest
        forward = np.linalg.solve(J, data.qacc_smooth - drift)
        return State(q, v, a, tau, mass, bias, bias + mass @ a, forward, poses, com, u)
