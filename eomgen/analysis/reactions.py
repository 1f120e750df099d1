"""States -> the wrenches that joints transmit, and which of them rigid bodies leave undetermined.

What every body needs (Newton, Euler) less what the constraint equations exert on it is summed from the tips of the
tree to ground (Featherstone, RBDA, sec. 5.3); what does work along a joint's free directions belongs to drives, not to
its reaction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.constraints import BALANCE as RANK
from ..base.limits.constraints import UNMOVED
from ..errors import cannot
from ..runtime.constrained import ProjectedStates, evaluate, multipliers, solve_multipliers
from .limits import SEEN

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

# -- joint wrenches ----------------------------------------------------------------------------------------------------


GROUND = -1


class Geometry(NamedTuple):
    """Placement of joints and bodies for k states; the last axis counts states."""

    rows: Array  #: (n_c, n_bodies, 6, k) D: the wrench -l D on each body, about its origin
    points: Array  #: (n_joints, 3, k) S of each joint
    free: Array  #: (n_f, 6, k) free directions (linear, angular) at S
    reach: Array  #: (n_r, 6, k) gradients of the equations of joints without coordinates, at S
    loops: Array  #: (n_loop_coordinates, 6, k) gradients of the coordinates of cut joints, at S
    origins: Array  #: (n_bodies, 3, k)


def joint_table(module: BoundModel) -> Mapping[str, Any]:
    """What the model's metadata says of its joints."""
    table = module.info.wrenches
    if table is None:
        raise cannot(
            f"model {module.name!r} has no joints between bodies, so there are no reactions; "
            "multipliers(t, x) gives the forces of its constraint equations"
        )
    return table


def place(states: ProjectedStates) -> Geometry:
    """Evaluate the geometry."""
    module, table = states.module, joint_table(states.module)
    k, n_c, n_b = len(states.t), module.n_rows, module.n_bodies
    flat = states.evaluate(module.kernels.wrench_geometry, states.q)
    sizes = (
        6 * n_c * n_b,
        3 * len(table["ends"]),
        6 * len(table["columns"]),
        6 * len(table["reach"]),
        6 * len(table["loops"]),
    )
    ends = np.cumsum(sizes)
    rows, points, free, reach, loops = np.split(flat, ends[:-1])
    poses = states.evaluate(module.poses, states.q)
    return Geometry(
        rows.reshape(n_c, n_b, 6, k),
        points.reshape(-1, 3, k),
        free.reshape(-1, 6, k),
        reach.reshape(-1, 6, k),
        loops.reshape(-1, 6, k),
        poses[:, :3, 3],
    )


def shift(wrench: Array, start: Array, end: Array) -> Array:
    """Wrenches (6, k) about ``start`` (3, k), about ``end`` instead."""
    moved = np.array(wrench)
    moved[3:] += np.cross(start - end, wrench[:3], axis=0)
    return moved


def transmitted(table: Mapping[str, Any], geometry: Geometry, needed: Array) -> Array:
    """What passes through the joints of the tree when each body gets what it needs (n_bodies, 6, k).

    Returns
    -------
    (n_joints, 6, k) array
        On S about S; zero for cut joints.
    """
    total = np.array(needed)
    result = np.zeros((len(table["ends"]), 6, needed.shape[-1]))
    for body, parent, joint, turned in reversed(table["tree"]):
        sign = -1.0 if turned else 1.0
        result[joint] = sign * shift(total[body], geometry.origins[body], geometry.points[joint])
        if parent != GROUND:
            total[parent] += shift(total[body], geometry.origins[body], geometry.origins[parent])
    return result


def on_successor(table: Mapping[str, Any], geometry: Geometry, joint: int, row: Array) -> Array:
    """The wrench (6, k) about S that wrenches on bodies (n_bodies, 6, k) of one equation of a cut joint mean for S."""
    outer, inner = table["ends"][joint]
    body, sign = (inner, 1.0) if inner != GROUND else (outer, -1.0)
    return sign * shift(row[body], geometry.origins[body], geometry.points[joint])


def free_of(table: Mapping[str, Any], joint: int) -> list[int]:
    """Numbers of the free directions of a joint."""
    return [i for i, owner in enumerate(table["columns"]) if owner == joint]


