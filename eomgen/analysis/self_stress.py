"""Analysis: reactions of a loop with more constraints than it needs -> the smallest ones, and where they are a choice.

Rigid bodies do not tell how a self-stress, a set of reactions that balance each other on every body, is shared out
(J. Garcia de Jalon, M.D. Gutierrez-Lopez, Multibody dynamics with redundant constraints and singular mass matrix,
Multibody System Dynamics 30 (2013), 311-341; M. Wojtyra, Joint reactions in rigid body mechanisms with dependent
constraints, Mechanism and Machine Theory 44 (2009), 2265-2278).  All joints are taken into account, with the
equations that the mechanism's symmetry makes vanish, so that it does not matter where loops were cut.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..numeric.scales import Array
from .constrained import States
from .reactions import GROUND, RANK, SEEN, Geometry, along_free, free_of, shift, transmitted


def bases(table: dict[str, Any], geometry: Geometry, length: float, state: int) -> list[Array]:
    """Orthonormal bases (6, r) of the wrenches that each joint can exert at S, moments in units of the length."""
    found = []
    for joint in range(len(table["ends"])):
        own = free_of(table, joint)
        reach = [i for i, owner in enumerate(table["reach"]) if owner == joint]
        if reach:
            G = geometry.reach[reach, :, state] * _per(length)
            U, sizes, _ = np.linalg.svd(G.T, full_matrices=False)
            found.append(U[:, sizes > RANK * sizes.max(initial=0.0)])
            continue
        F = geometry.free[own, :, state] / _per(length)
        size = np.sqrt((F**2).sum(axis=1))
        _, sizes, Vt = np.linalg.svd(F / np.where(size > 0.0, size, 1.0)[:, None])
        found.append(Vt[int((sizes > RANK).sum()) :].T)
    return found


def _per(length: float) -> Array:
    """Factors that take a wrench to one in units of force."""
    return np.array([1.0, 1.0, 1.0, 1.0 / length, 1.0 / length, 1.0 / length])


def element_wrenches(states: States, table: dict[str, Any], geometry: Geometry) -> Array:
    """What unit multipliers of constraint elements exert on each body, along coordinates of the tree too.

    Returns
    -------
    (n_e, n_bodies, 6, k) array
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
    _, unit = along_free(free, (np.linalg.pinv(directions) @ forces.T[:, :, None])[:, :, 0].T)
    return unit


def remove_self_stress(
    states: States, table: dict[str, Any], geometry: Geometry, reactions: Array, multipliers: Array
) -> tuple[Array, Array]:
    """The smallest reactions, and which components a self-stress changes.

    The measure is the sum of squares of all joint forces and of all moments over the model's length, and of scaled
    multipliers of constraint elements.
    """
    length, scales = states.module.layout.length, states.module.layout.scales
    elements = element_wrenches(states, table, geometry)
    element_rows = [i for i, joint in enumerate(table["rows"]) if joint == GROUND]
    per, n_b = _per(length), len(geometry.origins)
    result, flags = np.array(reactions), np.zeros(reactions.shape, dtype=bool)
    for s in range(reactions.shape[-1]):
        joints = bases(table, geometry, length, s)
        columns = [_balance(table, geometry, joint, B / per[:, None], s) * per for joint, B in enumerate(joints)]
        sizes = scales.c[element_rows] / length
        columns.append(-elements[..., s] * per / sizes[:, None, None])
        A = np.concatenate([c.reshape(len(c), 6 * n_b) for c in columns]).T
        _, found, Vt = np.linalg.svd(A)
        N = Vt[int((found > RANK * found.max(initial=0.0)).sum()) :].T
        if not N.shape[1]:
            continue
        forces = [B.T @ (reactions[j, :, s] * per) for j, B in enumerate(joints)]
        forces.append(multipliers[element_rows, s] * sizes)
        ends = np.cumsum([0, *(len(f) for f in forces)])
        stress = N @ (N.T @ np.concatenate(forces))
        for j, B in enumerate(joints):
            part = slice(ends[j], ends[j + 1])
            result[j, :, s] -= (B @ stress[part]) / per
            flags[j, :, s] = np.sqrt(((B @ N[part]) ** 2).sum(axis=1)) > SEEN
    return result, flags


def _balance(table: dict[str, Any], geometry: Geometry, joint: int, wrenches: Array, state: int) -> Array:
    """Wrenches (6, r) of a joint on S about S -> on all bodies about their origins, (r, n_bodies, 6)."""
    result = np.zeros((wrenches.shape[1], len(geometry.origins), 6))
    point = np.repeat(geometry.points[joint, :, state, None], wrenches.shape[1], axis=1)
    for body, sign in zip(table["ends"][joint], (-1.0, 1.0), strict=True):
        if body != GROUND:
            origin = np.repeat(geometry.origins[body, :, state, None], wrenches.shape[1], axis=1)
            result[:, body] += sign * shift(wrenches, point, origin).T
    return result
