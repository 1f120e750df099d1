"""A judge from outside for loops: all six coordinates of every body, constraints with multipliers, in NumPy alone.

Rows and their rates for joints as conditions on points and directions fixed in the bodies (Shabana, *Computational
Dynamics*, ch. 6); velocities are those of the centres of mass and the angular velocities, ground axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Joint -> conditions: P points coincide; D directions of the two bodies are perpendicular; L the way between points
#: is perpendicular to a direction of the first body.  Letters name the axes of the markers.
CONDITIONS: dict[str, tuple[str, ...]] = {
    "revolute": ("P", "Dxz", "Dyz"),
    "spherical": ("P",),
    "prismatic": ("Dxz", "Dyz", "Dxy", "Lx", "Ly"),
    "cylindrical": ("Dxz", "Dyz", "Lx", "Ly"),
    "weld": ("P", "Dxz", "Dyz", "Dxy"),
    "planar": ("Dxz", "Dyz", "Lz"),
    "universal": ("P", "Dxy"),
}


@dataclass(frozen=True)
class Body:
    """Mass, centre of mass and central inertia in body axes."""

    mass: float
    com: Array
    inertia: Array


@dataclass(frozen=True)
class Joint:
    """Two bodies (-1: ground) and in each a point and a frame (3, 3), in body axes."""

    kind: str
    bodies: tuple[int, int]
    points: tuple[Array, Array]
    frames: tuple[Array, Array]


@dataclass(frozen=True)
class Verdict:
    """Degrees of freedom, accelerations (n, 6) of centres and angular, largest gap, condition of the rows, and the
    singular values (relative to the largest) at the rank and beyond it."""

    dof: int
    accelerations: Array
    gap: float
    condition: float
    beyond: float


def cross(v: Array) -> Array:
    """The matrix of v x."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


class _Rows:
    """Rows G, their C and gamma (C'' = G a + gamma) at a state."""

    def __init__(self, bodies: list[Body], poses: Array, v: Array, w: Array) -> None:
        self.n = len(bodies)
        self.turns = [*poses[:, :3, :3], np.eye(3)]
        self.centres = [*(p[:3, :3] @ b.com + p[:3, 3] for p, b in zip(poses, bodies, strict=True)), np.zeros(3)]
        self.coms = [*(b.com for b in bodies), np.zeros(3)]
        self.v, self.w = np.vstack([v, np.zeros(3)]), np.vstack([w, np.zeros(3)])
        self.G: list[Array] = []
        self.C: list[float] = []
        self.gamma: list[float] = []

    def row(self, blocks: dict[int, tuple[Array, Array]], C: float, gamma: float) -> None:
        full = np.zeros((self.n + 1, 6))
        for body, (linear, angular) in blocks.items():
            full[body, :3] += linear
            full[body, 3:] += angular
        self.G.append(full[:-1].ravel())
        self.C.append(C)
        self.gamma.append(gamma)

    def point(self, i: int, at: Array) -> tuple[Array, Array, Array, Array]:
        """Arm from the centre of mass, place, velocity, acceleration without those of the body."""
        arm = self.turns[i] @ (at - self.coms[i])
        spin = self.w[i]
        return arm, self.centres[i] + arm, self.v[i] + np.cross(spin, arm), np.cross(spin, np.cross(spin, arm))

    def joint(self, joint: Joint) -> None:
        i, j = joint.bodies
        (s_i, p_i, v_i, g_i), (s_j, p_j, v_j, g_j) = (
            self.point(body, at) for body, at in zip(joint.bodies, joint.points, strict=True)
        )
        axes = [
            dict(zip("xyz", (self.turns[b] @ f).T, strict=True))
            for b, f in zip(joint.bodies, joint.frames, strict=True)
        ]
        w_i, w_j = self.w[i], self.w[j]
        for condition in CONDITIONS[joint.kind]:
            if condition == "P":
                for k, e in enumerate(np.eye(3)):
                    blocks = {i: (-e, -np.cross(s_i, e)), j: (e, np.cross(s_j, e))}
                    self.row(blocks, (p_j - p_i)[k], (g_j - g_i)[k])
            elif condition[0] == "D":
                u, d = axes[0][condition[1]], axes[1][condition[2]]
                n = np.cross(u, d)
                rate = np.cross(np.cross(w_i, u), d) + np.cross(u, np.cross(w_j, d))
                self.row({i: (np.zeros(3), n), j: (np.zeros(3), -n)}, u @ d, rate @ (w_i - w_j))
            else:
                u, d, d_dot = axes[0][condition[1]], p_j - p_i, v_j - v_i
                u_dot = np.cross(w_i, u)
                blocks = {i: (-u, np.cross(u, d) - np.cross(s_i, u)), j: (u, np.cross(s_j, u))}
                gamma = np.cross(w_i, u_dot) @ d + 2 * u_dot @ d_dot + u @ (g_j - g_i)
                self.row(blocks, u @ d, gamma)


def judge(
    bodies: list[Body], joints: list[Joint], gravity: Array, poses: Array, v: Array, w: Array, size: float
) -> Verdict:
    """What the bodies do.

    Parameters
    ----------
    poses : (n, 4, 4) array
        Body frames in ground.
    v, w : (n, 3) arrays
        Of the centres of mass; angular.
    size : float
        Length by which lengths are divided, so that the rank does not depend on units.
    """
    small = [Body(b.mass, b.com / size, b.inertia / size**2) for b in bodies]
    near = np.array(poses)
    near[:, :3, 3] /= size
    rows = _Rows(small, near, v / size, w)
    for joint in joints:
        rows.joint(Joint(joint.kind, joint.bodies, (joint.points[0] / size, joint.points[1] / size), joint.frames))
    n = len(bodies)
    M, Q = np.zeros((6 * n, 6 * n)), np.zeros(6 * n)
    for k, body in enumerate(small):
        inertia = rows.turns[k] @ body.inertia @ rows.turns[k].T
        M[6 * k : 6 * k + 3, 6 * k : 6 * k + 3] = body.mass * np.eye(3)
        M[6 * k + 3 : 6 * k + 6, 6 * k + 3 : 6 * k + 6] = inertia
        Q[6 * k : 6 * k + 3] = body.mass * gravity / size
        Q[6 * k + 3 : 6 * k + 6] = -np.cross(w[k], inertia @ w[k])
    G, gamma = np.array(rows.G), np.array(rows.gamma)
    G, gamma = G / np.linalg.norm(G, axis=1)[:, None], gamma / np.linalg.norm(G, axis=1)
    U, s, Vt = np.linalg.svd(G)
    rank = int((s > 1e-7 * s[0]).sum())
    a = -Vt[:rank].T @ ((U[:, :rank].T @ gamma) / s[:rank])
    N = Vt[rank:].T
    if N.shape[1]:
        a = a + N @ np.linalg.solve(N.T @ M @ N, N.T @ (Q - M @ a))
    a = a.reshape(n, 6) * np.array([size] * 3 + [1.0] * 3)
    beyond = float(s[rank] / s[0]) if rank < len(s) else 0.0
    return Verdict(6 * n - rank, a, float(np.abs(rows.C).max()), float(s[0] / s[rank - 1]), beyond)
