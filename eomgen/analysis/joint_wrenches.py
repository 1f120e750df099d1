"""Analysis: states and wrenches across the tree's joints -> wrenches on successors, and what joints leave free."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.constraints import UNMOVED
from ..errors import cannot
from ..runtime.constrained import ProjectedStates

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


GROUND = -1


class Geometry(NamedTuple):
    """Placement of joints and bodies for k states; the last axis counts states."""

    rows: Array  #: (n_c, n_bodies, 6, k) D: the wrench -l D on each body, about its origin
    points: Array  #: (n_joints, 3, k) S of each joint
    free: Array  #: (n_f, 6, k) free directions (linear, angular) at S
    reach: Array  #: (n_r, 6, k) gradients of the equations of joints without coordinates, at S
    loops: Array  #: (n_loop_coordinates, 6, k) gradients of the coordinates of cut joints, at S
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
        raise cannot(
            f"model {module.name!r} has no joints between bodies, so there are no reactions; "
            "multipliers(t, x) gives the forces of its constraint equations"
        )
    return table


def place(states: ProjectedStates) -> Geometry:
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
