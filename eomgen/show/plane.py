"""Stage show, plane: poses of a mechanism -> the plane in which it moves, and how a page lies in it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.pictures import NOTHING, SAME

TRIALS = 6  #: positions that are looked at
ROUNDING = SAME  #: relative size of what is rounding and not motion


def find_view(poses: Callable[[Array], Array], q: Array, quaternions: list[int], gravity: Array) -> Array | None:
    """Axes of a page (3, 3), rows right, up and towards the reader in ground axes; None of a spatial mechanism.

    Positions of the tree are drawn at random, loops open: every motion that the joints have shows.

    Parameters
    ----------
    poses : callable
        q (n_q, k) -> (n_bodies, 4, 4, k).
    q : (n_q,) array
    quaternions : list of int
        First of each four Euler parameters.
    gravity : (3,) array
    """
    random = np.random.default_rng(0)
    trial = q[:, None] + random.uniform(-1.0, 1.0, (len(q), TRIALS))
    for i in quaternions:
        trial[i : i + 4] /= np.linalg.norm(trial[i : i + 4], axis=0)
    first = poses(q[:, None])[..., 0]
    moved = poses(trial)
    if not np.isfinite(moved).all():
        return None
    travel = moved[:, :3, 3] - first[:, :3, 3, None]
    turns = np.einsum("bijk,blj->bilk", moved[:, :3, :3], first[:, :3, :3])  # relative rotation
    size = max(float(np.abs(travel).max(initial=0.0)), NOTHING)
    # the normal n has n . travel = 0 and R n = n
    rows = [(travel / size).transpose(0, 2, 1).reshape(-1, 3)]
    rows.append((turns.transpose(0, 3, 1, 2) - np.eye(3)).reshape(-1, 3))
    stacked = np.vstack(rows)
    candidates = [np.eye(3)[k] for k in (2, 1, 0)]
    strength = float(np.linalg.norm(gravity))
    if strength:  # a page on which things fall is better than one on which they do not
        candidates.sort(key=lambda n: abs(float(n @ gravity)) > ROUNDING * strength)
    axes = algebra.svd(stacked, full_matrices=True)[2]
    candidates.append(axes[2])
    for n in candidates:
        if float(np.abs(stacked @ n).max(initial=0.0)) <= 1e3 * ROUNDING:
            return _page(n, gravity)
    return None


def _page(normal: Array, gravity: Array) -> Array:
    """Right, up and towards the reader, for a normal in ground axes."""
    up = None
    strength = float(np.linalg.norm(gravity))
    along_axis = strength > 0.0 and float(np.abs(gravity).max()) > (1.0 - ROUNDING) * strength
    if along_axis and abs(float(normal @ gravity)) < ROUNDING * strength:
        up = -gravity / strength
    if up is None:
        k = int(np.argmax(np.abs(normal)))
        up = np.eye(3)[1 if k == 2 else 2]
        up = up - (up @ normal) * normal
        up /= np.linalg.norm(up)
    right = np.cross(up, normal)
    if right[int(np.argmax(np.abs(right)))] < 0.0:
        right = -right
    return np.array([right, up, np.cross(right, up)])


def page_axes(up: Array) -> tuple[int, int]:
    """Of a picture in space: the axis that is nearest to the vertical, and the one that runs to the right."""
    vertical = int(np.argmax(np.abs(up)))
    return vertical, 1 if vertical == 0 else 0
