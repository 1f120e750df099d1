"""Judge of joint reactions: Newton's and Euler's equations of every body, from its poses and the description alone."""

from __future__ import annotations

from typing import Any

import judges
import numpy as np
import rotations

from eomgen.graph import evaluate


def numbers(mechanism: Any, expressions: Any) -> np.ndarray:
    """Constants of a description at the declared parameter values."""
    values = {p.name: p.value for p in mechanism.parameters} | {u.name: u.value for u in mechanism.inputs}
    return np.array(evaluate(list(expressions), values), dtype=float)


class Balance:
    """What joints and drives must exert on each body at a state, and the placement of all joints' markers.

    Attributes
    ----------
    needed : (k, 6) force and moment about the body's origin: m a - m g, and the same for the angular momentum
    """

    def __init__(self, module: Any, mechanism: Any, x: np.ndarray, t: float = 0.0) -> None:
        n_q = module.n_q
        self.module, self.mechanism = module, mechanism
        q, v = x[:n_q], x[n_q:]
        a = module.rhs(t, x)[n_q:]
        q_dot = rotations.coordinate_rates(module.metadata, q, v)
        # q' = N v: q'' = N v' + N' v, and N' v is N(q') v, as N is linear in Euler parameters
        bend = rotations.coordinate_rates(module.metadata, q_dot, v) - rotations.coordinate_rates(
            module.metadata, 0 * q_dot, v
        )
        q_ddot = rotations.coordinate_rates(module.metadata, q, a) + bend
        self.bodies = judges.Bodies(module, q, q_dot, t)
        rigid = judges.rigid_bodies(mechanism)
        b = self.bodies
        self.N = np.array([rotations.coordinate_rates(module.metadata, q, e) for e in np.eye(module.n_v)]).T
        w_dot, r_ddot = b.w_dot + b.J_w @ q_ddot, b.r_ddot + b.J_r @ q_ddot
        self.needed = np.zeros((len(rigid.masses), 6))
        for k, mass in enumerate(rigid.masses):
            arm, w = b.R[k] @ rigid.centers[k], b.w[k]
            tensor = b.R[k] @ rigid.inertias[k] @ b.R[k].T
            force = mass * (r_ddot[k] + np.cross(w_dot[k], arm) + np.cross(w, np.cross(w, arm)) - rigid.gravity)
            moment = tensor @ w_dot[k] + np.cross(w, tensor @ w) + np.cross(arm, force)
            self.needed[k] = [*force, *moment]

    def marker(self, marker: Any) -> tuple[np.ndarray, np.ndarray]:
        """Axes and origin of a marker in ground axes."""
        flat = numbers(self.mechanism, [*(x for row in marker.frame.rotation for x in row), *marker.frame.position])
        R, r = flat[:9].reshape(3, 3), flat[9:]
        if marker.body < 0:
            return R, r
        return self.bodies.R[marker.body] @ R, self.bodies.r[marker.body] + self.bodies.R[marker.body] @ r

    def add(self, total: np.ndarray, body: int, point: np.ndarray, wrench: np.ndarray, sign: float = 1.0) -> None:
        """Add a wrench at a point to a body."""
        if body >= 0:
            arm = point - self.bodies.r[body]
            total[body] += sign * np.concatenate([wrench[:3], wrench[3:] + np.cross(arm, wrench[:3])])

    def exerted(self, wrenches: np.ndarray) -> np.ndarray:
        """What joints exert on the bodies, from wrenches (n_joints, 6) on S at S."""
        total = np.zeros_like(self.needed)
        for spec, wrench in zip(self.mechanism.joints, wrenches, strict=True):
            _, point = self.marker(spec.successor)
            self.add(total, spec.successor.body, point, wrench)
            self.add(total, spec.predecessor.body, point, wrench, -1.0)
        return total

    def relative(self, spec: Any) -> np.ndarray:
        """Velocity of S against P at S, and angular velocity, per generalized velocity (6, n_v), ground axes."""
        _, point = self.marker(spec.successor)
        result = np.zeros((6, self.module.n_v))
        for marker, sign in ((spec.successor, 1.0), (spec.predecessor, -1.0)):
            k = marker.body
            if k >= 0:
                turn = self.bodies.J_w[k] @ self.N
                result[:3] += sign * (self.bodies.J_r[k] @ self.N + np.cross(turn.T, point - self.bodies.r[k]).T)
                result[3:] += sign * turn
        return result


def tangent(module: Any, q: np.ndarray, t: float = 0.0) -> np.ndarray:
    """Velocities that the constraints allow, as columns."""
    if not module.n_rows:
        return np.eye(module.n_v)
    scales = module.layout.scales
    J = scales.jacobian(module.constraint_jacobian(q, t=t, rows="all"))
    _, sizes, Vt = np.linalg.svd(J)
    return scales.q[:, None] * Vt[int((sizes > 1e-9 * sizes[0]).sum()) :].T
