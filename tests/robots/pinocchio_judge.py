"""Pinocchio as a judge of URDF robots: what it says of random states, in the coordinates of our model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin


@dataclass(frozen=True)
class State:
    """One state, and what Pinocchio says of it; damping of joints is added to its numbers."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    tau: np.ndarray
    mass_matrix: np.ndarray
    bias: np.ndarray
    inverse_dynamics: np.ndarray
    acceleration: np.ndarray
    frames: dict[str, np.ndarray]
    com: np.ndarray
    u: dict[str, float]  #: inputs; ``tau`` is what they make


class Judge:
    """A robot in Pinocchio; ``columns`` are its velocities in the order of our coordinates."""

    def __init__(self, path: Path, floating: bool, model: Any) -> None:
        if floating:
            root = pin.JointModelComposite()
            for joint in (pin.JointModelTranslation(), *(getattr(pin, f"JointModelR{axis}")() for axis in "XYZ")):
                root.addJoint(joint)
            self.pin = pin.buildModelFromUrdf(str(path), root)
        else:
            self.pin = pin.buildModelFromUrdf(str(path))
        self.data = self.pin.createData()
        self.model = model
        renamed = model.renamed.get("joints", {})
        self.velocities: dict[str, int] = {}
        for joint, name in list(zip(self.pin.joints, self.pin.names, strict=True))[1:]:
            if name == "root_joint":
                names = [f"base_{k}" for k in ("x", "y", "z", "1", "2", "3")]
            else:
                names = [renamed.get(name, name)]
            assert joint.nv == len(names), name
            self.velocities |= {n: joint.idx_v + k for k, n in enumerate(names)}

    def states(self, names: tuple[str, ...], count: int, seed: int) -> list[State]:
        """Random states; ``names`` are our coordinates in our order."""
        assert sorted(names) == sorted(self.velocities)
        order = [self.velocities[name] for name in names]
        random = np.random.default_rng(seed)
        return [self._state(order, *random.uniform(-1, 1, (4, len(names)))) for _ in range(count)]

    def _state(self, order: list[int], q: np.ndarray, v: np.ndarray, a: np.ndarray, tau: np.ndarray) -> State:
        model, data = self.pin, self.data
        v, a, tau = 3 * v, 5 * a, 10 * tau
        tau = np.where([name in self.actuated for name in self.names_of(order)], tau, 0.0)
        u = {
            f"tau_{name}": x
            for name, x in zip(self.names_of(order), tau.tolist(), strict=True)
            if name in self.actuated
        }
        turned, theirs = np.zeros(model.nv), np.zeros((3, model.nv))
        turned[order] = q
        theirs[:, order] = v, a, tau
        pq = pin.neutral(model)
        for joint in list(model.joints)[1:]:
            if joint.nq == 2 and joint.nv == 1:  # a continuous joint: cosine and sine
                pq[joint.idx_q : joint.idx_q + 2] = np.cos(turned[joint.idx_v]), np.sin(turned[joint.idx_v])
            else:
                pq[joint.idx_q : joint.idx_q + joint.nq] = turned[joint.idx_v : joint.idx_v + joint.nv]
        pv, pa, ptau = theirs
        drag = np.asarray(model.damping) * pv
        M = pin.crba(model, data, pq).copy()
        M = np.triu(M) + np.triu(M, 1).T
        bias = pin.nonLinearEffects(model, data, pq, pv) + drag
        inverse = pin.rnea(model, data, pq, pv, pa) + drag
        forward = pin.aba(model, data, pq, pv, ptau - drag).copy()
        pin.framesForwardKinematics(model, data, pq)
        frames = {
            frame.name: data.oMf[k].homogeneous.copy()
            for k, frame in enumerate(model.frames)
            if frame.type == pin.FrameType.BODY
        }
        com = pin.centerOfMass(model, data, pq).copy()
        return State(q, v, a, tau, M[np.ix_(order, order)], bias[order], inverse[order], forward[order], frames, com, u)

    @property
    def actuated(self) -> set[str]:
        """Our coordinates that have an input."""
        entries = self.model.description.sections["forces"]
        return {entry.values["joint"] for entry in entries if entry.values["type"] == "actuator"}

    def names_of(self, order: list[int]) -> list[str]:
        """Our names of their velocities."""
        back = {k: name for name, k in self.velocities.items()}
        return [back[k] for k in order]


def link_frames(model: Any) -> dict[str, tuple[str | None, np.ndarray]]:
    """Link of the file -> our body (None for ground) and the frame in it (4, 4), read from the description."""
    back = {new: old for old, new in model.renamed.get("bodies", {}).items()}
    found: dict[str, tuple[str | None, np.ndarray]] = {}
    for entry in model.description.sections["bodies"]:
        body = None if entry.name == "ground" else entry.name
        if body is not None:
            found[back.get(body, body)] = body, np.eye(4)
        for name, placed in dict(entry.values.get("markers", {})).items():
            frame = np.eye(4)
            frame[:3, :3] = pin.rpy.rpyToMatrix(*placed.get("rpy", (0.0, 0.0, 0.0)))
            frame[:3, 3] = placed.get("at", (0.0, 0.0, 0.0))
            found[back.get(name, name)] = body, frame
    return found


def centre_of_mass(model: Any, poses: np.ndarray, body_names: tuple[str, ...]) -> np.ndarray:
    """Of all bodies together, from their poses and the numbers in the description."""
    total, moment = 0.0, np.zeros(3)
    for entry in model.description.sections["bodies"]:
        if entry.name == "ground":
            continue
        pose = poses[body_names.index(entry.name)]
        mass = entry.values["mass"]
        total += mass
        moment += mass * (pose[:3, :3] @ np.array(entry.values.get("com", (0, 0, 0))) + pose[:3, 3])
    return moment / total


def difference(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Largest difference, of the largest entry."""
    return float(np.abs(ours - theirs).max(initial=0.0) / max(np.abs(theirs).max(initial=0.0), 1e-12))