def along_free(free: Array, wrench: Array) -> tuple[Array, Array]:
    """Split a wrench at S into the generalized forces along the free directions and the wrench that makes them.

    Directions that turn are driven by a torque, those that only slide by a force.

    Parameters
    ----------
    free : (n, 6, k) array
        (linear, angular).
    wrench : (6, k) array

    Returns
    -------
    forces : (n, k) array
    wrench : (6, k) array
    """
    directions = np.moveaxis(free, -1, 0)  # (k, n, 6)
    forces = np.einsum("knj,jk->kn", directions, wrench)
    size = np.abs(directions).max(initial=0.0)
    turning = np.abs(directions[:, :, 3:]).max(axis=(0, 2)) > UNMOVED * size
    slides, turns = directions[:, ~turning, :3], directions[:, turning, 3:]
    force = algebra.pinv(slides) @ forces[:, ~turning, None] if slides.size else np.zeros((len(forces), 3, 1))
    rest = forces[:, turning, None] - directions[:, turning, :3] @ force
    torque = algebra.pinv(turns) @ rest if turns.size else np.zeros((len(forces), 3, 1))
    return forces.T, np.concatenate([force, torque], axis=1)[:, :, 0].T


# -- self-stress -------------------------------------------------------------------------------------------------------

# Rigid bodies do not tell how a self-stress, a set of reactions that balance each other on every body, is shared out
# (J. Garcia de Jalon, M.D. Gutierrez-Lopez, Multibody dynamics with redundant constraints and singular mass matrix,
# Multibody System Dynamics 30 (2013), 311-341; M. Wojtyra, Joint reactions in rigid body mechanisms with dependent
# constraints, Mechanism and Machine Theory 44 (2009), 2265-2278).  All joints are taken into account, with the
# equations that the mechanism's symmetry makes vanish, so that it does not matter where loops were cut.


def bases(table: Mapping[str, Any], geometry: Geometry, length: float) -> list[Array]:
    """Orthonormal columns (k, 6, r) of the wrenches that each joint can exert at S, moments in units of the length.

    A state in which there are fewer than in others has columns of zeros.
    """
    result = []
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
        result.append(np.swapaxes(columns, 1, 2))
    return result


def _per(length: float) -> Array:
    """Factors that take a wrench to one in units of force."""
    return np.array([1.0, 1.0, 1.0, 1.0 / length, 1.0 / length, 1.0 / length])


def element_wrenches(states: ProjectedStates, table: Mapping[str, Any], geometry: Geometry) -> Array:
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
            free = free_of(table, joint)
            if not free:
                continue
            forces, _ = along_free(geometry.free[free], passed[joint])
            rest = C_q[:, e, [table["velocities"][i] for i in free]].T - forces
            couple = _driving(geometry.free[free], rest)
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
    states: ProjectedStates, table: Mapping[str, Any], geometry: Geometry, reactions: Array, multipliers: Array
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
    table: Mapping[str, Any], geometry: Geometry, joints: Sequence[Array], elements: Array, length: float
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
    result, rest = [], []
    for joint, B in enumerate(joints):
        if joint in cut:
            n = cut.index(joint)
            result.append(np.broadcast_to(np.eye(width)[starts[n] : starts[n + 1]], (count, B.shape[2], width)))
        else:
            scaled = np.moveaxis(passed[joint] * per[:, None, None], 1, 0)
            along = np.swapaxes(B, 1, 2) @ scaled
            result.append(along)
            rest.append(scaled - B @ along)
    result.append(np.broadcast_to(np.eye(width)[starts[-2] :], (count, len(elements), width)))
    stresses = np.concatenate(result, axis=1)
    Q = algebra.qr(np.concatenate([stresses, *rest], axis=1))[0]
    n = stresses.shape[1]
    _, missing, Vt = algebra.svd(algebra.qr(Q[:, n:])[1])
    null = np.ones(Vt.shape[:2], dtype=bool)
    null[:, : missing.shape[1]] = missing <= RANK
    return (Vt * null[:, :, None]) @ np.swapaxes(Q[:, :n], 1, 2)


CHUNK = 4_000_000  #: numbers held at once


