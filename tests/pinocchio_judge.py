"""Pinocchio as a judge of URDF robots: what it says of random states, in the coordinates of our model.

A base that floats is, in Euler angles, a chain of three slides and three hinges; in Euler parameters it is Pinocchio's
free flyer, whose linear velocity is in body axes where ours is in ground axes: with its v = J v_ours and
v' = J v'_ours + J' v_ours its equations become ours.
"""

from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pinocchio as pin
from model_files import described
from robot_comparison import State, draw_parameters

SUFFIXES = {
    "euler_angles": (["x", "y", "z", "1", "2", "3"], ["x_dot", "y_dot", "z_dot", "1_dot", "2_dot", "3_dot"]),
    "euler_parameters": (["x", "y", "z", "e0", "e1", "e2", "e3"], ["x_dot", "y_dot", "z_dot", "wx", "wy", "wz"]),
}


class Judge:
    """A robot in Pinocchio; ``places`` say where its positions and velocities are of our names."""

    def __init__(self, path: Path, floating: bool, model: Any, rotation: str = "euler_parameters") -> None:
        self.flyer = floating and rotation == "euler_parameters"
        if self.flyer:
            self.pin = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
        elif floating:
            root = pin.JointModelComposite()
            for joint in (pin.JointModelTranslation(), *(getattr(pin, f"JointModelR{axis}")() for axis in "XYZ")):
                root.addJoint(joint)
            self.pin = pin.buildModelFromUrdf(str(path), root)
        else:
            self.pin = pin.buildModelFromUrdf(str(path))
        self.data = self.pin.createData()
        self.model = model
        renamed = model.renamed.get("joints", {})
        self.positions: dict[str, int] = {}  # an angle of a continuous joint: the place of its cosine
        self.velocities: dict[str, int] = {}
        self.continuous: set[str] = set()
        for joint, name in list(zip(self.pin.joints, self.pin.names, strict=True))[1:]:
            ours = renamed.get(name, name)
            coordinates, velocities = [ours], [f"{ours}_dot"]
            if name == "root_joint":
                coordinates, velocities = ([f"base_{s}" for s in part] for part in SUFFIXES[rotation])
            elif joint.nq == 2 and joint.nv == 1:
                self.continuous.add(ours)
            else:
                assert joint.nq == joint.nv == 1, name
            self.positions |= {n: joint.idx_q + k for k, n in enumerate(coordinates)}
            self.velocities |= {n: joint.idx_v + k for k, n in enumerate(velocities)}
        assert sum(n.startswith("base_") for n in self.velocities) >= 6 * floating

    def states(self, module: Any, count: int, seed: int) -> list[State]:
        """Random states in the order of a module's coordinates and velocities."""
        names, velocities = module.q_names, module.v_names
        assert sorted(names) == sorted(self.positions)
        assert sorted(velocities) == sorted(self.velocities)
        random = np.random.default_rng(seed)
        return [self._state(names, velocities, random) for _ in range(count)]

    def _state(self, names: tuple[str, ...], velocities: tuple[str, ...], random: np.random.Generator) -> State:
        q = random.uniform(-1, 1, len(names))
        if self.flyer:
            q[[names.index(f"base_e{k}") for k in range(4)]] = draw_parameters(random)
        v, a, tau = random.uniform(-1, 1, (3, len(velocities))) * np.array([[3.0], [5.0], [10.0]])
        driven = {f"{name}_dot": name for name in self.actuated}
        tau = np.where([name in driven for name in velocities], tau, 0.0)
        return self.at(names, velocities, q, v, a, tau)

    def at(
        self,
        names: tuple[str, ...],
        velocities: tuple[str, ...],
        q: np.ndarray,
        v: np.ndarray,
        a: np.ndarray,
        tau: np.ndarray,
    ) -> State:
        """What Pinocchio says of one state given in our names; ``tau`` (n_v,) in their order."""
        model, data = self.pin, self.data
        driven = {f"{name}_dot": name for name in self.actuated}
        u = {f"tau_{driven[n]}": float(x) for n, x in zip(velocities, tau, strict=True) if n in driven}
        theirs = self.position(names, q)
        order = [self.velocities[name] for name in velocities]
        J, drift = np.zeros((model.nv, len(v))), np.zeros(model.nv)
        J[order, range(len(v))] = 1.0
        if self.flyer:
            turned = pin.XYZQUATToSE3(theirs[:7]).rotation.T
            linear, omega = J[:3] @ v, J[3:6] @ v
            J[:3] = turned @ J[:3]
            drift[:3] = -np.cross(omega, turned @ linear)
        pv, pa, ptau = J @ v, J @ a + drift, np.linalg.solve(J.T, tau)
        drag = np.asarray(model.damping) * pv
        M = pin.crba(model, data, theirs).copy()
        M = np.triu(M) + np.triu(M, 1).T
        bias = pin.nonLinearEffects(model, data, theirs, pv) + drag
        inverse = pin.rnea(model, data, theirs, pv, pa) + drag
        forward = pin.aba(model, data, theirs, pv, ptau - drag).copy()
        pin.framesForwardKinematics(model, data, theirs)
        frames = {
            frame.name: data.oMf[k].homogeneous.copy()
            for k, frame in enumerate(model.frames)
            if frame.type == pin.FrameType.BODY
        }
        return State(
            q=q,
            v=v,
            a=a,
            tau=tau,
            mass_matrix=J.T @ M @ J,
            bias=J.T @ (bias + M @ drift),
            inverse_dynamics=J.T @ inverse,
            acceleration=np.linalg.solve(J, forward - drift),
            frames=frames,
            com=pin.centerOfMass(model, data, theirs).copy(),
            u=u,
        )

    def position(self, names: tuple[str, ...], q: np.ndarray) -> np.ndarray:
        """Pinocchio's q: a continuous joint as cosine and sine, Euler parameters of length one, scalar part last."""
        theirs = pin.neutral(self.pin)
        for name, x in zip(names, q, strict=True):
            place = self.positions[name]
            if name in self.continuous:
                theirs[place : place + 2] = np.cos(x), np.sin(x)
            else:
                theirs[place] = x
        if self.flyer:
            e = theirs[3:7] / np.linalg.norm(theirs[3:7])
            theirs[3:7] = *e[1:], e[0]
        return theirs

    def call_time(self) -> float:
        """Nanoseconds of one call of Pinocchio's forward dynamics from Python, the best of several rounds."""
        model, data = self.pin, self.data
        q, v = pin.neutral(model), np.full(model.nv, 0.1)
        tau = np.zeros(model.nv)
        rounds = []
        for _ in range(7):
            start = perf_counter()
            for _ in range(300):
                pin.aba(model, data, q, v, tau)
            rounds.append((perf_counter() - start) / 300)
        return 1e9 * min(rounds)

    @cached_property
    def actuated(self) -> set[str]:
        """Our coordinates that have an input."""
        forces = described(self.model).get("forces", {})
        return {entry["joint"] for entry in forces.values() if entry["type"] == "actuator"}
