"""MuJoCo as a judge of MJCF models, by random states in the coordinates of our model, and of distances of shapes.

MuJoCo turns free and ball joints by quaternions, scalar part first, with the angular velocity in body axes as their
rate.  Our Euler parameters have the same velocities; our Euler angles x-y'-z'' have their own rates: with MuJoCo's
v = J v_ours and v' = J v'_ours + J' v_ours its equations become ours.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from model_files import described
from robot_comparison import State, angle_rates, angle_rates_slope, draw_parameters
from scipy.spatial.transform import Rotation

TURNS = {  # coordinates and velocities of a joint that turns freely
    "euler_angles": (["_1", "_2", "_3"], ["_1_dot", "_2_dot", "_3_dot"]),
    "euler_parameters": (["_e0", "_e1", "_e2", "_e3"], ["_wx", "_wy", "_wz"]),
}
SLIDES = ["_x", "_y", "_z"]


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

    def __init__(self, path: Path, model: Any, rotation: str = "euler_parameters") -> None:
        mujoco.set_mju_user_warning(lambda text: None)  # no log file in the current folder
        self.mj = mujoco.MjModel.from_xml_path(str(path))
        self.mj.opt.density = self.mj.opt.viscosity = 0.0  # the medium is left out of ours, which a note says
        self.data = mujoco.MjData(self.mj)
        self.model = model
        joints, inputs = model.renamed.get("joints", {}), model.renamed.get("inputs", {})
        self.joints: list[tuple[int, list[str], list[str]]] = []  # with our coordinates and velocities
        for j in range(self.mj.njnt):
            name = self.mj.joint(j).name or f"joint{j}"
            name = joints.get(name, name)
            turns, rates = TURNS[rotation]
            coordinates, velocities = {
                0: ([*SLIDES, *turns], [*(f"{s}_dot" for s in SLIDES), *rates]),
                1: (turns, rates),
            }.get(int(self.mj.jnt_type[j]), ([""], ["_dot"]))
            self.joints.append((j, [name + s for s in coordinates], [name + s for s in velocities]))
        actuators = [self.mj.actuator(k).name or f"actuator{k}" for k in range(self.mj.nu)]
        self.inputs = {inputs.get(name, name): k for k, name in enumerate(actuators)}
        self.known = list(described(model).get("inputs", {}))
        for name in self.inputs.keys() - set(self.known):  # those with states of their own, which a note names
            assert any("actuators" in note and name in note for note in model.notes), name
            self.mj.actuator_gainprm[self.inputs[name]] = self.mj.actuator_biasprm[self.inputs[name]] = 0.0

    def states(self, module: Any, count: int, seed: int) -> list[State]:
        """Random states in the order of a module's coordinates and velocities, each with values of our inputs."""
        names, velocities = module.q_names, module.v_names
        assert sorted(names) == sorted(name for _, group, _ in self.joints for name in group)
        assert sorted(velocities) == sorted(name for _, _, group in self.joints for name in group)
        random = np.random.default_rng(seed)
        return [self._state(names, velocities, random) for _ in range(count)]

    def _state(self, names: tuple[str, ...], velocities: tuple[str, ...], random: np.random.Generator) -> State:
        mj, data = self.mj, self.data
        q = random.uniform(-1, 1, len(names))
        v, a = random.uniform(-1, 1, (2, len(velocities))) * np.array([[3.0], [5.0]])
        J, drift = np.zeros((mj.nv, len(v))), np.zeros(mj.nv)
        for j, coordinates, rates in self.joints:
            at, moving = [names.index(n) for n in coordinates], [velocities.index(n) for n in rates]
            start, dof = mj.jnt_qposadr[j], mj.jnt_dofadr[j]
            if len(moving) == 6:
                data.qpos[start : start + 3] = q[at[:3]]
                J[dof : dof + 3, moving[:3]] = np.eye(3)
                start, dof, at, moving = start + 3, dof + 3, at[3:], moving[3:]
            if len(at) == 4:
                q[at] = draw_parameters(random)
                data.qpos[start : start + 4] = q[at] / np.linalg.norm(q[at])
                J[dof : dof + 3, moving] = np.eye(3)
            elif len(at) == 3:
                data.qpos[start : start + 4] = quaternion(q[at])
                J[dof : dof + 3, moving] = angle_rates(q[at])
                drift[dof : dof + 3] = angle_rates_slope(q[at], v[moving]) @ v[moving]
            else:
                data.qpos[start] = q[at[0]]
                J[dof, moving[0]] = 1.0
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
        moving_bodies = mj.body_weldid > 0
        masses = mj.body_mass[moving_bodies]
        com = (masses @ data.xipos[moving_bodies]) / masses.sum()
        u = {name: float(random.uniform(-1, 1)) for name in self.known}
        for name, value in u.items():
            data.ctrl[self.inputs[name]] = value
        mujoco.mj_forward(mj, data)
        tau = J.T @ data.qfrc_actuator - rest
        forward = np.linalg.solve(J, data.qacc_smooth - drift)
        return State(q, v, a, tau, mass, bias, bias + mass @ a, forward, poses, com, u)

    def reference_pose(self, body: str) -> np.ndarray:
        """(4, 4) of a body where the file places it."""
        mujoco.mj_resetData(self.mj, self.data)
        mujoco.mj_kinematics(self.mj, self.data)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = self.data.body(body).xmat.reshape(3, 3), self.data.body(body).xpos
        return pose


