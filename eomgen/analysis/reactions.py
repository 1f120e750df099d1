"""Analysis: states -> the wrenches that joints transmit, and which of them rigid bodies leave undetermined.

What every body needs (Newton, Euler) less what the constraint equations exert on it is summed from the tips of the
tree to ground (Featherstone, RBDA, sec. 5.3); what does work along a joint's free directions belongs to drives, not to
its reaction.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import UsageError
from ..limits.constraints import UNMOVED
from ..numeric import algebra
from ..numeric.scales import Array
from .constrained import States, evaluate, prepare, solve_multipliers

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

CHUNK = 4_000_000  #: numbers held at once
GROUND = -1


class Geometry(NamedTuple):
    """Placement of joints and bodies for k states; the last axis counts states."""

    rows: Array  #: (n_c, n_bodies, 6, k) D: the wrench -l D on each body, about its origin
    points: Array  #: (n_joints, 3, k) S of each joint
    free: Array  #: (n_f, 6, k) free directions (linear, angular) at S
    reach: Array  #: (n_r, 6, k) gradients of the equations of joints without coordinates, at S
    loops: Array  #: (n_k, 6, k) gradients of the coordinates of cut joints, at S
    origins: Array  #: (n_bodies, 3, k)


def joint_table(module: BoundModel) -> dict[str, Any]:
    """What the model's metadata says of its joints.

    Raises
    ------
    UsageError
        There are no bodies, or the model was generated without these kernels.
    """
    table: dict[str, Any] | None = module.metadata.get("wrenches")
    if table is None:
        raise UsageError(
            f"model {module.name!r} has no joints between bodies, so there are no reactions; "
            "multipliers(t, x) gives the forces of its constraint equations"
        )
    return table


def place(states: States) -> Geometry:
    """Evaluate the geometry."""
    module, table = states.module, joint_table(states.module)
    k, n_c, n_b = len(states.t), module.n_rows, module.n_bodies
    flat = states.evaluate(module.kernels.state("wrench_geometry"), states.q)
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


def transmitted(table: dict[str, Any], geometry: Geometry, needed: Array) -> Array:
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


def on_successor(table: dict[str, Any], geometry: Geometry, joint: int, row: Array) -> Array:
    """The wrench (6, k) about S that wrenches on bodies (n_bodies, 6, k) of one equation of a cut joint mean for S."""
    outer, inner = table["ends"][joint]
    body, sign = (inner, 1.0) if inner != GROUND else (outer, -1.0)
    return sign * shift(row[body], geometry.origins[body], geometry.points[joint])


def free_of(table: dict[str, Any], joint: int) -> list[int]:
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


def find_reactions(
    states: States,
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
    width = max(1, CHUNK // max(1, module.layout.n_w, (6 * len(joint_table(module)["ends"])) ** 2))
    parts = []
    for k in range(0, len(states.t), width):
        some = slice(k, k + width)
        x, now, own = (np.ascontiguousarray(y[:, some]) for y in (states.x, a, multipliers))
        loads = {number: force[some] for number, force in drives.items()}
        parts.append(_reactions(states._replace(t=states.t[some], x=x), now, own, loads))
    return np.concatenate([r for r, _ in parts], axis=-1), np.concatenate([m for _, m in parts], axis=-1)


def _reactions(states: States, a: Array, multipliers: Array, drives: Mapping[int, Array]) -> tuple[Array, Array]:
    module = states.module
    table, geometry = joint_table(module), place(states)
    flat = states.evaluate(module.kernels.motion("needed_wrenches"), states.q, states.v, a)
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
        own = free_of(table, joint)
        if own:
            result[joint] -= along_free(geometry.free[own], result[joint])[1]
    if not module.n_rows and not table["cut"]:
        return result, np.zeros(result.shape, dtype=bool)
    from .self_stress import remove_self_stress

    return remove_self_stress(states, table, geometry, result, multipliers)


@np.errstate(all="ignore")
def reactions(
    module: BoundModel, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None, out: Array | None = None
) -> Array:
    """Reaction forces and moments of all joints.

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
def undetermined_reactions(module: BoundModel, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None) -> Any:
    """Which components of :meth:`reactions` redundant constraints leave undetermined.

    Returns
    -------
    (n_joints, 6) or (n_joints, 6, k) array of bool
    """
    joint_table(module)
    return evaluate(lambda states: find_reactions(states)[1], module, t, x, p, u)


@np.errstate(all="ignore")
def driving_forces(module: BoundModel, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None) -> dict[str, Array]:
    """Generalized forces that constraint elements (drivers, gears, rolling ...) exert, by name.

    Returns
    -------
    dict
        Name of the element, or ``<name>.<row>`` where it has several rows, -> force or (k,) forces: the power they
        bring in is the force times the rate of the row's left side, so that a driver that holds ``theta - f(t)``
        at 0 exerts this torque along ``theta``.
    """
    states = prepare(module, t, x, p, u)
    table = joint_table(module)
    values = states.shaped(
        -solve_multipliers(states.jacobian(), states.residual(states.accelerations()), module.layout.scales)
    )
    labels = [label for label, joint in zip(module.layout.constraint_labels, table["rows"], strict=True) if joint < 0]
    names = [label.partition(".")[0] for label in labels]
    result: dict[str, Array] = {}
    for row, (label, joint) in enumerate(zip(module.layout.constraint_labels, table["rows"], strict=True)):
        if joint < 0:
            name = label.partition(".")[0]
            result[name if names.count(name) == 1 else label] = values[row]
    return result
