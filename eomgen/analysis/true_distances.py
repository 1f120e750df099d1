"""Analysis: gaps with friction and their sliding velocities -> refused where they are no distances and their rates.

Friction compares the impulses along both, so a gap written at half its size would have twice the friction.  A distance
changes by n . d where a body moves by d without turning, with n of length 1; so do places along the surface.  The
sliding joints of the tree move bodies in this way: the parts of n along their directions are known, and together they
are no longer than 1, or just as long where the directions are all there are: in space, or in a plane mechanism.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..errors import UsageError
from ..limits.constraints import MEASURED
from ..numeric import algebra
from ..numeric.scales import Array
from .impact_friction import Sliding

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


def require_distances(
    module: BoundModel, t: float, q: Array, normals: Array, names: Sequence[str], sliding: Sliding
) -> None:
    """Refuse gaps with friction whose derivatives (n, n_v) by velocities are not those of distances.

    Raises
    ------
    UsageError
    """
    joints = module.layout.metadata.get("translations", ())
    rubs = np.flatnonzero(sliding.coefficients[sliding.owner] > 0.0)
    if not joints or not rubs.size or "poses" not in module.kernels.core.names:
        return
    moves, spins = _motions(module, t, q)
    for gap in sorted({*sliding.owner[rubs].tolist()}):
        own = [k for k in rubs.tolist() if sliding.owner[k] == gap]
        rows = np.vstack([normals[gap], sliding.rows[own]])
        said = [f"gap {names[gap]}", *(f"sliding velocity {sliding.names[k]}" for k in own)]
        crossed = [np.abs(rows[:, places]).max(initial=0.0) > MEASURED for _, _, _, places in joints]
        for j in np.flatnonzero(crossed).tolist():
            chain, name = [j], joints[j][0]
            while (inner := joints[chain[-1]][1]) >= 0:
                chain.append(inner)
            places = [k for i in chain if crossed[i] for k in joints[i][3]]
            D = moves[joints[j][2]][places]
            lengths = np.linalg.norm(algebra.lstsq(D, rows[:, places].T, rcond=MEASURED), axis=0)
            exact = _is_whole(D, moves, spins)
            for what, length in zip(said, lengths.tolist(), strict=True):
                if length > 1.0 + MEASURED or (exact and MEASURED < length < 1.0 - MEASURED):
                    raise UsageError(
                        f"{what} changes by {length:.6g} for each unit of length by which joint {name} moves along it: "
                        "friction compares the impulses along the gap and along its sliding velocity, so the gap must "
                        f"be the distance and the velocity that of its place; divide it by {length:.6g}"
                    )


def _motions(module: BoundModel, t: float, q: Array) -> tuple[Array, Array]:
    """Velocities of the origins of all bodies (n_bodies, n_v, 3) and their angular velocities by each velocity."""
    scales, moving = module.layout.scales, module.layout.n_v - len(module.layout.states)
    step = MEASURED
    ends = np.stack([scales.move(q, side * step * e) for e in np.eye(module.layout.n_v)[:moving] for side in (1, -1)])
    poses = np.moveaxis(np.asarray(module.poses(np.ascontiguousarray(ends.T), t=t)), -1, 0)
    change = (poses[::2] - poses[1::2]) / (2.0 * step * scales.q[:moving, None, None, None])
    turned = change[..., :3, :3] @ np.swapaxes(poses[::2, :, :3, :3], -1, -2)
    spins = np.stack([turned[..., 2, 1], turned[..., 0, 2], turned[..., 1, 0]], axis=-1)
    return np.swapaxes(change[..., :3, 3], 0, 1), np.swapaxes(spins, 0, 1)


def _is_whole(D: Array, moves: Array, spins: Array) -> bool:
    """Whether directions (k, 3) are all in which bodies can be touched: of space, or of the plane of all motions."""
    _, sizes, directions = algebra.svd(D)
    rank = int(np.count_nonzero(sizes > MEASURED * sizes[0]))
    if rank != 2:
        return rank == 3
    across = directions[2]
    flat = np.abs(moves @ across).max(initial=0.0) <= MEASURED * np.abs(moves).max(initial=0.0)
    tilted = np.linalg.norm(np.cross(spins, across), axis=-1).max(initial=0.0)
    return bool(flat and tilted <= MEASURED * max(1.0, np.abs(spins).max(initial=0.0)))
