"""CasADi as a peer for robots: recursions over a Pinocchio model in its symbols -> its C text, after its own cse.

Written as its users would, with what is known to be short: link axes, zeros and ones that fold, articulated bodies, or
composite bodies and L^T D L from the leaves, whichever takes fewer operations.  ``common``: products of velocities from
twists of the links' origins, linear velocities included, as in textbooks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np


@dataclass(frozen=True)
class Text:
    """A function f(x, u) of CasADi."""

    method: str
    function: Any

    @property
    def codes(self) -> list[int]:
        """What its instructions do."""
        return [self.function.instruction_id(k) for k in range(self.function.n_instructions())]

    @property
    def operations(self) -> int:
        """Arithmetic and functions, after cse."""
        return sum(code not in (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST) for code in self.codes)

    def arithmetic(self) -> list[int]:
        """Multiplications and squares, additions with subtractions and doublings, divisions and reciprocals."""
        kinds = (ca.OP_MUL, ca.OP_SQ), (ca.OP_ADD, ca.OP_SUB, ca.OP_TWICE), (ca.OP_DIV, ca.OP_INV)
        return [sum(code in kind for code in self.codes) for kind in kinds]

    @property
    def source(self) -> str:
        """Its C text."""
        generator = ca.CodeGenerator("f", {"with_header": False})
        generator.add(self.function)
        return str(generator.dump())


def _text(method: str, arguments: list[Any], result: Any) -> Text:
    """The result row by row."""
    return Text(method, ca.Function("f", arguments, [ca.densify(ca.vec(result.T))], {"cse": True}))


def write_robot(model: Any, **variant: bool) -> list[Text]:
    """x' = f(x, tau) by each method; q, v as Pinocchio orders them, joint damping included."""
    x, tau = ca.SX.sym("x", model.nq + model.nv), ca.SX.sym("tau", model.nv)
    drag, found = ca.SX(ca.DM(np.asarray(model.damping))), []
    for method, solve in (("articulated bodies", articulated), ("composite bodies", composite)):
        robot = Robot(model, x[: model.nq], x[model.nq :], **variant)
        found.append(_text(method, [x, tau], ca.vertcat(robot.rates(), solve(robot, tau - drag * robot.v))))
    return found


def write_derivatives(model: Any) -> dict[str, Text]:
    """By kernel: ``inverse_dynamics_derivatives`` of [q; v; a], ``jacobian`` by whichever recursion is shorter then."""
    n_q, n = model.nq, model.nv
    z, x, u = ca.SX.sym("z", n_q + 2 * n), ca.SX.sym("x", n_q + n), ca.SX.sym("u", n)
    drag = ca.SX(ca.DM(np.asarray(model.damping)))
    robot = Robot(model, z[:n_q], z[n_q : n_q + n])
    tau = inverse_dynamics(robot, z[n_q + n :]) + drag * robot.v
    ways: list[Text] = []
    for method, solve in (("articulated bodies", articulated), ("composite bodies", composite)):
        robot = Robot(model, x[:n_q], x[n_q:])
        rates = ca.vertcat(robot.rates(), solve(robot, u - drag * robot.v))
        ways.append(_text(method, [x, u], ca.jacobian(rates, x)))
    return {
        "inverse_dynamics_derivatives": _text("Newton-Euler", [z], ca.jacobian(tau, z)),
        "jacobian": min(ways, key=lambda text: text.operations),
    }


