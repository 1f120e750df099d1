"""Analysis: gaps with friction and their sliding velocities -> refused where they are no distances and their rates.

Friction compares the impulses along both, so a gap written at half its size would have twice the friction.  A distance
changes by n . d where a body moves by d without turning, with n of length 1; so do places along the surface.  The
sliding joints of an open tree move bodies in this way: the parts of n along their directions are known, and together
they are no longer than 1, and just as long where the directions span space.  Of closed loops, whose coordinates depend
on each other, and of directions that span less, a gap that is too small is not told.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.constraints import MEASURED
from ..errors import cannot
from ..numeric.ranks import rank
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
    layout = module.layout
    joints = layout.metadata.get("translations", ())
    rubs = np.flatnonzero(sliding.coefficients[sliding.owner] > 0.0)
    depend = layout.n_c or layout.metadata.get("held_rows")  # coordinates, on each other
    if not joints or not rubs.size or depend or "poses" not in module.kernels.core.names:
        return
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
            D = _directions(module, t, q, joints[j][2], places)
            lengths = np.linalg.norm(algebra.lstsq(D, rows[:, places].T, rcond=MEASURED), axis=0)
            exact = rank(D).rank == 3
            for what, length in zip(said, lengths.tolist(), strict=True):
                if length > 1.0 + MEASURED or (exact and MEASURED < length < 1.0 - MEASURED):
                    raise cannot(
                        f"{what} changes by {length:.6g} for each unit of length by which joint {name} moves along it: "
                        "friction compares the impulses along the gap and along its sliding velocity, so the gap must "
                        f"be the distance and the velocity that of its place; divide it by {length:.6g}"
                        f"{'' if exact else ', or more where they move askew'}"
                    )


def _directions(module: BoundModel, t: float, q: Array, body: int, places: Sequence[int]) -> Array:
    """Directions (k, 3) in which velocities at some places move a body; a difference over a length is exact here."""
    scales = module.layout.scales
    units = np.eye(module.layout.n_v)[list(places)]
    ends = np.stack([scales.move(q, side * e) for e in units for side in (0.5, -0.5)])
    origins = np.asarray(module.poses(np.ascontiguousarray(ends.T), t=t))[body, :3, 3]
    return np.asarray((origins[:, ::2] - origins[:, 1::2]) / scales.q[list(places)]).T