def find_reactions(
    states: ProjectedStates,
    a: Array | None = None,
    multipliers: Array | None = None,
    drives: Mapping[int, Array] | None = None,
) -> tuple[Array, Array]:
    """Reactions (n_joints, 6, k) and which are undetermined (n_joints, 6, k).

    ``drives`` are further forces (k,) along coordinates of cut joints, by their number.
    """
    module, drives = states.module, drives or {}
    a = states.accelerations() if a is None else a
    if multipliers is None:
        multipliers = solve_multipliers(states.jacobian(), states.residual(a), module.layout.scales)
    width = max(1, CHUNK // max(1, module.layout.sizes.n_wrench_geometry, (6 * len(joint_table(module)["ends"])) ** 2))
    parts = []
    for k in range(0, len(states.t), width):
        some = slice(k, k + width)
        x, now, multipliers_here = (np.ascontiguousarray(y[:, some]) for y in (states.x, a, multipliers))
        loads = {number: force[some] for number, force in drives.items()}
        parts.append(_reactions(states._replace(t=states.t[some], x=x), now, multipliers_here, loads))
    return np.concatenate([r for r, _ in parts], axis=-1), np.concatenate([m for _, m in parts], axis=-1)


def _reactions(
    states: ProjectedStates, a: Array, multipliers: Array, drives: Mapping[int, Array]
) -> tuple[Array, Array]:
    module = states.module
    table, geometry = joint_table(module), place(states)
    flat = states.evaluate(module.kernels.needed_wrenches, states.q, states.v, a)
    every = flat.reshape(-1, 6, len(states.t))
    needed = every[: module.n_bodies] + np.einsum("ck,cbik->bik", multipliers, geometry.rows)
    loads = dict(zip(table["cut"], every[module.n_bodies :], strict=True))
    for number, force in drives.items():
        joint, load = table["loops"][number], force * geometry.loops[number]
        loads[joint] = loads[joint] + load
        for body, sign in zip(table["ends"][joint], (1.0, -1.0), strict=True):
            if body != GROUND:
                needed[body] += sign * shift(load, geometry.points[joint], geometry.origins[body])
    result = transmitted(table, geometry, needed)
    for joint, load in loads.items():
        result[joint] += load
    for row, joint in enumerate(table["rows"]):
        if joint != GROUND:
            result[joint] -= multipliers[row] * on_successor(table, geometry, joint, geometry.rows[row])
    for joint in range(len(result)):
        free = free_of(table, joint)
        if free:
            result[joint] -= along_free(geometry.free[free], result[joint])[1]
    if not module.n_rows and not table["cut"]:
        return result, np.zeros(result.shape, dtype=bool)
    return remove_self_stress(states, table, geometry, result, multipliers)


@np.errstate(all="ignore")
def reactions(
    module: BoundModel, /, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None, out: Array | None = None
) -> Array:
    """Compute the reaction forces and moments of all joints.

    Parameters
    ----------
    t, x, p, u, out
        As for :meth:`multipliers`.

    Returns
    -------
    (n_joints, 6) or (n_joints, 6, k) array
        Per joint of ``joint_names`` the force (N) and moment (N m) ``[Fx Fy Fz Mx My Mz]`` that the predecessor
        exerts on the successor at the successor's marker, in ground axes.  Reactions do no work in the motion the
        joint allows: forces of drives, friction, springs and couplings along its coordinates are not in them
        (they act as torques where a coordinate turns, as forces where it slides).

    Raises
    ------
    UsageError
        A wrong shape, or a model without bodies.

    Notes
    -----
    Where constraints are redundant, rigid bodies do not determine all of it: see :meth:`undetermined_reactions`.
    Returned are then the reactions with the smallest sum of squares of all joints' forces and of their moments
    divided by the model's length, wherever loops are cut.
    """
    joint_table(module)
    return evaluate(lambda states: find_reactions(states)[0], module, t, x, p, u, out)


@np.errstate(all="ignore")
def undetermined_reactions(module: BoundModel, /, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None) -> Any:
    """Tell which components of :meth:`reactions` are undetermined, because constraints are redundant.

    Returns
    -------
    (n_joints, 6) or (n_joints, 6, k) array of bool
    """
    joint_table(module)
    return evaluate(lambda states: find_reactions(states)[1], module, t, x, p, u)


@np.errstate(all="ignore")
def driving_forces(module: BoundModel, /, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None) -> dict[str, Array]:
    """Compute the generalized forces that constraint elements (drivers, gears, rolling, ...) exert, by name.

    Returns
    -------
    dict
        Name of the element, or ``<name>.<row>`` where it has several rows, -> force or (k,) forces: the power they
        bring in is the force times the rate of the row's left side, so that a driver that holds ``theta - f(t)``
        at 0 exerts this torque along ``theta``.
    """
    table, values = joint_table(module), -multipliers(module, t, x, p, u)
    labels = [label for label, joint in zip(module.layout.constraint_labels, table["rows"], strict=True) if joint < 0]
    names = [label.partition(".")[0] for label in labels]
    result: dict[str, Array] = {}
    for row, (label, joint) in enumerate(zip(module.layout.constraint_labels, table["rows"], strict=True)):
        if joint < 0:
            name = label.partition(".")[0]
            result[name if names.count(name) == 1 else label] = values[row]
    return result