def base_inertias(model: Any) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Mass, first moment and tensor about the origin of every link, all that a hinge cannot tell from its parent's
    moved there (Gautier and Khalil 1990)."""
    found = []
    for k in range(1, model.njoints):
        body = model.inertias[k]
        m, c = float(body.mass), np.asarray(body.lever)
        found.append((m, m * c, np.asarray(body.inertia) + m * (c @ c * np.eye(3) - np.outer(c, c))))
    for k in reversed(range(model.njoints - 1)):
        kind = model.joints[k + 1].shortname()
        if kind == "JointModelFreeFlyer":
            continue
        axis = "XYZ".index(kind[-1])
        e, (m, h, J) = np.eye(3)[axis], found[k]
        across = J[(axis + 1) % 3][(axis + 1) % 3]
        part = m, h[axis] * e, across * (np.eye(3) - np.outer(e, e))
        found[k] = tuple(a - b for a, b in zip(found[k], part, strict=True))  # type: ignore[assignment]
        parent = int(model.parents[k + 1]) - 1
        if parent >= 0:
            R, p = model.jointPlacements[k + 1].rotation, np.asarray(model.jointPlacements[k + 1].translation)
            h, J = R @ part[1], R @ part[2] @ R.T
            both, outer = p @ (2 * h + m * p), np.outer(h, p)
            J = J + both * np.eye(3) - (outer + outer.T + m * np.outer(p, p))
            m0, h0, J0 = found[parent]
            found[parent] = m0 + m, h0 + h + m * p, J0 + J
    return found


def _exact(value: float) -> float:
    """Entries of rotations next to 0 and 1 are 0 and 1, so that products with them fold."""
    return float(round(value)) if abs(value - round(value)) < 1e-9 and abs(value) < 2 else float(value)


def _constant(matrix: Any) -> Any:
    return ca.SX(ca.DM(np.vectorize(_exact)(np.asarray(matrix))))


def _turn(axis: int, angle: Any) -> Any:
    s, c = ca.sin(angle), ca.cos(angle)
    rows = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    order = [(k - axis + 2) % 3 for k in range(3)]
    return ca.vertcat(*(ca.horzcat(*(ca.SX(rows[i][j]) for j in order)) for i in order))


def _rotation(e: Any) -> Any:
    """Of the quaternion (x, y, z, w)."""
    x, y, z, w = (e[k] for k in range(4))
    return ca.vertcat(
        ca.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        ca.horzcat(2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        ca.horzcat(2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


class Robot:
    """Placement, twist and inertia of every link, in link axes about the link's origin, twists as (angular, linear)."""

    def __init__(self, model: Any, q: Any, v: Any, common: bool = False, regrouped: bool = False) -> None:
        self.model, self.q, self.v, self.n, self.common = model, q, v, model.nv, common
        self.turn: list[Any] = []  # link axes to parent axes
        self.place: list[Any] = []
        self.columns: list[list[Any]] = []
        self.spin: list[Any] = []  # angular velocity
        self.slide: list[Any] = []  # velocity of the origin, only if common
        self.rate: list[tuple[Any, Any]] = []  # velocity products: acceleration at v' = 0, relative to the parent
        self.gravity = ca.SX(ca.DM(-np.asarray(model.gravity.linear)))
        self.bodies = [self._body(k) for k in range(model.njoints - 1)]
        if regrouped:
            self.bodies = [(ca.SX(m), ca.SX(ca.DM(h)), ca.SX(ca.DM(J))) for m, h, J in base_inertias(model)]
        for k in range(1, model.njoints):
            joint, placement = model.joints[k], model.jointPlacements[k]
            R, p = _constant(placement.rotation), ca.SX(ca.DM(placement.translation))
            at, first = joint.idx_q, joint.idx_v
            parent = model.parents[k] - 1
            above, along = (self.spin[parent], self.slide[parent]) if parent >= 0 else (ca.SX.zeros(3), ca.SX.zeros(3))
            if joint.shortname() == "JointModelFreeFlyer":
                assert parent < 0
                R, p = _rotation(q[at + 3 : at + 7]), q[at : at + 3]
                unit = ca.SX.eye(6)
                columns = [unit[:, c] for c in (3, 4, 5, 0, 1, 2)]
                omega, moved = v[first + 3 : first + 6], v[first : first + 3]
                product = ca.SX.zeros(3), ca.cross(omega, moved)
            else:
                axis = "XYZ".index(joint.shortname()[-1])
                R = ca.mtimes(R, _turn(axis, q[at]))
                columns = [ca.SX.eye(6)[:, axis]]
                down, moved = ca.mtimes(R.T, above), ca.mtimes(R.T, along + ca.cross(above, p))
                own = columns[0][:3] * v[first]
                omega = down + own
                linear = ca.cross(moved, own) if common else ca.mtimes(R.T, ca.cross(above, ca.cross(above, p)))
                product = ca.cross(down, own), linear
            self.turn.append(R)
            self.place.append(p)
            self.columns.append(columns)
            self.spin.append(omega)
            self.slide.append(moved if common else ca.SX.zeros(3))
            self.rate.append(product)

    def rates(self) -> Any:
        """q'."""
        if self.model.nq == self.model.nv:
            return self.v
        x, y, z, w = (self.q[k] for k in range(3, 7))
        a, b, c = (self.v[k] for k in range(3, 6))
        turning = 0.5 * ca.vertcat(
            w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -x * a - y * b - z * c
        )
        return ca.vertcat(ca.mtimes(self.turn[0], self.v[:3]), turning, self.v[6:])

    def parent(self, k: int) -> int:
        """Index of the parent link, -1 for ground."""
        return int(self.model.parents[k + 1]) - 1

    def first(self, k: int) -> int:
        """Index of the link's first velocity."""
        return int(self.model.joints[k + 1].idx_v)

    def inertia(self, k: int) -> tuple[Any, Any, Any]:
        """Mass, first moment, inertia about the origin."""
        return self.bodies[k]

    def _body(self, k: int) -> tuple[Any, Any, Any]:
        body = self.model.inertias[k + 1]
        c = np.asarray(body.lever)
        about = np.asarray(body.inertia) + body.mass * (c @ c * np.eye(3) - np.outer(c, c))
        return ca.SX(body.mass), ca.SX(ca.DM(body.mass * c)), ca.SX(ca.DM(about))

    def moved_to(self, k: int, motion: tuple[Any, Any]) -> tuple[Any, Any]:
        """Acceleration of the parent as the link's origin has it, with the velocity products added."""
        angular, linear = motion
        R = self.turn[k].T
        linear = linear if self.parent(k) < 0 else linear + ca.cross(angular, self.place[k])
        return ca.mtimes(R, angular) + self.rate[k][0], ca.mtimes(R, linear) + self.rate[k][1]

    def load(self, k: int) -> tuple[Any, Any]:
        """Wrench at zero acceleration."""
        _, h, J = self.inertia(k)
        omega, slide = self.spin[k], self.slide[k]
        if self.common:
            turn, push = _times(self.inertia(k), omega, slide)
            return ca.cross(omega, turn) + ca.cross(slide, push), ca.cross(omega, push)
        return ca.cross(omega, ca.mtimes(J, omega)), ca.cross(omega, ca.cross(omega, h))

    def lifted(self, k: int, turn: Any, push: Any) -> tuple[Any, Any]:
        """A wrench on the link, in parent axes about the parent's origin."""
        push = ca.mtimes(self.turn[k], push)
        return ca.mtimes(self.turn[k], turn) + ca.cross(self.place[k], push), push


