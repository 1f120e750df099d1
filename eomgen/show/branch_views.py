"""Stage show, views: the positions of branches -> from where and by which coordinates they are told apart."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ..base.algebra import Array
from ..base.limits.pictures import NOTHING, SEEN
from .plane import page_axes
from .scene import Scene

ELEVATION, AZIMUTH = 22.0, -58.0  #: of the eye (degrees), from the axis that runs to the right
ELEVATIONS = (10.0, ELEVATION, 35.0, 50.0, 65.0)  #: that are tried
AZIMUTHS = 24
SOLID = ("shape", "link", "block", "joint")  #: roles of which the points are compared
GOOD = 0.7  #: part of the best view's difference with which the usual view is kept
MOST = 3  #: coordinates in a title


def usual_view(scene: Scene) -> tuple[float, float]:
    """Elevation and azimuth of the eye (degrees) before a spatial mechanism."""
    vertical, right = page_axes(scene.up)
    # matplotlib counts azimuths from the axis after the vertical one
    return ELEVATION, AZIMUTH if right == (vertical + 1) % 3 else 90.0 + AZIMUTH


def toward_eye(scene: Scene, elevation: float, azimuth: float) -> Array:
    """Unit vector (3,) from a mechanism to the eye, in ground axes."""
    vertical, right = page_axes(scene.up)
    e, a = np.radians([elevation, azimuth])
    toward = np.empty(3)
    toward[[(vertical + 1) % 3, (vertical + 2) % 3, vertical]] = np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)
    if scene.up[vertical] < 0.0:  # these axes are turned round
        toward[[vertical, 3 - vertical - right]] *= -1.0
    return toward


def telling_view(scenes: Sequence[Scene]) -> tuple[float, float]:
    """Elevation and azimuth from which the branches that look most alike differ most; the usual one if it is as good.

    Two branches differ by the mean distance between the same points of their drawings, seen from far away, as a part of
    that in space.  Those that differ in angles alone and have all bodies in one place look alike from everywhere.
    """
    usual = usual_view(scenes[0])
    if len(scenes) < 2:
        return usual
    moving = [
        np.vstack([s.frames[0, :, :3, 3], *(item.at(s.frames[0]) for item in s.items if item.role in SOLID)])
        for s in scenes
    ]
    if len({len(points) for points in moving}) > 1:
        return usual
    size = float(np.ptp(moving[0], axis=0).max())
    apart = [(one - other, _mean(one - other)) for one, other in combinations(moving, 2)]
    apart = [(way, far) for way, far in apart if far > SEEN * size]
    if not apart:
        return usual

    def difference(view: tuple[float, float]) -> float:
        n = toward_eye(scenes[0], *view)
        return min(_mean(way - np.outer(way @ n, n)) / far for way, far in apart)

    best = max(((e, usual[1] + 360.0 * k / AZIMUTHS) for e in ELEVATIONS for k in range(AZIMUTHS)), key=difference)
    return usual if difference(usual) >= GOOD * difference(best) else best


def _mean(ways: Array) -> float:
    return float(np.linalg.norm(ways, axis=1).mean())


def telling_values(names: Sequence[str], positions: Sequence[Array]) -> list[str]:
    """Of each position, the values of the coordinates that differ most between all, as a line of a title."""
    every = np.array(positions)
    spread = np.ptp(every, axis=0) / np.maximum(np.abs(every).max(axis=0), NOTHING)
    chosen = [k for k in np.argsort(-spread, kind="stable")[:MOST] if spread[k] > SEEN]
    return [", ".join(f"{names[k]} = {q[k]:.3g}" for k in sorted(chosen)) for q in every]
