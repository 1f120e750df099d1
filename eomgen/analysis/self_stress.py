"""Analysis: reactions of a loop with more constraints than it needs -> the smallest ones, and where they are a choice.

Rigid bodies do not tell how a self-stress, a set of reactions that balance each other on every body, is shared out
(J. Garcia de Jalon, M.D. Gutierrez-Lopez, Multibody dynamics with redundant constraints and singular mass matrix,
Multibody System Dynamics 30 (2013), 311-341; M. Wojtyra, Joint reactions in rigid body mechanisms with dependent
constraints, Mechanism and Machine Theory 44 (2009), 2265-2278).  All joints are taken into account, with the
equations that the mechanism's symmetry makes vanish, so that it does not matter where loops were cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import SEEN
from ..base.limits.constraints import BALANCE as RANK
from ..runtime.constrained import ProjectedStates
from .joint_wrenches import GROUND, Geometry, along_free, free_of, shift, transmitted


def bases(table: dict[str, Any], geometry: Geometry, length: float) -> list[Array]:
    """Orthonormal columns (k, 6, r) of the wrenches that each joint can exert at S, moments in units of the length.

    A state in which there are fewer than in others has columns of zeros.
    """
    found = []
    for joint in range(len(table["ends"])):
        reach = [i for i, owner in enumerate(table["reach"]) if owner == joint]
        if reach:
            G = np.moveaxis(geometry.reach[reach], -1, 0) * _per(length)
            _, sizes, Vt = algebra.svd(G, full_matrices=False)
            kept = sizes > RANK * sizes[:, :1]
        else:
            F = np.moveaxis(geometry.free[free_of(table, joint)], -1, 0) / _per(length)
            size = np.sqrt((F**2).sum(axis=2, keepdims=True))
            _, sizes, Vt = algebra.svd(F / np.where(size > 0.0, size, 1.0))
            kept = np.ones(Vt.shape[:2], dtype=bool)
            kept[:, : sizes.shape[1]] = sizes <= RANK
        columns = Vt[:, kept.any(axis=0)] * kept[:, kept.any(axis=0), None]
        found.append(np.swapaxes(columns, 1, 2))
    return found


def _per(length: float) -> Array:
    """Factors that take a wrench to one in units of force."""
    return np.array([1.0, 1.0, 1.0, 1.0 / length, 1.0 / length, 1.0 / length])


def element_wrenches(states: ProjectedStates, table: dict[str, Any], geometry: Geometry) -> Array:
    """What unit multipliers of constraint elements exert on each body, along coordinates of the tree too.

    Returns
    -------
    (n_finite_forces, n_bodies, 6, k) array
    """
    rows = [i for i, joint in enumerate(table["rows"]) if joint == GROUND]
    result = np.array(geometry.rows[rows])
    if not rows:
        return result
    C_q = states.jacobian()[:, rows]
    for e in range(len(rows)):
        passed = transmitted(table, geometry, geometry.rows[rows[e]])
        for _, _, joint, _ in table["tree"]:
            own = free_of(table, joint)
            if not own:
                continue
            forces, _ = along_free(geometry.free[own], passed[joint])
            rest = C_q[:, e, [table["velocities"][i] for i in own]].T - forces
            couple = _driving(geometry.free[own], rest)
            for body, sign in zip(table["ends"][joint], (-1.0, 1.0), strict=True):
                if body != GROUND:
                    result[e, body] += sign * shift(couple, geometry.points[joint], geometry.origins[body])
    return result


def _driving(free: Array, forces: Array) -> Array:
    """The wrench (6, k) at S with these generalized forces (n, k): torques where directions turn."""
    directions = np.moveaxis(free, -1, 0)
    _, unit = along_free(free, (algebra.pinv(directions) @ forces.T[:, :, None])[:, :, 0].T)
    return unit


def remove_self_stress(
    states: ProjectedStates, table: dict[str, Any], geometry: Geometry, reactions: Array, multipliers: Array
) -> tuple[Array, Array]:
    """The smallest reactions, and which components a self-stress changes.

    The measure is the sum of squares of all joint forces and of all moments over the model's length, and of scaled
    multipliers of constraint elements.
    """
    length, scales = states.module.layout.length, states.module.layout.scales
    element_rows = [i for i, joint in enumerate(table["rows"]) if joint == GROUND]
    sizes, per = scales.c[element_rows] / length, _per(length)
    joints = bases(table, geometry, length)
    ends = np.cumsum([0, *(B.shape[2] for B in joints), len(element_rows)])
    elements = element_wrenches(states, table, geometry) / sizes[:, None, None, None]
    N = self_stresses(table, geometry, joints, elements, length)
    scaled = np.moveaxis(reactions * per[:, None], -1, 0)
    forces = [np.einsum("kij,ki->kj", B, scaled[:, j]) for j, B in enumerate(joints)]
    forces.append((multipliers[element_rows] * sizes[:, None]).T)
    stress = np.einsum("kni,kn->ki", N, np.einsum("kni,ki->kn", N, np.concatenate(forces, axis=1)))
    result, flags = np.array(reactions), np.zeros(reactions.shape, dtype=bool)
    for j, B in enumerate(joints):
        part = slice(ends[j], ends[j + 1])
        result[j] -= (np.einsum("kij,kj->ki", B, stress[:, part]) / per).T
        flags[j] = (np.sqrt(((B @ np.swapaxes(N[:, :, part], 1, 2)) ** 2).sum(axis=2)) > SEEN).T
    return result, flags


def self_stresses(
    table: dict[str, Any], geometry: Geometry, joints: Sequence[Array], elements: Array, length: float
) -> Array:
    """Orthonormal rows (k, r, n) of what joints (in their bases) and elements exert in balance; rows of zeros as well.

    Any wrenches of the cut joints and any multipliers are balanced by wrenches of the joints of the tree, of which only
    those along their bases can be exerted: the rest has to vanish.  So the rank is that of a matrix of as many columns
    as cut joints and elements have reactions, not of one of all joints.
    """
    inside = [joint for _, _, joint, _ in table["tree"]]
    cut = [joint for joint in range(len(joints)) if joint not in set(inside)]
    starts = np.cumsum([0, *(joints[joint].shape[2] for joint in cut), len(elements)])
    count, width = geometry.points.shape[-1], int(starts[-1])
    if not width:
        return np.zeros((count, 0, sum(B.shape[2] for B in joints)))
    wide = geometry._replace(  # one column for each state and each of these reactions
        points=np.repeat(geometry.points, width, axis=-1), origins=np.repeat(geometry.origins, width, axis=-1)
    )
    per = _per(length)
    needed = np.zeros((len(geometry.origins), 6, count, width))
    for n, joint in enumerate(cut):
        wrench = np.zeros((6, count, width))
        wrench[..., starts[n] : starts[n + 1]] = np.moveaxis(joints[joint] / per[:, None], 0, 1)
        for body, sign in zip(table["ends"][joint], (-1.0, 1.0), strict=True):
            if body != GROUND:
                moved = shift(wrench.reshape(6, -1), wide.points[joint], wide.origins[body])
                needed[body] -= sign * moved.reshape(wrench.shape)
    needed[..., starts[-2] :] += np.moveaxis(elements, 0, -1)
    passed = transmitted(table, wide, needed.reshape(len(needed), 6, -1)).reshape(-1, 6, count, width)
    found, rest = [], []
    for joint, B in enumerate(joints):
        if joint in cut:
            n = cut.index(joint)
            found.append(np.broadcast_to(np.eye(width)[starts[n] : starts[n + 1]], (count, B.shape[2], width)))
        else:
            scaled = np.moveaxis(passed[joint] * per[:, None, None], 1, 0)
            along = np.swapaxes(B, 1, 2) @ scaled
            found.append(along)
            rest.append(scaled - B @ along)
    found.append(np.broadcast_to(np.eye(width)[starts[-2] :], (count, len(elements), width)))
    own = np.concatenate(found, axis=1)
    Q = algebra.qr(np.concatenate([own, *rest], axis=1))[0]
    n = own.shape[1]
    _, missing, Vt = algebra.svd(algebra.qr(Q[:, n:])[1])
    null = np.ones(Vt.shape[:2], dtype=bool)
    null[:, : missing.shape[1]] = missing <= RANK
    return (Vt * null[:, :, None]) @ np.swapaxes(Q[:, :n], 1, 2)