def inverse_dynamics(robot: Robot, a: Any) -> Any:
    """M a + h by Newton-Euler."""
    links = range(len(robot.turn))
    motions: list[tuple[Any, Any]] = []
    wrenches: list[tuple[Any, Any]] = []
    for k in links:
        above = motions[robot.parent(k)] if robot.parent(k) >= 0 else (ca.SX.zeros(3), robot.gravity)
        angular, linear = robot.moved_to(k, above)
        for c, column in enumerate(robot.columns[k]):
            rate = a[robot.first(k) + c]
            angular, linear = angular + column[:3] * rate, linear + column[3:] * rate
        motions.append((angular, linear))
        wrenches.append(_add(_times(robot.inertia(k), angular, linear), robot.load(k)))
    tau = [ca.SX(0)] * robot.n
    for k in reversed(links):
        for c, column in enumerate(robot.columns[k]):
            tau[robot.first(k) + c] = _dot(column, wrenches[k])
        above = robot.parent(k)
        if above >= 0:
            wrenches[above] = _add(wrenches[above], robot.lifted(k, *wrenches[k]))
    return ca.vertcat(*tau)


def composite(robot: Robot, forces: Any) -> Any:
    """M and h by composite bodies and Newton-Euler, then L^T D L from the leaves."""
    links, n = range(len(robot.turn)), robot.n
    motions: list[tuple[Any, Any]] = []
    wrenches: list[tuple[Any, Any]] = []
    for k in links:
        above = motions[robot.parent(k)] if robot.parent(k) >= 0 else (ca.SX.zeros(3), robot.gravity)
        motions.append(robot.moved_to(k, above))
        wrenches.append(_add(_times(robot.inertia(k), *motions[k]), robot.load(k)))
    right = [forces[i] for i in range(n)]
    bodies = [robot.inertia(k) for k in links]
    M = [[ca.SX(0)] * n for _ in range(n)]
    for k in reversed(links):
        for c, column in enumerate(robot.columns[k]):
            i = robot.first(k) + c
            right[i] = right[i] - _dot(column, wrenches[k])
            wrench = _times(bodies[k], column[:3], column[3:])
            for d, other in enumerate(robot.columns[k][: c + 1]):
                M[i][robot.first(k) + d] = _dot(other, wrench)
            at = k
            while robot.parent(at) >= 0:
                wrench = robot.lifted(at, *wrench)
                at = robot.parent(at)
                for d, other in enumerate(robot.columns[at]):
                    M[i][robot.first(at) + d] = _dot(other, wrench)
        above = robot.parent(k)
        if above >= 0:
            wrenches[above] = _add(wrenches[above], robot.lifted(k, *wrenches[k]))
            bodies[above] = tuple(a + b for a, b in zip(bodies[above], _moved(robot, k, bodies[k]), strict=True))
    return _solve(M, right)


