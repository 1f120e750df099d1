"""Random mechanisms of every joint type under forces, and the same forces written out again as wrenches in NumPy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import judges
import numpy as np
import rotations
from mechanisms import Random, random_mechanism

from eomgen.api.equations import derive
from eomgen.forces import BodyTorque, Damper, Line, PointForce, Spring
from eomgen.frames import GROUND, Frame, Marker
from eomgen.graph import vectors

ANCHOR, TIP, CORNER = np.array([3.0, 2.0, 0.5]), np.array([0.2, -0.3, 0.4]), np.array([-0.1, 0.2, 0.3])
PUSH, TWIST = np.array([1.0, -2.0, 0.7]), np.array([0.3, 0.4, -0.6])
STIFFNESS, LENGTH, DAMPING = 20.0, 1.0, 1.5


def powered(made: Random) -> Random:
    """With a spring and a damper from ground to the last body, and a force and a torque in body axes."""
    m = made.mechanism
    graph, last = m.graph, len(m.bodies) - 1

    def marker(body: int, at: np.ndarray) -> Marker:
        return Marker(body, Frame(vectors.identity(graph), vectors.vector(graph, at.tolist())), f"m{body}")

    line = Line(marker(GROUND, ANCHOR), marker(last, TIP))
    forces = (
        Spring("s", line, graph.constant(STIFFNESS), graph.constant(LENGTH)),
        Damper("d", line, graph.constant(DAMPING)),
        PointForce("p", marker(0, CORNER), vectors.vector(graph, PUSH.tolist()), "body"),
        BodyTorque("t", marker(last // 2, TIP), vectors.vector(graph, TWIST.tolist()), "body"),
    )
    return replace(made, mechanism=replace(m, forces=forces))


def tree(group: tuple[str, ...], bodies: int, rotation: str, seed: int = 0) -> Random:
    """A random tree that has a joint of each type of a group, some of them turned round."""
    for s in range(seed, seed + 1000):
        made = random_mechanism(s, bodies, reverse=True, forces=False, types=group, rotation=rotation)
        if set(made.kinds) == set(group):
            return powered(made)
    raise AssertionError(group)


def derived(made: Random, method: str) -> Any:
    """Equations of a random mechanism, through the pipeline that models take."""
    return derive(SimpleNamespace(mechanism=lambda: made.mechanism), method)  # type: ignore[arg-type]


def basis(module: Any, q: np.ndarray) -> np.ndarray:
    """N of q' = N v, from outside."""
    return np.array([rotations.coordinate_rates(module.metadata, q, e) for e in np.eye(module.n_v)]).T


def in_velocities(module: Any, q_dot: np.ndarray, N: np.ndarray, v: np.ndarray, M: np.ndarray, h: np.ndarray) -> Any:
    """M q'' + h of rates of the coordinates in terms of v': N^T M N, N^T (h + M N' v)."""
    bent = rotations.coordinate_rates(module.metadata, q_dot, v)  # N' v, linear in the Euler parameters ...
    bent[[name[-3:-1] != "_e" for name in module.q_names]] = 0.0  # ... and zero elsewhere
    return N.T @ M @ N, N.T @ (h + M @ bent)


def gamma(module: Any, x: np.ndarray, q_dot: np.ndarray) -> np.ndarray:
    """C_q' v by differences of the constraint Jacobian."""
    v = x[module.n_q :]

    def rates(columns: np.ndarray) -> np.ndarray:
        return np.einsum("ijk,j->ik", module.constraint_jacobian(columns, rows="all"), v)

    return judges.first(rates, x[: module.n_q], q_dot)


@dataclass
class Judge:
    """What the bodies do at a state, from differences of poses alone, and what the forces then are.

    Attributes
    ----------
    M, h : (n, n), (n,)
        In velocities v: M v' + h = constraint forces, by Newton and Euler and virtual power.
    power : float
        Of all that is neither gravity nor a spring, wrench times twist (W).
    """

    def __init__(self, module: Any, made: Random, x: np.ndarray) -> None:
        q, v = x[: module.n_q], x[module.n_q :]
        N = basis(module, q)
        self.q_dot = N @ v
        self.bodies = bodies = judges.Bodies(module, q, self.q_dot)
        rigid = judges.RigidBodies(made.masses, made.centers, made.inertias, made.gravity)
        M, h = bodies.newton_euler(rigid)
        last = len(made.masses) - 1
        tip, tip_rate, tip_J = bodies.point(last, TIP)
        _, corner_rate, corner_J = bodies.point(0, CORNER)
        reach = tip - ANCHOR
        length = float(np.linalg.norm(reach))
        along = reach / length
        push, twist = bodies.R[0] @ PUSH, bodies.R[last // 2] @ TWIST
        drag = -DAMPING * float(along @ tip_rate) * along
        self.power = float(drag @ tip_rate + push @ corner_rate + twist @ bodies.w[last // 2])
        pull = drag - STIFFNESS * (length - LENGTH) * along
        Q = tip_J.T @ pull + corner_J.T @ push + bodies.J_w[last // 2].T @ twist
        self.M, self.h = in_velocities(module, self.q_dot, N, v, M, h - Q)


def energy_rate(module: Any, q_dot: np.ndarray, x: np.ndarray, a: np.ndarray) -> tuple[float, float]:
    """(T + V)' along a motion by differences of the energies, and the size of its parts."""
    n, v = module.n_q, x[module.n_q :]
    moving = np.concatenate([q_dot, np.zeros(len(v))])
    pushed = np.concatenate([np.zeros(n), a])
    speed = max(float(np.abs(v).max()), 1e-3)
    parts = [
        judges.first(module.energy, x, moving, size=max(1.0, np.abs(q_dot).max())).sum(),
        judges.first(module.energy, x, pushed, size=np.abs(a).max() / speed)[0],
    ]
    return sum(parts), max(map(abs, parts))