# -- distances of shapes -----------------------------------------------------------------------------------------------

EDGE = 0.05  #: part of a cuboid's least length that rounds its edges
ROUNDED = "rounded"  #: a cuboid without the layer of its rounded edges
ALONG_X = Rotation.from_euler("y", np.pi / 2)
SMALL = (0.0, 1e-12, 1e-9, 1e-6, 1e-3)  #: angles by which axes beside axes are turned


class Scene(NamedTuple):
    """Two shapes, the first about the origin: how far apart, both rotations, the centre of the second."""

    gap: float
    turns: tuple[Rotation, Rotation]
    centre: np.ndarray


class Distances:
    """Two shapes: gaps as MuJoCo's convex routines find them; in the plane those of prisms far longer than wide."""

    def __init__(self, kinds: Sequence[str], shapes: Sequence[Mapping[str, Any]], layer: float = 0.0) -> None:
        mujoco.set_mju_user_warning(lambda text: None)
        self.planar, self.layer = kinds[0] in ("circle", "segment", "box"), layer
        bodies = ""
        for kind, shape in zip(kinds, shapes, strict=True):
            x, y, z, w = (ALONG_X if kind == "segment" else Rotation.identity()).as_quat()
            geom, sizes = self._geom(kind, shape)
            numbers = " ".join(repr(float(size)) for size in sizes)
            bodies += f'<body><freejoint/><geom type="{geom}" size="{numbers}" quat="{w} {x} {y} {z}"/></body>'
        option = '<option ccd_tolerance="1e-15" ccd_iterations="500"/>'
        self.mj = mujoco.MjModel.from_xml_string(f"<mujoco>{option}<worldbody>{bodies}</worldbody></mujoco>")
        self.data = mujoco.MjData(self.mj)

    @staticmethod
    def _geom(kind: str, shape: Mapping[str, Any]) -> tuple[str, Sequence[float]]:
        if kind in ("circle", "sphere"):
            return "sphere", [shape["radius"]]
        if kind in ("segment", "capsule"):
            return "capsule", [shape["radius"], 0.5 * shape["length"]]
        if kind == "ellipsoid":
            return "ellipsoid", shape["semi_axes"]
        size = np.array([*shape["size"], 10.0][:3])
        return "box", list(0.5 * size - (EDGE * size.min() if kind == ROUNDED else 0.0))

    def gap(self, turns: Sequence[Rotation], centre: np.ndarray) -> float:
        """Negative where they overlap."""
        for k, (place, turn) in enumerate(zip(([0.0] * 3, centre), turns, strict=True)):
            x, y, z, w = turn.as_quat()
            self.data.qpos[7 * k : 7 * k + 7] = [*place, w, x, y, z]
        mujoco.mj_kinematics(self.mj, self.data)
        return float(mujoco.mj_geomDistance(self.mj, self.data, 0, 1, 10.0, None)) - self.layer

    def scenes(self, gaps: Sequence[float], count: int) -> Iterator[Scene]:
        """Turned at random or axes nearly beside axes, along an axis or beside it; apart by each gap in turn."""
        rng = np.random.default_rng(3)
        axes = np.eye(3)[: 2 if self.planar else 3]
        for k in range(count):
            one, other = (self._turn(rng.uniform(-np.pi, np.pi, 3)) for _ in "ab")
            small = rng.choice(SMALL) * rng.standard_normal(3)
            if k % 2:
                quarter = rng.integers(4) * np.pi / 2 * (np.eye(3)[2] if self.planar else axes[rng.integers(3)])
                other = one * Rotation.from_rotvec(quarter) * self._turn(small)
            way = one.apply(axes[rng.integers(len(axes))] + small if k % 4 > 1 else rng.standard_normal(3))
            way *= (1.0, 1.0, 0.0 if self.planar else 1.0)
            way, reach, wanted = way / np.linalg.norm(way), 0.4, gaps[k % len(gaps)]
            for _ in range(60):
                found = self.gap((one, other), reach * way)
                if abs(found - wanted) < 1e-13:
                    break
                reach -= found - wanted
            if abs(found - wanted) < 1e-11:  # else it leads where the least way out is another
                yield Scene(found, (one, other), reach * way)

    def _turn(self, angles: np.ndarray) -> Rotation:
        return Rotation.from_rotvec([0.0, 0.0, angles[2]] if self.planar else angles)