def _moved(robot: Robot, k: int, body: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    m, h, J = body
    R, p = robot.turn[k], robot.place[k]
    h, J = ca.mtimes(R, h), _turned(R, J)
    both = ca.dot(p, 2 * h + m * p)
    outer = ca.mtimes(h, p.T)
    return m, h + m * p, _mirrored(J + both * ca.SX.eye(3) - (outer + outer.T + m * ca.mtimes(p, p.T)))


def _solve(M: list[list[Any]], right: list[Any]) -> Any:
    n = len(right)
    for k in reversed(range(n)):
        inverse = 1 / M[k][k]
        for i in (i for i in range(k) if not M[k][i].is_zero()):
            ratio = M[k][i] * inverse
            for j in (j for j in range(i + 1) if not M[k][j].is_zero()):
                M[i][j] = M[i][j] - ratio * M[k][j]
            right[i] = right[i] - ratio * right[k]
        M[k] = [entry * inverse if i < k else entry for i, entry in enumerate(M[k])]
        right[k] = right[k] * inverse
    for i in range(n):
        for j in range(i):
            right[i] = right[i] - M[i][j] * right[j]
    return ca.vertcat(*right)


def articulated(robot: Robot, forces: Any) -> Any:
    """Featherstone's articulated bodies, a column of the motion subspace at a time."""
    links = range(len(robot.turn))
    eye = ca.SX.eye(3)
    bodies = [(J, ca.skew(h), m * eye) for m, h, J in map(robot.inertia, links)]
    wrenches = [robot.load(k) for k in links]
    released: list[list[tuple[Any, ...]]] = [[] for _ in links]
    for k in reversed(links):
        J, H, m = bodies[k]
        turn, push = wrenches[k]
        for c in reversed(range(len(robot.columns[k]))):
            column, i = robot.columns[k][c], robot.first(k) + c
            at = next(e for e in range(6) if not column[e].is_zero())
            u = (J[:, at], H[at, :].T) if at < 3 else (H[:, at - 3], m[:, at - 3])
            inverse, left = 1 / (u[0][at] if at < 3 else u[1][at - 3]), forces[i] - _dot(column, (turn, push))
            released[k].append((i, column, u, inverse, left))
            scaled = u[0] * inverse, u[1] * inverse
            keep = [ca.SX(ca.DM([e != at for e in side])) for side in ((0, 1, 2), (3, 4, 5))]
            J = _mirrored(J - ca.mtimes(u[0], scaled[0].T)) * ca.mtimes(keep[0], keep[0].T)
            H = (H - ca.mtimes(u[0], scaled[1].T)) * ca.mtimes(keep[0], keep[1].T)
            m = _mirrored(m - ca.mtimes(u[1], scaled[1].T)) * ca.mtimes(keep[1], keep[1].T)
            turn, push = turn + u[0] * (inverse * left), push + u[1] * (inverse * left)
        above = robot.parent(k)
        if above >= 0:
            spin, slide = robot.rate[k]
            turn = turn + ca.mtimes(J, spin) + ca.mtimes(H, slide)
            push = push + ca.mtimes(H.T, spin) + ca.mtimes(m, slide)
            wrenches[above] = _add(wrenches[above], robot.lifted(k, turn, push))
            R, P = robot.turn[k], ca.skew(robot.place[k])
            J, H, m = _turned(R, J), ca.mtimes(ca.mtimes(R, H), R.T), _turned(R, m)
            moved = H + ca.mtimes(P, m)
            J = _mirrored(J + ca.mtimes(P, H.T) - ca.mtimes(moved, P))
            bodies[above] = tuple(a + b for a, b in zip(bodies[above], (J, moved, m), strict=True))
    result = [ca.SX(0)] * robot.n
    motions: list[tuple[Any, Any]] = []
    for k in links:
        above = motions[robot.parent(k)] if robot.parent(k) >= 0 else (ca.SX.zeros(3), robot.gravity)
        motion = robot.moved_to(k, above)
        for i, column, u, inverse, left in reversed(released[k]):
            result[i] = inverse * (left - ca.dot(u[0], motion[0]) - ca.dot(u[1], motion[1]))
            motion = motion[0] + column[:3] * result[i], motion[1] + column[3:] * result[i]
        motions.append(motion)
    return ca.vertcat(*result)


def _times(body: tuple[Any, Any, Any], angular: Any, linear: Any) -> tuple[Any, Any]:
    m, h, J = body
    return ca.mtimes(J, angular) + ca.cross(h, linear), m * linear - ca.cross(h, angular)


def _add(a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    return a[0] + b[0], a[1] + b[1]


def _dot(column: Any, wrench: tuple[Any, Any]) -> Any:
    return ca.dot(column[:3], wrench[0]) + ca.dot(column[3:], wrench[1])


def _turned(R: Any, J: Any) -> Any:
    """R J R^T of a symmetric J: its upper triangle, mirrored."""
    return _mirrored(ca.mtimes(ca.mtimes(R, J), R.T))


def _mirrored(J: Any) -> Any:
    return ca.triu2symm(ca.triu(J))
