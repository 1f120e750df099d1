"""Operations of the right-hand sides of robots on equal terms: the same instructions counted for eomgen and CasADi,
with base parameters (regrouped inertia) for both and for neither."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any
from unittest.mock import patch

import numpy as np

from .report import Report, Table
from .robot_calls import ROBOTS, build, load_pinocchio, state

TITLE = "operations of right-hand sides, the same instructions for all"
#: Where eomgen takes regrouped inertia from.
REGROUPING = ("eomgen.mechanics.methods.embedding.regroup", "eomgen.mechanics.methods.recursive.regroup")

#: By how much accelerations of what is counted may differ from Pinocchio's, relative.
AGREED = 1e-9


def of_eomgen(robot: Any, regrouped: bool) -> dict[str, int]:
    """Of the compiled right-hand side: multiplications, additions, divisions, and all else but sines and cosines."""

    def plain(graph: Any, links: Any) -> list[Any]:
        return [link.spatial for link in links]

    if regrouped:
        _, program = build(robot)
    else:
        with patch(REGROUPING[0], plain), patch(REGROUPING[1], plain):
            _, program = build(robot)
    counts = program.counts.values()
    return {
        "multiplications": sum(c.multiplications for c in counts),
        "additions": sum(c.additions for c in counts),
        "divisions": sum(c.divisions for c in counts),
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


def of_casadi(model: Any, regrouped: bool) -> tuple[str, dict[str, int]]:
    """The shorter of two recursions after CasADi's cse, and its operations."""
    import casadi as ca

    from .casadi_recursions import Robot, articulated, composite

    class Regrouped(Robot):
        """With base parameters."""

        def __init__(self, *given: Any) -> None:
            super().__init__(*given)
            self.base = base_inertias(self.model)

        def inertia(self, k: int) -> tuple[Any, Any, Any]:
            m, h, J = self.base[k]
            return ca.SX(m), ca.SX(ca.DM(h)), ca.SX(ca.DM(J))

    names = {
        "multiplications": (ca.OP_MUL, ca.OP_SQ),
        "additions": (ca.OP_ADD, ca.OP_SUB, ca.OP_TWICE),
        "divisions": (ca.OP_DIV, ca.OP_INV),
    }
    best: tuple[str, dict[str, int]] | None = None
    values = [import_module("pinocchio").aba(model, model.createData(), *_damped(model))]
    for method, solve in (("articulated bodies", articulated), ("composite bodies", composite)):
        x, tau = ca.SX.sym("x", model.nq + model.nv), ca.SX.sym("tau", model.nv)
        robot = (Regrouped if regrouped else Robot)(model, x[: model.nq], x[model.nq :])
        forces = tau - ca.SX(ca.DM(np.asarray(model.damping))) * robot.v
        result = ca.densify(ca.vertcat(robot.rates(), solve(robot, forces)))
        f = ca.Function("f", [x, tau], [result], {"cse": True})
        at = np.concatenate([*state(model)[:2]])
        found = np.array(f(at, state(model)[2])).ravel()
        values.append(found[model.nq :])
        ids = [f.instruction_id(k) for k in range(f.n_instructions())]
        counts = {name: sum(i in codes for i in ids) for name, codes in names.items()}
        if best is None or sum(counts.values()) < sum(best[1].values()):
            best = method, counts
    assert best is not None
    gap = max(np.abs(found - values[0]).max() for found in values) / np.abs(values[0]).max()
    if not gap < AGREED:
        raise RuntimeError(f"accelerations differ by {gap:.1e}: other equations are counted")
    return best


def _damped(model: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, v and the torques less damping."""
    q, v, tau = state(model)
    return q, v, tau - np.asarray(model.damping) * v


def run(quick: bool) -> Report:
    """All robots, the second alone if it is to be quick."""
    rows: list[list[Any]] = []
    details: dict[str, Any] = {}
    for robot in ROBOTS[1:2] if quick else ROBOTS:
        model = load_pinocchio(robot)
        for regrouped in (True, False):
            own = of_eomgen(robot, regrouped)
            method, peer = of_casadi(model, regrouped) if find_spec("casadi") else (None, {})
            total, theirs = sum(own.values()), sum(peer.values())
            counts = (*own.values(), total, *(peer.get(name) for name in own), theirs or None)
            rows.append([robot.name, "on" if regrouped else "off", *counts, method, theirs / total or None])
            details[f"{robot.name}, base parameters {rows[-1][1]}"] = {"eomgen": own, "CasADi": peer, "method": method}
    columns = ("robot", "base parameters", "eomgen mul", "add", "div", "sum", "CasADi mul", "add", "div", "sum",
               "CasADi's method", "CasADi over eomgen")  # fmt: skip
    notes = (
        "Multiplications (squares too), additions and subtractions (doublings too), divisions (reciprocals too);",
        "negations, sines, cosines, comparisons and copies are counted for none. Inertias are numbers. CasADi: the",
        "shorter of articulated bodies and composite bodies with L^T D L (casadi_recursions.py), after its cse.",
        "Base parameters: inertia that a joint cannot tell from its parent's is moved there, for both or for neither.",
        "Pinocchio and MuJoCo run loops over joints of any kind, whose instructions no graph shows: compare times.",
    )
    return Report((Table("operations", columns, rows),), (), notes, details)
