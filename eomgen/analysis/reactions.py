"""Analysis: states -> the wrenches that joints transmit, and which of them rigid bodies leave undetermined.

What every body needs (Newton, Euler) less what the constraint equations exert on it is summed from the tips of the
tree to ground (Featherstone, RBDA, sec. 5.3); what does work along a joint's free directions belongs to drives, not to
its reaction.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..runtime.constrained import ProjectedStates, evaluate, prepare, solve_multipliers
from .joint_wrenches import GROUND, along_free, free_of, joint_table, on_successor, place, shift, transmitted
from .self_stress import remove_self_stress

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

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
    width = max(1, CHUNK // max(1, module.layout.n_wrench_geometry, (6 * len(joint_table(module)["ends"])) ** 2))
    parts = []
    for k in range(0, len(states.t), width):
        some = slice(k, k + width)
        x, now, own = (np.ascontiguousarray(y[:, some]) for y in (states.x, a, multipliers))
        loads = {number: force[some] for number, force in drives.items()}
        parts.append(_reactions(states._replace(t=states.t[some], x=x), now, own, loads))
    return np.concatenate([r for r, _ in parts], axis=-1), np.concatenate([m for _, m in parts], axis=-1)


def _reactions(
    states: ProjectedStates, a: Array, multipliers: Array, drives: Mapping[int, Array]
) -> tuple[Array, Array]:
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
